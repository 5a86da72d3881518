//! Test of lines of sight among boxes.

use visibility_core::glam::DVec3;
use visibility_core::{Aabb, Scene};

/// Returns whether a segment, in metres relative to the scene's origin, misses the inside of all occluders'
/// boxes, except that of the occluder with index `but`.
pub fn is_clear(scene: &Scene, from: DVec3, to: DVec3, but: usize) -> bool {
    let others = scene.ids().filter(|id| id.index() != but).map(|id| scene.object(id).unwrap());
    misses(others.filter(|object| object.occluder).map(|object| object.bounds), from, to)
}

/// Returns whether a segment misses the inside of all boxes (slab test). The segment and the boxes are in
/// metres relative to one origin.
pub(crate) fn misses(mut boxes: impl Iterator<Item = Aabb>, from: DVec3, to: DVec3) -> bool {
    boxes.all(|bounds| {
        let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let (a, b) = ((min - from) / (to - from), (max - from) / (to - from));
        let (enter, leave) = (a.min(b).max_element().max(0.0), a.max(b).min_element().min(1.0));
        enter >= leave
    })
}
