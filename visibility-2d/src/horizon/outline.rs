//! Upper and lower outline of an occluder in one face of the picture.
//!
//! An occluder is given by *posts*: upright segments inside of it. A convex solid contains the hull of its
//! posts, so the polylines through the highest and lowest points of this hull lie inside the occluder's
//! picture. This remains true if posts are left out, so no exact predicates are needed: a wrong choice makes
//! the outline smaller, never larger.
//!
//! A wall is a list of upright panels between two posts each. A *run* is a sequence of panels in one
//! direction of the picture, each beginning where the one before ends. By continuity, in each column between
//! the ends of a run, a line of sight crosses one of its panels on the plan. Unlike the outlines of a convex
//! solid, those of a run may bend both ways and jump, so within a column they are also bounded at their
//! corners.
//!
//! # Rounding
//! With `u = 2^-53`. Coordinates relative to the eye are off by at most `e`: the eye's error, the post's own,
//! and `4u` of the magnitudes of both for the subtraction and for cutting. For a depth `x >= c` with `e < c /
//! 8`, a quotient `q = y / x` is off by at most `(e + |q| e) / (c - e)` and a rounding: less than `2 e (1 +
//! |q|) / c`. With `d = 2 e / c`, the columns of a corner are therefore off by `d (1 + |t|)` for each unit of
//! `t`, heights by `d (1 + |s|)`, and inverse depths by `d / x`. An edge between two such corners is, at any
//! column, off by at most the error of the heights and, for the errors of the columns at both ends, by its
//! slope times these; if the edge is at least four times as wide as that error, the exact slope is at most
//! twice the computed one and a part of the height's error: `2 (height + slope * column)`. Another such sum
//! covers a column beyond the ends of the computed edge by the error of columns, and the rounding of the
//! interpolation: a sum of at most 2^15 steps, each rounded by `u` of a number that is at most the greatest
//! height or inverse depth.

use super::frame::{Frame, turned};
use alloc::vec::Vec;

/// Unit round-off of `f64`: 2^-53.
const U: f64 = f64::EPSILON / 2.0;

/// Bound on the rounding error of a height or an inverse depth that is summed up column by column along an
/// edge, in units of round-off. Each of the at most 2^14 columns of a face adds one unit, and the value at
/// the edge's first column is allowed as many again.
const STEPS: f64 = 32768.0;

/// Upright segment inside of an occluder, in metres relative to the scene's origin.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Post {
    /// First coordinate on the plan, in metres from the scene's origin.
    pub(crate) x: f64,
    /// Second coordinate on the plan, in metres from the scene's origin.
    pub(crate) y: f64,
    /// Height of the lower end, in metres from the scene's origin.
    pub(crate) low: f64,
    /// Height of the upper end, in metres from the scene's origin. At least `low`.
    pub(crate) high: f64,
}

/// Corner of an outline in one face of the picture.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Corner {
    /// Lateral position in columns, from 0 at the right edge of the face.
    pub(crate) column: f64,
    /// Height in the picture: height above the eye over depth.
    pub(crate) height: f64,
    /// Inverse of the depth, in 1/m.
    pub(crate) inverse_depth: f64,
}

/// Bounds on the errors of the corners of an outline.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub(crate) struct CornerError {
    /// Bound on the error of [`Corner::column`], in columns.
    pub(crate) column: f64,
    /// Bound on the error of [`Corner::height`].
    pub(crate) height: f64,
    /// Bound on the error of [`Corner::inverse_depth`], in 1/m.
    pub(crate) inverse_depth: f64,
}

/// Outlines of one occluder in one face. Reused for the next occluder to keep its memory.
#[derive(Clone, Debug, Default)]
pub(crate) struct Outline {
    /// Corners of the upper outline, from the least to the greatest column: none or at least two.
    pub(crate) upper: Vec<Corner>,
    /// Corners of the lower outline, from the least to the greatest column.
    pub(crate) lower: Vec<Corner>,
    pub(crate) error: CornerError,
    /// Scratch: posts of the occluder relative to the eye, cut at the least depth that is drawn.
    cut: Vec<Relative>,
    /// Scratch: the posts in `cut`, projected to the face.
    projected: Vec<Projected>,
    /// Index of the panel of the present wall at which the next run begins. A run is a sequence of panels
    /// that follow each other in one direction of the picture.
    next_panel: usize,
    /// Number of panels of the present wall that are in no run so far.
    panels_left: usize,
}

