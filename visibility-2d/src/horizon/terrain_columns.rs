//! The hills of a frame: steps of columns from the sheets of ground, block of columns by block.
//!
//! From the eye outwards, the wedge of a block is cut into *rings* by depth. The squares that a ring meets
//! bound the height of the sheet there. While they are unbroken, the step of a ring reaches from the least of
//! the greatest heights in the picture of the rings before it up to its own least height: a line of sight
//! between the two was above the sheet before and is below it at this ring. A step is added to the columns
//! where the heights stop growing, which is at a crest.
//!
//! # Rounding
//! With `u = 2^-53`. Depths and sides of a wedge are numbers as computed, for the exact eye. Points of the
//! wedge then have coordinates off by the eye's error and `8u` of their magnitude, and squares are looked up
//! in a rectangle larger by that. Heights above the eye are off by the same, and quotients round once.

use super::columns::{BLOCK, Columns, Step};
use super::frame::{FACES, Frame};
use super::terrain::{BROKEN, PAD, Sheet, Square, Terrain, floor};
use alloc::vec::Vec;
use visibility_core::view::{ViewPlane, ViewPlanes};
use visibility_core::{Aabb, Scene, VisibleSet};

/// Unit round-off of `f64`: 2^-53.
const U: f64 = f64::EPSILON / 2.0;

/// Length of a ring as a fraction of its depth.
const RING: f64 = 0.1;

/// Greatest number of squares along each axis that a ring reads. Where there would be more, a coarser level
/// is read.
const MAX_SQUARES: i64 = 3;

/// Number of rings behind a crest after which the crest's step is added.
const BEHIND_CREST: u32 = 2;

/// Whether objects of the ground are drawn in a frame. Computed on the first request for each list.
#[derive(Clone, Debug, Default)]
pub(crate) struct Presence {
    /// By number of a list of objects: whether all objects in the list are drawn or certainly outside the
    /// view. `None` if this was not computed yet in this frame.
    lists: Vec<Option<bool>>,
}

/// What decides, in one frame, whether the triangles of an object of the ground may hide others.
struct Drawn<'a> {
    scene: &'a Scene,
    visible: &'a VisibleSet,
    planes: ViewPlanes,
    /// Indices of the objects that have changed since the sheets were made, ascending.
    changed: &'a [u32],
    terrain: &'a Terrain,
}

impl Drawn<'_> {
    /// Returns whether the triangles of an object of the ground may hide: it is unchanged since the sheets
    /// were made, and it is a candidate of the frame or outside the view.
    fn is_drawn(&self, object: usize) -> bool {
        let ground = &self.terrain.objects[object];
        if self.terrain.is_lost(object) || self.changed.binary_search(&(ground.id.index() as u32)).is_ok() {
            return false;
        }
        self.visible.contains(self.scene, ground.id) || is_outside(&self.planes, &ground.bounds)
    }
}

/// Returns whether a box is surely outside of a view.
fn is_outside(planes: &ViewPlanes, bounds: &Aabb) -> bool {
    let (center, half) = (bounds.center().as_dvec3(), bounds.half_extent().as_dvec3());
    planes.as_slice().iter().any(|ViewPlane { plane, error }| {
        // Center and half extent round to `f32`.
        let reach = plane.normal.abs().dot(half * 1.001 + center.abs() * 1e-6);
        let most = plane.signed_distance(center) + reach;
        most < -(4.0 * plane.error_bound(center.abs() + half) + error)
    })
}

/// Adds the ground to the columns of a new frame. `changed` are the indices of objects that have changed
/// since the sheets were made, ascending.
pub(crate) fn draw_terrain(
    columns: &mut Columns,
    frame: &Frame,
    planes: ViewPlanes,
    terrain: &Terrain,
    candidates: (&Scene, &VisibleSet, &[u32]),
    presence: &mut Presence,
) {
    let (scene, visible, changed) = candidates;
    let drawn = Drawn { scene, visible, planes, changed, terrain };
    for sheet in &terrain.sheets {
        // From below, nearly every line of sight meets the back.
        if frame.eye[2] < f64::from(sheet.bottom) {
            continue;
        }
        presence.lists.clear();
        presence.lists.resize(sheet.list_count(), None);
        let lists = &mut presence.lists;
        let mut is_present = |list: u32| {
            let all = || sheet.owners(list).iter().all(|&object| drawn.is_drawn(object as usize));
            *lists[list as usize].get_or_insert_with(all)
        };
        for face in 0..FACES {
            let seen = columns.seen(face);
            for block in seen.start / BLOCK..seen.end.div_ceil(BLOCK) {
                let half = 0.5 * columns.per_face() as f64;
                let side = |column: usize| (column as f64 - half) / half;
                let sides = [side(block * BLOCK), side((block + 1) * BLOCK)];
                let mut wedge = Wedge::new(frame, sheet, face, sides);
                while let Some(step) = wedge.next_step(&mut is_present) {
                    columns.add_step(face, block, step);
                }
            }
        }
    }
}

