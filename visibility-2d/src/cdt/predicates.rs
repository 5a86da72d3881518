//! Exact predicates of points: on which side of a line a point lies, and whether it lies in a circle.
//!
//! This work is based on: Jonathan Shewchuk, "Adaptive Precision Floating-Point Arithmetic and Fast Robust
//! Geometric Predicates", 1997, as implemented by the crate `robust`. The first filter of the orientation is
//! repeated here, so that the compiler can inline it.

use super::error::PlanError;
use robust::Coord;
use visibility_core::geometry::DoubleDouble;

/// Point of the plan: x and y in world units.
pub(crate) type Point = [f64; 2];

/// Greatest magnitude of a coordinate. The in-circle test multiplies four differences of coordinates: below
/// 1e242, far from overflow.
pub(crate) const MAX_MAGNITUDE: f64 = 1e60;

/// Least magnitude of a nonzero coordinate: smaller ones are set to 0. The last bit of a coordinate is then
/// at least 1e-56, and the product of four such bits at least 1e-224, so that no product of the predicates
/// underflows.
pub(crate) const MIN_MAGNITUDE: f64 = 1e-40;

/// Shewchuk's bound `(3 + 16 u) u` on the error of the orientation, relative to the sum of the magnitudes of
/// its two products; `u` is 2^-53.
pub(crate) const ORIENTATION_ERROR: f64 = 3.330_669_073_875_471_6e-16;

/// Returns whether heights are numbers up to [`MAX_MAGNITUDE`] in absolute value.
pub(crate) fn are_heights(heights: [f64; 2]) -> bool {
    heights.iter().all(|height| height.abs() <= MAX_MAGNITUDE)
}

fn coord([x, y]: Point) -> Coord<f64> {
    Coord { x, y }
}

/// Returns a positive number if `c` lies to the left of the line from `a` to `b`, a negative one if to the
/// right, and 0 if the three points are collinear. The sign is exact for coordinates of [`checked`].
#[inline(always)]
pub(crate) fn orient(a: Point, b: Point, c: Point) -> f64 {
    let left = (a[0] - c[0]) * (b[1] - c[1]);
    let right = (a[1] - c[1]) * (b[0] - c[0]);
    let difference = left - right;
    if difference.abs() > ORIENTATION_ERROR * (left.abs() + right.abs()) {
        return difference;
    }
    orient_slow(a, b, c)
}

#[cold]
#[inline(never)]
pub(crate) fn orient_slow(a: Point, b: Point, c: Point) -> f64 {
    robust::orient2d(coord(a), coord(b), coord(c))
}

/// Returns twice the signed area of a triangle with 106 bits of precision, positive if `a`, `b` and `c` turn
/// left. [`orient`] has the same sign, but where the points are nearly collinear its magnitude is not
/// precise.
///
/// The differences, and the products of their leading parts, are exact: [`DoubleDouble`] numbers. Only terms
/// below 2^-105 of the two products are left out.
pub(crate) fn area(a: Point, b: Point, c: Point) -> f64 {
    cross([c, a], [c, b])
}

/// Returns a bound on the error of [`area`]: 2^-102 of the sum of the magnitudes of its two products. With u
/// = 2^-53, each product is off by up to 8 u^2 (the low parts' product, two products with a low part, and two
/// sums), the difference of the low parts by 3 u^2, and its sum with the high one by 4 u^2: 15 of 16.
pub(crate) fn area_error(a: Point, b: Point, c: Point) -> f64 {
    let [x, y] = [0, 1].map(|axis| ((a[axis] - c[axis]) * (b[1 - axis] - c[1 - axis])).abs());
    (x + y) / (1u128 << 102) as f64
}

/// Returns the cross product of the vectors from `a` to `b` and from `c` to `d`, with 106 bits of precision
/// relative to its two products: positive if the second vector turns left from the first.
pub(super) fn cross([a, b]: [Point; 2], [c, d]: [Point; 2]) -> f64 {
    let difference = DoubleDouble::difference;
    let left = product(difference(b[0], a[0]), difference(d[1], c[1]));
    let right = product(difference(b[1], a[1]), difference(d[0], c[0]));
    let high = difference(left.hi, right.hi);
    high.hi + (high.lo + (left.lo - right.lo))
}

/// Returns the product of two numbers without that of their low parts. The high part is not rounded again.
fn product(a: DoubleDouble, b: DoubleDouble) -> DoubleDouble {
    let DoubleDouble { hi, lo } = DoubleDouble::product(a.hi, b.hi);
    DoubleDouble { hi, lo: lo + (a.hi * b.lo + a.lo * b.hi) }
}

/// Returns whether `d` lies strictly inside the circle through `a`, `b` and `c`, which turn left. Exact.
pub(crate) fn in_circle(a: Point, b: Point, c: Point, d: Point) -> bool {
    robust::incircle(coord(a), coord(b), coord(c), coord(d)) > 0.0
}

/// Returns whether `a` and `b` lie on the same side of `origin`, for three collinear points, `a` and `b`
/// different from `origin`.
pub(crate) fn is_same_way(origin: Point, a: Point, b: Point) -> bool {
    let axis = usize::from(a[0] == origin[0]);
    (a[axis] > origin[axis]) == (b[axis] > origin[axis])
}

/// Returns the point with coordinates below [`MIN_MAGNITUDE`] in magnitude, and -0, replaced by 0.
///
/// # Errors
/// [`PlanError::Coordinate`] with the given index if a coordinate is NaN or its magnitude exceeds
/// [`MAX_MAGNITUDE`].
pub(crate) fn checked(point: Point, index: usize) -> Result<Point, PlanError> {
    if !point.iter().all(|x| x.abs() <= MAX_MAGNITUDE) {
        return Err(PlanError::Coordinate { index, point });
    }
    Ok(point.map(|x| if x.abs() < MIN_MAGNITUDE { 0.0 } else { x }))
}
