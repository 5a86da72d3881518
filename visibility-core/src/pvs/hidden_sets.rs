//! `HiddenSets`: what is hidden from all of a box, as baked sets and sets made online both answer it; and how
//! much an object matters to an eye in that box.

use crate::bits::Bits;
use crate::{ObjectId, Scene};
use glam::DVec3;

/// Visible sets that are asked for a box of eye positions, for all directions of view. Implemented by
/// [`PvsCuller`](super::PvsCuller), for baked sets, and by `visibility_region::OnlinePvs`, for sets made
/// online, so that a [`Residency`](super::Residency) streams by either.
///
/// A view draws what is seen from the points at which its lines of sight begin
/// ([`View::for_each_sight_start`](crate::View::for_each_sight_start)): the eye and the corners of the near
/// plane. A box that stands for a view must hold all of these, not the eye alone. For a near distance of
/// 0.05 m, an angle of 1.2 upwards and an aspect ratio of 1.5, the corners are 0.08 m from the eye.
pub trait HiddenSets {
    /// Replaces `hidden` by the [indices](ObjectId::index) of the objects that are hidden from every point of
    /// a box in world space, from `min` to `max`, in metres. Objects that no culler may remove may be among
    /// them. `layers` are the [layers](crate::View::layers) of the views from the box, one mask for each
    /// view. One object hides another only if each of these views draws it, so several views are several
    /// masks, never the union of their masks. Without a mask there is no view, and the answer is as for views
    /// of all layers.
    ///
    /// Returns false if the answer is not known: it is not made yet, the box is not covered by viewcells, it
    /// is inverted or not finite, the scene has changed too much, or a view does not draw all occluders that
    /// the sets were made with. Every object may be visible then, and the content of `hidden` is unspecified.
    fn write_hidden(
        &mut self,
        scene: &Scene,
        layers: &[u32],
        min: DVec3,
        max: DVec3,
        hidden: &mut Bits,
    ) -> bool;
}

/// Returns the diagonal of an object's bounds divided by their distance from a box in world space, from `min`
/// to `max`. For small angles, this is about the greatest angle in radians at which the object is seen from
/// the box. Infinite for an object that reaches into the box, and 0 for an unknown one.
///
/// ```
/// use visibility_core::{Aabb, Scene, glam::DVec3, pvs::importance};
/// let mut scene = Scene::new();
/// let post = scene.insert(Aabb::from_arrays([11.0, 0.0, 0.0], [14.0, 4.0, 0.0]));
/// assert_eq!(importance(&scene, post, DVec3::ZERO, DVec3::ONE), 0.5, "5 m long, 10 m away");
/// ```
pub fn importance(scene: &Scene, id: ObjectId, min: DVec3, max: DVec3) -> f64 {
    let Ok(bounds) = scene.bounds(id) else { return 0.0 };
    let [low, high] = [bounds.min, bounds.max].map(|corner| corner.as_dvec3() + scene.origin());
    let distance = (low - max).max(min - high).max(DVec3::ZERO).length();
    if distance > 0.0 { (high - low).length() / distance } else { f64::INFINITY }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Aabb;

    #[test]
    fn what_touches_a_place_matters_most_however_small_it_is() {
        let mut scene = Scene::new();
        let [low, high] = [DVec3::ZERO, DVec3::splat(4.0)];
        for at in [[0.0; 3], [1.0, 2.0, 3.0], [4.0; 3], [4.0, 2.0, 0.0]] {
            let point = scene.insert(Aabb::from_arrays(at, at));
            assert_eq!(importance(&scene, point, low, high), f64::INFINITY, "a point at {at:?}");
        }
        // 3 and 4 m from a corner of the place, 12 m long, on either side of it.
        for (min, max) in [([-6.0, -16.0, 1.0], [-3.0, -4.0, 5.0]), ([7.0, 8.0, 1.0], [10.0, 20.0, 5.0])] {
            let beside = scene.insert(Aabb::from_arrays(min, max));
            assert_eq!(importance(&scene, beside, low, high), 13.0 / 5.0, "{min:?} to {max:?}");
        }
    }
}
