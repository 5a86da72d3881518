//! The unit that boxes are tested against: one polygon, or two that share an edge.

use crate::clip_projection::{ClipProjection, U};
use crate::shadow::{BackPlane, OccluderPolygon};
use core::ops::Range;
use visibility_core::glam::DVec3;
use visibility_core::view::Eye;

/// An edge of a polygon and the plane through this edge and the eye of the frame. The inner side of the plane
/// is the side that its normal points to, on which the polygon lies.
#[derive(Clone, Copy, Debug)]
pub(super) struct Edge {
    /// Ends of the edge, in metres relative to `Scene::origin`.
    pub(super) ends: [DVec3; 2],
    /// A point inside the polygon, in metres relative to `Scene::origin`. The plane's normal points to the
    /// side of this point.
    pub(super) inner: DVec3,
    /// Bound on the error of each coordinate of `ends`, in metres.
    pub(super) placing_error: f64,
    /// Normal of the plane, not normalized, pointing to the side of `inner`. The plane passes through
    /// [`base`](Self::base).
    normal: DVec3,
    /// Linear term of the bound `slope * s + least` on the absolute error of `normal . q`, for a point `q` in
    /// metres relative to [`base`](Self::base), with no coordinate above `s` in magnitude. Infinite before
    /// the first call of [`update_eye`](Self::update_eye).
    slope: f64,
    /// Constant term of the error bound; see `slope`. Infinite before the first call of
    /// [`update_eye`](Self::update_eye), and if the eye sees the edge's polygon edge on.
    least: f64,
}

/// One polygon, or two that share an edge, and the edges that bound the shadow that they cast together.
#[derive(Clone, Debug)]
pub(super) struct Group {
    /// Edges that bound the group's shadow, a range of `Groups::edges`; an edge shared by the two polygons
    /// is not among them.
    pub(super) edges: Range<usize>,
    /// Indices in `Groups::faces` of the two polygons; both are the same for a single polygon.
    pub(super) polygons: [usize; 2],
    /// Whether the group's shadow may be used in this frame. True for a single polygon, and for two polygons
    /// that the eye sees on opposite sides of the shared edge. False for two polygons that fold over each
    /// other as seen from the eye, and for any group that the near plane of a parallel view may cut.
    pub(super) usable: bool,
}

/// The plane of a polygon and the side of it that the eye of the frame is on.
#[derive(Clone, Copy, Debug)]
pub(super) struct Face {
    /// Back planes (just behind all vertices of the polygon, as seen from the eye) for an eye in front of
    /// the polygon and for one behind it. The second is used only if `two_sided`.
    front: [BackPlane; 2],
    /// Whether the polygon also hides for eyes behind its front; if false, only for eyes in front.
    two_sided: bool,
    /// Back plane for the side of the polygon that the eye is on; a copy of one entry of `front`.
    pub(super) back: BackPlane,
    /// Whether the polygon may hide boxes: the eye is surely on the side that `back` is for, and farther from
    /// the polygon's plane than the near plane reaches in the image.
    pub(super) usable: bool,
    /// Whether `back` is the entry for an eye in front of the polygon (false: behind).
    pub(super) from_front: bool,
}

impl Face {
    /// Creates the planes of a polygon. The eye's side is unknown (`usable` is false) until
    /// [`update_eye`](Self::update_eye) is called.
    pub(super) fn new(occluder_polygon: &OccluderPolygon<'_>) -> Self {
        let front =
            BackPlane { normal: occluder_polygon.normal, offset: -occluder_polygon.extent_along_normal[0] };
        let rear =
            BackPlane { normal: -occluder_polygon.normal, offset: occluder_polygon.extent_along_normal[1] };
        let two_sided = occluder_polygon.two_sided;
        Self { front: [front, rear], two_sided, back: front, usable: false, from_front: true }
    }

    /// Determines the side of the polygon that the eye is on and updates `back`, `usable` and `from_front`.
    /// `eye_error` bounds the eye's error in metres. If the plane is closer to the eye than `clear` metres,
    /// the near plane may cut the polygon, and `usable` becomes false.
    pub(super) fn update_eye(&mut self, eye: &Eye, eye_error: f64, clear: f64) {
        // The eye must be in front of the back plane. It must also be in front of all vertices, so that it
        // sees an uneven polygon from one side.
        let height = |near: &BackPlane, far: &BackPlane| match eye {
            Eye::Point(eye) => {
                let size = near.normal.abs().dot(eye.abs()) + near.offset.abs() + far.offset.abs();
                let before = near.normal.dot(*eye) + near.offset.min(-far.offset);
                let error = 16.0 * U * size + 2.0 * eye_error;
                before - clear - error
            }
            Eye::Direction(along) => -near.normal.dot(*along) - 16.0 * U - 2.0 * eye_error,
        };
        let [front, rear] = &self.front;
        let (before, behind) = (height(front, rear), height(rear, front));
        if before > 0.0 || !self.two_sided || before >= behind {
            (self.back, self.usable, self.from_front) = (*front, before > 0.0, true);
        } else {
            (self.back, self.usable, self.from_front) = (*rear, behind > 0.0, false);
        }
    }

    /// Returns [`ClipProjection::near_unevenness`] of the polygon, seen from the side of `back`.
    pub(super) fn near_unevenness(&self, projection: &ClipProjection) -> f64 {
        let before = self.front[usize::from(self.from_front)];
        projection.near_unevenness(self.back.normal, -before.offset, self.back.offset)
    }
}

