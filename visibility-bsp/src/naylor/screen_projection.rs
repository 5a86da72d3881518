//! From polygons and boxes of the scene to polygons of the picture.

use super::beams::{Corner, NARROWEST};
use crate::polygon_cut::cut;
use crate::view_volume::ViewVolume;
use alloc::vec::Vec;
use visibility_core::glam::{DMat4, DVec3, DVec4};
use visibility_core::{
    Aabb, Scene, View,
    geometry::{Plane, Side, SidePlane},
    view::MAX_PLANES,
};

/// A polygon in the picture, with scratch memory for clipping it.
#[derive(Clone, Debug, Default)]
pub(super) struct ProjectedPolygon {
    space: [Vec<DVec3>; 3],
    polygon: Vec<Corner>,
    error: f64,
}

impl ProjectedPolygon {
    /// Bound on the error of its corners, in halves of the picture.
    pub(super) fn error(&self) -> f64 {
        self.error
    }

    /// Corners of the polygon projected last, counter-clockwise.
    pub(super) fn polygon(&self) -> &[Corner] {
        &self.polygon
    }
}

/// The projection of scene coordinates to the picture, with bounds on its rounding.
#[derive(Clone, Debug)]
pub(super) struct ScreenProjection {
    clip: DMat4,
    /// Near, far, those of the view's own, and the sides of a wider picture.
    planes: [SidePlane; MAX_PLANES],
    count: usize,
    volume: ViewVolume,
    /// Lower bound on `w` in view.
    least_w: f64,
    /// Bound on the error of clip-space `x`, `y` and `w`.
    error: f64,
}

/// Maximum error of a point of the picture; a view with more is not culled.
const WORST: f64 = 1e-8;

/// How many times as wide as the picture polygons are cut in space. What is left is cut in the picture, where
/// an edge keeps its line.
const WIDER: f64 = 4.0;

impl ScreenProjection {
    /// `None` where the coordinates of the scene are so large, or its near plane so near, that rounding blurs
    /// the picture.
    ///
    /// `x`, `y` and `w` are sums of four products, rounded by at most `5 u` of the sum of magnitudes `m`; the
    /// matrix is rounded once, and the vertex itself, if it was cut, by another `6 u` of its magnitude: `12 u
    /// m` in all. `x / w` is then known up to `12 u m (1 + |x / w|) / w`.
    pub(super) fn new(view: &View, scene: &Scene, bounds: &Aabb) -> Option<Self> {
        let origin = scene.origin();
        let clip = view.clip_from(origin);
        let reach = bounds.min.abs().max(bounds.max.abs()).as_dvec3();
        // Rounded outwards, the largest numbers are infinite, and nothing that is computed from them tells
        // so.
        if !reach.is_finite() {
            return None;
        }
        let [x, y, w] = [clip.row(0), clip.row(1), clip.row(3)];
        let size = |row: DVec4| row.truncate().abs().dot(reach) + row.w.abs();
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
        // The first four are the sides of the picture.
        for plane in view.planes(origin).as_slice().iter().skip(4) {
            let side = SidePlane::new(plane.plane, reach);
            projection.push(SidePlane { margin: side.margin + plane.error, ..side });
        }
        for row in [w * WIDER + x, w * WIDER - x, w * WIDER + y, w * WIDER - y] {
            let plane = Plane::new(row.truncate(), row.w).normalized()?;
            projection.push(SidePlane::new(plane, reach));
        }
        (projection.error_at(least_w) <= WORST).then_some(projection)
    }

    fn push(&mut self, plane: SidePlane) {
        if self.count < MAX_PLANES {
            self.planes[self.count] = plane;
            self.count += 1;
        }
    }

    /// Bound on the error of points of the wider picture whose `w` is at least this.
    fn error_at(&self, w: f64) -> f64 {
        (self.error * (1.0 + WIDER) / w).max(4.0 * f64::EPSILON)
    }

    /// Bound on the error of points of the picture, in halves of it.
    pub(super) fn error(&self) -> f64 {
        self.error_at(self.least_w)
    }

    /// Clips a polygon to the view and projects it. False if nothing is left.
    pub(super) fn draw(&self, vertices: &[DVec3], image: &mut ProjectedPolygon) -> bool {
        let [polygon, inner, outer] = &mut image.space;
        polygon.clear();
        polygon.extend_from_slice(vertices);
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
        let mut nearest = f64::INFINITY;
        for v in polygon.iter() {
            let q = self.clip * v.extend(1.0);
            let w = q.w.max(self.least_w);
            nearest = nearest.min(w);
            image.polygon.push(Corner::new(q.x / w, q.y / w));
        }
        image.error = self.error_at(nearest);
        if area(&image.polygon) < 0.0 {
            image.polygon.reverse();
        }
        image.polygon.len() >= 3
    }

    /// Whether all of a box is before the near plane and no wider in the picture, in some direction, than
    /// gaps that are not seen through; `None` where it reaches behind the near plane.
    pub(super) fn is_narrow(&self, bounds: &Aabb) -> Option<bool> {
        let mut corners = [[0.0; 2]; 8];
        for (place, corner) in corners.iter_mut().zip(bounds.corners()) {
            let q = self.clip * corner.as_dvec3().extend(1.0);
            if !(q.w >= self.least_w) {
                return None;
            }
            *place = [q.x / q.w, q.y / q.w];
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
        // Distances from the longest line through it, times its length.
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        let off = |p: &[f64; 2]| (dx * (p[1] - a[1]) - dy * (p[0] - a[0])).abs();
        Some(corners.iter().all(|p| off(p) <= 2.0 * NARROWEST * length))
    }

    /// Projects a box to a rectangle around it. False if the box is outside the view.
    pub(super) fn draw_box(&self, bounds: &Aabb, image: &mut ProjectedPolygon) -> bool {
        let (mut min, mut max) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for corner in bounds.corners() {
            let q = self.clip * corner.as_dvec3().extend(1.0);
            if q.w < self.least_w {
                if self.volume.is_outside(bounds) {
                    return false;
                }
                // Beside the eye it may be anywhere.
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
        image
            .polygon
            .extend([(left, low), (right, low), (right, high), (left, high)].map(|(x, y)| Corner::new(x, y)));
        left <= right && low <= high
    }
}

/// A lower bound on `w` in view, `None` if there is no positive one.
fn nearest_w(view: &View) -> Option<f64> {
    let clip = view.clip_from(view.origin());
    // Along the near plane w is constant for every camera by the book; an oblique one may have less at a
    // corner of the picture.
    let inverse = clip.inverse();
    let near = view.depth().at_near();
    let mut least = f64::INFINITY;
    for (x, y) in [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)] {
        // A point of the picture comes from a point p with clip * p = w (x, y, near, 1).
        let p = inverse * DVec4::new(x, y, near, 1.0);
        least = least.min(1.0 / p.w);
    }
    (least > 0.0 && least.is_finite()).then_some(least * 0.999)
}

fn area(polygon: &[Corner]) -> f64 {
    let first = polygon[0];
    polygon
        .windows(2)
        .map(|p| (p[0].x - first.x) * (p[1].y - first.y) - (p[0].y - first.y) * (p[1].x - first.x))
        .sum()
}
