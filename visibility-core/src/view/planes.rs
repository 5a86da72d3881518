//! The planes that bound a view, extracted from its clip matrix (Gribb and Hartmann, "Fast Extraction of
//! Viewing Frustum Planes from the World-View-Projection Matrix", 2001).

use super::limits::{MAX_CLIP_PLANES, MAX_PLANES};
use super::{View, ViewError};
use crate::Aabb;
use crate::geometry::Plane;
use glam::DVec3;

/// One plane of a view, for points in metres relative to the origin passed to [`View::planes`], with a bound
/// on its rounding error.
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
    /// The plane, with a unit normal that points into the view. Each component of the normal has a relative
    /// error of at most `2 * f64::EPSILON` beside a factor that is common to all, and with that factor of at
    /// most `8 * f64::EPSILON`.
    pub plane: Plane,
    /// Bound on the absolute error of the plane's offset, in metres.
    pub error: f64,
}

impl ViewPlane {
    /// Returns whether a point is certainly strictly inside: see [`ViewPlanes::contains`]. `magnitude` bounds
    /// its absolute coordinates.
    fn contains(&self, p: DVec3, magnitude: DVec3) -> bool {
        // 6u of the magnitudes for the arithmetic, 16u for the normal's own rounding.
        self.plane.signed_distance(p) > 4.0 * self.plane.error_bound(magnitude) + self.error
    }

    /// Returns whether all points of a box are certainly strictly inside. False for an inverted box, and for
    /// NaN.
    pub(crate) fn contains_box(&self, bounds: &Aabb) -> bool {
        let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let nearest = DVec3::select(self.plane.normal.cmpge(DVec3::ZERO), min, max);
        bounds.is_proper() && self.contains(nearest, min.abs().max(max.abs()))
    }
}

/// The planes of a view, for points in metres relative to the origin passed to [`View::planes`], with normals
/// that point into the view. The order is left, right, bottom, top, near, far, followed by the view's [clip
/// planes](View::with_clip_planes). An infinite far plane is left out, and so is any plane that `f64` cannot
/// represent.
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
    /// For each plane, its slot: 0 to 5 for left, right, bottom, top, near and far; 6 and up for clip planes
    /// in their order. In slots 0 to 5, `slot ^ 1` is the opposite plane.
    slots: [u8; MAX_PLANES],
    count: usize,
}

impl ViewPlanes {
    /// Slot of the near plane.
    pub const NEAR: u8 = 4;
    /// Slot of the far plane.
    pub const FAR: u8 = 5;

    /// An empty list of planes: every point is inside.
    pub const NONE: Self = Self {
        planes: [ViewPlane { plane: Plane::new(DVec3::ZERO, 1.0), error: 0.0 }; MAX_PLANES],
        slots: [0; MAX_PLANES],
        count: 0,
    };

    /// Returns the planes in the order that [`ViewPlanes`] states.
    pub fn as_slice(&self) -> &[ViewPlane] {
        &self.planes[..self.count]
    }

    /// Returns whether a point, in metres relative to the origin that the planes were made for, is certainly
    /// strictly inside every plane. False for a point on a plane, where rounding leaves the side undecided,
    /// and for NaN. True without planes.
    pub fn contains(&self, p: DVec3) -> bool {
        self.as_slice().iter().all(|plane| plane.contains(p, p.abs()))
    }

    /// Iterates over the planes, each with its slot: 0 to 5 for left, right, bottom, top, near and far; 6 and
    /// up for clip planes.
    pub fn by_slot(&self) -> impl Iterator<Item = (u8, &ViewPlane)> {
        self.slots.iter().copied().zip(self.as_slice())
    }

    /// Returns the plane in a slot, numbered as in [`by_slot`](Self::by_slot). `None` if that plane was left
    /// out, or if there are fewer clip planes.
    pub fn in_slot(&self, slot: u8) -> Option<&ViewPlane> {
        self.by_slot().find(|&(other, _)| other == slot).map(|(_, plane)| plane)
    }

