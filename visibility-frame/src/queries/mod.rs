//! Queries: the objects in a sphere, a box or a convex volume, along a ray, and nearest to a point.
//!
//! A query walks the scene's hierarchy, tests 64 boxes at a time, skips nodes outside its shape and takes
//! nodes inside its shape without further tests (the range search of Guttman, "R-Trees: A Dynamic Index
//! Structure for Spatial Searching", 1984; nearest objects by Roussopoulos, Kelley and Vincent, "Nearest
//! Neighbor Queries", 1995).
//!
//! Shapes are in scene coordinates: `f32`, in metres relative to the scene's origin, like bounds. A query
//! tests bounds, not triangles, and all shapes and bounds are closed: what touches is found.
//!
//! # What is undecided
//! A query never misses an object. Where rounding leaves open whether bounds touch a shape, the object is
//! found. An object whose bounds are [improper](visibility_core::Aabb::is_proper) may be anywhere: every area
//! query finds it, every ray hits it at distance 0, and its distance from every point is 0. Any other object
//! that is [never culled](visibility_core::Object::never_cull) is found by its bounds, like all objects.
//!
//! # Cost
//! A query takes time in proportion to the nodes that its shape crosses and the objects found. No query
//! allocates once the caller's buffer has grown.

mod nearest;
mod ray;
mod region;
#[cfg(test)]
mod tests;

pub use nearest::Neighbor;
pub use ray::{Ray, RayError, RayHit};

use alloc::vec::Vec;
use region::{BoxRegion, Everywhere};
use region::{Region, SphereRegion};
use visibility_core::frustum::ConvexVolume;
use visibility_core::geometry::Sphere;
use visibility_core::scene::{Boxes64, FAN_OUT, lanes};
use visibility_core::walk::{BoxHierarchy, Child, SceneHierarchy, unculled_blocks};
use visibility_core::{Aabb, CullStats, ObjectId, Scene};

/// A reader of a scene that answers queries: for the assignment of lights, for triggers and blasts, for
/// picking, for the nearest sources of sound.
///
/// ```
/// use visibility_core::{geometry::Sphere, glam::Vec3, Aabb, Scene};
/// use visibility_frame::queries::{Ray, SceneQuery};
/// let mut scene = Scene::new();
/// let boxes = (0..100).map(|i| Aabb::from_arrays([i as f32, 0.0, 0.0], [i as f32 + 0.5, 1.0, 1.0]));
/// let ids = scene.insert_batch(boxes);
/// let query = SceneQuery::new(&scene);
///
/// let mut found = Vec::new(); // kept from frame to frame
/// query.in_sphere(&Sphere::new(Vec3::new(10.0, 0.5, 0.5), 1.0), &mut found);
/// assert_eq!(found.len(), 3);
///
/// let ray = Ray::new(Vec3::new(-5.0, 0.5, 0.5), Vec3::X, f32::INFINITY)?;
/// assert_eq!(query.first_hit(&ray).map(|hit| hit.id), Some(ids[0]));
///
/// let mut near = Vec::new();
/// query.nearest(Vec3::new(50.2, 0.5, 0.5), 2, &mut near);
/// assert_eq!((near[0].id, near.len()), (ids[50], 2));
/// # Ok::<(), visibility_frame::queries::RayError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct SceneQuery<'a> {
    scene: &'a Scene,
    layers: u32,
}

impl<'a> SceneQuery<'a> {
    /// Returns a reader of the objects on all layers. An object whose layer mask is 0 is never found.
    pub fn new(scene: &'a Scene) -> Self {
        Self { scene, layers: u32::MAX }
    }

    /// Returns the reader restricted to objects that share a layer with `layers`, one bit per layer.
    #[must_use]
    pub fn on_layers(self, layers: u32) -> Self {
        Self { layers, ..self }
    }

