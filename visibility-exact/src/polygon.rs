//! Small convex polygons: parts of faces of the viewcell, where lines of sight begin, and parts of faces of
//! the target, where they end.

use crate::half::Half;
use visibility_core::glam::DVec3;

/// Greatest number of corners of a polygon.
pub(crate) const MAX_CORNERS: usize = 8;

/// A convex polygon with at most [`MAX_CORNERS`] corners, in scene coordinates: a face of the viewcell or of
/// a target, or a part of one.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Polygon {
    /// Positions of the corners, in order around the polygon. The first `n` are in use.
    v: [DVec3; MAX_CORNERS],
    /// For each corner, bits 0 to 2 tell which barycentric coordinates in the target triangle are exactly 0.
    /// No bits for polygons that are not a part of the target triangle, and after the triangle was moved.
    pub(crate) zero: [u8; MAX_CORNERS],
    /// Number of corners.
    n: usize,
}

impl Polygon {
    /// Makes a polygon of at most [`MAX_CORNERS`] corners; further corners are ignored.
    pub(crate) fn new(corners: &[DVec3]) -> Self {
        let mut polygon = Self { v: [DVec3::ZERO; MAX_CORNERS], zero: [0; MAX_CORNERS], n: 0 };
        for &corner in corners {
            polygon.push(corner, 0);
        }
        polygon
    }

    /// Makes the polygon of a whole target triangle, and records which barycentric coordinates of each corner
    /// are 0.
    pub(crate) fn target(triangle: &[DVec3; 3]) -> Self {
        let mut polygon = Self::new(triangle);
        polygon.zero[..3].copy_from_slice(&[0b110, 0b101, 0b011]);
        polygon
    }

    pub(crate) fn corners(&self) -> &[DVec3] {
        &self.v[..self.n]
    }

    pub(crate) fn center(&self) -> DVec3 {
        self.corners().iter().sum::<DVec3>() / self.n as f64
    }

    /// Returns the normal vector, whose length is twice the polygon's area.
    pub(crate) fn normal(&self) -> DVec3 {
        let pairs = self.corners().windows(2).skip(1);
        pairs.map(|pair| (pair[0] - self.v[0]).cross(pair[1] - self.v[0])).sum()
    }

    /// Returns the length of the longest side in metres.
    pub(crate) fn size(&self) -> f64 {
        (0..self.n).map(|i| self.v[i].distance(self.v[(i + 1) % self.n])).fold(0.0, f64::max)
    }

    /// Returns two values. The first is the greatest width of a side: its extent in metres perpendicular to
    /// the unit vector `direction`, or its length if `direction` is zero. The second is the argument with
    /// which [`halves`](Self::halves) halves the pair of opposite sides of a quadrilateral that has the
    /// greater sum of such widths; false for other polygons.
    pub(crate) fn extent_across(&self, direction: DVec3) -> (f64, bool) {
        let side = |k: usize| self.v[(k + 1) % self.n] - self.v[k % self.n];
        let width = |k: usize| {
            if direction == DVec3::ZERO { side(k).length() } else { side(k).cross(direction).length() }
        };
        let widest = (0..self.n).map(width).fold(0.0, f64::max);
        if self.n != 4 {
            return (widest, false);
        }
        let first_is_longer = side(0).length() + side(2).length() >= side(1).length() + side(3).length();
        (widest, (width(0) + width(2) >= width(1) + width(3)) != first_is_longer)
    }

    fn push(&mut self, corner: DVec3, zero: u8) -> bool {
        let fits = self.n < MAX_CORNERS;
        if fits {
            (self.v[self.n], self.zero[self.n]) = (corner, zero);
            self.n += 1;
        }
        fits
    }

    /// Returns the part of the polygon in a half-space, or the whole polygon if the part would have too many
    /// corners. `None` if no corner is in front of the plane, so that the part has no area.
    pub(crate) fn clip(&self, half: &Half) -> Option<Self> {
        let height = |i: usize| half.height(self.v[i % self.n]);
        let mut out = Self::new(&[]);
        let mut inside = false;
        for i in 0..self.n {
            let (here, next) = (height(i), height(i + 1));
            inside |= here > 0.0;
            if here >= 0.0 && !out.push(self.v[i], self.zero[i]) {
                return Some(*self);
            }
            if (here > 0.0 && next < 0.0) || (here < 0.0 && next > 0.0) {
                let j = (i + 1) % self.n;
                let cut = half.crossing(self.v[i], self.v[j], [here, next]);
                if !out.push(cut, self.zero[i] & self.zero[j]) {
                    return Some(*self);
                }
            }
        }
        (inside && out.n >= 3).then_some(out)
    }

