//! Directions on the plan as numbers, without angles: the point of the unit diamond `|x| + |y| = 1` in the
//! direction, measured along it. Grows counter-clockwise from 0 to 4 as the angle does.
//!
//! # Rounding
//! With `u = 2^-53`: the sum rounds once, the quotient once, and adding a whole number once: at most `4u` of
//! the result's largest value 4, so two directions are told apart if they differ by more than `2^-49`.

/// Returns the direction number of a vector other than zero, from 0 to 4: 0 for +x, 1 for +y, 2 for -x, 3 for
/// -y.
#[inline]
pub(crate) fn diamond(x: f64, y: f64) -> f64 {
    let part = y / (x.abs() + y.abs());
    if x >= 0.0 { if y >= 0.0 { part } else { 4.0 + part } } else { 2.0 - part }
}

/// Returns the direction numbers of the first and the last direction, counter-clockwise, in which a disc is
/// seen whose centre is at `(x, y)` relative to the eye, and a bound on the error of both. `power` is `x^2 +
/// y^2 - r^2` and must be positive.
#[inline]
pub(crate) fn disc_span(x: f64, y: f64, radius: f64, power: f64) -> (f64, f64, f64) {
    // A tangent from the eye is of the length `t`, the root of the power. It meets the circle at right
    // angles, so its direction is that of the centre turned by the angle whose sine is `r / d` and cosine
    // `t / d`.
    let t = visibility_core::geometry::sqrt(power);
    let first = diamond(x * t + y * radius, y * t - x * radius);
    let last = diamond(x * t - y * radius, y * t + x * radius);
    // The power is rounded by 4u of `d^2 + r^2 <= 2 d^2`, so `t` is off by `4u d^2 / t`, the angle by that
    // over `d`, or `4u d / t <= 4u d^2 / t^2`; in numbers of the diamond, whose sides run at most at the rate
    // sqrt(2). Other roundings are below `16u`.
    let squared = x * x + y * y;
    (first, last, 8.0 * f64::EPSILON + 4.0 * f64::EPSILON * (squared / power))
}

/// Returns the direction numbers of the first and the last direction, counter-clockwise, in which a rectangle
/// is seen, given by its least and greatest coordinates relative to the eye. `None` if the eye is in it.
#[inline]
pub(crate) fn rectangle_span(x0: f64, y0: f64, x1: f64, y1: f64) -> Option<(f64, f64)> {
    // The corners that bound the rectangle, counter-clockwise, by the side that the eye is on.
    let (first, last) = if x0 > 0.0 {
        ([if y0 > 0.0 { x1 } else { x0 }, y0], [if y1 < 0.0 { x1 } else { x0 }, y1])
    } else if x1 < 0.0 {
        ([if y1 < 0.0 { x0 } else { x1 }, y1], [if y0 > 0.0 { x0 } else { x1 }, y0])
    } else if y0 > 0.0 {
        ([x1, y0], [x0, y0])
    } else if y1 < 0.0 {
        ([x0, y1], [x1, y1])
    } else {
        return None;
    };
    Some((diamond(first[0], first[1]), diamond(last[0], last[1])))
}
