//! Validity regions: for which views, beside the one that was culled, an answer is certainly good.
//!
//! An answer for one eye and one direction is good for that instant. Made for a ball of eyes and a cone of
//! turns it is good for as long as the camera stays inside (Coorg and Teller, "Temporally Coherent
//! Conservative Visibility", 1996; Durand, "A Multidisciplinary Survey of Visibility", 2000, section 2 on
//! coherence). A [`ViewRegion`] is such a ball and cone around one view, with all that cullers need: the
//! planes around what any of its views can see, and one wider view of the ball's centre into which a culler
//! of points of view may draw.
//!
//! # The volume
//! Let `c` be the eye of the view that the region is around, `r` the radius and `d` the angle. Let `X` and
//! `Y` be tangents in the axes of that view: `x / z` and `y / z`. A direction turned by at most `d` from a
//! unit vector `u` is that of a point in the ball of radius `sin d` around `u`. Its shadow in the plane of
//! `x` and
//! `z` is in the disc of that radius around `(u.x, u.z)`, so its angle in that plane differs from that of `u`
//! by at most `asin(sin d / |(u.x, u.z)|)`, and `|(u.x, u.z)|` is at least `1 / sqrt(1 + Y^2)`. The window is
//! widened by this angle on each side. Then the sides are moved outwards by `r`, since each eye is within `r`
//! of `c`. A point of the near plane is `near (X, Y, 1)` in the axes of its own view, with `X^2 + Y^2` at
//! most some `D^2`, and has at least the depth `near (cos d - D sin d)` in the axes of the first; a point of
//! the far plane has at most `far (cos d + D sin d)`, and never more than `far sqrt(1 + D^2)`, at which it
//! lies straight ahead.
//!
//! # The picture
//! The *picture* is a view from `c` through a window that is wider by a further angle `g`. Its near plane is
//! beyond all points at which sight of the region's views begins. Points of the volume outside the picture
//! are near: in the plane of `x` and `z` such a point is beyond a side of the widened window by more than the
//! angle `g` and by at most the distance `r`, so it is within `r / sin g` of `c` in that plane, and the other
//! sides bound its third coordinate. [`PictureMargin`] tells for a box whether it may hold such a point.

use super::{Eye, Pose, View, ViewPlane, ViewProjection, Window};
use crate::geometry::Plane;
use crate::view::MAX_PLANES;
use crate::{Aabb, float};
use glam::{DVec3, DVec4};
use smallvec::SmallVec;

/// How far a camera may move and turn while an answer stays good.
///
/// ```
/// use visibility_core::view::Reach;
/// // Five frames at 1.4 m/s, 90 degrees a second and 60 frames a second.
/// let reach = Reach::new(0.1, 6f64.to_radians());
/// assert_eq!(reach.metres(), 0.1);
/// assert_eq!(Reach::new(-1.0, f64::NAN), Reach::new(0.0, 0.0));
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Reach {
    metres: f64,
    radians: f64,
}

impl Reach {
    /// Makes a reach: the radius of the ball of eyes in metres, and the greatest angle of a turn, about any
    /// axis, in radians. A negative number or NaN counts as 0.
    pub fn new(metres: f64, radians: f64) -> Self {
        Self { metres: metres.max(0.0), radians: radians.max(0.0) }
    }

    /// Returns the radius of the ball of eyes, in metres.
    pub fn metres(&self) -> f64 {
        self.metres
    }

    /// Returns the greatest angle of a turn, in radians.
    pub fn radians(&self) -> f64 {
        self.radians
    }
}

/// Relative difference of windows, near and far distances up to which the views of a region may differ from
/// the view that the region is around: more than the rounding of clip matrices in `f32`.
const SAME: f64 = 5e-4;

/// Relative size of the margin that is left for such differences and for rounding: more than [`SAME`], plus
/// what near and far planes that are tilted by 1e-4 gain at a corner of the widest window, with a tangent of
/// 8.
const SLACK: f64 = 2e-3;

/// Tangent of the angle by which the window of the [picture](ViewRegion::picture) is wider than that of the
/// volume. A wider picture has coarser pixels; a narrower one has more boxes near the eye that it does not
/// decide.
const PICTURE_MARGIN: f64 = 0.1;

/// Greatest tangent of a side of the picture, about 80 degrees. Regions with wider pictures are not made.
const MAX_TANGENT: f64 = 6.0;

/// Greatest angle of a turn in radians.
const MAX_RADIANS: f64 = 1.0;

/// The camera that a perspective clip matrix stands for.
#[derive(Clone, Copy, Debug)]
struct Camera {
    /// Eye in the world, in metres.
    eye: DVec3,
    /// Bound on the rounding error of the eye, in metres.
    eye_error: f64,
    /// Unit vectors to the right, up and ahead.
    axes: [DVec3; 3],
    window: Window,
    /// Distances of the near and far plane in metres. The second is infinite without a far plane.
    near: f64,
    far: f64,
}

