//! A view in the form that portals are clipped to: its anchor (the eye of a perspective view), and the planes
//! that bound the view.

use super::window_plane::{U, USELESS, WindowPlane};
use smallvec::SmallVec;
use visibility_core::geometry::Plane;
use visibility_core::glam::DVec3;
use visibility_core::view::{ClipRow, ViewPlanes, ViewProjection, ViewRegion};
use visibility_core::{View, view::Eye};

/// The lines of sight of a view: rays from one point (perspective), or parallel lines (orthographic).
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) enum Lines {
    /// Perspective: all lines of sight start at the anchor, which is the eye.
    FromAnchor,
    /// Orthographic: all lines of sight are parallel to the unit direction (world axes) in the first part.
    /// The second part is an upper bound on the length of the difference between that direction and the exact
    /// unit direction.
    Along(DVec3, f64),
}

/// A view in anchor-relative coordinates: world axes and units, relative to the anchor. The anchor is the
/// eye, or the view's origin if its lines of sight are parallel.
#[derive(Clone, Debug)]
pub(super) struct PortalView {
    /// Origin of the anchor-relative coordinates, in world space.
    pub(super) anchor: DVec3,
    pub(super) lines: Lines,
    /// Bound on the distance between the anchor and the exact eye, in world units. 0 for a view with
    /// parallel lines of sight.
    pub(super) error: f64,
    /// Radius of the ball of eyes around the anchor, in world units. 0 for a single eye.
    pub(super) ball: f64,
    /// The left, right, bottom and top planes of the frustum, in this order, anchor-relative, with normals
    /// into the view.
    pub(super) sides: [WindowPlane; 4],
    /// The planes at which lines of sight end, anchor-relative: the far plane, if it is finite and can be
    /// computed, and the clip planes.
    pub(super) ends: SmallVec<[WindowPlane; 11]>,
    /// Rows of the clip matrix that give clip-space x, y and w of anchor-relative points.
    pub(super) rows: [ClipRow; 3],
}

impl PortalView {
    /// Converts `view` to anchor-relative form. `None` if the eye, the direction of parallel lines or one of
    /// the planes but the far one cannot be computed in `f64`.
    pub(super) fn new(view: &View) -> Option<Self> {
        let projection = ViewProjection::new(view, DVec3::ZERO);
        let anchor = projection.anchor();
        let planes = view.planes(anchor);
        if !anchor.is_finite() {
            return None;
        }
        // `planes` omits a plane that cannot be computed. Without the near plane or a clip plane, lines of
        // sight would seem to begin elsewhere. Without the far plane they end nowhere, which holds more: in
        // `f32`, rounding takes the normal of a far plane that is 2^24 times as far as the near plane.
        planes.in_slot(ViewPlanes::NEAR)?;
        let side = |slot| planes.in_slot(slot).map(WindowPlane::of_view);
        let sides = [side(0)?, side(1)?, side(2)?, side(3)?];
        let clips = view.clip_planes_from(anchor);
        if clips.as_slice().len() != view.clip_planes().len() {
            return None;
        }
        let ends = planes.in_slot(ViewPlanes::FAR).into_iter().chain(clips.as_slice());
        let ends = ends.map(WindowPlane::of_view).collect();
        let (lines, error) = match projection.eye() {
            Eye::Point(_) => (Lines::FromAnchor, projection.eye_error()),
            Eye::Direction(direction) => (Lines::Along(direction, projection.eye_error()), 0.0),
        };
        let turn = if let Lines::Along(_, turn) = lines { turn } else { 0.0 };
        // Written so that NaN is refused as well.
        if !(error.is_finite() && turn < 0.01) {
            return None;
        }
        let rows = [projection.x(), projection.y(), projection.w()];
        Some(Self { anchor, lines, error, ball: 0.0, sides, ends, rows })
    }

