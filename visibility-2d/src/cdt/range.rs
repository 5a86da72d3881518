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
    /// u + 2 u) (1 + 3 u) of the sum of the magnitudes of its products: below 5 u of that sum. Squares of
    /// distances have relative errors below 6 u. `ERROR` is 16 u.
    pub(crate) fn is_near(&self, [a, b]: [Point; 2]) -> bool {
        const ERROR: f64 = 8.0 * f64::EPSILON;
        let [a, b] = [a, b].map(|p| [p[0] - self.eye[0], p[1] - self.eye[1]]);
        let along = [b[0] - a[0], b[1] - a[1]];
        let square = self.range * self.range * (1.0 + ERROR);
        if dot(a, a).min(dot(b, b)) <= square {
            return true;
        }
        // If the foot of the perpendicular is beyond an end, this end is the nearest point. Where rounding
        // decides that, the foot is beyond by up to (2 / s + 3) u |a|, with s = |b - a| / |a|, and by less
        // than s |a|. So the square of the distance of the end is that of the foot up to 5 u.
        let (length, at_a, at_b) = (dot(along, along), dot(a, along), dot(b, along));
        if at_a >= 0.0 || at_b <= 0.0 {
            return false;
        }
        // The square of the length is off by up to (8 x + 20) u, with x = |a_x a_y| / (s |a|^2). What the
        // margins of the cross product and of the range leave is 22 max(1, 2 x - 1) u + 16 u.
        let (p, m) = (a[0] * b[1], a[1] * b[0]);
        let cross = ((p - m).abs() - ERROR * (p.abs() + m.abs())).max(0.0);
        cross * cross <= square * length
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

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;
    use visibility_testing::Random;

    /// Edges at just the range, by whole numbers, are near, whether the nearest point is between the ends or
    /// is an end; edges a little farther are not.
    #[test]
    fn edges_at_just_the_range_are_near() {
        let mut random = Random(3);
        for round in 0..10_000 {
            // Direction (p, q) of whole length h.
            let [m, n] = [0; 2].map(|_| random.magnitude(13));
            let (p, q, h) = (m * m - n * n, 2 * m * n, m * m + n * n);
            let (away, eye) = (random.magnitude(20), [0; 2].map(|_| random.magnitude(40)));
            let foot = [eye[0] - away * q, eye[1] + away * p];
            let (to_a, to_b) = match round % 4 {
                0 => (-random.magnitude(20), random.magnitude(20)),
                1 => (0, random.magnitude(20)),
                2 => (0, 0),
                _ => (-1, 1),
            };
            let mut ends = [to_a, to_b].map(|by| [foot[0] + by * p, foot[1] + by * q].map(|x| x as f64));
            if random.one_in(2) {
                ends.swap(0, 1);
            }
            let is_near = |range: f64| Disc::new(eye.map(|x| x as f64), range).is_near(ends);
            let range = (away * h) as f64;
            assert!(is_near(range), "round {round}: {ends:?} at {range} from {eye:?}");
            assert!(!is_near(range * (1.0 - 1e-9)), "round {round}: {ends:?} beyond {range} from {eye:?}");
            // From the first end on, away from the eye.
            let beyond = [ends[0], [ends[0][0] - (away * q) as f64, ends[0][1] + (away * p) as f64]];
            let to_end = Disc::new(eye.map(|x| x as f64), range * 0.5);
            assert!(!to_end.is_near(beyond), "round {round}: {beyond:?} from {eye:?}");
        }
        assert!(!Disc::new([0.0; 2], -2.0).is_near([[1.0, 0.0], [1.0, 1.0]]), "a negative range is 0");
    }

    /// Points of the clipped boundary are on the edge or the circle, begin in the direction asked for, and
    /// arcs have no gap of more than a 64th of a turn.
    #[test]
    fn clipped_edges_are_parts_of_edge_and_circle() {
        let disc = Disc::new([1.0, 2.0], 5.0);
        let clip = |a: Point, b: Point| {
            let mut points = Vec::new();
            let to = |p: Point| [p[0] - 1.0, p[1] - 2.0];
            disc.clip([a, b], [to(a), to(b)], &mut |p| points.push(p));
            points
        };
        let edge = [[5.0, -1.0], [5.0, 5.0]];
        assert_eq!(clip(edge[0], edge[1]), edge, "an edge whose ends are on the circle");
        assert_eq!(clip([4.0, 1.0], [4.0, 3.0]), [[4.0, 1.0], [4.0, 3.0]], "an edge inside");
        for (a, b, inner) in
            [([5.0, -9.0], [5.0, 9.0], 2), ([7.0, -9.0], [7.0, 9.0], 0), ([6.0, 0.0], [6.0, 4.0], 1)]
        {
            let points = clip(a, b);
            let on_edge = points.iter().filter(|p| (p[0] - a[0]).abs() < 1e-12).count();
            assert_eq!(on_edge, inner, "points on the edge from {a:?} to {b:?}: {points:?}");
            for [p, q] in points.windows(2).map(|pair| [pair[0], pair[1]]) {
                let is_edge = [p, q].iter().all(|p| (p[0] - a[0]).abs() < 1e-12);
                let apart = chord([1.0, 2.0], p, q);
                assert!(apart > 0.0 && (is_edge || apart < 25.0 * 0.0981), "{p:?} to {q:?}");
            }
            let is_in_range = |p: &Point| (p[0] - 1.0).hypot(p[1] - 2.0) < 5.0 + 1e-9;
            assert!(points.iter().all(is_in_range), "{points:?} from {a:?} to {b:?}");
            let first = points.first().unwrap();
            assert!(chord([1.0, 2.0], a, *first).abs() < 1e-9, "{first:?} is in the direction of {a:?}");
        }
        let half = {
            let mut points = Vec::new();
            disc.arc([1.0, 1e-9], [-1.0, 0.0], &mut |p| points.push(p));
            points
        };
        assert!((33..65).contains(&half.len()), "points of an arc of half a turn: {}", half.len());
        assert!(half.iter().all(|p| p[1] >= 2.0 - 1e-6), "the half to the left");
    }
}