impl Camera {
    /// Returns the camera of a view. `None` for a parallel or skewed view, for an oblique near plane, and for
    /// a view with clip planes.
    fn of(view: &View) -> Option<Self> {
        let Eye::Point(eye) = view.eye(DVec3::ZERO) else { return None };
        let Eye::Point(local) = view.eye(view.origin()) else { return None };
        if view.clip_count > 0 {
            return None;
        }
        let m = &view.clip_from_local;
        let [x, y, z, w] = [0, 1, 2, 3].map(|i| m.row(i));
        let scale = w.truncate().length();
        let ahead = w.truncate() / scale;
        let [x_row, y_row] = [x, y].map(|row: DVec4| row.truncate() / scale);
        let [across, upwards] = [x_row, y_row].map(|row| row - ahead * row.dot(ahead));
        let (width, height) = (across.length(), upwards.length());
        let right = across / width;
        let up = upwards / height;
        // Skewed pictures have no window. Rounding of matrices in `f32` is far smaller.
        let skew = right.dot(up).abs();
        let is_square = skew < 1e-5;
        if !is_square {
            return None;
        }
        let up = (up - right * up.dot(right)).normalize();
        let side = |row: DVec3, length: f64, at: f64| (at - row.dot(ahead)) / length;
        let window = Window {
            left: side(x_row, width, -1.0),
            right: side(x_row, width, 1.0),
            bottom: side(y_row, height, -1.0),
            top: side(y_row, height, 1.0),
        };
        // Straightened, the upper and lower side are off by the skew times the tangent aside. That must stay
        // within half of [`SLACK`], also for a wide and low window.
        let aside = window.left.abs().max(window.right.abs());
        let is_within = skew * aside < 0.5 * SLACK * (window.top - window.bottom);
        if !is_within {
            return None;
        }
        // Distance from the eye of a plane across the view direction; `None` for any other plane.
        let distance = |row: DVec4, towards: DVec3| {
            let normal = row.truncate();
            let unit = normal / normal.length();
            let off = (unit - towards).length();
            (off < 1e-4).then(|| -(normal.dot(local) + row.w) / normal.dot(ahead))
        };
        let (near_row, far_row) = view.depth.rows(z, w);
        let near = distance(near_row, ahead)?;
        // Without a far plane the volume is only larger.
        let far = far_row.and_then(|row| distance(row, -ahead)).unwrap_or(f64::INFINITY);
        let eye_error = ViewProjection::new(view, DVec3::ZERO).eye_error();
        let sides = [window.left, window.right, window.bottom, window.top];
        let proper = sides.iter().all(|side| side.is_finite())
            && window.left < window.right
            && window.bottom < window.top
            && near > 0.0
            && near < far
            && eye.is_finite()
            && eye_error.is_finite();
        proper.then_some(Self { eye, eye_error, axes: [right, up, ahead], window, near, far })
    }
}

/// All perspective views that show the same layers through the same window, with the same near and far
/// distance, from an eye in a ball and turned by at most an angle: a *validity region* around one view.
///
/// ```
/// use visibility_core::view::{Reach, ViewRegion};
/// use visibility_core::{glam::DVec3, Pose, View};
/// let at = |eye: DVec3, ahead: DVec3| {
///     View::perspective(Pose::look_at(eye, eye + ahead, DVec3::Z), 1.0, 1.5, 0.1, f64::INFINITY)
/// };
/// let region = ViewRegion::around(&at(DVec3::ZERO, DVec3::X)?, Reach::new(0.1, 0.1)).unwrap();
/// assert!(region.contains(&at(DVec3::new(0.09, 0.0, 0.0), DVec3::new(1.0, 0.09, 0.0))?));
/// assert!(!region.contains(&at(DVec3::new(0.11, 0.0, 0.0), DVec3::X)?), "too far");
/// assert!(!region.contains(&at(DVec3::ZERO, DVec3::new(1.0, 0.11, 0.0))?), "turned too far");
/// # Ok::<(), visibility_core::view::ViewError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct ViewRegion {
    reach: Reach,
    camera: Camera,
    layers: u32,
    /// Radius of the ball of eyes around the camera's eye, in metres, with a margin for rounding.
    radius: f64,
    /// Least and greatest depth, in metres along the camera's direction, of points that a view can see. The
    /// first may be negative, and negative infinity; the second may be infinite.
    depths: [f64; 2],
    /// View through the window of the volume, before its sides are moved outwards.
    volume: View,
    picture: View,
    /// Radius of a ball around the camera's eye that holds all points at which sight begins, in metres.
    start: f64,
    /// Points of the volume that are not in the picture are nearer than this to the camera's eye, in metres.
    margin: f64,
}

