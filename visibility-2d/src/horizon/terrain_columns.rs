//! Hills in a frame: computes steps of columns from the sheets of ground, one block of columns at a time.
//!
//! The wedge of a block is cut into *rings* by depth, from the eye outwards. The squares that a ring meets
//! bound the height of the sheet there. As long as the squares are unbroken, each ring gives a step. Its top
//! is the ring's least height, projected to the picture. Its bottom is the minimum, over earlier rings, of
//! their projected greatest heights. A line of sight between bottom and top was above the sheet in an earlier
//! ring and is below it in this ring. Steps are only added at crests, where heights stop growing.
//!
//! # Rounding
//! With `u = 2^-53`. Depths and sides of a wedge are numbers as computed, for the exact eye.
//!
//! - *Positions.* Coordinates of a wedge's points are off by the eye's error and `16u` of their magnitude.
//!   [`Wedge::new`] refuses an eye for which this is more than 0.9 [`PAD`] of a square. The heights of a
//!   square hold up to one [`PAD`] beyond it, of which the sheet's own errors take a hundredth, so squares
//!   are looked up without a margin.
//! - *Heights* above the eye are off by the eye's error, which is taken from the lower and added to the upper
//!   bound. The two sums and the quotient by a depth round by `3u` of their results; where a sum cancels most
//!   of its terms, these are as small as the eye's error, of which a thousandth is added.
//! - *Steps* are rounded to `f32` inwards by two steps of rounding: to the nearest number, which is wrong by
//!   half the distance of two numbers, and by one whole distance. What is left over, at least `2^-25` of the
//!   number, is more than the `3u` and the rounding of an inverse depth.

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
        self.visible.contains(self.scene, ground.id) || is_outside(self.planes.as_slice(), &ground.bounds)
    }
}

