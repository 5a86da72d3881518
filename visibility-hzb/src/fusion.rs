//! Occluder fusion within a pixel: what no shape covers alone, several may cover together.
//!
//! Where a wall meets a floor, the pixels along the crease are covered by neither. So each tile remembers the first few outlines that cover part
//! of it, and where all else leaves a box undecided, its pixel is cut up: what of it lies within one outline, and is nearer there than the
//! box, is done with; what lies outside has to be within the others. (Cutting away what is covered until nothing is left is how Weiler and
//! Atherton, "Hidden Surface Removal Using Polygon Area Sorting", 1977, find what is seen.) Nothing is asked of how outlines meet: shared
//! edges, overlaps and T-junctions are all the same.
//!
//! # Why it is sound
//! All points within the half-planes of an outline are covered by its shape, at least as near as the least of its planes (see
//! [`shape`](crate::shape)). A pixel is a convex polygon; a half-plane splits it into two that are convex as well. Pieces within all half-planes
//! of an outline have been compared with its planes at their corners, which is enough as all is linear; pieces outside go on to the next
//! outline, and one that is left over in the end leaves the pixel as it was. Which outlines are remembered, and the order of them, decide what is
//! found, never whether it is right.
//!
//! # The error bound
//! With `u = 2^-24`, the half-plane `x >= s y + t` of a [`Line`] was moved inwards by `8u (|s| H + |t|) + 16u (W + 2)` along the row, for a picture of `W x H`
//! pixels, of which rounding `s` and `t` to `f32` takes less than `3u (|s| H + |t|)`. What is left, `5u |s| H + 16u W`, is more than `3u min(H, W)`
//! straight across the line, whatever `s` is: `2^-19` of a pixel, as no side has less than 16. Level edges were moved by `8u H`.
//!
//! Here all is computed in `f64`, in coordinates that count from the pixel's corner. The value of a line at a corner is off by less than `2^-50 (|s| H + |t| +
//! W)`. If `|t|` exceeds `2 (|s| H + W)`, the line is nowhere near; else that is less than `2^-34` of a pixel across the line. So a corner that is
//! taken to be inside is, and with all the more room, inside the half-plane before it was moved. A cut divides a side at a share between 0 and 1; whatever
//! the error of that share, the new corner lies on the side but for `2^-51` of a pixel, and both parts have it. So of what was cut, they lack
//! no more than a strip of that width. After [`STEPS`] outlines of [`CUTS`] cuts each, twice, every point of the pixel is within `2^-40` of a
//! piece that was found inside an outline, and so within that outline. Over such a distance a plane differs by `2^-40` of its slopes, where
//! `2^-22` of them for each column and row of the picture were taken off ([`Shape::bound`]); bounds on a box are moved by `2^-30` of theirs.

use crate::faces::Slabs;
use crate::shape::{Line, Shape, down};
use crate::tiles::Surface;

/// The most edges of outlines that are remembered: boxes have six, and two are level.
const EDGES: usize = 8;

/// The most of them that may cut a pixel.
const CUTS: usize = 4;

/// Outlines that a tile remembers.
const MET: usize = 8;

/// Outlines that are tried on pieces of one pixel before it is left undecided.
const STEPS: usize = 32;

/// The most corners of a piece. Each cut adds one at most; what would have more is left undecided.
const CORNERS: usize = 12;

/// By how much bounds on boxes are moved, in pixels.
const TINY: f64 = 1.0 / (1 << 30) as f64;

/// What tells most outlines that a pixel has nothing to do with.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Head {
    /// First and end columns, first and end rows, in pixels.
    sides: [u16; 4],
    /// Nearness that nothing of the shape exceeds.
    ceiling: f32,
}

impl Head {
    /// That of nothing.
    pub(crate) const NONE: Self = Self { sides: [0; 4], ceiling: f32::NEG_INFINITY };

    #[inline(always)]
    pub(crate) fn of(shape: &Shape) -> Self {
        let [left, right] = shape.columns;
        let [top, bottom] = shape.lines;
        // Heights are not rounded to pixels: there may be part of a row before the first whole one, and after the last.
        let sides =
            [left as u16, right as u16, top.saturating_sub(1) as u16, bottom.saturating_add(1) as u16];
        Self { sides, ceiling: shape.ceiling }
    }