/// Post relative to the eye: depth and lateral coordinate in a face, and heights of its ends, in metres.
#[derive(Clone, Copy, Debug)]
struct Relative {
    depth: f64,
    lateral: f64,
    low: f64,
    high: f64,
}

impl Relative {
    /// Returns the post at the given depth on the panel from this post to a deeper one.
    fn towards(&self, other: &Self, depth: f64) -> Self {
        let part = (depth - self.depth) / (other.depth - self.depth);
        let at = |from: f64, to: f64| from + (to - from) * part;
        let (lateral, low, high) =
            (at(self.lateral, other.lateral), at(self.low, other.low), at(self.high, other.high));
        Self { depth, lateral, low, high }
    }
}

/// Post in a face of the picture: its position in columns from the right edge of the face, the heights of its
/// ends (height above the eye over depth), and its inverse depth in 1/m.
#[derive(Clone, Copy, Debug)]
struct Projected {
    column: f64,
    low: f64,
    high: f64,
    inverse_depth: f64,
}

impl Projected {
    /// Returns the upper and the lower end of the post, as corners of an outline.
    fn corners(&self) -> (Corner, Corner) {
        let corner = |height| Corner { column: self.column, height, inverse_depth: self.inverse_depth };
        (corner(self.high), corner(self.low))
    }
}

impl Outline {
    /// Computes the outlines of a convex solid, given by posts of which it is the hull, in one face of
    /// `columns` columns. Each post may be wrong by at most `error` metres: an upright segment at most this
    /// far away certainly lies inside the solid. Returns whether there is an outline. False if the solid is
    /// behind the face, or if rounding leaves this undecided.
    pub(crate) fn project(
        &mut self,
        frame: &Frame,
        posts: &[Post],
        error: f64,
        face: usize,
        columns: usize,
    ) -> bool {
        let Some((nearest, e)) = self.place(frame, posts, error, face) else { return false };
        self.cut_at(nearest);
        self.project_cut(e, columns);
        self.projected.sort_unstable_by(|a, b| a.column.total_cmp(&b.column));
        self.upper.clear();
        self.lower.clear();
        for p in &self.projected {
            let (high, low) = p.corners();
            push_to_hull(&mut self.upper, high, 1.0);
            push_to_hull(&mut self.lower, low, -1.0);
        }
        self.upper.len() > 1 && self.lower.len() > 1
    }

    /// Projects the panels of a wall, two posts each, in one face of `columns` columns. `error` bounds the
    /// distance of each post from the exact one, in metres. Returns whether there are panels in the face;
    /// false if rounding leaves this undecided. Afterwards, [`next_run`](Self::next_run) returns the
    /// outlines.
    pub(crate) fn project_wall(
        &mut self,
        frame: &Frame,
        posts: &[Post],
        error: f64,
        face: usize,
        columns: usize,
    ) -> bool {
        let Some((nearest, e)) = self.place(frame, posts, error, face) else { return false };
        let mut kept = 0;
        for i in (1..self.cut.len()).step_by(2) {
            let (a, b) = (self.cut[i - 1], self.cut[i]);
            if a.depth < nearest && b.depth < nearest {
                continue;
            }
            self.cut[kept] = if a.depth < nearest { a.towards(&b, nearest) } else { a };
            self.cut[kept + 1] = if b.depth < nearest { b.towards(&a, nearest) } else { b };
            kept += 2;
        }
        self.cut.truncate(kept);
        self.project_cut(e, columns);
        // In a ring no panel is the first, so the walk starts at a panel that begins a run.
        let count = kept / 2;
        self.panels_left = count;
        self.next_panel = (0..count).find(|&i| !self.continues((i + count - 1) % count, i)).unwrap_or(0);
        count > 0
    }

