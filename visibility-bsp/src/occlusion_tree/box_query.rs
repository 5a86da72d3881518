//! Boxes against the tree: down one side while that is certain, in two parts where it is not.
//!
//! # Why it is sound
//! Parts of a box are kept as the corners of a convex set whose cone holds every direction that the part has,
//! when each corner may be moved by the part's error. A plane parts it at twice the slack beyond itself to
//! either side, so that each part holds all the box's directions that are exactly on that side, and those
//! within rounding of the plane go both ways: they are hidden only if both sides say so, and one of them is
//! theirs. So two shadows that share an edge leave no gap, and none is wider than it is. Each cut adds four
//! roundings to the error.

use super::nodes::{AWAY, Child, HIDDEN, LIT, MOST_PLANES, Nodes};
use crate::clip_projection::{BoxProjection, ClipProjection, U, dot, slack_of};
use visibility_core::glam::DVec3;
use visibility_core::{Aabb, occlusion::Occlusion, view::Eye};

/// Maximum number of corners of a part of a box. A part that would get more counts as visible in part.
const MOST: usize = 24;

/// Whether parts of a box reached leaves that hide them, and leaves that do not.
#[derive(Clone, Copy, Debug, Default)]
struct Found {
    hidden: bool,
    lit: bool,
}

/// A convex part of a box's outline: directions of its corners, and the bound on the error of `n . v` for
/// them.
#[derive(Clone, Copy)]
struct Part {
    corners: [[f64; 3]; MOST],
    count: usize,
    slack: f64,
}

/// Each face of a box by the numbers of its corners, counter-clockwise from outside: -x, +x, -y, +y, -z, +z.
const FACES: [[u8; 4]; 6] =
    [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];

/// For each set of faces that an eye can be before, by mask, the corners of the outline in order, and how
/// many they are (Schmalstieg and Tobler, "Fast Projected Area Computation for Three-Dimensional Bounding
/// Boxes", 1999).
const OUTLINES: [([u8; 6], u8); 64] = {
    let mut table = [([0; 6], 0); 64];
    let mut mask = 1;
    while mask < 64 {
        // Edges of front faces whose other way round is in no front face lead from corner to corner around
        // the outline.
        let mut next = [u8::MAX; 8];
        let mut face = 0;
        while face < 6 {
            let mut i = 0;
            while mask >> face & 1 != 0 && i < 4 {
                let (a, b) = (FACES[face][i], FACES[face][(i + 1) % 4]);
                let mut shared = false;
                let mut other = 0;
                while other < 6 {
                    let mut j = 0;
                    while mask >> other & 1 != 0 && j < 4 {
                        shared |= FACES[other][j] == b && FACES[other][(j + 1) % 4] == a;
                        j += 1;
                    }
                    other += 1;
                }
                if !shared {
                    next[a as usize] = b;
                }
                i += 1;
            }
            face += 1;
        }
        let mut start = 0;
        while start < 8 && next[start] == u8::MAX {
            start += 1;
        }
        let mut at = start;
        let mut count = 0;
        while at < 8 && count < 6 {
            table[mask].0[count] = at as u8;
            count += 1;
            at = next[at] as usize;
            if at == start {
                break;
            }
        }
        table[mask].1 = count as u8;
        mask += 1;
    }
    table
};

/// The test of one box.
struct Walk<'a> {
    nodes: &'a Nodes,
    projection: &'a ClipProjection,
    min: DVec3,
    max: DVec3,
    /// Mask of the faces that the eye is before.
    faces: usize,
    found: Found,
}

impl Nodes {
    /// Tests a box against the tree.
    pub(crate) fn test(&self, projection: &ClipProjection, bounds: &Aabb) -> Occlusion {
        if !bounds.is_finite() {
            return Occlusion::Visible;
        }
        if !projection.is_beyond_near(bounds) {
            return Occlusion::Partial;
        }
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
            AWAY => return Occlusion::Hidden,
            LIT => return Occlusion::Visible,
            _ => {}
        }
        let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let mut walk = Walk { nodes: self, projection, min, max, faces: 0, found: Found::default() };
        let whole = match faces_before(projection, min, max) {
            Some(faces) => {
                walk.faces = faces;
                let (outline, count) = &OUTLINES[faces];
                walk.visit(child, &Part::new(&cone, &outline[..usize::from(*count)]))
            }
            // Where it is not certain which faces the eye is before, all that it may be.
            None => (0..6).all(|face| {
                !may_be_before(projection, face, min, max)
                    || walk.visit(child, &Part::new(&cone, &FACES[face]))
            }),
        };
        walk.found.verdict(whole)
    }
}