    /// Returns two halves of the polygon. For a quadrilateral, `across` true halves the shorter pair of
    /// opposite sides, and false the longer pair. Other polygons are halved in one way only.
    pub(crate) fn halves(&self, across: bool) -> [Self; 2] {
        let length = |i: usize| self.v[i % self.n].distance(self.v[(i + 1) % self.n]);
        let corner = |i: usize| (self.v[i % self.n], self.zero[i % self.n]);
        let middle = |i: usize| {
            let ((a, x), (b, y)) = (corner(i), corner(i + 1));
            ((a + b) * 0.5, x & y)
        };
        let make = |corners: &[(DVec3, u8)]| {
            let mut polygon = Self::new(&[]);
            for &(corner, zero) in corners {
                polygon.push(corner, zero);
            }
            polygon
        };
        match self.n {
            // A triangle is cut from the middle of its longest side to the corner opposite.
            3 => {
                let longest = (0..3).fold(0, |best, i| if length(i) > length(best) { i } else { best });
                let [i, j, k] = [longest, longest + 1, longest + 2];
                let m = middle(i);
                [make(&[corner(i), m, corner(k)]), make(&[m, corner(j), corner(k)])]
            }
            // A quadrilateral is cut between the middles of two opposite sides.
            4 => {
                let first = length(0) + length(2) >= length(1) + length(3);
                let i = usize::from(first == across);
                let (m, n) = (middle(i), middle(i + 2));
                [make(&[corner(i), m, n, corner(i + 3)]), make(&[m, corner(i + 1), corner(i + 2), n])]
            }
            // Any other polygon is cut along a diagonal.
            n => {
                let half = n / 2;
                let first: [_; MAX_CORNERS] = core::array::from_fn(|i| corner(i.min(half)));
                let second: [_; MAX_CORNERS] = core::array::from_fn(|i| corner((half + i).min(n)));
                [make(&first[..=half]), make(&second[..=n - half])]
            }
        }
    }

