//! Clipping and projection of the scene's polygons and boxes to NDC.

use super::beams::{ImageCorner, MIN_VISIBLE_WIDTH};
use crate::polygon_cut::cut;
use crate::view_volume::ViewVolume;
use alloc::vec::Vec;
use visibility_core::glam::{DMat4, DVec3, DVec4};
use visibility_core::{
    Aabb, Scene, View,
    geometry::{Plane, Side, SidePlane},
    view::{Eye, MAX_PLANES, ViewPlanes, ViewProjection},
};

/// A polygon projected to NDC, with the scratch memory for clipping it.
#[derive(Clone, Debug, Default)]
pub(super) struct ProjectedPolygon {
    /// Scratch: vertices in metres relative to `Scene::origin` of the polygon, and of the inner and outer
    /// parts of a cut.
    space: [Vec<DVec3>; 3],
    /// NDC corners of the polygon projected last, counter-clockwise; the image is -1 to 1. They may lie
    /// outside the image. Empty before the first projection.
    pub(super) polygon: Vec<ImageCorner>,
    /// Bound on the absolute error of the corners in `polygon`, in NDC (1 is half the image).
    pub(super) error: f64,
    /// Whether all of the polygon drawn last is certainly beyond the near plane, before the far plane and on
    /// the inner side of the view's own clip planes. Then its [`Extent`] makes no difference.
    pub(super) is_whole: bool,
}

/// Part of a polygon that is projected, where rounding leaves undecided what the near plane, the far plane
/// and the view's own clip planes cut off.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Extent {
    /// All that may be in view: what is tested for visibility.
    Greatest,
    /// Only what is certainly in view: what covers image area.
    Least,
}

/// The projection of points in metres relative to `Scene::origin` to NDC, with bounds on its rounding errors.
#[derive(Clone, Debug)]
pub(super) struct ScreenProjection {
    /// Matrix from points in metres relative to `Scene::origin` to clip space.
    clip: DMat4,
    /// Clipping planes in metres relative to `Scene::origin`, inner side in front: near, far, the view's own
    /// clip planes, the four sides of an image [`CLIP_WIDTH`] times as wide, and the plane of `least_w`. Only
    /// the first `count` are valid.
    planes: [SidePlane; MAX_PLANES + 1],
    /// Number of leading `planes` that bound the view: near, far and the view's own clip planes.
    view_count: usize,
    /// Number of clipping planes: the valid entries in `planes`.
    count: usize,
    /// The view volume, for testing boxes that extend in front of the near plane.
    volume: ViewVolume,
    /// Positive lower bound on clip-space `w` of points in the view volume.
    least_w: f64,
    /// Bound on the absolute error of clip-space `x`, `y` and `w` of any point in the scene's bounds.
    error: f64,
}

/// Maximum absolute error of an NDC position. A view with a larger error is not culled.
const MAX_NDC_ERROR: f64 = 1e-8;

/// Width in image widths of the volume to which polygons are clipped before they are projected. It is wider
/// than the image, since such a cut gives an edge another line. Cuts at the sides of the image are left to
/// the beam tree, which keeps the line of the whole edge.
const CLIP_WIDTH: f64 = 4.0;

