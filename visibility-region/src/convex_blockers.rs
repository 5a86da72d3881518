//! Visibility from a region, with single convex blockers: an object is hidden if one blocker alone hides it
//! from every point of the viewcell.
//!
//! This work is based on: Cohen-Or, Fibich, Halperin and Zadicario, "Conservative Visibility and Strong
//! Occlusion for Viewspace Partitioning of Densely Occluded Scenes", 1998, for the test, and on
//! Saona-Vazquez, Navazo and Brunet, "The Visibility Octree: A Data Structure for 3D Navigation", 1999, for
//! the choice of few blockers and the test of whole nodes. Blockers do not fuse: a house smaller than the
//! viewcell hides little, and a row of such houses hides no more.

use crate::blocker::Blocker;
use crate::remove::{cell_box, remove_hidden};
use crate::solids::Solids;
use crate::solids::occluding;
use crate::umbra::Umbra;
use alloc::vec::Vec;
use visibility_core::bits::Bits;
use visibility_core::glam::{Affine3A, DVec3};
use visibility_core::pvs::Viewcell;
use visibility_core::{Accuracy, CullStats, OccluderMesh, RegionCuller, Scene, VisibleSet};

/// Greatest number of blockers of a viewcell. By measurement, twice as many blockers hide hardly more
/// objects.
const BLOCKERS: usize = 128;

/// Removes objects that a single convex blocker hides from every point of a viewcell. Conservative.
///
/// Blockers are convex solids among the candidates' occluder meshes, and the largest triangles of meshes
/// without such solids. The 128 that look largest from the viewcell are used. A solid that meets the viewcell
/// hides nothing.
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
#[derive(Clone, Debug)]
pub struct ConvexBlockersCuller {
    solids: Solids,
    umbrae: Vec<Umbra>,
    blockers: Vec<[DVec3; 2]>,
}

/// A convex solid or a single triangle that may be chosen as a blocker.
struct Candidate<'a> {
    shape: Shape<'a>,
    /// Approximate solid angle in steradians as seen from the viewcell. Candidates with the greatest become
    /// blockers.
    rank: f64,
    bounds: [DVec3; 2],
}

