//! Bounding rectangles on the screen: the narrowing of Luebke and Georges, with four planes for each portal.

use super::portal_view::PortalView;
use super::window_plane::{Corner, U, WindowPlane};
use alloc::vec::Vec;
use visibility_core::geometry::Plane;
use visibility_core::glam::DVec3;
use visibility_core::view::ClipRow;

/// Left, right, bottom and top of a rectangle on the screen, as quotients `x / w` and `y / w` of clip
/// coordinates: -1 to 1 is the whole screen.
pub(super) type Rectangle = [f64; 4];

/// The rectangle on the screen around corners that may each be off by `error`, within `outer`.
///
/// A row of the clip matrix at a corner is off by the row's own error and by `error` times its length. A
/// quotient `q = x / w` whose terms are off by `dx` and `dw` is off by at most `(dx + |q| dw) / (w - dw)`.
pub(super) fn around(eye_view: &PortalView, corners: &[Corner], error: f64, outer: Rectangle) -> Rectangle {
    let value = |row: &ClipRow, at: DVec3| {
        let (value, own) = row.at(at);
        (value, own + error * row.linear.length())
    };
    let mut bounds = [f64::INFINITY, f64::NEG_INFINITY, f64::INFINITY, f64::NEG_INFINITY];
    for corner in corners {
        let (w, dw) = value(&eye_view.rows[2], corner.at);
        // A corner so near the eye may be anywhere on the screen; so may a NaN.
        if w.is_nan() || dw.is_nan() || w <= 4.0 * dw {
            return outer;
        }
        for axis in 0..2 {
            let (x, dx) = value(&eye_view.rows[axis], corner.at);
            let q = x / w;
            let off = (dx + q.abs() * dw) / (w - dw) + 4.0 * U * q.abs();
            bounds[axis * 2] = bounds[axis * 2].min(q - off);
            bounds[axis * 2 + 1] = bounds[axis * 2 + 1].max(q + off);
        }
    }
    [bounds[0].max(outer[0]), bounds[1].min(outer[1]), bounds[2].max(outer[2]), bounds[3].min(outer[3])]
}

/// Adds the planes of a rectangle on the screen: `x - left w >= 0` and so on, by rows of the clip matrix.
/// Planes that are known too little to bound anything are left out.
///
/// Let `s` be the sum of the lengths of the two parts of a row, and `l` that of their difference, so that
/// `s >= l`. The difference is rounded by `2u s`, the unit normal by `4u` of itself, the product with a point
/// `x` by `4u |x|`: at most `10u (s / l) |x|` in all. The offset is off by what the rows are, and rounded by
/// `6u` of itself.
pub(super) fn push_sides(eye_view: &PortalView, rectangle: Rectangle, sides: &mut Vec<WindowPlane>) {
    let w = &eye_view.rows[2];
    for (i, bound) in rectangle.into_iter().enumerate() {
        let x = &eye_view.rows[i / 2];
        let sign = if i % 2 == 0 { 1.0 } else { -1.0 };
        let linear = (x.linear - w.linear * bound) * sign;
        let length = linear.length();
        let size = x.linear.length() + bound.abs() * w.linear.length();
        let constants = x.constant.abs() + (bound * w.constant).abs();
        let slope = 16.0 * U * size / length;
        let slack = (x.error + bound.abs() * w.error + 8.0 * U * constants) / length;
        let offset = (x.constant - w.constant * bound) * sign / length;
        if slope < 0.25 && slack.is_finite() && offset.is_finite() {
            sides.push(WindowPlane { plane: Plane::new(linear / length, offset), slope, slack });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::whole_numbers::Random;
    use visibility_core::View;
    use visibility_core::glam::DMat4;

    #[test]
    fn points_on_the_edge_of_a_rectangle_are_within_its_planes() {
        let mut random = Random(9);
        let view =
            View::from_clip_from_world(DMat4::IDENTITY, visibility_core::view::Depth::ZeroToOne).unwrap();
        let mut eye_view = PortalView::new(&view).unwrap();
        let (mut sides, mut found) = (Vec::new(), [0; 2]);
        for round in 0..20_000 {
            // Rows (x, 0) and (w, 0) in the plane z = 0 and a bound, all exact, in units of 2^-40. Their
            // difference is far smaller than they are, but for the parts that are chosen so that it is not.
            let unit = (1u64 << 40) as f64;
            let bound = random.below(1 << 40);
            let w = [0; 2].map(|_| random.below(1 << 39));
            let spread = if round % 2 == 0 { 1 << 12 } else { 1 << 25 };
            let x = w.map(|w| (((bound * w) >> 27) + random.below(spread)) << 27);
            let row = [0, 1].map(|i| x[i] - bound * w[i]);
            // A point at right angles to the difference: on the plane, exactly.
            let point = DVec3::new(row[1] as f64, -row[0] as f64, 0.0);
            if [row[1], -row[0]].map(|k| k as f64 as i128) != [row[1], -row[0]] {
                continue;
            }
            let exact = |v: [i128; 2], unit: f64| {
                let linear = DVec3::new(v[0] as f64, v[1] as f64, 0.0) * unit;
                ClipRow { linear, constant: 0.0, error: 0.0 }
            };
            eye_view.rows = [exact(x, 1.0), exact(x, 1.0), exact(w, unit)];
            sides.clear();
            push_sides(&eye_view, [bound as f64 / unit; 4], &mut sides);
            for side in &sides {
                assert!(!side.excludes(point, point, 0.0), "{x:?} {w:?} {bound}");
                // A step outwards of 64 times the margin is outside.
                let out = point - side.plane.normal * (64.0 * side.margin(point.length()));
                assert!(side.excludes(out, out, 0.0));
            }
            found[round % 2] += sides.len();
        }
        assert!(found.iter().all(|&count| count > 5_000), "{found:?}");
    }
}