/// Returns whether a box is surely outside of a view.
fn is_outside(planes: &[ViewPlane], bounds: &Aabb) -> bool {
    let (center, half) = (bounds.center().as_dvec3(), bounds.half_extent().as_dvec3());
    planes.iter().any(|&ViewPlane { plane, error }| {
        // The factors 1.001 and 1e-6 cover the rounding of centre and half extent to `f32`, `2^-23` of both,
        // and a thousand times over what `f64` rounds: `16u` in the normal, and `4u` of the terms of the
        // distance. The plane's offset is one of these terms; where the sum is near zero, it is as large as
        // the others.
        let reach = plane.normal.abs().dot(half * 1.001 + center.abs() * 1e-6);
        plane.signed_distance(center) + reach < -error
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

    /// Returns the step at the crest of the run. `None` if it was already returned. A step whose heights
    /// rounding has made empty hides nothing. The inverse depth is a normal number, see [`MAX_SIDE`].
    fn take(&mut self) -> Option<Step> {
        self.since.take()?;
        let [low, high, depth] = self.crest;
        Some(Step {
            inverse_depth: ((1.0 / depth) as f32).next_down(),
            low: (low as f32).next_up(),
            high: (high as f32).next_down(),
        })
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
        let depth = near.max(0.5 * sheet.side);
        let (bottom, top) = (f64::from(sheet.bottom) - eye[2], f64::from(sheet.top) - eye[2]);
        // For NaN, and for errors larger than squares allow for, the walk is empty. Else `size` is below 2^36
        // sides of squares, and so are depths.
        let end = if frame.error + 16.0 * U * size < 0.9 * PAD * sheet.side { end } else { 0.0 };
        Self {
            frame,
            sheet,
            face,
            sides,
            per_side: 1.0 / sheet.side,
            depth,
            end,
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
            if (self.top / from).max(self.top / self.end) < self.run.crest[1] {
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
            let under = (low / from).max(low / to);
            let mut step = None;
            if under > run.crest[1].max(run.low) {
                // No point of the sheet behind the crest is lower in the picture than its lowest point.
                run.crest = [run.low.max(self.bottom / to), under, to];
                run.since = Some(0);
            } else if let Some(since) = &mut run.since {
                *since += 1;
                if *since == BEHIND_CREST {
                    step = run.take();
                }
            }
            run.low = run.low.min((high / from).min(high / to));
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
        // The ring's part in this block as a rectangle on the plan: `from` to `to` along the face's axis, and
        // between the wedge's sides across it.
        let ([x0, x1], [y0, y1]) = match self.face {
            0 => ([from, to], [right, left]),
            1 => ([-left, -right], [from, to]),
            2 => ([-to, -from], [-left, -right]),
            _ => ([right, left], [-to, -from]),
        };
        let eye = self.frame.eye;
        let (min, max) = ([eye[0] + x0, eye[1] + y0], [eye[0] + x1, eye[1] + y1]);
        let index = |at: [f64; 2], axis: usize| floor((at[axis] - self.sheet.corner[axis]) * self.per_side);
        let (first, last) = ([index(min, 0), index(min, 1)], [index(max, 0), index(max, 1)]);
        // The finest level on which the rectangle meets at most [`MAX_SQUARES`] squares along each axis.
        let mut level = 0;
        while (0..2).any(|axis| (last[axis] >> level) - (first[axis] >> level) >= MAX_SQUARES) {
            level += 1;
        }
        let squares = self.sheet.levels.get(level)?;
        let rows = squares.squares.len() / squares.columns;
        // Converted, not cast: beside a distant sheet, numbers of squares exceed 32 bits.
        let place = |i: i64| usize::try_from(i >> level).ok();
        let (x0, y0, x1, y1) = (place(first[0])?, place(first[1])?, place(last[0])?, place(last[1])?);
        if x1 >= squares.columns || y1 >= rows {
            return None;
        }
        let (mut low, mut high, mut known) = (f32::INFINITY, f32::NEG_INFINITY, BROKEN);
        for row in y0..=y1 {
            let begin = row * squares.columns;
            for square in &squares.squares[begin + x0..=begin + x1] {
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
        let pad = PAD * self.sheet.side;
        if !self.frame.is_box_beyond_near([min[0], min[1], low], [max[0], max[1], high], pad) {
            return None;
        }
        let error = 1.001 * self.frame.error;
        Some([low - eye[2] - error, high - eye[2] + error])
    }
}

#[cfg(test)]
mod tests {
    use super::super::frame::UpAxis;
    use super::super::terrain::Level;
    use super::*;
    use alloc::vec;
    use visibility_core::geometry::Plane;
    use visibility_core::glam::{Affine3A, DVec3, Vec3};
    use visibility_core::{Object, OccluderMesh, Pose, View};
    use visibility_testing::cameras::power_of_two;
    use visibility_testing::{Random, sign_of_sum};

    /// Number of squares of a ridge along the depth, and across it.
    const SQUARES: [usize; 2] = [16, 3];

    /// Returns a scene of rising ground, and its terrain of one sheet.
    fn hill() -> (Scene, Terrain) {
        let at = |x: i16, y: i16| Vec3::new(f32::from(x), f32::from(y), 0.5 * f32::from(x));
        let cells = (-4..4).flat_map(|x| (-4..4).map(move |y| (x, y)));
        let triangles: Vec<_> = cells
            .flat_map(|(x, y)| {
                let [a, b, c, d] = [at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)];
                [[a, b, c], [a, c, d]]
            })
            .collect();
        let (mut scene, mesh) = (Scene::new(), OccluderMesh::from_triangles(&triangles).unwrap());
        let id = scene.insert(Object { occluder: true, ..Object::new(*mesh.bounds()) });
        let mesh = scene.add_mesh(mesh);
        scene.set_mesh(id, mesh, Affine3A::IDENTITY).unwrap();
        let terrain = Terrain::new(&scene, UpAxis::Z);
        (scene, terrain)
    }

    /// Returns the frame of an eye, known without error, that looks level along `ahead`.
    fn frame(eye: DVec3, ahead: DVec3, near: f64) -> Frame {
        let pose = Pose::look_at(eye, eye + ahead * near, DVec3::Z);
        let view = View::perspective(pose, 1.0, 1.0, near, f64::INFINITY).unwrap();
        let mut frame = Frame::new(&view, DVec3::ZERO, UpAxis::Z);
        (frame.eye, frame.error) = (eye.to_array(), 0.0);
        frame
    }

    /// Ground whose height depends on the depth in one face alone, and a frame that looks along it.
    struct Ridge {
        face: usize,
        side: f64,
        /// Depth of the grid's first square, negative if it begins behind the eye: a multiple of half a side.
        begin: f64,
        sheet: Sheet,
        frame: Frame,
    }

    impl Ridge {
        /// Makes a ridge of any sheet and the least and the greatest height of each square, from the first
        /// one on. `None` stands for a broken square. The eye is at the height `eye`. `corner` is in sides.
        fn new(
            mut sheet: Sheet,
            face: usize,
            side: f64,
            begin: f64,
            heights: &[Option<[f32; 2]>; SQUARES[0]],
            corner: [f64; 2],
            eye: f64,
        ) -> Self {
            let [along, across] = [SQUARES[0], SQUARES[1]];
            let (columns, rows) = if face.is_multiple_of(2) { (along, across) } else { (across, along) };
            let square = |x: usize, y: usize| {
                let place = if face.is_multiple_of(2) { x } else { y };
                let place = if face < 2 { place } else { along - 1 - place };
                let [low, high] = heights[place].unwrap_or([0.0; 2]);
                Square { low, high, owners: if heights[place].is_some() { 0 } else { BROKEN } }
            };
            let squares = (0..rows).flat_map(|y| (0..columns).map(move |x| square(x, y))).collect();
            sheet.levels = vec![Level { columns, squares }];
            (sheet.corner, sheet.side) = (corner.map(|x| x * side), side);
            let known = || heights.iter().flatten().flatten().copied();
            sheet.bottom = known().fold(f32::INFINITY, f32::min);
            sheet.top = known().fold(f32::NEG_INFINITY, f32::max);
            let ahead = [DVec3::X, DVec3::Y, -DVec3::X, -DVec3::Y][face];
            let near = if face < 2 { -begin } else { begin + side * along as f64 };
            let middle = 0.5 * side * across as f64;
            let [x, y] = if face.is_multiple_of(2) { [near, middle] } else { [middle, near] };
            let at = DVec3::new(sheet.corner[0] + x, sheet.corner[1] + y, eye);
            let frame = frame(at, ahead, 1e-3 * side);
            Self { face, side, begin, sheet, frame }
        }

        fn steps(&self) -> Vec<Step> {
            let mut wedge = Wedge::new(&self.frame, &self.sheet, self.face, [-0.05, 0.04]);
            core::iter::from_fn(|| wedge.next_step(&mut |_| true)).collect()
        }
    }

    /// Returns whether a line of sight of the given slope meets ground from above at an inverse depth of `w`
    /// or more. The ground is straight between `nodes`, which are `side` apart, and has a gap where `gaps`
    /// says so. Exact, for an eye that is `[forth, up]` off the frame's.
    fn is_met(slope: f64, w: f64, ridge: &Ridge, ground: (&[f64], &[bool]), [forth, up]: [f64; 2]) -> bool {
        let (nodes, gaps) = ground;
        let (side, eye) = (ridge.side, ridge.frame.eye[2]);
        let mut was_above = false;
        for (i, &z) in nodes.iter().enumerate() {
            let depth = ridge.begin + i as f64 * side - forth;
            if depth <= 0.0 {
                continue;
            }
            let is_beyond = sign_of_sum([(depth, w), (-1.0, 1.0)]) > 0;
            let above = if is_beyond && i > 0 {
                // The line's height above the ground at the inverse depth, times `w`.
                let last = nodes[i - 1];
                let growth = (z - last) / side;
                let back = growth * (depth - side);
                let terms = [(slope, 1.0), (eye, w), (up, w), (-last, w), (-growth, 1.0), (back, w)];
                sign_of_sum(terms)
            } else {
                sign_of_sum([(slope, depth), (eye, 1.0), (up, 1.0), (-z, 1.0)])
            };
            was_above &= i == 0 || !gaps[i - 1];
            if was_above && above <= 0 {
                return true;
            }
            if is_beyond {
                return false;
            }
            was_above |= above > 0;
        }
        false
    }

    /// Random ridges at all scales and far from the origin. Lines of sight next to both ends of each step,
    /// from eyes that are off by the whole error, meet the ground where the step says. Half of the eyes are
    /// next to the height of the ground, where errors are largest beside heights.
    #[test]
    fn steps_hold_for_each_eye_within_the_error() {
        let mut random = Random(1);
        let any = hill().1.sheets.remove(0);
        let mut lines = 0;
        for round in 0..20_000 {
            let side = power_of_two(random.between(-60, 60));
            let unit = side / 1024.0;
            let base = [0.0, 1e4, 1e6][random.below(3)] * unit;
            let steep = [1, 1, 8, 100][random.below(4)];
            let mut height = 0;
            let nodes: Vec<f64> = (0..=SQUARES[0])
                .map(|_| {
                    height += random.between(-steep, steep) * i32::from(random.one_in(2));
                    base + f64::from(height) * unit
                })
                .collect();
            let gaps: Vec<bool> = (0..SQUARES[0]).map(|_| random.one_in(20)).collect();
            // Bounds of the ground over each square and the pad around it.
            let bounds: [_; SQUARES[0]] = core::array::from_fn(|i| {
                let at = |node: usize, next: Option<&f64>| {
                    let growth = next.map_or(0.0, |next| next - nodes[node]);
                    [nodes[node], nodes[node] + PAD * growth]
                };
                let before = i.checked_sub(1).and_then(|before| nodes.get(before));
                let ends = [at(i, before), at(i + 1, nodes.get(i + 2))].concat();
                let least = ends.iter().copied().fold(f64::INFINITY, f64::min);
                let most = ends.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                (!gaps[i]).then_some([(least as f32).next_down(), (most as f32).next_up()])
            });
            let start = random.between(-2 * SQUARES[0] as i32, 8);
            let start = f64::from(start | 1);
            let place = nodes[random.below(nodes.len())];
            let eye = place + side * [1e-6, 1e-4, 1e-2, 1.0][random.below(4)] * random.range(-0.2, 1.0);
            let corner = [0, 1].map(|_| f64::from(random.between(-1 << 20, 1 << 20) >> random.below(21)));
            let face = random.below(FACES);
            let mut ridge = Ridge::new(any.clone(), face, side, 0.5 * start * side, &bounds, corner, eye);
            // A multiple of 2^-40 sides, below 0.9 pads.
            let error = f64::from(random.between(0, 98_000_000) >> [0, 10, 27][random.below(3)]);
            let error = error * power_of_two(-40) * side;
            ridge.frame.error = error;
            for step in ridge.steps() {
                let [w, low, high] = [step.inverse_depth, step.low, step.high].map(f64::from);
                if low >= high {
                    continue;
                }
                for slope in [low.next_up(), 0.5 * (low + high), high.next_down()] {
                    for off in [[0.0, 0.0], [0.0, error], [0.0, -error], [error, 0.0], [-error, 0.0]] {
                        lines += 1;
                        let is_met = is_met(slope, w, &ridge, (&nodes, &gaps), off);
                        assert!(is_met, "round {round}, {step:?}: slope {slope} from an eye off by {off:?}");
                    }
                }
            }
        }
        assert!(lines > 100_000, "{lines} lines of sight are no test");
    }

    /// Numbers that a step rounds to `f32` move inwards by more than the errors of `f64`, at all magnitudes.
    #[test]
    fn crests_are_rounded_inwards() {
        let mut random = Random(2);
        for round in 0..100_000 {
            let number = |random: &mut Random, least: i32, most: i32| {
                random.fine_range(1.0, 2.0) * power_of_two(random.between(least, most))
            };
            let depth = number(&mut random, -100, 122);
            let height = number(&mut random, -160, 140) * [-1.0, 1.0][random.below(2)];
            let mut run = Run { low: 0.0, crest: [height, height, depth], since: Some(0) };
            let Some(step) = run.take() else { panic!("round {round}: no step of a crest") };
            let off = 8.0 * U * height.abs();
            assert!(f64::from(step.low) > height + off, "round {round}: {step:?} from {height}");
            assert!(f64::from(step.high) < height - off, "round {round}: {step:?} up to {height}");
            let product = [(depth, step.inverse_depth.into()), (-1.0, 1.0)];
            assert!(sign_of_sum(product) < 0, "round {round}: {step:?} is nearer than {depth}");
            assert!(step.inverse_depth >= f32::MIN_POSITIVE, "round {round}: {step:?} is no normal number");
            assert_eq!(run.take(), None, "round {round}: a step is returned once");
        }
    }

    /// Ground of height `0` at the eye's own height, and lower before.
    fn level(heights: [f32; SQUARES[0]], eye: f64) -> Ridge {
        Ridge::new(
            hill().1.sheets.remove(0),
            0,
            1.0,
            -0.5,
            &heights.map(|height| Some([height; 2])),
            [0.0; 2],
            eye,
        )
    }

    #[test]
    fn an_eye_whose_error_exceeds_the_pad_sees_nothing_hidden() {
        let mut ridge = level(core::array::from_fn(|i| if i < 4 { -1.0 } else { 1.0 }), 0.0);
        for (error, hides) in [(0.0, true), (0.89, true), (0.91, false), (1.7, false), (f64::NAN, false)] {
            ridge.frame.error = error * PAD;
            assert_eq!(!ridge.steps().is_empty(), hides, "an error of {error} pads");
        }
        // Far away, coordinates are rounded by as much.
        ridge.frame.error = 0.0;
        for (far, hides) in [(1e8, true), (1e12, false)] {
            let squares = [Some([0.0; 2]); SQUARES[0]];
            let mut ridge = Ridge::new(hill().1.sheets.remove(0), 0, 1.0, -0.5, &squares, [far, 0.0], 1.0);
            ridge.frame.error = 0.0;
            assert_eq!(!ridge.steps().is_empty(), hides, "{far} squares from the origin");
        }
    }

    /// Of rings that are equally high in the picture, the nearest ring gives the step. A ring that is as high
    /// as the lowest ring before it gives no step, and leaves later rings their steps.
    #[test]
    fn equal_heights_do_not_move_a_crest() {
        let steps = level(core::array::from_fn(|i| if i < 3 { -1.0 } else { 0.0 }), 0.0).steps();
        let depths: Vec<f32> = steps.iter().map(|step| 1.0 / step.inverse_depth).collect();
        assert!(matches!(depths[..], [depth] if (3.4..3.6).contains(&depth)), "depths of steps: {depths:?}");
        // The second ring, 2 m above the eye, is as high in the picture as the first was: 2 m over 1.5 m. The
        // fourth is lower there than that, and hides what is between it and the lowest up to then.
        let steps = level(core::array::from_fn(|i| if i < 4 { 3.0 } else { 4.5 }), 1.0).steps();
        assert!(steps.iter().any(|step| step.low < 0.9 && step.high > 0.9), "steps: {steps:?}");
    }

    /// The near plane cuts ground that it comes near by less than the pad.
    #[test]
    fn ground_next_to_the_near_plane_does_not_hide() {
        for (near, hides) in [(0.4, true), (0.4999, false), (0.50001, false)] {
            let mut ridge = level(core::array::from_fn(|i| if i < 1 { -1.0 } else { 1.0 }), 0.0);
            ridge.frame = frame(DVec3::from_array(ridge.frame.eye), DVec3::X, near);
            let wedge = Wedge::new(&ridge.frame, &ridge.sheet, 0, [-0.05, 0.04]);
            assert_eq!(wedge.heights(0.5, 1.5, &mut |_| true).is_some(), hides, "a near plane at {near}");
        }
    }

    /// An eye at the height of the lowest ground is above the sheet.
    #[test]
    fn an_eye_as_low_as_the_ground_is_above_it() {
        let (scene, terrain) = hill();
        for (below, hides) in [(0.0, true), (1e-9, false)] {
            let eye = DVec3::new(-10.0, 0.0, f64::from(terrain.sheets[0].bottom) - below);
            let frame = frame(eye, DVec3::X, 1e-3);
            let mut columns = Columns::new(8 * BLOCK);
            columns.begin(&frame);
            let candidates = (&scene, &VisibleSet::new(), &[][..]);
            let mut presence = Presence::default();
            draw_terrain(&mut columns, &frame, ViewPlanes::NONE, &terrain, candidates, &mut presence);
            let is_hidden = columns.face(0).iter().any(|block| block.is_hidden_throughout(0.0, 0.2, 0.21));
            assert_eq!(is_hidden, hides, "{below} m below the ground");
        }
    }

    /// A box next to a plane whose offset is off by a quarter of a metre.
    #[test]
    fn boxes_within_the_error_of_a_plane_are_not_outside() {
        for far in [0.0, 1e6f32] {
            let plane = Plane::new(DVec3::X, -f64::from(far));
            let is_outside = |reach: f32, error: f64| {
                let bounds = Aabb::from_arrays([far - 2.0, 0.0, 0.0], [far + reach, 1.0, 1.0]);
                is_outside(&[ViewPlane { plane, error }], &bounds)
            };
            assert!(!is_outside(-0.2, 0.25), "a box before the plane by less than its error, at {far}");
            assert!(!is_outside(0.1, 0.0), "a box beyond the plane, at {far}");
            assert!(far > 0.0 || is_outside(-0.3, 0.25), "a box before the plane by more");
        }
        assert!(!is_outside(&[], &Aabb::from_arrays([0.0; 3], [1.0; 3])), "a view without planes");
        // Boxes that end at a plane, with a centre and a half extent that are rounded.
        let mut random = Random(3);
        for round in 0..10_000 {
            let ends = [0; 2].map(|_| random.fine_range(-1.0, 1.0) as f32);
            let (min, max) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
            let plane = Plane::new(DVec3::X, -f64::from(max));
            let bounds = Aabb::from_arrays([min, 0.0, 0.0], [max, 1.0, 1.0]);
            let found = is_outside(&[ViewPlane { plane, error: 0.0 }], &bounds);
            assert!(!found, "round {round}: {bounds:?} touches its plane");
        }
    }
}