impl ViewRegion {
    /// Returns the region around a view. `None` for views without regions: parallel and skewed ones, those
    /// with an oblique near plane or with [clip planes](View::with_clip_planes), and those whose window would
    /// become wider than about 160 degrees.
    pub fn around(view: &View, reach: Reach) -> Option<Self> {
        let camera = Camera::of(view)?;
        let Window { left, right, bottom, top } = camera.window;
        let radius = (reach.metres * (1.0 + 1e-6) + 4.0 * camera.eye_error).max(1e-9 * camera.near);
        let turn = reach.radians * (1.0 + 1e-6) + 1e-6;
        if !(turn < MAX_RADIANS && radius.is_finite()) {
            return None;
        }
        let tan_turn = float::tan(turn);
        let cosine = 1.0 / float::sqrt(1.0 + tan_turn * tan_turn);
        let sine = tan_turn * cosine;
        // Windows that count as the same are within this one.
        let (wider, higher) = (SLACK * (right - left), SLACK * (top - bottom));
        let sides = [right + wider, wider - left, top + higher, higher - bottom];
        let [most_x, most_y] = [sides[0].abs().max(sides[1].abs()), sides[2].abs().max(sides[3].abs())];
        let diagonal = float::sqrt(most_x * most_x + most_y * most_y);
        let mut volume = [0.0; 4];
        let mut picture = [0.0; 4];
        for (i, &side) in sides.iter().enumerate() {
            let other = if i < 2 { most_y } else { most_x };
            let widened = sine * float::sqrt(1.0 + other * other);
            let tangent = widened / float::sqrt(1.0 - widened * widened);
            volume[i] = turned(side, tangent * (1.0 + 1e-9))?;
            picture[i] = turned(volume[i], PICTURE_MARGIN)?;
        }
        let most = volume.iter().fold(0.0f64, |most, side| most.max(side.abs()));
        let sloped = float::sqrt(1.0 + most * most);
        let near = camera.near * (1.0 - SLACK);
        let far = camera.far * (1.0 + SLACK);
        let least = near * (cosine - diagonal * sine);
        let depths = [
            if least > 0.0 { least - radius } else { f64::NEG_INFINITY },
            // Turned by more than the angle of the corner, the corner comes nearer again.
            far * if tan_turn < diagonal {
                cosine + diagonal * sine
            } else {
                float::sqrt(1.0 + diagonal * diagonal)
            } + radius,
        ];
        // Where lines of sight begin: on the near plane of each view.
        let start =
            (radius + camera.near * (1.0 + SLACK) * float::sqrt(1.0 + diagonal * diagonal)) * (1.0 + SLACK);
        // So far that no point beyond comes near the plane of any of the eyes.
        let start = start.max(2.0 * radius);
        let margin_sine = PICTURE_MARGIN / float::sqrt(1.0 + PICTURE_MARGIN * PICTURE_MARGIN);
        let beside = radius / margin_sine;
        let across = |depth: f64| most * depth + radius * sloped;
        let beyond_sides = float::sqrt(beside * beside + across(beside) * across(beside));
        let before_near = float::sqrt(start * start + 2.0 * across(start) * across(start));
        let [right, up, forward] = camera.axes;
        let pose = Pose { eye: camera.eye, right, up, forward };
        let window =
            |[right, left, top, bottom]: [f64; 4]| Window { left: -left, right, bottom: -bottom, top };
        let through = |sides| View::perspective_off_center(pose, window(sides), start, f64::INFINITY).ok();
        Some(Self {
            reach,
            camera,
            layers: view.layers(),
            radius,
            depths,
            volume: through(volume)?.with_layers(view.layers()),
            picture: through(picture)?.with_layers(view.layers()),
            start,
            margin: beyond_sides.max(before_near) * (1.0 + SLACK),
        })
    }

    /// Returns the reach that the region was made with.
    pub fn reach(&self) -> Reach {
        self.reach
    }

    /// Returns whether a view is one of the region's. Windows, near and far distances may differ by the
    /// rounding of matrices in `f32`. That rounding leaves some matrices without a far plane: a region whose
    /// views have none contains views with any far plane, as all that these see is in sight of its own.
    pub fn contains(&self, view: &View) -> bool {
        let Some(other) = Camera::of(view) else { return false };
        let Window { left, right, bottom, top } = self.camera.window;
        let window = other.window;
        let (wide, high) = (SAME * (right - left), SAME * (top - bottom));
        let same = |a: f64, b: f64, by: f64| a == b || (a - b).abs() <= by;
        let turned: f64 = (0..3).map(|i| (self.camera.axes[i] - other.axes[i]).length_squared()).sum();
        // A rotation by the angle `t` moves three orthonormal vectors by `8 sin^2(t / 2)` in all, squared.
        let tangent = float::tan(0.5 * self.reach.radians.min(MAX_RADIANS));
        let most_turned = 8.0 * tangent * tangent / (1.0 + tangent * tangent);
        let off = self.camera.eye.distance(other.eye) + self.camera.eye_error + other.eye_error;
        view.layers() == self.layers
            && same(window.left, left, wide)
            && same(window.right, right, wide)
            && same(window.bottom, bottom, high)
            && same(window.top, top, high)
            && same(other.near, self.camera.near, SAME * self.camera.near)
            && same(other.far, self.camera.far, SAME * self.camera.far)
            && off <= self.radius
            && turned <= most_turned * (1.0 + 1e-9) + 1e-13
    }

