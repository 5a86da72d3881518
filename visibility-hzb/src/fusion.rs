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
//! no more than a strip of that width. After [`STEPS`] outlines of [`CUTS`] cuts each, every point of the pixel is within `2^-40` of a
//! piece that was found inside an outline, and so within that outline. Over such a distance a plane differs by `2^-40` of its slopes, where
//! `2^-22` of them for each column and row of the picture were taken off ([`Shape::bound`]); bounds on a box are moved by `2^-30` of theirs.

use crate::faces::Slabs;
use crate::shape::{Shape, down};
use crate::tiles::Surface;

/// The most edges of outlines that are remembered, two of them level: boxes have six.
const EDGES: usize = 8;

/// The most of them that may cut a pixel.
const CUTS: usize = 4;

/// Outlines that a tile remembers.
const MET: usize = 8;

/// Outlines that are tried on pieces of one pixel before it is left undecided.
const STEPS: usize = 32;

/// Pieces that wait to be covered.
const BARE: usize = 12;

/// The most corners of a piece. Each cut adds one at most; what would have more is left undecided.
const CORNERS: usize = 7;

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

/// The half-planes of a shape: `a x + b y + c >= 0`, in pixels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Outline {
    /// All zeros where there is none.
    a: [f32; EDGES],
    b: [f32; EDGES],
    c: [f64; EDGES],
    /// Between which columns all of it lies.
    columns: [f32; 2],
}

impl Outline {
    /// That of nothing.
    pub(crate) const NONE: Self = Self {
        a: [0.0; EDGES],
        b: [0.0; EDGES],
        c: [0.0; EDGES],
        columns: [f32::INFINITY, f32::NEG_INFINITY],
    };

    /// That of a shape with conservative coverage; of nothing if it has too many edges.
    #[inline(always)]
    pub(crate) fn of(shape: &Shape) -> Self {
        let mut outline = Self::NONE;
        // Two more are level.
        if shape.lefts + shape.rights > EDGES - 2 {
            return outline;
        }
        outline.columns = shape.columns;
        let mut count = 2;
        // A bound on pixels holds at their worst corner; taken back, it is one on points.
        for line in &shape.left[..shape.lefts] {
            let (s, t) = (f64::from(line.slope), f64::from(line.offset));
            (outline.a[count], outline.b[count]) = (1.0, -line.slope);
            outline.c[count] = -(t - if s > 0.0 { s } else { 0.0 });
            count += 1;
        }
        for line in &shape.right[..shape.rights] {
            let (s, t) = (f64::from(line.slope), f64::from(line.offset));
            (outline.a[count], outline.b[count]) = (-1.0, line.slope);
            outline.c[count] = t - if s < 0.0 { s } else { 0.0 };
            count += 1;
        }
        let [top, bottom] = shape.heights.map(f64::from);
        (outline.b[0], outline.c[0]) = (1.0, -top);
        (outline.b[1], outline.c[1]) = (-1.0, bottom);
        outline
    }

    /// What of it cuts a pixel; `None` if it misses the pixel or cuts it too often. All edges at once, since most cut nothing.
    #[inline(always)]
    fn cuts(&self, [x, y]: [f64; 2]) -> Option<Cuts> {
        let [left, right] = self.columns.map(f64::from);
        let (mut lines, mut cuts) = ([[0.0; EDGES]; 3], [false; EDGES]);
        // A NaN misses, and is outside.
        let (mut misses, mut off_middle) = (!(left < x + 1.0) | !(right > x), false);
        for i in 0..EDGES {
            let (a, b) = (f64::from(self.a[i]), f64::from(self.b[i]));
            let c = (a * x + b * y) + self.c[i];
            let low = if a < 0.0 { a } else { 0.0 } + if b < 0.0 { b } else { 0.0 };
            let high = if a > 0.0 { a } else { 0.0 } + if b > 0.0 { b } else { 0.0 };
            (lines[0][i], lines[1][i], lines[2][i]) = (a, b, c);
            cuts[i] = !(c + low >= 0.0);
            misses |= cuts[i] & !(c + high > 0.0);
            off_middle |= !(c + 0.5 * (a + b) >= 0.0);
        }
        if misses {
            return None;
        }
        let mut all = Cuts { lines: [[0.0; 3]; CUTS], count: 0, leave_middle: !off_middle };
        for i in 0..EDGES {
            if cuts[i] {
                *all.lines.get_mut(all.count)? = [lines[0][i], lines[1][i], lines[2][i]];
                all.count += 1;
            }
        }
        Some(all)
    }
}