impl Walk<'_> {
    /// Notes whether a leaf hides a part. False if it neither hides nor surely shows it, or if another part
    /// had the other answer: the box is then visible in part.
    fn look(&mut self, leaf: Child, part: &Part) -> bool {
        let lit = match leaf {
            AWAY => return true,
            LIT => true,
            _ => match self.side_of(leaf, part) {
                0 => return false,
                side => side > 0,
            },
        };
        self.found.lit |= lit;
        self.found.hidden |= !lit;
        !(self.found.lit && self.found.hidden)
    }

    /// Whether a part of a box is hidden in a leaf (`-1`), before all that hides there (`1`) or neither.
    fn side_of(&self, leaf: Child, part: &Part) -> i32 {
        let (mut leaf, mut all) = (leaf, 1);
        for _ in 0..MOST_PLANES {
            let Some(hide) = self.nodes.hides.get((leaf & !HIDDEN) as usize).filter(|_| leaf < AWAY) else {
                break;
            };
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

    /// Whether a part of a box that itself is on both sides of a plane is behind it: if along each of its
    /// lines of sight, the plane comes before the plane of one of the faces that the box is entered by, which
    /// is no farther than where it is entered.
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

    /// Tests a part of a box against a child and all below. False as soon as the box is known to be visible
    /// in part.
    fn visit(&mut self, child: Child, part: &Part) -> bool {
        if part.count == 0 {
            return true;
        }
        let mut child = child;
        loop {
            let Some(node) = self.nodes.nodes.get(child as usize) else {
                return self.look(child, part);
            };
            let slack = node.line.slack + part.slack;
            let (mut least, mut greatest) = (f64::INFINITY, f64::NEG_INFINITY);
            let mut values = [0.0; MOST];
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

impl Found {
    fn verdict(self, whole: bool) -> Occlusion {
        match (whole, self.hidden, self.lit) {
            (false, ..) | (true, true, true) => Occlusion::Partial,
            (true, _, false) => Occlusion::Hidden,
            (true, false, true) => Occlusion::Visible,
        }
    }
}

impl Part {
    fn empty(slack: f64) -> Self {
        Self { corners: [[0.0; 3]; MOST], count: 0, slack }
    }

    fn new(cone: &BoxProjection, numbers: &[u8]) -> Self {
        let mut part = Self { count: numbers.len(), ..Self::empty(cone.slack) };
        for (corner, &number) in part.corners.iter_mut().zip(numbers) {
            *corner = cone.corner(usize::from(number));
        }
        part
    }

    /// Puts what of it is where `sign * value >= limit` into another, whose slack is that of a cut more;
    /// false if that has too many corners.
    fn beyond(&self, values: &[f64; MOST], sign: f64, limit: f64, out: &mut Self) -> bool {
        let mut count = 0;
        let mut j = self.count - 1;
        let mut db = values[j] * sign - limit;
        for (i, value) in values.iter().enumerate().take(self.count) {
            let da = value * sign - limit;
            if count + 2 > MOST {
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

/// Mask of the faces that the eye is before, `None` if that is uncertain for any of the six.
fn faces_before(projection: &ClipProjection, min: DVec3, max: DVec3) -> Option<usize> {
    let mut mask = 0;
    let certain = match projection.eye {
        Eye::Point(eye) => {
            let mut certain = true;
            for axis in 0..3 {
                let error = projection.eye_error;
                let (below, above) = (min[axis] - eye[axis], eye[axis] - max[axis]);
                // The differences are rounded by less than the error is.
                mask |= usize::from(below > 0.0) << (2 * axis) | usize::from(above > 0.0) << (2 * axis + 1);
                certain &= below.abs() > 2.0 * error && above.abs() > 2.0 * error;
            }
            certain
        }
        Eye::Direction(along) => {
            let mut certain = true;
            for axis in 0..3 {
                mask |= usize::from(along[axis] > 0.0) << (2 * axis)
                    | usize::from(along[axis] < 0.0) << (2 * axis + 1);
                certain &= along[axis].abs() > 2.0 * projection.eye_error + 8.0 * U;
            }
            certain
        }
    };
    (certain && mask != 0).then_some(mask)
}

/// Whether the eye may be before a face.
fn may_be_before(projection: &ClipProjection, face: usize, min: DVec3, max: DVec3) -> bool {
    let axis = face / 2;
    match projection.eye {
        Eye::Point(eye) if face.is_multiple_of(2) => !(eye[axis] - min[axis] > 2.0 * projection.eye_error),
        Eye::Point(eye) => !(max[axis] - eye[axis] > 2.0 * projection.eye_error),
        Eye::Direction(along) => {
            let along = if face.is_multiple_of(2) { along[axis] } else { -along[axis] };
            !(along < -(2.0 * projection.eye_error + 8.0 * U))
        }
    }
}
