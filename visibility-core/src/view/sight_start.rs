//! Where the view rays of a view begin: computed here once for all users that need to know from which regions
//! an eye sees.
//!
//! Surfaces nearer than the near plane are not drawn, nor are surfaces that a clip plane cuts away. So a view
//! ray begins at its first point inside all of these planes: in the eye if the eye is inside all of them,
//! otherwise on a plane that the ray crosses inwards. All view rays that cross such a plane meet it in the
//! convex hull of the points in which the four edges of the view meet it, provided that all four do so in
//! front of the eye. An oblique near plane, as of a mirror (Lengyel, "Oblique View Frustum Depth Projection
//! and Clipping", 2005), need not meet all four edges. View rays then begin at any distance, and no bound is
//! given.
//!
//! # Rounding
//! The planes of a [`View`] are within stated errors of the exact ones. [`margin`] bounds the error of
//! distances from these planes, and [`intersection`] the error of the points where three of them meet. Every
//! question that decides whether view rays begin somewhere is answered for the exact planes, or reported as
//! undecided.

use super::{Eye, View, ViewPlane, ViewProjection};
use crate::geometry::{Corners, clip_outward};
use glam::DVec3;
use smallvec::SmallVec;

/// Unit round-off of `f64`: 2^-53, the relative error of one rounded operation.
const U: f64 = f64::EPSILON / 2.0;

/// Least determinant of three unit normals, in magnitude, at which rounding leaves its sign certain; twice
/// the error bound.
///
/// With `u` the unit round-off of `f64`: each of the three normals is within `16u` of the exact one and
/// changes the determinant by at most its own error: `48u`. The products and sums of the determinant round by
/// less than `16u`. So if the computed determinant is above this constant, the exact one is at least half of
/// the computed one.
const MIN_DETERMINANT: f64 = 128.0 * U;

impl View {
    /// Calls `each` with convex polygons that together contain the first point of every view ray of this
    /// view, without regard to the far plane. The first point is where a ray passes the near plane and all
    /// [clip planes](Self::with_clip_planes).
    ///
    /// The first argument of `each` is a polygon's corners in order around it, in metres relative to
    /// `anchor`, a point of the world. The second argument is an error bound in metres: every point of the
    /// exact polygon is within this distance of the polygon given. If no plane cuts the eye away, the only
    /// polygon is a single point, the eye. A common view has one polygon, the rectangle on its near plane.
    /// Each clip plane that cuts the eye away adds at most one polygon. If there is no polygon at all, planes
    /// cut everything away. Errors are smallest if `anchor` is the eye or near it.
    ///
    /// Returns false if the first points cannot be determined; the polygons passed so far are then to be
    /// discarded. This happens where some view rays never meet an oblique near plane, so that others start at
    /// any distance; where rounding leaves undecided on which side of a plane the eye, or the direction of a
    /// parallel view, is; and where `f64` cannot represent a plane of the view.
    ///
    /// Takes constant time, with clip planes in proportion to the square of their number, and allocates
    /// nothing.
    ///
    /// ```
    /// use visibility_core::{glam::DVec3, Pose, View};
    /// let eye = DVec3::new(1.0, 2.0, 3.0);
    /// let view = View::perspective(Pose::look_at(eye, eye + DVec3::X, DVec3::Z), 1.0, 1.5, 0.5, 100.0)?;
    /// let mut corners = Vec::new();
    /// let known = view.for_each_sight_start(eye, |polygon, _error| corners.extend_from_slice(polygon));
    /// assert!(known && corners.len() == 4);
    /// assert!(corners.iter().all(|corner| (corner.x - 0.5).abs() < 1e-12), "half a metre ahead");
    /// # Ok::<(), visibility_core::view::ViewError>(())
    /// ```
    pub fn for_each_sight_start(&self, anchor: DVec3, each: impl FnMut(&[DVec3], f64)) -> bool {
        SightPlanes::new(self, anchor).is_some_and(|planes| planes.for_each_polygon(each).is_some())
    }
}