    /// Replaces the outlines by those of the wall's next run: panels that follow each other in one direction
    /// of the picture. Panels with ascending columns show their back, and are skipped unless `two_sided`.
    /// Returns false after the last run.
    pub(crate) fn next_run(&mut self, two_sided: bool) -> bool {
        let count = self.projected.len() / 2;
        while self.panels_left > 0 {
            let first = self.next_panel;
            let mut length = 1;
            while length < self.panels_left
                && self.continues((first + length - 1) % count, (first + length) % count)
            {
                length += 1;
            }
            self.panels_left -= length;
            self.next_panel = (first + length) % count;
            let ascends = self.ascends(first);
            if ascends && !two_sided {
                continue;
            }
            self.upper.clear();
            self.lower.clear();
            for k in 0..length {
                let panel = (first + if ascends { k } else { length - 1 - k }) % count * 2;
                for end in [panel + usize::from(!ascends), panel + usize::from(ascends)] {
                    let (high, low) = self.projected[end].corners();
                    self.upper.push(high);
                    self.lower.push(low);
                }
            }
            return true;
        }
        false
    }

    /// Returns whether the columns of a panel ascend from its first post to its second.
    fn ascends(&self, panel: usize) -> bool {
        self.projected[2 * panel].column < self.projected[2 * panel + 1].column
    }

    /// Returns whether panel `b` begins where panel `a` ends, and continues in the same direction.
    fn continues(&self, a: usize, b: usize) -> bool {
        let (end, begin) = (&self.projected[2 * a + 1], &self.projected[2 * b]);
        end.column == begin.column
            && end.inverse_depth == begin.inverse_depth
            && self.ascends(a) == self.ascends(b)
    }

    /// Computes the posts relative to the eye, in `cut`. Returns the least depth that is drawn, and a bound
    /// on the error of coordinates, both in metres. `None` if all posts are behind the face, or if rounding
    /// leaves the picture undecided.
    fn place(&mut self, frame: &Frame, posts: &[Post], error: f64, face: usize) -> Option<(f64, f64)> {
        self.cut.clear();
        let (mut deepest, mut size) = (0.0f64, 0.0f64);
        for post in posts {
            let (depth, lateral) = turned(face, post.x - frame.eye[0], post.y - frame.eye[1]);
            let (low, high) = (post.low - frame.eye[2], post.high - frame.eye[2]);
            deepest = deepest.max(depth);
            size = size.max(depth.abs()).max(lateral.abs()).max(low.abs()).max(high.abs());
            self.cut.push(Relative { depth, lateral, low, high });
        }
        // The part nearer than 1/64 of the greatest depth is cut off, which loses little occlusion.
        let nearest = deepest * (1.0 / 64.0);
        let e = frame.error + error + 8.0 * U * size + f64::MIN_POSITIVE;
        // Written so that an error that is NaN gives `None`; posts are finite. `e` is at least `8 U size`, so
        // that `size` is below 2^47 times `nearest`, and all quotients are finite.
        let is_decided = e < nearest * 0.125 && nearest > 1e-100 && size < 1e100;
        is_decided.then_some((nearest, e))
    }

    /// Projects the posts in `cut`, whose coordinates have an error of at most `e` metres, into `projected`,
    /// and sets the bounds in `error`.
    fn project_cut(&mut self, e: f64, columns: usize) {
        let half = 0.5 * columns as f64;
        let (mut tangent, mut height, mut least) = (0.0f64, 0.0f64, 0.0f64);
        self.projected.clear();
        for p in &self.cut {
            let inverse_depth = 1.0 / p.depth;
            let t = p.lateral * inverse_depth;
            let (low, high) = (p.low * inverse_depth, p.high * inverse_depth);
            tangent = tangent.max(t.abs());
            height = height.max(low.abs()).max(high.abs());
            least = least.max(inverse_depth);
            self.projected.push(Projected { column: half + half * t, low, high, inverse_depth });
        }
        let d = 2.0 * e * least;
        self.error = CornerError {
            column: half * d * (1.0 + tangent) + 8.0 * U * half * (1.0 + tangent),
            height: d * (1.0 + height) + STEPS * U * height,
            inverse_depth: (d + STEPS * U) * least,
        };
    }

