//! Test of lines of sight among boxes.

use visibility_core::Scene;
use visibility_core::glam::DVec3;

/// Returns whether a segment, in metres relative to the scene's origin, misses the inside of all occluders'
/// boxes, except that of the occluder with index `but` (slab test).
pub fn is_clear(scene: &Scene, from: DVec3, to: DVec3, but: usize) -> bool {
    scene.ids().filter(|id| id.index() != but).all(|id| {
        let object = scene.object(id).unwrap();
        let (min, max) = (object.bounds.min.as_dvec3(), object.bounds.max.as_dvec3());
        let (a, b) = ((min - from) / (to - from), (max - from) / (to - from));
        let (enter, leave) = (a.min(b).max_element().max(0.0), a.max(b).min_element().min(1.0));
        !object.occluder || enter >= leave
    })
}
