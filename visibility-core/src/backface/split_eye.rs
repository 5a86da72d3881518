//! The eye in the form that the cone test takes, and the arithmetic of the test itself.

use crate::view::ViewProjection;
use crate::{View, view::Eye};
use glam::DVec3;

/// An eye, relative to the origin of the cones, as the sum of two `f32` per coordinate, so that its
/// difference to an apex loses no digits where coordinates are large. For a parallel view, the negated view
/// direction in the same form.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SplitEye {
    high: [f32; 3],
    low: [f32; 3],
    /// 1 for an eye point. 0 for a direction, from which no apex is subtracted.
    weight: f32,
    /// Bound for the rounding and the uncertainty of the eye, scaled to multiply a cone's `margin`: the sum
    /// of `2u` times the sum of the coordinates' magnitudes (`u = 2^-24`), `2^-100`, and `5 * 2^19` times
    /// the greatest distance from the true eye.
    blur: f32,
}

impl SplitEye {
    /// An eye whose position is unknown: no cone holds it, so nothing is culled.
    pub(crate) const UNKNOWN: Self = Self { high: [f32::NAN; 3], low: [0.0; 3], weight: 1.0, blur: f32::NAN };

    /// Converts an eye whose coordinates are exact.
    pub(crate) fn new(eye: &Eye) -> Self {
        match *eye {
            Eye::Point(eye) => Self::around(eye, 1.0, 0.0),
            Eye::Direction(direction) => Self::around(-direction, 0.0, 0.0),
        }
    }

    /// Converts a point, or a direction if `weight` is 0, that lies within `radius` of `p`.
    fn around(p: DVec3, weight: f32, radius: f64) -> Self {
        let high = p.as_vec3();
        let low = (p - high.as_dvec3()).as_vec3();
        let blur =
            f64::from(f32::EPSILON) * p.abs().element_sum() + f64::from(f32::MIN_POSITIVE) * 67108864.0;
        let blur = (blur + 5.0 * 524288.0 * radius) as f32;
        Self { high: high.to_array(), low: low.to_array(), weight, blur: blur.next_up() }
    }

    /// Returns the eye of a view relative to `origin`. `None` if rounding leaves open whether the eye is a
    /// point or a direction, or if the bound on its error is infinite (for a direction: 1e-3 or more).
    pub(crate) fn of_view(view: &View, origin: DVec3) -> Option<Self> {
        let projection = ViewProjection::new(view, origin);
        let error = projection.eye_error();
        match projection.eye() {
            Eye::Point(eye) => error.is_finite().then(|| Self::around(eye, 1.0, error)),
            Eye::Direction(along) => (error < 1e-3).then(|| Self::around(-along, 0.0, error)),
        }
    }
}

/// Count of numbers of a cone in the test: nine matrix elements by rows, three of the apex, the margin.
pub(crate) const NUMBERS: usize = 13;

/// Tests an eye against `WIDTH` cones at once. Result `i` is negative if cone `i` certainly holds the eye,
/// otherwise zero or positive. `cones` holds the [`NUMBERS`] of the cones as structure of arrays. All SIMD
/// paths give the same results.
///
/// With `v` the eye minus the apex and `w = rows * v`, the cone holds the eye if `w.z + |(w.x, w.y)| <= 0`,
/// for `rows` before they were rounded. Let `u = 2^-24`, `s` the greatest element of `rows`, `S` the sum of
/// the magnitudes in `v`, `E` that in the eye. Then
///
/// - a component of `v` is two roundings off, `2u |v|` and `u |low| <= u^2 E`, and what two `f32` cannot hold
///   of the eye, `u^2 E`;
/// - a component of `w` is off by `3u` for the rounding of its products and sums, `u` for that of `rows` and
///   `2u` for that of `v`, each of `s S`, and by `2u^2 s E`: less than `6.1 u s S + 2.1 u^2 s E`;
/// - `w.z + |(w.x, w.y)|` by `1 + 2^1/2` times that, less than `15u s S + 6u^2 s E`. The margin is `32u s (S
///   + 2u E)`: its own rounding is a millionth of it.
/// - An eye off by `r` moves it by less than `4.2 s r`; the blur holds `5 r / 32u`.
/// - Flushed denormals take `2^-126` from components of `v`, which is `2^-123 s` in the end; the blur's
///   `2^-100` gives `2^-119 s`. They take as much from products: less than `2^-122`, without the factor `s`,
///   and nothing next to `2^-50`, on which more below.
/// - Comparing squares instead: five more roundings, for which 16u are there. Squares of what exceeds `2^-50`
///   are well above denormals (those of smaller components may be flushed: `2^-126` next to `2^-100`), and,
///   with `2^-122` as above, `4u` of either side of the comparison remain, at least `2^-74`.
/// - An overflow is infinite or NaN, on either side of either comparison, and then decides nothing or what is
///   true anyway.
#[inline(always)]
pub(crate) fn inside<const WIDTH: usize>(cones: [&[f32; WIDTH]; NUMBERS], eye: &SplitEye) -> [f32; WIDTH] {
    let [xx, xy, xz, yx, yy, yz, zx, zy, zz, ax, ay, az, margin] = cones;
    let SplitEye { high, low, weight, blur } = *eye;
    let mut found = [0.0; WIDTH];
    for i in 0..WIDTH {
        let x = (high[0] - weight * ax[i]) + low[0];
        let y = (high[1] - weight * ay[i]) + low[1];
        let z = (high[2] - weight * az[i]) + low[2];
        let wx = (xx[i] * x + xy[i] * y) + xz[i] * z;
        let wy = (yx[i] * x + yy[i] * y) + yz[i] * z;
        let wz = (zx[i] * x + zy[i] * y) + zz[i] * z;
        let size = ((x.abs() + y.abs()) + z.abs()) + blur;
        let depth = wz + margin[i] * size;
        let square = (wx * wx + wy * wy) * (1.0 + 8.0 * f32::EPSILON);
        // False for NaN, and then the result is 0: not held.
        let outside = square < depth * depth;
        found[i] = if outside { depth + LEAST } else { 0.0 };
    }
    found
}

/// `2^-50`, added to a depth so that only depths below `-2^-50` count: their squares are far above the
/// denormals.
const LEAST: f32 = 1.0 / 1_125_899_906_842_624.0;