enum Shape<'a> {
    Solid(&'a Blocker),
    /// A triangle of a mesh: the mesh, the mesh's transform, and the triangle's index.
    Triangle(&'a OccluderMesh, Affine3A, usize),
}

impl Default for ConvexBlockersCuller {
    fn default() -> Self {
        Self::new()
    }
}

impl ConvexBlockersCuller {
    /// Makes a culler without blockers. The first call finds them.
    pub const fn new() -> Self {
        Self { solids: Solids::new(), umbrae: Vec::new(), blockers: Vec::new() }
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

    /// Removes the candidates that a single blocker hides. For a viewcell with planes, its whole box counts.
    /// A viewcell that is inverted or not finite removes nothing.
    fn cull(&mut self, scene: &Scene, cell: &Viewcell, visible: &mut VisibleSet) -> CullStats {
        self.solids.sync(scene);
        self.umbrae.clear();
        self.blockers.clear();
        if let Some((min, max)) = cell_box(cell, scene.origin()) {
            let mut candidates = candidates(scene, visible, &self.solids, min, max);
            candidates.sort_unstable_by(|a, b| b.rank.total_cmp(&a.rank));
            for Candidate { shape, bounds, .. } in &candidates {
                if self.umbrae.len() == BLOCKERS {
                    break;
                }
                let umbra = match *shape {
                    Shape::Solid(blocker) => Umbra::new(blocker, min, max),
                    Shape::Triangle(mesh, transform, triangle) => {
                        Umbra::new(&Blocker::triangle(mesh, &transform, triangle), min, max)
                    }
                };
                if let Some(umbra) = umbra {
                    self.umbrae.push(umbra);
                    self.blockers.push(bounds.map(|corner| corner + scene.origin()));
                }
            }
        }
        let mut stats = remove_hidden(scene, visible, &self.umbrae, None);
        stats.occluders += self.umbrae.len() as u64;
        stats
    }
}

/// Returns the solids of the candidate occluders, and the triangles of occluders without a solid, ranked by
/// how large they look from the viewcell. `min` and `max` are the corners of the viewcell's box.
fn candidates<'a>(
    scene: &'a Scene,
    visible: &VisibleSet,
    solids: &'a Solids,
    min: DVec3,
    max: DVec3,
) -> Vec<Candidate<'a>> {
    let mut list = Vec::new();
    // `area` holds the areas as seen along the three axes: a floor is large from above, but edge-on from
    // afar.
    let mut add = |shape, bounds: [DVec3; 2], area: DVec3| {
        let towards = ((bounds[0] - max) + (bounds[1] - min)).normalize_or_zero();
        let area = area.abs().dot(towards.abs());
        let gap = (bounds[0] - max).max(min - bounds[1]).max(DVec3::ZERO).length();
        let reach = gap + 0.5 * (max - min).length();
        let rank = area / (reach * reach);
        // Also false for NaN.
        if rank > 0.0 {
            list.push(Candidate { shape, rank, bounds });
        }
    };
    let occluding = occluding(scene, visible);
    let mut has_solid = Bits::new(scene.index_limit());
    for solid in solids.list.iter().filter(|solid| occluding.contains(solid.id.index())) {
        has_solid.insert(solid.id.index());
        let size = solid.max - solid.min;
        let area = DVec3::new(size.y * size.z, size.z * size.x, size.x * size.y);
        add(Shape::Solid(&solid.blocker), [solid.min, solid.max], area);
    }
    visible.for_each_occluder(scene, |id| {
        let index = id.index();
        if !occluding.contains(index) || has_solid.contains(index) {
            return;
        }
        let Some((mesh, transform)) = scene.occluder(id) else { return };
        for triangle in 0..mesh.triangles().len() {
            let v = Blocker::triangle(mesh, &transform, triangle).vertices;
            let bounds = [v[0].min(v[1]).min(v[2]), v[0].max(v[1]).max(v[2])];
            let area = (v[1] - v[0]).cross(v[2] - v[0]) * 0.5;
            add(Shape::Triangle(mesh, transform, triangle), bounds, area);
        }
    });
    list
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::glam::Vec3;
    use visibility_core::{Aabb, Object};
    use visibility_testing::NOT_ALWAYS_DRAWN;

    /// Adds an occluder with a mesh of triangles.
    fn add(scene: &mut Scene, mesh: OccluderMesh) -> visibility_core::ObjectId {
        let id = scene.insert(Object { occluder: true, ..Object::new(*mesh.bounds()) });
        let mesh = scene.add_mesh(mesh);
        scene.set_mesh(id, mesh, Affine3A::IDENTITY).unwrap();
        id
    }

    /// Returns rank and bounds of the candidates for the viewcell from -1 to 1.
    fn ranked(scene: &Scene) -> Vec<(f64, [DVec3; 2])> {
        let mut solids = Solids::new();
        solids.sync(scene);
        let all = candidates(scene, &VisibleSet::new(), &solids, DVec3::NEG_ONE, DVec3::ONE);
        all.iter().map(|candidate| (candidate.rank, candidate.bounds)).collect()
    }

    /// A solid is one candidate, ranked by the area that it shows and by its distance on whichever side.
    #[test]
    fn solids_are_ranked_by_area_and_distance() {
        for (low, high, gap) in [(3.0, 4.0, 2.0), (-4.0, -3.0, 2.0), (0.5, 4.0, 0.0), (-1.5, -1.0, 0.0)] {
            let mut scene = Scene::new();
            let bounds = Aabb::new(Vec3::new(low, -1.0, -1.0), Vec3::new(high, 1.0, 1.0));
            add(&mut scene, OccluderMesh::cuboid(&bounds).unwrap());
            let reach = gap + 3.0f64.sqrt();
            let found = ranked(&scene);
            let [(rank, of)] = found[..] else { panic!("{found:?} of one solid") };
            assert!((rank - 4.0 / (reach * reach)).abs() < 1e-12, "{low} to {high}: {rank}");
            assert_eq!(of, [bounds.min.as_dvec3(), bounds.max.as_dvec3()], "the bounds of the solid");
        }
    }

    /// Without a solid, each triangle that shows some area is a candidate, if its object is always drawn.
    #[test]
    fn triangles_of_what_is_always_drawn_are_candidates() {
        let p = |x: f32, y: f32, z: f32| Vec3::new(x, y, z);
        let mesh = || {
            let facing = [p(4.0, 2.0, -1.0), p(5.0, -3.0, 1.0), p(3.0, 0.0, 4.0)];
            let edge_on = [p(5.0, 0.0, 0.0), p(6.0, 1.0, 0.0), p(6.0, -1.0, 0.0)];
            OccluderMesh::from_triangles(&[facing, edge_on]).unwrap()
        };
        let mut scene = Scene::new();
        add(&mut scene, mesh());
        let found = ranked(&scene);
        let [(rank, bounds)] = found[..] else { panic!("{found:?} of two triangles") };
        assert!(rank > 0.0, "{rank}");
        assert_eq!(bounds, [DVec3::new(3.0, -3.0, -1.0), DVec3::new(5.0, 2.0, 4.0)], "bounds of a triangle");
        for change in NOT_ALWAYS_DRAWN {
            let mut scene = Scene::new();
            let id = add(&mut scene, mesh());
            change(&mut scene, id);
            assert!(ranked(&scene).is_empty(), "triangles that may not be drawn");
        }
    }
}