    /// Returns whether [`halves`](Self::halves) can halve the polygon in two ways.
    pub(crate) fn has_two_ways(&self) -> bool {
        self.n == 4
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_cover_the_polygon() {
        let angle = |k: usize, n: usize| core::f64::consts::TAU * k as f64 / n as f64;
        for n in 3..=MAX_CORNERS {
            let corners: std::vec::Vec<DVec3> =
                (0..n).map(|k| DVec3::new(angle(k, n).cos() * 2.0, angle(k, n).sin(), 1.0)).collect();
            let polygon = Polygon::new(&corners);
            for across in [false, true] {
                let halves = polygon.halves(across);
                let area = |polygon: &Polygon| polygon.normal().z;
                assert!(halves.iter().all(|half| area(half) > 0.2 * area(&polygon)), "{n}");
                assert!(
                    (area(&halves[0]) + area(&halves[1]) - area(&polygon)).abs() < 1e-12,
                    "{n} corners, across: {across}: halves add up to the polygon"
                );
            }
            let [a, b] =
                [DVec3::X, -DVec3::X].map(|normal| polygon.clip(&Half { normal, offset: 0.1 }).unwrap());
            assert!(
                a.normal().z + b.normal().z > polygon.normal().z,
                "{n} corners: the parts beyond 0.1 m to either side overlap"
            );
            assert_eq!(
                polygon.clip(&Half { normal: DVec3::Z, offset: -2.0 }),
                None,
                "{n} corners: a plane that leaves nothing"
            );
        }
    }

    fn in_plane(points: &[[f64; 2]]) -> Polygon {
        Polygon::new(&points.iter().map(|p| DVec3::new(p[0], p[1], 0.0)).collect::<std::vec::Vec<_>>())
    }

    /// A square is cut along its diagonal, beside it, and along its sides: the part has the corners that it
    /// should, each once, whichever corner of the square comes first.
    #[test]
    fn a_part_has_each_corner_once() {
        let square = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]];
        let half = |x: f64, y: f64, offset: f64| Half { normal: DVec3::new(x, y, 0.0), offset };
        let (r, s) = (0.5f64.sqrt(), 2.0 * 0.5f64.sqrt());
        // A half-space, and the number of corners and twice the area of the part in it.
        let cases = [
            (half(r, -r, 0.0), 3, 16.0),
            (half(-r, r, 0.0), 3, 16.0),
            (half(r, -r, -s), 3, 4.0),
            (half(-r, r, s), 5, 28.0),
            (half(1.0, 0.0, 0.0), 4, 32.0),
            (half(1.0, 0.0, -1.0), 4, 24.0),
            (half(1.0, 0.0, 9.0), 4, 32.0),
        ];
        for turn in 0..4 {
            let polygon = in_plane(&core::array::from_fn::<_, 4, _>(|k| square[(k + turn) % 4]));
            for (half, corners, area) in cases {
                let part = polygon.clip(&half).unwrap();
                assert_eq!(part.corners().len(), corners, "corner {turn} first, {half:?}");
                let found = part.normal().length();
                assert!(
                    (found - area).abs() < 1e-12,
                    "corner {turn} first, {half:?}: twice the area {found}"
                );
            }
            for outside in [half(-1.0, 0.0, 0.0), half(-1.0, 0.0, -1.0)] {
                assert_eq!(polygon.clip(&outside), None, "corner {turn} first, {outside:?} has no area");
            }
            let own = Half { normal: DVec3::Z, offset: 0.0 };
            assert_eq!(polygon.clip(&own), None, "corner {turn} first: the polygon's own plane has no area");
        }
    }

    /// A polygon of as many corners as it may have, without one of them, would have one corner too many.
    #[test]
    fn a_part_with_too_many_corners_is_the_whole() {
        let angle = |k: usize| core::f64::consts::TAU * k as f64 / MAX_CORNERS as f64;
        let corners: [DVec3; MAX_CORNERS] =
            core::array::from_fn(|k| DVec3::new(angle(k).cos(), angle(k).sin(), 0.0));
        let polygon = Polygon::new(&[&corners[..], &corners[..1]].concat());
        assert_eq!(polygon.corners(), corners, "a corner too many is ignored");
        for corner in corners {
            let half = Half { normal: -corner, offset: 0.9 };
            assert_eq!(polygon.clip(&half), Some(polygon), "without {corner}");
        }
    }

    /// Corners of parts of a target triangle have the coordinates 0 that both ends of their side have.
    #[test]
    fn what_is_cut_of_a_target_keeps_its_zeros() {
        let target = Polygon::target(&[DVec3::ZERO, DVec3::X * 4.0, DVec3::Y * 4.0]);
        let part = target.clip(&Half { normal: DVec3::X, offset: -1.0 }).unwrap();
        let found: std::vec::Vec<_> = part.corners().iter().zip(&part.zero).collect();
        let at = |x: f64, y: f64| DVec3::new(x, y, 0.0);
        assert_eq!(
            found,
            [(&at(1.0, 0.0), &0b100), (&at(4.0, 0.0), &0b101), (&at(1.0, 3.0), &0b001)],
            "corners and zeros"
        );
    }

    /// The longest side of a triangle is halved, and the sides of a rectangle that are asked for.
    #[test]
    fn the_sides_that_are_asked_for_are_halved() {
        for turn in 0..3 {
            let t: [[f64; 2]; 3] =
                core::array::from_fn(|k| [[0.0, 0.0], [4.0, 0.0], [1.0, 1.0]][(k + turn) % 3]);
            let size = in_plane(&t).halves(false).map(|half| half.size());
            assert!(
                size.iter().all(|size| *size < 3.5),
                "corner {turn} first: the longest sides are {size:?}"
            );
        }
        for turn in 0..4 {
            let sides = [[0.0, 0.0], [3.0, 0.0], [3.0, 1.0], [0.0, 1.0]];
            let polygon = in_plane(&core::array::from_fn::<_, 4, _>(|k| sides[(k + turn) % 4]));
            assert_eq!(polygon.size(), 3.0, "corner {turn} first: the longest side");
            let sizes = [false, true].map(|across| polygon.halves(across).map(|half| half.size()));
            assert_eq!(
                sizes,
                [[1.5; 2], [3.0; 2]],
                "corner {turn} first: halves of the long and short sides"
            );
            // Across y the rectangle is 3 m wide, so its long sides are to be halved.
            let across = [DVec3::ZERO, DVec3::Y, DVec3::X].map(|edge| polygon.extent_across(edge));
            assert_eq!(across, [(3.0, false), (3.0, false), (1.0, true)], "corner {turn} first: widths");
        }
    }
}