/// A walk outwards along the wedge of a block of columns.
struct Wedge<'a> {
    frame: &'a Frame,
    sheet: &'a Sheet,
    face: usize,
    /// Right and left side of the wedge: lateral coordinates at depth 1.
    sides: [f64; 2],
    /// Inverse of the side of a square in 1/m, exact.
    per_side: f64,
    /// Depth at which the next ring begins, in metres.
    depth: f64,
    /// Depth in metres beyond which the sheet has no square.
    end: f64,
    /// Bound on the error of coordinates and heights, in metres.
    error: f64,
    run: Run,
    /// Height of the sheet's lowest point above the eye, in metres.
    bottom: f64,
    /// Height of the sheet's highest point above the eye, in metres.
    top: f64,
}

/// Consecutive rings of a wedge in which every square is unbroken: the sheet covers it without a border.
#[derive(Clone, Copy)]
struct Run {
    /// Least, over the rings of the run, of a ring's greatest height in the picture (height above the eye
    /// over depth).
    low: f64,
    /// The step at the crest: its lower and upper height in the picture, and its depth in metres.
    crest: [f64; 3],
    /// Number of rings since the crest. `None` before the first crest, and once the crest's step is added.
    since: Option<u32>,
}

impl Run {
    const EMPTY: Self =
        Self { low: f64::INFINITY, crest: [f64::INFINITY, f64::NEG_INFINITY, 0.0], since: None };

    /// Returns the step at the crest of the run. `None` if it was returned before.
    fn take(&mut self) -> Option<Step> {
        self.since.take()?;
        let [low, high, depth] = self.crest;
        let step = Step {
            inverse_depth: ((1.0 / depth) as f32).next_down(),
            low: (low as f32).next_up(),
            high: (high as f32).next_down(),
        };
        (step.low < step.high && step.inverse_depth >= f32::MIN_POSITIVE).then_some(step)
    }
}

impl<'a> Wedge<'a> {
    fn new(frame: &'a Frame, sheet: &'a Sheet, face: usize, sides: [f64; 2]) -> Self {
        let finest = &sheet.levels[0];
        let counts = [finest.columns, finest.squares.len() / finest.columns];
        let far = |axis: usize| sheet.corner[axis] + counts[axis] as f64 * sheet.side;
        let eye = frame.eye;
        // Depths of the grid in this face.
        let [near, end] = match face {
            0 => [sheet.corner[0] - eye[0], far(0) - eye[0]],
            1 => [sheet.corner[1] - eye[1], far(1) - eye[1]],
            2 => [eye[0] - far(0), eye[0] - sheet.corner[0]],
            _ => [eye[1] - far(1), eye[1] - sheet.corner[1]],
        };
        let size = eye.iter().fold(end.abs(), |size, x| size.max(x.abs()));
        let error = 2.0 * frame.error + 16.0 * U * size;
        let depth = near.max(0.5 * sheet.side);
        let (bottom, top) = (f64::from(sheet.bottom) - eye[2], f64::from(sheet.top) - eye[2]);
        // NaN, and errors that squares do not allow for, leave nothing to walk.
        let end = if error < PAD * sheet.side && size < 1e15 { end } else { 0.0 };
        Self {
            frame,
            sheet,
            face,
            sides,
            per_side: 1.0 / sheet.side,
            depth,
            end,
            error,
            run: Run::EMPTY,
            bottom,
            top,
        }
    }