    /// Returns the lines of sight of all views of a region, in anchor-relative form. The anchor is the middle
    /// of the ball of eyes. `None` as for [`new`](Self::new).
    pub(super) fn of_region(region: &ViewRegion) -> Option<Self> {
        let mut of_picture = Self::new(region.picture())?;
        let planes = region.planes(of_picture.anchor);
        let [left, right, bottom, top, ends @ ..] = planes.as_slice() else { return None };
        of_picture.sides = [left, right, bottom, top].map(WindowPlane::of_view);
        // The plane that bounds what is nearest ends no line of sight.
        let ahead = of_picture.rows[2].linear;
        let is_far = |plane: &&visibility_core::view::ViewPlane| plane.plane.normal.dot(ahead) < 0.0;
        of_picture.ends = ends.iter().filter(is_far).map(WindowPlane::of_view).collect();
        of_picture.ball = region.radius();
        Some(of_picture)
    }

    /// Returns in which direction lines of sight cross a polygon: along its unit normal `normal`, or against
    /// it. The vertices are anchor-relative, and each is known up to `error` (which includes the error of the
    /// eye), and up to `flaw` once the polygon as a whole is moved rightly. The polygon's extent in every
    /// direction of its plane is at least `width`. All lengths are in world units.
    pub(super) fn crossing(
        &self,
        vertices: impl Iterator<Item = DVec3>,
        normal: DVec3,
        width: f64,
        flaw: f64,
        error: f64,
    ) -> Crossing {
        // Lines from an eye cross along the normal if and only if the eye is behind the plane. Vertices that
        // are off by `flaw` tilt the plane by twice `flaw / width`. With the unit round-off `u` = 2^-53,
        // evaluating the height of a vertex rounds by `8u` of its distance from the anchor, and each
        // component of the stored normal is off by up to `4u`.
        let tilt = 2.0 * flaw / width + 32.0 * U;
        let (least, most) = match self.lines {
            Lines::FromAnchor => {
                vertices.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), vertex| {
                    let height = normal.dot(vertex);
                    let margin = error + tilt * vertex.length();
                    (least.min(height - margin), most.max(height + margin))
                })
            }
            Lines::Along(direction, turn) => {
                let height = normal.dot(direction);
                (height - turn - tilt, height + turn + tilt)
            }
        };
        if least > 0.0 {
            Crossing::Along
        } else if most < 0.0 {
            Crossing::Against
        } else {
            Crossing::Undecided
        }
    }

    /// Returns the half-space bounded by the plane of the lines of sight that meet the edge from `a` to `b`
    /// (anchor-relative, each known up to `error` world units). As seen along the lines of sight, its inner
    /// side is on the left of the edge for `sign` 1, on the right for `sign` -1. `None` if the edge is too
    /// short or too nearly in line with the lines of sight to give a plane. See
    /// [`WindowPlane::through_edge`].
    // Inlined always: otherwise the compiler inlines or not depending on how it divides the crate, and a walk
    // through portals takes up to 1.24 times as long without.
    #[inline(always)]
    pub(super) fn through_edge(&self, a: DVec3, b: DVec3, sign: f64, error: f64) -> Option<WindowPlane> {
        match self.lines {
            Lines::FromAnchor if self.ball > 0.0 => {
                // Let `e` be an eye of the ball of radius `r`, and `y` the point of the edge's line that is
                // nearest to the anchor, at the distance `d`. A point `x` that `e` sees inside the edge has
                // `((a - e) x (b - e)) . (x - y) >= 0`, and this product is `(a x b) . (x - y) - (e x (b -
                // a)) . (x - y)`. With `|a x b| = d |b - a|`, the unit normal `n` of the plane through the
                // anchor has `n . x = n . (x - y) >= -r / d |x - y|`, which is at least `-(r + r / d |x|)`.
                let side = WindowPlane::through_edge(a, b, sign, error)?;
                let ball = self.ball * (1.0 + 1e-9);
                let turn = ball * (b - a).length() / a.cross(b).length();
                let (slope, slack) = (side.slope + turn * (1.0 + side.slope), side.slack + ball);
                (slope < USELESS).then_some(WindowPlane { slope, slack, ..side })
            }
            Lines::FromAnchor => WindowPlane::through_edge(a, b, sign, error),
            Lines::Along(direction, turn) => WindowPlane::along(direction, turn, a, b, sign, error),
        }
    }

    /// Returns two half-spaces, one on each side of the plane through the anchor with the unit normal
    /// `normal`, that together bound the lines of sight which meet a polygon. The corners of the polygon are
    /// anchor-relative, and each point of the exact polygon is within `error` world units, which include the
    /// error of the eye, of the polygon that the corners span. `None` if lines of sight are parallel, or may
    /// rise from the plane by more than a quarter of their length.
    pub(super) fn edge_on(
        &self,
        corners: impl Iterator<Item = DVec3>,
        normal: DVec3,
        error: f64,
    ) -> Option<[WindowPlane; 2]> {
        // A line of sight begins at an eye `e`, no farther from the anchor than `r`, the error of the eye
        // plus the radius of the ball. The line has the direction `p + d`, where `p` is a point of the
        // polygon that the corners span, and `d` at most `s`, `error` plus the radius, long. If `s < |p|`,
        // the sine of the angle between the line and `p` is at most `s / |p|`; that of the angle between `p`
        // and the plane is `|n . p| / |p|`. The sine of a sum of angles is at most the sum of their sines, so
        // the line rises by at most `(|n . p| + s) / |p|` of its length. This is at most `slope`, since no
        // corner is higher than `height`, and no point of the polygon nearer than `nearest`. A point `x` of
        // the line is at most `|x| + r` from `e`, so `|n . x| <= r + slope (|x| + r)`.
        // With the unit round-off `u` = 2^-53: `|n . p|` rounds by `3u |p|`, and so does `|n . x|`; the
        // length of the normal is off by `4u`; the slope, if at most a quarter, rounds by less than `2u`.
        let (mut low, mut high, mut height) = (DVec3::INFINITY, DVec3::NEG_INFINITY, 0.0f64);
        for at in corners {
            (low, high) = (low.min(at), high.max(at));
            height = height.max(normal.dot(at).abs() + 32.0 * U * at.length());
        }
        let nearest = low.max(-high).max(DVec3::ZERO).length();
        let slope = (height + error + self.ball) / nearest;
        let slack = (self.error + self.ball) * (1.0 + slope) + f64::MIN_POSITIVE;
        // Written so that a NaN, of a corner at the anchor, is rejected as well.
        (self.lines == Lines::FromAnchor && slope <= 0.25)
            .then(|| [normal, -normal].map(|n| WindowPlane { plane: Plane::new(n, 0.0), slope, slack }))
    }
}

