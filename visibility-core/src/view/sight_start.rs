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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Plane;
    use glam::{DMat3, DVec4};
    use visibility_testing::Random;

    fn plane(normal: DVec3, offset: f64, error: f64) -> ViewPlane {
        let length = normal.length();
        ViewPlane { plane: Plane::new(normal / length, offset / length), error }
    }

    /// Returns the point in which three planes meet, moved by `by` along their normals.
    fn met(planes: [&ViewPlane; 3], by: [f64; 3]) -> DVec3 {
        let [a, b, c] = planes.map(|plane| plane.plane);
        let offsets = DVec3::new(a.offset + by[0], b.offset + by[1], c.offset + by[2]);
        DMat3::from_cols(a.normal, b.normal, c.normal).transpose().inverse() * -offsets
    }

    /// The planes of a view along z from the origin, with tangents of 1 at all sides and the near plane at a
    /// distance of 1. `errors` are those of sides, of the near plane and of the eye.
    fn planes(errors: [f64; 3], clips: &[ViewPlane]) -> SightPlanes {
        let side = |x: f64, y: f64| plane(DVec3::new(x, y, 1.0), 0.0, errors[0]);
        let mut start_planes = SmallVec::new();
        start_planes.push(plane(DVec3::Z, -1.0, errors[1]));
        start_planes.extend_from_slice(clips);
        let sides = [side(1.0, 0.0), side(-1.0, 0.0), side(0.0, 1.0), side(0.0, -1.0)];
        SightPlanes { sides, start_planes, eye: Some((DVec3::ZERO, errors[2])) }
    }

    fn polygons(planes: &SightPlanes) -> Option<Vec<(Vec<DVec3>, f64)>> {
        let mut found = Vec::new();
        planes.for_each_polygon(|corners, error| found.push((corners.to_vec(), error)))?;
        Some(found)
    }

    extern crate std;
    use std::vec::Vec;

    /// Planes that are off by as much as they may be meet within the bound.
    #[test]
    fn planes_meet_within_the_bound() {
        let mut random = Random(81);
        let (mut told, mut tight) = (0, 0);
        for round in 0..5000 {
            let errors = [(); 3].map(|()| random.fine_range(1e-6, 1e-3));
            // Often nearly in one bundle: three normals of which one is nearly a sum of the others.
            let [a, b] = [random.direction(), random.direction()];
            let c = if round % 2 == 0 { random.direction() } else { -(a + b) + random.vector(0.01) };
            let [a, b, c] = [(a, errors[0]), (b, errors[1]), (c, errors[2])]
                .map(|(normal, error)| plane(normal, random.fine_range(-2.0, 2.0), error));
            let Some(Intersection { at, error, determinant }) = intersection([&a, &b, &c]) else { continue };
            told += 1;
            let volume = a.plane.normal.dot(b.plane.normal.cross(c.plane.normal));
            assert_eq!(determinant > 0.0, volume > 0.0, "{round}: the sign of the determinant");
            for signs in 0..8 {
                let by = core::array::from_fn(|i| if signs >> i & 1 == 0 { errors[i] } else { -errors[i] });
                let off = met([&a, &b, &c], by).distance(at);
                assert!(off <= error, "{round}: off by {off} of at most {error}");
                tight += usize::from(off > 0.3 * error);
            }
        }
        assert!(told > 4000 && tight > 100, "{told} points, {tight} nearly off");
        let flat = |z: f64| plane(DVec3::new(1.0, 0.0, z), 1.0, 0.0);
        assert!(intersection([&flat(0.0), &flat(1.0), &flat(2.0)]).is_none(), "normals in one plane");
        for round in 0..100 {
            // Three normals in one plane, but for the rounding of the third.
            let [a, b] = [random.direction(), random.direction()];
            let [a, b, c] = [a, b, a * 0.3 + b * 0.4].map(|normal| plane(normal, 1.0, 0.0));
            assert!(intersection([&a, &b, &c]).is_none(), "{round}: a sign that is rounding alone");
        }
        let far = |normal| plane(normal, 1e308, 0.0);
        let [x, y, z] = [DVec3::X, DVec3::new(1.0, 1e-3, 0.0), DVec3::new(0.0, 1.0, 1e-3)].map(far);
        assert!(intersection([&x, &y, &z]).is_none_or(|found| found.error < f64::INFINITY), "far away");
        let uncertain = ViewPlane { error: f64::MAX, ..x };
        assert!(intersection([&uncertain, &y, &z]).is_none(), "a bound without end");
    }

    /// Distances of points of whole numbers from planes of whole numbers, of which the normal is rounded.
    #[test]
    fn distances_are_within_the_margin() {
        let mut random = Random(82);
        let view = crate::Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
        let view = View::perspective(view, 1.0, 1.0, 0.5, 9.0).unwrap();
        let mut off = 0;
        for round in 0..5000 {
            let whole = |random: &mut Random, size: i32| [(); 3].map(|()| random.between(-size, size));
            let vector = |a: [i32; 3]| DVec3::from_array(a.map(f64::from));
            let n = whole(&mut random, 1 << 20);
            if n == [0; 3] {
                continue;
            }
            // Points across the normal, at a distance of 0 from a plane through the anchor.
            let q = whole(&mut random, 1 << 10);
            let p = vector(n).cross(vector(q)) * f64::from(random.between(1, 1 << 10));
            let clipped = view.with_clip_planes(&[Plane::new(vector(n), 0.0)]).unwrap();
            let planes = clipped.clip_planes_from(DVec3::ZERO);
            let [own] = planes.as_slice() else { panic!("{round}: one plane") };
            let distance = own.plane.signed_distance(p).abs();
            let bound = margin(own, p.length());
            assert!(distance <= bound, "{round}: {distance} of at most {bound}");
            off += usize::from(distance > bound / 64.0);
        }
        assert!(off > 100, "{off} points are off by a part of the margin");
        assert_eq!(margin(&plane(DVec3::X, 0.0, 0.5), 0.0), 0.5 + 8.0 * f64::MIN_POSITIVE, "its own error");
    }

    #[test]
    fn an_eye_within_the_errors_of_a_plane_is_undecided() {
        // The near plane is 1 m before the eye.
        for (near, eye, is_decided) in
            [(0.5, 0.45, true), (0.5, 0.55, false), (0.9, 0.2, false), (0.2, 0.9, false)]
        {
            let planes = planes([0.0, near, eye], &[]);
            let found = planes.is_entered(0);
            assert_eq!(found, is_decided.then_some(true), "errors of {near} and {eye} m");
        }
        let behind = plane(DVec3::Z, 2.0, 0.5);
        let planes = planes([0.0, 0.1, 0.1], &[behind]);
        assert_eq!(planes.is_entered(1), Some(false), "a clip plane behind the eye");
        let found = polygons(&planes).unwrap_or_default();
        assert!(found.len() == 1 && found[0].0.len() == 4, "the near plane alone: {found:?}");
    }

    #[test]
    fn the_eye_is_where_sight_begins_if_no_plane_cuts_it_away() {
        let mut planes = planes([0.0, 0.1, 0.125], &[]);
        planes.start_planes[0] = plane(DVec3::Z, 1.0, 0.1);
        assert_eq!(polygons(&planes), Some(alloc::vec![(alloc::vec![DVec3::ZERO], 0.125)]), "the eye");
        // The eye of a view far from its anchor has an error.
        let pose = crate::Pose::look_at(DVec3::new(1e9, 2e9, 3e9), DVec3::ZERO, DVec3::Z);
        let far = View::perspective(pose, 1.0, 1.0, 0.5, 9.0).unwrap();
        let own = SightPlanes::new(&far, DVec3::ZERO).and_then(|planes| planes.eye);
        let expected = ViewProjection::new(&far, DVec3::ZERO).eye_error();
        assert!(expected > 1e-7, "an error of {expected} m");
        assert_eq!(own.map(|(_, error)| error), Some(expected), "the error of the eye");
    }

    /// The error of a polygon is that of its least certain corner.
    #[test]
    fn polygons_have_the_greatest_error_of_their_corners() {
        for slope in [DVec3::X, -DVec3::X, DVec3::Y, -DVec3::Y, DVec3::ONE] {
            let mut planes = planes([1e-6, 1e-6, 0.0], &[]);
            planes.start_planes[0] = plane(DVec3::Z + slope * 0.3, -1.0, 1e-6);
            let [left, right, bottom, top] = &planes.sides;
            let front = &planes.start_planes[0];
            let corners = [[left, bottom], [right, bottom], [right, top], [left, top]];
            let errors = corners.map(|[a, b]| intersection([front, a, b]).unwrap().error);
            let greatest = errors.into_iter().fold(0.0, f64::max);
            assert!(errors.iter().any(|error| *error < 0.8 * greatest), "corners differ: {errors:?}");
            let found = polygons(&planes).unwrap_or_default();
            assert!(found.len() == 1 && found[0].1 >= greatest, "{slope}: {found:?}");
        }
    }

    /// The corners of the near plane must be before the eye by more than the errors.
    #[test]
    fn corners_that_may_be_behind_the_eye_are_undecided() {
        // An oblique plane that the upper edges of the view meet at 1 / (1 - slope).
        let upper = |slope: f64, errors: [f64; 3]| {
            let mut planes = planes(errors, &[]);
            planes.start_planes[0] = plane(DVec3::new(0.0, -slope, 1.0), -1.0, errors[1]);
            planes.polygon(0)
        };
        assert!(upper(0.0, [0.0; 3]).is_some() && upper(0.9, [0.0; 3]).is_some(), "planes before the eye");
        assert!(upper(1.1, [0.0; 3]).is_none(), "a plane that the upper edges do not meet");
        // The corners of the near plane are 2 / sqrt(2) inside the opposite planes.
        let inside = 2f64.sqrt();
        for (sides, near, is_told) in
            [(0.1, 0.1, true), (0.8 * inside, 0.0, false), (0.0, 0.5 * inside, false)]
        {
            assert_eq!(upper(0.0, [sides, near, 0.0]).is_some(), is_told, "errors of {sides} and {near} m");
        }
    }

    fn distance_to_polygon(p: DVec3, polygon: &[DVec3]) -> f64 {
        // Distance from the nearest of many points of the polygon: of edges and of a fan of triangles.
        let mut least = f64::INFINITY;
        for i in 0..polygon.len() {
            let (a, b) = (polygon[i], polygon[(i + 1) % polygon.len()]);
            for (from, to) in [(a, b), (polygon[0], a)] {
                let along = to - from;
                let t = (p - from).dot(along) / along.length_squared().max(f64::MIN_POSITIVE);
                least = least.min(p.distance(from + along * t.clamp(0.0, 1.0)));
            }
        }
        least
    }

    /// A clip plane that meets the near plane at a small angle cuts it far from where it would if both were
    /// without their errors.
    #[test]
    fn clipped_polygons_hold_where_sight_may_begin() {
        for errors in [[1e-3, 1e-3, 0.0], [1e-9, 1e-9, 1e-3], [1e-6, 1e-3, 1e-3], [1e-3, 1e-9, 1e-9]] {
            let [side_error, near_error, clip_error] = errors;
            for slope in [0.02, 0.3, -0.3] {
                let clip = plane(DVec3::new(slope, 0.0, 1.0), -1.0, clip_error);
                let planes = planes([side_error, near_error, 0.0], &[clip]);
                let Some((corners, error)) = planes.polygon(0) else { panic!("the near plane is met") };
                // The exact near plane is farther away by its error, and the exact clip plane nearer: between
                // them is where x is least.
                let [bottom, top] = [2, 3].map(|side| &planes.sides[side]);
                let near = &planes.start_planes[0];
                for side in [bottom, top] {
                    for [near_by, clip_by] in [[-1.0, 1.0], [1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]] {
                        let by = [0.0, near_error * near_by, clip_error * clip_by];
                        let p = met([side, near, &clip], by);
                        if p.x.abs() > 0.99 {
                            continue;
                        }
                        let off = distance_to_polygon(p, &corners);
                        assert!(off <= error, "{errors:?}, {slope}: {p} is {off} off, of at most {error}");
                    }
                }
            }
        }
    }

    /// In a parallel view, rays enter a plane if they cross it in the sense in which they cross the near
    /// plane.
    #[test]
    fn parallel_rays_enter_planes_in_the_sense_of_the_near_plane() {
        let pose = crate::Pose { eye: DVec3::ZERO, right: DVec3::X, up: DVec3::Y, forward: DVec3::Z };
        let window = crate::view::Window::centered(1.0, 1.0);
        let view = View::orthographic(pose, window, 0.5, 9.0).unwrap();
        let clips = [Plane::new(DVec3::Z, -2.0), Plane::new(-DVec3::Z, 4.0)];
        let view = view.with_clip_planes(&clips).unwrap();
        let planes = SightPlanes::new(&view, DVec3::ZERO).unwrap();
        let entered = [0, 1, 2].map(|index| planes.is_entered(index));
        assert_eq!(entered, [Some(true), Some(true), Some(false)], "near plane and clip planes");
        assert!(view.clip_from(DVec3::ZERO).row(3) == DVec4::W, "the view is parallel");
    }
}