/// The planes that decide where view rays begin, for points in metres relative to an anchor. All normals
/// point into the view; the inner side of a plane is the side that its normal points to.
struct SightPlanes {
    /// Left, right, bottom and top plane of the frustum, with normals that point inwards.
    sides: [ViewPlane; 4],
    /// The planes that view rays may begin on: the near plane, then the clip planes in their order.
    start_planes: SmallVec<[ViewPlane; 11]>,
    /// The eye, in metres relative to the anchor, and a bound on its error in metres; `None` for parallel
    /// views.
    eye: Option<(DVec3, f64)>,
}

impl SightPlanes {
    /// Collects the planes of `view` relative to `anchor`, a point of the world. `None` if `f64` cannot
    /// represent one of them.
    fn new(view: &View, anchor: DVec3) -> Option<Self> {
        let planes = view.planes(anchor);
        let mut sides = [None; 4];
        let mut start_planes = SmallVec::new();
        for (slot, plane) in planes.by_slot() {
            match slot {
                0..=3 => sides[usize::from(slot)] = Some(*plane),
                5 => {}
                _ => start_planes.push(*plane),
            }
        }
        let [left, right, bottom, top] = sides;
        let sides = [left?, right?, bottom?, top?];
        // If a start plane were missing, view rays would seem to begin nearer than they do.
        if start_planes.len() != 1 + view.clip_planes().len() {
            return None;
        }
        let projection = ViewProjection::new(view, anchor);
        let eye = match projection.eye() {
            Eye::Point(eye) => Some((eye, projection.eye_error())),
            Eye::Direction(_) => None,
        };
        Some(Self { sides, start_planes, eye })
    }

    /// Calls `each` with every polygon (corners in metres relative to the anchor) and its error bound in
    /// metres, as [`View::for_each_sight_start`] does. `None` if the first points of view rays cannot be
    /// determined; polygons passed before are then invalid.
    fn for_each_polygon(&self, mut each: impl FnMut(&[DVec3], f64)) -> Option<()> {
        let mut at_eye = self.eye;
        for index in 0..self.start_planes.len() {
            if !self.is_entered(index)? {
                continue;
            }
            at_eye = None;
            let (corners, error) = self.polygon(index)?;
            if !corners.is_empty() {
                each(&corners, error);
            }
        }
        if let Some((eye, error)) = at_eye {
            each(&[eye], error);
        }
        Some(())
    }

    /// Returns whether view rays that cross the plane `start_planes[index]` cross it inwards, towards the
    /// side that its normal points to. `Some(false)` if they cross it outwards; `None` if rounding leaves the
    /// answer undecided.
    fn is_entered(&self, index: usize) -> Option<bool> {
        // From an eye, rays cross the plane inwards if the eye is outside of it. In a parallel view, rays are
        // known to cross the near plane inwards. Parallel rays run along the edge in which two side planes
        // meet, and the determinants of the two front planes with these side planes have the same sign if
        // both are crossed in the same sense.
        let front = &self.start_planes[index];
        let [left, _, bottom, _] = &self.sides;
        match self.eye {
            Some((eye, error)) => {
                let distance = front.plane.signed_distance(eye);
                let doubt = margin(front, eye.length()) + error;
                let sure = distance.abs() > doubt;
                sure.then_some(distance < 0.0)
            }
            None => {
                let angle = |front| intersection([front, left, bottom]).map(|at| at.determinant);
                Some(angle(front)? * angle(&self.start_planes[0])? > 0.0)
            }
        }
    }

