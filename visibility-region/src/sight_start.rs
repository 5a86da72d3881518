//! The box in which the lines of sight of a view begin.

use visibility_core::View;
use visibility_core::glam::DVec3;

/// Returns a box in world space, as minimum and maximum corner, that contains the starts of all lines of
/// sight of a view. `anchor` is a point near the eye. `None` if the starts are unknown or not finite.
pub(crate) fn sight_start(view: &View, anchor: DVec3) -> Option<(DVec3, DVec3)> {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let mut finite = true;
    let known = view.for_each_sight_start(anchor, |corners, error| {
        for corner in corners {
            finite &= corner.is_finite() && error.is_finite();
            (low, high) = (low.min(*corner - error), high.max(*corner + error));
        }
    });
    // The sums round by half an EPSILON of their result.
    let margin = (anchor.abs() + low.abs().max(high.abs())) * f64::EPSILON;
    let (low, high) = (low + anchor - margin, high + anchor + margin);
    (known && finite && low.cmple(high).all()).then_some((low, high))
}
