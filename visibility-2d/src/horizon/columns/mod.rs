//! Columns of the horizon's picture. Each has a few steps; behind a step, everything between two heights is
//! hidden.

use super::frame::{FACES, Frame};
use super::outline::{Corner, CornerError, Edge, Outline, Post};
use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

/// Number of steps that a column keeps. With one fewer, a tower behind a house replaces a part of the house's
/// occlusion; one more made hardly any difference (measured).
pub(crate) const STEPS: usize = 3;

/// Step of a column. Every line of sight through the column with a height in the picture between `low` and
/// `high` has met an occluder at an inverse depth of at least `inverse_depth`.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Step {
    /// Inverse of the occluder's depth in 1/m. The step hides surfaces at this inverse depth or less.
    pub(crate) inverse_depth: f32,
    /// Height in the picture above which the step hides: height above the eye over depth.
    pub(crate) low: f32,
    /// Height in the picture below which the step hides: height above the eye over depth.
    pub(crate) high: f32,
}

impl Step {
    /// Step that hides nothing.
    const OPEN: Self = Self { inverse_depth: 0.0, low: f32::INFINITY, high: f32::NEG_INFINITY };

    /// Returns whether this step hides everything that `other` hides.
    fn covers(&self, other: &Self) -> bool {
        self.inverse_depth >= other.inverse_depth && self.low <= other.low && self.high >= other.high
    }

    /// Returns whether the height ranges of the two steps intersect.
    fn meets(&self, other: &Self) -> bool {
        self.low <= other.high && other.low <= self.high
    }
}

/// Number of columns of a [`Block`].
pub(crate) const BLOCK: usize = 8;

/// Steps of eight neighbouring columns, which are tested together. Arrays are indexed by the number of a step
/// (0 to [`STEPS`] - 1), then by the column in the block.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Block {
    /// Step that hides only what every column of the block hides, made from each column's step with the
    /// highest top.
    common: Step,
    /// For each step and column, the step's [inverse depth](Step::inverse_depth). The next two fields hold
    /// its lower and its upper height.
    inverse_depth: [[f32; BLOCK]; STEPS],
    low: [[f32; BLOCK]; STEPS],
    high: [[f32; BLOCK]; STEPS],
}

impl Block {
    const OPEN: Self = Self {
        common: Step::OPEN,
        inverse_depth: [[Step::OPEN.inverse_depth; BLOCK]; STEPS],
        low: [[Step::OPEN.low; BLOCK]; STEPS],
        high: [[Step::OPEN.high; BLOCK]; STEPS],
    };

    fn step(&self, step: usize, column: usize) -> Step {
        Step {
            inverse_depth: self.inverse_depth[step][column],
            low: self.low[step][column],
            high: self.high[step][column],
        }
    }

    fn set_step(&mut self, step: usize, column: usize, value: Step) {
        self.inverse_depth[step][column] = value.inverse_depth;
        self.low[step][column] = value.low;
        self.high[step][column] = value.high;
    }

    /// Computes `common` from the steps of the columns.
    fn summarize(&mut self) {
        let mut all = Step { inverse_depth: f32::INFINITY, low: f32::NEG_INFINITY, high: f32::INFINITY };
        for column in 0..BLOCK {
            let mut highest = self.step(0, column);
            for step in 1..STEPS {
                let other = self.step(step, column);
                highest = if other.high > highest.high { other } else { highest };
            }
            all = Step {
                inverse_depth: all.inverse_depth.min(highest.inverse_depth),
                low: all.low.max(highest.low),
                high: all.high.min(highest.high),
            };
        }
        self.common = all;
    }

    /// Returns whether the common step hides, in all columns, a surface between the heights `low` and `high`
    /// at inverse depth `inverse_depth` or less.
    #[inline(always)]
    pub(crate) fn is_hidden_throughout(&self, inverse_depth: f32, low: f32, high: f32) -> bool {
        let Step { inverse_depth: w, low: from, high: to } = self.common;
        (w > inverse_depth) & (from < low) & (to > high)
    }