    /// Returns a convex polygon that contains all points of the plane `start_planes[index]` at which view
    /// rays begin, and the error bound of its corners in metres. The corners are in metres relative to the
    /// anchor; the polygon may be empty. `None` unless all four edges of the frustum, the lines in which
    /// neighbouring side planes meet, certainly meet the plane in front of the eye.
    fn polygon(&self, index: usize) -> Option<(Corners, f64)> {
        // A corner is in front of the eye if clip-space `w` is positive there. On the left plane `x = -w`, so
        // the right plane's `w - x` is `2w` there. The sign of `w` at a corner is therefore that of the
        // distance from any side plane that does not pass through the corner.
        let front = &self.start_planes[index];
        let [left, right, bottom, top] = &self.sides;
        let (mut corners, mut error) = (Corners::new(), 0.0f64);
        for ([a, b], opposite) in [
            ([left, bottom], [right, top]),
            ([right, bottom], [left, top]),
            ([right, top], [left, bottom]),
            ([left, top], [right, bottom]),
        ] {
            let corner = intersection([front, a, b])?;
            let reach = corner.at.length();
            let is_inside =
                |side: &ViewPlane| side.plane.signed_distance(corner.at) > margin(side, reach) + corner.error;
            if !opposite.into_iter().any(is_inside) {
                return None;
            }
            corners.push(corner.at);
            error = error.max(corner.error);
        }
        for (_, other) in self.start_planes.iter().enumerate().filter(|&(other, _)| other != index) {
            // A point of the exact polygon that is inside the exact plane has a point between the corners
            // within `error`, and that point is within `margin + error` of the plane as given here. The
            // rounding of a corner's distance is part of the margin. The position of a crossing on its edge
            // rounds by a few units of the distance of both ends from the anchor and of the plane from the
            // anchor, and is off the edge by less than `4u` of these.
            let reach = corners.iter().fold(0.0, |reach: f64, corner| reach.max(corner.length()));
            let moved = margin(other, reach) + error + 16.0 * U * (reach + other.plane.offset.abs());
            corners = clip_outward(&corners, &other.plane, moved);
            error += 8.0 * U * reach;
        }
        Some((corners, error))
    }
}

/// Returns a bound, in metres, on the difference between the computed distance of a point from a plane and
/// the distance from the exact plane. `reach` is the point's distance from the anchor, in metres.
fn margin(plane: &ViewPlane, reach: f64) -> f64 {
    // With `u` the unit round-off of `f64`: the exact normal is within `16u` of the plane's own in each
    // component, which counts `16u reach`. The products and sums round by `4u` of the reach and `2u` of the
    // offset, and may lose denormals. The rest of `32u` and `4u` covers the rounding of the reach itself.
    plane.error + 32.0 * U * reach + 4.0 * U * plane.plane.offset.abs() + 8.0 * f64::MIN_POSITIVE
}

/// The point `at` in which three planes meet, in metres relative to the anchor.
struct Intersection {
    at: DVec3,
    /// Bound on the distance, in metres, from `at` to the point in which the exact planes meet.
    error: f64,
    /// Determinant of the unit normals in the order of the planes. The exact determinant has the same sign.
    determinant: f64,
}

/// Returns the point in which three planes certainly meet, in metres relative to the anchor; `None` if
/// rounding leaves undecided whether there is exactly one.
fn intersection(planes: [&ViewPlane; 3]) -> Option<Intersection> {
    // The exact planes may be off the computed point by its computed distances from the planes and the
    // margins of these distances. With the unit normals as rows of a matrix, the product of its singular
    // values is the determinant, and the sum of their squares is 3, so the least singular value is at least
    // the determinant over 1.5. The exact determinant is at least half the computed one. The distance of the
    // exact point is therefore at most `3 sqrt(3)` times the greatest residual over the computed determinant.
    // The factor 6 leaves the rest for rounding of this bound.
    let [a, b, c] = planes.map(|plane| plane.plane);
    let (bc, ca, ab) = (b.normal.cross(c.normal), c.normal.cross(a.normal), a.normal.cross(b.normal));
    let determinant = a.normal.dot(bc);
    let at = -(bc * a.offset + ca * b.offset + ab * c.offset) / determinant;
    let reach = at.length();
    let residual = planes.iter().fold(0.0, |residual: f64, plane| {
        residual.max(plane.plane.signed_distance(at).abs() + margin(plane, reach))
    });
    let error = 6.0 * residual / determinant.abs();
    // Written so that NaN gives `None`.
    let sure = determinant.abs() > MIN_DETERMINANT && error < f64::INFINITY;
    sure.then_some(Intersection { at, error, determinant })
}
