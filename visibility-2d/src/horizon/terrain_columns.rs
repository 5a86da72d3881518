//! Hills in a frame: computes steps of columns from the sheets of ground, one block of columns at a time.
//!
//! The wedge of a block is cut into *rings* by depth, from the eye outwards. The squares that a ring meets
//! bound the height of the sheet there. As long as the squares are unbroken, each ring gives a step. Its top
//! is the ring's least height, projected to the picture. Its bottom is the minimum, over earlier rings, of
//! their projected greatest heights. A line of sight between bottom and top was above the sheet in an earlier
//! ring and is below it in this ring. Steps are only added at crests, where heights stop growing.
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

/// Length of a ring along the depth, as a fraction of the depth at which it begins. A ring is one step of the
/// walk outwards from the eye; it is at least one square long.
const RING: f64 = 0.1;

/// Maximum number of squares along each axis that are read for one ring (step of the walk). If there are
/// more, squares of a coarser level are used.
const MAX_SQUARES: i64 = 3;

/// Number of rings that are walked beyond a crest (ring that is higher in the picture than all before) before
/// its step is added to the columns. A higher crest in one of them replaces it.
const BEHIND_CREST: u32 = 2;

/// Which ground may occlude in a frame. A square of ground belongs to several objects, given by a list of
/// owners (see [`Sheet::owners`]); it may occlude if all of them are drawn. Computed when first needed.
#[derive(Clone, Debug, Default)]
pub(crate) struct Presence {
    /// For each list of owners of the present sheet, by its number, whether all these objects are drawn or
    /// certainly outside the view. `None` if not computed in this frame.
    lists: Vec<Option<bool>>,
}

/// Data that tells, in one frame, whether the triangles of a ground object may occlude.
struct Drawn<'a> {
    scene: &'a Scene,
    visible: &'a VisibleSet,
    planes: ViewPlanes,
    /// Indices, in the scene, of the objects that have changed since the sheets were made, ascending.
    changed: &'a [u32],
    terrain: &'a Terrain,
}

impl Drawn<'_> {
    /// Returns whether the triangles of a ground object, given by its index in [`Terrain::objects`], may
    /// occlude: the object is unchanged since the sheets were made, and it is a candidate of the frame or
    /// outside the view.
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
        // The factors 1.001 and 1e-6 cover the rounding of centre and half extent to `f32`.
        let reach = plane.normal.abs().dot(half * 1.001 + center.abs() * 1e-6);
        let most = plane.signed_distance(center) + reach;
        most < -(4.0 * plane.error_bound(center.abs() + half) + error)
    })
}

/// Adds the ground to the columns of a new frame. `changed` has the indices, ascending, of objects that have
/// changed since the sheets were made.
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
        // From below the sheet, nearly every line of sight meets its back, so it is skipped.
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

/// Walk outwards along the wedge of a block of columns.
struct Wedge<'a> {
    frame: &'a Frame,
    sheet: &'a Sheet,
    /// Index of the face of the picture in which the wedge lies, 0 to 3.
    face: usize,
    /// Lateral coordinates, at depth 1, of the right and the left side of the wedge.
    sides: [f64; 2],
    /// Inverse of the side of a square in 1/m, exact.
    per_side: f64,
    /// Depth at which the next ring begins, in metres.
    depth: f64,
    /// Depth in metres beyond which the sheet has no square.
    end: f64,
    /// Bound on the error of coordinates and heights, in metres.
    error: f64,
    /// The rings walked since the last ring over which the ground does not occlude.
    run: Run,
    /// Height of the sheet's lowest point above the eye, in metres.
    bottom: f64,
    /// Height of the sheet's highest point above the eye, in metres.
    top: f64,
}

/// Consecutive rings of a wedge whose squares are all unbroken, so that the sheet has no border there.
#[derive(Clone, Copy)]
struct Run {
    /// Minimum, over the rings of the run, of each ring's greatest height in the picture (height above the
    /// eye over depth).
    low: f64,
    /// Step of the last crest, the ring that was higher in the picture than all before: the step's lower and
    /// upper height in the picture, and its depth in metres.
    crest: [f64; 3],
    /// Number of rings since the crest. `None` before the first crest, and once the crest's step is added.
    since: Option<u32>,
}

impl Run {
    const EMPTY: Self =
        Self { low: f64::INFINITY, crest: [f64::INFINITY, f64::NEG_INFINITY, 0.0], since: None };

    /// Returns the step at the crest of the run. `None` if it was already returned.
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
        // Depths, in this face, where the grid begins and ends.
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
        // For NaN, and for errors larger than squares allow for, the walk is empty.
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

    /// Returns the next step outwards, or `None` if the rest of the sheet hides nothing more. `is_present`
    /// gets the number of a list of owners ([`Sheet::owners`]) and tells whether all of them are drawn or out
    /// of view.
    fn next_step(&mut self, is_present: &mut impl FnMut(u32) -> bool) -> Option<Step> {
        while self.depth < self.end {
            let from = self.depth;
            let to = from + self.sheet.side.max(from * RING);
            self.depth = to;
            // From here on, no point of the sheet can be higher in the picture than the crest.
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
            // A line of sight lower than this in the picture is below the sheet at one end of the ring, which
            // suffices to block it.
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
    /// all objects of a list (see [`Sheet::owners`]) are drawn. `None` if the sheet must not occlude there:
    /// the part leaves the grid or is too large for the coarsest level, meets a [`BROKEN`] square (one with a
    /// border of the sheet, or not covered by it) or an object that is not drawn, or is not certainly beyond
    /// the near plane.
    fn heights(&self, from: f64, to: f64, is_present: &mut impl FnMut(u32) -> bool) -> Option<[f64; 2]> {
        let [right, left] = self.sides;
        let (right, left) = ((right * from).min(right * to), (left * from).max(left * to));
        let e = self.error;
        let ring = [from - e, to + e, right - e, left + e];
        let [near, far, right, left] = ring;
        // The ring's part in this block as a rectangle on the plan: `from` to `to` along the face's axis, and
        // between the wedge's sides across it.
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
        // The finest level on which the rectangle meets at most [`MAX_SQUARES`] squares along each axis.
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
                // Most neighbouring squares have the same owners, so the last answer is reused.
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
        // Heights relative to the eye, with a bound on the rounding of both.
        let outward = |height: f64| (height - eye[2], e + 4.0 * U * (height.abs() + eye[2].abs()));
        let ((low, a), (high, b)) = (outward(low), outward(high));
        // Quotients by depths round once: 4u of their value.
        Some([low - a - 8.0 * U * low.abs(), high + b + 8.0 * U * high.abs()])
    }
}
