//! Axis-aligned openings.

use visibility_core::glam::{DVec2, DVec3};

/// An opening in a wall at right angles to an axis, in world space.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Rectangle {
    /// The corner with the least coordinates.
    pub min: DVec3,
    /// The corner with the greatest coordinates; the same as `min` along `axis`.
    pub max: DVec3,
    /// The axis at right angles to the wall: 0, 1 or 2.
    pub axis: usize,
    /// Whether lines pass towards greater coordinates along `axis`.
    pub forward: bool,
}

impl Rectangle {
    /// The rectangle as seen along an axis: a segment in the plane of the two axes that follow it, by its
    /// left and its right end. `None` if it is seen as a rectangle.
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

    /// The corners, counter-clockwise around the direction in which lines pass.
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