    /// Appends `plane` in slot `slot`, translated to another origin and scaled to a unit normal. `plane` is
    /// for points in metres relative to the view's own origin. The appended plane is for points relative to
    /// the view's origin moved by `shift` metres. A plane with a zero normal, or outside the range of `f64`,
    /// is left out, which only enlarges the view.
    fn push(&mut self, slot: u8, plane: Plane, shift: DVec3) {
        // Scaled before anything is multiplied, because products with very small matrix elements would
        // underflow.
        let scale = plane.normal.abs().max_element();
        let (n, offset) = (plane.normal / scale, plane.offset / scale);
        let moved = Plane::new(n, n.x * shift.x + n.y * shift.y + n.z * shift.z + offset);
        // The components of the normal are rounded by the sum of two rows, by the scale and by the division
        // by the length, whose error they share.
        let Some(unit) = moved.normalized() else { return };
        // The shift is rounded once, and so are normal and offset by scaling. Then each product and partial
        // sum rounds once more, as in `Plane::error_bound`, and the division by the length rounds all: 8u of
        // the sum of magnitudes. Another 2u covers products of roundings and the rounding of that sum.
        let size = n.abs().dot(shift.abs()) + offset.abs();
        let error = 5.0 * f64::EPSILON * size / n.length() + f64::MIN_POSITIVE;
        if error.is_finite() && self.count < MAX_PLANES {
            self.planes[self.count] = ViewPlane { plane: unit, error };
            self.slots[self.count] = slot;
            self.count += 1;
        }
    }
}

impl View {
    /// Returns this view further restricted to the inner side, `normal . p + offset >= 0`, of the given
    /// planes, such as the plane of a mirror, the sides of a portal, or a section through a model. They
    /// replace the view's former clip planes; an empty slice removes these.
    ///
    /// Planes are relative to the view's [origin](Self::origin), in metres, as the clip matrix is; normals
    /// may have any length. [`relative_to`](Self::relative_to) moves planes and matrix together, so it should
    /// be called before. (A view made from a [`Pose`](crate::Pose) has its origin in the eye.)
    ///
    /// Cullers that use [`planes`](Self::planes) respect clip planes: the
    /// [`FrustumCuller`](crate::FrustumCuller), the `CasterCuller` of `visibility-frame`, and the
    /// item buffer of `visibility-measure`. Clip planes are not part of the clip matrix. An occlusion map
    /// that uses only the matrix may keep objects beyond the planes, and must not be given occluders that
    /// the planes cut away.
    ///
    /// # Errors
    /// [`ViewError::TooManyClipPlanes`] for more than [`MAX_CLIP_PLANES`]; [`ViewError::ClipPlane`] for a
    /// plane that is not finite or has a zero normal.
    ///
    /// ```
    /// use visibility_core::{geometry::Plane, glam::DVec3, Pose, View};
    /// let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    /// let view = View::perspective(pose, 1.0, 1.5, 0.1, f64::INFINITY)?;
    /// // Only objects at least 4 m ahead, as for a view through a mirror at that distance.
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

    /// Returns the view's clip planes, which restrict it beyond its clip matrix, relative to the view's
    /// [origin](Self::origin). Empty by default.
    pub fn clip_planes(&self) -> &[Plane] {
        &self.clip_planes[..self.clip_count]
    }

    /// Returns the [`clip_planes`](Self::clip_planes) alone, without the planes of the clip matrix, for
    /// points relative to `origin`, a point of the world. Normals have unit length, and each plane has
    /// its error bound.
    pub fn clip_planes_from(&self, origin: DVec3) -> ViewPlanes {
        let mut planes = ViewPlanes::NONE;
        for (slot, &plane) in (0..).zip(self.clip_planes()) {
            planes.push(slot, plane, origin - self.origin);
        }
        planes
    }

    /// Returns the near plane for points relative to `origin`, a point of the world. `None` if `f64` cannot
    /// represent the plane.
    pub(crate) fn near_plane(&self, origin: DVec3) -> Option<ViewPlane> {
        self.planes(origin).in_slot(ViewPlanes::NEAR).copied()
    }

