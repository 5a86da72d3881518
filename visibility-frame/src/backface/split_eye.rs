//! The eye in the form that the cone test takes, and the arithmetic of the test itself.

use visibility_core::glam::DVec3;
use visibility_core::view::ViewProjection;
use visibility_core::{View, view::Eye};

/// An eye in the coordinates of the cones. Each coordinate is the sum `high + low` of two `f32`, so that the
/// difference of eye and apex loses no digits where coordinates are large. For a parallel view, `high + low`
/// is the negated view direction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SplitEye {
    high: [f32; 3],
    low: [f32; 3],
    /// Factor by which the apex is multiplied before it is subtracted from the eye: 1 for an eye point, 0
    /// for a direction (parallel view).
    weight: f32,
    /// Bound on the uncertainty of the eye, to be multiplied by a cone's `margin`: `2^-100 + 5 r / (32 u)`,
    /// derived at [`inside`]. Here `u = 2^-24`, and `r` is the greatest distance of the true eye from this
    /// eye.
    blur: f32,
}

impl SplitEye {
    /// An eye whose position is unknown: no cone holds it, so nothing is culled.
    pub(crate) const UNKNOWN: Self = Self { high: [f32::NAN; 3], low: [0.0; 3], weight: 1.0, blur: f32::NAN };

    /// Returns the bound on the uncertainty of the eye.
    #[cfg(test)]
    pub(crate) fn blur(&self) -> f32 {
        self.blur
    }

    /// Converts an eye whose coordinates, relative to the origin of the cones, are exact.
    pub(crate) fn new(eye: &Eye) -> Self {
        match *eye {
            Eye::Point(eye) => Self::around(eye, 1.0, 0.0),
            Eye::Direction(direction) => Self::around(-direction, 0.0, 0.0),
        }
    }

    /// Returns the eye at point `p` (`weight` 1), or the parallel view with negated direction `p` (`weight`
    /// 0). The true eye or negated direction lies within `radius` of `p`.
    pub(crate) fn around(p: DVec3, weight: f32, radius: f64) -> Self {
        let high = p.as_vec3();
        let low = (p - high.as_dvec3()).as_vec3();
        let blur = f64::from(f32::MIN_POSITIVE) * 67108864.0 + 5.0 * 524288.0 * radius;
        Self { high: high.to_array(), low: low.to_array(), weight, blur: blur as f32 }
    }

    /// Returns the eye of a view relative to `origin`. `None` if rounding leaves open whether the eye is a
    /// point or a direction, or if its error is too large: for a point, the bound in metres is infinite; for
    /// a direction, the bound on the length of the difference of unit vectors is 1e-3 or more.
    pub(crate) fn of_view(view: &View, origin: DVec3) -> Option<Self> {
        let projection = ViewProjection::new(view, origin);
        let error = projection.eye_error();
        match projection.eye() {
            Eye::Point(eye) => error.is_finite().then(|| Self::around(eye, 1.0, error)),
            Eye::Direction(along) => (error < 1e-3).then(|| Self::around(-along, 0.0, error)),
        }
    }
}

/// Number of `f32` values that describe a cone in the test: nine matrix elements by rows, the three
/// coordinates of the apex, the margin.
pub(crate) const NUMBERS: usize = 13;

/// Tests an eye against `WIDTH` cones at once. Result `i` is negative if cone `i` certainly holds the eye
/// (the eye sees only backs), otherwise zero or positive; also zero for NaN. `cones[n][i]` is number `n` of
/// cone `i` in the order of [`NUMBERS`]. All SIMD paths give the same results.
///
/// The bound on rounding: let `v` be the eye minus the apex, `w = rows * v` with the exact rows, `|(x, y)|`
/// the Euclidean length, and `u = 2^-24`. The cone holds the eye if `w.z + |(w.x, w.y)| <= 0`. Let `s` be the
/// greatest magnitude in `rows`, and `S` the sum of the magnitudes of the components of `v`. Then
///
/// - `high` is the `f32` nearest to the eye, and the apex is an `f32` as well, so `|low| <= |v|` on each
///   axis. The error of a component of `v` is at most `3u |v|` for two roundings, of `high` minus apex and of
///   the sum, and `u |low| <= u |v|` for the rounding of `low`.
/// - The error of a component of `w` is at most `3u s S` for its products and sums, `u s S` for the rounding
///   of `rows`, and `4u s S` for that of `v`: together less than `8.1 u s S`.
/// - The error of `w.z + |(w.x, w.y)|` is at most `1 + 2^1/2` times that: less than `20u s S`. The margin is
///   `32u s S`; the rounding of the margin itself is a millionth of it.
/// - An eye that is off by `r` changes `w.z + |(w.x, w.y)|` by less than `4.2 s r`. The field
///   `SplitEye::blur` contains `5 r / (32 u)` for this.
/// - Flushing of denormals changes components of `v` by up to `2^-126`, and the result by up to `2^-123 s`.
///   The term `2^-100` of the blur allows for `2^-119 s`. Flushing also changes products, by less than
///   `2^-122` without the factor `s`; the last `2^-50` allows for this, see the next item.
/// - The code compares squares instead of lengths, which takes five more roundings; `16u` are available for
///   these. Squares of numbers above `2^-50` are well above the denormals. Squares of smaller components may
///   be flushed, which loses `2^-126` beside `2^-100`. With the `2^-122` of the previous item, `4u` of each
///   side of the comparison remain, at least `2^-74`.
/// - An overflow makes a side of a comparison infinite or NaN. The comparison then decides nothing, or
///   decides what is true anyway.
#[inline(always)]
pub(super) fn inside<const WIDTH: usize>(cones: [&[f32; WIDTH]; NUMBERS], eye: &SplitEye) -> [f32; WIDTH] {
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
        // `outside` is false for NaN; the result is then 0, which means that the cone does not hold the eye.
        let outside = square < depth * depth;
        found[i] = if outside { depth + MIN_DEPTH } else { 0.0 };
    }
    found
}

