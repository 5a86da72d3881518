//! Lines through segments of a floor plan.
//!
//! A directed line is the set of points `p` with `n . p + c = 0`, positive on its left. It passes between the
//! left and the right end of a segment, clear of both ends by the clearance `r`, if
//!
//! ```text
//! n . left + c >= r |n|,    -(n . right + c) >= r |n|
//! ```
//!
//! Scaled so that `n . (left - right) = 1` for one of the segments, this is a linear program in two
//! variables. Certificates are made in three variables, with `n` of unit length: the inequalities above, `|c|
//! <= radius` since the line passes that segment, whose ends are at most `radius` from the origin, and `n .
//! (left - right) >= 2 r` for that segment.

use super::radius::radius_of;
use super::stab::Stab;
use crate::lp::{Certificate, Row, SeidelSolver, Stop, find};
use alloc::vec::Vec;
use visibility_core::geometry::DoubleDouble;
use visibility_core::glam::DVec2;

/// Scratch memory for finding a line through segments of a floor plan by a linear program in two variables.
#[derive(Clone, Debug, Default)]
pub(crate) struct FloorPlan {
    seidel: SeidelSolver,
    rows: Vec<([f64; 2], f64)>,
}

/// Distances from the boundary at which a point of the linear program is searched, in this order until one is
/// found: how far inside each half-space the point must be, as a fraction of the half-space's greatest
/// coefficient.
const INSIDE_FRACTIONS: [f64; 4] = [1e-2, 1e-4, 1e-6, 0.0];

/// Bound on the absolute value of both variables of the linear program. Certificates do not depend on it.
const VARIABLE_BOUND: f64 = 1e6;

impl FloorPlan {
    /// Searches a line through all `segments`, each given by its left and its right end as the line passes,
    /// at least `clearance` away from all ends. The result is a point and a direction. [`Stab::Undecided`] if
    /// undecided, for no segments, for a coordinate that is not finite, and for a clearance that is not
    /// positive.
    pub(crate) fn stab(&mut self, segments: &[[DVec2; 2]], clearance: f64) -> Stab<[DVec2; 2]> {
        let (Some(first), Some(last)) = (segments.first(), segments.last()) else { return Stab::Undecided };
        let sensible = clearance > 0.0 && segments.iter().flatten().all(|p| p.is_finite());
        if !sensible {
            return Stab::Undecided;
        }
        let origin = (first[0] + first[1]) * 0.5;
        let across = |s: &[DVec2; 2]| s[0] - s[1];
        let along = (last[0] + last[1]) * 0.5 - origin;
        let along = along.try_normalize().unwrap_or(-across(first).perp().normalize_or_zero());
        // The segment most nearly at right angles to the approximate line along `along`.
        let square = segments.iter().max_by(|a, b| {
            let sine = |s: &[DVec2; 2]| across(s).normalize_or_zero().dot(along.perp());
            sine(a).total_cmp(&sine(b))
        });
        let square = square.unwrap_or(first);
        let width = across(square);
        let start = along.perp() / width.dot(along.perp());
        // If the approximate line crosses no segment from the proper side, the perpendicular of the segment
        // is used to start from.
        let start = if width.dot(along.perp()) > 0.0 { start } else { width / width.length_squared() };
        // A line is a normal `start + turn * t`, whose product with the segment `square` is 1 for any t, and
        // an offset: two unknowns. Each end of a segment must be on its side of the line.
        let turn = width.perp() / width.length_squared();
        let size =
            segments.iter().flatten().fold(0.0, |size: f64, p| size.max((*p - origin).abs().max_element()));
        self.rows.clear();
        for p in segments.iter().flatten().enumerate() {
            let (sign, p) = (if p.0 % 2 == 0 { 1.0 } else { -1.0 }, *p.1 - origin);
            self.rows.push(([sign * turn.dot(p), sign * size * turn.length()], sign * start.dot(p)));
        }
        // First a line well inside all segments, then closer to their ends.
        for inside in INSIDE_FRACTIONS {
            let rows = &self.rows;
            let inside = |i: usize| {
                let ([a, b], c) = rows[i];
                ([a, b], c - inside * a.abs().max(b.abs()).max(c.abs()))
            };
            match self.seidel.solve(rows.len(), inside, [0.0; 2], [VARIABLE_BOUND; 2]) {
                Ok([t, c]) => {
                    let (n, c) = (start + turn * t, c * size * turn.length());
                    let line = [origin - n * (c / n.length_squared()), -n.perp()];
                    if is_clear(segments, line, clearance) {
                        return Stab::Line(line);
                    }
                }
                Err(Stop::Conflict) => {
                    if let Some(certificate) = self.certificate(segments, square, origin, clearance) {
                        return Stab::No(certificate);
                    }
                }
                Err(Stop::GaveUp) => {}
            }
        }
        Stab::Undecided
    }

    /// Returns the certificate that no line passes the segment ends which the last run of the linear program
    /// found to contradict each other (its conflict). `square` is the segment (left end, right end) by which
    /// lines are scaled: a line's normal `n` has `n . (left - right) = 1`. `origin` is the point that the
    /// program's coordinates are relative to. `None` if no proof is found.
    fn certificate(
        &self,
        segments: &[[DVec2; 2]],
        square: &[DVec2; 2],
        origin: DVec2,
        clearance: f64,
    ) -> Option<Certificate> {
        let (radius, unit) = radius_of(square.iter().map(|&p| (p - origin).length()));
        let difference =
            |a: DVec2, b: DVec2| [DoubleDouble::difference(a.x, b.x), DoubleDouble::difference(a.y, b.y)];
        let [x, y] = difference(square[0], square[1]);
        // Doubling is exact, and so are double-double differences of coordinates.
        let least = 2.0 * clearance;
        let mut rows = [Row { normal: [x, y, DoubleDouble::ZERO], error: 0.0, least }; 4];
        let mut count = 1;
        for end in self.seidel.conflicting_rows() {
            let [x, y] = difference(segments[end / 2][end % 2], origin);
            let mut normal = [x, y, DoubleDouble::from(unit)];
            if end % 2 == 1 {
                normal = normal.map(DoubleDouble::negated);
            }
            rows[count] = Row { normal, error: 0.0, least: clearance };
            count += 1;
        }
        let multipliers = find(&rows[..count], &[1.0, 1.0, radius / unit])?;
        let ends = self.seidel.conflicting_rows().map(|end| end as u32);
        Some(Certificate::new(ends.zip(multipliers[1..].iter().copied())))
    }
}

/// Tests whether a line, given by a point and a direction of any length, certainly passes between the ends of
/// all segments, at least `clearance` away from them. `false` if undecided or NaN.
pub(super) fn is_clear(segments: &[[DVec2; 2]], [point, direction]: [DVec2; 2], clearance: f64) -> bool {
    let length = direction.length();
    segments.iter().flatten().enumerate().all(|(i, &p)| {
        let side = direction.perp_dot(p - point) * if i % 2 == 0 { 1.0 } else { -1.0 };
        // Two products and a difference of differences, each rounded, are off by less than 12u of the sizes.
        // Where the test passes, the right side is no greater and is off by no more: 32u covers both.
        let sizes = (p.length() + point.length()) * length;
        side >= clearance * length + 16.0 * f64::EPSILON * sizes
    })
}
