//! The unit that boxes are tested against: one polygon, or two that share an edge.

use crate::clip_projection::{ClipProjection, U, corners_of};
use crate::shadow::{BackPlane, OccluderPolygon};
use core::ops::Range;
use visibility_core::glam::DVec3;
use visibility_core::view::Eye;

/// Greatest error of the ends of an edge, as a fraction of their distance from the eye, up to which the edge
/// is used. Sides of two objects that are placed at the same coordinate count as one edge, so that there may
/// be a crack as wide as the error.
const MAX_PLACING_ERROR: f64 = 1.0 / (1u64 << 24) as f64;

/// An edge of a polygon and the plane through this edge and the eye of the frame. The inner side of the plane
/// is the side that its normal points to.
#[derive(Clone, Copy, Debug)]
pub(super) struct Edge {
    /// Ends of the edge, in metres relative to `Scene::origin`.
    pub(super) ends: [DVec3; 2],
    /// Index in `Groups::faces` of the polygon.
    pub(super) face: usize,
    /// Bound on the error of each coordinate of `ends`, in metres.
    pub(super) placing_error: f64,
    /// Normal of the plane, not normalized, pointing to the inner side. The plane passes through
    /// [`base`](Self::base).
    normal: DVec3,
    /// Sign by which a view ray on the inner side passes the edge from its first to its second end: -1 for a
    /// polygon that is seen from its front, 1 from behind.
    turn: f64,
    /// Linear term of the bound `slope * s + least` on the absolute error of `normal . q`, for a point `q` in
    /// metres relative to [`base`](Self::base), with no coordinate above `s` in magnitude. Infinite before
    /// the first call of [`update_eye`](Self::update_eye).
    slope: f64,
    /// Constant term of the error bound; see `slope`. Infinite before the first call of
    /// [`update_eye`](Self::update_eye), and if the edge bounds no shadow.
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
                let error = 16.0 * U * size + eye_error;
                before - clear - error
            }
            Eye::Direction(along) => -near.normal.dot(*along) - 16.0 * U - 2.0 * eye_error,
        };
        let [front, rear] = &self.front;
        let (before, behind) = (height(front, rear), height(rear, front));
        if before > 0.0 || !self.two_sided {
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
    /// Creates an edge of polygon number `face` between two points in metres relative to `Scene::origin`, in
    /// boundary order, counter-clockwise as seen from the polygon's front. Each coordinate may be off by
    /// `placing_error` metres. No box is inside the edge's plane until [`update_eye`](Self::update_eye) is
    /// called.
    pub(super) fn new(ends: [DVec3; 2], face: usize, placing_error: f64) -> Self {
        let (slope, least) = (f64::INFINITY, f64::INFINITY);
        Self { ends, face, placing_error, normal: DVec3::ZERO, turn: 0.0, slope, least }
    }

    /// Computes the plane through the eye and the edge. A view ray is on its inner side if it passes the edge
    /// on the side on which the polygon's boundary encircles it, seen from the polygon's front or not as
    /// `from_front` tells. A ray that is on the inner side of all edges of a closed boundary is encircled by
    /// it, however the boundary winds. `eye_error` bounds the eye's error: in metres for a point, as the
    /// length of the difference for a unit direction.
    ///
    /// No box is inside the plane if the ends are off by more than 2^-24 of their distance from the eye; for
    /// parallel views, of the edge's length.
    pub(super) fn update_eye(&mut self, eye: &Eye, eye_error: f64, from_front: bool) {
        // The plane's value at a point is a determinant of three differences to the eye: six products of
        // three factors. Rounding adds at most `8u` of each product, and an eye that is off by `e` adds at
        // most `e` in place of each factor, as ends do that are off by `e`. The factors of 64 cover both.
        self.turn = if from_front { -1.0 } else { 1.0 };
        let nearest = match eye {
            Eye::Point(eye) => {
                let eye_error = eye_error + self.placing_error;
                let (a, b) = (self.ends[0] - *eye, self.ends[1] - *eye);
                let (size_a, size_b) = (a.abs().max_element(), b.abs().max_element());
                self.normal = self.turn * a.cross(b);
                self.slope = 64.0 * (U * size_a * size_b + eye_error * (size_a + size_b));
                self.least = 64.0 * eye_error * size_a * size_b + f64::MIN_POSITIVE;
                size_a.min(size_b)
            }
            Eye::Direction(along) => {
                let side = self.ends[1] - self.ends[0];
                let size = side.abs().max_element();
                self.normal = self.turn * along.cross(side);
                self.slope = 64.0 * ((U + eye_error) * size + self.placing_error);
                self.least = 64.0 * self.placing_error * size + f64::MIN_POSITIVE;
                size
            }
        };
        if self.placing_error > MAX_PLACING_ERROR * nearest {
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

    /// Returns two distances in metres that the eye may move from `eye`, the point passed to
    /// [`update_eye`](Self::update_eye). Up to the first, a box that is inside the edge's plane stays inside,
    /// and the ends do not come so near that the edge is not used; up to the second, a box that is not inside
    /// does not come inside. Both are reduced by a bound on the rounding of heights, to no less than 0. The
    /// box is from `min` to `max`, in metres relative to `Scene::origin`.
    pub(super) fn clearance(&self, eye: DVec3, min: DVec3, max: DVec3) -> [f64; 2] {
        // A corner is on the edge's plane where the eye is on the plane through the edge and the corner. Of
        // these planes of a box's points, the outermost are those of corners.
        let [a, b] = self.ends;
        let (side, to_eye) = (b - a, eye - a);
        let (mut inside, mut outside) = (f64::INFINITY, 0.0f64);
        if self.placing_error > 0.0 {
            // Coordinates of the ends, relative to the eye, change by no more than the eye moves.
            let nearest = to_eye.abs().max_element().min((eye - b).abs().max_element());
            inside = (nearest - self.placing_error / MAX_PLACING_ERROR).max(0.0);
        }
        for corner in corners_of([min, max]) {
            // The normal is off by a few roundings of its factors, which the eye's distance from the edge
            // multiplies.
            let normal = side.cross(corner - a);
            let length = normal.length();
            let distance = -self.turn * normal.dot(to_eye) / length;
            let (along, across) = (side.length(), (corner - a).length());
            let error = U * along * across + self.placing_error * (along + across);
            let error = 64.0 * error / length * to_eye.length() + 2.0 * self.placing_error;
            // Not a number, if the corner is in line with the edge.
            let sure =
                |distance: f64| Some(distance - error).filter(|d| d.is_finite()).unwrap_or(0.0).max(0.0);
            (inside, outside) = (inside.min(sure(distance)), outside.max(sure(-distance)));
        }
        [inside, outside]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The edge that bounds the shadow on the side of +y, seen from the origin.
    fn edge(placing_error: f64) -> Edge {
        Edge::new([DVec3::new(1.0, 1.0, 1.0), DVec3::new(1.0, 1.0, -4.0)], 0, placing_error)
    }

    #[test]
    fn an_edge_whose_ends_are_placed_worse_than_a_direction_may_be_bounds_no_shadow() {
        let (min, max) = (DVec3::new(3.0, -1.0, -1.0), DVec3::new(4.0, 1.0, 1.0));
        // The nearer end is 1 m away, and the edge 5 m long.
        for (eye, limit) in [(Eye::Point(DVec3::ZERO), 6e-8), (Eye::Direction(DVec3::X), 3e-7)] {
            for (error, holds) in [(0.0, true), (0.98 * limit, true), (1.02 * limit, false), (1e-3, false)] {
                let mut edge = edge(error);
                edge.update_eye(&eye, 0.0, true);
                let (low, high) = (min, max.min(DVec3::new(4.0, 0.5, 1.0)));
                assert_eq!(edge.holds(&eye, low, high), holds, "error of {error} m, {eye:?}");
            }
        }
    }

    #[test]
    fn an_edge_that_runs_the_wrong_way_bounds_no_shadow() {
        let (min, max) = (DVec3::new(3.0, -1.0, -1.0), DVec3::new(4.0, 0.5, 1.0));
        for eye in [Eye::Point(DVec3::ZERO), Eye::Direction(DVec3::X)] {
            for from_front in [true, false] {
                let mut edge = edge(0.0);
                edge.update_eye(&eye, 0.0, from_front);
                assert_eq!(
                    edge.holds(&eye, min, max),
                    from_front,
                    "seen from the front: {from_front}, {eye:?}"
                );
            }
        }
    }

    /// Returns six times the signed volume of a tetrahedron with whole coordinates.
    fn volume([a, b, c, d]: [[i64; 3]; 4]) -> i128 {
        let [b, c, d] = [b, c, d].map(|p| [0, 1, 2].map(|i| i128::from(p[i] - a[i])));
        b[0] * (c[1] * d[2] - c[2] * d[1])
            + b[1] * (c[2] * d[0] - c[0] * d[2])
            + b[2] * (c[0] * d[1] - c[1] * d[0])
    }

    /// Edges, eyes and points with whole coordinates, whose volumes exceed the precision of a double. Many
    /// points are in the plane of the eye and the edge, or beside it by as little as there is.
    #[test]
    fn points_are_inside_an_edge_only_if_they_exactly_are_wherever_its_ends_are_placed() {
        let mut random = visibility_testing::Random(43);
        let mut whole = |bits: u32| (random.bits() >> (63 - bits)) as i64 - (1 << bits);
        let (mut held, mut kept, mut left) = (0, 0, 0);
        for round in 0..60_000 {
            // All coordinates are multiples of 2^-8.
            let point = |whole: &mut dyn FnMut(u32) -> i64, bits| [(); 3].map(|()| whole(bits) << 8);
            let plus = |p: [i64; 3], k: i64, q: [i64; 3]| [0, 1, 2].map(|i| p[i] + k * q[i]);
            let eye = point(&mut whole, 12);
            let (u, v) = (point(&mut whole, 18), point(&mut whole, 18));
            let ends = [plus(eye, 1, u), plus(eye, 1, v)];
            let from_front = whole(1) > 0;
            // A view ray inside an edge of a polygon that is seen from its front passes it on its left.
            let turn = if from_front { -1 } else { 1 };
            let is_inside = |eye, [a, b]: [_; 2], q| i128::from(turn) * volume([eye, a, b, q]) > 0;
            let little = point(&mut whole, [0, 3, 8, 17][round % 4]);
            let q = plus(plus(plus(eye, whole(3), u), whole(3), v), i64::from(round % 3 != 0), little);
            let [placed, known] = [round / 12 % 2, round / 24 % 2].map(|x| x as i64);
            let metres = |p: [i64; 3]| DVec3::from_array(p.map(|x| x as f64 / 256.0));
            let mut edge = Edge::new(ends.map(metres), 0, placed as f64 / 256.0);
            let from = Eye::Point(metres(eye));
            edge.update_eye(&from, known as f64 / 256.0, from_front);
            // A box that reaches to beside the eye, or a point.
            let near = plus(eye, 1, [256; 3].map(|x| x * whole(2)));
            let other = if round % 5 == 0 { near } else { q };
            let (min, max) = (metres(q).min(metres(other)), metres(q).max(metres(other)));
            let is_held = edge.holds(&from, min, max);
            let [inside, outside] = edge.clearance(metres(eye), metres(q), metres(q));
            for _ in 0..4 {
                let mut off = |most: i64| [(); 3].map(|()| most * whole(1).signum());
                let moved = ends.map(|end| plus(end, 1, off(placed)));
                let seen_from = plus(eye, 1, off(known));
                for corner in 0..if is_held { 8 } else { 0 } {
                    let corner = [0, 1, 2].map(|i| if corner >> i & 1 == 0 { q[i] } else { other[i] });
                    assert!(
                        is_inside(seen_from, moved, corner),
                        "round {round}: {corner:?} is outside of {edge:?}"
                    );
                }
                held += usize::from(is_held);
                // Eyes almost as far away as the answer lasts.
                let way = DVec3::from_array([(); 3].map(|()| whole(20) as f64)).normalize();
                let distance = if is_inside(eye, ends, q) { inside } else { outside };
                let way = (way * distance * 256.0).to_array().map(|x| x.trunc() as i64);
                let there = plus(eye, 1, way);
                if distance > 1.0 && distance < 1e6 {
                    let now = is_inside(there, moved, q);
                    let was = is_inside(eye, ends, q);
                    assert_eq!(
                        now, was,
                        "round {round}: {q:?} from {there:?}, {distance} m from {eye:?}: {edge:?}"
                    );
                    if was { kept += 1 } else { left += 1 }
                }
            }
        }
        assert!(
            held > 20_000 && kept > 5_000 && left > 5_000,
            "{held} held, {kept} kept inside, {left} outside"
        );
    }

    /// As above, along a direction of whole numbers: the plane is parallel to it.
    #[test]
    fn points_are_inside_an_edge_of_a_parallel_view_only_if_they_exactly_are() {
        let mut random = visibility_testing::Random(44);
        let mut whole = |bits: u32| (random.bits() >> (63 - bits)) as i64 - (1 << bits);
        let mut held = 0;
        for round in 0..40_000 {
            let plus = |p: [i64; 3], k: i64, q: [i64; 3]| [0, 1, 2].map(|i| p[i] + k * q[i]);
            let [along, side, first, little] = [20, 24, [4, 28][round % 2], [0, 3, 9, 20][round / 2 % 4]]
                .map(|bits| [(); 3].map(|()| whole(bits)));
            let q = plus(plus(plus(first, whole(3), along), whole(3), side), 1, little);
            let [placed, known] = [round / 8 % 2, round / 16 % 2].map(|x| x as i64);
            let metres = |p: [i64; 3]| DVec3::from_array(p.map(|x| x as f64));
            let ends = [first, plus(first, 1, side)];
            let mut edge = Edge::new(ends.map(metres), 0, placed as f64 * 0.5);
            // The direction is of about unit length.
            let unit = 2f64.powi(-20);
            let from = Eye::Direction(metres(along) * unit);
            edge.update_eye(&from, known as f64 * unit, true);
            if !edge.holds(&from, metres(q), metres(q)) {
                continue;
            }
            held += 1;
            let mut off = |most: i64| [(); 3].map(|()| most * whole(1).signum());
            for _ in 0..8 {
                // In halves.
                let [a, b] = ends.map(|end| plus(off(placed), 2, end));
                let along = plus(along, 1, off(known));
                let inside = -volume([a, plus(a, 1, along), b, [0, 1, 2].map(|i| 2 * q[i])]);
                assert!(inside > 0, "round {round}: {q:?} is outside of {edge:?}");
            }
        }
        assert!(held > 3_000, "points inside an edge: {held}");
    }

    /// Eyes are a thousandth, or some units in the last place, beyond or before the height from which the
    /// eye's error, the near plane and the polygon's unevenness let the polygon be used.
    #[test]
    fn a_polygon_is_used_only_from_surely_before_all_of_it() {
        let face = |two_sided| {
            let (vertices, extent_along_normal) = (&[][..], [-0.2, 0.3]);
            Face::new(&OccluderPolygon {
                vertices,
                normal: DVec3::Z,
                extent_along_normal,
                placing_error: 0.0,
                two_sided,
            })
        };
        for two_sided in [false, true] {
            let from = |z: f64, eye_error, clear| {
                let mut face = face(two_sided);
                face.update_eye(&Eye::Point(DVec3::Z * z), eye_error, clear);
                (face.usable, face.from_front)
            };
            for (share, is) in [(1.001, true), (0.999, false)] {
                assert_eq!(
                    from(0.9 * share, 0.1, 0.5).0,
                    is,
                    "{share} of the height, two-sided: {two_sided}"
                );
                let behind = from(-0.8 * share, 0.1, 0.5);
                let expected = (is && two_sided, !two_sided);
                assert_eq!(behind, expected, "{share} of the depth, two-sided: {two_sided}");
            }
            // 16 units of a sum of 0.8.
            assert!(from(0.3 + 16.0 * U, 0.0, 0.0).0, "beyond rounding");
            assert!(!from(0.3 + 10.0 * U, 0.0, 0.0).0, "within rounding");
            let along = |z: f64, eye_error| {
                let mut face = face(two_sided);
                face.update_eye(&Eye::Direction(DVec3::new((1.0 - z * z).sqrt(), 0.0, z)), eye_error, 0.0);
                (face.usable, face.from_front)
            };
            for (share, is) in [(1.01, true), (0.99, false)] {
                assert_eq!(along(-0.2 * share, 0.1).0, is, "{share} of the slope, two-sided: {two_sided}");
                assert_eq!(
                    along(-16.0 * share * U, 0.0).0,
                    is,
                    "{share} of rounding, two-sided: {two_sided}"
                );
                assert_eq!(along(0.2 * share, 0.1), (is && two_sided, !two_sided), "{share} from behind");
            }
        }
    }

    /// Points near and far, which are outside of the edge if the eye or the ends are moved by their error.
    #[test]
    fn errors_of_the_eye_and_of_ends_count_near_and_far() {
        let (eye, parallel) = (Eye::Point(DVec3::ZERO), Eye::Direction(DVec3::X));
        // As far as a coordinate of the ends may be off, if it is to be used.
        let placing = 5e-8;
        for (eye, eye_error, placing, low, high) in [
            // An eye that is off by 1 cm: points far behind the edge and near the eye.
            (eye, 0.01, 0.0, [1000.0, 987.0, 0.0], [1000.0, 987.0, 0.0]),
            (eye, 0.01, 0.0, [0.001, -0.012, 0.0], [0.001, -0.012, 0.0]),
            // Ends of an edge of 5 m that are off to both sides, as far as a kilometre along the edge.
            (eye, 0.0, placing, [1.0, 1.0 - 390.0 * placing, 0.0], [1.0, 1.0 - 390.0 * placing, 1000.0]),
            (
                parallel,
                0.0,
                placing,
                [1.0, 1.0 - 390.0 * placing, 1000.0],
                [1.0, 1.0 - 390.0 * placing, 1000.0],
            ),
            (parallel, 0.0, placing, [1.0, 1.0 - 0.9 * placing, 1.0], [1.0, 1.0 - 0.9 * placing, 1.0]),
        ] {
            let [low, high] = [low, high].map(DVec3::from_array);
            let mut edge = edge(placing);
            edge.update_eye(&eye, eye_error, true);
            assert!(
                !edge.holds(&eye, low, high),
                "from {low} to {high}, eye off by {eye_error}, ends by {placing}"
            );
            let mut edge = self::edge(0.0);
            edge.update_eye(&eye, 0.0, true);
            assert!(edge.holds(&eye, low, high), "from {low} to {high}, without errors");
        }
    }

    /// Edges, corners and eyes of whole numbers. An eye may move as far as is told, straight to the plane
    /// through the edge and the corner, and stays on its side of it, wherever the ends are. In the first case
    /// the normal is rounded by much more than it is long; in the second, ends that are off turn it much; in
    /// the third, they move it.
    #[test]
    fn an_eye_that_moves_as_far_as_is_told_stays_beside_the_plane() {
        let mut random = visibility_testing::Random(45);
        let mut whole = |bits: u32| (random.bits() >> (63 - bits)) as i64 - (1 << bits);
        let mut moved = [[0; 2]; 3];
        for round in 0..12_000 {
            let case = round % 3;
            let mut point = |bits: u32| [(); 3].map(|()| whole(bits));
            let plus = |p: [i64; 3], k: i64, q: [i64; 3]| [0, 1, 2].map(|i| p[i] + k * q[i]);
            let (a, part, little) = (point(20), point([34, 22, 38][case]), point([8, 9, 41][case]));
            let [b, to_eye] = [plus(a, 16, part), point([38, 30, 32][case])];
            let (eye, placed) = (plus(a, 1, to_eye), [0, 1, 64][case]);
            let q = plus(plus(a, whole(5), part), 1, little);
            let from_front = whole(1) > 0;
            let turn = if from_front { -1 } else { 1 };
            let height = |eye, [a, b]: [_; 2]| turn * volume([eye, a, b, q]);
            let metres = |p: [i64; 3]| DVec3::from_array(p.map(|x| x as f64));
            let mut edge = Edge::new([a, b].map(metres), 0, placed as f64);
            edge.update_eye(&Eye::Point(metres(eye)), 0.0, from_front);
            let before = height(eye, [a, b]);
            let is_inside = before > 0;
            let distance = edge.clearance(metres(eye), metres(q), metres(q))[usize::from(!is_inside)];
            // The exact normal, and the way from the eye to the plane.
            let [side, corner] = [b, q].map(|p| [0, 1, 2].map(|i| i128::from(p[i] - a[i])));
            let normal = [(1, 2), (2, 0), (0, 1)].map(|(i, j)| side[i] * corner[j] - side[j] * corner[i]);
            let over: i128 = (0..3).map(|i| normal[i] * i128::from(to_eye[i])).sum();
            if distance < 4.0 || over == 0 {
                continue;
            }
            let normal = DVec3::from_array(normal.map(|x| x as f64)) * -over.signum() as f64;
            let way = normal.normalize() * distance;
            let there = plus(eye, 1, way.to_array().map(|x| x.trunc() as i64));
            // Both ends towards the eye, and each way.
            let towards = normal.to_array().map(|x| -(x.signum() as i64) * placed);
            let mut off = || [(); 3].map(|()| placed * whole(1).signum());
            let shifts = [[[0; 3]; 2], [towards; 2], [towards, off()], [off(), towards], [off(), off()]];
            for shift in shifts {
                let now = height(there, [plus(a, 1, shift[0]), plus(b, 1, shift[1])]);
                assert!(
                    now.signum() == before.signum(),
                    "round {round}: {distance} from {eye:?}, of {edge:?} and {q:?}: {now} of {before}"
                );
            }
            moved[case][usize::from(is_inside)] += 1;
        }
        assert!(moved.iter().flatten().all(|&count| count > 500), "eyes that moved: {moved:?}");
    }

    /// An answer lasts no longer than the edge may be used.
    #[test]
    fn an_eye_that_moves_as_far_as_is_told_may_use_the_edge() {
        let (min, max) = (DVec3::new(3.0, -1.0, -1.0), DVec3::new(4.0, 0.5, 1.0));
        let edge = |eye: f64, placing_error| {
            let mut edge = edge(placing_error);
            edge.update_eye(&Eye::Point(DVec3::splat(eye)), 0.0, true);
            let holds = edge.holds(&Eye::Point(DVec3::splat(eye)), min, max);
            (holds, edge.clearance(DVec3::splat(eye), min, max)[0])
        };
        let (holds, free) = edge(0.0, 0.0);
        assert!(holds && free > 1.0, "an eye may move by {free} m beside an exact edge");
        // The ends may be off by 2^-25 m, which is too much from half a metre on.
        let placing_error = 0.5 * MAX_PLACING_ERROR;
        for eye in [0.0, 0.25, 0.49, 0.51] {
            let (holds, free) = edge(eye, placing_error);
            assert_eq!(holds, eye < 0.5, "an edge seen from {eye}");
            let left = (0.5 - eye).max(0.0);
            assert!((free - left).abs() < 1e-6, "an eye at {eye} may move by {free} m");
        }
    }
}
