//! The planes that bound a view, extracted from its clip matrix (Gribb and Hartmann, "Fast Extraction of
//! Viewing Frustum Planes from the World-View-Projection Matrix", 2001).

use super::limits::{MAX_CLIP_PLANES, MAX_PLANES};
use super::{View, ViewError};
use crate::geometry::Plane;
use glam::{DVec3, DVec4};

/// One plane of a view, and how far rounding may have moved it.
///
/// ```
/// use visibility_core::{glam::DVec3, Pose, View};
/// let view = View::perspective(Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z), 1.0, 1.0, 0.5, 9.0)?;
/// let near = view.planes(DVec3::ZERO).as_slice()[4];
/// assert!((near.plane.signed_distance(DVec3::new(2.0, 0.0, 0.0)) - 1.5).abs() <= near.error + 1e-15);
/// # Ok::<(), visibility_core::view::ViewError>(())
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct ViewPlane {
    /// Unit normal, pointing into the view. Each component is within `8 * f64::EPSILON` of its own size.
    pub plane: Plane,
    /// Bound on the error of the plane's offset, in metres.
    pub error: f64,
}

/// The planes of a view: left, right, bottom, top, near, far, less those that do not exist (an infinite far
/// plane), then its own [clip planes](View::with_clip_planes).
///
/// ```
/// use visibility_core::{glam::DVec3, Pose, View};
/// let view = View::perspective(Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z), 1.0, 1.0, 0.1,
///     f64::INFINITY)?;
/// assert_eq!(view.planes(DVec3::ZERO).as_slice().len(), 5);
/// # Ok::<(), visibility_core::view::ViewError>(())
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct ViewPlanes {
    planes: [ViewPlane; MAX_PLANES],
    /// Which plane each is: 0 to 5 for left to far, above for the view's own. Of the first six, `slot ^ 1`
    /// is opposite.
    slots: [u8; MAX_PLANES],
    count: usize,
}

impl ViewPlanes {
    /// No plane, so that every point is inside.
    pub const NONE: Self = Self {
        planes: [ViewPlane { plane: Plane::new(DVec3::ZERO, 1.0), error: 0.0 }; MAX_PLANES],
        slots: [0; MAX_PLANES],
        count: 0,
    };

    /// The planes.
    pub fn as_slice(&self) -> &[ViewPlane] {
        &self.planes[..self.count]
    }

    /// Returns whether a point, relative to the origin that the planes were made for, certainly lies on the
    /// inner side of every plane. False for a point on a plane, where rounding cannot decide, and for NaN.
    pub fn contain(&self, p: DVec3) -> bool {
        self.as_slice().iter().all(|ViewPlane { plane, error }| {
            // 6u of the magnitudes for the arithmetic, 16u for the normal's own rounding.
            plane.signed_distance(p) > 4.0 * plane.error_bound(p.abs()) + error
        })
    }

    /// The planes, each with its slot.
    pub(crate) fn with_slots(&self) -> impl Iterator<Item = (u8, &ViewPlane)> {
        self.slots.iter().copied().zip(self.as_slice())
    }

    /// Adds the half-space `normal . p + offset >= 0` of points relative to the view's own origin, for points
    /// that are shifted by `shift` from there. A plane with no direction, or beyond the reach of `f64`,
    /// bounds nothing and is left out, which can only show more.
    fn push(&mut self, slot: u8, plane: Plane, shift: DVec3) {
        // Scaled before anything is multiplied: the elements of a matrix may be so small that products with
        // them are not.
        let scale = plane.normal.abs().max_element();
        let (n, offset) = (plane.normal / scale, plane.offset / scale);
        let moved = Plane::new(n, n.x * shift.x + n.y * shift.y + n.z * shift.z + offset);
        let Some(unit) = moved.normalized() else { return };
        // The shift itself is rounded once, and so are normal and offset by scaling, then each product and
        // partial sum once more, as in `Plane::error_bound`, then all by the length: 8u of the sum of
        // magnitudes covers it.
        let size = n.abs().dot(shift.abs()) + offset.abs();
        let error = 4.0 * f64::EPSILON * size / n.length() + f64::MIN_POSITIVE;
        if error.is_finite() && self.count < MAX_PLANES {
            self.planes[self.count] = ViewPlane { plane: unit, error };
            self.slots[self.count] = slot;
            self.count += 1;
        }
    }
}

