//! A ray against boxes and triangles, decided with margins: a triangle is missed, possibly met or certainly
//! met.
//!
//! The sides of the ray on which the three edges of a triangle pass decide (Woop, Benthin and Wald,
//! "Watertight Ray/Triangle Intersection", 2013). An aggressive answer needs both directions of doubt: what
//! *may* block a ray counts as blocking, and only what is *certainly* met counts as seen.

use visibility_core::glam::{DVec3, Vec3};

/// Unit round-off of `f64`, 2^-53.
const U: f64 = f64::EPSILON / 2.0;

/// A ray that starts at a viewpoint, in metres relative to the scene's origin.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ray {
    pub(super) origin: DVec3,
    /// Direction whose component of greatest magnitude is about 1. A parameter is a multiple of it.
    pub(super) along: DVec3,
    inverse: DVec3,
    /// Squared length of `along`, from 1 to 3.
    length_squared: f64,
}

/// Where a ray meets a triangle, as parameters of the ray.
#[derive(Clone, Copy, Debug)]
pub(super) struct Meeting {
    /// Lower bound of the parameter, possibly negative.
    pub(super) least: f64,
    /// Upper bound of the parameter; infinite if the ray may miss the triangle.
    pub(super) most: f64,
}

impl Meeting {
    /// Returns whether the ray certainly meets the triangle.
    pub(super) fn is_certain(&self) -> bool {
        self.most < f64::INFINITY
    }
}

impl Ray {
    /// Makes the ray from `origin` through `target`. `None` if the two are equal or not finite.
    pub(super) fn through(origin: DVec3, target: DVec3) -> Option<Self> {
        let along = target - origin;
        let greatest = along.abs().max_element();
        if !(greatest > 1e-250 && greatest.is_finite()) {
            return None;
        }
        let along = along / greatest;
        Some(Self { origin, along, inverse: along.recip(), length_squared: along.length_squared() })
    }

    /// Returns the point of the ray at a parameter.
    pub(super) fn at(&self, parameter: f64) -> DVec3 {
        self.origin + self.along * parameter
    }

    /// Returns a lower bound of the parameter at which the ray enters a box, at least 0. `None` if the ray
    /// certainly misses the box.
    ///
    /// A computed bound of a slab errs by a difference, an inverse and a product, less than 4u of itself.
    /// Enter and exit are compared with twice that.
    pub(super) fn enter(&self, min: Vec3, max: Vec3) -> Option<f64> {
        let (mut enter, mut exit) = (0.0f64, f64::INFINITY);
        for axis in 0..3 {
            let (o, along) = (self.origin[axis], self.along[axis]);
            let (low, high) = (f64::from(min[axis]), f64::from(max[axis]));
            if along == 0.0 {
                if o < low || o > high {
                    return None;
                }
                continue;
            }
            let (near, far) = if along > 0.0 { (low, high) } else { (high, low) };
            enter = enter.max((near - o) * self.inverse[axis]);
            exit = exit.min((far - o) * self.inverse[axis]);
        }
        let lower = enter * (1.0 - 8.0 * U);
        (lower <= exit + exit.abs() * (8.0 * U)).then_some(lower)
    }

    /// Tests a triangle whose corners are known up to `slack` metres on each axis. `None` if the ray
    /// certainly misses the triangle.
    ///
    /// # Rounding
    /// With the corners `p` relative to the ray's origin and `d` the direction, the ray passes the edge from
    /// `p` to `q` on the side of the sign of `d . (p x q)`. `|d| <= 1` on each axis; let `P` and `Q` be the
    /// greatest magnitudes of the coordinates of `p` and `q`. Differences err by u of themselves, so each of
    /// the two products in a component of the cross product errs by less than 3.1u P Q, the component by less
    /// than 8.3u P Q. The three terms of the dot product have magnitudes up to 2 P Q and err by 10.4u P Q
    /// each, their sum by another 12u P Q: less than 44u P Q in all. The margin is 128u P Q, and 12 (P + Q +
    /// slack) slack for the doubt about the corners, of which 6 would do.
    ///
    /// The point of the triangle that is met is the mean of the corners, weighted by the three values.
    /// Weights that err by the sum `m` of the margins move the point, within the triangle, by less than
    /// `4 m / sum` of the difference of the corners' parameters. A corner's parameter is a dot product of
    /// three terms over the squared length and errs by less than 32u P, and by 2 slack.
    pub(super) fn meet(&self, corners: &[Vec3; 3], slack: f64) -> Option<Meeting> {
        let p = corners.map(|corner| corner.as_dvec3() - self.origin);
        let size = p.map(|p| p.abs().max_element());
        let (mut sides, mut margins) = ([0.0; 3], [0.0; 3]);
        for i in 0..3 {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            sides[i] = self.along.dot(p[j].cross(p[k]));
            margins[i] = 128.0 * U * size[j] * size[k]
                + 12.0 * (size[j] + size[k] + slack) * slack
                + f64::MIN_POSITIVE;
        }
        let every = |test: &dyn Fn(usize) -> bool| (0..3).all(test);
        if !(every(&|i| sides[i] >= -margins[i]) || every(&|i| sides[i] <= margins[i])) {
            return None;
        }
        let t = p.map(|p| p.dot(self.along) / self.length_squared);
        let (first, last) = (t[0].min(t[1]).min(t[2]), t[0].max(t[1]).max(t[2]));
        let rounding = 32.0 * U * size[0].max(size[1]).max(size[2]) + 2.0 * slack;
        if last + rounding < 0.0 {
            return None;
        }
        let sum = sides[0] + sides[1] + sides[2];
        let margin = margins[0] + margins[1] + margins[2];
        let certain = every(&|i| sides[i] > margins[i]) || every(&|i| sides[i] < -margins[i]);
        // Where the ray runs almost in the plane of the triangle, the place of the meeting is not known.
        if !certain || sum.abs() < 1024.0 * margin {
            return Some(Meeting { least: first - rounding, most: f64::INFINITY });
        }
        let at = (sides[0] * t[0] + sides[1] * t[1] + sides[2] * t[2]) / sum;
        let doubt = 4.0 * margin / sum.abs() * (last - first) + 2.0 * rounding;
        if at + doubt < 0.0 {
            return None;
        }
        Some(Meeting { least: (at - doubt).max(first - rounding), most: at + doubt })
    }
}