    /// Returns the radius of the ball that holds all eyes of the region, around the eye of the
    /// [picture](Self::picture), in metres. A little more than [`Reach::metres`], for rounding.
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// Returns the radius of a ball around the eye of the [picture](Self::picture) that holds all points at
    /// which sight of the region's views begins, on their near planes, in metres.
    pub fn start_radius(&self) -> f64 {
        self.start
    }

    /// Returns the view to draw occluders with: from the middle of the ball, wide enough for all directions,
    /// without a far plane. Its near plane is beyond all points at which sight of the region's views begins.
    /// [`margin`](Self::margin) tells of the space beside the picture that a view of the region may see.
    pub fn picture(&self) -> &View {
        &self.picture
    }

    /// Returns the planes of a convex volume that contains all that the region's views can see, for points in
    /// metres relative to `origin`, a point of the world.
    pub fn planes(&self, origin: DVec3) -> SmallVec<[ViewPlane; MAX_PLANES]> {
        let mut planes = SmallVec::new();
        for (slot, plane) in self.volume.planes(origin).by_slot() {
            if slot < 4 {
                let ViewPlane { plane: Plane { normal, offset }, error } = *plane;
                planes.push(ViewPlane { plane: Plane { normal, offset: offset + self.radius }, error });
            }
        }
        let (eye, ahead) = (self.camera.eye - origin, self.camera.axes[2]);
        let error = 1e-12 * (eye.length() + self.camera.eye.length() + origin.length());
        for (towards, depth) in [(ahead, self.depths[0]), (-ahead, -self.depths[1])] {
            if depth.is_finite() {
                let offset = -towards.dot(eye) - depth;
                let error = error + 1e-12 * depth.abs();
                planes.push(ViewPlane { plane: Plane { normal: towards, offset }, error });
            }
        }
        planes
    }

    /// Returns the test for boxes that may be seen outside the [picture](Self::picture), for boxes in metres
    /// relative to `origin`, a point of the world.
    pub fn margin(&self, origin: DVec3) -> PictureMargin {
        let mut planes = SmallVec::new();
        planes.extend_from_slice(self.picture.planes(origin).as_slice());
        let eye = self.camera.eye - origin;
        let error = 1e-12 * (self.camera.eye.length() + origin.length());
        let reach = self.margin + error;
        PictureMargin { eye, squared: reach * reach, planes }
    }
}

/// Returns the tangent of the sum of two angles, given by their tangents, of which the second is not
/// negative.
/// `None` if the sum is not certainly less than the angle of [`MAX_TANGENT`].
fn turned(tangent: f64, by: f64) -> Option<f64> {
    let sum = (tangent + by) / (1.0 - tangent * by);
    (tangent * by < 1.0 && sum.abs() < MAX_TANGENT).then_some(sum)
}

/// The space beside and before the [picture](ViewRegion::picture) of a region in which a view of the region
/// may see something. All of it is near the middle of the ball.
#[derive(Clone, Debug)]
pub struct PictureMargin {
    /// Middle of the ball, relative to the origin of the boxes, in metres.
    eye: DVec3,
    /// Square of the distance from the eye within which points of the space lie.
    squared: f64,
    /// Planes of the picture.
    planes: SmallVec<[ViewPlane; MAX_PLANES]>,
}

