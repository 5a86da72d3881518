//! One polygon, or two that share an edge, as what boxes are tested against.

use crate::clip_projection::U;
use crate::shadow::{BackPlane, OccluderPolygon};
use core::ops::Range;
use visibility_core::glam::DVec3;
use visibility_core::view::Eye;

/// An edge of a polygon and the plane through it and the eye of the frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Edge {
    pub(super) ends: [DVec3; 2],
    /// A point inside the polygon, by which the inner side of the plane is told.
    pub(super) inner: DVec3,
    normal: DVec3,
    /// The bound on the error of the plane's value at a point `q` from the eye is `slope |q| + least`.
    slope: f64,
    least: f64,
}

/// One polygon, or two that share an edge, and the edges that bound what they hide together.
#[derive(Clone, Debug)]
pub(super) struct Group {
    pub(super) edges: Range<usize>,
    /// Indices into `Groups::faces`: twice the same for a single polygon.
    pub(super) polygons: [usize; 2],
    /// Whether the eye sees the two polygons on opposite sides of the shared edge. If not, one folds over
    /// the other, and they hide nothing together.
    pub(super) joined: bool,
}

/// The plane of a polygon and which side of it the eye of the frame is on.
#[derive(Clone, Copy, Debug)]
pub(super) struct Face {
    /// The back planes for an eye before the front, and for one before the back; the second is used if
    /// `two_sided`.
    front: [BackPlane; 2],
    two_sided: bool,
    /// The one of these for the side that the eye is on.
    pub(super) back: BackPlane,
    /// Whether the eye is surely in front of it, farther than the near plane reaches.
    pub(super) before: bool,
    /// Whether the eye is on the side of the front.
    pub(super) from_front: bool,
}

impl Face {
    pub(super) fn new(occluder_polygon: &OccluderPolygon<'_>) -> Self {
        let front = BackPlane { normal: occluder_polygon.normal, offset: -occluder_polygon.reach[0] };
        let rear = BackPlane { normal: -occluder_polygon.normal, offset: occluder_polygon.reach[1] };
        let two_sided = occluder_polygon.two_sided;
        Self { front: [front, rear], two_sided, back: front, before: false, from_front: true }
    }

    /// Determines which side of the polygon the eye is on. What is within `clear` metres of the eye may be
    /// before the near plane, so the plane must be farther than that.
    pub(super) fn look(&mut self, eye: &Eye, eye_error: f64, clear: f64) {
        // The eye must be before the plane behind the vertices and, so that what it sees of an uneven polygon
        // is one side, before that of the vertices too.
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
            (self.back, self.before, self.from_front) = (*front, before > 0.0, true);
        } else {
            (self.back, self.before, self.from_front) = (*rear, behind > 0.0, false);
        }
    }
}

impl Edge {
    pub(super) fn new(ends: [DVec3; 2], inner: DVec3) -> Self {
        Self { ends, inner, normal: DVec3::ZERO, slope: f64::INFINITY, least: f64::INFINITY }
    }

    /// Takes in the eye: the plane through it and the edge, its normal inwards.
    ///
    /// Its value at a point is a determinant of three differences to the eye, six products of three factors:
    /// rounding adds `8u` of each at most, and an eye that is off by `e` as much as `e` in the place of each
    /// factor. 64 for the one and the other cover both.
    pub(super) fn look(&mut self, eye: &Eye, eye_error: f64) {
        match eye {
            Eye::Point(eye) => {
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
                self.slope = 64.0 * (U + eye_error) * size;
                self.least = 64.0 * U * size * self.ends[0].abs().max_element() + f64::MIN_POSITIVE;
            }
        }
        let inner = self.inner - self.base(eye);
        if self.normal.dot(inner) < 0.0 {
            self.normal = -self.normal;
        }
        // A polygon that itself is not surely on the inner side is seen too much from the edge to be of use.
        if !(self.normal.dot(inner) > self.error(inner.abs().max_element())) {
            self.least = f64::INFINITY;
        }
    }

    /// The point that others are relative to: the eye, or for parallel views an end of the edge.
    fn base(&self, eye: &Eye) -> DVec3 {
        match eye {
            Eye::Point(eye) => *eye,
            Eye::Direction(_) => self.ends[0],
        }
    }

    fn error(&self, size: f64) -> f64 {
        self.slope * size + self.least
    }

    /// Whether a box is surely on the inner side.
    pub(super) fn holds(&self, eye: &Eye, min: DVec3, max: DVec3) -> bool {
        let base = self.base(eye);
        let (low, high) = (min - base, max - base);
        // The corner that is farthest out is told by the signs of the normal.
        let corner = DVec3::select(self.normal.cmpge(DVec3::ZERO), low, high);
        let size = low.abs().max(high.abs()).max_element();
        self.normal.dot(corner) > self.error(size)
    }

    /// By how much the eye is on the inner side of the supporting plane, through the edge and the corner of a
    /// box behind the polygon that a plane turned about the edge meets first; negative beyond it.
    pub(super) fn support(&self, eye: DVec3, min: DVec3, max: DVec3) -> Option<f64> {
        let [a, b] = self.ends;
        let side = b - a;
        let mut at = DVec3::select(self.normal.cmpge(DVec3::ZERO), min, max);
        // Each turn passes at least one corner, so there are seven at most.
        for _ in 0..8 {
            let normal = side.cross(at - a);
            let normal = if normal.dot(self.inner - a) < 0.0 { -normal } else { normal };
            let next = DVec3::select(normal.cmpge(DVec3::ZERO), min, max);
            if next == at || normal.dot(next - a) >= normal.dot(at - a) {
                // The normal is off by a few roundings of its factors, which the eye's distance from the edge
                // makes larger; a corner that was taken for another by rounding is within as much.
                let length = normal.length();
                let distance = normal.dot(eye - a) / length;
                let error = 64.0 * U * side.length() * (at - a).length() / length * (eye - a).length();
                let sure = (distance.abs() - error).max(0.0);
                return sure.is_finite().then_some(if distance < 0.0 { -sure } else { sure });
            }
            at = next;
        }
        None
    }
}
