//! Directions on the plan as numbers instead of angles. The number of a direction is the length along the
//! unit diamond `|x| + |y| = 1` from (1, 0) to the diamond's point in this direction, with sides of length 1.
//! It grows counter-clockwise from 0 to 4, as the angle does.
//!
//! # Rounding
//! With `u = 2^-53`: the sum, the quotient and the addition of a whole number round once each, by at most
//! `4u` of the result's largest value 4. So two directions are distinguished if they differ by more than
//! `2^-49`.

/// Returns the direction number of a vector other than zero, from 0 to 4: 0 for +x, 1 for +y, 2 for -x, 3 for
/// -y.
#[inline]
pub(crate) fn diamond(x: f64, y: f64) -> f64 {
    let part = y / (x.abs() + y.abs());
    if x >= 0.0 { if y >= 0.0 { part } else { 4.0 + part } } else { 2.0 - part }
}

/// Returns the first and the last direction, counter-clockwise, in which a disc is seen, and a bound on the
/// error of both, as direction numbers of [`diamond`]: from 0 to 4. The first is greater than the last if +x,
/// where the numbers begin again, is between them. The disc's centre is at `(x, y)` relative to the eye.
/// `power` is `x^2 + y^2 - r^2` and must be positive.
#[inline]
pub(crate) fn disc_span(x: f64, y: f64, radius: f64, power: f64) -> (f64, f64, f64) {
    // A tangent from the eye has length `t`, the root of the power, and is perpendicular to the radius at the
    // point of contact. So its direction is that of the centre rotated by the angle with sine `r / d` and
    // cosine `t / d`, where `d` is the distance of the centre.
    let t = visibility_core::geometry::sqrt(power);
    let first = diamond(x * t + y * radius, y * t - x * radius);
    let last = diamond(x * t - y * radius, y * t + x * radius);
    // The power has an error of `4u (d^2 + r^2) <= 8u d^2`, so `t` is off by `4u d^2 / t`, and the angle by
    // at most `4u d / t <= 4u d^2 / t^2`. Direction numbers change by at most sqrt(2) times as much. Other
    // roundings are below `16u`. Products of the least numbers underflow, each by up to 2^-1075.
    let squared = x * x + y * y;
    let of_power = 4.0 * f64::EPSILON * squared + f64::MIN_POSITIVE;
    (first, last, 8.0 * f64::EPSILON + of_power / power)
}

/// Returns the first and the last direction, counter-clockwise, in which a rectangle is seen, as direction
/// numbers of [`diamond`]: from 0 to 4. The first is greater than the last if +x, where the numbers begin
/// again, is between them. The rectangle is given by its least and greatest coordinates relative to the eye.
/// `None` if the eye is inside.
#[inline]
pub(crate) fn rectangle_span(x0: f64, y0: f64, x1: f64, y1: f64) -> Option<(f64, f64)> {
    // The two corners where the tangents from the eye touch the rectangle, counter-clockwise, chosen by the
    // side of the rectangle that the eye is on.
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

#[cfg(test)]
mod tests {
    use super::rectangle_span;

    /// From a side or corner of a rectangle, it is seen as from inside.
    #[test]
    fn rectangles_have_no_span_from_their_border() {
        for x in [-1.0, -0.5, 0.0] {
            for y in [-1.0, -0.5, 0.0] {
                assert_eq!(rectangle_span(x, y, x + 1.0, y + 1.0), None, "a unit square from ({x}, {y})");
            }
        }
        assert_eq!(rectangle_span(1.0, -1.0, 2.0, 1.0), Some((3.5, 0.5)), "a rectangle ahead");
    }
}