impl PictureMargin {
    /// Returns whether a box may hold a point that is outside the picture and that a view of the region may
    /// see. A map that was drawn into the picture must not hide such a box. True for inverted boxes and NaN.
    pub fn may_meet(&self, bounds: &Aabb) -> bool {
        let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let beside = (min - self.eye).max(self.eye - max).max(DVec3::ZERO);
        let is_far = beside.length_squared() > self.squared;
        !is_far && !self.planes.iter().all(|plane| plane.contains_box(bounds))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::Depth;
    use glam::{DMat4, DQuat};
    use visibility_testing::Random;

    /// Returns a view from `eye` through a window, given by its left, right, bottom and top side. It looks
    /// along z, with x to the right and y upwards, turned by `turn`.
    fn view(eye: DVec3, turn: DQuat, [left, right, bottom, top]: [f64; 4], near: f64, far: f64) -> View {
        let pose = Pose { eye, right: turn * DVec3::X, up: turn * DVec3::Y, forward: turn * DVec3::Z };
        View::perspective_off_center(pose, Window { left, right, bottom, top }, near, far).unwrap()
    }

    /// Returns a view along z from the origin whose upper and lower side rise by `skew` times their tangent
    /// to the right, and whose near plane rises towards x and y by `tilt`. The far plane rises by more: by
    /// the ratio of far to near.
    fn askew(sides: [f64; 4], skew: f64, tilt: [f64; 2], near: f64, far: f64) -> View {
        let [left, right, bottom, top] = sides;
        let (width, height) = (right - left, top - bottom);
        let row = |x: f64, y: f64, z: f64, w: f64| DVec4::new(x, y, z, w);
        let (scale, depth) = if far.is_finite() {
            (far / (far - near), Depth::ZeroToOne)
        } else {
            (1.0, Depth::ZeroToOneInfinite)
        };
        let rows = [
            row(2.0 / width, 0.0, -(left + right) / width, 0.0),
            row(2.0 * skew / height, 2.0 / height, -(bottom + top) / height, 0.0),
            row(tilt[0], tilt[1], 1.0, -near) * scale,
            DVec4::Z,
        ];
        let matrix = DMat4::from_cols(rows[0], rows[1], rows[2], rows[3]).transpose();
        View::from_clip_from_world(matrix, depth).unwrap()
    }

    /// Returns the least signed distance of a point of the world from the region's planes.
    fn inside_by(region: &ViewRegion, p: DVec3) -> f64 {
        let planes = region.planes(DVec3::ZERO);
        planes.iter().map(|plane| plane.plane.signed_distance(p)).fold(f64::INFINITY, f64::min)
    }

    const STILL: DQuat = DQuat::IDENTITY;
    const SIDES: [f64; 4] = [-0.5, 0.7, -0.3, 0.4];
    const FREE: f64 = f64::INFINITY;

    #[test]
    fn a_region_contains_views_that_differ_by_the_rounding_of_matrices_and_no_others() {
        let of = |sides, near, far| view(DVec3::ZERO, STILL, sides, near, far);
        let region = ViewRegion::around(&of(SIDES, 0.1, 50.0), Reach::new(0.0, 0.0)).unwrap();
        let endless = ViewRegion::around(&of(SIDES, 0.1, FREE), Reach::new(0.0, 0.0)).unwrap();
        assert!(
            region.contains(&of(SIDES, 0.1, 50.0)) && endless.contains(&of(SIDES, 0.1, FREE)),
            "the views themselves"
        );
        assert!(!region.contains(&of(SIDES, 0.1, FREE)), "a view that sees farther");
        assert!(endless.contains(&of(SIDES, 0.1, 1e9)), "a view that sees less far than without end");
        assert!(!region.contains(&of(SIDES, 0.1, 50.0).with_layers(1)), "other layers");
        for (by, is_same) in [(4.9e-4, true), (5.1e-4, false), (-4.9e-4, true), (-5.1e-4, false)] {
            for side in 0..4 {
                let mut sides = SIDES;
                sides[side] += by * [1.2, 0.7][side / 2];
                assert_eq!(region.contains(&of(sides, 0.1, 50.0)), is_same, "side {side} moved by {by}");
            }
            let scaled = 1.0 + by;
            assert_eq!(region.contains(&of(SIDES, 0.1 * scaled, 50.0)), is_same, "near moved by {by}");
            assert_eq!(region.contains(&of(SIDES, 0.1, 50.0 * scaled)), is_same, "far moved by {by}");
        }
        let mirrored = Pose { eye: DVec3::ZERO, right: -DVec3::X, up: DVec3::Y, forward: DVec3::Z };
        let window = Window { left: -0.5, right: 0.7, bottom: -0.3, top: 0.4 };
        let mirrored = View::perspective_off_center(mirrored, window, 0.1, 50.0).unwrap();
        assert!(!region.contains(&mirrored), "a mirrored view");
    }

    /// The eye of a view far from the world's zero point is uncertain. A region contains its own view and
    /// those within its reach, and no eye that may be outside of its ball.
    #[test]
    fn a_region_contains_what_is_certainly_within_its_ball() {
        let eye = DVec3::new(1e9, -1e9, 1e9);
        let at = |eye: DVec3| view(eye, STILL, SIDES, 1e-3, FREE);
        let error = ViewProjection::new(&at(eye), DVec3::ZERO).eye_error();
        assert!(error > 1e-6 && error < 1e-5, "the error of the eye is {error} m");
        for metres in [0.0, 1.0 / 1024.0] {
            let region = ViewRegion::around(&at(eye), Reach::new(metres, 0.0)).unwrap();
            assert!(region.contains(&at(eye)), "the view itself, {metres} m");
            assert!(region.contains(&at(eye + DVec3::X * metres)), "a view {metres} m away");
            for (errors, is_certain) in [(2.3, true), (1.7, false), (1.2, false)] {
                let off = region.radius() - errors * error;
                let other = at(eye + DVec3::X * off);
                assert_eq!(region.contains(&other), is_certain, "{metres} m, {errors} errors within");
            }
        }
        // Eyes on a grid of 2^-23 m, and a reach that the rounding of an eye exceeds.
        let step = eye.x.next_up() - eye.x;
        let region = ViewRegion::around(&at(eye), Reach::new(0.75 * step, 0.0)).unwrap();
        assert!(region.contains(&at(eye + DVec3::X * step)), "an eye that is rounded to the next number");
    }

    /// Corners of the pictures of all views that count as the same are in the region: with windows that are
    /// wider by the tolerance and askew, and near and far planes that are moved and tilted by theirs.
    #[test]
    fn planes_hold_what_views_at_the_tolerances_see() {
        let corners = |[left, right, bottom, top]: [f64; 4]| {
            [(left, bottom), (left, top), (right, bottom), (right, top)]
        };
        let most = 4.999e-4;
        // Windows, with the greatest skew that half of the slack allows.
        for (x, y, skew) in [(0.5, 0.4, 0.0), (3.5, 0.0171, 9.7e-6), (3.5, 0.0171, -9.7e-6)] {
            let sides = [-x, x, -y, y];
            for near_skew in [0.0, skew] {
                let own = askew(sides, near_skew, [0.0; 2], 1.0, FREE);
                let region = ViewRegion::around(&own, Reach::new(0.0, 0.0)).unwrap();
                let wider =
                    [-x - 2.0 * x * most, x + 2.0 * x * most, -y - 2.0 * y * most, y + 2.0 * y * most];
                for sides in [wider, [wider[0], x, wider[2], y], [-x, wider[1], -y, wider[3]]] {
                    let other = askew(sides, skew, [0.0; 2], 1.0, FREE);
                    assert!(region.contains(&other), "{sides:?} askew by {skew}");
                    for (right, up) in corners(sides) {
                        let p = DVec3::new(right, up - skew * right, 1.0) * 4.0;
                        let least = inside_by(&region, p);
                        assert!(least > -1e-12, "{p} is outside by {least}: {sides:?}, {skew}");
                    }
                }
            }
        }
        // Askew by more than the slack allows, to one side alone.
        for sides in [[-0.01, 3.5, -0.005, 0.005], [-3.5, 0.01, -0.005, 0.005]] {
            let own = askew(sides, 9e-6, [0.0; 2], 1.0, FREE);
            assert!(ViewRegion::around(&own, Reach::new(0.0, 0.0)).is_none(), "{sides:?}");
        }
        // Near and far planes that are tilted towards a corner of a wide window.
        let wide = [-3.66, 3.66, -3.66, 3.66];
        let tilt = 0.9999e-4 / 2f64.sqrt();
        let region =
            ViewRegion::around(&askew(wide, 0.0, [0.0; 2], 1.0, FREE), Reach::new(0.0, 0.0)).unwrap();
        let near = 1.0 - most;
        let other = askew(wide, 0.0, [tilt; 2], near, FREE);
        assert!(region.contains(&other), "a near plane that is tilted");
        let bounded =
            ViewRegion::around(&askew(wide, 0.0, [0.0; 2], 1.0, 9.0), Reach::new(0.0, 0.0)).unwrap();
        let far = 9.0 * (1.0 + most);
        let tilted = askew(wide, 0.0, [tilt / far; 2], 1.0, far);
        assert!(bounded.contains(&tilted), "a far plane that is tilted");
        for (right, up) in corners(wide) {
            let (ray, slope) = (DVec3::new(right, up, 1.0), right + up);
            let p = ray * (near / (1.0 + tilt * slope));
            assert!(inside_by(&region, p) > -1e-12, "{p} of the near plane is outside");
            assert!(p.length() <= region.start_radius(), "{p} is where sight begins");
            // On the far plane `w - z = 0`, with `z = s (n . p - near)` and `s = far / (far - near)`.
            let s = far / (far - 1.0);
            let p = ray * (s / (s * (1.0 + tilt / far * slope) - 1.0));
            assert!(inside_by(&bounded, p) > -1e-12, "{p} of the far plane is outside");
        }
    }

    /// Corners of the near and far plane of views that are turned and moved to the limits of the region, for
    /// windows whose sides differ.
    #[test]
    fn planes_hold_what_turned_views_see() {
        let mut random = Random(71);
        let all =
            [[-2.0, 0.1, -0.1, 0.1], [-0.1, 2.0, -0.1, 0.1], [-0.1, 0.1, -2.0, 0.1], [-0.1, 0.1, -0.1, 2.0]];
        let narrow = [[-0.03, 0.03, -0.04, 0.04], [-1.0, 1.0, -1.0, 1.0], [-2.0, 2.0, -0.1, 0.1]];
        for sides in all.into_iter().chain(narrow) {
            for (metres, radians) in [(0.0, 0.1), (0.2, 0.1), (0.1, 0.3), (0.0, 0.9)] {
                let own = view(DVec3::ZERO, STILL, sides, 1.0, 9.0);
                let Some(region) = ViewRegion::around(&own, Reach::new(metres, radians)) else { continue };
                let [left, right, bottom, top] = sides;
                for round in 0..200 {
                    let axis = if round % 3 == 0 {
                        random.pick(&[DVec3::X, -DVec3::X, DVec3::Y, -DVec3::Y, DVec3::Z, -DVec3::Z])
                    } else {
                        random.direction()
                    };
                    let part = if round % 2 == 0 { 1.0 } else { random.unit() };
                    let turn = DQuat::from_axis_angle(axis, radians * part);
                    let eye = random.direction() * metres;
                    assert!(region.contains(&view(eye, turn, sides, 1.0, 9.0)), "{round}: {sides:?}");
                    let beyond = DQuat::from_axis_angle(axis, radians * 1.001 + 1e-5);
                    assert!(!region.contains(&view(eye, beyond, sides, 1.0, 9.0)), "{round}: {sides:?}");
                    for (x, y) in [(left, bottom), (left, top), (right, bottom), (right, top), (left, 0.0)] {
                        for depth in [1.0, 9.0] {
                            let p = eye + turn * (DVec3::new(x, y, 1.0) * depth);
                            let least = inside_by(&region, p);
                            assert!(least > -1e-12, "{round}: {p} is {least} outside, {sides:?} {radians}");
                        }
                        let start = eye + turn * DVec3::new(x, y, 1.0);
                        assert!(start.length() <= region.start_radius(), "{round}: sight begins at {start}");
                    }
                }
                assert!(region.start_radius() >= 2.0 * region.radius(), "planes of eyes are near");
            }
        }
        let wide = ViewRegion::around(&view(DVec3::ZERO, STILL, SIDES, 1e-3, FREE), Reach::new(1.0, 0.0));
        assert!(wide.unwrap().start_radius() >= 2.0, "planes of eyes are near");
    }

    #[test]
    fn views_and_reaches_without_regions() {
        let at = |sides| view(DVec3::ZERO, STILL, sides, 0.1, FREE);
        let around = |view: &View, metres, radians| ViewRegion::around(view, Reach::new(metres, radians));
        let narrow = at([-0.1, 0.1, -0.1, 0.1]);
        assert!(
            around(&at(SIDES), 0.1, 0.1).is_some() && around(&narrow, 0.1, 0.9).is_some(),
            "views with regions"
        );
        for radians in [1.0, 3.0, 3.3, 6.5, FREE] {
            assert!(around(&narrow, 0.1, radians).is_none(), "a turn of {radians}");
        }
        assert!(around(&at(SIDES), FREE, 0.1).is_none(), "a ball without end");
        assert!(around(&at([-7.0, 7.0, -1.0, 1.0]), 0.1, 0.0).is_none(), "a wide window");
        assert!(around(&at([-0.1, 3.0, -0.1, 0.1]), 0.1, 0.9).is_none(), "a side behind the eye");
        // Angles whose sums are beyond 90 degrees have tangents as those of a window to the other side.
        let aside = at([-0.001, 1.0, -0.001, 1.0]);
        assert!(
            around(&aside, 0.1, 0.2).is_some() && around(&aside, 0.1, 0.735).is_none(),
            "a turned corner"
        );
        let clipped = at(SIDES).with_clip_planes(&[Plane::new(DVec3::X, 1.0)]).unwrap();
        assert!(around(&clipped, 0.1, 0.1).is_none(), "a clip plane");
        let behind = askew(SIDES, 0.0, [0.0; 2], -0.5, FREE);
        assert!(around(&behind, 0.1, 0.1).is_none(), "a near plane behind the eye");
        let oblique = askew(SIDES, 0.0, [1e-3, 0.0], 0.5, FREE);
        assert!(around(&oblique, 0.1, 0.1).is_none(), "an oblique near plane");
        assert_eq!(Reach::new(-1.0, f64::NAN), Reach::new(0.0, 0.0), "reaches that are none");
    }

    /// The margin meets points beside the picture that an eye aside sees along a side of the volume. It meets
    /// no point far beside the picture, and none inside the picture.
    #[test]
    fn the_margin_holds_what_is_beside_the_picture() {
        let point = |p: DVec3| Aabb::new(p.as_vec3() - 1e-4, p.as_vec3() + 1e-4);
        for [x, y] in [[0.01, 0.01], [1.0, 0.5], [0.5, 2.0]] {
            let own = view(DVec3::ZERO, STILL, [-x, x, -y, y], 1e-3, FREE);
            let region = ViewRegion::around(&own, Reach::new(1.0, 0.0)).unwrap();
            let (margin, picture) = (region.margin(DVec3::ZERO), region.picture().planes(DVec3::ZERO));
            let mut beside = 0;
            for (across, along, tangent, other) in [(DVec3::X, DVec3::Y, x, y), (DVec3::Y, DVec3::X, y, x)] {
                for side in [-1.0, 1.0] {
                    let (sine, cosine) = (tangent / tangent.hypot(1.0), 1.0 / tangent.hypot(1.0));
                    let eye = across * (cosine * side) - DVec3::Z * sine;
                    for step in 0..200 {
                        let depth = f64::from(step) * 0.1;
                        for up in [-other, 0.0, other] {
                            let p = eye + (across * (tangent * side) + along * up + DVec3::Z) * depth;
                            let is_inside = picture.contains(p + (p - eye) * 1e-3);
                            beside += usize::from(!is_inside && depth > 2.0);
                            let is_met = margin.may_meet(&point(p));
                            assert!(is_inside || is_met, "{p} is beside the picture of {x} by {y}");
                        }
                    }
                }
            }
            assert!(beside > 100, "{beside} points beside the picture");
            assert!(!margin.may_meet(&point(DVec3::Z * 8.0)), "a box in the middle of the picture");
            assert!(margin.may_meet(&point(DVec3::Z * 1.5)), "a box before the picture");
        }
        let narrow = view(DVec3::ZERO, STILL, [-0.01, 0.01, -0.01, 0.01], 1e-3, FREE);
        let region = ViewRegion::around(&narrow, Reach::new(1.0, 0.0)).unwrap();
        let margin = region.margin(DVec3::ZERO);
        for p in [DVec3::X, DVec3::Y, DVec3::new(0.9, 0.0, 0.4)] {
            assert!(!margin.may_meet(&point(p * 11.0)) && !margin.may_meet(&point(p * -11.0)), "{p} is far");
        }
        assert!(margin.may_meet(&Aabb::new(glam::Vec3::ONE, glam::Vec3::ZERO)), "an inverted box");
        // Sight of a wide view begins beside and before the picture, farther away than the ball is wide.
        let wide = view(DVec3::ZERO, STILL, [-3.0, 3.0, -3.0, 3.0], 1.0, FREE);
        let region = ViewRegion::around(&wide, Reach::new(0.01, 0.0)).unwrap();
        let margin = region.margin(DVec3::ZERO);
        for at in [DVec3::new(2.9, 2.9, 1.0), DVec3::new(-2.9, 2.9, 1.0), DVec3::new(8.0, -8.0, 3.0)] {
            assert!(margin.may_meet(&point(at)), "{at} is before the picture");
        }
    }

    /// The eye relative to an origin so far that the difference is rounded by 127 m: the planes across the
    /// view and the margin count it.
    #[test]
    fn far_origins_count_with_their_rounding() {
        let (eye, origin) = (DVec3::Z * 129.0, DVec3::Z * -2f64.powi(60));
        let ahead = view(eye, STILL, [-1e-3, 1e-3, -1e-3, 1e-3], 1.0, 100.0);
        let region = ViewRegion::around(&ahead, Reach::new(14.0, 0.0)).unwrap();
        let (mut across, mut most) = (0, 0.0f64);
        for plane in region.planes(origin).into_iter().filter(|plane| plane.plane.normal.z.abs() > 0.9) {
            let towards = plane.plane.normal.z;
            if plane.plane.normal.truncate() != glam::DVec2::ZERO {
                continue;
            }
            across += 1;
            let depth = if towards > 0.0 { region.depths[0] } else { -region.depths[1] };
            // `offset + towards * 2^60` is exact, `-129 towards - depth` what it should be.
            let off = (plane.plane.offset + towards * 2f64.powi(60)) - (-129.0 * towards - depth);
            most = most.max(off.abs());
            assert!(off.abs() <= plane.error, "{towards}: off by {off} m");
        }
        assert!(across == 2 && most > 100.0, "{across} planes across the view, off by up to {most} m");
        let turned = DQuat::from_rotation_y(core::f64::consts::PI);
        let back = view(eye, turned, [-1e-3, 1e-3, -1e-3, 1e-3], 1e-3, FREE);
        let region = ViewRegion::around(&back, Reach::new(14.0, 0.0)).unwrap();
        // Relative to the origin, 129 m before the eye and 14 m aside.
        let at = glam::Vec3::new(14.0, 0.0, 2f32.powi(60));
        assert!(region.margin(origin).may_meet(&Aabb::new(at, at)), "a box beside the picture");
        let relative = glam::Vec3::new(14.0, 0.0, -129.0);
        assert!(region.margin(eye).may_meet(&Aabb::new(relative, relative)), "the same from nearby");
    }

    /// The sides of the volume, relative to origins near them and far from the eye, against sums of double
    /// precision.
    #[test]
    fn sides_are_within_their_errors() {
        use crate::geometry::DoubleDouble;
        let mut random = Random(73);
        let region = ViewRegion::around(&view(DVec3::ZERO, STILL, SIDES, 0.1, FREE), Reach::new(0.0, 0.0));
        let region = region.unwrap();
        let m = region.volume.clip_from_local;
        let mut off = 0;
        for round in 0..400 {
            let (axis, sign) = (round / 2 % 2, if round % 2 == 0 { 1.0 } else { -1.0 });
            let (row, w) = (m.row(axis), m.row(3));
            let normal = [0, 1, 2].map(|i| DoubleDouble::sum(w[i], sign * row[i]));
            let length = DVec3::from_array(normal.map(|x| x.hi)).length();
            // Along the side, so that the terms of the offset cancel.
            let mut origin = DVec3::new(random.fine_range(-1.0, 1.0), random.fine_range(-1.0, 1.0), 1.0);
            origin[axis] = -normal[2].hi / normal[axis].hi;
            let origin = origin * 2f64.powi(40) * random.fine_range(0.5, 1.0);
            let terms = [0, 1, 2].map(|i| normal[i].times(origin[i].into()));
            let exact = terms[0].plus(terms[1]).plus(terms[2]).hi / length + region.radius;
            let plane = region.planes(origin)[2 * axis + round % 2];
            let distance = (plane.plane.offset - exact).abs();
            assert!(distance <= plane.error, "{round}: {distance} of at most {}", plane.error);
            off += usize::from(distance > plane.error / 64.0);
        }
        assert!(off > 20, "{off} sides are off by a part of their bound");
    }
}
