//! The convex solids of a scene's occluders, with their meshes.
//!
//! Buildings are often modelled without a bottom. If closing the one hole of a mesh makes it a convex solid,
//! the mesh occludes like the solid for every viewpoint strictly behind the planes of the hole: a line of
//! sight enters a convex solid once, and from there not through the hole.

use crate::blocker::{Blocker, dents};
use alloc::vec::Vec;
use visibility_core::bits::Bits;
use visibility_core::glam::DVec3;
use visibility_core::scene::{Changes, SceneCursor, Triangle};
use visibility_core::{ObjectId, OccluderMesh, Scene, VisibleSet};

/// Greatest number of triangles that a mesh may have for its hole to be closed.
const OPEN: usize = 64;

/// A convex solid that is an occluder's mesh or a part of it.
#[derive(Clone, Debug)]
pub(crate) struct Solid {
    pub(crate) id: ObjectId,
    /// The solid in coordinates of the occluder's mesh, closed and convex.
    #[cfg(feature = "papers")]
    pub(crate) mesh: OccluderMesh,
    /// The solid in scene coordinates. Its `caps` are triangles that close the hole of an open mesh.
    pub(crate) blocker: Blocker,
    /// Least corner of the solid's bounds in scene coordinates, widened by the error of vertices.
    pub(crate) min: DVec3,
    /// Greatest corner of the solid's bounds in scene coordinates, widened by the error of vertices.
    pub(crate) max: DVec3,
}

#[cfg(feature = "papers")]
impl Solid {
    /// Returns whether the box from `min` to `max` and the bounds of the solid meet or touch.
    pub(crate) fn meets(&self, min: DVec3, max: DVec3) -> bool {
        self.min.cmple(max).all() && min.cmple(self.max).all()
    }
}

/// The solids of one scene.
#[derive(Clone, Debug)]
pub(crate) struct Solids {
    cursor: SceneCursor,
    /// Indices of the objects that were occluders when `list` was made.
    occluders: Bits,
    pub(crate) list: Vec<Solid>,
}

impl Solids {
    pub(crate) const fn new() -> Self {
        Self { cursor: SceneCursor::START, occluders: Bits::EMPTY, list: Vec::new() }
    }

    /// Finds the solids again if occluders of the scene have changed. Returns whether any has.
    pub(crate) fn sync(&mut self, scene: &Scene) -> bool {
        if !occluders_changed(&mut self.cursor, scene, &self.occluders) {
            return false;
        }
        self.list.clear();
        self.occluders.reset(scene.index_limit());
        for id in scene.ids() {
            let Some((mesh, ref transform)) = scene.occluder(id) else { continue };
            self.occluders.insert(id.index());
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
                // Without faces, a flattened solid would count as all of space.
                if min.is_finite() && max.is_finite() && !blocker.faces.is_empty() {
                    let (min, max) = (min - blocker.slack, max + blocker.slack);
                    self.list.push(Solid {
                        id,
                        #[cfg(feature = "papers")]
                        mesh: solid.clone(),
                        blocker,
                        min,
                        max,
                    });
                }
            }
        }
        true
    }
}

/// Returns the indices of the objects that may occlude: the candidates that are flagged as occluders (see
/// [`VisibleSet::for_each_occluder`]), have a mesh, and are [always drawn](Scene::is_always_drawn).
pub(crate) fn occluding(scene: &Scene, visible: &VisibleSet) -> Bits {
    let mut bits = Bits::new(scene.index_limit());
    visible.for_each_occluder(scene, |id| {
        if scene.occluder(id).is_some() && scene.is_always_drawn(id) {
            bits.insert(id.index());
        }
    });
    bits
}

/// Moves a cursor to the present state of a scene. Returns whether an object that is or was an occluder has
/// changed since the cursor's former state. `known` are the indices of the occluders at that state.
pub(crate) fn occluders_changed(cursor: &mut SceneCursor, scene: &Scene, known: &Bits) -> bool {
    match cursor.follow(scene) {
        Changes::Everything => true,
        Changes::Objects(ids) => {
            ids.iter().any(|&id| known.contains(id.index()) || scene.occluder(id).is_some())
        }
    }
}

/// Returns the parts of a mesh, or the mesh itself if it is not divided into parts.
pub(crate) fn pieces(mesh: &OccluderMesh) -> &[OccluderMesh] {
    if mesh.parts().is_empty() { core::slice::from_ref(mesh) } else { mesh.parts() }
}

/// Closes the hole of an open mesh. Returns the convex solid, and the triangles that close the hole (caps),
/// without slivers. `None` if the mesh has more than [`OPEN`] triangles or not exactly one hole, if the
/// closed mesh is not convex, or if a sliver is not in the plane of a cap.
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
    // The closing triangles run along the hole's rim in the opposite direction.
    let fan: Vec<Triangle> =
        (1..hole.len().max(2) - 1).map(|i| corner(&[hole[0], hole[i + 1], hole[i]])).collect();
    triangles.extend(&fan);
    let closed = OccluderMesh::from_triangles(&triangles).ok()?;
    let caps = caps(&fan, &closed)?;
    closed.is_convex().then_some((closed, caps))
}