    /// Replaces the posts nearer than the depth `nearest` by posts where the hull of all posts crosses this
    /// depth.
    fn cut_at(&mut self, nearest: f64) {
        let near = |p: &Relative| p.depth < nearest;
        if !self.cut.iter().any(near) {
            return;
        }
        let count = self.cut.len();
        for i in 0..count {
            for j in 0..count {
                let (a, b) = (self.cut[i], self.cut[j]);
                if near(&a) && !near(&b) {
                    self.cut.push(a.towards(&b, nearest));
                }
            }
        }
        self.cut.retain(|p| !near(p));
    }
}

/// Appends a corner to a chain that only bends one way: to the right if `sense` is 1, to the left if -1.
/// First removes corners that would make the chain bend the other way.
fn push_to_hull(chain: &mut Vec<Corner>, corner: Corner, sense: f64) {
    while let [.., a, b] = chain[..] {
        let turn = (b.column - a.column) * (corner.height - a.height)
            - (b.height - a.height) * (corner.column - a.column);
        if sense * turn < 0.0 {
            break;
        }
        chain.pop();
    }
    // Of two corners in one column, the outer one counts.
    if let [first] = chain[..]
        && first.column == corner.column
        && sense * (corner.height - first.height) >= 0.0
    {
        chain.pop();
    }
    chain.push(corner);
}

/// Edge of an outline as linear functions of the column: its inverse depth and its height, minus their error
/// bounds.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Edge {
    /// Position of the edge's first corner, in columns from the right edge of the face.
    column: f64,
    /// Inverse depth at `column` in 1/m, minus its error bound.
    inverse_depth: f64,
    /// Height in the picture at `column`, minus its error bound.
    height: f64,
    /// Change of the inverse depth from column to column, in 1/m.
    pub(crate) inverse_depth_slope: f64,
    /// Change of the height in the picture from column to column.
    pub(crate) slope: f64,
}

impl Edge {
    /// Makes the edge between two successive corners of an outline. `sense` is 1 for an upper outline and -1
    /// for a lower one, whose heights are negated. An edge so steep that its slope is lost in the errors is
    /// level, at the lesser height and the lesser inverse depth of its two ends.
    pub(crate) fn new(from: Corner, to: Corner, error: &CornerError, sense: f64) -> Self {
        let width = to.column - from.column;
        let is_steep = width.is_nan() || width <= 4.0 * error.column;
        let per = if is_steep { 0.0 } else { 1.0 / width };
        let slope = sense * (to.height - from.height) * per;
        let inverse_depth_slope = (to.inverse_depth - from.inverse_depth) * per;
        let (mut height, mut inverse_depth) = (sense * from.height, from.inverse_depth);
        if is_steep {
            height = height.min(sense * to.height);
            inverse_depth = inverse_depth.min(to.inverse_depth);
        }
        Self {
            column: from.column,
            inverse_depth: inverse_depth
                - 4.0 * (error.inverse_depth + error.column * inverse_depth_slope.abs()),
            height: height - 4.0 * (error.height + error.column * slope.abs()),
            inverse_depth_slope,
            slope,
        }
    }

    /// Returns inverse depth and height at a column of the edge, or at a column beyond its ends by at most
    /// the error of columns.
    #[inline]
    pub(crate) fn at(&self, column: f64) -> (f64, f64) {
        let along = column - self.column;
        (self.inverse_depth + self.inverse_depth_slope * along, self.height + self.slope * along)
    }
}

#[cfg(test)]
mod tests {
    use super::super::columns::{BLOCK, Columns};
    use super::*;
    use alloc::vec;
    use visibility_testing::Random;

    /// Number of columns of each face.
    const COUNT: usize = 16;

    /// Returns whether columns hide a surface in the column at a position, at a height in the picture and an
    /// inverse depth.
    fn hides(columns: &Columns, at: f64, height: f64, inverse_depth: f64) -> bool {
        let column = at as usize;
        let block = columns.face(0)[column / BLOCK];
        block.hides(inverse_depth as f32, height as f32, height as f32) >> (column % BLOCK) & 1 != 0
    }

