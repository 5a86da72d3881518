//! Pixels that the convex hull of two rectangles meets.

use super::ray_map::{PixelRect, RayMap};

/// A rectangle in pixel coordinates: minimum and maximum x, then y. An end of a contour edge is seen in it
/// from somewhere in the viewcell.
pub(super) type Spread = [[f64; 2]; 2];

/// Sets the pixels of `rect` that the convex hull of two rectangles meets: all that is between two rectangles
/// which the ends of an edge may be seen in.
pub(super) fn draw_hull(map: &mut RayMap, p: &Spread, q: &Spread, rect: PixelRect) {
    let (low, high) = (p[1][0].min(q[1][0]), p[1][1].max(q[1][1]));
    let (left, right) = (p[0][0].min(q[0][0]), p[0][1].max(q[0][1]));
    let (first, last) = (low.max(rect.y[0] as f64), high.min(rect.y[1] as f64 + 1.0));
    if first > last || right < rect.x[0] as f64 || left >= rect.x[1] as f64 + 1.0 {
        return;
    }
    let left = Side::new([p[0][0], p[1][0], p[1][1]], [q[0][0], q[1][0], q[1][1]]);
    // The right side is the left one of the mirror image.
    let right = Side::new([-p[0][1], p[1][0], p[1][1]], [-q[0][1], q[1][0], q[1][1]]);
    for row in first as usize..=(last as usize).min(rect.y[1]) {
        let band = [(row as f64).max(low), (row as f64 + 1.0).min(high)];
        let (a, b) =
            (left.least(band).max(rect.x[0] as f64), (-right.least(band)).min(rect.x[1] as f64 + 0.5));
        if a <= b {
            map.set_span(row, a as usize, b as usize);
        }
    }
}

/// The left side of the hull of two upright segments: a convex function of y.
struct Side {
    /// The segment farther to the left: x and both ends.
    x: f64,
    ends: [f64; 2],
    /// x of the other segment, and the slopes from this segment's ends to that one's.
    other: f64,
    slopes: [f64; 2],
}

impl Side {
    /// From two segments as x, least y and greatest y.
    fn new(p: [f64; 3], q: [f64; 3]) -> Self {
        let ([x, low, high], [other, other_low, other_high]) = if p[0] <= q[0] { (p, q) } else { (q, p) };
        let slope = |from: f64, to: f64| if from == to { 0.0 } else { (other - x) / (to - from) };
        Self { x, ends: [low, high], other, slopes: [slope(low, other_low), slope(high, other_high)] }
    }

    /// Returns the least x within a band of y, which must meet the hull.
    #[inline]
    fn least(&self, [low, high]: [f64; 2]) -> f64 {
        let x = if low > self.ends[1] {
            self.x + (low - self.ends[1]) * self.slopes[1]
        } else if high < self.ends[0] {
            self.x + (high - self.ends[0]) * self.slopes[0]
        } else {
            self.x
        };
        // Where a slope is infinite or NaN, the whole side counts.
        if x > self.x { x.min(self.other) } else { self.x }
    }
}