/// Returns the triangles of `fan` that are not slivers (triangles of nearly no area). `None` if a sliver is
/// not in the plane of a returned triangle.
///
/// Slivers can be left out since the blocker is used only for viewpoints strictly behind the planes of all
/// caps. A line of sight from there does not enter the solid through a cap. A sliver is off the plane of some
/// cap by at most the depth of the solid's dents. A line that enters through the sliver stays as close to
/// that plane inside the solid, since the solid does not reach beyond the plane. So the line misses the solid
/// without its dents, and only the solid without its dents counts as blocking.
fn caps(fan: &[Triangle], solid: &OccluderMesh) -> Option<Vec<Triangle>> {
    let normal = |t: &Triangle| {
        let [a, b, c] = t.map(|p| p.as_dvec3());
        (b - a).cross(c - a)
    };
    let is_wide = |t: &&Triangle| {
        let [a, b, c] = t.map(|p| p.as_dvec3());
        normal(t).length() > 1e-4 * (b - a).length_squared().max((c - a).length_squared())
    };
    let size = solid.bounds().min.abs().max(solid.bounds().max.abs()).max_element();
    let slack = dents(solid) * f64::from(size);
    let (wide, slivers): (Vec<&Triangle>, Vec<&Triangle>) = fan.iter().partition(is_wide);
    let is_in_plane = |t: &Triangle, plane: &Triangle| {
        let (normal, anchor) = (normal(plane), plane[0].as_dvec3());
        t.iter().all(|p| normal.dot(p.as_dvec3() - anchor).abs() <= slack * normal.length())
    };
    let is_covered = |t: &&Triangle| wide.iter().any(|plane| is_in_plane(t, plane));
    (!wide.is_empty() && slivers.iter().all(is_covered)).then(|| wide.into_iter().copied().collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec;
    use visibility_core::glam::Vec3;

    /// Returns the walls and the roof of a house without a bottom. One wall has a slit at the foot of its
    /// corner, `width` wide and `height` high.
    fn house(width: f32, height: f32) -> Vec<Triangle> {
        let floor = |x: f32, y: f32| Vec3::new(x, y, 0.0);
        let up = |p: Vec3| p + Vec3::Z * 9.0;
        let [a, b, c, d] = [floor(0.0, 0.0), floor(4.0, 0.0), floor(4.0, 4.0), floor(0.0, 4.0)];
        let (p, s) = (floor(4.0 - width, 0.0), Vec3::new(4.0 - width, 0.0, height));
        let wall = |a: Vec3, b: Vec3| [[a, b, up(b)], [a, up(b), up(a)]];
        let front = [[a, p, s], [a, s, up(a)], [s, up(b), up(a)], [s, b, up(b)]];
        let walls = [wall(b, c), wall(c, d), wall(d, a), [[up(a), up(b), up(c)], [up(a), up(c), up(d)]]];
        front.into_iter().chain(walls.into_iter().flatten()).collect()
    }

    #[test]
    fn a_slit_at_the_foot_of_a_house_is_open() {
        let mut closed = 0;
        for (width, height) in [(1.0, 3.0), (1e-3, 3.0), (3e-4, 8.0), (1e-5, 1.0)] {
            let triangles = house(width, height);
            // The order of the triangles decides at which corner the fan starts that closes the hole.
            for first in 0..3 * triangles.len() {
                let mut triangles = triangles.clone();
                triangles.rotate_left(first / 3);
                triangles[0].rotate_left(first % 3);
                let mesh = OccluderMesh::from_triangles(&triangles).unwrap();
                let Some((_, caps)) = close(&mesh) else { continue };
                closed += 1;
                let is_in_slit = |cap: &Triangle| cap.iter().all(|p| p.y == 0.0);
                assert!(caps.iter().any(is_in_slit), "{width} x {height}, from {first}: {caps:?}");
            }
        }
        assert!(closed > 0, "no house with a slit was closed");
    }

    #[test]
    fn slivers_are_dropped_in_the_plane_of_a_cap_only() {
        let p = |x: f32, y: f32, z: f32| Vec3::new(x, y, z);
        let solid = OccluderMesh::from_triangles(&[
            [p(0.0, 0.0, 0.0), p(0.0, 4.0, 0.0), p(4.0, 0.0, 0.0)],
            [p(0.0, 0.0, 0.0), p(4.0, 0.0, 0.0), p(0.0, 0.0, 4.0)],
            [p(0.0, 0.0, 0.0), p(0.0, 0.0, 4.0), p(0.0, 4.0, 0.0)],
            [p(4.0, 0.0, 0.0), p(0.0, 4.0, 0.0), p(0.0, 0.0, 4.0)],
        ]);
        let solid = solid.unwrap();
        let bottom = [p(0.0, 0.0, 0.0), p(0.0, 4.0, 0.0), p(4.0, 0.0, 0.0)];
        let sliver = |z: f32| [p(0.0, 0.0, 0.0), p(4.0, 0.0, 0.0), p(4.0, 1e-5, z)];
        assert_eq!(
            caps(&[bottom, sliver(0.0)], &solid),
            Some(vec![bottom]),
            "the sliver in the plane of the cap is dropped"
        );
        assert_eq!(caps(&[sliver(1e-6), bottom], &solid), Some(vec![bottom]), "as deep as the dents may be");
        assert_eq!(caps(&[bottom, sliver(1e-5)], &solid), None, "a sliver deeper than dents may be");
        assert_eq!(caps(&[sliver(0.0)], &solid), None, "no cap has a plane");
    }
}
