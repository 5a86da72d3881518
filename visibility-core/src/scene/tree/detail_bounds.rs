//! Bounds on the objects of a node: their size, and the distance up to which they are drawn.

#[cfg(doc)]
use crate::Aabb;
use crate::scene::boxes64::{Boxes64, FAN_OUT};

/// Upper bounds on the objects below a node of the hierarchy.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct DetailBounds {
    /// Greatest squared diagonal of the boxes of the objects below, in square metres, as
    /// [`Aabb::diagonal_squared`] computes it.
    pub diagonal_squared: f64,
    /// Greatest distance at which an object may still be drawn, in metres; infinite if an object has no
    /// limit.
    pub end: f32,
}

impl DetailBounds {
    /// The bounds of a node without objects.
    pub(in crate::scene) const NONE: Self = Self { diagonal_squared: 0.0, end: 0.0 };

    pub(super) fn max(self, other: Self) -> Self {
        Self {
            diagonal_squared: self.diagonal_squared.max(other.diagonal_squared),
            end: self.end.max(other.end),
        }
    }
}

/// Returns [`Aabb::diagonal_squared`] of the box in each lane; 0 for lanes without a box.
#[inline(always)]
pub(super) fn diagonals_squared(boxes: &Boxes64) -> [f64; FAN_OUT] {
    let mut sums = [0.0; FAN_OUT];
    for axis in 0..3 {
        let (min, max) = (&boxes.coordinates[axis], &boxes.coordinates[axis + 3]);
        for lane in 0..FAN_OUT {
            let side = f64::from(max[lane]) - f64::from(min[lane]);
            let side = if side > 0.0 { side } else { 0.0 };
            sums[lane] += side * side;
        }
    }
    sums
}
