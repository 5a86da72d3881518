//! Visibility from a region behind single convex blockers: an object is hidden if one blocker hides it from
//! all of the viewcell.
//!
//! This work is based on: Cohen-Or, Fibich, Halperin and Zadicario, "Conservative Visibility and Strong
//! Occlusion for Viewspace Partitioning of Densely Occluded Scenes", 1998, for the test, and on
//! Saona-Vazquez, Navazo and Brunet, "The Visibility Octree: A Data Structure for 3D Navigation", 1999, for
//! the choice of few blockers and the test of whole nodes. Blockers do not fuse: a house smaller than the
//! viewcell hides little, and a row of them hides no more.

use crate::blocker::Blocker;
use crate::remove::{cell_box, remove_hidden};
use crate::umbra::Umbra;
use alloc::vec::Vec;
use visibility_core::glam::{Affine3A, DVec3};
use visibility_core::pvs::Viewcell;
use visibility_core::{Accuracy, CullStats, OccluderMesh, RegionCuller, Scene, VisibleSet};

/// Number of blockers of a viewcell. Twice as many hide next to nothing more (measured).
const BLOCKERS: usize = 128;

/// Hides what a single convex blocker hides from all of a viewcell. Conservative.
///
/// Blockers are the convex solids among the occluder meshes of the candidates, and the largest triangles of
/// the other meshes. Of these, the 128 that look largest from the viewcell are used. A solid that the
/// viewcell meets hides nothing.
///
/// ```
/// use visibility_core::{glam::{Affine3A, DVec3}, pvs::Viewcell};
/// use visibility_core::{Aabb, OccluderMesh, RegionCuller, Scene, VisibleSet};
/// use visibility_region::ConvexBlockersCuller;
/// let mut scene = Scene::new();
/// let bounds = Aabb::from_arrays([4.0, -9.0, -9.0], [5.0, 9.0, 9.0]);
/// let wall = scene.insert(bounds);
/// let mesh = scene.add_mesh(OccluderMesh::cuboid(&bounds)?);
/// scene.set_mesh(wall, mesh, Affine3A::IDENTITY)?;
/// scene.set_occluder(wall, true)?;
/// let behind = scene.insert(Aabb::from_arrays([6.0, -1.0, -1.0], [7.0, 1.0, 1.0]));
/// let mut visible = VisibleSet::new();
/// let cell = Viewcell::from_box(DVec3::ZERO, DVec3::ONE);
/// ConvexBlockersCuller::new().cull(&scene, &cell, &mut visible);
/// assert!(visible.contains(&scene, wall) && !visible.contains(&scene, behind));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct ConvexBlockersCuller {
    umbrae: Vec<Umbra>,
    blockers: Vec<[DVec3; 2]>,
}

/// A part of an occluder mesh that may be a blocker.
struct Candidate<'a> {
    mesh: &'a OccluderMesh,
    transform: &'a Affine3A,
    /// Triangle of a mesh that is not convex. `None` for a whole convex mesh.
    triangle: Option<usize>,
    /// Approximate solid angle from the viewcell.
    rank: f64,
    bounds: [DVec3; 2],
}

impl ConvexBlockersCuller {
    /// Makes a culler.
    pub const fn new() -> Self {
        Self { umbrae: Vec::new(), blockers: Vec::new() }
    }

    /// Returns the bounds of the blockers of the last call, in world space, as minimum and maximum corners.
    /// Empty before the first call.
    pub fn blockers(&self) -> &[[DVec3; 2]] {
        &self.blockers
    }
}

impl RegionCuller for ConvexBlockersCuller {
    /// Returns [`Accuracy::Conservative`].
    fn accuracy(&self) -> Accuracy {
        Accuracy::Conservative
    }

    /// Removes the candidates that a single blocker hides. Of a viewcell that planes cut, the whole box
    /// counts. A viewcell that is inverted or not finite removes nothing.
    fn cull(&mut self, scene: &Scene, cell: &Viewcell, visible: &mut VisibleSet) -> CullStats {
        self.umbrae.clear();
        self.blockers.clear();
        if let Some((min, max)) = cell_box(cell, scene.origin()) {
            let mut candidates = Vec::new();
            visible.for_each_occluder(scene, |id| {
                if let Some((mesh, transform)) = scene.occluder(id) {
                    let pieces =
                        if mesh.parts().is_empty() { core::slice::from_ref(mesh) } else { mesh.parts() };
                    pieces.iter().for_each(|piece| list(piece, transform, min, max, &mut candidates));
                }
            });
            candidates.sort_unstable_by(|a, b| b.rank.total_cmp(&a.rank));
            for candidate in &candidates {
                if self.umbrae.len() == BLOCKERS {
                    break;
                }
                if let Some(umbra) = Umbra::new(&candidate.blocker(), min, max) {
                    self.umbrae.push(umbra);
                    self.blockers.push(candidate.bounds.map(|corner| corner + scene.origin()));
                }
            }
        }
        let mut stats = remove_hidden(scene, visible, &self.umbrae, None);
        stats.occluders += self.umbrae.len() as u64;
        stats
    }
}

/// Adds the convex parts of a mesh to the candidates.
fn list<'a>(
    mesh: &'a OccluderMesh,
    transform: &'a Affine3A,
    min: DVec3,
    max: DVec3,
    candidates: &mut Vec<Candidate<'a>>,
) {
    let mut add = |triangle, bounds: [DVec3; 2], area: f64| {
        let gap = (bounds[0] - max).max(min - bounds[1]).max(DVec3::ZERO).length();
        let reach = gap + 0.5 * (max - min).length();
        // An area cannot look larger than its hemisphere; NaN ranks last.
        let rank = area / (reach * reach).max(f64::MIN_POSITIVE);
        if rank > 0.0 {
            candidates.push(Candidate { mesh, transform, triangle, rank, bounds });
        }
    };
    if mesh.is_convex() {
        let bounds = bounds_of(&Blocker::solid(mesh, transform).vertices);
        let size = bounds[1] - bounds[0];
        add(None, bounds, size.x * size.y + size.y * size.z + size.z * size.x);
        return;
    }
    for triangle in 0..mesh.triangles().len() {
        let vertices = Blocker::triangle(mesh, transform, triangle).vertices;
        let area = 0.5 * (vertices[1] - vertices[0]).cross(vertices[2] - vertices[0]).length();
        add(Some(triangle), bounds_of(&vertices), area);
    }
}

fn bounds_of(points: &[DVec3]) -> [DVec3; 2] {
    let start = [DVec3::INFINITY, DVec3::NEG_INFINITY];
    points.iter().fold(start, |[min, max], &p| [min.min(p), max.max(p)])
}

impl Candidate<'_> {
    fn blocker(&self) -> Blocker {
        match self.triangle {
            None => Blocker::solid(self.mesh, self.transform),
            Some(triangle) => Blocker::triangle(self.mesh, self.transform, triangle),
        }
    }
}