    /// Returns a mask of the columns with a step that hides a surface between the heights `low` and `high` at
    /// inverse depth `inverse_depth` or less.
    // Not inlined, because the loop compiles to vector instructions only in a separate function.
    #[inline(never)]
    pub(crate) fn hides(&self, inverse_depth: f32, low: f32, high: f32) -> u32 {
        // Masks are made by selection instead of shifts, since SSE2 shifts all lanes by the same number.
        const BITS: [u32; BLOCK] = [1, 2, 4, 8, 16, 32, 64, 128];
        let mut any = [0u32; BLOCK];
        for step in 0..STEPS {
            let (w, from, to) = (&self.inverse_depth[step], &self.low[step], &self.high[step]);
            for column in 0..BLOCK {
                let is = (w[column] > inverse_depth) & (from[column] < low) & (to[column] > high);
                any[column] |= if is { BITS[column] } else { 0 };
            }
        }
        any.iter().fold(0, |all, one| all | one)
    }
}

/// Columns of the four faces of the picture.
#[derive(Clone, Debug)]
pub(crate) struct Columns {
    /// Number of columns of each face, without those that fill up its last block.
    per_face: usize,
    /// Blocks of columns of all faces, face by face, in a face from its right edge on. The number of columns
    /// of each face is rounded up to whole blocks.
    blocks: Vec<Block>,
    /// For each face, the half-open range of the columns in view, counted from the right edge of the face.
    /// Empty for a face that is not in view.
    seen: [Range<usize>; FACES],
    outline: Outline,
    /// Scratch of [`draw`](Self::draw): three lists with one entry for each boundary between two columns of a
    /// face, from its right edge on. They hold the height of the occluder's top in the picture, the negated
    /// height of its bottom, and its inverse depth in 1/m.
    sides: [Vec<f64>; 3],
}

impl Columns {
    /// Makes columns that hide nothing.
    pub(crate) fn new(per_face: usize) -> Self {
        Self {
            per_face,
            blocks: vec![Block::OPEN; per_face.div_ceil(BLOCK) * FACES],
            seen: [const { 0..0 }; FACES],
            outline: Outline::default(),
            sides: core::array::from_fn(|_| vec![0.0; per_face + 1]),
        }
    }

    pub(crate) fn per_face(&self) -> usize {
        self.per_face
    }

    /// Returns the half-open range of the columns in view of a face. Empty if none is.
    pub(crate) fn seen(&self, face: usize) -> Range<usize> {
        self.seen[face].clone()
    }

    /// Returns the columns of one face, in blocks of [`BLOCK`] from its right edge. The last block may have
    /// columns beyond the face.
    pub(crate) fn face(&self, face: usize) -> &[Block] {
        let count = self.per_face.div_ceil(BLOCK);
        &self.blocks[face * count..][..count]
    }

    fn face_mut(&mut self, face: usize) -> &mut [Block] {
        let count = self.per_face.div_ceil(BLOCK);
        &mut self.blocks[face * count..][..count]
    }

    /// Takes the range of columns in view from a new frame, and clears these columns.
    pub(crate) fn begin(&mut self, frame: &Frame) {
        for (face, seen) in frame.seen.iter().enumerate() {
            let last = self.per_face as f64;
            let begin = (seen.start * last) as usize;
            let end = ((seen.end * last) as usize + 1).min(self.per_face);
            self.seen[face] = if seen.is_empty() { 0..0 } else { begin.min(end)..end };
            let blocks = self.seen[face].start / BLOCK..self.seen[face].end.div_ceil(BLOCK);
            self.face_mut(face)[blocks].fill(Block::OPEN);
        }
    }

    /// Adds a convex solid, given by posts of which it is the hull. Each post may be wrong by at most `error`
    /// metres: an upright segment at most this far away certainly lies inside the solid.
    pub(crate) fn draw_solid(&mut self, frame: &Frame, posts: &[Post], error: f64) {
        for face in 0..FACES {
            if self.seen[face].is_empty() {
                continue;
            }
            let mut outline = core::mem::take(&mut self.outline);
            if outline.project(frame, posts, error, face, self.per_face) {
                self.draw(face, &outline, false);
            }
            self.outline = outline;
        }
    }