/// Lines `a x + b y + c >= 0` that cut a pixel, in coordinates that count from its upper left corner.
#[derive(Clone, Copy)]
struct Cuts {
    lines: [[f64; 3]; CUTS],
    count: usize,
    /// Whether the middle of the pixel is on the inner side of all.
    leave_middle: bool,
}

/// A convex piece of a pixel, in coordinates that count from its upper left corner.
#[derive(Clone, Copy)]
pub(crate) struct Piece {
    /// One more than there may be: what does not count is written there.
    x: [f64; CORNERS + 1],
    y: [f64; CORNERS + 1],
    count: usize,
}

impl Piece {
    const NONE: Self = Self { x: [0.0; CORNERS + 1], y: [0.0; CORNERS + 1], count: 0 };

    pub(crate) const WHOLE: Self = {
        let mut piece = Self::NONE;
        (piece.x[1], piece.x[2]) = (1.0, 1.0);
        (piece.y[2], piece.y[3]) = (1.0, 1.0);
        piece.count = 4;
        piece
    };

    /// The parts on the inner and the outer side of a line; `None` if one would have too many corners. Both have corners where a side crosses
    /// the line.
    #[inline(always)]
    fn split(&self, [a, b, c]: [f64; 3]) -> Option<[Self; 2]> {
        let count = self.count.min(CORNERS);
        let (mut values, mut kept) = ([0.0; CORNERS + 1], 0);
        for i in 0..CORNERS + 1 {
            values[i] = a * self.x[i] + b * self.y[i] + c;
            // A NaN is outside.
            kept += usize::from((values[i] >= 0.0) & (i < count));
        }
        if kept == count {
            return Some([*self, Self::NONE]);
        }
        if kept == 0 {
            return Some([Self::NONE, *self]);
        }
        let [mut inner, mut outer] = [Self::NONE; 2];
        let mut from = count - 1;
        for to in 0..count {
            let (before, value) = (values[from], values[to]);
            let inside = value >= 0.0;
            let crosses = inside != (before >= 0.0);
            let share = before / (before - value);
            let [dx, dy] = [self.x[to] - self.x[from], self.y[to] - self.y[from]];
            let between = [self.x[from] + dx * share, self.y[from] + dy * share];
            inner.push(between, crosses);
            outer.push(between, crosses);
            inner.push([self.x[to], self.y[to]], inside);
            outer.push([self.x[to], self.y[to]], !inside);
            from = to;
        }
        (inner.count <= CORNERS && outer.count <= CORNERS).then_some([inner, outer])
    }

    /// Adds a corner if it counts, without a branch.
    #[inline(always)]
    fn push(&mut self, [x, y]: [f64; 2], counts: bool) {
        let place = self.count.min(CORNERS);
        (self.x[place], self.y[place]) = (x, y);
        self.count += usize::from(counts);
    }

    /// The corners, in pixels from a pixel at `at`.
    #[inline(always)]
    pub(crate) fn corners(&self, at: [f64; 2]) -> impl Iterator<Item = [f64; 2]> {
        (0..self.count.min(CORNERS)).map(move |i| [at[0] + self.x[i], at[1] + self.y[i]])
    }
}

/// What a pixel is to be nearer than.
pub(crate) trait Behind {
    /// How near it is at a point, more or less: what is farther there is not looked at.
    fn nearness(&self, at: [f64; 2]) -> f64;

    /// Whether a surface is before all of it within a piece of a pixel.
    fn is_behind(&mut self, surface: &Surface, pixel: [f64; 2], piece: &Piece) -> bool;
}

/// A box is that, by its sides and by a nearness that none of it exceeds.
impl Behind for (&Slabs, f32) {
    #[inline(always)]
    fn nearness(&self, at: [f64; 2]) -> f64 {
        self.0.nearness(at).min(f64::from(self.1))
    }

