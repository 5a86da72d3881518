//! The convex solids of a scene's occluders, each with the mesh that bounds it.
//!
//! A building is often modelled without its bottom. If closing the one hole of a mesh gives a convex solid,
//! the mesh blocks like the solid for every viewpoint strictly behind the planes of the hole: a line of sight
//! enters a convex solid once, and not through the hole.

use crate::blocker::Blocker;
use alloc::vec::Vec;
use visibility_core::glam::DVec3;
use visibility_core::scene::{SceneCursor, Triangle};
use visibility_core::{ObjectId, OccluderMesh, Scene};

/// Greatest number of triangles of an open mesh that is tried to be closed.
const OPEN: usize = 64;

/// A convex solid of an occluder.
#[derive(Clone, Debug)]
pub(crate) struct Solid {
    pub(crate) id: ObjectId,
    /// The solid in coordinates of the occluder's mesh: closed and convex.
    pub(crate) mesh: OccluderMesh,
    /// The solid in scene coordinates, which knows the faces that close the hole.
    pub(crate) blocker: Blocker,
    /// Bounds in scene coordinates, doubt included.
    pub(crate) min: DVec3,
    pub(crate) max: DVec3,
}

impl Solid {
    /// Returns whether the closed box between two corners touches the bounds of the solid.
    pub(crate) fn meets(&self, min: DVec3, max: DVec3) -> bool {
        self.min.cmple(max).all() && min.cmple(self.max).all()
    }
}

/// The solids of one scene.
#[derive(Clone, Debug)]
pub(crate) struct Solids {
    cursor: SceneCursor,
    pub(crate) list: Vec<Solid>,
}

impl Solids {
    pub(crate) const fn new() -> Self {
        Self { cursor: SceneCursor::START, list: Vec::new() }
    }

    /// Finds the solids anew if the scene has changed. Returns whether it has.
    pub(crate) fn sync(&mut self, scene: &Scene) -> bool {
        if self.cursor.is_current(scene) {
            return false;
        }
        self.cursor = SceneCursor::at(scene);
        self.list.clear();
        for id in scene.ids() {
            let Some((mesh, transform)) = scene.occluder(id) else { continue };
            for piece in pieces(mesh) {
                let closed;
                let (solid, caps) = if piece.is_convex() {
                    (piece, &[][..])
                } else {
                    let Some(found) = close(piece) else { continue };
                    closed = found;
                    (&closed.0, &closed.1[..])
                };
                let blocker = Blocker::solid(solid, transform, caps);
                let around = [DVec3::INFINITY, DVec3::NEG_INFINITY];
                let [min, max] =
                    blocker.vertices.iter().fold(around, |[min, max], &p| [min.min(p), max.max(p)]);
                if min.is_finite() && max.is_finite() {
                    let (min, max) = (min - blocker.slack, max + blocker.slack);
                    self.list.push(Solid { id, mesh: solid.clone(), blocker, min, max });
                }
            }
        }
        true
    }
}

/// Returns the parts of a mesh, or the mesh itself if it has none.
pub(crate) fn pieces(mesh: &OccluderMesh) -> &[OccluderMesh] {
    if mesh.parts().is_empty() { core::slice::from_ref(mesh) } else { mesh.parts() }
}

/// Closes the hole of an open mesh. Returns the convex solid, and the triangles that close it. `None` if
/// there is not exactly one hole, or the closed mesh is not convex.
pub(crate) fn close(mesh: &OccluderMesh) -> Option<(OccluderMesh, Vec<Triangle>)> {
    if mesh.is_closed() || mesh.triangles().len() > OPEN {
        return None;
    }
    let rim: Vec<[u32; 2]> =
        mesh.edges().iter().filter(|edge| edge.right.is_none()).map(|edge| edge.vertices).collect();
    let mut hole = alloc::vec![rim.first()?[0]];
    for _ in 1..rim.len() {
        let at = *hole.last()?;
        let mut next = rim.iter().filter(|[from, _]| *from == at);
        let to = next.next()?[1];
        if next.next().is_some() || hole.contains(&to) {
            return None;
        }
        hole.push(to);
    }
    let corner = |&[a, b, c]: &[u32; 3]| [a, b, c].map(|i| mesh.positions()[i as usize]);
    let mut triangles: Vec<Triangle> = mesh.triangles().iter().map(corner).collect();
    // The closing faces run along the rim the other way.
    let fan: Vec<Triangle> =
        (1..hole.len().max(2) - 1).map(|i| corner(&[hole[0], hole[i + 1], hole[i]])).collect();
    triangles.extend(&fan);
    let closed = OccluderMesh::from_triangles(&triangles).ok()?;
    closed.is_convex().then_some((closed, fan))
}
