//! Convex parts of a triangle of the plan, bounded by lines through given points.
//!
//! A piece is stored as its lines, not as corners, so that cutting it again and again stays exact: which
//! corners lie on which side of a line is decided by `line_crossing.rs`.

use super::line_crossing::Line;
use super::predicates::Point;
use alloc::vec::Vec;

/// Cone of directions of less than half a turn: the lines from its apex along its right and its left bound.
pub(super) type Wedge = [Line; 2];

/// Convex polygon with an area.
#[derive(Clone, Debug)]
pub(super) struct ConvexPiece {
    /// Lines along the sides, counter-clockwise, the polygon on the left of each. Each turns left from the
    /// one before.
    lines: Vec<Line>,
    /// Least and greatest coordinates of the triangle. Rounded corners are kept in this rectangle.
    bounds: [Point; 2],
}

impl ConvexPiece {
    /// Makes a triangle, whose corners turn left.
    pub(super) fn triangle([a, b, c]: [Point; 3]) -> Self {
        let bounds = [f64::min, f64::max].map(|f| [0, 1].map(|axis| f(f(a[axis], b[axis]), c[axis])));
        Self { lines: alloc::vec![Line(a, b), Line(b, c), Line(c, a)], bounds }
    }

    /// Returns the lines before, along and after each side.
    pub(super) fn sides(&self) -> impl Iterator<Item = [Line; 3]> + '_ {
        let count = self.lines.len();
        (0..count).map(move |i| [(i + count - 1) % count, i, (i + 1) % count].map(|i| self.lines[i]))
    }

    /// Returns the side of a line on which each corner lies: 1 for left, -1 for right, 0 for on the line.
    /// Corner `i` is where side `i` ends.
    fn signs(&self, line: Line) -> impl Iterator<Item = i8> + '_ {
        self.sides().map(move |[_, side, after]| line.side_of_crossing(side, after))
    }

    /// Returns the part to the left of a line. `None` if that has no area.
    pub(super) fn left_of(&self, line: Line) -> Option<Self> {
        let signs: Vec<i8> = self.signs(line).collect();
        let count = signs.len();
        if signs.iter().all(|&sign| sign >= 0) {
            return Some(self.clone()).filter(|_| signs.contains(&1));
        }
        // The corners to the left follow each other. The first one ends the side on which the line enters.
        let first = (0..count).find(|&i| signs[i] > 0 && signs[(i + count - 1) % count] <= 0)?;
        let kept = (0..count).take_while(|i| signs[(first + i) % count] > 0).count();
        let mut lines: Vec<_> = (0..=kept).map(|i| self.lines[(first + i) % count]).collect();
        lines.push(line);
        Some(Self { lines, bounds: self.bounds })
    }

    /// Returns the part inside a wedge. `None` if that has no area.
    pub(super) fn inside(&self, [right, left]: Wedge) -> Option<Self> {
        self.left_of(right)?.left_of(left.reversed())
    }

    /// Appends to `out` the parts outside a wedge, without overlap: what is to the right of its right bound,
    /// and what is to the left of its left bound. Appends the piece uncut if no part with an area is inside.
    pub(super) fn cut(self, [right, left]: Wedge, out: &mut Vec<Self>) {
        let Some(rest) = self.left_of(right).filter(|rest| rest.left_of(left.reversed()).is_some()) else {
            return out.push(self);
        };
        out.extend(self.left_of(right.reversed()));
        out.extend(rest.left_of(left));
    }

    /// Returns whether the piece and another have a common part with an area.
    pub(super) fn overlaps(&self, other: &Self) -> bool {
        let (first, rest) = (other.lines.first(), other.lines.get(1..).unwrap_or(&[]));
        let Some(common) = first.and_then(|&line| self.left_of(line)) else { return false };
        rest.iter().try_fold(common, |common, &line| common.left_of(line)).is_some()
    }

    /// Returns whether the two wedges have a common point within the piece, be it on their bounds.
    pub(super) fn is_common(&self, one: Wedge, other: Wedge) -> bool {
        let mut common = self.clone();
        for line in [one[0], one[1].reversed(), other[0], other[1].reversed()] {
            match common.left_of(line) {
                Some(part) => common = part,
                // Without an area on the left, corners on the line may still be common.
                None => return common.signs(line).any(|sign| sign == 0),
            }
        }
        true
    }

    /// Returns whether a point is inside the piece or on its outline. Exact.
    pub(super) fn contains(&self, point: Point) -> bool {
        self.lines.iter().all(|line| line.side(point) >= 0.0)
    }

    /// Returns the corners, counter-clockwise. Those where lines through a common given point meet are exact,
    /// the others are rounded. All are in the rectangle around the triangle.
    pub(super) fn corners(&self) -> impl Iterator<Item = Point> + '_ {
        let [low, high] = self.bounds;
        self.sides().map(move |[_, side, after]| {
            let crossing = side.crossing(after);
            // `max` takes the bound for NaN.
            [0, 1].map(|axis| crossing[axis].max(low[axis]).min(high[axis]))
        })
    }

    /// Returns the mean of the corners, rounded.
    pub(super) fn middle(&self) -> Point {
        let count = self.lines.len() as f64;
        self.corners().fold([0.0; 2], |sum, corner| [0, 1].map(|axis| sum[axis] + corner[axis] / count))
    }

    /// Returns the area in square world units, rounded.
    pub(super) fn area(&self) -> f64 {
        let Some(first) = self.corners().next() else { return 0.0 };
        let twice: f64 = self
            .corners()
            .zip(self.corners().skip(1))
            .map(|(a, b)| super::predicates::area(first, a, b))
            .sum();
        (0.5 * twice).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Lines through a corner or along a side add no side that is a point.
    #[test]
    fn lines_through_corners_add_no_side_without_length() {
        let triangle = ConvexPiece::triangle([[0.0, 0.0], [4.0, 0.0], [0.0, 4.0]]);
        let sides = |line: Line| triangle.left_of(line).map(|piece| piece.lines.len());
        assert_eq!(sides(Line([0.0, 0.0], [-1.0, -2.0])), Some(3), "through the corner at 0, cut in two");
        assert_eq!(sides(Line([0.0, 0.0], [1.0, 2.0])), Some(3), "through the corner at 0, the other part");
        assert_eq!(sides(Line([5.0, -1.0], [3.0, 1.0])), Some(3), "along a side");
        assert_eq!(sides(Line([4.0, -1.0], [4.0, 1.0])), Some(3), "through a corner, with all on the left");
        assert_eq!(sides(Line([4.0, 1.0], [4.0, -1.0])), None, "through a corner, with all on the right");
        assert_eq!(sides(Line([1.0, -1.0], [1.0, 5.0])), Some(4), "across");
        assert_eq!(sides(Line([1.0, 5.0], [1.0, -1.0])), Some(3), "across, to the other side");
    }

    /// Lines that are parallel or nearly so have no crossing or one far off. Corners stay in the rectangle.
    #[test]
    fn corners_stay_around_the_triangle() {
        let triangle = ConvexPiece::triangle([[0.0, 0.0], [4.0, 0.0], [0.0, 2.0]]);
        let flat =
            [Line([0.0, 1.0], [4.0, 1.0]), Line([1.0, 0.0], [3.0, 0.0]), Line([0.0, 1.0], [5.0, 1e-9])];
        for lines in
            [[flat[0], flat[1]], [flat[1], flat[0]], [flat[1], flat[2]], [flat[0], flat[0].reversed()]]
        {
            let piece = ConvexPiece { lines: lines.to_vec(), ..triangle.clone() };
            for [x, y] in piece.corners() {
                assert!((0.0..=4.0).contains(&x) && (0.0..=2.0).contains(&y), "({x}, {y}) of {lines:?}");
            }
            assert!(piece.area().is_finite(), "area {} of {lines:?}", piece.area());
        }
    }
}
