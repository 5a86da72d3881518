//! Where the lines of sight of a view begin: the one computation for all who ask which regions an eye sees
//! from.
//!
//! Nothing before the near plane is drawn, and nothing that a clip plane cuts away. So a line of sight begins
//! at its first point inside of these planes: in the eye if that is inside of all of them, otherwise on a
//! plane that the line crosses inwards. All lines of sight that cross such a plane meet it in the convex hull
//! of the points in which the four edges of the view meet it, provided that all four do so before the eye. A
//! near plane as of a mirror (Lengyel, "Oblique View Frustum Depth Projection and Clipping", 2005) need not:
//! then the lines of sight begin at any distance, and nothing is told.
//!
//! # Rounding
//! The planes of a [`View`] are within stated errors of the exact ones, [`margin`] bounds the distances to
//! these, and [`intersection`] the points where three of them meet. Every question that decides whether lines
//! of sight begin somewhere is answered for the exact planes, or not at all.

use super::{Eye, View, ViewPlane, ViewProjection};
use crate::geometry::{Corners, clip_outward};
use glam::DVec3;
use smallvec::SmallVec;

/// Unit round-off of `f64`.
const U: f64 = f64::EPSILON / 2.0;

/// The least determinant of three unit normals that rounding leaves a sign, twice over.
///
/// The normals are within `16u` of the exact ones, each of which counts once: `48u`. The products and sums of
/// the determinant round by less than `16u`. So an exact determinant is at least half of a computed one above
/// this.
const LEAST_DETERMINANT: f64 = 128.0 * U;

impl View {
    /// Calls `each` with convex polygons that hold the first point of every line of sight of the view,
    /// whatever is far away.
    ///
    /// Corners are in order around a polygon, in metres relative to `anchor`, a point of the world; each is
    /// within the second argument, in metres, of where it should be, and so is all that is between them. A
    /// polygon may also be a single point: an eye that no plane cuts away. A common view has one polygon, the
    /// rectangle on its near plane; each [clip plane](Self::with_clip_planes) that cuts the eye away adds one
    /// at most; no polygon at all means that planes cut everything away. Errors are least where the anchor is
    /// the eye, or near it.
    ///
    /// False if that cannot be told, and then the polygons mean nothing: where lines of sight begin at any
    /// distance, since some never meet an oblique near plane; where rounding leaves open whether the eye, or
    /// the direction of a parallel view, is inside of a plane or beyond it; and where a plane of the view is
    /// beyond the range of `f64`.
    ///
    /// Takes constant time, with clip planes in proportion to the square of their number. No allocation.
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

/// The planes that decide where lines of sight begin, relative to an anchor.
struct SightPlanes {
    /// Left, right, bottom, top.
    sides: [ViewPlane; 4],
    /// The near plane, then the clip planes.
    fronts: SmallVec<[ViewPlane; 11]>,
    /// The eye and the bound on its error in metres; `None` for parallel views.
    eye: Option<(DVec3, f64)>,
}

impl SightPlanes {
    /// `None` if a plane is missing.
    fn new(view: &View, anchor: DVec3) -> Option<Self> {
        let planes = view.planes(anchor);
        let mut sides = [None; 4];
        let mut fronts = SmallVec::new();
        for (slot, plane) in planes.with_slots() {
            match slot {
                0..=3 => sides[usize::from(slot)] = Some(*plane),
                5 => {}
                _ => fronts.push(*plane),
            }
        }
        let [left, right, bottom, top] = sides;
        let sides = [left?, right?, bottom?, top?];
        // A plane that could not be had would let lines of sight begin earlier than they do.
        if fronts.len() != 1 + view.clip_planes().len() {
            return None;
        }
        let projection = ViewProjection::new(view, anchor);
        let eye = match projection.eye() {
            Eye::Point(eye) => Some((eye, projection.eye_error())),
            Eye::Direction(_) => None,
        };
        Some(Self { sides, fronts, eye })
    }

    /// `None` if it cannot be told where lines of sight begin.
    fn for_each_polygon(&self, mut each: impl FnMut(&[DVec3], f64)) -> Option<()> {
        let mut at_eye = self.eye;
        for place in 0..self.fronts.len() {
            if !self.is_entered(place)? {
                continue;
            }
            at_eye = None;
            let (corners, error) = self.polygon(place)?;
            if !corners.is_empty() {
                each(&corners, error);
            }
        }
        if let Some((eye, error)) = at_eye {
            each(&[eye], error);
        }
        Some(())
    }