    /// What a panel hides is behind the exact panel, as seen from the exact eye, wherever both are within
    /// their errors, which are large here; so for a wall of one panel and for a flat solid.
    #[test]
    fn a_panel_hides_what_is_behind_the_exact_panel() {
        let mut random = Random(1);
        // Errors of a 512th of the depth would leave the picture undecided. In narrow columns, what is
        // less than that shows.
        const FINE: usize = 4096;
        let (mut columns, mut hidden) = (Columns::new(FINE), [0; 2]);
        for trial in 0..20_000 {
            let mut large = || [0.0, 9e-4, 9e-4 * random.unit()][random.below(3)];
            let (mut frame, error) = (Frame::BLIND, large());
            frame.error = large();
            let near = random.range(1.0, 2.0);
            let [height, under] = [(); 2].map(|()| random.range(0.5, 1.0) * random.pick(&[1.0, 20.0]));
            // Half of the panels are across the face, and level.
            let is_level = random.one_in(2);
            let mut post = |y: f64| {
                let turn = |random: &mut Random| if is_level { 0.0 } else { random.range(0.0, 0.4) };
                let (x, high) = (near + turn(&mut random), height + turn(&mut random));
                Post { x, y: x * y, low: -under - turn(&mut random), high }
            };
            let posts = [post(0.7), post(-0.6)];
            columns.begin(&frame);
            if trial % 2 == 0 {
                columns.draw_wall(&frame, &posts, error, true);
            } else {
                columns.draw_solid(&frame, &posts, error);
            }
            // The exact panel is smaller and farther away, and the exact eye is farther back or aside.
            let mut off = |size: f64| {
                let axis = random.below(3);
                let mut off = [0.0; 3];
                off[axis] = if random.one_in(2) { size } else { -size };
                off
            };
            let (eye, moved) = (off(frame.error), off(error));
            let relative = posts.map(|post| {
                let [x, y] = [post.x + moved[0] - eye[0], post.y + moved[1] * post.y.signum() - eye[1]];
                [x, y, post.low + moved[2].abs() - eye[2], post.high - moved[2].abs() - eye[2]]
            });
            let at = |y: f64| 0.5 * FINE as f64 * (1.0 + y);
            for _ in 0..8 {
                let part = [0.0, 1.0, random.unit()][random.below(3)];
                let [x, y, low, high] =
                    [0, 1, 2, 3].map(|i| relative[0][i] + (relative[1][i] - relative[0][i]) * part);
                let what =
                    || std::format!("trial {trial}: {posts:?} off by {moved:?}, eye by {eye:?}, {part}");
                let (column, middle) = (at(y / x), 0.5 * (low + high) / x);
                assert!(!hides(&columns, column, high / x + 1e-6, 0.01), "{}, above", what());
                assert!(!hides(&columns, column, low / x - 1e-6, 0.01), "{}, below", what());
                assert!(!hides(&columns, column, middle, (1.0 + 1e-6) / x), "{}, before", what());
                let is_end = part == 0.0 || part == 1.0;
                let is_hidden = hides(&columns, column, middle, 0.01);
                assert!(!is_hidden || !is_end, "{}, the column of its end", what());
                hidden[usize::from(frame.error + error > 9e-4)] += u32::from(is_hidden);
            }
        }
        assert!(
            hidden.iter().all(|&count| count > 5_000),
            "{hidden:?} points are hidden, with small and large errors"
        );
    }

