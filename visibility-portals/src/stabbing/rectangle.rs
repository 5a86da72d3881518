//! Axis-aligned rectangles as openings that lines pass.

use visibility_core::glam::{DVec2, DVec3};

/// An opening in a wall perpendicular to an axis, in world space.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Rectangle {
    /// Corner with the least coordinates, in world space.
    pub min: DVec3,
    /// Corner with the greatest coordinates, in world space; equal to `min` along `axis`.
    pub max: DVec3,
    /// The axis perpendicular to the wall: 0 for x, 1 for y, 2 for z.
    pub axis: usize,
    /// Direction in which lines pass: `true` towards greater coordinates along `axis`, `false` towards
    /// lesser.
    pub forward: bool,
}

impl Rectangle {
    /// Returns the rectangle projected along `axis`: a segment in the plane of the two axes that follow
    /// `axis` cyclically. The two parts are the end that lines pass on their left, then the end that lines
    /// pass on their right. `None` if the wall is perpendicular to `axis`.
    pub(super) fn seen_along(&self, axis: usize) -> Option<[DVec2; 2]> {
        let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
        // For lines along the first axis of the projection, the second axis points left. For lines along the
        // second axis, the first axis points right.
        let [left, right] = match self.axis {
            a if a == i => [DVec2::new(self.min[i], self.max[j]), DVec2::new(self.min[i], self.min[j])],
            a if a == j => [DVec2::new(self.min[i], self.min[j]), DVec2::new(self.max[i], self.min[j])],
            _ => return None,
        };
        Some(if self.forward { [left, right] } else { [right, left] })
    }

    /// Returns the four corners in world space, counter-clockwise around the direction in which lines pass.
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
