//! Exact test on which side of a line two other lines cross, for lines through two given points each.
//!
//! The crossing itself has no `f64` coordinates. Its side of a third line is the sign of a determinant of
//! degree 4 in the given coordinates, so [`MIN_MAGNITUDE`](super::predicates::MIN_MAGNITUDE) and
//! [`MAX_MAGNITUDE`](super::predicates::MAX_MAGNITUDE) keep it from underflow and overflow, as they keep the
//! in-circle test.
//!
//! This work is based on: Jonathan Shewchuk, "Adaptive Precision Floating-Point Arithmetic and Fast Robust
//! Geometric Predicates", 1997 (sums that do not overlap; a filter before the exact sum).

use super::predicates::{Point, area, cross, orient};
use alloc::vec::Vec;
use visibility_core::geometry::DoubleDouble;

/// Directed line through two different points of the plan.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Line(pub(super) Point, pub(super) Point);

impl Line {
    /// Returns the same line in the opposite direction.
    pub(super) fn reversed(self) -> Self {
        Self(self.1, self.0)
    }

    /// Returns a positive number if a point lies to the left of the line, a negative one if to the right, and
    /// 0 on the line. Exact.
    pub(super) fn side(self, point: Point) -> f64 {
        orient(self.0, self.1, point)
    }

    /// Returns a given point through which both lines run. `None` if there is none.
    fn common_point(self, other: Self) -> Option<Point> {
        [self.0, self.1].into_iter().find(|p| *p == other.0 || *p == other.1)
    }

    fn is_same(self, other: Self) -> bool {
        self == other || self == other.reversed()
    }

    /// Returns the sign of the crossing of `first` and `second` as [`side`](Self::side) would: 1, -1 or 0.
    /// The second line must turn left from the first. Exact.
    pub(super) fn side_of_crossing(self, first: Self, second: Self) -> i8 {
        let sign = |x: f64| if x > 0.0 { 1 } else { -i8::from(x < 0.0) };
        if self.is_same(first) || self.is_same(second) {
            return 0;
        }
        if let Some(point) = first.common_point(second) {
            return sign(self.side(point));
        }
        // With coordinates relative to a point of this line, its constant coefficient is 0. A line is
        // a x + b y + c = 0.
        let coefficients = |line: Self| {
            let [[x, y], [u, v]] = [line.0, line.1].map(|point| [point[0] - self.0[0], point[1] - self.0[1]]);
            let (plus, minus) = (x * v, u * y);
            (line.0[1] - line.1[1], line.1[0] - line.0[0], plus - minus, plus.abs() + minus.abs())
        };
        let (a1, b1, c1, size1) = coefficients(first);
        let (a2, b2, c2, size2) = coefficients(second);
        let (a, b) = (self.0[1] - self.1[1], self.1[0] - self.0[0]);
        let value = a * (b1 * c2 - b2 * c1) + b * (c1 * a2 - c2 * a1);
        let size =
            a.abs() * (b1.abs() * size2 + b2.abs() * size1) + b.abs() * (a2.abs() * size1 + a1.abs() * size2);
        // Each of the four products of three factors is rounded at most 11 times: once in each of its four
        // differences of coordinates, twice in c, and five times from there on. 16 units of 2^-53 are more,
        // and cover the rounding of `size` as well.
        if value.abs() > 8.0 * f64::EPSILON * size { sign(value) } else { self.exact_side(first, second) }
    }

    #[cold]
    fn exact_side(self, first: Self, second: Self) -> i8 {
        let [(a1, b1, c1), (a2, b2, c2), (a3, b3, c3)] = [first, second, self].map(Self::exact_coefficients);
        let minor = |p: &Sum, q: &Sum, r: &Sum, s: &Sum| {
            let mut minor = Sum::default();
            minor.add_product(p, q, 1.0);
            minor.add_product(r, s, -1.0);
            minor
        };
        let mut total = Sum::default();
        total.add_product(&a3, &minor(&b1, &c2, &b2, &c1), 1.0);
        total.add_product(&b3, &minor(&c1, &a2, &c2, &a1), 1.0);
        total.add_product(&c3, &minor(&a1, &b2, &a2, &b1), 1.0);
        total.sign()
    }

    /// Returns the coefficients of the line, a x + b y + c = 0, which is positive on the left.
    fn exact_coefficients(self) -> (Sum, Sum, Sum) {
        let Self([x, y], [u, v]) = self;
        let (mut a, mut b, mut c) = (Sum::default(), Sum::default(), Sum::default());
        [y, -v].into_iter().for_each(|term| a.add(term));
        [u, -x].into_iter().for_each(|term| b.add(term));
        c.add_all(DoubleDouble::product(x, v));
        c.add_all(DoubleDouble::product(-u, y));
        (a, b, c)
    }

    /// Returns the rounded crossing of two lines that are not parallel; exact if a given point is common. Not
    /// finite if the lines are parallel, or may be if they are so up to an angle of 2^-105.
    pub(super) fn crossing(self, other: Self) -> Point {
        if let Some(point) = self.common_point(other) {
            return point;
        }
        let share = area(other.0, other.1, self.0) / cross([self.0, self.1], [other.0, other.1]);
        [0, 1].map(|axis| self.0[axis] + share * (self.1[axis] - self.0[axis]))
    }
}