    /// Adds a wall of upright panels, two posts each. A panel's front is to the right when walking from its
    /// first post to its second; its back only hides if `two_sided`. `error` bounds the distance in metres of
    /// each post from the exact one.
    pub(crate) fn draw_wall(&mut self, frame: &Frame, posts: &[Post], error: f64, two_sided: bool) {
        for face in 0..FACES {
            if self.seen[face].is_empty() {
                continue;
            }
            let mut outline = core::mem::take(&mut self.outline);
            if outline.project_wall(frame, posts, error, face, self.per_face) {
                while outline.next_run(two_sided) {
                    self.draw(face, &outline, true);
                }
            }
            self.outline = outline;
        }
    }

    /// Adds a step to all columns of the block with index `block` in a face. A step whose top, rounded, is
    /// not above its bottom hides nothing, and is left out: its top could be the highest of its columns.
    pub(crate) fn add_step(&mut self, face: usize, block: usize, step: Step) {
        if step.low >= step.high {
            return;
        }
        let block = &mut self.face_mut(face)[block];
        (0..BLOCK).for_each(|column| insert(block, column, step));
        block.summarize();
    }

    /// Adds the area between the upper and the lower part of an outline to the columns of a face that both
    /// parts span. `bends` is true if the parts may bend inwards, as those of walls do.
    fn draw(&mut self, face: usize, outline: &Outline, bends: bool) {
        let Outline { upper, lower, error, .. } = outline;
        let ([first, .., last], [low_first, .., low_last]) = (&upper[..], &lower[..]) else { return };
        let begin = first.column.max(low_first.column) + error.column;
        let end = last.column.min(low_last.column) - error.column;
        let seen = self.seen[face].clone();
        // The whole columns that both outlines span, clamped to those in view.
        let begin = (ceil(begin).max(seen.start as f64)) as usize;
        let end = (end.min(seen.end as f64).max(0.0)) as usize;
        if begin >= end {
            return;
        }
        let sides = &mut self.sides;
        // Upper height, negated lower height and inverse depth at each boundary between columns. Each is
        // bounded such that the column hides no more than the occluder does.
        sides.iter_mut().for_each(|entries| entries[begin..=end].fill(f64::INFINITY));
        let [highs, lows, inverse_depths] = sides;
        sample(&mut highs[begin..=end], &mut inverse_depths[begin..=end], begin, upper, error, 1.0);
        sample(&mut lows[begin..=end], &mut inverse_depths[begin..=end], begin, lower, error, -1.0);
        // The outline of a wall may dip at a corner between two boundaries, so the corner's height also
        // counts for its column.
        if bends {
            for (outline, heights, sense) in [(upper, &mut *highs, 1.0), (lower, &mut *lows, -1.0)] {
                for corner in &outline[1..outline.len() - 1] {
                    let inverse_depths = &mut inverse_depths[begin..=end];
                    lower_at(&mut heights[begin..=end], inverse_depths, begin, corner, error, sense);
                }
            }
        }
        let count = self.per_face.div_ceil(BLOCK);
        let blocks = &mut self.blocks[face * count..][..count];
        // A column takes the lesser of the values at its two boundaries, rounded inwards.
        for column in begin..end {
            let least =
                |of: &[f64]| (if of[column] < of[column + 1] { of[column] } else { of[column + 1] }) as f32;
            let (high, low, inverse_depth) = (least(highs), -least(lows), least(inverse_depths));
            // Rounding to `f32` has an error of 2^-24 of the number, or of the least denormal number.
            let step = Step {
                inverse_depth: inverse_depth - inverse_depth * INWARDS,
                low: low + (low.abs() * INWARDS + f32::MIN_POSITIVE),
                high: high - (high.abs() * INWARDS + f32::MIN_POSITIVE),
            };
            if step.low < step.high && step.inverse_depth >= f32::MIN_POSITIVE {
                insert(&mut blocks[column / BLOCK], column % BLOCK, step);
            }
        }
        blocks[begin / BLOCK..end.div_ceil(BLOCK)].iter_mut().for_each(Block::summarize);
    }
}

/// Amount by which a height or an inverse depth is moved inwards (hiding less) after rounding to `f32`,
/// relative to its magnitude: twice the unit round-off.
const INWARDS: f32 = f32::EPSILON;

