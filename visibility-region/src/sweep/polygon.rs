//! Cutting of triangles at two depths, and the pixels that the remaining polygons fill.

use super::pixel_block::PixelBlock;
use super::ray_map::{PixelRect, RayMap, SIDE, pixel_at};
use super::window::{FARTHEST_PIXEL, Window};
use core::ops::Range;
use visibility_core::glam::DVec3;

/// Returns the point at depth `z` of the segment from `a` to `b`, where `a.z < z < b.z`.
pub(super) fn cut(a: DVec3, b: DVec3, z: f64) -> DVec3 {
    let p = a + (b - a) * ((z - a.z) / (b.z - a.z));
    DVec3::new(p.x, p.y, z)
}

/// For each row of a map, two x in pixels: where an upward edge of a polygon crosses the middle line of the
/// row, and where a downward edge does.
pub(super) type Sides = [[f64; SIDE]; 2];

/// Returns the rows from `first` to `last`, both included, whose middle line has a y of at least `low` and
/// less than `high`, in pixels.
fn rows_between([low, high]: [f64; 2], [first, last]: [usize; 2]) -> Range<usize> {
    let from = |y: f64| {
        // The casts round towards zero, and turn negative numbers into zero.
        let above = (y - 0.5).min(SIDE as f64);
        above as usize + usize::from(above > above as usize as f64)
    };
    let start = from(low).max(first);
    start..from(high).min(last + 1).max(start)
}

/// The part of a triangle between two depths: a convex polygon in local coordinates.
#[derive(Clone, Debug)]
pub(super) struct Polygon {
    points: [DVec3; 5],
    count: usize,
}

impl Polygon {
    /// Returns the part of a triangle at depths from `near` to `far`, both included. It may be empty.
    pub(super) fn cut([a, b, c]: [DVec3; 3], near: f64, far: f64) -> Self {
        let mut polygon = Self { points: [a, b, c, c, c], count: 3 };
        polygon.clip(near, 1.0);
        polygon.clip(far, -1.0);
        polygon
    }

    pub(super) fn points(&self) -> &[DVec3] {
        &self.points[..self.count]
    }

    /// Cuts the polygon to the part with `z` at least `at` (`side` 1) or at most `at` (`side` -1).
    fn clip(&mut self, at: f64, side: f64) {
        let behind = |p: DVec3| (p.z - at) * side < 0.0;
        if !self.points().iter().any(|&p| behind(p)) {
            return;
        }
        let mut kept = Self { points: self.points, count: 0 };
        let mut push = |p| {
            // Each of two cuts adds at most one corner to the three of a triangle.
            if kept.count < kept.points.len() {
                kept.points[kept.count] = p;
                kept.count += 1;
            }
        };
        for (i, &a) in self.points().iter().enumerate() {
            let b = self.points[(i + 1) % self.count];
            if !behind(a) {
                push(a);
            }
            // The crossing is computed from the end with the lesser z, so that neighbours with the same edge
            // get the same point.
            let (low, high) = if a.z <= b.z { (a, b) } else { (b, a) };
            if low.z < at && high.z > at {
                push(cut(low, high, at));
            }
        }
        *self = kept;
    }

