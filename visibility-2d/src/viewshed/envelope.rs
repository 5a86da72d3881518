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

/// The image of an edge of the terrain: a line from one direction to a later one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Segment {
    line: Line,
    start: f64,
    end: f64,
}

/// Upper envelope over the directions from -1 to 1.
#[derive(Clone, Debug, Default)]
pub(super) struct Envelope {
    /// First direction and line of each piece, by direction. A piece ends where the next begins.
    pieces: Vec<(f64, Line)>,
    /// Pieces of the envelope that is being made.
    merged: Vec<(f64, Line)>,
}

/// Relative rounding of what a segment is made of: a direction and a slope are quotients of differences of
/// numbers as given, so each is off by at most 3 half units in the last place. A slope along the line adds the
/// roundings of two differences, a quotient, a product and a sum.
const ROUNDING: f64 = 16.0 * f64::EPSILON;

impl Line {
    const NOTHING: Self = Self { from: 0.0, at: f64::NEG_INFINITY, rise: 0.0 };

    fn slope(&self, direction: f64) -> f64 {
        self.at + self.rise * (direction - self.from)
    }
}

impl Segment {
    /// Makes the segment between two ends, each a direction and a slope, in any order, lowered by the bound on
    /// all roundings: that of the slopes, and that of the directions times the rise. `lowered` is lowered
    /// further. `None` for a segment along one direction, and for one with an end that is not finite.
    pub(super) fn new(a: (f64, f64), b: (f64, f64), lowered: f64) -> Option<Self> {
        let (a, b) = if a.0 <= b.0 { (a, b) } else { (b, a) };
        let rise = (b.1 - a.1) / (b.0 - a.0);
        let most = a.1.abs().max(b.1.abs()) + rise.abs() * a.0.abs().max(b.0.abs());
        let at = a.1 - ROUNDING * most - lowered;
        (b.0 > a.0 && at.is_finite()).then_some(Self {
            line: Line { from: a.0, at, rise },
            start: a.0,
            end: b.0,
        })
    }
}

impl Envelope {
    /// Removes all segments.
    pub(super) fn clear(&mut self) {
        self.pieces.clear();
        self.pieces.push((-1.0, Line::NOTHING));
    }

    /// Adds segments that come by direction and do not overlap. What an end that rounding has put before the
    /// end of the last segment overlaps is left out.
    pub(super) fn add(&mut self, segments: impl Iterator<Item = Segment>) {
        let mut merged = mem::take(&mut self.merged);
        merged.clear();
        let mut pieces = self.pieces.iter().copied().peekable();
        let mut piece = pieces.next().unwrap_or((-1.0, Line::NOTHING));
        // Up to here the envelope is merged.
        let mut done = -1.0;
        for Segment { line, start, end } in segments {
            let (start, end) = (start.max(done), end.min(1.0));
            if start >= end {
                continue;
            }
            // What ends before the segment begins stays.
            push(&mut merged, done, piece.1);
            while let Some(next) = pieces.next_if(|next| next.0 <= start) {
                piece = next;
                push(&mut merged, piece.0, piece.1);
            }
            let mut low = start;
            while low < end {
                let next = pieces.peek().map_or(1.0, |next| next.0);
                let high = end.min(next);
                higher(&mut merged, low, high, piece.1, line);
                low = high;
                if next <= end {
                    let Some(next) = pieces.next() else { break };
                    piece = next;
                }
            }
            done = end;
        }
        if done < 1.0 {
            push(&mut merged, done, piece.1);
        }
        for (start, line) in pieces {
            push(&mut merged, start, line);
        }
        self.merged = mem::replace(&mut self.pieces, merged);
    }

    /// Returns a function that tells the slope of the envelope for directions that do not decrease from call to
    /// call. Where two pieces meet, the lower of their slopes counts: they differ beside holes alone. In a
    /// direction along the border of the raster (`true`) it is the higher, since the other side has no terrain.
    /// Minus infinity where there is nothing.
    pub(super) fn slopes(&self) -> impl FnMut(f64, bool) -> f64 + '_ {
        let mut rest = self.pieces.as_slice();
        move |direction, on_border| {
            while let [_, later @ ..] = rest
                && later.first().is_some_and(|next| next.0 < direction)
            {
                rest = later;
            }
            match rest {
                [piece, next, ..] if next.0 == direction => {
                    let (before, after) = (piece.1.slope(direction), next.1.slope(direction));
                    if on_border { before.max(after) } else { before.min(after) }
                }
                [piece, ..] => piece.1.slope(direction),
                [] => f64::NEG_INFINITY,
            }
        }
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
