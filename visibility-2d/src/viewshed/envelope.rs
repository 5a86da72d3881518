//! The skyline of a quarter of the terrain: the upper envelope of segments in the plane of directions and
//! slopes.

use alloc::vec::Vec;
use core::mem;

/// A line over an interval of directions.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Line {
    /// Direction at which the line has the slope `at`.
    from: f64,
    /// Slope at `from`. Minus infinity where nothing has been added yet.
    at: f64,
    /// Change of the slope with the direction.
    rise: f64,
}

/// The image of an edge of the terrain: the straight segment between two ends, each a direction and a slope.
#[derive(Clone, Copy, Debug)]
pub(super) struct Segment {
    /// End of the lesser direction.
    a: (f64, f64),
    b: (f64, f64),
    /// By how much rounding may have raised the slopes, beyond what the ends themselves tell.
    lowered: f64,
}

/// Upper envelope over the directions from -[`REACH`] to [`REACH`].
#[derive(Clone, Debug, Default)]
pub(super) struct Envelope {
    /// First direction and line of each piece, by direction. A piece ends where the next begins.
    pieces: Vec<(f64, Line)>,
    /// Pieces of the envelope that is being made.
    merged: Vec<(f64, Line)>,
}

/// Relative rounding of what a segment is made of: a direction is a quotient of differences of numbers as
/// given, and a slope a product of such a difference and a reciprocal, so each is off by at most 4 half units
/// in the last place. A slope along the line adds the roundings of two differences, a quotient, a product and
/// a sum.
const ROUNDING: f64 = 16.0 * f64::EPSILON;

/// Greatest direction of an envelope. Those of a quarter are up to 1. A line of sight in a corner direction
/// of the quarter may pass over the end of an edge whose other side is a hole in the next quarter: the
/// envelope tells up to there, and beyond by more than the rounding of directions.
pub(super) const REACH: f64 = 1.0 + 32.0 * f64::EPSILON;

impl Line {
    const NOTHING: Self = Self { from: 0.0, at: f64::NEG_INFINITY, rise: 0.0 };

    fn slope(&self, direction: f64) -> f64 {
        self.at + self.rise * (direction - self.from)
    }
}

impl Segment {
    /// Makes the segment between two ends, each a direction and a slope, in any order. Its slopes are lowered
    /// by the bound on their roundings (see [`ROUNDING`]) and by `lowered`. `None` for a segment along one
    /// direction, and for one with an end that is NaN.
    pub(super) fn new(a: (f64, f64), b: (f64, f64), lowered: f64) -> Option<Self> {
        let (a, b) = if a.0 <= b.0 { (a, b) } else { (b, a) };
        (b.0 > a.0 && !a.1.is_nan() && !b.1.is_nan()).then_some(Self { a, b, lowered })
    }

    /// Returns the segment's line, lowered. `None` if its slope is not finite.
    fn line(&self) -> Option<Line> {
        let Self { a, b, lowered } = *self;
        let rise = (b.1 - a.1) / (b.0 - a.0);
        let most = a.1.abs().max(b.1.abs()) + rise.abs() * a.0.abs().max(b.0.abs());
        let at = a.1 - ROUNDING * most - lowered;
        at.is_finite().then_some(Line { from: a.0, at, rise })
    }

    /// Whether no point of the segment is above a line.
    fn is_below(&self, line: &Line) -> bool {
        self.a.1 <= line.slope(self.a.0) && self.b.1 <= line.slope(self.b.0)
    }
}

impl Envelope {
    /// Removes all segments.
    pub(super) fn clear(&mut self) {
        self.pieces.clear();
        self.pieces.push((-REACH, Line::NOTHING));
    }

