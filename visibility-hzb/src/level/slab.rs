//! The slab of a polygon, the layer across its normal that holds its vertices, as the eye sees it: which side
//! of it is far, whether the eye is in front of all faces, and how near points on the far side are.

use super::frame::{LevelFrame, MIN_PARALLEL_COSINE};
use crate::setup::depth_plane::plane;
use crate::setup::screen_projection::U;
use crate::setup::screen_shape::tile_minimum_plane;
use visibility_core::glam::DVec3;
use visibility_occluders::OccluderPolygon;

/// Returns the coordinate, along a polygon's normal, of the far side of the polygon's slab. The slab is the
/// layer that holds the polygon's vertices; its far side is the one away from the eye. `None` if the polygon
/// does not occlude from the side on which the eye is, if the eye is in the slab, or if rays may meet the
/// slab before the near plane.
#[inline(always)]
pub(super) fn far_side(frame: &LevelFrame, polygon: &OccluderPolygon) -> Option<f64> {
    let [low, high] = polygon.extent;
    let along = polygon.normal.dot(frame.eye);
    let thickness = high - low;
    if !frame.perspective {
        let back = along > 0.0;
        let is_certain = along.abs() > MIN_PARALLEL_COSINE + frame.eye_error;
        let seen = is_certain && (polygon.two_sided || !back);
        let far = if back { high } else { low };
        let before_near = thickness > frame.most_flattened && !is_beyond_window(frame, polygon, far);
        return (seen && !before_near).then_some(far);
    }
    let margin = 16.0 * U * polygon.normal.abs().dot(frame.eye.abs()) + frame.eye_error;
    let front = along > high;
    let (far, beside) = if front { (low, along - high) } else { (high, low - along) };
    let seen = beside > margin && (polygon.two_sided || front);
    // Every ray then meets a face at no less than half the distance of the slab's far side, or beyond the
    // window, and so beyond the near plane.
    (seen && (beside > thickness + margin || is_beyond_window(frame, polygon, far))).then_some(far)
}

/// Returns 1 if the eye is in front of a polygon's slab (the layer that holds its vertices), -1 if behind it.
/// `far` is the coordinate along `normal` of the slab's far side.
#[inline(always)]
fn eye_side(frame: &LevelFrame, normal: DVec3, far: f64) -> f64 {
    let along = normal.dot(frame.eye);
    let front = if frame.perspective { along > far } else { along < 0.0 };
    if front { 1.0 } else { -1.0 }
}

/// Returns whether all of a polygon's slab (the layer that holds its vertices) is certainly beyond the eye's
/// window, a rectangle across the picture: see [`LevelFrame::window`]. If true, every point of the slab in
/// the picture is so far from the eye that outlines are not cut there. `far` is the coordinate along the
/// polygon's normal of the slab's far side.
#[inline(always)]
pub(super) fn is_beyond_window(frame: &LevelFrame, polygon: &OccluderPolygon, far: f64) -> bool {
    let (normal, anchor) = (polygon.normal, frame.projection.anchor);
    let side = eye_side(frame, normal, far);
    let near_side = if side > 0.0 { polygon.extent[1] } else { polygon.extent[0] };
    frame.window.is_some_and(|window| {
        window.iter().all(|&point| {
            let margin = 16.0 * U * (normal.abs().dot(anchor.abs() + point.abs()) + near_side.abs());
            let margin = margin + if frame.perspective { frame.eye_error } else { 0.0 };
            side * (normal.dot(anchor) + normal.dot(point) - near_side) > margin
        })
    })
}

/// Returns whether the eye is certainly in front of all faces of a polygon. `middle` and `radius` are the
/// middle and radius of a ball around the vertices of its outline.
#[inline(always)]
pub(super) fn faces_eye(frame: &LevelFrame, polygon: &OccluderPolygon, middle: DVec3, radius: f64) -> bool {
    let [low, high] = polygon.extent;
    // Square of the sine of the greatest angle between the normal and those of faces.
    let sine_squared = 1.0 - polygon.min_cosine * polygon.min_cosine + 1e-12;
    let along = polygon.normal.dot(frame.eye);
    // A lower bound on the height of the eye above the polygon's slab (the layer that holds its vertices),
    // and an upper bound on its distance from points of the polygon's faces. Far from the origin, the 3 u by
    // which a product of three terms is off, and the error of the eye itself, may be much of the
    // height; the subtraction rounds by u of the height, which the factor below covers. In a parallel view
    // the height is at least the sine, 1e-6, so the factor covers the product as well.
    // The distance needs no error of the eye. Let a be the greatest angle between the normal and those of
    // faces, and q a point of a face, at distance d in a direction at angle b from the normal. If the height
    // is more than d sin a + e, for an error e, so is d cos b, and b < 90° - a. The eye is at least
    // d cos(a + b) above the plane of the face. That is at least d (cos b - sin a), and so more than e, since
    // (1 - cos a) / sin a = tan(a / 2) is at most tan(45° - b / 2) = (1 - sin b) / cos b.
    let (height, distance) = if frame.perspective {
        let margin = 4.0 * U * polygon.normal.abs().dot(frame.eye.abs()) + frame.eye_error;
        let distance = (frame.eye - middle).length();
        (along - high - margin, distance + radius + 2.0 * (high - low))
    } else {
        (-along - frame.eye_error, 1.0)
    };
    height > 0.0 && height * height > sine_squared * distance * distance * (1.0 + 1e-5)
}