impl ScreenProjection {
    /// Builds the projection for points within `bounds`, in metres relative to `Scene::origin`. `magnitude`
    /// is the bound on absolute coordinates, by axis, for which the tree decides sides: points that count as
    /// on its planes are off by roundings of that magnitude, however small `bounds` are. `None` if NDC
    /// positions, as they are or as an eye sees them that is off by its error, are not known to within
    /// [`MAX_NDC_ERROR`], because the coordinates are too large or the near plane too close, or if `bounds`
    /// is infinite.
    pub(super) fn new(view: &View, scene: &Scene, bounds: &Aabb, magnitude: DVec3) -> Option<Self> {
        // With `u = 2^-53`: clip-space `x`, `y` and `w` are sums of four products, each sum rounded by at
        // most `5 u` times the sum `m` of the products' magnitudes. The matrix is rounded once, and a vertex
        // made by a cut by another `6 u` of its magnitude. The total is `12 u m`. So `x / w` has an absolute
        // error of at most `12 u m (1 + |x / w|) / w`.
        let origin = scene.origin();
        let clip = view.clip_from(origin);
        let magnitude = bounds.min.abs().max(bounds.max.abs()).as_dvec3().max(magnitude);
        // Bounds rounded outwards are infinite for the largest numbers, and later checks would not detect
        // that.
        if !magnitude.is_finite() {
            return None;
        }
        let [x, y, w] = [clip.row(0), clip.row(1), clip.row(3)];
        let size = |row: DVec4| row.truncate().abs().dot(magnitude) + row.w.abs();
        let error = 6.0 * f64::EPSILON * size(x).max(size(y)).max(size(w));
        let least_w = nearest_w(view)?;
        let mut projection = Self {
            clip,
            planes: [SidePlane { plane: Plane::new(DVec3::ZERO, 1.0), margin: 0.0 }; MAX_PLANES + 1],
            view_count: 0,
            count: 0,
            volume: ViewVolume::new(view, scene, 0.0),
            least_w,
            error,
        };
        // The view's first four planes are the sides of the image; wider ones replace them.
        for (_, plane) in view.planes(origin).by_slot().filter(|&(slot, _)| slot >= ViewPlanes::NEAR) {
            let side = SidePlane::new(plane.plane, magnitude);
            projection.push(SidePlane { margin: side.margin + plane.error, ..side });
        }
        projection.view_count = projection.count;
        for row in [w * CLIP_WIDTH + x, w * CLIP_WIDTH - x, w * CLIP_WIDTH + y, w * CLIP_WIDTH - y] {
            let plane = Plane::new(row.truncate(), row.w).normalized()?;
            projection.push(SidePlane::new(plane, magnitude));
        }
        // Beside the image, points beyond an oblique near plane may have any `w`. The view volume has 1.001
        // times `least_w`, and the margin of the plane is less than 1e-7 of it, since the error of the image
        // is at most `MAX_NDC_ERROR`. So this plane cuts nothing in the image, and leaves no less than
        // `least_w`. `w` is the same everywhere in a parallel view.
        let beyond = Plane::new(w.truncate(), w.w - 1.0005 * least_w);
        if beyond.normal != DVec3::ZERO {
            projection.push(SidePlane::new(beyond.normalized()?, magnitude));
        }
        // The eye decides which side of a polygon's plane comes first, and which are fronts.
        let reach = match view.eye(origin) {
            Eye::Point(_) => 1.0,
            Eye::Direction(_) => (bounds.max - bounds.min).as_dvec3().length(),
        };
        // `x / w` changes with `x`, and with `w` at places up to one image width from the middle.
        let per_metre = x.truncate().length().max(y.truncate().length()) + w.truncate().length();
        let per_metre = per_metre / least_w;
        let eye_error = per_metre * reach * ViewProjection::new(view, origin).eye_error();
        (projection.error_at(least_w) <= MAX_NDC_ERROR && eye_error <= MAX_NDC_ERROR).then_some(projection)
    }

    /// Appends a clipping plane. The array holds all that a view has.
    fn push(&mut self, plane: SidePlane) {
        if self.count < self.planes.len() {
            self.planes[self.count] = plane;
            self.count += 1;
        }
    }

    /// Returns a bound on the absolute NDC error of points in the image widened by [`CLIP_WIDTH`] whose
    /// clip-space w coordinate is at least the argument.
    fn error_at(&self, w: f64) -> f64 {
        // The rounding of the quotient is less, since the error is at least `12 u w`.
        self.error * (1.0 + CLIP_WIDTH) / w
    }

    /// Returns a bound on the absolute error of any projected point, in NDC.
    pub(super) fn error(&self) -> f64 {
        self.error_at(self.least_w)
    }