    /// Adds segments that come by direction and do not overlap. What an end that rounding has put before the
    /// end of the last segment overlaps is left out. Most segments are below the envelope: nothing is written
    /// for these.
    pub(super) fn add(&mut self, segments: impl Iterator<Item = Segment>) {
        let Self { pieces, merged } = self;
        merged.clear();
        let end_of = |piece: usize| pieces.get(piece + 1).map_or(REACH, |next: &(f64, Line)| next.0);
        // The piece at the beginning of the segment; up to which direction the envelope is merged; and the
        // piece there.
        let (mut at, mut done, mut rest) = (0, -REACH, 0);
        for segment in segments {
            let (start, end) = (segment.a.0.max(done), segment.b.0.min(REACH));
            if start >= end {
                continue;
            }
            while end_of(at) <= start {
                at += 1;
            }
            let Some(&(_, piece)) = pieces.get(at) else { break };
            if end <= end_of(at) && segment.is_below(&piece) {
                continue;
            }
            let Some(line) = segment.line() else { continue };
            let mut is_above = false;
            let (mut last, mut low) = (at, start);
            while let Some(&(_, piece)) = pieces.get(last) {
                let high = end.min(end_of(last));
                is_above |= line.slope(low) > piece.slope(low) || line.slope(high) > piece.slope(high);
                low = high;
                if low >= end {
                    break;
                }
                last += 1;
            }
            if !is_above {
                continue;
            }
            // What ends before the segment begins stays.
            copy(merged, pieces, done, rest..at + 1);
            (rest, low) = (at, start);
            while let Some(&(_, piece)) = pieces.get(rest) {
                let high = end.min(end_of(rest));
                higher(merged, low, high, piece, line);
                low = high;
                if end_of(rest) <= end {
                    rest += 1;
                }
                if low >= end {
                    break;
                }
            }
            (done, at) = (end, rest);
        }
        if merged.is_empty() {
            return;
        }
        copy(merged, pieces, done, rest..pieces.len());
        mem::swap(pieces, merged);
    }

    /// Returns a function that tells the slope of the envelope for directions that do not decrease from call
    /// to call. Where pieces meet, up to the rounding of directions, the lower of their slopes counts: they
    /// differ beside holes alone. In a direction along the border of the raster (`true`) it is the higher,
    /// since the other side has no terrain. Minus infinity where there is nothing.
    pub(super) fn slopes(&self) -> impl FnMut(f64, bool) -> f64 + '_ {
        let mut rest = self.pieces.as_slice();
        move |direction, on_border| {
            // A direction is a quotient of differences, off by 2 epsilon; so is the end of a piece.
            let off = 8.0 * f64::EPSILON * direction.abs();
            while let [_, later @ ..] = rest
                && later.first().is_some_and(|next| next.0 < direction - off)
            {
                rest = later;
            }
            let (first, later) = match rest {
                [first, later @ ..] => (first.1.slope(direction), later),
                [] => return f64::NEG_INFINITY,
            };
            let met = later.iter().take_while(|piece| piece.0 <= direction + off);
            met.map(|piece| piece.1.slope(direction))
                .fold(first, |one, other| if on_border { one.max(other) } else { one.min(other) })
        }
    }
}

/// Adds pieces, the first of which begins at `start`.
fn copy(merged: &mut Vec<(f64, Line)>, pieces: &[(f64, Line)], start: f64, range: core::ops::Range<usize>) {
    if let Some([first, others @ ..]) = pieces.get(range) {
        push(merged, start, first.1);
        merged.extend_from_slice(others);
    }
}

/// Adds the piece that begins at `start`. It takes the place of the last piece if that begins there, too.
fn push(merged: &mut Vec<(f64, Line)>, start: f64, line: Line) {
    if merged.last().is_some_and(|last| last.0 >= start) {
        merged.pop();
    }
    if merged.last().is_none_or(|last| last.1 != line) {
        merged.push((start, line));
    }
}

/// Adds the higher of two lines from `low` to `high`. Equal slopes are the older line's.
fn higher(merged: &mut Vec<(f64, Line)>, low: f64, high: f64, old: Line, new: Line) {
    let (first, last) = (new.slope(low) - old.slope(low), new.slope(high) - old.slope(high));
    if first <= 0.0 && last <= 0.0 {
        push(merged, low, old);
    } else if first >= 0.0 && last >= 0.0 {
        push(merged, low, new);
    } else {
        let crossing = (low + (high - low) * (first / (first - last))).clamp(low, high);
        let (near, far) = if first > 0.0 { (new, old) } else { (old, new) };
        push(merged, low, near);
        if crossing < high {
            push(merged, crossing, far);
        }
    }
}
