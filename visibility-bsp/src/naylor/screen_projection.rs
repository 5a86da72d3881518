//! Clipping and projection of the scene's polygons and boxes to NDC.

use super::beams::{ImageCorner, MIN_VISIBLE_WIDTH};
use crate::polygon_cut::cut;
use crate::view_volume::ViewVolume;
use alloc::vec::Vec;
use visibility_core::glam::{DMat4, DVec3, DVec4};
use visibility_core::{
    Aabb, Scene, View,
    geometry::{Plane, Side, SidePlane},
    view::MAX_PLANES,
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
}

/// The projection of points in metres relative to `Scene::origin` to NDC, with bounds on its rounding errors.
#[derive(Clone, Debug)]
pub(super) struct ScreenProjection {
    /// Matrix from points in metres relative to `Scene::origin` to clip space.
    clip: DMat4,
    /// Clipping planes in metres relative to `Scene::origin`, inner side in front: near, far, the view's own
    /// clip planes, and the four sides of an image [`CLIP_WIDTH`] times as wide. Only the first `count` are
    /// valid.
    planes: [SidePlane; MAX_PLANES],
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
    /// Builds the projection for points within `bounds`, in metres relative to `Scene::origin`. `None` if NDC
    /// positions are not known to within [`MAX_NDC_ERROR`], because the coordinates are too large or the near
    /// plane too close, or if `bounds` is infinite.
    pub(super) fn new(view: &View, scene: &Scene, bounds: &Aabb) -> Option<Self> {
        // With `u = 2^-53`: clip-space `x`, `y` and `w` are sums of four products, each sum rounded by at
        // most `5 u` times the sum `m` of the products' magnitudes. The matrix is rounded once, and a vertex
        // made by a cut by another `6 u` of its magnitude. The total is `12 u m`. So `x / w` has an absolute
        // error of at most `12 u m (1 + |x / w|) / w`.
        let origin = scene.origin();
        let clip = view.clip_from(origin);
        let magnitude = bounds.min.abs().max(bounds.max.abs()).as_dvec3();
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
            planes: [SidePlane { plane: Plane::new(DVec3::ZERO, 1.0), margin: 0.0 }; MAX_PLANES],
            count: 0,
            volume: ViewVolume::new(view, scene),
            least_w,
            error,
        };
        // The view's first four planes are the sides of the image; wider ones replace them.
        for plane in view.planes(origin).as_slice().iter().skip(4) {
            let side = SidePlane::new(plane.plane, magnitude);
            projection.push(SidePlane { margin: side.margin + plane.error, ..side });
        }
        for row in [w * CLIP_WIDTH + x, w * CLIP_WIDTH - x, w * CLIP_WIDTH + y, w * CLIP_WIDTH - y] {
            let plane = Plane::new(row.truncate(), row.w).normalized()?;
            projection.push(SidePlane::new(plane, magnitude));
        }
        (projection.error_at(least_w) <= MAX_NDC_ERROR).then_some(projection)
    }

    /// Appends a clipping plane. Does nothing if the array is full, so polygons are then clipped less.
    fn push(&mut self, plane: SidePlane) {
        if self.count < MAX_PLANES {
            self.planes[self.count] = plane;
            self.count += 1;
        }
    }

    /// Returns a bound on the absolute NDC error of points in the image widened by [`CLIP_WIDTH`] whose
    /// clip-space w coordinate is at least the argument.
    fn error_at(&self, w: f64) -> f64 {
        (self.error * (1.0 + CLIP_WIDTH) / w).max(4.0 * f64::EPSILON)
    }

    /// Returns a bound on the absolute error of any projected point, in NDC.
    pub(super) fn error(&self) -> f64 {
        self.error_at(self.least_w)
    }

    /// Clips a convex polygon in metres relative to `Scene::origin` to the planes and replaces `image` by its
    /// projection in NDC. Returns false if fewer than three corners are left.
    pub(super) fn draw(&self, vertices: &[DVec3], image: &mut ProjectedPolygon) -> bool {
        let [polygon, inner, outer] = &mut image.space;
        polygon.clear();
        polygon.extend_from_slice(vertices);
        // Clipped to the view before the projection, so that every corner is beyond the near plane.
        for plane in &self.planes[..self.count] {
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
            cut(polygon, plane, inner, outer);
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