/// [`inside`] counts an eye as inside a cone only if the eye's `depth`, which is `w.z` plus the margin and
/// negative inside, is below minus this number, `2^-50`. Squares of smaller depths come near the denormals,
/// so eyes that close count as outside.
const MIN_DEPTH: f32 = 1.0 / 1_125_899_906_842_624.0;

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::Pose;
    use visibility_core::geometry::DoubleDouble;
    use visibility_core::view::Window;
    use visibility_testing::Random;

    /// Eyes next to the apex of a cone that is a half-space, far from the origin: an eye on the front side of
    /// the exact plane is not inside.
    #[test]
    fn eyes_before_a_far_plane_are_not_behind_it() {
        let mut random = Random(91);
        let (mut tried, mut behind) = (0, 0);
        for round in 0..100_000 {
            let apex = random.vec3(-1e6, 1e6);
            let normal = random.vec3(-1.0, 1.0);
            let near = 2f64.powi(-random.between(4, 24));
            let across = normal.as_dvec3().cross(random.fine_vector(near));
            let eye = apex.as_dvec3() + across;
            let term = |k: usize| {
                DoubleDouble::difference(eye[k], apex[k].into()).times(f64::from(normal[k]).into())
            };
            let height = term(0).plus(term(1)).plus(term(2)).hi;
            // 32 units of round-off of the greatest element.
            let margin = 16.0 * f32::EPSILON * normal.abs().max_element();
            let [a, b, c] = normal.to_array().map(|x| [x]);
            let [x, y, z] = apex.to_array().map(|x| [x]);
            let zero = [0.0];
            let numbers = [&zero, &zero, &zero, &zero, &zero, &zero, &a, &b, &c, &x, &y, &z, &[margin]];
            let found = inside::<1>(numbers, &SplitEye::new(&Eye::Point(eye)))[0];
            if height >= 0.0 {
                tried += 1;
                assert!(found >= 0.0, "{round}: {eye} is {height} before the plane at {apex} along {normal}");
            }
            let far = apex.as_dvec3() - normal.as_dvec3() * 0.125;
            behind += u32::from(inside::<1>(numbers, &SplitEye::new(&Eye::Point(far)))[0] < 0.0);
        }
        assert!(tried > 40_000 && behind > 50_000, "{tried} before a plane, {behind} far behind it");
    }

    /// The blur holds the error of the eye, which grows with the distance of the view's origin.
    #[test]
    fn the_error_of_a_view_is_in_the_blur() {
        let pose = Pose::look_at(DVec3::new(1.0, 2.0, 3.0), DVec3::new(4.0, 5.0, 9.0), DVec3::Z);
        let point = View::perspective(pose, 1.0, 1.5, 0.1, 100.0);
        let parallel = View::orthographic(pose, Window::centered(10.0, 10.0), 0.1, 100.0);
        for view in [point, parallel] {
            let view = view.unwrap();
            for origin in [DVec3::ZERO, DVec3::splat(1e12)] {
                let projection = ViewProjection::new(&view, origin);
                let (eye, error) = (projection.eye(), projection.eye_error());
                let found = SplitEye::of_view(&view, origin);
                assert!(found.is_some(), "{eye:?} is known");
                let blur = SplitEye::new(&eye).blur;
                let added = f64::from(found.map_or(0.0, |found| found.blur)) - f64::from(blur);
                let least = 5.0 * 524_288.0 * error - f64::from(f32::EPSILON * blur);
                assert!(error > 0.0 && added >= 0.99 * least, "{eye:?}: {added} for an error of {error}");
            }
        }
    }
}
