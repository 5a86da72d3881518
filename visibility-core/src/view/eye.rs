//! The eye of a view, a point or a direction, with a bound on its rounding error.

use super::depth::Depth;
use glam::{DMat4, DVec3, DVec4};

/// Unit round-off of `f64`: 2^-53, the relative error of one rounded operation.
const U: f64 = f64::EPSILON / 2.0;

/// Where a view is seen from: a point for perspective views, a direction for parallel ones. Points are in
/// metres, relative to the origin that was passed to [`View::eye`](crate::View::eye).
///
/// ```
/// use visibility_core::{glam::DVec3, view::Eye, Pose, View};
/// let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
/// let view = View::perspective(pose, 1.0, 1.5, 0.1, f64::INFINITY)?;
/// assert!(matches!(view.eye(DVec3::ZERO), Eye::Point(_)));
/// # Ok::<(), visibility_core::view::ViewError>(())
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Eye {
    /// Perspective view: the point in which all view rays start, in metres relative to the chosen origin.
    Point(DVec3),
    /// Parallel (orthographic) view: the unit direction of all view rays, away from the viewer.
    Direction(DVec3),
}

/// Returns the eye of the clip matrix `m`: for a perspective view a point, in the coordinates of the points
/// that `m` maps to clip space; for a parallel view the unit direction of the view rays, away from the
/// viewer. `depth` tells which of two opposite directions points away.
pub(super) fn eye_of(m: &DMat4, depth: Depth) -> Eye {
    // The matrix maps the eye to x = y = w = 0. The eye is the vector orthogonal to these three rows, which
    // exists for every projection, whatever its depth row holds.
    let rows = [m.row(0), m.row(1), m.row(3)].map(scaled_by_power_of_two);
    let eye = orthogonal(rows, |a, b| a - b);
    let position = eye.truncate() / eye.w;
    if position.is_finite() {
        return Eye::Point(position);
    }
    // The rays of a parallel projection run along the direction that the three rows map to zero. Of its two
    // senses, the one in which depth grows (shrinks, if reversed) points away from the viewer.
    let scale = eye.truncate().abs().max_element();
    let direction = (eye.truncate() / scale).normalize_or_zero();
    let depth = m.row(2).truncate().dot(direction) * if depth.is_reversed() { -1.0 } else { 1.0 };
    Eye::Direction(if depth < 0.0 { -direction } else { direction })
}

/// Returns a bound on the error of the eye of the clip matrix `m`: in metres for a point; for a direction,
/// the length of the difference of unit vectors. Infinite where rounding leaves the eye undecided.
///
/// `eye_from_view` is the result of [`eye_of`] for `m`, `view_origin` the point of the world that `m` is
/// relative to, and `origin` the point of the world that the caller takes the eye relative to. See
/// [`ViewProjection::eye_error`](super::ViewProjection::eye_error).
pub(super) fn eye_error(m: &DMat4, eye_from_view: Eye, view_origin: DVec3, origin: DVec3) -> f64 {
    // The eye is orthogonal to three rows of the matrix. With the rows scaled by powers of two, each
    // component is a sum of six products of three numbers. Each product is rounded twice as a product and at
    // most four times in sums, so `12u` (`u = 2^-53`) of the sum of the products' magnitudes exceeds the
    // error.
    let rows = [m.row(0), m.row(1), m.row(3)].map(scaled_by_power_of_two);
    let eye = orthogonal(rows, |a, b| a - b);
    let size = orthogonal(rows.map(DVec4::abs), |a, b| a + b);
    let error = size * (16.0 * U) + DVec4::splat(1e-290);
    match eye_from_view {
        Eye::Direction(_) => {
            let length = eye.truncate().length();
            let direction = eye.truncate() / length;
            // Length and quotient round by at most 6u. The factor 2 covers this, since it doubles the 16u of
            // each component's terms.
            let error = 2.0 * error.truncate().length() / length;
            // The depth row decides which of the two senses points away from the viewer. If its product with
            // the direction is within the error, or NaN, the direction is unknown.
            let depth = m.row(2).truncate();
            let is_certain =
                size.w == 0.0 && depth.dot(direction).abs() > 2.0 * error * depth.abs().element_sum();
            if is_certain { error } else { f64::INFINITY }
        }
        Eye::Point(_) => {
            let position = eye.truncate() / eye.w;
            let off = (error.truncate() + position.abs() * error.w) / eye.w.abs();
            let sums = position.abs() + view_origin.abs() + origin.abs();
            let error = 1.01 * off.length() + 8.0 * U * sums.element_sum();
            // The error of the quotient is linear in the error of the divisor only if the divisor's error is
            // small.
            let is_certain = eye.w.abs() > 1024.0 * size.w * (16.0 * U) && error.is_finite();
            if is_certain { error } else { f64::INFINITY }
        }
    }
}