    /// Whether lines of sight cross a front plane inwards, if they cross it at all; `None` if that is unsure.
    ///
    /// From an eye they do if it is beyond the plane. In a parallel view the sense of the lines is such that
    /// they cross the near plane inwards; they run along the edge in which two sides meet, and the
    /// determinants tell the angles of that with the planes.
    fn is_entered(&self, place: usize) -> Option<bool> {
        let front = &self.fronts[place];
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
                Some(angle(front)? * angle(&self.fronts[0])? > 0.0)
            }
        }
    }

    /// The part of a front plane in which lines of sight begin, which may be empty, and the bound on the
    /// error of its corners in metres. `None` unless all edges of the view surely meet the plane before the
    /// eye.
    ///
    /// A corner is before the eye if clip `w` is positive there. On the left side `x = -w`, so the right
    /// side's `w - x` is `2w`: any side that is not met in the corner tells.
    fn polygon(&self, place: usize) -> Option<(Corners, f64)> {
        let front = &self.fronts[place];
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
        for (_, other) in self.fronts.iter().enumerate().filter(|&(other, _)| other != place) {
            // A point of the exact polygon that is inside of the exact plane has a point between the corners
            // within `error` of it, and that is within `margin + error` of the plane as it is here. To
            // compute the height of a corner is in the margin; where a crossing is put on its edge rounds by
            // a few units of what both ends are from the anchor and the plane from them, and it is off the
            // edge by less than `4u` of that.
            let reach = corners.iter().fold(0.0, |reach: f64, corner| reach.max(corner.length()));
            let moved = margin(other, reach) + error + 16.0 * U * (reach + other.plane.offset.abs());
            corners = clip_outward(&corners, &other.plane, moved);
            error += 8.0 * U * reach;
        }
        Some((corners, error))
    }
}

/// Bound on the difference in metres between the distance of a point from a plane, as computed, and that from
/// the exact plane.
///
/// `reach` is the point's distance from the anchor. The exact normal is within `16u` of the plane's own in
/// each component, which counts `16u reach`; the products and sums round by `4u` of the reach and `2u` of the
/// offset, and may lose denormals. The rest of `32u` and `4u` covers that of the reach itself.
fn margin(plane: &ViewPlane, reach: f64) -> f64 {
    plane.error + 32.0 * U * reach + 4.0 * U * plane.plane.offset.abs() + 8.0 * f64::MIN_POSITIVE
}

/// The point where three planes meet.
struct Intersection {
    at: DVec3,
    /// How far, in metres, `at` can be from where the exact planes meet.
    error: f64,
    /// Of the unit normals in the order of the planes. The exact one has the same sign.
    determinant: f64,
}

/// Where three planes surely meet in one point; `None` if they may not.
///
/// The point found may be off the exact planes by its computed distances from them and the margins of these.
/// With unit normals `N`, the product of the singular values is the determinant and the sum of their squares
/// 3, so the least is at least the determinant over 1.5. The exact determinant is at least half the computed
/// one; so the distance of the exact point is at most `3 sqrt(3)` times the greatest residual over the
/// computed determinant. 6 leaves the rest for rounding of this bound.
fn intersection(planes: [&ViewPlane; 3]) -> Option<Intersection> {
    let [a, b, c] = planes.map(|plane| plane.plane);
    let (bc, ca, ab) = (b.normal.cross(c.normal), c.normal.cross(a.normal), a.normal.cross(b.normal));
    let determinant = a.normal.dot(bc);
    let at = -(bc * a.offset + ca * b.offset + ab * c.offset) / determinant;
    let reach = at.length();
    let residual = planes.iter().fold(0.0, |residual: f64, plane| {
        residual.max(plane.plane.signed_distance(at).abs() + margin(plane, reach))
    });
    let error = 6.0 * residual / determinant.abs();
    // Written so that NaN is no point.
    let sure = determinant.abs() > LEAST_DETERMINANT && error < f64::INFINITY;
    sure.then_some(Intersection { at, error, determinant })
}
