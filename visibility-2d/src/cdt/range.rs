//! Sight within a distance: the test whether an edge is in range, and the clipping of polygons to the circle.

use super::predicates::Point;

/// Cosine of 1/64 of a turn, the greatest angle between successive points of an arc.
const COSINE: f64 = 0.995_184_726_672_196_9;

/// Disc of the points within the range of an eye.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Disc {
    /// Centre of the disc, in world units.
    eye: Point,
    /// Radius of the disc in world units, not negative.
    range: f64,
}

/// Returns twice the area of the triangle of the eye, `a` and `b`; positive if they turn left.
#[inline]
pub(crate) fn chord(eye: Point, a: Point, b: Point) -> f64 {
    (a[0] - eye[0]) * (b[1] - eye[1]) - (a[1] - eye[1]) * (b[0] - eye[0])
}

fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

fn plus(a: Point, share: f64, b: Point) -> Point {
    [a[0] + share * b[0], a[1] + share * b[1]]
}

impl Disc {
    /// Makes the disc of a range that is not NaN; a negative range counts as 0.
    pub(crate) fn new(eye: Point, range: f64) -> Self {
        Self { eye, range: range.max(0.0) }
    }

    /// Returns whether a point of a segment is within the range. Possibly true if the segment is out of range
    /// by less than rounding.
    ///
    /// Let u be 2^-53, and a and b the ends relative to the eye. Each coordinate is rounded once, so its
    /// relative error is at most u. The cross product of a and b then differs from the true one by at most (2
    /// u + 2 u) (1 + 3 u) of the sum of the magnitudes of its products: below 5 u of that sum. Squares and
    /// squared lengths have relative errors below 8 u. `ERROR` is 16 u, more than either, and is added on
    /// both sides of each comparison.
    pub(crate) fn is_near(&self, [a, b]: [Point; 2]) -> bool {
        const ERROR: f64 = 8.0 * f64::EPSILON;
        let [a, b] = [a, b].map(|p| [p[0] - self.eye[0], p[1] - self.eye[1]]);
        let along = [b[0] - a[0], b[1] - a[1]];
        let square = self.range * self.range * (1.0 + ERROR);
        if dot(a, a).min(dot(b, b)) <= square * (1.0 + ERROR) {
            return true;
        }
        // If the foot of the perpendicular is beyond an end by more than rounding, this end is the nearest
        // point.
        let (length, at_a, at_b) = (dot(along, along), dot(a, along), dot(b, along));
        let scale = (a[0].abs() + a[1].abs() + b[0].abs() + b[1].abs()) * (along[0].abs() + along[1].abs());
        if length == 0.0 || at_a > ERROR * scale || at_b < -ERROR * scale {
            return false;
        }
        let (p, m) = (a[0] * b[1], a[1] * b[0]);
        let cross = ((p - m).abs() - ERROR * (p.abs() + m.abs())).max(0.0);
        cross * cross <= square * length * (1.0 + ERROR)
    }

    /// Calls `push` with the vertices, except the eye, of the part of a triangle within the range,
    /// counter-clockwise; arcs become chords. The triangle's corners are the eye, `a` on the ray in direction
    /// `right`, and `b` on the ray in direction `left`.
    pub(crate) fn clip(&self, [a, b]: [Point; 2], [right, left]: [Point; 2], push: &mut impl FnMut(Point)) {
        let [p, q] = [a, b].map(|p| [p[0] - self.eye[0], p[1] - self.eye[1]]);
        let along = [q[0] - p[0], q[1] - p[1]];
        let square = self.range * self.range;
        // |p + t along| = range.
        let (length, half) = (dot(along, along), dot(p, along));
        let root = half * half - length * (dot(p, p) - square);
        if !(root > 0.0 && length > 0.0) {
            return self.arc(right, left, push);
        }
        let root = visibility_core::geometry::sqrt(root);
        let (enter, leave) = (((-half - root) / length).max(0.0), ((root - half) / length).min(1.0));
        if enter >= leave {
            return self.arc(right, left, push);
        }
        let (first, second) = (plus(p, enter, along), plus(p, leave, along));
        if enter > 0.0 {
            self.arc(right, first, push);
        } else {
            push(a);
        }
        if leave < 1.0 {
            self.arc(second, left, push);
        } else {
            push(b);
        }
    }

    /// Calls `push` with points of the circle from direction `right` to direction `left`, less than half a
    /// turn apart.
    fn arc(&self, right: Point, left: Point, push: &mut impl FnMut(Point)) {
        let [right, left] = [right, left].map(unit);
        push(plus(self.eye, self.range, right));
        self.inner_arc(right, left, push, 8);
        push(plus(self.eye, self.range, left));
    }

    fn inner_arc(&self, right: Point, left: Point, push: &mut impl FnMut(Point), depth: u32) {
        if depth > 0 && dot(right, left) < COSINE {
            // The sum of nearly opposite directions is unreliable, so the arc is split a quarter turn from
            // the right one instead.
            let sum = plus(right, 1.0, left);
            let middle = if dot(sum, sum) > 1e-6 { unit(sum) } else { [-right[1], right[0]] };
            self.inner_arc(right, middle, push, depth - 1);
            push(plus(self.eye, self.range, middle));
            self.inner_arc(middle, left, push, depth - 1);
        }
    }
}

/// Returns the unit vector in a direction; (1, 0) for the zero vector.
fn unit(direction: Point) -> Point {
    // Scaled first, so that squares neither overflow nor underflow.
    let size = direction[0].abs().max(direction[1].abs());
    if size == 0.0 {
        return [1.0, 0.0];
    }
    let [x, y] = direction.map(|x| x / size);
    let length = visibility_core::geometry::sqrt(x * x + y * y);
    [x / length, y / length]
}