    /// Returns the next step outwards, or `None` if no further part of the sheet hides anything. `is_present`
    /// tells whether all objects of a list (see [`Sheet::owners`]) are drawn.
    fn next_step(&mut self, is_present: &mut impl FnMut(u32) -> bool) -> Option<Step> {
        while self.depth < self.end {
            let from = self.depth;
            let to = from + self.sheet.side.max(from * RING);
            self.depth = to;
            // No point from here on can be higher in the picture than the crest.
            if self.top / if self.top > 0.0 { from } else { self.end } < self.run.crest[1] {
                break;
            }
            let Some([low, high]) = self.heights(from, to, is_present) else {
                let step = self.run.take();
                self.run = Run::EMPTY;
                if step.is_some() {
                    return step;
                }
                continue;
            };
            // Lines of sight are lowest under a height at one end of the ring or the other.
            let run = &mut self.run;
            let under = low / if low > 0.0 { from } else { to };
            let mut step = None;
            if under > run.crest[1] && run.low < under {
                // No point of the sheet behind the crest is lower in the picture than its lowest point.
                run.crest = [run.low.max(self.bottom / to), under, to];
                run.since = Some(0);
            } else if let Some(since) = &mut run.since {
                *since += 1;
                if *since == BEHIND_CREST {
                    step = run.take();
                }
            }
            run.low = run.low.min(high / if high > 0.0 { to } else { from });
            if step.is_some() {
                return step;
            }
        }
        self.run.take()
    }

    /// Returns a lower bound on the least and an upper bound on the greatest height of the sheet above the
    /// eye, in metres, in the part of the wedge from depth `from` to depth `to`. `is_present` tells whether
    /// all objects of a list (see [`Sheet::owners`]) are drawn. `None` if the sheet must not hide there: the
    /// part leaves the grid or is too large for the coarsest level, meets a [`BROKEN`] square (one with a
    /// border of the sheet, or not covered by it) or an object that is not drawn, or is not certainly beyond
    /// the near plane.
    fn heights(&self, from: f64, to: f64, is_present: &mut impl FnMut(u32) -> bool) -> Option<[f64; 2]> {
        let [right, left] = self.sides;
        let (right, left) = ((right * from).min(right * to), (left * from).max(left * to));
        let e = self.error;
        let ring = [from - e, to + e, right - e, left + e];
        let [near, far, right, left] = ring;
        // The ring's part in this column as a rectangle on the plan: `from` to `to` along the axis of the
        // face, the column's sides across it.
        let ([x0, x1], [y0, y1]) = match self.face {
            0 => ([near, far], [right, left]),
            1 => ([-left, -right], [near, far]),
            2 => ([-far, -near], [-left, -right]),
            _ => ([right, left], [-far, -near]),
        };
        let eye = self.frame.eye;
        let (min, max) = ([eye[0] + x0, eye[1] + y0], [eye[0] + x1, eye[1] + y1]);
        let index = |at: [f64; 2], axis: usize, pad: f64| {
            floor((at[axis] - self.sheet.corner[axis]) * self.per_side + pad)
        };
        let first = [index(min, 0, -PAD), index(min, 1, -PAD)];
        let last = [index(max, 0, PAD), index(max, 1, PAD)];
        // The finest level on which the rectangle meets few squares.
        let mut level = 0;
        while (0..2).any(|axis| (last[axis] >> level) - (first[axis] >> level) >= MAX_SQUARES) {
            level += 1;
        }
        let squares = self.sheet.levels.get(level)?;
        let rows = squares.squares.len() / squares.columns;
        let [x0, y0] = first.map(|i| i >> level);
        let [x1, y1] = last.map(|i| i >> level);
        if x0 < 0 || y0 < 0 || x1 as usize >= squares.columns || y1 as usize >= rows {
            return None;
        }
        let (mut low, mut high, mut known) = (f32::INFINITY, f32::NEG_INFINITY, BROKEN);
        for row in y0 as usize..=y1 as usize {
            let begin = row * squares.columns;
            for square in &squares.squares[begin + x0 as usize..=begin + x1 as usize] {
                let Square { low: a, high: b, owners } = *square;
                // Most neighbours have the same owners.
                if owners == BROKEN || owners != known && !is_present(owners) {
                    return None;
                }
                known = owners;
                (low, high) = (low.min(a), high.max(b));
            }
        }
        let (low, high) = (f64::from(low), f64::from(high));
        if !self.frame.is_box_beyond_near([min[0], min[1], low], [max[0], max[1], high]) {
            return None;
        }
        // Relative to the eye, outward by the roundings of both heights.
        let outward = |height: f64| (height - eye[2], e + 4.0 * U * (height.abs() + eye[2].abs()));
        let ((low, a), (high, b)) = (outward(low), outward(high));
        // Quotients by depths round once: 4u of themselves.
        Some([low - a - 8.0 * U * low.abs(), high + b + 8.0 * U * high.abs()])
    }
}
