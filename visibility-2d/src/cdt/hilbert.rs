//! Order of points along a space-filling curve: points close in the order are close in space.
//!
//! This work is based on: David Hilbert, "Ueber die stetige Abbildung einer Linie auf ein Flaechenstueck",
//! 1891. Location by binary search in the order adapts to the density of the points, which a grid does not.

use super::predicates::Point;

/// Space-filling curve through a rectangle, given by the rectangle's least corner and the number of the
/// curve's finest steps per world unit along each axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Curve {
    low: Point,
    scale: Point,
}

impl Curve {
    /// Makes the curve through the rectangle between two corners. If both corners have the same coordinate on
    /// an axis, only two positions on this axis are told apart: up to that coordinate, and beyond it.
    pub(crate) fn new(low: Point, high: Point) -> Self {
        let scale = core::array::from_fn(|axis| 4_294_967_040.0 / (high[axis] - low[axis]));
        Self { low, scale }
    }

    /// Returns the position of a point along a curve of 2^(2 `LEVELS`) steps: the index of the step at the
    /// point, in the highest 2 `LEVELS` bits of the result. `LEVELS` must be at most 32. The position at
    /// fewer levels is a prefix of the position at more levels. A point outside the rectangle gets the
    /// position of a point on its boundary.
    pub(crate) fn place<const LEVELS: u32>(&self, point: Point) -> u64 {
        // A cast to an integer saturates, and NaN becomes 0.
        let [mut x, mut y] =
            core::array::from_fn(|axis| ((point[axis] - self.low[axis]) * self.scale[axis]) as u32);
        let mut place = 0u64;
        for level in 0..LEVELS {
            let (right, upper) = (x >> (31 - level) & 1, y >> (31 - level) & 1);
            place = place << 2 | u64::from((3 * right) ^ upper);
            // Branchless: `swap` has all bits set in the lower quadrants, `mirror` only in the lower right
            // one.
            let swap = upper.wrapping_sub(1);
            let mirror = swap & 0u32.wrapping_sub(right);
            (x, y) = (x ^ mirror, y ^ mirror);
            let both = (x ^ y) & swap;
            (x, y) = (x ^ both, y ^ both);
        }
        place << (64 - 2 * LEVELS)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;

    #[test]
    fn the_curve_steps_from_neighbour_to_neighbour() {
        let curve = Curve::new([0.0, 0.0], [16.0, 16.0]);
        let mut cells: Vec<_> = (0..256)
            .map(|i: i32| {
                (curve.place::<4>([f64::from(i % 16) + 0.5, f64::from(i / 16) + 0.5]), i % 16, i / 16)
            })
            .collect();
        cells.sort_unstable();
        for pair in cells.windows(2) {
            let ((_, x, y), (_, u, v)) = (pair[0], pair[1]);
            assert_eq!((x - u).abs() + (y - v).abs(), 1, "steps from {x}, {y} to {u}, {v}");
        }
    }

    #[test]
    fn fewer_levels_are_a_prefix() {
        let curve = Curve::new([-3.0, 5.0], [9.0, 6.0]);
        for i in 0..1000 {
            let point = [f64::from(i * 7 % 13) - 3.0, 5.0 + f64::from(i) / 1000.0];
            assert_eq!(
                curve.place::<16>(point) >> 32,
                curve.place::<32>(point) >> 32,
                "{point:?}: 16 levels and 32"
            );
        }
    }
}