    /// Sets pixels of `rect` in `inside`: those in which the polygon, as seen from the middle of the cell's
    /// front, meets the middle line of the pixel's row. If the polygon comes from the outer side of a rim and
    /// does not pass it, the first pixel on the rim's inner side is not set. Pixels that are set in `map` may
    /// be left out. Returns whether any pixel was set. `sides` is scratch memory.
    pub(super) fn fill(
        &self,
        inside: &mut PixelBlock,
        sides: &mut Sides,
        map: &RayMap,
        window: &Window,
        rect: PixelRect,
    ) -> bool {
        let count = self.count;
        if count < 3 {
            return false;
        }
        let mut p = [[0.0; 2]; 5];
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        let (mut left, mut right) = (f64::INFINITY, f64::NEG_INFINITY);
        for (p, at) in p.iter_mut().zip(self.points()) {
            let scale = window.d / at.z;
            *p = [window.pixel(at.x * scale, 0), window.pixel(at.y * scale, 1)];
            (low, high) = (low.min(p[1]), high.max(p[1]));
            (left, right) = (left.min(p[0]), right.max(p[0]));
        }
        if !p[..count].as_flattened().iter().all(|x| x.abs() < FARTHEST_PIXEL) {
            return false;
        }
        let (first, last) = (low.max(rect.y[0] as f64), high.min(rect.y[1] as f64 + 1.0));
        let left = left.max(rect.x[0] as f64);
        let meets = first <= last && left <= right && left < rect.x[1] as f64 + 1.0;
        if !meets {
            return false;
        }
        let right = (right as usize).min(rect.x[1]);
        let (first, last) = (first as usize, (last as usize).min(rect.y[1]));
        if map.all_set(PixelRect { x: [left as usize, right], y: [first, last] }) {
            return false;
        }
        // The rows whose middle lines are between the least and the greatest y. Each is crossed by one upward
        // and one downward edge. Rows outside `rect` are left out.
        let rows = rows_between([low, high], [first, last]);
        for i in 0..count {
            let (a, b) = (p[i], p[if i + 1 == count { 0 } else { i + 1 }]);
            let side = &mut sides[usize::from(a[1] > b[1])];
            let slope = (b[0] - a[0]) / (b[1] - a[1]);
            let edge = rows_between([a[1].min(b[1]), a[1].max(b[1])], [first, last]);
            // Conversion from `i32` is one instruction, also for several rows at once.
            for (row, x) in (edge.start as i32..).zip(&mut side[edge]) {
                *x = a[0] + (f64::from(row) + 0.5 - a[1]) * slope;
            }
        }
        let mut any = false;
        let [begin, end] = [rect.x[0] as f64, rect.x[1] as f64 + 1.0];
        let [up, down] = sides.each_ref().map(|side| &side[rows.clone()]);
        for (mut row, (&up, &down)) in inside.rows_from(rows.start).zip(up.iter().zip(down)) {
            let ends = if up < down { [up, down] } else { [down, up] };
            let [left, right] = window.clip_at_rim(ends, 0);
            let left = if left > begin { left } else { begin };
            // Clamping the ends before the comparison would lose a span within the right half of the last
            // column.
            if left <= right && left < end {
                let right = if right < end { pixel_at(right).min(rect.x[1]) } else { rect.x[1] };
                // `pixel_at` may round `left` up to `end`.
                row.set_span(pixel_at(left).min(right), right);
                any = true;
            }
        }
        any
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;

    /// Tests by separating lines, in integers, whether a triangle meets the middle line of a pixel that is
    /// extended by `grow` units at both ends. A pixel is 64 units wide.
    fn meets(triangle: [[i64; 2]; 3], [x, y]: [usize; 2], grow: i64) -> bool {
        let (x, y) = (x as i64 * 64, y as i64 * 64 + 32);
        let line = [[x - grow, y], [x + 64 + grow, y]];
        let across = |i: usize| {
            let (a, b) = (triangle[i], triangle[(i + 1) % 3]);
            [a[1] - b[1], b[0] - a[0]]
        };
        [[1, 0], [0, 1], across(0), across(1), across(2)].into_iter().all(|n| {
            let at = |p: [i64; 2]| p[0] * n[0] + p[1] * n[1];
            let (t, l) = (triangle.map(at), line.map(at));
            let least = |of: &[i64]| of.iter().copied().fold(i64::MAX, i64::min);
            let most = |of: &[i64]| of.iter().copied().fold(i64::MIN, i64::max);
            least(&t) <= most(&l) && least(&l) <= most(&t)
        })
    }

    #[test]
    fn a_left_side_that_rounds_to_the_end_of_the_rectangle_is_in_its_last_column() {
        let (mut inside, map, mut sides) = (PixelBlock::new(), RayMap::new(), [[0.0; SIDE]; 2]);
        let rect = PixelRect { x: [0, 63], y: [0, 3] };
        inside.begin(rect);
        let left = 64.0 - 2f64.powi(-34);
        let corners = [[left, 0.0], [left, 4.0], [70.0, 2.0]].map(|[x, y]| DVec3::new(x, y, 1.0));
        let any = Polygon::cut(corners, 0.5, 2.0).fill(&mut inside, &mut sides, &map, &Window::unit(), rect);
        let columns: Vec<_> = (0..64).filter(|&x| inside.get(x, 1)).collect();
        assert_eq!((any, &columns[..]), (true, &[63][..]), "columns of the second row");
    }

    #[test]
    fn pixels_of_triangles_are_those_of_integer_arithmetic() {
        let window = Window::unit();
        let (mut inside, map) = (PixelBlock::new(), RayMap::new());
        let mut sides = [[0.0; SIDE]; 2];
        let columns = [32, 56, 64, 96, 104, 216, 224, 232, 256, 320];
        let rows = [40, 96, 104, 160, 224, 300];
        let points: [[i64; 2]; 60] = core::array::from_fn(|i| [columns[i % 10], rows[i / 10]]);
        for rect in [PixelRect { x: [1, 3], y: [1, 3] }, PixelRect { x: [3, 3], y: [0, 1] }] {
            for i in 0..60 * 60 * 60 {
                let triangle = [i % 60, i / 60 % 60, i / 3600].map(|at| points[at]);
                inside.begin(PixelRect { x: [0, 5], y: [0, 5] });
                let corners = triangle.map(|[x, y]| DVec3::new(x as f64, y as f64, 64.0) / 64.0);
                let any = Polygon::cut(corners, 0.5, 2.0).fill(&mut inside, &mut sides, &map, &window, rect);
                let (low, high) =
                    triangle.iter().fold((i64::MAX, 0), |(low, high), p| (low.min(p[1]), high.max(p[1])));
                let mut is_any = false;
                for (x, y) in (0..6).flat_map(|y| (0..6).map(move |x| (x, y))) {
                    let is_inside =
                        (rect.x[0]..=rect.x[1]).contains(&x) && (rect.y[0]..=rect.y[1]).contains(&y);
                    let is_set = inside.get(x, y);
                    is_any |= is_set;
                    // A middle line at the triangle's greatest y does not count as crossed.
                    let is_crossed = is_inside && (low..high).contains(&(y as i64 * 64 + 32));
                    assert!(!(is_crossed && meets(triangle, [x, y], -1)) || is_set, "{x} {y} {triangle:?}");
                    assert!(is_crossed && meets(triangle, [x, y], 1) || !is_set, "{x} {y} {triangle:?}");
                }
                assert_eq!(any, is_any, "{triangle:?}");
            }
        }
    }

    /// Polygons beside the rectangle, up to its border, words of pixels away, set nothing.
    #[test]
    fn polygons_beside_the_rectangle_set_nothing() {
        let (mut inside, map, mut sides) = (PixelBlock::new(), RayMap::new(), [[0.0; SIDE]; 2]);
        let (rect, mut full) = (PixelRect { x: [200, 255], y: [100, 163] }, RayMap::new());
        (0..SIDE).for_each(|row| full.set_span(row, 0, SIDE - 1));
        let triangle = |x: f64, y: f64| {
            [[x, y], [x, y + 50.0], [x + 90.0, y + 25.0]].map(|[x, y]| DVec3::new(x, y, 1.0))
        };
        for (x, y) in [(0.0, 110.0), (256.0, 110.0), (400.0, 110.0), (210.0, 20.0), (210.0, 200.0)] {
            inside.begin(rect);
            let polygon = Polygon::cut(triangle(x, y), 0.5, 2.0);
            let any = polygon.fill(&mut inside, &mut sides, &map, &Window::unit(), rect);
            let is_set = (100..164).any(|y| (200..256).any(|x| inside.get(x, y)));
            assert_eq!((any, is_set), (false, false), "a triangle at {x}, {y}");
            let any = polygon.fill(&mut inside, &mut sides, &full, &Window::unit(), rect);
            assert!(!any, "a triangle at {x}, {y}, on a full map");
        }
        inside.begin(rect);
        let polygon = Polygon::cut(triangle(150.0, 110.0), 0.5, 2.0);
        assert!(
            polygon.fill(&mut inside, &mut sides, &map, &Window::unit(), rect) && inside.get(220, 135),
            "a triangle that reaches into the rectangle"
        );
    }
}
