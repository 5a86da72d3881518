//! Test of a box against the occlusion tree. The box follows one child while that is certain, and is cut in
//! two parts where it is not.
//!
//! # Why it is sound
//! A part of a box is represented by the corner directions of a convex cone. The cone contains every
//! direction of the part if each corner may be moved by the part's error. The slack is the sum of the
//! rounding bounds of a plane and of a part. A plane cuts a part at twice the slack beyond the plane on
//! either side. So each half contains all the box's directions that are exactly on that side. Directions
//! within rounding of the plane go to both halves; they are hidden only if both sides hide them, and one of
//! the sides is their own. Two shadows that share an edge therefore leave no gap, and no shadow becomes wider
//! than it is. Each cut adds four roundings to the error.

use super::nodes::{Child, MAX_LEAF_TESTS, Nodes, OUTSIDE, VISIBLE};
use crate::clip_projection::{BoxProjection, ClipProjection, U, dot, slack_of};
use visibility_core::glam::DVec3;
use visibility_core::{Aabb, occlusion::Occlusion, view::Eye};

/// Maximum number of corners of a [`Part`] of a box's projection. If a cut would make more, the box counts as
/// partially visible.
const MAX_CORNERS: usize = 24;

/// A convex part of a box's projection: the cone of view rays that the clip-space directions `(x, y, w)` of
/// its corners span.
#[derive(Clone, Copy)]
struct Part {
    /// Clip-space directions `(x, y, w)` of the part's corners, in order around its border. Only the first
    /// `count` are valid.
    corners: [[f64; 3]; MAX_CORNERS],
    /// Number of corners of the part, at most [`MAX_CORNERS`]: the valid entries in `corners`.
    count: usize,
    /// Bound on the absolute error of `n . v` for the direction `v` of any corner and any line coefficients
    /// `n` of at most 1 in magnitude.
    slack: f64,
}

/// Corner numbers of each face of a box, counter-clockwise from outside. Faces are numbered -x, +x, -y, +y,
/// -z, +z from 0; bits 0, 1 and 2 of a corner number choose max x, y and z.
const FACES: [[u8; 4]; 6] =
    [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];

/// Silhouette of a box for each set of faces turned to the eye: the corner numbers in order around the
/// silhouette, and their count. The index is a mask in which bit i stands for face i of [`FACES`]; masks with
/// two opposite faces do not occur (Schmalstieg and Tobler, "Fast Projected Area Computation for
/// Three-Dimensional Bounding Boxes", 1999).
const OUTLINES: [([u8; 6], u8); 64] = {
    let mut table = [([0; 6], 0); 64];
    let mut mask = 1;
    while mask < 64 {
        // The silhouette consists of the edges of front faces that no other front face runs along in reverse.
        // `next` leads from corner to corner along it.
        let mut next = [u8::MAX; 8];
        let mut edge = 0;
        while edge < 24 {
            let [a, b] = edge_of(edge);
            if mask >> (edge / 4) & 1 != 0 && !has_edge(mask, b, a) {
                next[a as usize] = b;
            }
            edge += 1;
        }
        let mut start = 0;
        while start < 8 && next[start] == u8::MAX {
            start += 1;
        }
        let (mut at, mut count) = (start, 0);
        while at < 8 && count < 6 && (count == 0 || at != start) {
            table[mask].0[count] = at as u8;
            count += 1;
            at = next[at] as usize;
        }
        table[mask].1 = count as u8;
        mask += 1;
    }
    table
};

/// Returns the corner numbers of the start and the end of edge `edge % 4` of face `edge / 4` of [`FACES`].
const fn edge_of(edge: usize) -> [u8; 2] {
    let face = FACES[edge / 4];
    [face[edge % 4], face[(edge + 1) % 4]]
}

/// Tests whether a face in `mask` (bit i stands for face i of [`FACES`]) has the edge from corner `a` to
/// corner `b` in this direction. False if no face in the mask has that edge, or only in the opposite
/// direction.
const fn has_edge(mask: usize, a: u8, b: u8) -> bool {
    let mut edge = 0;
    while edge < 24 {
        let [start, end] = edge_of(edge);
        if mask >> (edge / 4) & 1 != 0 && start == a && end == b {
            return true;
        }
        edge += 1;
    }
    false
}