    /// Whether a shape may cover part of a pixel, and be nearer there than `limit`.
    #[inline(always)]
    pub(crate) fn may_cover(&self, [column, row]: [usize; 2], limit: f32) -> bool {
        let [left, right, top, bottom] = self.sides.map(usize::from);
        self.ceiling > limit && left <= column && column < right && top <= row && row < bottom
    }
}

/// The half-planes of a shape.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Outline {
    /// Bounds from the left, then from the right, on the pixels of a row.
    edges: [Line; EDGES],
    lefts: u8,
    count: u8,
    /// Between which columns and between which heights all of it lies.
    columns: [f32; 2],
    heights: [f32; 2],
}

impl Outline {
    /// That of nothing.
    pub(crate) const NONE: Self = Self {
        edges: [Line { slope: 0.0, offset: 0.0 }; EDGES],
        lefts: 0,
        count: 0,
        columns: [f32::INFINITY, f32::NEG_INFINITY],
        heights: [f32::INFINITY, f32::NEG_INFINITY],
    };

    /// That of a shape with conservative coverage; of nothing if it has too many edges.
    #[inline(always)]
    pub(crate) fn of(shape: &Shape) -> Self {
        let (lefts, count) = (shape.lefts, shape.lefts + shape.rights);
        if count > EDGES {
            return Self::NONE;
        }
        let mut outline = Self {
            lefts: lefts as u8,
            count: count as u8,
            columns: shape.columns,
            heights: shape.heights,
            ..Self::NONE
        };
        outline.edges[..lefts].copy_from_slice(&shape.left[..lefts]);
        outline.edges[lefts..count].copy_from_slice(&shape.right[..shape.rights]);
        outline
    }

    /// What of it cuts a pixel; `None` if it misses the pixel or cuts it too often.
    fn cuts(&self, [x, y]: [f64; 2]) -> Option<Cuts> {
        let [left, right] = self.columns.map(f64::from);
        let [top, bottom] = self.heights.map(f64::from);
        // A NaN misses.
        if !(left < x + 1.0 && right > x && top < y + 1.0 && bottom > y) {
            return None;
        }
        let mut cuts = Cuts { lines: [[0.0; 3]; CUTS], count: 0 };
        for (i, edge) in self.edges[..usize::from(self.count)].iter().enumerate() {
            let (s, t) = (f64::from(edge.slope), f64::from(edge.offset));
            // A bound on pixels holds at their worst corner; taken back, it is one on points.
            let line = if i < usize::from(self.lefts) {
                [1.0, -s, x - s * y - (t - s.max(0.0))]
            } else {
                [-1.0, s, s * y - x + (t - s.min(0.0))]
            };
            if !cuts.push(line) {
                return None;
            }
        }
        (cuts.push([0.0, 1.0, y - top]) && cuts.push([0.0, -1.0, bottom - y])).then_some(cuts)
    }
}

/// Lines `a x + b y + c >= 0` that cut a pixel, in coordinates that count from its upper left corner.
#[derive(Clone, Copy)]
struct Cuts {
    lines: [[f64; 3]; CUTS],
    count: usize,
}

impl Cuts {
    /// Adds a line unless all of the pixel is inside. False if all of it is outside, or there is no room for one more.
    fn push(&mut self, [a, b, c]: [f64; 3]) -> bool {
        let (least, most) = (c + a.min(0.0) + b.min(0.0), c + a.max(0.0) + b.max(0.0));
        if least >= 0.0 {
            return true;
        }
        // A NaN is outside.
        if !(most > 0.0) || self.count == CUTS {
            return false;
        }
        self.lines[self.count] = [a, b, c];
        self.count += 1;
        true
    }
}

impl Cuts {
    /// Whether the middle of the pixel is on the inner side of all.
    fn leave_middle(&self) -> bool {
        let mut inside = true;
        for [a, b, c] in &self.lines[..self.count] {
            inside &= c + 0.5 * (a + b) >= 0.0;
        }
        inside
    }
}

/// A convex piece of a pixel.
#[derive(Clone, Copy)]
struct Piece {
    corners: [[f64; 2]; CORNERS],
    count: usize,
}