impl View {
    /// The same view, showing only what is on the inner side, `normal . p + offset >= 0`, of some more
    /// planes: a mirror's, those of a portal, a section through a model. They take the place of those
    /// that it had; an empty slice takes them away.
    ///
    /// Points are relative to the view's [origin](Self::origin), in metres, as for the clip matrix; normals
    /// may have any length. [`relative_to`](Self::relative_to) moves planes and matrix alike, so call it
    /// first or mean it. (A view made from a [`Pose`](crate::Pose) has its origin in the eye.)
    ///
    /// Whoever asks for [`planes`](Self::planes) honours them: the [`FrustumCuller`](crate::FrustumCuller)
    /// and the [`CasterCuller`](crate::casters::CasterCuller); so does the item buffer of
    /// `visibility-measure`.
    /// They are no part of the clip matrix: an occlusion map that draws by the matrix alone may keep
    /// objects beyond them, and must not be given occluders that they cut away.
    ///
    /// # Errors
    /// [`ViewError::TooManyClipPlanes`] beyond [`MAX_CLIP_PLANES`]; [`ViewError::ClipPlane`] for one that is
    /// not finite or has no direction.
    ///
    /// ```
    /// use visibility_core::{geometry::Plane, glam::DVec3, Pose, View};
    /// let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    /// let view = View::perspective(pose, 1.0, 1.5, 0.1, f64::INFINITY)?;
    /// // Only what is at least 4 m ahead: behind a mirror, say.
    /// let behind = view.with_clip_planes(&[Plane::through(DVec3::new(4.0, 0.0, 0.0), DVec3::X)])?;
    /// assert_eq!(behind.planes(DVec3::ZERO).as_slice().len(), 6);
    /// # Ok::<(), visibility_core::view::ViewError>(())
    /// ```
    pub fn with_clip_planes(self, planes: &[Plane]) -> Result<Self, ViewError> {
        if planes.len() > MAX_CLIP_PLANES {
            return Err(ViewError::TooManyClipPlanes { count: planes.len() });
        }
        let is_usable = |plane: &Plane| {
            plane.normal.is_finite() && plane.offset.is_finite() && plane.normal != DVec3::ZERO
        };
        if let Some(index) = planes.iter().position(|plane| !is_usable(plane)) {
            return Err(ViewError::ClipPlane { index });
        }
        let mut clip_planes = [Plane::new(DVec3::ZERO, 0.0); MAX_CLIP_PLANES];
        clip_planes[..planes.len()].copy_from_slice(planes);
        Ok(Self { clip_planes, clip_count: planes.len(), ..self })
    }

    /// The planes that were added to those of the clip matrix, relative to the view's origin.
    pub fn clip_planes(&self) -> &[Plane] {
        &self.clip_planes[..self.clip_count]
    }

    /// Returns the unit planes of [`clip_planes`](Self::clip_planes) alone, for points relative to `origin`,
    /// with the bounds on their rounding.
    pub fn clip_planes_from(&self, origin: DVec3) -> ViewPlanes {
        let mut planes = ViewPlanes::NONE;
        for (slot, &plane) in (0..).zip(self.clip_planes()) {
            planes.push(slot, plane, origin - self.origin);
        }
        planes
    }

    /// The near plane, for points relative to `origin`, if the matrix has one.
    pub(crate) fn near_plane(&self, origin: DVec3) -> Option<ViewPlane> {
        let mut planes = ViewPlanes::NONE;
        let near = self.depth_rows().0;
        planes.push(0, Plane::new(near.truncate(), near.w), origin - self.origin);
        planes.as_slice().first().copied()
    }

    /// The near and, if there is one, the far plane, as rows that give what is in view a positive product.
    fn depth_rows(&self) -> (DVec4, Option<DVec4>) {
        self.depth.rows(self.clip_from_local.row(2), self.clip_from_local.row(3))
    }

    /// The planes that bound the view, for points relative to `origin`.
    pub fn planes(&self, origin: DVec3) -> ViewPlanes {
        let m = &self.clip_from_local;
        let [x, y, w] = [m.row(0), m.row(1), m.row(3)];
        let (near, far) = self.depth_rows();
        let shift = origin - self.origin;
        let mut planes = ViewPlanes::NONE;
        // An infinite far plane is left out on the caller's word: what rounding leaves of it in the matrix
        // would be a plane at a random angle.
        for (slot, row) in (0..).zip([w + x, w - x, w + y, w - y, near].into_iter().chain(far)) {
            planes.push(slot, Plane::new(row.truncate(), row.w), shift);
        }
        for (slot, &plane) in (6..).zip(self.clip_planes()) {
            planes.push(slot, plane, shift);
        }
        planes
    }
}
