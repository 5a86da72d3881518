//! Filling triangles row by row, with the nearest at each pixel centre.
//!
//! Coverage is decided on the edges' crossings with each row of centres. An edge is always taken from its upper to its
//! lower end, whichever triangle it belongs to, so two triangles that share it get the same crossing to the last bit:
//! one ends where the other begins. A centre is covered if `left <= x < right`, a row is met if `top <= y < bottom`:
//! the top-left rule of graphics APIs. The crossings of one row cut it into half-open intervals without gaps, so
//! a mesh has no cracks whatever the rounding; where rounding swaps two crossings that are within 1e-12 pixels, a centre
//! between them is covered twice, and the nearer triangle has it.

use alloc::vec::Vec;

/// A corner of a triangle on the screen.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Corner {
    /// Columns from the left side of the image; centres are at halves.
    pub(super) x: f64,
    /// Rows from the top of the image.
    pub(super) y: f64,
    /// Linear on the screen, greater for nearer points.
    pub(super) nearness: f64,
}

impl Corner {
    pub(super) fn is_finite(&self) -> bool {
        self.x.is_finite() && self.y.is_finite() && self.nearness.is_finite()
    }

    /// Order from top to bottom; the rest only makes it independent of the order in which corners come.
    fn is_above(&self, other: &Self) -> bool {
        (self.y, self.x, self.nearness) < (other.y, other.x, other.nearness)
    }
}

/// Per pixel, the nearest item so far and how near it is, in rows from the top.
#[derive(Clone, Debug)]
pub(super) struct Image {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) items: Vec<u32>,
    pub(super) nearness: Vec<f64>,
    /// Pixels covered so far, each as often as a triangle covers it.
    pub(super) layers: u64,
}

impl Image {
    /// Draws a triangle with finite corners, of any size and position.
    pub(super) fn fill(&mut self, corners: [Corner; 3], item: u32) {
        let [a, b, c] = corners;
        // Most triangles are small and miss all centres: find that out before anything is divided.
        let left = first_center(a.x.min(b.x).min(c.x), self.width);
        let right = first_center(a.x.max(b.x).max(c.x), self.width);
        let upper = first_center(a.y.min(b.y).min(c.y), self.height);
        let lower = first_center(a.y.max(b.y).max(c.y), self.height);
        if left >= right || upper >= lower {
            return;
        }
        let [top, middle, bottom] = sorted(corners);
        let Some(plane) = NearnessPlane::through(top, middle, bottom) else { return };
        let long = Edge::new(top, bottom);
        for short in [Edge::new(top, middle), Edge::new(middle, bottom)] {
            let rows = first_center(short.upper.y, self.height)..first_center(short.lower.y, self.height);
            for row in rows {
                let y = row as f64 + 0.5;
                let (a, b) = (long.crossing(y), short.crossing(y));
                let (first, end) = (first_center(a.min(b), self.width), first_center(a.max(b), self.width));
                self.fill_span(row, first, end, &plane, item);
            }
        }
    }

    #[inline]
    fn fill_span(&mut self, row: usize, first: usize, end: usize, plane: &NearnessPlane, item: u32) {
        let span = row * self.width + first..row * self.width + end;
        self.layers += (end - first) as u64;
        let in_row = plane.slope_y * (row as f64 + 0.5 - plane.reference.y);
        let mut x = first as f64 + 0.5;
        let (items, nearness) = (&mut self.items[span.clone()], &mut self.nearness[span]);
        for (held, held_nearness) in items.iter_mut().zip(nearness) {
            let linear = plane.reference.nearness + (plane.slope_x * (x - plane.reference.x) + in_row);
            let here = linear.max(plane.least).min(plane.greatest);
            // Strictly: of equally near items the first stays.
            if here > *held_nearness {
                *held_nearness = here;
                *held = item;
            }
            x += 1.0;
        }
    }
}

/// The number of pixel centres `0.5, 1.5, ..` below `v`, at most `limit`: the index of the first centre not below.
#[inline]
fn first_center(v: f64, limit: usize) -> usize {
    // The subtraction is exact for v >= 0.25, and below that the result is negative anyway.
    let t = v - 0.5;
    if t >= limit as f64 {
        limit
    } else if t > 0.0 {
        let whole = t as usize;
        whole + usize::from((whole as f64) < t)
    } else {
        0
    }
}