/// State of testing one box against the occlusion tree.
struct BoxTest<'a> {
    /// The occlusion tree of the frame.
    nodes: &'a Nodes,
    /// Projection of the frame's view.
    projection: &'a ClipProjection,
    /// Minimum corner of the tested box, in metres relative to `Scene::origin`.
    min: DVec3,
    /// Maximum corner of the tested box, in metres relative to `Scene::origin`.
    max: DVec3,
    /// Mask of the faces turned to the eye, bit i for face i of [`FACES`]; 0 if that is uncertain.
    faces: usize,
    /// True once a part of the box was found surely hidden in its leaf; false so far.
    hidden: bool,
    /// True once a part of the box was found surely visible in its leaf; false so far.
    visible: bool,
}

impl Nodes {
    /// Tests a box in metres relative to `Scene::origin` against the tree. `Visible` for a box that is not
    /// finite. `Partial` for one that is not surely beyond the near plane, and wherever rounding leaves the
    /// answer open. `Hidden` for a box outside the image.
    pub(crate) fn test(&self, projection: &ClipProjection, bounds: &Aabb) -> Occlusion {
        if !bounds.is_finite() {
            return Occlusion::Visible;
        }
        if !projection.is_beyond_near(bounds) {
            return Occlusion::Partial;
        }
        // The box is first taken as the cone around it, down to the first node whose line crosses this cone.
        let Some(cone) = projection.cone(bounds) else { return Occlusion::Partial };
        let mut child = self.root;
        while let Some(node) = self.nodes.get(child as usize) {
            let (least, greatest) = cone.span(node.line.n);
            let slack = node.line.slack + cone.slack;
            if least > slack {
                child = node.children[1];
            } else if greatest < -slack {
                child = node.children[0];
            } else {
                break;
            }
        }
        match child {
            OUTSIDE => return Occlusion::Hidden,
            VISIBLE => return Occlusion::Visible,
            _ => {}
        }
        // Only from there on the box's own outline is cut by the lines of the tree, and its depth is compared
        // in the leaves.
        let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let (heights, margin) = (face_heights(projection, min, max), projection.eye_error);
        let faces = (0..6).filter(|&face| heights[face] > 0.0).fold(0, |mask, face| mask | 1 << face);
        // No face may be turned to the eye: the eye is in the box. The near plane does not tell so, if it is
        // not in front of the eye, as of a matrix that was made for another convention of depth.
        if heights.iter().all(|&height| height < -margin) {
            return Occlusion::Partial;
        }
        let certain = heights.iter().all(|height| height.abs() > margin);
        let faces = if certain { faces } else { 0 };
        let mut test = BoxTest { nodes: self, projection, min, max, faces, hidden: false, visible: false };
        let decided = if certain {
            let (outline, count) = &OUTLINES[faces];
            test.visit(child, &Part::new(&cone, &outline[..usize::from(*count)]))
        } else {
            // If it is uncertain which faces are turned to the eye, every face that may be is tested.
            (0..6).all(|face| heights[face] < -margin || test.visit(child, &Part::new(&cone, &FACES[face])))
        };
        match (decided, test.visible) {
            (false, _) => Occlusion::Partial,
            (true, false) => Occlusion::Hidden,
            (true, true) => Occlusion::Visible,
        }
    }
}