    #[inline(always)]
    fn is_behind(&mut self, surface: &Surface, pixel: [f64; 2], piece: &Piece) -> bool {
        let (slabs, nearest) = (self.0, f64::from(self.1));
        let (mut before, mut all) = (slabs.uppers(), true);
        for at in piece.corners(pixel) {
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

    fn is_behind(&mut self, surface: &Surface, pixel: [f64; 2], piece: &Piece) -> bool {
        for at in piece.corners(pixel) {
            let nearness = surface.at(at);
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

    fn is_behind(&mut self, surface: &Surface, pixel: [f64; 2], piece: &Piece) -> bool {
        piece.corners(pixel).all(|at| surface.at(at) >= self.0)
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
    #[inline(always)]
    pub(crate) fn new([column, row]: [usize; 2], behind: &'a mut B) -> Self {
        let pixel = [column as f64, row as f64];
        let none = (&Surface::NONE, Cuts { lines: [[0.0; 3]; CUTS], count: 0, leave_middle: false });
        let limit = behind.nearness(pixel.map(|side| side + 0.5));
        Self { pixel, met: [none; MET], added: 0, middle: false, limit, steps: STEPS, behind }
    }

    /// What is farther than this in the middle of the pixel is of no use.
    #[inline(always)]
    pub(crate) fn limit(&self) -> f32 {
        down(self.limit)
    }

    /// Adds an outline and the surface within it, nearest last. What was added first gives way where there are too many.
    #[inline(always)]
    pub(crate) fn add(&mut self, surface: &'a Surface, outline: &Outline) {
        let [x, y] = self.pixel;
        if let Some(cuts) = outline.cuts(self.pixel)
            && surface.most([x, x + 1.0, y, y + 1.0]) > self.limit
        {
            self.middle |= cuts.leave_middle;
            self.met[self.added % MET] = (surface, cuts);
            self.added += 1;
        }
    }

    /// Whether the outlines cover the pixel together, each part of it before what is behind.
    #[inline(always)]
    pub(crate) fn covers(&mut self) -> bool {
        if self.added < 2 || !self.middle {
            return false;
        }
        // What has to be covered, each by the first so many outlines, as far as they are still there.
        let mut bare = [(Piece::NONE, 0); BARE];
        bare[0] = (Piece::WHOLE, self.added);
        let mut count = 1;
        while count > 0 {
            count -= 1;
            let (piece, mut i) = bare[count];
            // The nearest outline that covers part of it; without one, it stays bare.
            count = loop {
                if i <= self.added.saturating_sub(MET) || self.steps == 0 {
                    return false;
                }
                (i, self.steps) = (i - 1, self.steps - 1);
                let (surface, cuts) = &self.met[i % MET];
                let (mut inside, mut end) = (piece, count);
                for &line in &cuts.lines[..cuts.count.min(CUTS)] {
                    let Some([inner, outer]) = inside.split(line) else { return false };
                    if outer.count > 0 {
                        let Some(place) = bare.get_mut(end) else { return false };
                        (*place, end) = ((outer, i), end + 1);
                    }
                    inside = inner;
                    if inside.count == 0 {
                        break;
                    }
                }
                if inside.count > 0 && self.behind.is_behind(surface, self.pixel, &inside) {
                    break end;
                }
            };
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::faces::LANES;
    use crate::random::random;
    use std::vec::Vec;

    #[test]
    fn parts_are_all_of_a_piece() {
        let mut source = random(3);
        let mut random = || source(0.0, 1.0);
        let area = |piece: &Piece| {
            let corners: Vec<_> = piece.corners([0.0; 2]).collect();
            let twice = |i: usize| {
                let ([a, b], [c, d]) = (corners[i], corners[(i + 1) % corners.len()]);
                a * d - b * c
            };
            (0..corners.len()).map(twice).sum::<f64>() * 0.5
        };
        let mut refused = 0;
        for _ in 0..2_000 {
            let mut piece = Piece::WHOLE;
            // Cuts that take corners off leave more of them.
            for _ in 0..12 {
                let (turn, distance) = (6.3 * random(), 0.4 + 0.2 * random());
                let (a, b) = (turn.cos(), turn.sin());
                match piece.split([a, b, distance - 0.5 * (a + b)]) {
                    Some([inner, outer]) => {
                        assert!((area(&inner) + area(&outer) - area(&piece)).abs() < 1e-12);
                        piece = inner;
                    }
                    None => refused += 1,
                }
            }
        }
        assert!(refused > 100, "{refused}");
    }

    /// Quadrilaterals at random before something that covers all of the pixel, or all but a part: what is found covered is, at every point.
    #[test]
    fn what_is_found_covered_has_no_hole() {
        let mut source = random(7);
        let mut random = || source(0.0, 1.0);
        let mut found = [[0; 2]; 2];
        for trial in 0..20_000 {
            let mut outlines = [Outline { columns: [-1.0, 2.0], ..Outline::NONE }; MET];
            let hole = trial % 2 == 1;
            let line = |outline: &mut Outline, i: usize, turn: f64, at: [f64; 2]| {
                (outline.a[i], outline.b[i]) = (turn.cos() as f32, turn.sin() as f32);
                outline.c[i] = -(f64::from(outline.a[i]) * at[0] + f64::from(outline.b[i]) * at[1]);
            };
            let [base, quads @ ..] = &mut outlines;
            if hole {
                line(base, 0, 6.3 * random(), [random(), random()]);
            }
            for quad in quads {
                let (center, size, turn) = ([random(), random()], 0.1 + 0.4 * random(), 6.3 * random());
                for i in 0..CUTS {
                    let turn = turn + 1.6 * i as f64 + 0.5 * random();
                    line(quad, i, turn, [center[0] - size * turn.cos(), center[1] - size * turn.sin()]);
                }
            }
            let (mut nearness, surface) = (f64::INFINITY, Surface::flat(1.0));
            let mut fusion = Fusion::new([0, 0], &mut nearness);
            outlines.iter().for_each(|outline| fusion.add(&surface, outline));
            let covers = fusion.covers();
            found[usize::from(hole)][usize::from(covers)] += 1;
            for _ in 0..if covers { 200 } else { 0 } {
                let (x, y) = (random(), random());
                let inside = |outline: &Outline| {
                    (0..EDGES).all(|i| {
                        f64::from(outline.a[i]) * x + f64::from(outline.b[i]) * y + outline.c[i] > -1e-9
                    })
                };
                assert!(outlines.iter().any(inside), "{trial}: {x} {y} {outlines:?}");
            }
        }
        assert!(found[0][1] > 1_000 && found[1][0] > 5_000 && found[1][1] > 50, "{found:?}");
    }

    /// What is found behind a surface at the corners of a piece is behind it at all points of the piece, by some bound.
    #[test]
    fn a_box_behind_at_the_corners_is_behind_throughout() {
        let mut random = random(1);
        let (mut yes, mut no) = (0, 0);
        for _ in 0..4000 {
            let pixel = [random(0.0, 60.0).floor(), random(0.0, 30.0).floor()];
            let corners: Vec<_> = (0..5).map(|_| [random(0.0, 1.0), random(0.0, 1.0)]).collect();
            let mut piece = Piece::NONE;
            corners.iter().for_each(|&corner| piece.push(corner, true));
            let mut planes = || {
                let [a, b] = [random(-0.2, 0.2), random(-0.2, 0.2)];
                [a, b, 5.0 - a * pixel[0] - b * pixel[1] + random(-0.2, 0.2)]
            };
            let slabs = Slabs::of([0; LANES].map(|_| planes()), 3);
            let mut shape = Shape::EMPTY;
            for _ in 0..2 {
                assert!(shape.bound(planes(), [64.0, 32.0]));
            }
            let surface = Surface::of(&shape);
            let nearest = random(4.7, 5.3) as f32;
            let behind = (&slabs, nearest).is_behind(&surface, pixel, &piece);
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

    /// Corners of pieces are off by a little, and a bound on a box that is as near there as a surface rises above it beyond.
    #[test]
    fn bounds_have_room_for_the_rounding_of_pieces() {
        let turns: Vec<f64> = (0..16).map(|i| f64::from(i) * 0.4).collect();
        for turn in turns {
            let (a, b) = (turn.cos(), turn.sin());
            let behind = |below: f64| {
                let slabs = Slabs::of([[a, b, 1.0 - 0.3 * a - 0.6 * b - below]; LANES], 1);
                let mut piece = Piece::NONE;
                piece.push([0.3, 0.6], true);
                (&slabs, 2.0).is_behind(&Surface::flat(1.0), [0.0; 2], &piece)
            };
            // At a distance of 2^-40 it is that much nearer.
            assert!(!behind(0.5f64.powi(40)));
            assert!(behind(4.0 * TINY));
        }
    }
}
