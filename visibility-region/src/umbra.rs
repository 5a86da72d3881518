//! The umbra of one convex blocker: the region that the blocker alone hides from every point of a box.
//!
//! From one viewpoint, a convex blocker hides the points inside the cone through its outline and behind its
//! front faces. If an object's box lies in that region for each corner of the viewcell's box, the blocker
//! hides the object from the whole viewcell, which must not meet the blocker (Cohen-Or, Fibich, Halperin and
//! Zadicario, "Conservative Visibility and Strong Occlusion for Viewspace Partitioning of Densely Occluded
//! Scenes", 1998). The reason: for a fixed point behind the blocker, the lines of sight through the blocker's
//! inside come from a convex set, which contains the corners of the viewcell and so all of it.

use crate::blocker::Blocker;
use alloc::vec::Vec;
use visibility_core::Aabb;
use visibility_core::geometry::Containment;
use visibility_core::glam::DVec3;

/// Unit round-off of `f64`, 2^-53.
const U: f64 = f64::EPSILON / 2.0;

/// The open half-space of the points `x` with `det(u, v, x - anchor) > 0`. The points `anchor`, `anchor + u`
/// and `anchor + v` are in its boundary plane.
#[derive(Clone, Copy, Debug)]
struct Side {
    anchor: DVec3,
    /// Cross product of `u` and `v`, normal to the boundary plane.
    normal: DVec3,
    /// Greatest magnitude of a coordinate of `u`, and of a coordinate of `v`.
    sizes: [f64; 2],
}

impl Side {
    fn new(anchor: DVec3, u: DVec3, v: DVec3) -> Self {
        let (u, v) = (u - anchor, v - anchor);
        Self { anchor, normal: u.cross(v), sizes: [u.abs().max_element(), v.abs().max_element()] }
    }

    /// Returns `Inside` if the box from `min` to `max` is certainly within the half-space, `Outside` if
    /// certainly no point of it is, otherwise `Crossing`. `slack` bounds the error, in metres, of each
    /// coordinate of the points that span the plane.
    ///
    /// # Rounding
    /// Let e be the unit round-off of `f64`, and U, V and W the greatest magnitudes of the coordinates of
    /// `u`, `v` and `x - anchor`, for all corners `x` of the box. The determinant is computed as in
    /// `sampling/ray.rs`, with an error below 44 e U V W: there, `d` with `|d| <= 1` takes the place of `x -
    /// anchor`. The corner is chosen by the signs of a normal that errs by 8.3 e U V on each axis, so
    /// another corner is lower by less than 25 e U V W. The margin is 128 e U V W. Vertices with an error of
    /// `slack` change each of `u`, `v` and `x - anchor` by 2 slack on an axis, and the determinant by 12
    /// slack (V W + U W + U V), to first order. The margin has 16 instead of 12, which also holds what is of
    /// higher order: if slack is a quarter of U, V or W or more, 16 slack (V W + U W + U V) is at least 4 U
    /// V W, the greatest determinant of such vectors, and nothing is certain; if it is less, terms of higher
    /// order are below slack (4 U W + 5 U V), and those of first order below slack (8 V W + 8 U W + 4 U V),
    /// since a determinant is at most 4 times the product of the greatest magnitudes of its rows.
    fn classify(&self, min: DVec3, max: DVec3, slack: f64) -> Containment {
        let [u, v] = self.sizes;
        let (min, max) = (min - self.anchor, max - self.anchor);
        let w = min.abs().max(max.abs()).max_element();
        let positive = self.normal.cmpge(DVec3::ZERO);
        let least = self.normal.dot(DVec3::select(positive, min, max));
        let most = self.normal.dot(DVec3::select(positive, max, min));
        let margin = 128.0 * U * u * v * w + 16.0 * slack * (v * w + u * w + u * v) + f64::MIN_POSITIVE;
        if least > margin {
            Containment::Inside
        } else if most < -margin {
            Containment::Outside
        } else {
            Containment::Crossing
        }
    }
}

/// Returns, for each face of a blocker, the open half-space behind the face.
fn behind(blocker: &Blocker) -> impl Iterator<Item = Side> + '_ {
    let vertex = |corner: usize| blocker.vertices[blocker.corners[corner] as usize];
    blocker
        .faces
        .iter()
        .map(move |face| Side::new(vertex(face.start), vertex(face.start + 2), vertex(face.start + 1)))
}