impl Edge {
    /// Creates an edge between two points in metres relative to `Scene::origin`, each coordinate of which may
    /// be off by `placing_error` metres, with the polygon's inside on the side of `inner`. No box is inside
    /// its plane until [`update_eye`](Self::update_eye) is called.
    pub(super) fn new(ends: [DVec3; 2], inner: DVec3, placing_error: f64) -> Self {
        let (slope, least) = (f64::INFINITY, f64::INFINITY);
        Self { ends, inner, placing_error, normal: DVec3::ZERO, slope, least }
    }

    /// Computes the plane through the eye and the edge, its normal to the side of `inner`. `eye_error` bounds
    /// the eye's error: in metres for a point, as the length of the difference for a unit direction.
    pub(super) fn update_eye(&mut self, eye: &Eye, eye_error: f64) {
        // The plane's value at a point is a determinant of three differences to the eye: six products of
        // three factors. Rounding adds at most `8u` of each product, and an eye that is off by `e` adds at
        // most `e` in place of each factor, as ends do that are off by `e`. The factors of 64 cover both.
        match eye {
            Eye::Point(eye) => {
                let eye_error = eye_error + self.placing_error;
                let (a, b) = (self.ends[0] - *eye, self.ends[1] - *eye);
                let (size_a, size_b) = (a.abs().max_element(), b.abs().max_element());
                self.normal = a.cross(b);
                self.slope = 64.0 * (U * size_a * size_b + eye_error * (size_a + size_b));
                self.least = 64.0 * eye_error * size_a * size_b + f64::MIN_POSITIVE;
            }
            Eye::Direction(along) => {
                let side = self.ends[1] - self.ends[0];
                let size = side.abs().max_element();
                self.normal = along.cross(side);
                self.slope = 64.0 * ((U + eye_error) * size + self.placing_error);
                self.least = 64.0 * (U * self.ends[0].abs().max_element() + self.placing_error) * size
                    + f64::MIN_POSITIVE;
            }
        }
        let inner = self.inner - self.base(eye);
        if self.normal.dot(inner) < 0.0 {
            self.normal = -self.normal;
        }
        // An inner point that is not surely on the inner side means that the polygon is seen edge on. The
        // plane is then made unusable.
        if !(self.normal.dot(inner) > self.error(inner.abs().max_element())) {
            self.least = f64::INFINITY;
        }
    }

    /// Returns the origin of the points that `normal` is applied to: the eye, or for parallel views the first
    /// end of the edge.
    fn base(&self, eye: &Eye) -> DVec3 {
        match eye {
            Eye::Point(eye) => *eye,
            Eye::Direction(_) => self.ends[0],
        }
    }

    /// Returns the bound on the absolute error of `normal . q`, for a point `q` in metres relative to the
    /// base, none of whose coordinates exceeds `size` in magnitude.
    fn error(&self, size: f64) -> f64 {
        self.slope * size + self.least
    }

    /// Tests whether a box (`min` to `max` in metres relative to `Scene::origin`) is surely on the inner side
    /// of the plane through the eye and this edge. `eye` must be the eye passed to
    /// [`update_eye`](Self::update_eye). False if undecided or NaN.
    pub(super) fn holds(&self, eye: &Eye, min: DVec3, max: DVec3) -> bool {
        let base = self.base(eye);
        let (low, high) = (min - base, max - base);
        // The outermost corner follows from the signs of the normal.
        let corner = DVec3::select(self.normal.cmpge(DVec3::ZERO), low, high);
        let size = low.abs().max(high.abs()).max_element();
        self.normal.dot(corner) > self.error(size)
    }

    /// Returns the signed distance in metres of the eye from the supporting plane of a box behind the
    /// polygon. This is the plane through the edge that touches the box and has all of the box on its inner
    /// side, the side on which the polygon lies. The distance is positive if the eye is on the inner side
    /// too. Its magnitude is reduced by a bound on the rounding error, to no less than 0. The box is from
    /// `min` to `max`; box and eye are in metres relative to `Scene::origin`. `None` if the supporting plane
    /// is not found or the distance is not finite.
    pub(super) fn support(&self, eye: DVec3, min: DVec3, max: DVec3) -> Option<f64> {
        let [a, b] = self.ends;
        let side = b - a;
        let mut at = DVec3::select(self.normal.cmpge(DVec3::ZERO), min, max);
        // Each turn passes at least one corner, so at most seven turns are needed.
        for _ in 0..8 {
            let normal = side.cross(at - a);
            let normal = if normal.dot(self.inner - a) < 0.0 { -normal } else { normal };
            let next = DVec3::select(normal.cmpge(DVec3::ZERO), min, max);
            if next == at || normal.dot(next - a) >= normal.dot(at - a) {
                // The normal is off by a few roundings of its factors, which the eye's distance from the edge
                // multiplies. A corner that rounding mistakes for another is within the same bound.
                let length = normal.length();
                let distance = normal.dot(eye - a) / length;
                let (along, across) = (side.length(), (at - a).length());
                let error = U * along * across + self.placing_error * (along + across);
                let error = 64.0 * error / length * (eye - a).length() + 2.0 * self.placing_error;
                let sure = (distance.abs() - error).max(0.0);
                return sure.is_finite().then_some(if distance < 0.0 { -sure } else { sure });
            }
            at = next;
        }
        None
    }
}
