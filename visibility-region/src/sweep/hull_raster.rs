//! Drawing of the pixels that the convex hull of two rectangles meets.

use super::pixel_block::PixelBlock;
use super::ray_map::{PixelRect, pixel_at};

/// A rectangle in pixel coordinates: least and greatest x, then y. It contains the pixels where rays from the
/// viewcell through one end of a contour edge arrive.
pub(super) type Spread = [[f64; 2]; 2];

/// Sets the pixels of `rect` that the convex hull of two rectangles meets. If each rectangle contains the
/// projections of one end of an edge, these are the pixels in which the edge may be seen.
pub(super) fn draw_hull(map: &mut PixelBlock, p: &Spread, q: &Spread, rect: PixelRect) {
    let (low, high) = (p[1][0].min(q[1][0]), p[1][1].max(q[1][1]));
    let (left, right) = (p[0][0].min(q[0][0]), p[0][1].max(q[0][1]));
    let (first, last) = (low.max(rect.y[0] as f64), high.min(rect.y[1] as f64 + 1.0));
    if first > last || right < rect.x[0] as f64 || left >= rect.x[1] as f64 + 1.0 {
        return;
    }
    let left = Side::new([p[0][0], p[1][0], p[1][1]], [q[0][0], q[1][0], q[1][1]]);
    // The right side is found as the left side of the mirror image.
    let right = Side::new([-p[0][1], p[1][0], p[1][1]], [-q[0][1], q[1][0], q[1][1]]);
    let [begin, end] = [rect.x[0] as f64, rect.x[1] as f64 + 1.0];
    let rows = first as i32..=(last as usize).min(rect.y[1]) as i32;
    for (y, mut row) in rows.zip(map.rows_from(first as usize)) {
        let y = f64::from(y);
        let band = [y.max(low), (y + 1.0).min(high)];
        let (a, b) = (left.least(band), -right.least(band));
        let a = if a > begin { a } else { begin };
        // Clamping the ends before the comparison would lose a hull within the right half of the last column.
        if a <= b && a < end {
            let b = if b < end { pixel_at(b).min(rect.x[1]) } else { rect.x[1] };
            // `pixel_at` may round `a` up to `end`.
            row.set_span(pixel_at(a).min(b), b);
        }
    }
}

/// The left boundary of the convex hull of two vertical segments: x as a convex function of y.
struct Side {
    /// x of the segment that is farther to the left, in pixels.
    x: f64,
    /// Least and greatest y of the left segment, in pixels.
    ends: [f64; 2],
    /// x of the segment that is farther to the right, in pixels.
    other: f64,
    /// Change of x per row along two lines: from the lower end of one segment to the lower end of the other,
    /// and from upper end to upper end. 0 where the two ends have equal y.
    slopes: [f64; 2],
}

impl Side {
    /// Makes the left boundary of the hull of two vertical segments, each given as x, least y and greatest y.
    fn new(p: [f64; 3], q: [f64; 3]) -> Self {
        let ([x, low, high], [other, other_low, other_high]) = if p[0] <= q[0] { (p, q) } else { (q, p) };
        let slope = |from: f64, to: f64| if from == to { 0.0 } else { (other - x) / (to - from) };
        Self { x, ends: [low, high], other, slopes: [slope(low, other_low), slope(high, other_high)] }
    }

