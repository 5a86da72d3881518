//! Openings along the axes, which lines pass if they do so in three projections.

use visibility_core::glam::{DVec2, DVec3};

/// An opening in a wall at right angles to an axis.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Rectangle {
    /// The corner with the least coordinates.
    pub min: DVec3,
    /// The one with the greatest; the same as `min` along the axis.
    pub max: DVec3,
    /// The axis, 0, 1 or 2, along which lines go through.
    pub axis: usize,
    /// Whether they go towards greater coordinates.
    pub forward: bool,
}

impl Rectangle {
    /// As seen along an axis: its left and its right end, in the plane of the two axes that follow. `None` if
    /// it is seen as a whole.
    pub(super) fn seen_along(&self, axis: usize) -> Option<[DVec2; 2]> {
        let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
        // Towards the second axis, the third is to the left; towards the third, the second is to the right.
        let [left, right] = match self.axis {
            a if a == i => [DVec2::new(self.min[i], self.max[j]), DVec2::new(self.min[i], self.min[j])],
            a if a == j => [DVec2::new(self.min[i], self.min[j]), DVec2::new(self.max[i], self.min[j])],
            _ => return None,
        };
        Some(if self.forward { [left, right] } else { [right, left] })
    }

    /// Counter-clockwise around the way that lines take.
    pub(super) fn corners(&self) -> [DVec3; 4] {
        let (i, j) = ((self.axis + 1) % 3, (self.axis + 2) % 3);
        let corner = |at_i: f64, at_j: f64| {
            let mut p = self.min;
            p[i] = at_i;
            p[j] = at_j;
            p
        };
        let (a, b) = (self.min, self.max);
        let mut corners = [corner(a[i], a[j]), corner(b[i], a[j]), corner(b[i], b[j]), corner(a[i], b[j])];
        if !self.forward {
            corners.reverse();
        }
        corners
    }
}