impl Piece {
    const WHOLE: Self = {
        let mut corners = [[0.0; 2]; CORNERS];
        (corners[1], corners[2], corners[3]) = ([1.0, 0.0], [1.0, 1.0], [0.0, 1.0]);
        Self { corners, count: 4 }
    };

    /// The part on the inner side of a line, or on the outer side; `None` if it would have too many corners. Both parts have corners where a side
    /// crosses the line.
    fn part(&self, [a, b, c]: [f64; 3], inner: bool) -> Option<Self> {
        let mut part = Self { corners: [[0.0; 2]; CORNERS], count: 0 };
        let at = |[x, y]: [f64; 2]| a * x + b * y + c;
        let corners = &self.corners[..self.count];
        let Some(mut from) = corners.last().copied() else { return Some(part) };
        let mut before = at(from);
        for &to in corners {
            let value = at(to);
            if (before >= 0.0) != (value >= 0.0) {
                let share = before / (before - value);
                part.push([from[0] + (to[0] - from[0]) * share, from[1] + (to[1] - from[1]) * share])?;
            }
            if (value >= 0.0) == inner {
                part.push(to)?;
            }
            (from, before) = (to, value);
        }
        Some(part)
    }

    fn push(&mut self, corner: [f64; 2]) -> Option<()> {
        *self.corners.get_mut(self.count)? = corner;
        self.count += 1;
        Some(())
    }
}

/// What a pixel is to be nearer than.
pub(crate) trait Behind {
    /// How near it is at a point, more or less: what is farther there is not looked at.
    fn nearness(&self, at: [f64; 2]) -> f64;

    /// Whether a surface is before all of it within a convex polygon, given by corners in pixels from a pixel at `[x, y]`.
    fn is_behind(&mut self, surface: &Surface, pixel: [f64; 2], corners: &[[f64; 2]]) -> bool;
}

/// A box is that, by its sides and by a nearness that none of it exceeds.
impl Behind for (&Slabs, f32) {
    fn nearness(&self, at: [f64; 2]) -> f64 {
        self.0.nearness(at).min(f64::from(self.1))
    }

    fn is_behind(&mut self, surface: &Surface, [x, y]: [f64; 2], corners: &[[f64; 2]]) -> bool {
        let (slabs, nearest) = (self.0, f64::from(self.1));
        let (mut before, mut all) = (slabs.uppers(), true);
        for corner in corners {
            let at = [x + corner[0], y + corner[1]];
            let nearness = surface.at(at);
            all &= nearness > nearest;
            slabs.keep_below(&mut before, at, nearness, TINY);
        }
        for one in before {
            all |= one;
        }
        all
    }
}

/// Finds out how near a pixel is at least.
impl Behind for f64 {
    fn nearness(&self, _: [f64; 2]) -> f64 {
        f64::NEG_INFINITY
    }

    fn is_behind(&mut self, surface: &Surface, [x, y]: [f64; 2], corners: &[[f64; 2]]) -> bool {
        for corner in corners {
            let nearness = surface.at([x + corner[0], y + corner[1]]);
            // A NaN is the least of all.
            *self = if nearness >= *self { *self } else { nearness };
        }
        true
    }
}

/// Something at a known nearness, or farther.
pub(crate) struct AtLeast(pub(crate) f64);

impl Behind for AtLeast {
    fn nearness(&self, _: [f64; 2]) -> f64 {
        f64::NEG_INFINITY
    }

    fn is_behind(&mut self, surface: &Surface, [x, y]: [f64; 2], corners: &[[f64; 2]]) -> bool {
        corners.iter().all(|corner| surface.at([x + corner[0], y + corner[1]]) >= self.0)
    }
}