    /// Corners of panels that are cut before the eye are within their errors of the exact ones. Coordinates
    /// are integers, so that only cutting and projecting round. Compared in double-double numbers.
    #[test]
    fn corners_of_cut_panels_are_within_their_errors() {
        use visibility_core::geometry::DoubleDouble;
        let mut random = Random(2);
        let (mut outline, mut cut) = (Outline::default(), [0; 2]);
        let mut frame = Frame::BLIND;
        frame.error = 0.0;
        for trial in 0..20_000 {
            let face = trial % 4;
            let mut number = |most: i32| f64::from(random.between(-most, most));
            let most = 1 << 26;
            let mut post = || {
                let (low, high) = (number(most), number(most));
                Post { x: number(most), y: number(most), low: low.min(high), high: low.max(high) }
            };
            let posts = [post(), post()];
            if !outline.project_wall(&frame, &posts, 0.0, face, COUNT) || !outline.next_run(true) {
                continue;
            }
            let at = posts.map(|p| {
                let (depth, lateral) = turned(face, p.x, p.y);
                [depth, lateral, p.high, p.low]
            });
            let nearest = at[0][0].max(at[1][0]) / 64.0;
            (0..2).for_each(|i| cut[i] += usize::from(at[i][0] < nearest));
            let half = 0.5 * COUNT as f64;
            for (corners, row) in [(&outline.upper, 2), (&outline.lower, 3)] {
                for corner in corners {
                    // The computed corner is that of the first or the second post, up to its errors.
                    let is_near = (0..2).any(|i| {
                        let (own, other) = (at[i], at[1 - i]);
                        // A fraction over a whole number, after the cut: numbers are products of integers.
                        let [depth, lateral, height] = if own[0] >= nearest {
                            [own[0], own[1], own[row]].map(DoubleDouble::from)
                        } else {
                            let whole = other[0] - own[0];
                            let part = DoubleDouble::from(nearest).plus((-own[0]).into());
                            let along = |k: usize| {
                                let change = part.times((other[k] - own[k]).into());
                                DoubleDouble::product(own[k], whole).plus(change)
                            };
                            [DoubleDouble::product(nearest, whole), along(1), along(row)]
                        };
                        // Columns and heights are compared multiplied by the depth.
                        let column = DoubleDouble::from(half).times(depth.plus(lateral));
                        let scale = depth.hi.abs();
                        let off = |found: f64, exact: DoubleDouble| {
                            depth.times((-found).into()).plus(exact).hi.abs() / scale
                        };
                        off(corner.column, column) <= outline.error.column
                            && off(corner.height, height) <= outline.error.height
                    });
                    assert!(
                        is_near,
                        "trial {trial}: {corner:?} of {posts:?} in face {face}, {:?}",
                        outline.error
                    );
                }
            }
        }
        assert!(cut.iter().all(|&cut| cut > 1_500), "{cut:?} panels are cut at the first or the second post");
    }

    /// Pictures that rounding leaves undecided have no outline: errors of an eighth of the least depth that
    /// is drawn, a 64th of the greatest depth, and sizes that leave no quotient finite.
    #[test]
    fn pictures_that_are_undecided_have_no_outline() {
        let mut outline = Outline::default();
        let mut is_drawn = |scale: f64, aside: f64, [eye, own]: [f64; 2]| {
            let mut frame = Frame::BLIND;
            frame.error = eye;
            let post = |y: f64| Post { x: 64.0 * scale, y: y * aside, low: -aside, high: aside };
            let posts = [post(1.0), post(-1.0)];
            let drawn = outline.project_wall(&frame, &posts, own, 0, COUNT);
            assert_eq!(outline.project(&frame, &posts, own, 0, COUNT), drawn, "a wall and a solid");
            drawn
        };
        for (errors, expected) in [
            ([0.0, 0.0], true),
            ([0.124, 0.0], true),
            ([0.0, 0.124], true),
            ([0.126, 0.0], false),
            ([0.0, 0.126], false),
            ([0.07, 0.07], false),
            ([f64::INFINITY, 0.0], false),
            ([f64::NAN, 0.0], false),
        ] {
            assert_eq!(is_drawn(1.0, 9.0, errors), expected, "errors {errors:?} at a depth of 64");
        }
        let cases = [
            (1e-99, 1e-99, true),
            (1e-101, 1e-101, false),
            (1e97, 1e97, true),
            (1e99, 1e99, false),
            (-1.0, 1.0, false),
            (f64::NAN, 1.0, false),
        ];
        for (scale, aside, expected) in cases {
            assert_eq!(is_drawn(scale, aside, [0.0; 2]), expected, "{scale} deep, {aside} aside");
        }
        // The rounding of what is far to the side, or high, is more than an eighth of the least depth.
        assert!(!is_drawn(1.0, 1e16, [0.0; 2]), "far to the side");
    }

