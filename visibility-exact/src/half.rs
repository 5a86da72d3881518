//! Half-spaces, whose heights are exact where the plane is perpendicular to an axis.

use visibility_core::glam::DVec3;

/// A half-space: the points x with `normal . x + offset >= 0`, in front of its plane. The normal is a unit
/// vector.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Half {
    pub(crate) normal: DVec3,
    pub(crate) offset: f64,
}

impl Half {
    #[inline]
    pub(crate) fn height(&self, x: DVec3) -> f64 {
        self.normal.dot(x) + self.offset
    }

    /// Returns the axis (0, 1 or 2) that the plane is perpendicular to. One coordinate, without rounding,
    /// then decides on which side of the plane a point lies. `None` for a tilted plane, also if the tilt is
    /// so small that a component of the normal rounds to 1.
    #[inline]
    pub(crate) fn axis(&self) -> Option<usize> {
        (0..3).find(|&k| self.normal.abs() == DVec3::AXES[k])
    }

    /// Returns whether a point lies on the plane exactly. False for planes that are not perpendicular to an
    /// axis.
    #[inline]
    pub(crate) fn holds(&self, x: DVec3) -> bool {
        self.axis().is_some_and(|k| x[k] == -self.offset * self.normal[k])
    }

    /// Returns the point at which the edge from `a` to `b` crosses the plane. `heights` are those of `a` and
    /// of `b` over the plane. If the plane is perpendicular to an axis, the point is exactly on the plane.
    pub(crate) fn crossing(&self, a: DVec3, b: DVec3, heights: [f64; 2]) -> DVec3 {
        let mut x = a + (b - a) * (heights[0] / (heights[0] - heights[1]));
        if let Some(k) = self.axis() {
            x[k] = -self.offset * self.normal[k];
        }
        x
    }

    /// Returns the half-space enlarged by `pad` metres; unchanged if the plane is perpendicular to an axis,
    /// where heights are exact.
    pub(crate) fn padded(&self, pad: f64) -> Self {
        Self { offset: if self.axis().is_some() { self.offset } else { self.offset + pad }, ..*self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tilt_that_rounds_away_is_no_axis() {
        let tilted = Half { normal: DVec3::new(1e-9, 0.0, 1.0).normalize(), offset: 0.0 };
        assert_eq!(
            (tilted.normal.z, tilted.axis()),
            (1.0, None),
            "the tilt rounds away, and the plane has no axis"
        );
        let (a, b) = (DVec3::new(100.0, 0.0, 1.0), DVec3::new(100.0, 0.0, -1.0));
        assert!(
            (tilted.crossing(a, b, [tilted.height(a), tilted.height(b)]).z + 1e-7).abs() < 1e-14,
            "the crossing at 100 m is 1e-7 m aside"
        );
        assert_eq!(Half { normal: -DVec3::Y, offset: 2.0 }.axis(), Some(1), "the plane is along y");
    }
}