/// Returns a row of the clip matrix divided by the greatest power of two that does not exceed its largest
/// magnitude. The division is exact unless that magnitude is subnormal. It does not change the eye. It keeps
/// products of rows within the range of `f64` where the magnitudes of the rows differ by many orders.
fn scaled_by_power_of_two(row: DVec4) -> DVec4 {
    let most = row.abs().max_element();
    let power = f64::from_bits(most.to_bits() & (0x7ff << 52));
    row / if power.is_normal() { power } else { most }
}

/// Returns the 4D vector orthogonal to three vectors, by cofactors; `subtract` must then be subtraction. With
/// addition for `subtract` and the magnitudes of the vectors' components, returns the sum of the magnitudes
/// of the terms of each component instead.
fn orthogonal([a, b, c]: [DVec4; 3], subtract: impl Fn(f64, f64) -> f64) -> DVec4 {
    let minor = |i: usize, j: usize, k: usize| {
        let x = subtract(b[j] * c[k], b[k] * c[j]);
        let y = subtract(b[i] * c[k], b[k] * c[i]);
        let z = subtract(b[i] * c[j], b[j] * c[i]);
        subtract(a[i] * x, a[j] * y) + a[k] * z
    };
    let negative = subtract(0.0, 1.0);
    DVec4::new(minor(1, 2, 3), negative * minor(0, 2, 3), minor(0, 1, 3), negative * minor(0, 1, 2))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::DoubleDouble;
    use visibility_testing::Random;

    fn matrix(rows: [DVec4; 4]) -> DMat4 {
        DMat4::from_cols(rows[0], rows[1], rows[2], rows[3]).transpose()
    }

    fn whole(random: &mut Random, size: i32) -> DVec3 {
        DVec3::from_array([(); 3].map(|()| f64::from(random.between(-size, size))))
    }

    /// Rows that are nearly parallel, of integers, so that the eye of the matrix is known.
    #[test]
    fn a_point_is_within_its_bound_of_the_eye() {
        let mut random = Random(51);
        let (mut off, mut certain) = (0, 0);
        for round in 0..20_000 {
            let (eye, common) = (whole(&mut random, 1 << 20), whole(&mut random, 1 << 24));
            let spread = 1 << random.between(1, 24);
            let rows = [(); 4].map(|()| {
                let row = common + whole(&mut random, spread);
                row.extend(-row.dot(eye))
            });
            let m = matrix(rows);
            let found = eye_of(&m, Depth::ZeroToOne);
            let bound = eye_error(&m, found, DVec3::ZERO, DVec3::ZERO);
            let Eye::Point(at) = found else { continue };
            let distance = at.distance(eye);
            assert!(distance <= bound, "{round}: {at} is {distance} m off {eye}, of at most {bound}");
            certain += u32::from(bound < f64::INFINITY);
            off += u32::from(bound < f64::INFINITY && distance > bound / 64.0);
        }
        assert!(certain > 10_000 && off > 500, "{certain} with a bound, {off} not far below it");
        // Rows of which one is the sum of the others have no point: `w` of the eye is 0 but for rounding.
        let mut rounded = 0;
        for round in 0..1000 {
            let [x, y] = [(); 2].map(|()| (random.fine_vector(1.0) * 2f64.powi(40)).round());
            let rows = [x.extend(1.0), y.extend(2.0), DVec4::new(0.3, 0.7, 0.9, 0.0), (x + y).extend(1.0)];
            let m = matrix(rows);
            let found = eye_of(&m, Depth::ZeroToOne);
            rounded += u32::from(matches!(found, Eye::Point(_)));
            let bound = eye_error(&m, found, DVec3::ZERO, DVec3::ZERO);
            assert_eq!(bound, f64::INFINITY, "{round}: {found:?} of rows in one plane");
        }
        assert!(rounded > 100, "{rounded} matrices that rounding gives a point");
    }

    /// The eye relative to a far origin: sums of the eye and the difference of origins are rounded.
    #[test]
    fn a_point_is_within_its_bound_of_the_eye_from_far_origins() {
        let mut random = Random(52);
        for round in 0..5000 {
            let [view_origin, origin] = [(); 2].map(|()| random.fine_vector(1e9));
            let eye = whole(&mut random, 100);
            let row = |linear: DVec3| linear.extend(-linear.dot(eye));
            let m = matrix([row(DVec3::X), row(DVec3::Y), row(DVec3::ONE), row(DVec3::Z)]);
            let found = eye_of(&m, Depth::ZeroToOne);
            assert_eq!(found, Eye::Point(eye), "{round}: the eye from the view's origin");
            let at = eye + (view_origin - origin);
            let off = DVec3::from_array([0, 1, 2].map(|k| {
                let exact = DoubleDouble::difference(view_origin[k], origin[k]).plus(eye[k].into());
                exact.plus((-at[k]).into()).hi
            }));
            let bound = eye_error(&m, found, view_origin, origin);
            assert!(off.length() <= bound, "{round}: {at} is {} m off, of at most {bound}", off.length());
            assert!(bound < 1e-5, "{round}: the bound is {bound} m");
        }
        let m = matrix([DVec4::X, DVec4::Y, DVec4::ONE, DVec4::Z]);
        let bound = eye_error(&m, eye_of(&m, Depth::ZeroToOne), DVec3::ZERO, DVec3::NAN);
        assert_eq!(bound, f64::INFINITY, "from an origin that is no point");
    }

    /// Two nearly parallel rows of integers, whose cross product is the direction.
    #[test]
    fn a_direction_is_within_its_bound_or_unknown() {
        let mut random = Random(53);
        let (mut off, mut certain) = (0, 0);
        for round in 0..20_000 {
            let common = whole(&mut random, 1 << 28);
            let spread = 1 << random.between(1, 24);
            let [x, y] = [(); 2].map(|()| common + whole(&mut random, spread));
            let [p, q] = [x, y].map(|v| v.to_array().map(|v| v as i128));
            let exact = [(1, 2), (2, 0), (0, 1)].map(|(i, j)| (p[i] * q[j] - p[j] * q[i]) as f64);
            let exact = DVec3::from_array(exact).normalize_or_zero();
            // The depth row is along the direction, or across it up to rounding.
            let is_across = round % 2 == 1;
            let depth = if is_across { x } else { exact };
            let m = matrix([x.extend(3.0), y.extend(5.0), depth.extend(0.0), DVec4::W]);
            let found = eye_of(&m, Depth::ZeroToOne);
            let bound = eye_error(&m, found, DVec3::ZERO, DVec3::ZERO);
            let Eye::Direction(along) = found else { continue };
            if is_across {
                assert_eq!(bound, f64::INFINITY, "{round}: depth does not grow along {along}");
                continue;
            }
            let distance = along.distance(exact);
            assert!(distance <= bound, "{round}: {along} is {distance} off {exact}, of at most {bound}");
            certain += u32::from(bound < f64::INFINITY);
            off += u32::from(bound < f64::INFINITY && distance > bound / 64.0);
        }
        assert!(certain > 5000 && off > 100, "{certain} with a bound, {off} not far below it");
        // The third row is the sum of the first two in x, y and z: `w` of the eye is 0 without rounding, but
        // it is a sum of terms that are not.
        let rows = [[1.0, 0.0, 1.0, 0.0], [0.0, 1.0, 1.0, 0.0], [1.0, 1.0, 1.0, 0.0], [1.0, 1.0, 2.0, 1.0]];
        let m = matrix(rows.map(DVec4::from_array));
        let found = eye_of(&m, Depth::ZeroToOne);
        assert!(matches!(found, Eye::Direction(_)), "{found:?} of three rows in one plane");
        let bound = eye_error(&m, found, DVec3::ZERO, DVec3::ZERO);
        assert_eq!(bound, f64::INFINITY, "a direction that may be a point");
    }
}