    /// The walk along a ring of panels begins where a run begins, and gives each panel once; only fronts,
    /// unless it is two-sided. Panels that do not meet are runs of their own.
    #[test]
    fn runs_are_panels_that_follow_each_other_in_one_direction() {
        let mut frame = Frame::BLIND;
        frame.error = 0.0;
        let post = |x: f64, y: f64| Post { x, y, low: -1.0, high: 1.0 };
        let ring = [(4.0, 2.0), (4.0, -2.0), (8.0, -3.0), (8.0, 3.0)];
        let panel = |i: usize, j: usize| [post(ring[i].0, ring[i].1), post(ring[j].0, ring[j].1)];
        let mut outline = Outline::default();
        let mut runs = |posts: &[Post], two_sided: bool| {
            assert!(outline.project_wall(&frame, posts, 0.0, 0, COUNT), "panels in the face");
            let mut runs = Vec::new();
            while outline.next_run(two_sided) {
                let columns: Vec<i64> =
                    outline.upper.iter().map(|corner| (corner.column * 8.0).round() as i64).collect();
                runs.push(columns);
            }
            runs
        };
        let [right, left, far_right, far_left] =
            [(-0.5), 0.5, -0.375, 0.375].map(|t| (64.0 * (1.0 + t)) as i64);
        let whole = [panel(0, 1), panel(1, 2), panel(2, 3), panel(3, 0)].concat();
        // From the left to the right of the near panel its front is seen, the other three show their backs.
        let near = vec![right, left];
        assert_eq!(runs(&whole[..2], false), core::slice::from_ref(&near), "the near panel");
        assert_eq!(runs(&whole[4..6], false), Vec::<Vec<i64>>::new(), "the back of the far panel");
        let back = vec![right, far_right, far_right, far_left, far_left, left];
        for start in 0..4 {
            let mut turned = whole.clone();
            turned.rotate_left(2 * start);
            assert_eq!(runs(&turned, false), core::slice::from_ref(&near), "a ring from panel {start}");
            let mut both = runs(&turned, true);
            both.sort();
            let mut expected = [near.clone(), back.clone()];
            expected.sort();
            assert_eq!(both, expected, "a ring from panel {start}, two-sided");
        }
        // Two panels that meet in the picture, and not in depth; and two that do not meet at all.
        let apart = [post(4.0, 2.0), post(4.0, 0.0), post(8.0, 0.0), post(8.0, -4.0)];
        let middle = 64;
        assert_eq!(runs(&apart, false).len(), 2, "panels that meet in the picture alone");
        let beside = [post(4.0, 2.0), post(4.0, 0.5), post(4.0, -0.5), post(4.0, -2.0)];
        assert_eq!(runs(&beside, false).len(), 2, "panels beside each other");
        let one = [post(4.0, 2.0), post(4.0, 0.0), post(4.0, 0.0), post(4.0, -2.0)];
        assert_eq!(runs(&one, false), [vec![right, middle, middle, left]], "panels that follow each other");
    }

    /// An edge so steep that its slope is lost in the errors is as low and as far as the lesser of its ends.
    #[test]
    fn steep_edges_are_level_at_the_lesser_end() {
        let corner = |column, height, inverse_depth| Corner { column, height, inverse_depth };
        let error = CornerError { column: 0.25, height: 0.0, inverse_depth: 0.0 };
        let (high, low) = (corner(3.0, 2.0, 1.0), corner(3.5, 1.0, 0.5));
        for (from, to) in [(high, low), (corner(3.5, 2.0, 1.0), corner(3.5, 1.0, 0.5)), (low, high)] {
            for column in [3.0, 3.5] {
                assert_eq!(Edge::new(from, to, &error, 1.0).at(column), (0.5, 1.0), "{from:?} to {to:?}");
                assert_eq!(Edge::new(from, to, &error, -1.0).at(column), (0.5, -2.0), "{from:?} to {to:?}");
            }
        }
        // Ends in no column at all.
        let [from, to] = [2.0, 1.0].map(|height| corner(f64::INFINITY, height, 1.0));
        assert_eq!(Edge::new(from, to, &error, 1.0).slope, 0.0, "an edge of no width");
        let wide = Edge::new(corner(3.0, 2.0, 1.0), corner(7.0, 1.0, 0.5), &error, 1.0);
        assert_eq!(wide.slope, -0.25, "an edge of four columns");
    }
}
