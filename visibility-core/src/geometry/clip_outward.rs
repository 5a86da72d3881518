//! Clipping convex polygons to half-spaces that are enlarged by a margin, so that rounding loses nothing.

use crate::geometry::Plane;
use glam::DVec3;
use smallvec::SmallVec;

/// The corners of a convex polygon in order around it; a single point or an edge counts as one. Sixteen are
/// held in place.
pub(crate) type Corners = SmallVec<[DVec3; 16]>;

/// The part of a convex polygon inside a half-space whose boundary is moved by `margin` metres against its
/// unit normal.
///
/// A negative margin makes the half-space smaller. Corners on the moved plane are kept; empty if all are
/// beyond it.
pub(crate) fn clip_outward(corners: &[DVec3], plane: &Plane, margin: f64) -> Corners {
    let mut kept = Corners::new();
    let height = |at: DVec3| plane.signed_distance(at) + margin;
    for (i, &a) in corners.iter().enumerate() {
        let b = corners[(i + 1) % corners.len()];
        let (height_a, height_b) = (height(a), height(b));
        if height_a >= 0.0 {
            kept.push(a);
        }
        if (height_a >= 0.0) != (height_b >= 0.0) {
            kept.push(a + (b - a) * (height_a / (height_a - height_b)));
        }
    }
    kept
}
