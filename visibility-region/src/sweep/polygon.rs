//! Parts of triangles between two depths, and the pixels that they fill.

use super::ray_map::{PixelRect, RayMap, SIDE};
use super::window::{FARTHEST_PIXEL, Window};
use core::ops::Range;
use visibility_core::glam::DVec3;

/// Returns the point at depth `z` of the segment from `a` to `b`, where `a.z < z < b.z`.
pub(super) fn cut(a: DVec3, b: DVec3, z: f64) -> DVec3 {
    let p = a + (b - a) * ((z - a.z) / (b.z - a.z));
    DVec3::new(p.x, p.y, z)
}

/// By row of a map, the x at which an edge that runs up crosses the middle line of the row, and one that runs
/// down.
pub(super) type Sides = [[f64; SIDE]; 2];

/// Returns the rows from `first` to `last`, both included, whose middle lines are at `low` or above it, and
/// below `high`.
fn rows_between([low, high]: [f64; 2], [first, last]: [usize; 2]) -> Range<usize> {
    let from = |y: f64| {
        // Casts round towards zero, and to zero what is negative.
        let above = (y - 0.5).min(SIDE as f64);
        above as usize + usize::from(above > above as usize as f64)
    };
    let start = from(low).max(first);
    start..from(high).min(last + 1).max(start)
}

/// A triangle, and what two cuts leave of it.
pub(super) struct Polygon {
    points: [DVec3; 5],
    count: usize,
}

impl Polygon {
    /// Returns the part of a triangle between two depths.
    pub(super) fn cut([a, b, c]: [DVec3; 3], near: f64, far: f64) -> Self {
        let mut polygon = Self { points: [a, b, c, c, c], count: 3 };
        polygon.clip(near, 1.0);
        polygon.clip(far, -1.0);
        polygon
    }

    pub(super) fn points(&self) -> &[DVec3] {
        &self.points[..self.count]
    }

    /// Keeps the part with `z` at least `at` (`side` 1) or at most `at` (`side` -1).
    fn clip(&mut self, at: f64, side: f64) {
        let behind = |p: DVec3| (p.z - at) * side < 0.0;
        if !self.points().iter().any(|&p| behind(p)) {
            return;
        }
        let mut kept = Self { points: self.points, count: 0 };
        let mut push = |p| {
            // A convex polygon of three corners has at most one more after each of two cuts.
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
            // The same point whichever way the edge runs: neighbours are cut at the same points.
            let (low, high) = if a.z <= b.z { (a, b) } else { (b, a) };
            if low.z < at && high.z > at {
                push(cut(low, high, at));
            }
        }
        *self = kept;
    }

    /// Sets the pixels of `rect` in which the polygon, seen from the middle of the cell's front, meets the
    /// middle line of the pixel's row. Pixels that `map` has need not be set. Returns whether any was
    /// set. `sides` is scratch.
    pub(super) fn fill(
        &self,
        inside: &mut RayMap,
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
        let (left, right) = (left.max(rect.x[0] as f64), right.min(rect.x[1] as f64 + 0.5));
        let meets = first <= last && left <= right;
        if !meets {
            return false;
        }
        let (first, last) = (first as usize, (last as usize).min(rect.y[1]));
        if map.all_set(PixelRect { x: [left as usize, right as usize], y: [first, last] }) {
            return false;
        }
        // The rows whose middle lines are between the least and the greatest y: each is crossed by an edge
        // that runs up and by one that runs down. Beyond `rect` there are none.
        let rows = rows_between([low, high], [first, last]);
        for i in 0..count {
            let (a, b) = (p[i], p[if i + 1 == count { 0 } else { i + 1 }]);
            let side = &mut sides[usize::from(a[1] > b[1])];
            let slope = (b[0] - a[0]) / (b[1] - a[1]);
            let edge = rows_between([a[1].min(b[1]), a[1].max(b[1])], [first, last]);
            for (row, x) in edge.clone().zip(&mut side[edge]) {
                *x = a[0] + (row as f64 + 0.5 - a[1]) * slope;
            }
        }
        let mut any = false;
        for row in rows {
            let [up, down] = sides.each_ref().map(|side| side[row]);
            let (left, right) =
                (up.min(down).max(rect.x[0] as f64), up.max(down).min(rect.x[1] as f64 + 0.5));
            if left <= right {
                inside.set_span(row, left as usize, right as usize);
                any = true;
            }
        }
        any
    }
}