    /// Clips a convex polygon in metres relative to `Scene::origin` to the planes and replaces `image` by its
    /// projection in NDC. `extent` is the part that is meant where rounding leaves the sides of its vertices
    /// undecided. Returns false if fewer than three corners are left.
    ///
    /// A plane that bounds the view is moved by twice its margin for that, outwards or inwards. Vertices
    /// beyond the margin of the moved plane, cut points and vertices within that margin are then all at least
    /// half a margin off the plane itself, on the outer or on the inner side.
    pub(super) fn draw(&self, vertices: &[DVec3], extent: Extent, image: &mut ProjectedPolygon) -> bool {
        let [polygon, inner, outer] = &mut image.space;
        polygon.clear();
        polygon.extend_from_slice(vertices);
        // Clipped to the view before the projection, so that every corner is beyond the near plane.
        image.is_whole = true;
        for (i, plane) in self.planes[..self.count].iter().enumerate() {
            let mut plane = *plane;
            if i < self.view_count {
                if polygon.iter().all(|&v| plane.side(v) == Side::Front) {
                    continue;
                }
                image.is_whole = false;
                let by = if extent == Extent::Greatest { 2.0 } else { -2.0 } * plane.margin;
                plane.plane.offset += by;
            }
            let (mut inside, mut outside) = (false, false);
            for &v in polygon.iter() {
                match plane.side(v) {
                    Side::Front => inside = true,
                    Side::Back => outside = true,
                    Side::On => {}
                }
            }
            if !outside {
                continue;
            }
            if !inside {
                return false;
            }
            cut(polygon, &plane, inner, outer);
            core::mem::swap(polygon, inner);
        }
        image.polygon.clear();
        // The error in NDC grows as `w` shrinks: that of the nearest corner bounds all.
        let mut nearest = f64::INFINITY;
        for v in polygon.iter() {
            let q = self.clip * v.extend(1.0);
            let w = q.w.max(self.least_w);
            nearest = nearest.min(w);
            image.polygon.push(ImageCorner::new(q.x / w, q.y / w));
        }
        image.error = self.error_at(nearest);
        // Counter-clockwise in the image, whichever side of the polygon is seen.
        if area(&image.polygon) < 0.0 {
            image.polygon.reverse();
        }
        image.polygon.len() >= 3
    }

    /// Tests whether a box is at most about 4 [`MIN_VISIBLE_WIDTH`] wide in NDC in some direction: every
    /// corner lies within 2 [`MIN_VISIBLE_WIDTH`] of one line. `None` if a corner may be in front of the
    /// near plane, or is NaN.
    pub(super) fn is_narrow(&self, bounds: &Aabb) -> Option<bool> {
        let mut corners = [[0.0; 2]; 8];
        for (projected, corner) in corners.iter_mut().zip(bounds.corners()) {
            let q = self.clip * corner.as_dvec3().extend(1.0);
            if !(q.w >= self.least_w) {
                return None;
            }
            *projected = [q.x / q.w, q.y / q.w];
        }
        let farthest = |from: [f64; 2]| {
            let mut best = (0.0, from);
            for p in corners {
                let distance = (p[0] - from[0]).abs().max((p[1] - from[1]).abs());
                if distance > best.0 {
                    best = (distance, p);
                }
            }
            best
        };
        let (_, a) = farthest(corners[0]);
        let (length, b) = farthest(a);
        // Distances of the corners from the longest line between corners, times that line's length.
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        let off = |p: &[f64; 2]| (dx * (p[1] - a[1]) - dy * (p[0] - a[0])).abs();
        Some(corners.iter().all(|p| off(p) <= 2.0 * MIN_VISIBLE_WIDTH * length))
    }

    /// Replaces `image` by a rectangle in NDC that contains the projection of a box, clamped to the image.
    /// The rectangle is the whole image if the box may extend in front of the near plane. Returns false if
    /// the box is outside the view.
    pub(super) fn draw_box(&self, bounds: &Aabb, image: &mut ProjectedPolygon) -> bool {
        let (mut min, mut max) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for corner in bounds.corners() {
            let q = self.clip * corner.as_dvec3().extend(1.0);
            if q.w < self.least_w {
                if self.volume.is_outside(bounds) {
                    return false;
                }
                // A box that reaches beside the eye may project anywhere.
                (min, max) = ([-1.0; 2], [1.0; 2]);
                break;
            }
            let (x, y) = (q.x / q.w, q.y / q.w);
            min = [min[0].min(x), min[1].min(y)];
            max = [max[0].max(x), max[1].max(y)];
        }
        let [left, low] = min.map(|v| (v - 4.0 * self.error()).max(-1.0));
        let [right, high] = max.map(|v| (v + 4.0 * self.error()).min(1.0));
        image.polygon.clear();
        image.polygon.extend(
            [(left, low), (right, low), (right, high), (left, high)].map(|(x, y)| ImageCorner::new(x, y)),
        );
        left <= right && low <= high
    }
}

