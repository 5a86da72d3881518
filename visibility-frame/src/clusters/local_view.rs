//! Planes and eye of a view in the coordinates of an instance's mesh, with bounds on their rounding.
//!
//! An instance maps a point `p` of its mesh to `A p + t`, where `A` has the columns `a`, `b`, `c`. The
//! numbers of the transform are exact: they are what the engine draws with. With `u = 2^-53`:
//!
//! # Planes
//! The plane `n . q + d >= 0` is `(n . a, n . b, n . c) . p + (n . t + d) >= 0` in mesh coordinates, also for
//! mirroring transforms. The normal is within `16u` of the view's own in each component, a product and two
//! sums round by `3u`, and the division by the normal's length by `u`. So each component is off by at most
//! `20u` of the sum of its terms' magnitudes. The same holds for the offset: the sum with `d` rounds once
//! more, but the terms of `d` have fewer roundings. The code uses `32u`. Its other `12u` cover the three
//! roundings of the plane's own error, which admits every point of the mesh if it exceeds all magnitudes.
//! Where terms cancel, as under a shear or far from the origin, such an error may exceed the length of the
//! normal. Errors of the normal, times the greatest coordinate of the mesh, therefore count as errors of the
//! offset. A product that underflows loses less than the least normal number.
//!
//! # Eye
//! The eye `e` is at `A^-1 (e - t)`. The rows of the inverse are `b x c`, `c x a` and `a x b` over the
//! determinant `a . (b x c)`.
//! - A component of these cross products is the difference of two products of `f32`, which are exact in
//!   `f64`: it is off by `u` of itself.
//! - The determinant is a sum of three products with such components: `u + u + 2u` of the sum of magnitudes.
//!   The code uses `8u`.
//! - A row times `e - t` adds the `u` of the difference: `5u`, and the quotient `u`. The code uses `8u`. The
//!   error of the eye itself counts with the sum of the row's magnitudes.
//! - A quotient is off by the error of the numerator, plus the error of the denominator times the quotient,
//!   over the exact determinant. The exact determinant is at least `1 - 2^-10` of the computed one if the
//!   computed one is at least `2^10` times its error. A transform with a smaller determinant counts as flat.

use crate::backface::SplitEye;
use visibility_core::frustum::ConvexVolume;
use visibility_core::geometry::Plane;
use visibility_core::glam::{Affine3A, DVec3, Vec3A};
use visibility_core::simd::Simd;
use visibility_core::view::{Eye, MAX_PLANES, ViewPlane, ViewPlanes};

/// Unit round-off of `f64`.
const U: f64 = f64::EPSILON / 2.0;

/// Planes and eye of a view in mesh coordinates.
pub(super) struct LocalView {
    pub(super) volume: ConvexVolume,
    pub(super) eye: SplitEye,
}

/// The transform of an instance, with its inverse up to a factor.
pub(super) struct Placement {
    axes: [DVec3; 3],
    translation: DVec3,
    /// Rows of the inverse of the matrix with the columns `axes`, times `determinant`.
    rows: [DVec3; 3],
    determinant: f64,
    determinant_error: f64,
}

impl Placement {
    /// Returns the placement of a transform. `None` if the transform is not finite, or so flat that the sign
    /// of its determinant is uncertain.
    pub(super) fn new(transform: &Affine3A) -> Option<Self> {
        if !transform.is_finite() {
            return None;
        }
        let exact = |v: Vec3A| DVec3::from_array(v.to_array().map(f64::from));
        let matrix = &transform.matrix3;
        let [a, b, c] = [matrix.x_axis, matrix.y_axis, matrix.z_axis].map(exact);
        let rows = [b.cross(c), c.cross(a), a.cross(b)];
        let determinant = a.dot(rows[0]);
        let determinant_error = 8.0 * U * a.abs().dot(rows[0].abs());
        let is_certain = determinant.abs() > 1024.0 * determinant_error;
        let translation = exact(transform.translation);
        is_certain.then_some(Self { axes: [a, b, c], translation, rows, determinant, determinant_error })
    }

