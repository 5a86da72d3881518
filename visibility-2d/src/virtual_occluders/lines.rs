//! Points on the plan with bounds on their errors, and certain tests on which side of a line they are.

/// Unit round-off of `f64`: 2^-53.
pub(crate) const U: f64 = f64::EPSILON / 2.0;

/// Point on the plan in metres relative to the scene's origin.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub(crate) struct Point {
    pub(crate) x: f64,
    pub(crate) y: f64,
    /// Bound on the distance from the exact point along each axis. 0 for an exact point.
    pub(crate) error: f64,
}

impl Point {
    /// Makes an exact point.
    pub(crate) const fn exact(x: f64, y: f64) -> Self {
        Self { x, y, error: 0.0 }
    }

    /// Returns whether two points are certainly identical.
    pub(crate) fn is(self, other: Self) -> bool {
        self == other && self.error == 0.0
    }
}

/// Returns twice the area of the triangle minus a bound on its error. At least 0 only if `c` is certainly to
/// the left of the line from `a` to `b` or on it. NaN for NaN.
///
/// With `p` and `q` the vectors from `a` to `b` and `c`, the area is a difference of two products of
/// differences: each product is rounded by less than `4u` of itself, the difference by `u`. The errors of the
/// points change `p` by at most `e` along each axis and `q` by at most `f`, and so the area by at most `e
/// |q|_1 + f |p|_1 + 2 e f`. An underflow loses less than the least positive number.
pub(crate) fn left_of(a: Point, b: Point, c: Point) -> f64 {
    let (px, py, qx, qy) = (b.x - a.x, b.y - a.y, c.x - a.x, c.y - a.y);
    let (first, second) = (px * qy, py * qx);
    let (e, f) = (a.error + b.error, a.error + c.error);
    let of_points = e * (qx.abs() + qy.abs()) + f * (px.abs() + py.abs()) + 2.0 * e * f;
    (first - second)
        - (8.0 * U * (first.abs() + second.abs()) + (1.0 + 16.0 * U) * of_points + f64::MIN_POSITIVE)
}

/// Returns whether all of `points` are certainly to the left of the line from `a` to `b` or on it.
pub(crate) fn all_left_of(a: Point, b: Point, points: &[Point]) -> bool {
    points.iter().all(|&point| left_of(a, b, point) >= 0.0)
}