    /// Returns the scene that the query reads.
    pub fn scene(&self) -> &'a Scene {
        self.scene
    }

    /// Replaces the content of `found` with the objects whose bounds touch `sphere`, in the order of the
    /// hierarchy. Distances are rounded by at most 2^-19 of themselves and 2^-60 metres, always towards
    /// finding an object; a radius above 2^63 metres may count as infinite. An improper sphere touches every
    /// object. Returns the work counters.
    pub fn in_sphere(&self, sphere: &Sphere, found: &mut Vec<ObjectId>) -> CullStats {
        self.collect(&SphereRegion::new(sphere), found)
    }

    /// Replaces the content of `found` with the objects whose bounds touch the box `area`, in the order of
    /// the hierarchy. The test compares coordinates and is exact. An improper box touches every object.
    /// Returns the work counters.
    pub fn in_box(&self, area: &Aabb, found: &mut Vec<ObjectId>) -> CullStats {
        self.collect(&BoxRegion::new(area), found)
    }

    /// Replaces the content of `found` with the objects whose bounds are not wholly outside any single plane
    /// of `volume`. These are all objects that touch the volume, and possibly some near its edges that do
    /// not. The planes are relative to the scene's origin. Returns the work counters.
    pub fn in_convex(&self, volume: &ConvexVolume, found: &mut Vec<ObjectId>) -> CullStats {
        self.collect(volume, found)
    }

    /// Replaces the content of `found` with the objects whose bounds may touch `region`.
    pub(crate) fn collect(&self, region: &impl Region, found: &mut Vec<ObjectId>) -> CullStats {
        found.clear();
        let mut stats = CullStats::default();
        self.collect_below(None, region, found, &mut stats);
        self.for_each_unculled(|boxes, ids, mask, improper| {
            stats.tests += u64::from(mask.count_ones());
            let touched = mask & (improper | !region.outside(boxes));
            found.extend(lanes(touched).map(|lane| ids[lane]));
        });
        stats.visible = found.len() as u64;
        stats
    }

    fn collect_below<R: Region>(
        &self,
        node: Option<usize>,
        region: &R,
        found: &mut Vec<ObjectId>,
        stats: &mut CullStats,
    ) {
        SceneHierarchy.for_each_block(self.scene, node, |block| {
            stats.nodes += 1;
            let candidates = block.occupied();
            if R::EXCLUDES {
                stats.tests += u64::from(candidates.count_ones());
            }
            let touched = candidates & !region.outside(block.boxes());
            if let Some((leaf, ids)) = block.leaf() {
                let touched = touched & self.scene.lanes_on_layers(leaf, self.layers);
                found.extend(lanes(touched).map(|lane| ids[lane]));
                return;
            }
            let inside = region.inside(block.boxes());
            for lane in lanes(touched) {
                let Child::Node(child) = block.child(lane) else { continue };
                if R::EXCLUDES && inside >> lane & 1 != 0 {
                    stats.accepted_subtrees += 1;
                    self.collect_below(Some(child), &Everywhere, found, stats);
                } else {
                    self.collect_below(Some(child), region, found, stats);
                }
            }
        });
    }

    /// Calls `each` for every block of objects that are never culled, which no hierarchy holds. The arguments
    /// of `each` are the boxes and the ids of the block, the mask of the lanes with an object on the query's
    /// layers, and the mask of the lanes with improper bounds; bit i stands for lane i.
    fn for_each_unculled(&self, mut each: impl FnMut(&Boxes64, &[ObjectId; FAN_OUT], u64, u64)) {
        for block in unculled_blocks(self.scene) {
            let (boxes, Some((leaf, ids))) = (block.boxes(), block.leaf()) else { continue };
            let mask = self.scene.lanes_on_layers(leaf, self.layers);
            let improper = lanes(mask).filter(|&lane| !boxes.get(lane).is_proper());
            let improper = improper.fold(0, |all, lane| all | 1 << lane);
            each(boxes, ids, mask, improper);
        }
    }
}

/// Removes the lane with the least key from `mask` and returns it, of equal keys the lowest lane. `None` if
/// `mask` is 0. Keys must not be NaN.
fn take_least<K: PartialOrd + Copy>(keys: &[K; FAN_OUT], mask: &mut u64) -> Option<usize> {
    let least = lanes(*mask).reduce(|best, lane| if keys[lane] < keys[best] { lane } else { best })?;
    *mask &= !(1 << least);
    Some(least)
}