    /// Returns the half-spaces of `planes` in mesh coordinates. Their errors hold for points whose
    /// coordinates have at most the magnitudes `reach`, in mesh units.
    pub(super) fn volume(&self, simd: Simd, planes: &ViewPlanes, reach: DVec3) -> ConvexVolume {
        let mut local = [ViewPlane { plane: Plane::new(DVec3::ZERO, 1.0), error: 0.0 }; MAX_PLANES];
        let mut count = 0;
        for view_plane in planes.as_slice() {
            if let Some(plane) = self.plane(view_plane, reach) {
                local[count] = plane;
                count += 1;
            }
        }
        ConvexVolume::new(simd, &local[..count])
    }

    /// Returns a view plane in mesh coordinates. `None` if its normal is zero there, or if a number
    /// overflows. See the module's documentation for the errors.
    pub(super) fn plane(&self, ViewPlane { plane, error }: &ViewPlane, reach: DVec3) -> Option<ViewPlane> {
        let n = plane.normal;
        let normal = DVec3::from_array(self.axes.map(|axis| n.dot(axis)));
        let offset = n.dot(self.translation) + plane.offset;
        let sizes = DVec3::from_array(self.axes.map(|axis| n.abs().dot(axis.abs())));
        let offset_size = n.abs().dot(self.translation.abs()) + plane.offset.abs();
        let rounding = 32.0 * U * (sizes.dot(reach) + offset_size);
        let underflow = 16.0 * f64::MIN_POSITIVE * (1.0 + reach.element_sum());
        let length = normal.length();
        let error = (rounding + error + underflow) / length;
        // A normal of no length makes the error infinite, and so does an offset that overflows.
        let unit = Plane::new(normal / length, offset / length);
        error.is_finite().then_some(ViewPlane { plane: unit, error })
    }

    /// Returns the eye in mesh coordinates. `eye` is relative to the scene's origin. `error` bounds its
    /// distance from the exact eye: in metres for a point; for a direction, the length of the difference of
    /// unit vectors. [`SplitEye::UNKNOWN`], which no cone holds, if the result's error is not finite or, for
    /// a direction, a thousandth or more.
    pub(super) fn eye(&self, eye: &Eye, error: f64) -> SplitEye {
        match *eye {
            Eye::Point(eye) => {
                let (p, radius) = self.inverse(eye - self.translation, error);
                if radius.is_finite() { SplitEye::around(p, 1.0, radius) } else { SplitEye::UNKNOWN }
            }
            Eye::Direction(along) => {
                let (p, radius) = self.inverse(along, error);
                // A direction is scaled to its greatest component. The quotients round by `u` of at most 1
                // each.
                let length = p.abs().max_element();
                let radius = radius / length * (1.0 + 16.0 * U) + 4.0 * U;
                if radius < 1e-3 { SplitEye::around(-p / length, 0.0, radius) } else { SplitEye::UNKNOWN }
            }
        }
    }

    /// Returns the vector that the transform's matrix (with the columns `axes`) maps to `v`, and a bound on
    /// its distance from the exact vector. Each component of `v` may be off by `u = 2^-53` times its
    /// magnitude, and by `error` besides.
    pub(super) fn inverse(&self, v: DVec3, error: f64) -> (DVec3, f64) {
        let p = DVec3::from_array(self.rows.map(|row| row.dot(v) / self.determinant));
        let radius = self.rows.iter().zip(p.to_array()).fold(0.0, |sum, (row, x)| {
            let size = row.abs().dot(v.abs());
            let numerator_error = 8.0 * U * size + row.abs().element_sum() * error + 8.0 * f64::MIN_POSITIVE;
            sum + (numerator_error + x.abs() * self.determinant_error) / self.determinant.abs()
        });
        (p, radius * 1.01)
    }
}