/// The direction in which the lines of sight of a view cross the plane of a polygon, relative to the
/// polygon's normal.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Crossing {
    /// The lines of sight cross the polygon's plane in the direction of the polygon's normal.
    Along,
    /// The lines of sight cross the polygon's plane in the direction opposite to the polygon's normal.
    Against,
    /// Undecided: the eye is so near the polygon's plane, or the lines of sight are so nearly parallel to
    /// that plane, that rounding can hide the direction.
    Undecided,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integer_vectors::Random;
    use visibility_core::geometry::DoubleDouble;
    use visibility_core::glam::{DMat4, DVec4};
    use visibility_core::view::Depth;

    /// Returns the view of a clip matrix whose rows for x, y and w have the linear parts `rows` and the
    /// constants `offsets`. `None` if the matrix is not a valid view.
    fn view(rows: [DVec3; 3], offsets: [f64; 3]) -> Option<View> {
        let [x, y, w] = [0, 1, 2].map(|i| rows[i].extend(offsets[i]));
        let z = (rows[2] * 0.5 + rows[0] + rows[1]).extend(offsets[2] * 0.5 + offsets[0] + offsets[1] - 1.0);
        View::from_clip_from_world(DMat4::from_cols(x, y, z, w).transpose(), Depth::ZeroToOne).ok()
    }

    #[test]
    fn errors_of_eyes_and_directions_are_those_of_the_projection() {
        let error = |view: &View| ViewProjection::new(view, DVec3::ZERO).eye_error();
        let perspective = view([DVec3::X, DVec3::Y, DVec3::Z], [1e6, 2e6, 3e6]).unwrap();
        let found = PortalView::new(&perspective).unwrap();
        assert!(error(&perspective) > 0.0, "an eye far from the origin has an error");
        assert_eq!((found.error, found.lines), (error(&perspective), Lines::FromAnchor), "of the eye");
        let rows = [DVec4::new(0.3, 0.4, 0.5, 0.0), DVec4::Y, DVec4::new(0.0, 0.0, 0.1, 0.5), DVec4::W];
        let matrix = DMat4::from_cols(rows[0], rows[1], rows[2], rows[3]).transpose();
        let parallel = View::from_clip_from_world(matrix, Depth::ZeroToOne).unwrap();
        let Lines::Along(_, turn) = PortalView::new(&parallel).unwrap().lines else {
            panic!("parallel lines")
        };
        assert!(turn > 0.0, "the direction has an error");
        assert_eq!(turn, error(&parallel), "of the direction");
    }

    #[test]
    fn parallel_lines_of_sight_are_within_their_turn_of_the_direction() {
        let mut random = Random(4);
        let (mut found, mut greatest) = (0, 0.0f64);
        for _ in 0..4000 {
            let [x, y] = [(); 2].map(|()| random.vector(1 << 30));
            // All lines of sight are at right angles to both rows.
            let exact = x.cross(y).0.map(|k| {
                let hi = k as f64;
                DoubleDouble { hi, lo: (k - hi as i128) as f64 }
            });
            let direction = exact.map(|k| k.hi);
            let length = DVec3::from(direction).length();
            if length < 1e15 {
                continue;
            }
            let z = DVec3::from(direction) / length * 1e5;
            let rows = [x.to_f64().extend(0.0), y.to_f64().extend(0.0), z.extend(0.5), DVec4::W];
            let matrix = DMat4::from_cols(rows[0], rows[1], rows[2], rows[3]).transpose();
            let Ok(view) = View::from_clip_from_world(matrix, Depth::ZeroToOne) else { continue };
            let Some(Lines::Along(found_direction, turn)) =
                PortalView::new(&view).map(|eye_view| eye_view.lines)
            else {
                continue;
            };
            // The sine of the angle between the found and the exact direction, computed in double-double
            // numbers.
            let d = found_direction.to_array();
            let across = [0, 1, 2].map(|k| {
                let (i, j) = ((k + 1) % 3, (k + 2) % 3);
                let product = |a: f64, b: DoubleDouble| DoubleDouble::from(a).times(b);
                product(d[i], exact[j]).plus(product(d[j], exact[i]).negated()).hi
            });
            let sine = DVec3::from(across).length() / length;
            assert!(sine <= turn, "{x:?} {y:?}: off by {sine}, {turn} known of");
            greatest = greatest.max(sine / turn);
            found += 1;
        }
        assert!(found > 1000 && greatest > 0.001, "{found}, {greatest}");
    }

    #[test]
    fn an_eye_near_the_plane_of_a_polygon_is_never_said_to_be_on_the_wrong_side() {
        let mut random = Random(5);
        let wide = view([DVec3::X, DVec3::Y, DVec3::Z], [0.0; 3]).unwrap();
        let mut eye_view = PortalView::new(&wide).unwrap();
        eye_view.error = 0.0;
        let mut counts = [0; 3];
        for round in 0..20_000 {
            // The eye lies far along the plane of a triangle, and very little off the plane: by as little as
            // 2^-52 of the distance.
            let (corner, a, b) = (random.vector(1 << 20), random.vector(1 << 24), random.vector(1 << 24));
            let near = random.vector(if round % 2 == 0 { 4 } else { 1 << 12 });
            let far = a.times(random.below(1 << 24)).plus(b.times(random.below(1 << 24)));
            let eye = corner.plus(far).plus(near);
            let ahead = corner.minus(eye).dot(a.cross(b));
            let unit = a.to_f64().cross(b.to_f64()).normalize();
            let vertices = [corner, corner.plus(a), corner.plus(b)].map(|p| p.minus(eye).to_f64());
            let width = unit.cross(b.to_f64()).length() * 0.5;
            let crossing = eye_view.crossing(vertices.into_iter(), unit, width, 0.0, 0.0);
            // A line that starts behind the plane crosses along the normal.
            match crossing {
                Crossing::Along => assert!(ahead > 0, "{corner:?} {a:?} {b:?} {eye:?}"),
                Crossing::Against => assert!(ahead < 0, "{corner:?} {a:?} {b:?} {eye:?}"),
                Crossing::Undecided => {}
            }
            counts[crossing as usize] += 1;
        }
        assert!(counts.iter().all(|&count| count > 1000), "{counts:?}");
    }

    /// The direction is undecided where the exact eye may be on either side of the exact polygon, whose
    /// errors are large here. Half of an error would not do.
    #[test]
    fn eyes_within_the_error_of_a_polygon_are_on_neither_side() {
        let wide = view([DVec3::X, DVec3::Y, DVec3::Z], [0.0; 3]).unwrap();
        let eye_view = PortalView::new(&wide).unwrap();
        let triangle = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let at = |height: f64, flaw: f64, error: f64| {
            let vertices = triangle.map(|p| p + DVec3::new(0.0, 0.0, height));
            eye_view.crossing(vertices.into_iter(), DVec3::Z, 0.5, flaw, error)
        };
        for (height, error, expected) in [
            (0.09, 0.1, Crossing::Undecided),
            (-0.09, 0.1, Crossing::Undecided),
            (0.11, 0.1, Crossing::Along),
            (-0.11, 0.1, Crossing::Against),
        ] {
            assert_eq!(at(height, 0.0, error), expected, "{height} above the eye, off by {error}");
        }
    }

    /// Planes through edges hold the points that are seen past the exact edges by exact eyes, wherever these
    /// are within their errors, which are large here. Half of an error would not do.
    #[test]
    fn planes_of_edges_hold_what_is_seen_past_the_exact_edges() {
        let mut random = visibility_testing::Random(1);
        let wide = view([DVec3::X, DVec3::Y, DVec3::Z], [0.0; 3]).unwrap();
        let mut eye_view = PortalView::new(&wide).unwrap();
        let mut counts = [0; 3];
        for trial in 0..60_000 {
            let kind = trial % 3;
            let [a, b] = [0; 2].map(|_| random.vector(1.0));
            let direction = random.vector(1.0).normalize();
            let [error, turn, ball] = [0; 3].map(|_| random.range(0.0, 0.1) * random.unit());
            eye_view.ball = if kind == 1 { ball } else { 0.0 };
            eye_view.lines = if kind == 2 { Lines::Along(direction, turn) } else { Lines::FromAnchor };
            let unit = if kind == 2 { direction.cross(b - a) } else { a.cross(b) }.normalize();
            let mut off = |size: f64| {
                size * match random.below(3) {
                    0 => unit,
                    1 => -unit,
                    _ => random.vector(1.0).clamp_length_max(1.0),
                }
            };
            // The exact edge, an exact eye, the exact middle of the ball of eyes, and a direction.
            let (p, q, middle) = (a + off(error), b + off(error), off(error));
            let (eye, exact) = (middle + off(eye_view.ball), direction + off(turn));
            // A point in the plane of the eye, or the direction, and the edge.
            let size = 10f64.powf(random.range(-3.0, 3.0));
            let [along, aside] = [0; 2].map(|_| random.range(-size, size));
            let point = match kind {
                2 => p + (q - p) * along + exact * aside,
                _ => eye + (p + middle - eye) * along + (q + middle - eye) * aside,
            };
            let Some(side) = eye_view.through_edge(a, b, 1.0, error) else { continue };
            let (distance, margin) = (side.plane.signed_distance(point), side.margin(point.length()));
            assert!(
                distance >= -margin * (1.0 + 1e-9),
                "trial {trial}: {point} is {distance} inside, past {a}, {b}"
            );
            counts[kind] += 1;
        }
        assert!(counts.iter().all(|&count| count > 5_000), "planes: {counts:?}");
    }

    /// Planes close to a polygon that is seen edge on hold the lines from exact eyes through its exact
    /// points, wherever these are within their errors, which are large here. Half of an error would not do.
    #[test]
    fn lines_through_a_polygon_seen_edge_on_rise_no_more_than_its_planes() {
        let mut random = visibility_testing::Random(1);
        let wide = view([DVec3::X, DVec3::Y, DVec3::Z], [0.0; 3]).unwrap();
        let (mut eye_view, mut found) = (PortalView::new(&wide).unwrap(), 0);
        for trial in 0..60_000 {
            let mut large = || [0.0, 0.1, 0.1 * random.unit()][random.below(3)];
            let flaw = large();
            (eye_view.error, eye_view.ball) = (large(), large());
            let error = flaw + eye_view.error;
            let slant = if random.one_in(2) { 0.0 } else { random.range(-0.1, 0.1) };
            let corners = [[1.0, 0.0, slant], [2.0, 0.5, 0.0], [2.0, -0.5, -slant]].map(DVec3::from);
            let Some(planes) = eye_view.edge_on(corners.into_iter(), DVec3::Z, error) else { continue };
            // Lines rise most from an eye that is low through a vertex that is high, and from what is near.
            let up = if random.one_in(2) { 1.0 } else { -1.0 };
            let angle = random.range(1.2, 1.6);
            let toward = DVec3::new(-angle.cos(), 0.0, angle.sin() * up);
            let eye = -toward * (eye_view.error + eye_view.ball);
            let exact = corners[trial % 3] + toward * flaw;
            let far = if random.one_in(4) { 0.0 } else { 10f64.powf(random.range(0.0, 3.0)) };
            let point = eye + (exact - eye) * far;
            for side in planes {
                let (distance, margin) = (side.plane.signed_distance(point), side.margin(point.length()));
                assert!(
                    distance >= -margin * (1.0 + 1e-9),
                    "trial {trial}: {point} is {distance} inside {side:?}"
                );
                found += 1;
            }
        }
        assert!(found > 60_000, "{found} planes bound a window");
    }

    /// Points of the plane of a polygon whose plane passes exactly through the eye are held, far behind the
    /// polygon as well, where rounding decides.
    #[test]
    fn rounding_loses_no_line_through_a_polygon_seen_edge_on() {
        let mut random = Random(7);
        let wide = view([DVec3::X, DVec3::Y, DVec3::Z], [0.0; 3]).unwrap();
        let eye_view = PortalView { error: 0.0, ..PortalView::new(&wide).unwrap() };
        let mut found = 0;
        for trial in 0..20_000 {
            let [a, b] = [(); 2].map(|()| random.vector(1 << 20));
            let unit = a.to_f64().cross(b.to_f64()).normalize();
            // Corners, and a point behind them, whose coordinates are integers of less than 2^53.
            let corners = [a, a.times(3).plus(b), a.times(3).minus(b)];
            let point = a.times(1 << 20).plus(b.times(random.below(1 << 18))).to_f64();
            let corners = corners.into_iter().map(|corner| corner.to_f64());
            let Some(planes) = eye_view.edge_on(corners, unit, 0.0) else { continue };
            for side in planes {
                let is_outside = side.excludes(point, point, 0.0);
                assert!(!is_outside, "trial {trial}: {point} of the plane of {a:?}, {b:?}, {side:?}");
                found += 1;
            }
        }
        assert!(found > 10_000, "{found} planes bound a window");
    }

    #[test]
    fn planes_close_to_a_polygon_bound_flat_lines_from_an_eye_alone() {
        let wide = view([DVec3::X, DVec3::Y, DVec3::Z], [0.0; 3]).unwrap();
        let from_eye = PortalView::new(&wide).unwrap();
        let parallel = PortalView { lines: Lines::Along(DVec3::X, 0.0), ..from_eye.clone() };
        for (eye_view, x, error, is_bounded) in [
            (&from_eye, 1.0, 0.2, true),
            (&from_eye, 1.0, 0.3, false),
            (&from_eye, 0.0, 0.0, false),
            (&parallel, 1.0, 0.2, false),
        ] {
            let corners = [[x, 0.0, 0.0], [x + 1.0, 1.0, 0.0], [x + 1.0, 0.0, 0.0]].map(DVec3::from);
            let planes = eye_view.edge_on(corners.into_iter(), DVec3::Z, error);
            assert_eq!(planes.is_some(), is_bounded, "a polygon from x = {x}, off by {error}");
        }
    }

    #[test]
    fn views_with_a_plane_infinitely_far_away_are_refused() {
        let wide = view([DVec3::X, DVec3::Y, DVec3::Z], [0.0; 3]).unwrap();
        for (size, is_refused) in [(1e-300, true), (1.0, false)] {
            let clipped = wide.with_clip_planes(&[Plane::new(DVec3::X * size, 1e100)]).unwrap();
            assert_eq!(PortalView::new(&clipped).is_none(), is_refused, "a normal of length {size}");
        }
    }
}