/// Returns whether a blocker occludes from the box from `min` to `max` as if it had no hole: the box is
/// certainly strictly behind the planes of all its caps. True for a blocker without caps.
pub(crate) fn is_closed_from(blocker: &Blocker, min: DVec3, max: DVec3) -> bool {
    let is_behind = |[a, b, c]: &[DVec3; 3]| {
        Side::new(*a, *c, *b).classify(min, max, blocker.slack) == Containment::Inside
    };
    blocker.caps.iter().all(is_behind)
}

/// The region that a blocker hides from a box of viewpoints: an intersection of open half-spaces.
#[derive(Clone, Debug)]
pub(crate) struct Umbra {
    sides: Vec<Side>,
    slack: f64,
}

impl Umbra {
    /// Computes the umbra of a blocker from the box from `min` to `max`. `None` in two cases: there is no
    /// face that the whole box is certainly in front of, so the box may meet the blocker; or the box is not
    /// certainly strictly behind the triangles that close the blocker's hole.
    pub(crate) fn new(blocker: &Blocker, min: DVec3, max: DVec3) -> Option<Self> {
        let (Blocker { vertices, faces, corners, .. }, slack) = (blocker, blocker.slack);
        if !is_closed_from(blocker, min, max) {
            return None;
        }
        let behind: Vec<Side> = behind(blocker).collect();
        // The whole box must be outside of the blocker. It is not enough that all corners are: the blocker
        // may pass between them, and a viewpoint inside the blocker sees what is inside.
        if !behind.iter().any(|side| side.classify(min, max, slack) == Containment::Outside) {
            return None;
        }
        let mut is_ever_front = alloc::vec![false; faces.len()];
        let mut edges: Vec<(u32, u32)> = Vec::new();
        let mut sides = Vec::new();
        for corner in 0..8 {
            let at = |bit: usize, axis: usize| if corner >> bit & 1 != 0 { max[axis] } else { min[axis] };
            let eye = DVec3::new(at(0, 0), at(1, 1), at(2, 2));
            edges.clear();
            for (index, face) in faces.iter().enumerate() {
                let is_front = behind[index].normal.dot(eye - behind[index].anchor) < 0.0;
                is_ever_front[index] |= is_front;
                if is_front {
                    let next = |i: usize| if i + 1 == face.end { face.start } else { i + 1 };
                    edges.extend(face.clone().map(|i| (corners[i], corners[next(i)])));
                }
            }
            // The outline consists of edges of front faces that no other front face runs along in the
            // opposite direction. The cone is the intersection of the sides of its edges. It does not matter
            // whether rounding has taken a face for a front or not: the outline winds around a direction that
            // is on the inner side of all its edges at least once, and its winding number is the number of
            // faces that show their fronts there, less those that show their backs. So the line of sight
            // meets a front. That the point is behind this front is certain by the sides added last, and the
            // face that the whole box is in front of is a front for each corner. The line meets the front
            // ahead of the eye and not behind it: the eye is certainly before that face, the point certainly
            // behind it, and the whole solid is behind it too, so the half of the line that runs backwards
            // from the eye meets no face.
            edges.sort_unstable();
            for &(from, to) in &edges {
                if edges.binary_search(&(to, from)).is_err() {
                    sides.push(Side::new(eye, vertices[to as usize], vertices[from as usize]));
                }
            }
        }
        let ever = behind.iter().zip(&is_ever_front).filter(|(_, front)| **front);
        sides.extend(ever.map(|(side, _)| *side));
        Some(Self { sides, slack })
    }

    /// Returns the interior of a convex polyhedron: the intersection of the open half-spaces behind its
    /// faces.
    #[cfg(feature = "papers")]
    pub(crate) fn interior(blocker: &Blocker) -> Self {
        Self { sides: behind(blocker).collect(), slack: blocker.slack }
    }

    /// Classifies a box: `Inside` if all of it is certainly in the umbra, hidden strictly behind the blocker;
    /// `Outside` if certainly no point of it is in the umbra; `Crossing` if neither is certain, and for an
    /// improper box.
    pub(crate) fn classify(&self, bounds: &Aabb) -> Containment {
        if !bounds.is_proper() {
            return Containment::Crossing;
        }
        self.classify_box(bounds.min.as_dvec3(), bounds.max.as_dvec3())
    }