/// Returns the smallest integer not less than `x`.
fn ceil(x: f64) -> f64 {
    let whole = x.clamp(-1e15, 1e15) as i64 as f64;
    if whole < x { whole + 1.0 } else { whole }
}

/// Lowers each entry of `heights` and `inverse_depths` to the height and the inverse depth of an outline
/// minus their error bounds, if that is less. `sense` is 1 for an upper outline and -1 for a lower one, whose
/// heights are negated. Entry `i` of either list is for the right side of column `begin + i`: the boundary
/// between two columns.
fn sample(
    heights: &mut [f64],
    inverse_depths: &mut [f64],
    begin: usize,
    outline: &[Corner],
    error: &CornerError,
    sense: f64,
) {
    let last = (begin + heights.len() - 1) as f64;
    for pair in outline.windows(2) {
        // Boundaries that the exact edge may cross.
        let (from, to) = (pair[0].column - error.column, pair[1].column + error.column);
        if to < begin as f64 || from > last {
            continue;
        }
        let edge = Edge::new(pair[0], pair[1], error, sense);
        let from = ceil(from.max(begin as f64));
        let range = from as usize - begin..(to.min(last)) as usize + 1 - begin;
        let Some(heights) = heights.get_mut(range.clone()) else { continue };
        let (mut inverse_depth, mut height) = edge.at(from);
        for (h, w) in heights.iter_mut().zip(&mut inverse_depths[range]) {
            *h = if height < *h { height } else { *h };
            *w = if inverse_depth < *w { inverse_depth } else { *w };
            (inverse_depth, height) = (inverse_depth + edge.inverse_depth_slope, height + edge.slope);
        }
    }
}

/// Like [`sample`], for a single corner of an outline: lowers the entries for the right side of each column
/// that the exact corner may be in. This also lowers the column to the right of it, which shares this side.
fn lower_at(
    heights: &mut [f64],
    inverse_depths: &mut [f64],
    begin: usize,
    corner: &Corner,
    error: &CornerError,
    sense: f64,
) {
    let last = (begin + heights.len() - 1) as f64;
    let (from, to) = (corner.column - error.column, corner.column + error.column);
    if to < begin as f64 || from > last {
        return;
    }
    let range = from.max(begin as f64) as usize - begin..to.min(last) as usize + 1 - begin;
    let Some(heights) = heights.get_mut(range.clone()) else { return };
    let height = sense * corner.height - 4.0 * error.height;
    let inverse_depth = corner.inverse_depth - 4.0 * error.inverse_depth;
    for (h, w) in heights.iter_mut().zip(&mut inverse_depths[range]) {
        *h = h.min(height);
        *w = w.min(inverse_depth);
    }
}

/// Adds a step to a column of a block. If the column is full, the step that spans the least height, old or
/// new, is dropped.
fn insert(block: &mut Block, column: usize, step: Step) {
    // Shortcut for the first step of a column, since most columns are drawn only once.
    if block.high.iter().all(|high| high[column] == f32::NEG_INFINITY) {
        return block.set_step(0, column, step);
    }
    // If the height ranges of two steps meet, their union is hidden behind the farther of the two.
    let mut steps: [Step; STEPS] = core::array::from_fn(|old| block.step(old, column));
    let mut new = step;
    for old in &steps {
        if old.covers(&step) {
            return;
        }
        if old.inverse_depth >= new.inverse_depth && old.meets(&new) {
            (new.low, new.high) = (new.low.min(old.low), new.high.max(old.high));
        }
    }
    let span = |step: &Step| step.high - step.low;
    let mut least = 0;
    for index in 0..STEPS {
        let old = &mut steps[index];
        // An open step meets no other.
        if old.inverse_depth < new.inverse_depth && old.meets(&new) {
            (old.low, old.high) = (old.low.min(new.low), old.high.max(new.high));
            block.set_step(index, column, *old);
        }
        if new.covers(old) {
            *old = Step::OPEN;
            block.set_step(index, column, *old);
        }
        if span(&steps[index]) < span(&steps[least]) {
            least = index;
        }
    }
    if span(&steps[least]) < span(&new) {
        block.set_step(least, column, new);
    }
}

#[cfg(test)]
mod tests;