/// Returns the plane of least depth keys of a polygon, as a function of tile column and tile row: the key of
/// points whose coordinate along `normal` is `far`. The plane is computed from three points near the ball
/// around the polygon's vertices with the given middle and radius.
pub(super) fn depth_plane(
    frame: &LevelFrame,
    normal: DVec3,
    middle: DVec3,
    radius: f64,
    far: f64,
) -> [f32; 3] {
    let axis = normal.abs().min_position();
    let across = normal.cross(DVec3::AXES[axis]).normalize_or_zero() * radius;
    let along = normal.cross(across);
    // By rounding, a point whose coordinate along the normal should be `far` may miss that coordinate by a
    // few roundings.
    let rounding = 16.0 * f64::EPSILON * (normal.abs().dot(middle.abs()) + far.abs() + radius);
    let foot = middle + normal * (far - eye_side(frame, normal, far) * rounding - normal.dot(middle));
    let corners = [foot, foot + across, foot + along].map(|p| frame.object.at(p.to_array()));
    let plane = plane(corners.each_ref(), &frame.object, &frame.projection, &frame.plane_errors);
    tile_minimum_plane(plane, frame.projection.size)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::level::outline_rule::frame;
    use crate::random::random;
    use visibility_core::geometry::DoubleDouble;

    /// Returns a polygon of which only the slab and the directions of its faces count.
    fn polygon(normal: DVec3, extent: [f64; 2], min_cosine: f64, two_sided: bool) -> OccluderPolygon {
        OccluderPolygon { normal, extent, area: 1.0, min_cosine, edges: [0; 2], two_sided }
    }

    /// Returns `a . b` in double-double arithmetic.
    fn exact_dot(a: DVec3, b: DVec3) -> DoubleDouble {
        (0..3).fold(DoubleDouble::ZERO, |sum, i| sum.plus(DoubleDouble::product(a[i], b[i])))
    }

    fn vector(random: &mut impl FnMut(f64, f64) -> f64, size: f64) -> DVec3 {
        DVec3::from_array([0; 3].map(|_| random(-size, size)))
    }

    /// Eyes within some roundings of the sides of slabs, far from the origin: a far side is given only if the
    /// eye is beyond the other one, and farther from it than the slab is thick unless the window is clear of
    /// it, and if it is in front or the polygon has two sides.
    #[test]
    fn eyes_are_beyond_the_near_side_of_a_slab() {
        let (mut random, mut frame, mut found) = (random(51), frame(), [0; 2]);
        for trial in 0..40_000 {
            let normal = vector(&mut random, 1.0).normalize();
            frame.eye = vector(&mut random, 1e6);
            // A window in the direction in which a slab is left is clear of it, or none is.
            let away = if trial % 3 == 0 { Some(1e7) } else { None };
            let along = normal.dot(frame.eye);
            let unit = U * normal.abs().dot(frame.eye.abs());
            let thickness = if trial % 4 == 0 { 0.0 } else { random(0.0, 1e3) * unit };
            let beside = random(-20.0, 40.0) * unit + if trial % 2 == 0 { thickness } else { 0.0 };
            let is_front = trial % 8 < 4;
            let extent = if is_front {
                [along - beside - thickness, along - beside]
            } else {
                [along + beside, along + beside + thickness]
            };
            frame.projection.anchor = frame.eye;
            let side = if is_front { 1.0 } else { -1.0 };
            frame.window = away.map(|away| [normal * (side * away); 4]);
            let two_sided = trial % 16 < 8;
            let own = polygon(normal, extent, 1.0, two_sided);
            let height = |of: f64, sign: f64| {
                let above = exact_dot(normal, frame.eye).plus((-of).into());
                if sign > 0.0 { above.hi } else { -above.hi }
            };
            let far = far_side(&frame, &own);
            let thick = extent[1] - extent[0];
            let case = (trial, beside / unit, thickness / unit);
            if let Some(far) = far {
                let is_before = far == extent[0] && height(extent[1], 1.0) > 0.0;
                let sign = if is_before { 1.0 } else { -1.0 };
                let beside = height(if is_before { extent[1] } else { extent[0] }, sign);
                assert!(beside > 0.0, "{case:?}: the eye is {beside} before the slab, far is {far}");
                assert!(is_before || two_sided, "{case:?}: the back of a one-sided polygon");
                assert!(away.is_some() || beside > thick, "{case:?}: {beside} before a slab of {thick}");
            }
            let clear = if away.is_some() { 0.0 } else { thick };
            let is_clear = height(if is_front { extent[1] } else { extent[0] }, side) > clear + 32.0 * unit;
            let is_wanted = is_clear && (is_front || two_sided);
            assert!(far.is_some() || !is_wanted, "{case:?}: no far side");
            found[usize::from(far.is_some())] += 1;
        }
        assert!(found.iter().all(|&count| count > 5_000), "{found:?} without and with a far side");
    }

    /// The eye may be elsewhere by its error: no slab is certain that comes so near, from no side.
    #[test]
    fn slabs_within_the_error_of_the_eye_are_uncertain() {
        let mut frame = frame();
        (frame.eye, frame.projection.anchor, frame.eye_error) = (DVec3::Z, DVec3::Z, 0.01);
        for (beside, is_certain) in [(0.009, false), (0.011, true)] {
            frame.window = None;
            let own = polygon(DVec3::Z, [1.0 - beside; 2], 1.0, false);
            assert_eq!(far_side(&frame, &own).is_some(), is_certain, "{beside} m below the eye");
            assert_eq!(
                faces_eye(&frame, &own, own.normal, 0.0),
                is_certain,
                "faces {beside} m below the eye"
            );
            frame.window = Some([DVec3::Z; 4]);
            let thick = polygon(DVec3::Z, [0.0, 1.0 - beside], 1.0, false);
            assert_eq!(
                far_side(&frame, &thick).is_some(),
                is_certain,
                "a thick slab {beside} m below the eye"
            );
            frame.window = Some([DVec3::ZERO; 4]);
            assert_eq!(is_beyond_window(&frame, &thick, 0.0), is_certain, "a window {beside} m above a slab");
        }
    }

    /// In a parallel view, polygons count that are seen from a side on which they occlude, not along their
    /// plane, and not thicker than outlines may be flattened unless the window is clear of them.
    #[test]
    fn parallel_views_see_sides_that_occlude() {
        let mut frame = frame();
        (frame.perspective, frame.most_flattened, frame.window) = (false, 0.5, None);
        for (direction, two_sided, extent, wanted) in [
            (DVec3::NEG_Z, false, [1.0, 1.25], Some(1.0)),
            (DVec3::Z, true, [1.0, 1.25], Some(1.25)),
            (DVec3::Z, false, [1.0, 1.25], None),
            (DVec3::NEG_Z, true, [1.0, 1.25], Some(1.0)),
            (DVec3::new(1.0, 0.0, -0.02), true, [1.0, 1.25], Some(1.0)),
            (DVec3::new(1.0, 0.0, -0.005), true, [1.0, 1.25], None),
            (DVec3::NEG_Z, true, [1.0, 2.0], None),
            (DVec3::NEG_Z, true, [1.0, 1.5], Some(1.0)),
        ] {
            frame.eye = direction;
            let own = polygon(DVec3::Z, extent, 1.0, two_sided);
            assert_eq!(far_side(&frame, &own), wanted, "{direction}, two-sided: {two_sided}, {extent:?}");
        }
        // A window far along the view direction is clear of the slab.
        frame.eye = DVec3::NEG_Z;
        frame.window = Some([DVec3::Z * 100.0; 4]);
        let own = polygon(DVec3::Z, [1.0, 2.0], 1.0, true);
        assert_eq!(far_side(&frame, &own), Some(1.0), "a thick slab beyond the window");
        // The direction may be another by its error.
        let flat = polygon(DVec3::Z, [1.0; 2], 1.0, false);
        for (eye_error, is_certain) in [(0.9, true), (1.0, false)] {
            frame.eye_error = eye_error;
            assert_eq!(far_side(&frame, &flat).is_some(), is_certain, "a direction off by {eye_error}");
            assert_eq!(faces_eye(&frame, &flat, DVec3::Z, 1.0), is_certain, "faces, {eye_error} off");
        }
        let sides = [1.0, -1.0].map(|z| {
            frame.eye = DVec3::Z * z;
            eye_side(&frame, DVec3::Z, 1.0)
        });
        assert_eq!(sides, [-1.0, 1.0], "sides of the eye in a parallel view");
    }

    /// A window counts as clear of a slab only if all of its points are exactly.
    #[test]
    fn windows_are_clear_of_slabs_that_they_do_not_meet() {
        let (mut random, mut frame, mut found) = (random(52), frame(), [0; 2]);
        for trial in 0..20_000 {
            let normal = vector(&mut random, 1.0).normalize();
            let anchor = vector(&mut random, 1e6);
            (frame.projection.anchor, frame.eye) = (anchor, anchor + normal * 1e7);
            let window = [0; 4].map(|_| vector(&mut random, 1e3));
            let heights = window.map(|point| normal.dot(anchor) + normal.dot(point));
            let near = heights.into_iter().fold(f64::INFINITY, f64::min);
            let unit = U * normal.abs().dot(anchor.abs());
            let high = near - random(-20.0, 80.0) * unit;
            let is_front = trial % 2 == 0;
            // Seen from behind, normal and slab are turned over.
            let sign = if is_front { 1.0 } else { -1.0 };
            let extent = if is_front { [high - 1.0, high] } else { [-high, 1.0 - high] };
            let far = if is_front { extent[0] } else { extent[1] };
            frame.window = Some(window);
            let is_clear = is_beyond_window(&frame, &polygon(normal * sign, extent, 1.0, true), far);
            let exact = window.map(|point| {
                exact_dot(normal, anchor).plus(exact_dot(normal, point)).plus((-high).into()).hi
            });
            let least = exact.into_iter().fold(f64::INFINITY, f64::min);
            let case = (trial, least / unit);
            assert!(!is_clear || least > 0.0, "{case:?} roundings from the window");
            assert!(is_clear || least <= 64.0 * unit, "{case:?} roundings from the window");
            found[usize::from(is_clear)] += 1;
        }
        assert!(found.iter().all(|&count| count > 1_000), "{found:?} meet the window and are clear of it");
        frame.window = None;
        assert!(!is_beyond_window(&frame, &polygon(DVec3::Z, [0.0; 2], 1.0, true), 0.0), "no window");
    }

    /// The eye is in front of all faces whose normals lie within the angle only if its height above the slab
    /// is more than the sine of the angle times its greatest distance, in exact arithmetic, also where
    /// rounding far from the origin is much of the height.
    #[test]
    fn eyes_before_all_faces_are_high_enough() {
        let (mut random, mut frame, mut found) = (random(53), frame(), [0; 2]);
        for trial in 0..40_000 {
            let normal = vector(&mut random, 1.0).normalize();
            let sine = 10.0f64.powf(random(-5.0, -1.0));
            let min_cosine = (1.0 - sine * sine).sqrt();
            let (radius, thickness) = (random(0.1, 1.0), random(0.0, 0.01) * (trial % 2) as f64);
            let size = [1.0, 1e4, 1e8][trial / 2 % 3];
            frame.perspective = trial % 5 != 0;
            let own_sine = DoubleDouble::from(1.0).plus(DoubleDouble::product(min_cosine, -min_cosine));
            let (middle, height, distance, own);
            if frame.perspective {
                frame.eye = vector(&mut random, size);
                // Close to the limit, or anywhere about it.
                let across = normal.any_orthonormal_vector() * random(0.1, 3.0);
                let rough = sine * (across.length() + radius + 2.0 * thickness);
                let above =
                    rough * if trial % 3 == 0 { random(-2.0, 2.0) } else { 1.0 + random(-1e-4, 1e-4) };
                let high = normal.dot(frame.eye) - above;
                let extent = [high - thickness, high];
                middle = frame.eye - normal * above + across;
                own = polygon(normal, extent, min_cosine, false);
                height = exact_dot(normal, frame.eye).plus((-high).into()).hi;
                distance = (frame.eye - middle).length() + radius + 2.0 * (extent[1] - extent[0]);
            } else {
                let across = normal.any_orthonormal_vector();
                let above = sine * if trial % 3 == 0 { random(-2.0, 2.0) } else { 1.0 + random(-1e-4, 1e-4) };
                frame.eye = across * (1.0 - above * above).max(0.0).sqrt() - normal * above;
                (middle, distance) = (DVec3::ZERO, 1.0);
                own = polygon(normal, [0.0, thickness], min_cosine, false);
                height = -exact_dot(normal, frame.eye).hi;
            }
            let faces = faces_eye(&frame, &own, middle, radius);
            let limit = own_sine.hi * distance * distance;
            let case = (trial, height, distance, sine);
            // The exact sine has a thousandth of the margin left for its own rounding.
            assert!(!faces || height > 0.0 && height * height > limit * (1.0 - 1e-9), "{case:?}");
            let unit = U * normal.abs().dot(frame.eye.abs());
            let less = height - 32.0 * unit;
            let is_wanted = less > 0.0 && less * less > (limit + 2e-12 * distance * distance) * (1.0 + 1e-4);
            assert!(faces || !is_wanted, "{case:?}: not in front");
            found[usize::from(faces)] += 1;
        }
        assert!(found.iter().all(|&count| count > 5_000), "{found:?} are behind a face and before all");
    }

    /// All eyes within the error of an eye are in front of the faces, also of those that are tilted away from
    /// it the most. Some come near to these.
    #[test]
    fn eyes_within_the_error_are_before_all_faces() {
        let (mut random, mut frame, mut least, mut found) = (random(55), frame(), f64::INFINITY, [0; 2]);
        for trial in 0..40_000 {
            let normal = vector(&mut random, 1.0).normalize();
            let across = normal.any_orthonormal_vector();
            let (sine, radius) = (10.0f64.powf(random(-2.0, -0.1)), random(0.0, 1.0));
            let min_cosine = (1.0 - sine * sine).sqrt();
            frame.eye = vector(&mut random, 10.0);
            let height = random(0.0, 9.0);
            let middle = frame.eye - normal * height + across * random(0.0, 9.0);
            // About the limit at which the eye is still certain.
            let limit = height - sine * ((frame.eye - middle).length() + radius);
            frame.eye_error = limit * (1.0 + random(-0.2, 0.2));
            let own = polygon(normal, [normal.dot(middle); 2], min_cosine, false);
            if limit <= 0.01 * height {
                continue;
            }
            let faces = faces_eye(&frame, &own, middle, radius);
            found[usize::from(faces)] += 1;
            if !faces {
                continue;
            }
            for end in [-radius, radius] {
                let from = frame.eye - (middle + across * end);
                let tilted = [-sine, sine].map(|sine| from.dot(normal * min_cosine + across * sine));
                let above = tilted[0].min(tilted[1]) / frame.eye_error;
                assert!(above > 1.0, "trial {trial}: {above} errors of the eye above a face");
                least = least.min(above);
            }
        }
        assert!(found.iter().all(|&count| count > 2_000), "{found:?} eyes behind a face and before all");
        assert!(least < 1.01, "{least} errors above the nearest face");
    }

    /// The depth plane is below the exact depth keys of points on the far side of the slab.
    #[test]
    fn depth_planes_are_behind_the_far_side() {
        let (mut random, mut frame, mut found) = (random(54), frame(), 0);
        for trial in 0..20_000 {
            let normal = (DVec3::NEG_X + vector(&mut random, 0.9)).normalize();
            let middle = DVec3::new(random(2.0, 9.0), random(-1.0, 1.0), random(-1.0, 1.0));
            let radius = random(0.01, 1.0);
            let far = normal.dot(middle) + random(-0.1, 0.1) * f64::from(trial % 2);
            frame.projection.anchor = DVec3::ZERO;
            frame.eye = DVec3::ZERO;
            let plane = depth_plane(&frame, normal, middle, radius, far);
            let row = |i: usize, p: DVec3| {
                let row = frame.projection.rows[i];
                exact_dot(DVec3::from(row.linear), p).plus(row.constant.into()).hi
            };
            let across = normal.any_orthonormal_vector() * random(-radius, radius);
            let p = middle + normal * (far - normal.dot(middle)) + across;
            let [x, y, w, n] = [0, 1, 2, 3].map(|i| row(i, p));
            let tile = [x / w / 8.0, y / w / 8.0].map(|at| at.floor());
            if !(w > 0.0
                && plane[2].is_finite()
                && tile[0] >= 0.0
                && tile[0] < 18.0
                && (0.0..2.0).contains(&tile[1]))
            {
                continue;
            }
            let bound = f64::from(plane[0]) * tile[0] + f64::from(plane[1]) * tile[1] + f64::from(plane[2]);
            assert!(bound <= n / w, "{trial}: {bound} above {}", n / w);
            found += 1;
        }
        assert!(found > 2_000, "{found} points in the picture");
    }
}