impl BoxTest<'_> {
    /// Records in `hidden` and `visible` whether a leaf hides a part of the box. Returns false if this is
    /// undecided, or if another part got the opposite answer; the box is then partially visible. A leaf
    /// outside the image records nothing.
    fn record_leaf(&mut self, leaf: Child, part: &Part) -> bool {
        let visible = match leaf {
            OUTSIDE => return true,
            VISIBLE => true,
            _ => match self.side_of(leaf, part) {
                0 => return false,
                side => side > 0,
            },
        };
        self.visible |= visible;
        self.hidden |= !visible;
        !(self.visible && self.hidden)
    }

    /// Returns -1 if the part of the box is surely behind one of the leaf's polygons, 1 if the box is surely
    /// in front of all of them, and 0 if undecided.
    fn side_of(&self, leaf: Child, part: &Part) -> i32 {
        let (mut leaf, mut all) = (leaf, 1);
        for _ in 0..MAX_LEAF_TESTS {
            let Some(hide) = self.nodes.hider(leaf) else { break };
            let plane = hide.plane as usize;
            let side = self.nodes.planes[plane].side(self.min, self.max);
            if side < 0 || side == 0 && self.is_behind(plane, part) {
                return -1;
            }
            all = all.min(side);
            leaf = hide.under;
        }
        all
    }

    /// Tests whether a part of the box is surely behind back plane number `plane`, which crosses the box.
    /// True if, along each view ray of the part, the back plane surely comes before the plane of one and the
    /// same front face of the box. A ray enters a box only after it has met the planes of all front faces, so
    /// the back plane then comes before the box. False if undecided.
    fn is_behind(&self, plane: usize, part: &Part) -> bool {
        let Some(first) = &self.nodes.approaches[plane] else { return false };
        (0..6).filter(|face| self.faces >> face & 1 != 0).any(|face| {
            let axis = face / 2;
            let (sign, offset) = if face % 2 == 0 { (-1.0, self.min[axis]) } else { (1.0, -self.max[axis]) };
            let mut normal = DVec3::ZERO;
            normal[axis] = sign;
            let second = self.projection.approach(normal, offset);
            second.is_some_and(|second| {
                self.projection.is_met_first(first, &second, &part.corners[..part.count], part.slack)
            })
        })
    }

    /// Tests a part of the box against the subtree `child` and records the leaves that it reaches. Returns
    /// false as soon as the box is known to be partially visible, or the answer cannot be decided.
    fn visit(&mut self, child: Child, part: &Part) -> bool {
        if part.count == 0 {
            return true;
        }
        let mut child = child;
        loop {
            let Some(node) = self.nodes.nodes.get(child as usize) else {
                return self.record_leaf(child, part);
            };
            let slack = node.line.slack + part.slack;
            let (mut least, mut greatest) = (f64::INFINITY, f64::NEG_INFINITY);
            let mut values = [0.0; MAX_CORNERS];
            for (value, corner) in values.iter_mut().zip(&part.corners[..part.count]) {
                *value = dot(node.line.n, *corner);
                least = least.min(*value);
                greatest = greatest.max(*value);
            }
            if least > slack {
                child = node.children[1];
            } else if greatest < -slack {
                child = node.children[0];
            } else {
                let mut half = Part::empty(part.slack + slack_of(4.0 * U));
                return part.beyond(&values, -1.0, -2.0 * slack, &mut half)
                    && self.visit(node.children[0], &half)
                    && part.beyond(&values, 1.0, -2.0 * slack, &mut half)
                    && self.visit(node.children[1], &half);
            }
        }
    }
}

impl Part {
    /// Creates a part without corners, for which `slack` bounds the absolute error of `n . v`, the value of a
    /// line with coefficients `n` at a corner's direction `v`.
    fn empty(slack: f64) -> Self {
        Self { corners: [[0.0; 3]; MAX_CORNERS], count: 0, slack }
    }

    /// Creates the part outlined by the corners `numbers` of a projected box, in boundary order. Bits 0, 1
    /// and 2 of a corner number choose max x, y and z.
    fn new(cone: &BoxProjection, numbers: &[u8]) -> Self {
        let mut part = Self { count: numbers.len(), ..Self::empty(cone.slack) };
        for (corner, &number) in part.corners.iter_mut().zip(numbers) {
            *corner = cone.corner(usize::from(number));
        }
        part
    }

    /// Clips the part by a plane through the eye and stores the corners of the result in `out`. `values` are
    /// the plane's values at this part's corners. The result is where the value times `sign` is at least
    /// `limit`. The slack of `out` is left to the caller. Returns false if `out` would get more than
    /// [`MAX_CORNERS`] corners.
    fn beyond(&self, values: &[f64; MAX_CORNERS], sign: f64, limit: f64, out: &mut Self) -> bool {
        let mut count = 0;
        let mut j = self.count - 1;
        let mut db = values[j] * sign - limit;
        for (i, value) in values.iter().enumerate().take(self.count) {
            let da = value * sign - limit;
            if count + 2 > MAX_CORNERS {
                return false;
            }
            if (da >= 0.0) != (db >= 0.0) {
                let (a, b) = (self.corners[i], self.corners[j]);
                let t = da / (da - db);
                let s = 1.0 - t;
                out.corners[count] = [a[0] * s + b[0] * t, a[1] * s + b[1] * t, a[2] * s + b[2] * t];
                count += 1;
            }
            if da >= 0.0 {
                out.corners[count] = self.corners[i];
                count += 1;
            }
            (j, db) = (i, da);
        }
        out.count = count;
        true
    }
}