/// A pixel, and the outlines that cover part of it.
pub(crate) struct Fusion<'a, B> {
    pixel: [f64; 2],
    /// The last so many that were added: round and round.
    met: [(&'a Surface, Cuts); MET],
    added: usize,
    /// Whether one of them covers the middle, and how near that is to be.
    middle: bool,
    limit: f64,
    steps: usize,
    behind: &'a mut B,
}

impl<'a, B: Behind> Fusion<'a, B> {
    pub(crate) fn new([column, row]: [usize; 2], behind: &'a mut B) -> Self {
        let pixel = [column as f64, row as f64];
        let none = (&Surface::NONE, Cuts { lines: [[0.0; 3]; CUTS], count: 0 });
        let limit = behind.nearness(pixel.map(|side| side + 0.5));
        Self { pixel, met: [none; MET], added: 0, middle: false, limit, steps: STEPS, behind }
    }

    /// What is farther than this in the middle of the pixel is of no use.
    #[inline(always)]
    pub(crate) fn limit(&self) -> f32 {
        down(self.limit)
    }

    /// Adds an outline and the surface within it, nearest last. What was added first gives way where there are too many.
    pub(crate) fn add(&mut self, surface: &'a Surface, outline: &Outline) {
        let [x, y] = self.pixel;
        if let Some(cuts) = outline.cuts(self.pixel)
            && surface.most([x, x + 1.0, y, y + 1.0]) > self.limit
        {
            self.middle |= cuts.leave_middle();
            self.met[self.added % MET] = (surface, cuts);
            self.added += 1;
        }
    }

    /// Whether the outlines cover the pixel together, each part of it before what is behind.
    pub(crate) fn covers(&mut self) -> bool {
        self.added > 1 && self.middle && self.covers_piece(&Piece::WHOLE, self.added)
    }

    /// Whether the first so many outlines cover a piece, as far as they are still there.
    fn covers_piece(&mut self, piece: &Piece, count: usize) -> bool {
        for i in (self.added.saturating_sub(MET)..count).rev() {
            if self.steps == 0 {
                return false;
            }
            self.steps -= 1;
            let (surface, cuts) = self.met[i % MET];
            let mut inside = *piece;
            for &line in &cuts.lines[..cuts.count] {
                let Some(part) = inside.part(line, true) else { return false };
                inside = part;
            }
            let corners = &inside.corners[..inside.count];
            if corners.is_empty() || !self.behind.is_behind(surface, self.pixel, corners) {
                continue;
            }
            let mut rest = *piece;
            for &line in &cuts.lines[..cuts.count] {
                let (Some(inner), Some(outer)) = (rest.part(line, true), rest.part(line, false)) else {
                    return false;
                };
                if outer.count > 0 && !self.covers_piece(&outer, i) {
                    return false;
                }
                rest = inner;
            }
            return true;
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::faces::LANES;
    use std::vec::Vec;

    /// What is found behind a surface at the corners of a piece is behind it at all points of the piece, by some bound.
    #[test]
    fn a_box_behind_at_the_corners_is_behind_throughout() {
        let mut state = 1u64;
        let mut random = |low: f64, high: f64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            low + (high - low) * ((state >> 11) as f64 / (1u64 << 53) as f64)
        };
        let (mut yes, mut no) = (0, 0);
        for _ in 0..4000 {
            let pixel = [random(0.0, 60.0).floor(), random(0.0, 30.0).floor()];
            let corners: Vec<_> = (0..5).map(|_| [random(0.0, 1.0), random(0.0, 1.0)]).collect();
            let mut planes = || {
                let [a, b] = [random(-0.2, 0.2), random(-0.2, 0.2)];
                [a, b, 5.0 - a * pixel[0] - b * pixel[1] + random(-0.2, 0.2)]
            };
            let slabs = Slabs::of([0; LANES].map(|_| planes()), 3);
            let mut shape = Shape::EMPTY;
            for _ in 0..2 {
                assert!(shape.bound(planes(), [64.0, 32.0]));
            }
            let surface = Surface::of(&shape.planes[..shape.plane_count]);
            let nearest = random(4.7, 5.3) as f32;
            let behind = (&slabs, nearest).is_behind(&surface, pixel, &corners);
            *(if behind { &mut yes } else { &mut no }) += 1;
            for i in 0..60 {
                // Corners first of all.
                let shares =
                    [0, 1, 2, 3, 4].map(|k| if i < 5 { f64::from(i == k) } else { random(0.0, 1.0) });
                let sum: f64 = shares.iter().sum();
                let [x, y] = [0, 1].map(|axis| {
                    pixel[axis] + (0..5).map(|k| corners[k][axis] * shares[k]).sum::<f64>() / sum
                });
                let bound = slabs.nearness([x, y]).min(f64::from(nearest));
                assert!(!behind || surface.at([x, y]) > bound, "{pixel:?} {corners:?} {x} {y}");
            }
        }
        assert!(yes > 500 && no > 500, "{yes} {no}");
    }
}
