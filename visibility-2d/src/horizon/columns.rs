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
        if old.inverse_depth > 0.0 && old.inverse_depth < new.inverse_depth && old.meets(&new) {
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
mod tests {
    use super::*;
    use crate::horizon::column_query::QueryEye;
    use visibility_core::Aabb;
    use visibility_testing::{End, UNIT, ends, ends_f32};

    /// Number of columns of each face.
    const COUNT: usize = 16;

    /// Greatest distance in ranks from a border at which margins may decide either way.
    const HAIR: i64 = 2;

    /// Returns columns of which only a part of face 0 is in view, from `begin` to `end`, in columns.
    fn columns(begin: f64, end: f64) -> Columns {
        let mut columns = Columns::new(COUNT);
        let mut seen = [const { 0.0..0.0 }; FACES];
        seen[0] = begin / COUNT as f64..end / COUNT as f64;
        let mut frame = Frame::BLIND;
        frame.seen = seen;
        columns.begin(&frame);
        columns
    }

    fn start(column: usize) -> i64 {
        UNIT * column as i64
    }

    #[test]
    fn columns_in_view_are_those_that_the_view_meets() {
        let all = ends(1, COUNT as i32 - 1);
        for (i, begin) in all.iter().enumerate() {
            for end in &all[i + 1..] {
                let seen = columns(begin.value, end.value).seen(0);
                for column in 0..COUNT {
                    let is_met = begin.rank < start(column + 1) && end.rank > start(column);
                    let is_near = begin.rank - HAIR <= start(column + 1) && end.rank + HAIR >= start(column);
                    let is_seen = seen.contains(&column);
                    assert!(is_seen || !is_met, "{begin:?} to {end:?} meets {column}");
                    assert!(!is_seen || is_near, "{begin:?} to {end:?} is far from {column}");
                }
            }
        }
    }

    /// A step whose top is below its bottom leaves the block as it was, also if its top is the highest.
    #[test]
    fn inverted_steps_are_left_out() {
        let mut columns = columns(0.0, COUNT as f64);
        let step = |low, high| Step { inverse_depth: 0.5, low, high };
        columns.add_step(0, 0, step(0.0, 1.0));
        for (low, high) in [(3.0, 2.0), (2.0, 2.0)] {
            columns.add_step(0, 0, step(low, high));
            let block = &columns.face(0)[0];
            assert_eq!(block.common, step(0.0, 1.0), "the common step, after one from {low} to {high}");
            assert!(
                (0..BLOCK).all(|column| block.step(1, column) == Step::OPEN),
                "steps from {low} to {high}"
            );
        }
    }

    /// Returns an outline from height -1 up to the given corners (column and height), at depth 1.
    fn outline(upper: &[(f64, f64)], error: f64) -> Outline {
        let corner = |&(column, height): &(f64, f64)| Corner { column, height, inverse_depth: 1.0 };
        let lower = [upper[0].0, upper[upper.len() - 1].0].map(|column| (column, -1.0));
        let mut outline = Outline::default();
        outline.upper.extend(upper.iter().map(corner));
        outline.lower.extend(lower.iter().map(corner));
        outline.error.column = error;
        outline
    }

    /// Returns whether a column hides a surface at a height, slightly behind the outlines.
    fn hides(columns: &Columns, column: usize, height: f32) -> bool {
        columns.face(0)[column / BLOCK].hides(0.9, -0.9, height) >> (column % BLOCK) & 1 == 1
    }

    #[test]
    fn outlines_hide_the_columns_between_their_ends() {
        let all = ends(-2, COUNT as i32 + 2);
        for (error, ranks) in [(0.0, 0), (0.25, 3)] {
            for (low, high) in all.iter().flat_map(|low| all.iter().map(move |high| (low, high))) {
                let mut columns = columns(2.5, 12.5);
                columns.draw(0, &outline(&[(low.value, 1.0), (high.value, 1.0)], error), false);
                for column in 0..COUNT {
                    let holds = |hair: i64| {
                        low.rank + ranks + hair <= start(column)
                            && start(column + 1) <= high.rank - ranks - hair
                    };
                    let is_hidden = hides(&columns, column, 0.9);
                    // The sum of an end and an error is rounded to the next number, for which errors allow.
                    let is_held = holds(-i64::from(error > 0.0));
                    assert!(!is_hidden || is_held, "{low:?} to {high:?}, {error}: not all of {column}");
                    let is_seen = (2..=12).contains(&column);
                    assert_eq!(
                        is_hidden,
                        is_hidden && is_seen,
                        "{low:?} to {high:?}: column {column} is hidden out of view"
                    );
                    assert!(is_hidden || !is_seen || !holds(HAIR), "{low:?} to {high:?}, {error}: {column}");
                }
            }
        }
    }

    /// A wall that is lower at one corner, as a notch or as a step. The column of the corner must not hide
    /// above the lower height.
    #[test]
    fn corners_lower_the_columns_that_they_are_in() {
        for End { value, rank } in ends(1, 15) {
            let notch = [(0.0, 1.0), (value, 0.25), (16.0, 1.0)];
            let down = [(0.0, 1.0), (value, 1.0), (value, 0.25), (16.0, 0.25)];
            let up = [(0.0, 0.25), (value, 0.25), (value, 1.0), (16.0, 1.0)];
            for (shape, upper) in [&notch[..], &down, &up].into_iter().enumerate() {
                let mut columns = columns(0.0, 16.0);
                columns.draw(0, &outline(upper, 0.0), true);
                for column in 0..COUNT {
                    let is_before = start(column + 1) <= rank;
                    let is_behind = start(column) > rank;
                    let is_low = match shape {
                        0 => !is_before && !is_behind,
                        1 => !is_before,
                        _ => !is_behind,
                    };
                    let what = || std::format!("shape {shape}, corner {value}, column {column}");
                    assert!(!is_low || !hides(&columns, column, 0.26), "{}", what());
                    assert!(hides(&columns, column, 0.24), "{}", what());
                    // The boundary before the corner is lowered, and with it the column before that.
                    let is_clear = start(column + 2) + HAIR < rank || start(column) - HAIR > rank;
                    assert!(is_low || !is_clear || shape == 0 || hides(&columns, column, 0.9), "{}", what());
                }
            }
        }
    }

    /// A flat box behind columns, all of which hide it except one.
    #[test]
    fn boxes_are_hidden_unless_they_meet_the_only_open_column() {
        let mut frame = Frame::BLIND;
        frame.error = 0.0;
        let eye = QueryEye::new(&frame);
        // At a depth of half the number of columns, a column is a metre wide.
        let (half, all) = (COUNT as i16 / 2, ends_f32(-9, 9));
        let depth = f32::from(half);
        for open in 0..COUNT {
            let mut columns = columns(1.5, 14.5);
            for column in (0..COUNT).filter(|&column| column != open) {
                let step = Step { inverse_depth: 9.0, low: -9.0, high: 9.0 };
                insert(&mut columns.face_mut(0)[column / BLOCK], column % BLOCK, step);
            }
            columns.face_mut(0).iter_mut().for_each(Block::summarize);
            for (i, low) in all.iter().enumerate() {
                for high in &all[i..] {
                    let bounds = Aabb::from_arrays([depth, low.value, -1.0], [depth, high.value, 1.0]);
                    let [from, to] = [low, high].map(|end| end.rank + UNIT * i64::from(half));
                    let meets = |column: usize, hair: i64| {
                        from - hair < start(column + 1) && to + hair > start(column)
                    };
                    let is_hidden = columns.hides_box(&eye, [0, 1, 2], &bounds);
                    let is_open = (1..=14).contains(&open) && meets(open, 0);
                    assert!(!is_hidden || !is_open, "{low:?} to {high:?}, open {open}");
                    let is_in_view = (1..=14).any(|column| meets(column, 0));
                    assert!(
                        is_hidden || !is_in_view || meets(open, HAIR),
                        "{low:?} to {high:?}, open {open}"
                    );
                    let mut parts = Vec::new();
                    columns.for_each_part(&eye, [0, 1, 2], &bounds, |face, first, last, _| {
                        parts.push((face, first, last));
                        true
                    });
                    let in_part =
                        |column| parts.iter().any(|&(_, first, last)| (first..=last).contains(&column));
                    for column in 1..=14 {
                        assert!(in_part(column) || !meets(column, 0), "{low:?} to {high:?}: {parts:?}");
                        assert!(!in_part(column) || meets(column, HAIR), "{low:?} to {high:?}: {parts:?}");
                    }
                    assert!(
                        parts.iter().all(|&(face, first, last)| face == 0 && 1 <= first && last <= 14),
                        "{low:?} to {high:?}: parts in view: {parts:?}"
                    );
                }
            }
        }
    }

    /// Steps of a column hide, at each height, no more than the steps that were added to it. The first ones,
    /// as many as there is room for, hide all that they hid alone.
    #[test]
    fn steps_of_a_column_hide_what_was_added() {
        let mut random = visibility_testing::Random(1);
        for trial in 0..1_000 {
            let (mut block, mut added) = (Block::OPEN, Vec::new());
            for _ in 0..6 {
                let [a, b] = [(); 2].map(|()| random.below(7) as f32);
                let step =
                    Step { inverse_depth: 1.0 + random.below(4) as f32, low: a.min(b), high: a.max(b) + 1.0 };
                insert(&mut block, 3, step);
                added.push(step);
                // At half of each height and inverse depth, so that no two numbers are equal.
                for (low, high) in
                    (0..8).flat_map(|low| (low..8).map(move |high| (low as f32 + 0.5, high as f32 + 0.5)))
                {
                    for behind in [0.5, 1.5, 2.5, 3.5] {
                        let is_hidden = block.hides(behind, low, high) == 1 << 3;
                        let holds = |at: f32| {
                            added
                                .iter()
                                .any(|step| step.inverse_depth > behind && step.low <= at && at <= step.high)
                        };
                        let is_held =
                            (0..=14).map(|i| low + 0.5 * i as f32).filter(|at| *at <= high).all(holds);
                        assert!(
                            !is_hidden || is_held,
                            "trial {trial}: {low} to {high}, {behind} by {added:?}"
                        );
                        let alone =
                            |step: &Step| step.inverse_depth > behind && step.low < low && high < step.high;
                        let is_own = added.len() <= STEPS && added.iter().any(alone);
                        assert!(
                            is_hidden || !is_own,
                            "trial {trial}: {low} to {high}, {behind} by {added:?}"
                        );
                    }
                }
            }
        }
    }
}