/// Returns the heights in metres of the eye above the six faces of the box from `min` to `max`, in the order
/// of [`FACES`]. A face is turned to the eye if its height is positive. For parallel views, the heights are
/// the cosines between the faces' normals and the direction to the eye. A height whose magnitude exceeds the
/// eye's error has the sign of the exact height, since differences are rounded to the nearest number.
fn face_heights(projection: &ClipProjection, min: DVec3, max: DVec3) -> [f64; 6] {
    let (below, above) = match projection.eye {
        Eye::Point(eye) => (min - eye, eye - max),
        Eye::Direction(along) => (along, -along),
    };
    [below.x, above.x, below.y, above.y, below.z, above.z]
}

#[cfg(test)]
mod tests {
    use super::super::nodes::{HIDDEN, Hider};
    use super::*;
    use crate::clip_projection::Line;
    use crate::shadow::BackPlane;

    /// Returns a tree of two nodes: a plane with the coefficients `n` and the given slack, and above it the
    /// plane y = 0, both sides of which lead to the first.
    fn tree(n: [f64; 3], slack: f64, children: [Child; 2]) -> Nodes {
        let mut nodes = Nodes::default();
        nodes.clear();
        (nodes.nodes[0].line, nodes.nodes[0].children) = (Line { n, slack }, children);
        (nodes.nodes[1].line, nodes.nodes[1].children) = (Line { n: [0.0, 1.0, 0.0], slack: 0.0 }, [0, 0]);
        nodes
    }

    #[test]
    fn boxes_within_the_slack_of_a_plane_are_on_both_of_its_sides() {
        for (slack, row_error) in [(0.01, 0.0), (0.0, 5e-8)] {
            let projection = ClipProjection::along_z(0.0, 0.0, 0.0, row_error);
            let total = slack + 3.125 * row_error;
            for (share, expected) in [
                (0.98, Occlusion::Visible),
                (0.48, Occlusion::Visible),
                (-1.0, Occlusion::Visible),
                (1.02, Occlusion::Hidden),
            ] {
                for side in [1.0, -1.0] {
                    let children = if side > 0.0 { [VISIBLE, OUTSIDE] } else { [OUTSIDE, VISIBLE] };
                    let mut nodes = tree([1.0, 0.0, 0.0], slack, children);
                    let ends = [side * share * total, side * 4.0 * total].map(|x| x as f32);
                    let bounds = Aabb::from_arrays(
                        [ends[0].min(ends[1]), -0.1, 1.0],
                        [ends[0].max(ends[1]), 0.1, 1.0],
                    );
                    for root in [0, 1] {
                        nodes.root = root;
                        assert_eq!(
                            nodes.test(&projection, &bounds),
                            expected,
                            "{share} of the slack {total}, side {side}, root {root}"
                        );
                    }
                }
            }
        }
    }

    /// Returns the tree whose plane x = 0 has a leaf behind the plane z = 2 on its inner side.
    fn behind_two_metres(projection: &ClipProjection, outside: Option<Child>) -> Nodes {
        let mut nodes = tree([1.0, 0.0, 0.0], 0.0, [outside.unwrap_or(HIDDEN), HIDDEN]);
        nodes.planes.push(BackPlane { normal: DVec3::NEG_Z, offset: 2.0 });
        nodes.approaches.push(projection.approach(DVec3::NEG_Z, 2.0));
        nodes.hiders.push(Hider { plane: 0, under: VISIBLE });
        nodes
    }