    /// Classifies the box from `min` to `max`, relative to the scene's origin, as
    /// [`classify`](Self::classify) does.
    pub(crate) fn classify_box(&self, min: DVec3, max: DVec3) -> Containment {
        let mut result = Containment::Inside;
        for side in &self.sides {
            match side.classify(min, max, self.slack) {
                Containment::Inside => {}
                Containment::Crossing => result = Containment::Crossing,
                Containment::Outside => return Containment::Outside,
            }
        }
        result
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_testing::Random;

    fn unit_cell() -> (DVec3, DVec3) {
        (DVec3::splat(-0.5), DVec3::splat(0.5))
    }

    fn umbra_of_wall() -> Umbra {
        let wall = Blocker::cuboid(DVec3::new(3.0, -2.0, -2.0), DVec3::new(4.0, 2.0, 2.0));
        let (min, max) = unit_cell();
        Umbra::new(&wall, min, max).unwrap()
    }

    /// Points of one plane, whose determinant is not zero once it is rounded, are on neither side.
    #[test]
    fn points_of_a_plane_are_on_neither_side_of_it() {
        let mut random = Random(1);
        let mut rounded = [0; 2];
        for round in 0..20_000 {
            // Coordinates are integers below 2^41, so they and their differences are exact.
            let whole = |random: &mut Random| random.fine_vector(1e6).round();
            let (u, v) = (whole(&mut random), whole(&mut random));
            let [a, b, c, x] = core::array::from_fn(|_| {
                u * random.fine_range(-1e5, 1e5).round() + v * random.fine_range(-1e5, 1e5).round()
            });
            let side = Side::new(a, b, c);
            let found = side.classify(x, x, 0.0);
            assert_eq!(found, Containment::Crossing, "round {round}: the points {a} {b} {c} {x}");
            let distance = side.normal.dot(x - a);
            rounded[0] += usize::from(distance > 0.0);
            rounded[1] += usize::from(distance < 0.0);
        }
        assert!(rounded.iter().all(|&count| count > 5_000), "{rounded:?} determinants are no test");
    }

    /// Planes through points that are off by the slack: at (1, 1), such a plane is off by three times that.
    #[test]
    fn sides_hold_for_planes_of_points_off_by_the_slack() {
        for slack in [1e-9, 1e-3] {
            let side = Side::new(DVec3::ZERO, DVec3::X, DVec3::Y);
            for (height, may_be) in [
                (2.9 * slack, Containment::Crossing),
                (-2.9 * slack, Containment::Crossing),
                (50.0 * slack, Containment::Inside),
                (-50.0 * slack, Containment::Outside),
            ] {
                let x = DVec3::new(1.0, 1.0, height);
                assert_eq!(side.classify(x, x, slack), may_be, "{height} m off, slack {slack}");
            }
        }
        // A plane through points that nothing is known about.
        let side = Side::new(DVec3::ZERO, DVec3::X, DVec3::Y);
        for slack in [0.25, 1.0, 1e9] {
            let found = side.classify(DVec3::ONE, DVec3::ONE, slack);
            assert_eq!(found, Containment::Crossing, "points within {slack} m");
        }
    }

    /// The wall may end a centimetre sooner than its vertices say, and all its caps may be elsewhere.
    #[test]
    fn umbrae_hold_for_blockers_off_by_the_slack() {
        let (min, max) = (DVec3::new(3.0, -2.0, -2.0), DVec3::new(4.0, 2.0, 2.0));
        let slack = 0.01;
        let wall = Blocker { slack, ..Blocker::cuboid(min, max) };
        let (from, to) = unit_cell();
        let umbra = Umbra::new(&wall, from, to).unwrap();
        // Lines of sight past the edge of the smaller wall, as in the test above.
        let half = 2.0 - slack + (1.5 - slack) / (3.5 + slack) * (3.0 - slack);
        let boxed =
            |half: f64| umbra.classify_box(DVec3::new(6.0, -half, -half), DVec3::new(6.5, half, half));
        assert_eq!(boxed(half + 1e-9), Containment::Crossing, "a box that the smaller wall leaves visible");
        assert_eq!(boxed(1.0), Containment::Inside, "a box behind the middle of the wall");
        // The cell is before the wall's front by less than the slack, and passes the wall on both sides: all
        // of its corners are clear of the wall, which may still reach into it.
        let around = |x: f64| {
            let (from, to) = (DVec3::new(0.0, -3.0, -3.0), DVec3::new(x, 3.0, 3.0));
            Umbra::new(&wall, from, to).is_none()
        };
        assert!(around(2.995), "a cell that the wall may reach into");
        assert!(!around(1.0), "a cell that is clear of the wall");
        // A cap before the cell by less than the slack.
        let cap = |x: f64| [DVec3::new(x, -9.0, -9.0), DVec3::new(x, 0.0, 9.0), DVec3::new(x, 9.0, -9.0)];
        for (x, is_closed) in [(0.505, false), (-0.505, false), (-9.0, true), (9.0, false)] {
            let capped = Blocker { caps: alloc::vec![cap(x)], ..wall.clone() };
            assert_eq!(is_closed_from(&capped, from, to), is_closed, "a cap at {x}");
        }
    }

    #[test]
    fn the_umbra_widens_behind_a_wall_larger_than_the_cell() {
        let umbra = umbra_of_wall();
        // Of the lines from viewpoints past the edge at x = 3, y = 2, the lowest begins at x = -0.5, y = 0.5.
        let slope: f64 = 1.5 / 3.5;
        let half = 2.0 + slope * 3.0;
        let boxed = |half: f64| (DVec3::new(6.0, -half, -half), DVec3::new(6.5, half, half));
        let (min, max) = boxed(half - 1e-9);
        assert_eq!(umbra.classify_box(min, max), Containment::Inside, "a box within the umbra by 1e-9 m");
        let (min, max) = boxed(half + 1e-9);
        assert_eq!(
            umbra.classify_box(min, max),
            Containment::Crossing,
            "a box that leaves the umbra by 1e-9 m"
        );
        assert_eq!(
            umbra.classify_box(DVec3::new(-5.0, 0.0, 0.0), DVec3::new(-4.0, 1.0, 1.0)),
            Containment::Outside,
            "a box on the viewcell's side of the wall"
        );
    }

    #[test]
    fn what_touches_the_front_is_not_hidden() {
        let umbra = umbra_of_wall();
        let tile = |x: f64| umbra.classify_box(DVec3::new(x, 0.0, 0.0), DVec3::new(x + 0.5, 0.5, 0.5));
        assert_eq!(tile(3.0), Containment::Crossing, "in the plane of the front");
        assert_eq!(tile(3.0 + 1e-12), Containment::Inside, "inside the wall");
    }

    #[test]
    fn cells_in_or_beside_a_blocker_give_no_umbra() {
        let wall = Blocker::cuboid(DVec3::new(3.0, -2.0, -2.0), DVec3::new(4.0, 2.0, 2.0));
        let inside = |min: [f64; 3], max: [f64; 3]| Umbra::new(&wall, min.into(), max.into()).is_none();
        assert!(inside([3.2, 0.0, 0.0], [3.4, 1.0, 1.0]), "a cell within the wall");
        assert!(inside([2.0, 0.0, 0.0], [3.5, 1.0, 1.0]), "a cell that reaches into the wall");
        assert!(inside([2.0, 0.0, 0.0], [3.0, 1.0, 1.0]), "a cell that touches the wall");
        assert!(inside([2.0, 0.0, 0.0], [5.0, 1.0, 1.0]), "a cell that the wall passes through");
    }

    /// Points of a plane that is steep along x, in boxes that end at the anchor along that axis: no box is on
    /// a side of the plane that one of its points is not on. Compared in integers.
    #[test]
    fn boxes_that_end_at_the_anchor_are_on_no_side_that_rounding_tells() {
        let mut random = Random(2);
        let mut counts = [0; 2];
        for round in 0..20_000 {
            let mut number = |bits: u32| i128::from(random.bits() >> (64 - bits)) + 1;
            let (a, b) = (number(30), number(30));
            let (u, v) = ([number(20), a, b], [number(20), a + number(2), b + number(2)]);
            let n = [1, 2, 0].map(|i| u[i] * v[(i + 1) % 3] - u[(i + 1) % 3] * v[i]);
            let divisor = {
                let (mut p, mut q) = (n[0].abs(), n[1].abs());
                while q != 0 {
                    (p, q) = (q, p % q);
                }
                p
            };
            if divisor == 0 {
                continue;
            }
            // A point of the plane, and the anchor's x: the box has the coordinates of both.
            let point = [n[1] / divisor, -n[0] / divisor];
            if point.iter().any(|x| x.abs() >= 1 << 52) {
                continue;
            }
            let real = |p: [i128; 3]| DVec3::from(p.map(|x| x as f64));
            let side = Side::new(DVec3::ZERO, real(u), real(v));
            for off in [-1, 0, 1] {
                let x = point[0] + off;
                let ends = [[x.min(0), point[1], 0], [x.max(0), point[1], 0]];
                let heights = ends.map(|end| (0..3).map(|k| n[k] * end[k]).sum::<i128>());
                let found = side.classify(real(ends[0]), real(ends[1]), 0.0);
                let is_right = match found {
                    Containment::Inside => heights.iter().all(|&height| height > 0),
                    Containment::Outside => heights.iter().all(|&height| height < 0),
                    Containment::Crossing => true,
                };
                assert!(is_right, "round {round}: {found:?} of {ends:?} with heights {heights:?}");
                counts[usize::from(heights[0] * heights[1] > 0)] += 1;
            }
        }
        assert!(counts.iter().all(|&count| count > 1_000), "across the plane and beside it: {counts:?}");
    }
}