/// Returns a positive lower bound on clip-space `w` over the view volume; `None` if there is none.
fn nearest_w(view: &View) -> Option<f64> {
    let clip = view.clip_from(view.origin());
    // Clip-space w is constant over the near plane of an ordinary camera. With an oblique near plane, it may
    // be smaller at one corner of the image.
    let inverse = clip.inverse();
    let near = view.depth().at_near();
    let mut least = f64::INFINITY;
    for (x, y) in [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)] {
        // An NDC point at near depth comes from a point p with clip * p = w (x, y, near, 1).
        let p = inverse * DVec4::new(x, y, near, 1.0);
        least = least.min(1.0 / p.w);
    }
    (least > 0.0 && least.is_finite()).then_some(least * 0.999)
}

/// Returns twice the signed area of a polygon in square NDC units, positive if counter-clockwise. The polygon
/// must not be empty.
fn area(polygon: &[ImageCorner]) -> f64 {
    let first = polygon[0];
    polygon
        .windows(2)
        .map(|p| (p[0].x - first.x) * (p[1].y - first.y) - (p[0].y - first.y) * (p[1].x - first.x))
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::{
        Pose,
        view::{Depth, Window},
    };
    use visibility_testing::Random;

    /// View along x from `eye`, a quarter of a turn wide, whose near plane is 0.1 m away.
    fn view(eye: DVec3) -> View {
        let pose = Pose::look_at(eye, eye + DVec3::X, DVec3::Z);
        View::perspective_off_center(pose, Window::centered(1.0, 1.0), 0.1, f64::INFINITY).unwrap()
    }

    fn cube(size: f32) -> Aabb {
        Aabb::from_arrays([-size; 3], [size; 3])
    }

    #[test]
    fn a_view_is_refused_from_an_error_of_1e_minus_8_in_the_image_on() {
        let known = |size: f32| {
            ScreenProjection::new(&view(DVec3::ZERO), &Scene::new(), &cube(size), DVec3::ZERO).is_some()
        };
        // 12 u of the coordinates, divided by the least depth, at places up to four images wide.
        let limit = 1e-8 * 0.0999 / (12.0 * f64::EPSILON / 2.0 * 5.0);
        assert!(known(0.99 * limit as f32) && !known(1.01 * limit as f32), "limit of {limit} m");
        assert!(!known(f32::INFINITY), "infinite bounds");
        for bounds in
            [[[-1.0; 3], [2e5, 1.0, 1.0]], [[-1.0, -2e5, -1.0], [1.0; 3]], [[-1.0; 3], [1.0, 1.0, 2e5]]]
        {
            let bounds = Aabb::from_arrays(bounds[0], bounds[1]);
            assert!(
                ScreenProjection::new(&view(DVec3::ZERO), &Scene::new(), &bounds, DVec3::ZERO).is_none(),
                "{bounds:?}"
            );
        }
    }

    /// A parallel view whose direction is off by its error, over the extent of the scene, moves the image by
    /// more than corners are off.
    #[test]
    fn a_view_is_refused_where_the_error_of_its_direction_moves_the_image() {
        for window in [[1.0, 1.0], [1.0, 40.0], [40.0, 1.0]] {
            let pose = Pose::look_at(DVec3::ZERO, DVec3::new(0.6, 0.5, 0.3), DVec3::Z);
            let window = Window::centered(window[0], window[1]);
            let view = View::orthographic(pose, window, 0.1, 99.0).unwrap();
            let eye_error = ViewProjection::new(&view, DVec3::ZERO).eye_error();
            // Half of the image is 1 m wide, and the scene 2 sizes along each axis.
            let limit = 1e-8 * 0.999 / (2.0 * 3f64.sqrt() * eye_error);
            let new = |share: f64| {
                ScreenProjection::new(&view, &Scene::new(), &cube((share * limit) as f32), DVec3::ZERO)
            };
            assert!(new(1.01).is_none(), "{limit} m, window {window:?}");
            let error = new(0.99).map(|projection| projection.error());
            assert!(error.is_some_and(|error| error < 0.9e-8), "{error:?} at {limit} m, window {window:?}");
        }
    }

    /// Planes of a tree decide sides by margins for the greatest coordinates that it has held.
    #[test]
    fn a_view_is_refused_for_the_magnitude_of_sides_as_for_the_bounds() {
        for axis in DVec3::AXES {
            let known = |magnitude: DVec3| {
                ScreenProjection::new(&view(DVec3::ZERO), &Scene::new(), &cube(1.0), magnitude).is_some()
            };
            assert_eq!([1e5, 2e5].map(|size| known(axis * size)), [true, false], "along {axis}");
        }
    }

    /// An eye that is off along the view moves what it sees beside the middle, though `x` and `y` do not
    /// change.
    #[test]
    fn a_view_is_refused_whose_eye_is_uncertain_along_the_view() {
        let known = |shear: f64| {
            let w = DVec4::new(1.0, shear, shear, -450.0 * (1.0 + 2.0 * shear));
            let [x, y] = [DVec3::Y, DVec3::Z].map(|axis| axis.extend(-450.0) * 1e-3);
            let rows = DMat4::from_cols(x, y, w - DVec4::W * 0.1, w);
            let view = View::from_clip_from_world(rows.transpose(), Depth::ZeroToOneInfinite).unwrap();
            let projection = ScreenProjection::new(&view, &Scene::new(), &cube(500.0), DVec3::ZERO);
            let error = 6.0 * f64::EPSILON * 5.0 * (1.0 + 2.0 * shear) * 950.0 / 0.0999;
            assert!(error < MAX_NDC_ERROR, "the image alone is known to {error}");
            projection.is_some()
        };
        assert_eq!([0.1, 60.0].map(known), [true, false], "views with shears of 0.1 and 60");
    }

    /// Returns the image of a point, whose coordinates are multiples of 2^-8, and its depth. Sums are exact,
    /// of matrix elements to 2^-60.
    fn exactly(view: &View, p: DVec3) -> ([f64; 2], f64) {
        let (matrix, p) = (view.clip_from(view.origin()), p - view.origin());
        let [x, y, w] = [0, 1, 3].map(|i| {
            let whole = |x: f64, scale: i32| (x * 2f64.powi(scale)) as i128;
            let terms = matrix.row(i).to_array().map(|x| whole(x, 60));
            let point = p.extend(1.0).to_array().map(|x| whole(x, 8));
            terms.iter().zip(point).map(|(a, b)| a * b).sum::<i128>() as f64 * 2f64.powi(-68)
        });
        ([x / w, y / w], w)
    }

    /// Corners at depths far apart, of triangles and of the boxes around their sides.
    #[test]
    fn corners_and_boxes_are_projected_within_their_error() {
        let mut random = Random(17);
        let (mut image, mut rounded, mut least) = (ProjectedPolygon::default(), 0, 0);
        for round in 0..10_000 {
            let eye = random.vector(2e4).round();
            let pose = Pose::look_at(eye, eye + random.direction(), random.direction());
            let view =
                View::perspective_off_center(pose, Window::centered(1.0, 1.0), 0.1, f64::INFINITY).unwrap();
            let projection = ScreenProjection::new(&view, &Scene::new(), &cube(2.2e4), DVec3::ZERO).unwrap();
            let corners = [0, 1, 2].map(|i| {
                let depth = [0.15, 8.0, 500.0][(i + round) % 3];
                let [across, up] = [(); 2].map(|()| depth * random.range(-2.0, 2.0));
                ((eye + pose.forward * depth + pose.right * across + pose.up * up) * 256.0).round() / 256.0
            });
            let exact = corners.map(|p| exactly(&view, p));
            let nearest = exact.iter().fold(f64::INFINITY, |least, (_, w)| least.min(*w));
            if nearest < 0.11 {
                continue;
            }
            assert!(projection.draw(&corners, Extent::Greatest, &mut image), "round {round}: {corners:?}");
            assert!(
                (image.error / projection.error_at(nearest) - 1.0).abs() < 1e-6,
                "error at the least depth"
            );
            for corner in &image.polygon {
                let off = |(p, _): &([f64; 2], f64)| (corner.x - p[0]).abs().max((corner.y - p[1]).abs());
                let off = exact.iter().map(off).fold(f64::INFINITY, f64::min);
                assert!(off <= image.error, "round {round}: {off} of {}", image.error);
                rounded += usize::from(off > 4.0 * f64::EPSILON);
                least += usize::from(off > projection.error_at(500.0));
            }
            let bounds =
                Aabb::new(corners[0].min(corners[1]).as_vec3(), corners[0].max(corners[1]).as_vec3());
            let is_drawn = projection.draw_box(&bounds, &mut image);
            let image_of = bounds.corners().map(|p| exactly(&view, p.as_dvec3()));
            if image_of.iter().any(|(_, w)| *w < 0.11) {
                continue;
            }
            let inside = |p: &[f64; 2]| p.iter().all(|x| x.abs() <= 1.0);
            for (p, _) in image_of.iter().filter(|(p, _)| inside(p)) {
                let (low, high) = (image.polygon[0], image.polygon[2]);
                let holds = low.x <= p[0] && p[0] <= high.x && low.y <= p[1] && p[1] <= high.y;
                assert!(is_drawn && holds, "round {round}: {p:?} in {low:?} to {high:?}");
            }
        }
        assert!(rounded > 5_000 && least > 1_000, "{rounded} corners rounded, {least} more than far ones");
    }

    #[test]
    fn boxes_beside_the_image_are_not_drawn() {
        let projection =
            ScreenProjection::new(&view(DVec3::ZERO), &Scene::new(), &cube(10.0), DVec3::ZERO).unwrap();
        let mut image = ProjectedPolygon::default();
        let square = |y: f32, z: f32| Aabb::from_arrays([1.0, y - 0.1, z - 0.1], [1.0, y + 0.1, z + 0.1]);
        for (y, z, is) in
            [(0.0, 0.0, true), (1.2, 0.0, false), (-1.2, 0.0, false), (0.0, 1.2, false), (0.0, -1.2, false)]
        {
            assert_eq!(projection.draw_box(&square(y, z), &mut image), is, "{y}, {z}");
        }
        // The rectangle is as large as the box.
        assert!(projection.draw_box(&square(0.2, 0.3), &mut image), "in the image");
        let (low, high) = (image.polygon[0], image.polygon[2]);
        for (value, wanted) in [(low.x, -0.3), (high.x, -0.1), (low.y, 0.2), (high.y, 0.4)] {
            assert!((value - wanted).abs() < 1e-7, "{low:?} to {high:?}");
        }
        let narrow = |min: [f32; 3], max| projection.is_narrow(&Aabb::from_arrays(min, max));
        assert_eq!(narrow([1.0, -0.5, 0.0], [1.0, 0.5, 1e-8]), Some(true), "a level needle");
        assert_eq!(narrow([1.0, 0.0, -0.5], [1.0, 1e-8, 0.5]), Some(true), "an upright needle");
        assert_eq!(narrow([1.0, -0.5, 0.0], [1.0, 0.5, 1e-6]), Some(false), "a level strip");
        assert_eq!(narrow([1.0, 0.0, -0.5], [1.0, 1e-6, 0.5]), Some(false), "an upright strip");
        assert_eq!(narrow([0.0; 3], [1.0, 1.0, 1.0]), None, "a box around the eye");
    }

    #[test]
    fn views_whose_near_plane_is_behind_the_eye_or_at_infinity_have_no_least_depth() {
        let view = view(DVec3::ZERO);
        let least = nearest_w(&view).unwrap();
        assert!((least / 0.1 - 0.999).abs() < 1e-9, "{least}");
        // The same matrix under other conventions of depth.
        for depth in [Depth::ZeroToOne, Depth::NegativeOneToOne] {
            let view = View::from_clip_from_world(view.clip_from(DVec3::ZERO), depth).unwrap();
            assert_eq!(nearest_w(&view), None, "{depth:?}");
        }
    }
}