    /// Returns the least x of the boundary within a band of y, which must meet the hull.
    #[inline]
    fn least(&self, [low, high]: [f64; 2]) -> f64 {
        let x = if low > self.ends[1] {
            self.x + (low - self.ends[1]) * self.slopes[1]
        } else if high < self.ends[0] {
            self.x + (high - self.ends[0]) * self.slopes[0]
        } else {
            self.x
        };
        // NaN, from an infinite slope, gives the x of the left segment. The result is at most that of the
        // right one.
        if x > self.x { x.min(self.other) } else { self.x }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;

    /// The pixels that are tested.
    const TESTED: PixelRect = PixelRect { x: [0, 6], y: [0, 6] };

    /// An eighth of a pixel in the units of the oracle, which are 64ths of a pixel.
    const EIGHTH: i64 = 8;

    /// Tests by separating lines, in integers, whether the hull of two rectangles meets the square of a pixel
    /// that is enlarged by `grow` units on each side.
    fn meets(p: [[i64; 2]; 2], q: [[i64; 2]; 2], [x, y]: [usize; 2], grow: i64) -> bool {
        let corners = |[x, y]: [[i64; 2]; 2]| [[x[0], y[0]], [x[1], y[0]], [x[1], y[1]], [x[0], y[1]]];
        let square = corners([x, y].map(|at| [at as i64 * 64 - grow, (at as i64 + 1) * 64 + grow]));
        let (p, q) = (corners(p), corners(q));
        let across = |i: usize| [p[i][1] - q[i][1], q[i][0] - p[i][0]];
        let normals = [[1, 0], [0, 1], across(0), across(1), across(2), across(3)];
        normals.into_iter().all(|n| {
            let range = |points: &mut dyn Iterator<Item = [i64; 2]>| {
                points
                    .map(|at| at[0] * n[0] + at[1] * n[1])
                    .fold([i64::MAX, i64::MIN], |[low, high], at| [low.min(at), high.max(at)])
            };
            let (hull, square) = (range(&mut p.into_iter().chain(q)), range(&mut square.into_iter()));
            hull[0] <= square[1] && square[0] <= hull[1]
        })
    }

    /// Draws the hull of two rectangles in units of the oracle, and tests each pixel in and around `rect`. A
    /// pixel that the hull only touches from outside may be set or not.
    fn check(map: &mut PixelBlock, p: [[i64; 2]; 2], q: [[i64; 2]; 2], rect: PixelRect) {
        let pixels = |spread: [[i64; 2]; 2]| spread.map(|range| range.map(|end| end as f64 / 64.0));
        map.begin(TESTED);
        draw_hull(map, &pixels(p), &pixels(q), rect);
        for (x, y) in (0..7).flat_map(|y| (0..7).map(move |x| (x, y))) {
            let is_inside = (rect.x[0]..=rect.x[1]).contains(&x) && (rect.y[0]..=rect.y[1]).contains(&y);
            let is_set = map.get(x, y);
            let must = is_inside && meets(p, q, [x, y], -1);
            let may = is_inside && meets(p, q, [x, y], 1);
            assert!(!must || is_set, "{x} {y} is not drawn of {p:?} {q:?} in {rect:?}");
            assert!(may || !is_set, "{x} {y} is drawn of {p:?} {q:?} in {rect:?}");
        }
    }

    #[test]
    fn a_left_end_that_rounds_to_the_end_of_the_rectangle_is_in_its_last_column() {
        let (mut map, rect) = (PixelBlock::new(), PixelRect { x: [0, 63], y: [0, 3] });
        map.begin(rect);
        let a = 64.0 - 2f64.powi(-34);
        draw_hull(&mut map, &[[a, a + 1.0], [0.5, 0.5]], &[[a, a + 1.0], [2.5, 2.5]], rect);
        let columns: Vec<usize> = (0..64).filter(|&x| map.get(x, 1)).collect();
        assert_eq!(columns, [63], "columns of the second row");
    }

    /// Ranges whose ends are at, just before or just after the ends and the middles of the first and the last
    /// pixel. Includes single points.
    fn ranges([first, last]: [usize; 2]) -> Vec<[i64; 2]> {
        let mut ends: Vec<i64> = [first, last]
            .iter()
            .flat_map(|&pixel| [0, 32, 64].map(|at| pixel as i64 * 64 + at))
            .flat_map(|at| [at - EIGHTH, at, at + EIGHTH])
            .collect();
        ends.extend([0, 6 * 64 + 32]);
        ends.sort_unstable();
        ends.dedup();
        ends.iter().flat_map(|&a| ends.iter().filter(move |&&b| a <= b).map(move |&b| [a, b])).collect()
    }

    #[test]
    fn a_hull_within_half_a_pixel_is_drawn() {
        for half in [[0.1, 0.4], [0.5, 0.5], [0.6, 0.9]] {
            for column in [2, 5] {
                let mut map = PixelBlock::new();
                map.begin(TESTED);
                let x = half.map(|at| column as f64 + at);
                let rect = PixelRect { x: [2, 5], y: [1, 3] };
                draw_hull(&mut map, &[x, [0.0, 0.5]], &[x, [4.0, 6.0]], rect);
                assert!((1..=3).all(|row| map.get(column, row)), "{half:?} of column {column}");
            }
        }
    }

    #[test]
    fn pixels_of_hulls_are_those_of_integer_arithmetic() {
        let mut map = PixelBlock::new();
        for [first, last] in [[1, 3], [3, 3], [0, 6]] {
            let fixed = [[70, 180], [130, 130], [0, 448], [64, 128], [160, 170]];
            let rect = PixelRect { x: [first, last], y: [1, 3] };
            let turned = PixelRect { x: rect.y, y: rect.x };
            for (i, &a) in ranges(rect.x).iter().enumerate() {
                for (j, &b) in ranges(rect.x).iter().enumerate() {
                    let (c, d) = (fixed[i % 5], fixed[(i + j) % 5]);
                    check(&mut map, [a, c], [b, d], rect);
                    check(&mut map, [c, a], [d, b], turned);
                }
            }
        }
    }
}
