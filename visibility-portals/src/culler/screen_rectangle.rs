//! Screen-space bounding rectangles: the narrowing of Luebke and Georges, with four planes for each portal.

use super::view_planes::PortalView;
use super::window_plane::{Corner, U, WindowPlane};
use alloc::vec::Vec;
use core::cmp::Ordering;
use visibility_core::geometry::Plane;
use visibility_core::glam::DVec3;
use visibility_core::view::ClipRow;

/// Left, right, bottom and top of a rectangle on the screen, in NDC: quotients `x / w` and `y / w` of clip
/// coordinates. The whole screen is -1 to 1.
pub(super) type ScreenRectangle = [f64; 4];

/// Returns the screen-space rectangle around `corners`, intersected with the rectangle `outer`, both in NDC.
/// The corners are relative to the anchor of the view and may each be off by `error` world units. Returns
/// `outer` if a corner is NaN, at or behind the eye, or so near the eye that rounding decides.
pub(super) fn rectangle_around(
    eye_view: &PortalView,
    corners: &[Corner],
    error: f64,
    outer: ScreenRectangle,
) -> ScreenRectangle {
    // The value of a clip-matrix row at a corner is off by the row's own error plus `error` times the length
    // of the row's linear part. A quotient `q = x / w` whose terms are off by `dx` and `dw` is off by at most
    // `(dx + |q| dw) / (w - dw)`. Roundings of that bound are less than what `row.at` allows beyond the five
    // that it needs.
    let value = |row: &ClipRow, at: DVec3| {
        let (value, own) = row.at(at);
        (value, own + error * row.linear.length())
    };
    let mut bounds = [f64::INFINITY, f64::NEG_INFINITY, f64::INFINITY, f64::NEG_INFINITY];
    for corner in corners {
        let (w, dw) = value(&eye_view.rows[2], corner.at);
        // A corner that may be at the plane `w = 0` may project anywhere on the screen, and so may a NaN.
        if w.partial_cmp(&dw) != Some(Ordering::Greater) {
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

/// Appends to `sides` the planes of a rectangle on the screen, given in NDC, with normals to the inside. The
/// planes are anchor-relative and follow from the rows of the clip matrix: `x - left w >= 0` for the left
/// bound, where `x` and `w` are clip coordinates, and likewise for right, bottom and top. Planes whose error
/// is too large to bound anything are left out.
pub(super) fn push_rectangle_planes(
    eye_view: &PortalView,
    rectangle: ScreenRectangle,
    sides: &mut Vec<WindowPlane>,
) {
    // Let `s` be the sum of the lengths of the two terms of the difference `x - left w` of two rows, and `l`
    // the length of the difference. So `l` is at most `s`. With the unit round-off `u` = 2^-53, the
    // difference is rounded by `2u s`, the unit normal by `4u` of itself, the product with a point `p` by `4u
    // |p|`: at most `10u (s / l) |p|` in all. The offset is off by the errors of the rows, and rounded by
    // `6u` of itself.
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
    use crate::integer_vectors::Random;
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
            // Rows (x, 0) and (w, 0) in the plane z = 0 and a bound, all exact, in units of 2^-40. The
            // difference of the rows is far smaller than the rows, except for a component that is chosen at
            // random.
            let unit = (1u64 << 40) as f64;
            let bound = random.below(1 << 40);
            let w = [0; 2].map(|_| random.below(1 << 39));
            let spread = if round % 2 == 0 { 1 << 12 } else { 1 << 25 };
            let x = w.map(|w| (((bound * w) >> 27) + random.below(spread)) << 27);
            let row = [0, 1].map(|i| x[i] - bound * w[i]);
            // A point at right angles to the difference, which lies exactly on the plane.
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
            push_rectangle_planes(&eye_view, [bound as f64 / unit; 4], &mut sides);
            for side in &sides {
                assert!(!side.excludes(point, point, 0.0), "{x:?} {w:?} {bound}");
                // A point displaced outwards by 64 times the margin must be excluded.
                let out = point - side.plane.normal * (64.0 * side.margin(point.length()));
                assert!(
                    side.excludes(out, out, 0.0),
                    "{x:?} {w:?} {bound}: a point 64 margins outside is within"
                );
            }
            found[round % 2] += sides.len();
        }
        assert!(found.iter().all(|&count| count > 5_000), "{found:?}");
    }

    /// Rectangles and their planes hold points seen through them, wherever the corners and the rows of the
    /// view are within their errors, which are large here. Half of an error would not do.
    #[test]
    fn rectangles_hold_what_is_seen_through_exact_corners() {
        let mut random = visibility_testing::Random(3);
        let view =
            View::from_clip_from_world(DMat4::IDENTITY, visibility_core::view::Depth::ZeroToOne).unwrap();
        let mut eye_view = PortalView::new(&view).unwrap();
        let (mut sides, mut counts) = (Vec::new(), [0; 2]);
        for trial in 0..40_000 {
            let linear = [random.vector(1.0), random.vector(1.0), DVec3::X + random.vector(0.5)];
            // Only some of the errors are large, so that none hides another.
            let mut large = || if random.one_in(2) { random.unit() * random.unit() } else { 0.0 };
            let errors = [large(), large(), large()];
            let error = large();
            eye_view.rows = [0, 1, 2].map(|i| ClipRow { linear: linear[i], constant: 0.0, error: errors[i] });
            let at = random.vector(1.0) + DVec3::X;
            let toward = linear[random.below(3)] * if random.one_in(2) { 1.0 } else { -1.0 };
            let off = if random.one_in(4) { random.vector(0.5) } else { toward.normalize() };
            let exact = at + off * error;
            let [x, y, w] = [0, 1, 2].map(|i| {
                let off = [1.0, -1.0, random.range(-1.0, 1.0)][random.below(3)];
                linear[i].dot(exact) + errors[i] * off
            });
            let corner = Corner { at, edge: super::super::window_plane::EdgeSource::End };
            let outer = [f64::NEG_INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::INFINITY];
            let rectangle = rectangle_around(&eye_view, &[corner], error, outer);
            if rectangle != outer {
                let [left, right, bottom, top] = rectangle;
                let (x, y) = (x / w, y / w);
                assert!(w > 0.0, "trial {trial}: a corner behind the eye");
                assert!(left <= x && x <= right, "trial {trial}: {x} is in {rectangle:?}");
                assert!(bottom <= y && y <= top, "trial {trial}: {y} is in {rectangle:?}");
                counts[0] += 1;
            }
            // Planes of the rectangle around the exact place hold the point.
            if w > 0.0 {
                sides.clear();
                push_rectangle_planes(&eye_view, [x / w, x / w, y / w, y / w], &mut sides);
                for side in &sides {
                    assert!(!side.excludes(exact, exact, 0.0), "trial {trial}: {exact} is outside {side:?}");
                    counts[1] += 1;
                }
            }
        }
        assert!(counts.iter().all(|&count| count > 10_000), "{counts:?}");
    }
}