    /// Returns the planes that bound the view, clip planes included, for points relative to `origin`, a point
    /// of the world.
    pub fn planes(&self, origin: DVec3) -> ViewPlanes {
        let m = &self.clip_from_local;
        let [x, y, z, w] = [0, 1, 2, 3].map(|i| m.row(i));
        let (near, far) = self.depth.rows(z, w);
        let shift = origin - self.origin;
        let mut planes = ViewPlanes::NONE;
        // An infinite far plane is left out because the convention says so: rounding may leave some other
        // plane in the matrix, at a random angle.
        for (slot, row) in (0..).zip([w + x, w - x, w + y, w - y, near].into_iter().chain(far)) {
            planes.push(slot, Plane::new(row.truncate(), row.w), shift);
        }
        for (slot, &plane) in (6..).zip(self.clip_planes()) {
            planes.push(slot, plane, shift);
        }
        planes
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use visibility_testing::Random;

    fn view() -> View {
        let pose = crate::Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
        View::perspective(pose, 1.0, 1.0, 0.5, 9.0).unwrap()
    }

    fn plane(normal: DVec3, offset: f64, error: f64) -> ViewPlane {
        ViewPlane { plane: Plane::new(normal, offset), error }
    }

    #[test]
    fn points_within_the_error_of_a_plane_are_not_inside() {
        let own = plane(DVec3::X, -2.0, 0.25);
        for (x, is_inside) in [(1.9, false), (2.1, false), (2.2, false), (2.26, true), (9.0, true)] {
            let p = DVec3::new(x, 7.0, 7.0);
            assert_eq!(own.contains(p, p), is_inside, "a point at {x}");
        }
        // Normals of whole numbers and points across them: at a distance of 0, but for rounding.
        let mut random = Random(61);
        let mut beyond = 0;
        for _ in 0..1000 {
            let [a, b] = [(); 2].map(|()| f64::from(random.between(1, 1 << 20)));
            let across = view().with_clip_planes(&[Plane::new(DVec3::new(a, b, 0.0), 0.0)]).unwrap();
            let planes = across.clip_planes_from(DVec3::ZERO);
            let p = DVec3::new(b, -a, 0.0) * f64::from(random.between(1, 1 << 20));
            assert!(!planes.contains(p), "{p} is on the plane");
            beyond += usize::from(planes.as_slice()[0].plane.signed_distance(p) > 0.0);
        }
        assert!(beyond > 100, "{beyond} points are rounded inwards");
    }

    #[test]
    fn boxes_are_inside_with_all_their_corners() {
        let own = plane(DVec3::new(0.6, -0.8, 0.0), 0.0, 0.0);
        let at = |min: [f32; 3], max: [f32; 3]| own.contains_box(&Aabb::from_arrays(min, max));
        assert!(at([9.0, -1.0, -1.0], [10.0, 1.0, 1.0]), "a box in front");
        assert!(!at([-9.0, -1.0, -1.0], [10.0, 1.0, 1.0]), "a corner behind by x");
        assert!(!at([9.0, -1.0, -1.0], [10.0, 20.0, 1.0]), "a corner behind by y");
        assert!(!at([10.0, -1.0, -1.0], [9.0, 1.0, 1.0]), "an inverted box");
        assert!(!own.contains_box(&Aabb::new(Vec3::NAN, Vec3::NAN)), "a box of NaN");
    }

    /// Offsets of planes of whole numbers, moved to another origin, against exact sums.
    #[test]
    fn offsets_are_within_their_errors() {
        let mut random = Random(62);
        let mut off = 0;
        for round in 0..5000 {
            let whole = |random: &mut Random, size: i32| [(); 3].map(|()| random.between(-size, size));
            let (n, shift) = (whole(&mut random, 1 << 20), whole(&mut random, 1 << 30));
            let vector = |a: [i32; 3]| DVec3::from_array(a.map(f64::from));
            let dot: i64 = (0..3).map(|i| i64::from(n[i]) * i64::from(shift[i])).sum();
            let near = i64::from(random.between(-100, 100));
            if n == [0; 3] {
                continue;
            }
            let clipped = view().with_clip_planes(&[Plane::new(vector(n), (near - dot) as f64)]).unwrap();
            let planes = clipped.clip_planes_from(vector(shift));
            let [own] = planes.as_slice() else { panic!("{round}: one plane") };
            let distance = (own.plane.offset - near as f64 / vector(n).length()).abs();
            assert!(distance <= own.error, "{round}: {distance} of at most {}", own.error);
            off += usize::from(distance > own.error / 32.0);
        }
        assert!(off > 100, "{off} offsets are off by a part of the bound");
    }

    #[test]
    fn planes_that_are_none_are_left_out_or_refused() {
        let count = |plane: Plane, origin: DVec3| {
            view().with_clip_planes(&[plane]).unwrap().clip_planes_from(origin).as_slice().len()
        };
        assert_eq!(count(Plane::new(DVec3::X, -1.5e308), DVec3::X), 1, "a plane far away");
        // The terms of the offset cancel, and the sum of their magnitudes overflows.
        assert_eq!(count(Plane::new(DVec3::X, -1.5e308), DVec3::X * 1.5e308), 0, "an error without end");
        let refused = |plane: Plane| view().with_clip_planes(&[Plane::new(DVec3::X, 0.0), plane]).err();
        let expected = Some(ViewError::ClipPlane { index: 1 });
        for bad in [
            Plane::new(DVec3::ZERO, 1.0),
            Plane::new(DVec3::new(0.0, f64::NAN, 1.0), 1.0),
            Plane::new(DVec3::X, f64::INFINITY),
        ] {
            assert_eq!(refused(bad), expected, "{bad:?}");
        }
        let many = [Plane::new(DVec3::X, 0.0); MAX_CLIP_PLANES + 1];
        assert!(view().with_clip_planes(&many[1..]).is_ok(), "as many planes as there may be");
        let count = many.len();
        assert_eq!(
            view().with_clip_planes(&many).err(),
            Some(ViewError::TooManyClipPlanes { count }),
            "one more"
        );
    }
}