/// Exact sum of `f64` numbers: numbers that do not overlap, of ascending magnitude, without zeros.
#[derive(Default)]
struct Sum(Vec<f64>);

impl Sum {
    fn add(&mut self, mut term: f64) {
        let mut kept = 0;
        for index in 0..self.0.len() {
            let DoubleDouble { hi, lo } = DoubleDouble::sum(term, self.0[index]);
            term = hi;
            if lo != 0.0 {
                self.0[kept] = lo;
                kept += 1;
            }
        }
        self.0.truncate(kept);
        if term != 0.0 {
            self.0.push(term);
        }
    }

    /// Adds both parts of a number.
    fn add_all(&mut self, number: DoubleDouble) {
        self.add(number.lo);
        self.add(number.hi);
    }

    /// Adds `sign` times the product of two sums.
    fn add_product(&mut self, a: &Self, b: &Self, sign: f64) {
        for &x in &a.0 {
            for &y in &b.0 {
                self.add_all(DoubleDouble::product(sign * x, y));
            }
        }
    }

    fn sign(&self) -> i8 {
        self.0.last().map_or(0, |&x| if x > 0.0 { 1 } else { -1 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_testing::Random;

    /// Returns the side by integers: the sign of the determinant of the coefficients of the lines.
    fn expected(lines: [[[i64; 2]; 2]; 3]) -> i8 {
        let [[a, b, c], [d, e, f], [g, h, i]] = lines.map(|[[x, y], [u, v]]| {
            let [x, y, u, v] = [x, y, u, v].map(i128::from);
            [y - v, u - x, x * v - u * y]
        });
        (g * (b * f - e * c) + h * (c * d - f * a) + i * (a * e - d * b)).signum() as i8
    }

    /// Lines of very short or nearly parallel pairs of points, and their crossings by hand.
    #[test]
    fn crossings_of_short_and_flat_lines_are_precise() {
        for length in [1e-14, 1e-16, 1e-39] {
            let (short, long) = (Line([0.0; 2], [length, 0.0]), Line([0.0, -1.0], [10.0, 0.1]));
            for crossing in [short.crossing(long), short.reversed().crossing(long), long.crossing(short)] {
                let error = (crossing[0] - 10.0 / 1.1).abs().max(crossing[1].abs());
                assert!(error < 1e-14, "{crossing:?} at a length of {length}");
            }
        }
        // The second line rises by 2^-50 over a length of 8.
        let step = f64::EPSILON;
        let flat = Line([0.0, 1.0], [4.0, 1.0]).crossing(Line([0.0, 1.0 - step], [8.0, 1.0 + 3.0 * step]));
        assert_eq!(flat, [2.0, 1.0], "crossing of nearly parallel lines");
    }

    /// Lines through a common given point cross there, to the last bit.
    #[test]
    fn crossings_at_a_common_point_are_exact() {
        let mut random = Random(5);
        for round in 0..100 {
            let [p, a, b] =
                [0; 3].map(|_| [0; 2].map(|_| random.fine_range(-1.0, 1.0) * random.pick(&[1e-3, 1.0, 1e3])));
            for one in [Line(p, a), Line(a, p)] {
                for other in [Line(p, b), Line(b, p)] {
                    assert_eq!(one.crossing(other), p, "round {round}: {one:?} and {other:?}");
                }
            }
        }
    }

    #[test]
    fn sides_of_crossings_are_exact() {
        let mut counts = [0; 3];
        for seed in 0..20_000 {
            let mut random = Random(seed);
            let size = random.pick(&[2, 9, 1 << 12, 1 << 24]);
            let mut point = |size: i32| [0, 1].map(|_| i64::from(random.between(-size, size)));
            let mut lines = [[[0; 2]; 2]; 3].map(|line| line.map(|_| point(size)));
            // Half of the lines run through one point, up to a unit.
            if seed % 2 == 0 {
                let (center, off) = (point(size), point(1));
                for line in &mut lines {
                    line[1] = [0, 1].map(|k| 2 * center[k] - line[0][k]);
                }
                lines[2][1] = [0, 1].map(|k| lines[2][1][k] + off[k]);
            }
            let [first, second, _] = lines.map(|[a, b]| [b[0] - a[0], b[1] - a[1]]);
            let turn = first[0] * second[1] - first[1] * second[0];
            if turn == 0 || lines.iter().any(|[a, b]| a == b) {
                continue;
            }
            if turn < 0 {
                lines.swap(0, 1);
            }
            let [one, two, line] = lines.map(|line| {
                let [a, b] = line.map(|p| p.map(|x| x as f64));
                Line(a, b)
            });
            let side = line.side_of_crossing(one, two);
            assert_eq!(side, expected(lines), "seed {seed}: {lines:?}");
            assert_eq!(line.reversed().side_of_crossing(one, two), -side, "seed {seed}: reversed");
            counts[(side + 1) as usize] += 1;
        }
        assert!(counts.iter().all(|&count| count > 1000), "{counts:?}");
    }
}