fn sorted([mut a, mut b, mut c]: [Corner; 3]) -> [Corner; 3] {
    if b.is_above(&a) {
        (a, b) = (b, a);
    }
    if c.is_above(&b) {
        (b, c) = (c, b);
        if b.is_above(&a) {
            (a, b) = (b, a);
        }
    }
    [a, b, c]
}

/// An edge from its upper to its lower end.
struct Edge {
    upper: Corner,
    lower: Corner,
    /// Columns per row.
    slope: f64,
}

impl Edge {
    fn new(upper: Corner, lower: Corner) -> Self {
        // For a level edge the slope is NaN or infinite, but no row lies between its ends to ask for it.
        Self { upper, lower, slope: (lower.x - upper.x) / (lower.y - upper.y) }
    }

    /// Where the edge crosses a row that it meets.
    fn crossing(&self, y: f64) -> f64 {
        self.upper.x + (y - self.upper.y) * self.slope
    }
}

/// Nearness as a linear function on the screen.
struct NearnessPlane {
    reference: Corner,
    slope_x: f64,
    slope_y: f64,
    least: f64,
    greatest: f64,
}

impl NearnessPlane {
    /// `None` for triangles without area. The range is kept because slopes of a triangle seen almost edge-on
    /// are mostly rounding; within it they can do no harm.
    fn through(a: Corner, b: Corner, c: Corner) -> Option<Self> {
        let (bx, by, bn) = (b.x - a.x, b.y - a.y, b.nearness - a.nearness);
        let (cx, cy, cn) = (c.x - a.x, c.y - a.y, c.nearness - a.nearness);
        let area = bx * cy - cx * by;
        if area == 0.0 {
            return None;
        }
        // Nearness grows from the farthest corner. Beginning there, errors grow with it too, and a
        // triangle that runs from before the eye to the horizon is precise at the horizon.
        let reference = [b, c].into_iter().fold(a, |far, v| if v.nearness < far.nearness { v } else { far });
        Some(Self {
            reference,
            slope_x: (bn * cy - cn * by) / area,
            slope_y: (bx * cn - cx * bn) / area,
            least: reference.nearness,
            greatest: a.nearness.max(b.nearness).max(c.nearness),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn centers_are_counted_half_open() {
        let count = |v| first_center(v, 10);
        assert_eq!([-1e300, -0.5, 0.0, 0.5, 1.5, 9.5, 1e300].map(count), [0, 0, 0, 0, 1, 9, 10]);
        assert_eq!([0.5f64.next_up(), 1.5f64.next_down(), 1.5f64.next_up()].map(count), [1, 1, 2]);
        assert_eq!((count(f64::NAN), count(f64::INFINITY)), (0, 10));
    }

    fn image() -> Image {
        let nearness = [f64::NEG_INFINITY; 1024].into();
        Image { width: 32, height: 32, items: [9; 1024].into(), nearness, layers: 0 }
    }

    fn at(x: f64, y: f64, nearness: f64) -> Corner {
        Corner { x, y, nearness }
    }

    #[test]
    fn the_order_of_corners_changes_nothing() {
        let slanted = [at(1.3, 2.7, 0.1), at(30.1, 9.9, 3.0), at(12.2, 31.4, 0.7)];
        let level = [at(1.3, 2.7, 0.1), at(30.1, 2.7, 3.0), at(12.2, 31.4, 0.7)];
        for c in [slanted, level] {
            let draw = |order: [usize; 3]| {
                let mut image = image();
                image.fill(order.map(|i| c[i]), 1);
                image
            };
            let first = draw([0, 1, 2]);
            assert!(first.items.iter().filter(|&&i| i == 1).count() > 300);
            for order in [[0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
                assert_eq!(draw(order).nearness, first.nearness, "{order:?}");
            }
        }
    }

    #[test]
    fn slivers_are_as_near_as_their_corners() {
        // A few units in the last place wide, so that a centre may be taken for inside that is one width outside, where
        // nearness would be anything.
        let mut random = crate::measure::tests::Random(2);
        let mut drawn = 0;
        for _ in 0..2000 {
            let corners: [Corner; 3] = core::array::from_fn(|_| {
                let steps = random.range(-4.0, 4.0).round();
                at(10.5 + steps * 2e-15, random.range(0.0, 32.0), random.range(1.0, 2.0))
            });
            let mut image = image();
            image.fill(corners, 1);
            for &nearness in image.nearness.iter().filter(|n| n.is_finite()) {
                assert!((1.0..=2.0).contains(&nearness), "{nearness} of {corners:?}");
                drawn += 1;
            }
        }
        assert!(drawn > 1000, "{drawn}");
    }
}