    #[test]
    fn a_box_is_hidden_where_it_is_behind_in_all_leaves_and_visible_where_before() {
        let box_at = |low: f32, high: f32| Aabb::from_arrays([-0.1, -0.1, low], [0.1, 0.1, high]);
        // If it is not known which faces are turned to the eye, each is tested.
        for eye_error in [0.0, 0.2] {
            let projection = ClipProjection::along_z(0.0, 0.0, eye_error, 0.0);
            let nodes = behind_two_metres(&projection, None);
            for (low, high, expected) in [
                (3.0, 4.0, Occlusion::Hidden),
                (1.0, 1.5, Occlusion::Visible),
                (1.9, 2.1, Occlusion::Partial),
            ] {
                let answer = nodes.test(&projection, &box_at(low, high));
                assert_eq!(answer, expected, "from {low} to {high}, eye known to {eye_error}");
            }
            let nodes = behind_two_metres(&projection, Some(VISIBLE));
            let answer = nodes.test(&projection, &box_at(3.0, 4.0));
            assert_eq!(answer, Occlusion::Partial, "one half hidden, eye known to {eye_error}");
            let nodes = behind_two_metres(&projection, Some(OUTSIDE));
            let answer = nodes.test(&projection, &box_at(3.0, 4.0));
            assert_eq!(answer, Occlusion::Hidden, "one half outside, eye known to {eye_error}");
        }
    }

    /// The eye is 0.15 m beside where it is believed to be, so that it sees the right side of a box.
    #[test]
    fn faces_that_may_be_turned_to_the_eye_are_tested() {
        let bounds = Aabb::from_arrays([-0.3, -0.1, 3.0], [0.1, 0.1, 4.0]);
        for (known_at, eye_error) in [(0.15, 0.01), (0.0, 0.16)] {
            let projection = ClipProjection::along_z(0.15, known_at, eye_error, 0.0);
            // Only the right side of the box is beyond this plane.
            let mut nodes = tree([1.0, 0.0, 0.0155], 0.0, [OUTSIDE, VISIBLE]);
            nodes.root = 0;
            assert_ne!(nodes.test(&projection, &bounds), Occlusion::Hidden, "eye known to {eye_error}");
        }
    }

    /// A leaf's plane is met before the front face along a ray, but not where the ray may be.
    #[test]
    fn a_part_is_behind_a_plane_only_wherever_its_rays_are() {
        let projection = ClipProjection::along_z(0.0, 0.0, 0.0, 0.0);
        let slack = 0.01;
        let mut nodes = Nodes::default();
        for (share, expected) in [(0.98, false), (6.0, true)] {
            // At x = 0 the plane is this much nearer than the face in z = 3, and each metre in x takes one.
            let nearer = 3.0 * slack * share;
            let normal = DVec3::new(-1.0, 0.0, -1.0).normalize();
            let offset = (3.0 - nearer) * 0.5f64.sqrt();
            nodes.approaches = [projection.approach(normal, offset)].into();
            nodes.planes = [BackPlane { normal, offset }].into();
            nodes.hiders = [Hider { plane: 0, under: VISIBLE }].into();
            let (min, max) = (DVec3::new(-1.0, -0.1, 3.0), DVec3::new(0.1, 0.1, 4.0));
            let test = BoxTest {
                nodes: &nodes,
                projection: &projection,
                min,
                max,
                faces: 1 << 4,
                hidden: false,
                visible: false,
            };
            let mut part = Part { count: 1, ..Part::empty(slack) };
            part.corners[0] = [0.0, 0.0, 1.0];
            assert_eq!(test.is_behind(0, &part), expected, "{share} of what the ray's error takes");
            assert_eq!(test.side_of(HIDDEN, &part), if expected { -1 } else { 0 }, "{share}: in the leaf");
        }
    }

    #[test]
    fn both_halves_of_a_box_are_looked_for() {
        let projection = ClipProjection::along_z(0.0, 0.0, 0.0, 0.0);
        let bounds = Aabb::from_arrays([-0.1, -0.1, 1.0], [0.1, 0.1, 1.0]);
        for side in [1.0, -1.0] {
            // All but the part beyond y = 0.05 on one side is outside.
            let mut nodes = tree([0.0, side, -0.05], 0.0, [OUTSIDE, VISIBLE]);
            nodes.nodes[1].children = if side > 0.0 { [OUTSIDE, 0] } else { [0, OUTSIDE] };
            nodes.root = 1;
            assert_eq!(nodes.test(&projection, &bounds), Occlusion::Visible, "side {side}");
        }
    }
}
