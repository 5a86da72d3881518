//! Motion volumes: hidden movers that need no update until they may be seen.
//!
//! A mover that is hidden gets bounds that contain it for a span of time. While the span lasts and nothing of
//! these bounds is seen, neither its animation nor the scene needs an update. (Sudarsky and Gotsman,
//! "Output-Sensitive Visibility Algorithms for Dynamic Scenes with Applications to Virtual Reality", 1996,
//! who call them temporal bounding volumes. Spans adapt as there: one that ends unseen was too short, one
//! whose volume is seen before its end was too long.)

mod deadlines;

use crate::scene::{Changes, SceneCursor};
use crate::{Aabb, ObjectId, Scene, VisibleSet};
use alloc::vec::Vec;
use deadlines::Deadlines;
use glam::Vec3;

/// What is known of the motion of an object.
///
/// ```
/// use visibility_core::{motion::Motion, Aabb};
/// let walker = Motion::new(1.5).within(Aabb::from_arrays([-50.0, -50.0, 0.0], [50.0, 50.0, 2.0]));
/// assert_eq!(walker.max_speed, 1.5);
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Motion {
    /// Greatest speed of any side of the object's bounds, in metres per unit of the time that the caller
    /// counts in. A mover whose speed is negative or NaN never gets a volume; infinity means that only
    /// [`region`](Self::region) bounds the motion.
    pub max_speed: f32,
    /// Box that the bounds never leave, relative to the scene's origin; the infinite box if none is known. A
    /// region that does not contain the bounds is ignored while it does not.
    pub region: Aabb,
}

impl Motion {
    /// Returns a motion with a greatest speed, anywhere in space.
    pub const fn new(max_speed: f32) -> Self {
        Self { max_speed, region: Aabb::new(Vec3::NEG_INFINITY, Vec3::INFINITY) }
    }

    /// Returns the motion restricted to a box that the object's bounds never leave.
    pub const fn within(self, region: Aabb) -> Self {
        Self { region, ..self }
    }

    /// Returns a box that contains all bounds that `bounds` can become within `time`. `None` if no finite box
    /// is known.
    fn volume(&self, bounds: &Aabb, time: f64) -> Option<Aabb> {
        let reach = f64::from(self.max_speed) * time;
        let known = bounds.is_finite() && reach >= 0.0;
        // The caller rounds the bounds of both times to f32, by less than a step each: the first of a side of
        // `bounds`, at most `f32::EPSILON` of it, the second of the result. The conversion here may round
        // down to what the caller rounds up from: one step outwards. The second covers the sums in f64.
        let away = |x: f32, sign: f64| {
            (f64::from(x) + sign * (reach + f64::from(x.abs()) * f64::from(f32::EPSILON))) as f32
        };
        let mut volume = Aabb::new(
            Vec3::from_array(bounds.min.to_array().map(|x| away(x, -1.0).next_down().next_down())),
            Vec3::from_array(bounds.max.to_array().map(|x| away(x, 1.0).next_up().next_up())),
        );
        if self.region.min.cmple(bounds.min).all() && bounds.max.cmple(self.region.max).all() {
            volume = Aabb::new(volume.min.max(self.region.min), volume.max.min(self.region.max));
        }
        (known && volume.is_finite()).then_some(volume)
    }
}

/// How the scene's bounds of a mover are to be read.
#[derive(Clone, Copy, PartialEq, Debug)]
enum State {
    /// The place in the list is free.
    Free,
    /// The mover is due in the next frame but was not in the present one: it was added, its volume was seen,
    /// or its bounds were set from outside.
    New,
    /// The mover is due in the present frame: its bounds are exact once the caller has set them.
    Active,
    /// The mover was hidden in the last frame and gets its volume when the next one begins.
    Hidden,
    /// The bounds contain the mover until its deadline.
    Volume,
}

#[derive(Clone, Copy, Debug)]
struct Mover {
    id: ObjectId,
    motion: Motion,
    /// Length of the next span, in frames.
    span: f32,
    state: State,
    /// Last time at which the volume holds. Meaningful in the state `Volume`.
    deadline: f64,
    /// Whether `MotionVolumes::active` lists the index of this mover.
    is_listed: bool,
}

/// Returns a test of a deadline and a place in `movers`: whether they are those of a present volume.
fn is_volume(movers: &[Mover]) -> impl Fn(f64, u32) -> bool {
    |deadline, place| {
        let mover = &movers[place as usize];
        mover.state == State::Volume && mover.deadline == deadline
    }
}

/// The movers of a scene, and the spans of time for which the bounds of the hidden ones hold.
///
/// Each frame has two calls. [`begin_frame`](Self::begin_frame) lists the movers whose bounds must be set;
/// all others stay as they are. After culling, [`end_frame`](Self::end_frame) lists the movers that are seen
/// by their volumes: the caller finds out where they are before it draws them. Visible movers are due in each
/// frame.
///
/// # What is promised
/// No mover is hidden that would be visible with its exact bounds, as long as movers keep to their
/// [`Motion`], the due ones are set, and the culler is conservative: the bounds that it tests contain the
/// mover. A mover whose bounds the caller sets although it is not due (a teleport) is due again; so are all
/// movers after a change of the scene that its log does not list one by one, in another scene, and when time
/// is NaN or runs backwards.
///
/// # Cost
/// `begin_frame` takes `log n` time per due mover and hidden mover that gets a volume, `end_frame` time in
/// proportion to the visible objects, the due movers and the changes of the scene. Nothing is spent on the
/// other movers, and nothing is allocated once the buffers have grown.
///
/// ```
/// use visibility_core::motion::{Motion, MotionVolumes};
/// use visibility_core::{glam::DVec3, Aabb, FrustumCuller, Pipeline, Pose, Scene, View, VisibleSet};
/// let mut scene = Scene::new();
/// let at = |x: f32| Aabb::from_arrays([x, 0.0, 0.0], [x + 1.0, 1.0, 1.0]);
/// let walker = scene.insert(at(-500.0)); // behind the camera
/// let mut volumes = MotionVolumes::new();
/// volumes.insert(walker, Motion::new(2.0));
/// let view = View::perspective(Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z), 1.0, 1.0, 0.1, 1e3)?;
/// let (mut pipeline, mut visible) = (Pipeline::new().with(FrustumCuller::new()), VisibleSet::new());
/// let (mut due, mut seen, mut updates) = (Vec::new(), Vec::new(), 0);
/// for frame in 0..100 {
///     let time = f64::from(frame) / 60.0;
///     volumes.begin_frame(&mut scene, time, &mut due);
///     for &id in &due {
///         scene.set_bounds(id, at(-500.0 + 2.0 * time as f32))?;
///         updates += 1;
///     }
///     pipeline.cull(&scene, &view, &mut visible);
///     volumes.end_frame(&scene, &visible, &mut seen);
///     // Here the movers in `seen` are placed, and `visible` is drawn.
/// }
/// assert!(updates < 10);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct MotionVolumes {
    movers: Vec<Mover>,
    /// Indexed by object index: the place in `movers`, or `NONE`.
    places: Vec<u32>,
    free: Vec<u32>,
    /// Places of all movers without a volume, each once, and maybe of free ones.
    active: Vec<u32>,
    deadlines: Deadlines,
    /// Volumes that `begin_frame` sets.
    moved: Vec<(ObjectId, Aabb)>,
    cursor: SceneCursor,
    time: f64,
    /// Time from the frame before to the present one.
    frame_time: f64,
}

/// Mark of an object that is no mover.
const NONE: u32 = u32::MAX;

/// Least, first and greatest length of a span, in frames.
const SPANS: [f32; 3] = [2.0, 8.0, 4096.0];

impl Default for MotionVolumes {
    fn default() -> Self {
        Self::new()
    }
}

impl MotionVolumes {
    /// Returns a set without movers.
    pub const fn new() -> Self {
        Self {
            movers: Vec::new(),
            places: Vec::new(),
            free: Vec::new(),
            active: Vec::new(),
            deadlines: Deadlines::new(),
            moved: Vec::new(),
            cursor: SceneCursor::START,
            time: f64::NAN,
            frame_time: 0.0,
        }
    }

    /// Adds an object as a mover, or replaces its motion. The mover is due in the next frame.
    pub fn insert(&mut self, id: ObjectId, motion: Motion) {
        if self.places.len() <= id.index() {
            self.places.resize(id.index() + 1, NONE);
        }
        // The mover itself, or an object that had the index before and was removed from the scene.
        let old = self.places[id.index()];
        if old != NONE {
            self.release(old);
        }
        let place = self.free.pop().unwrap_or(self.movers.len() as u32);
        let mover = Mover { id, motion, span: SPANS[1], state: State::New, deadline: 0.0, is_listed: false };
        if place as usize == self.movers.len() {
            self.movers.push(mover);
        } else {
            let is_listed = self.movers[place as usize].is_listed;
            self.movers[place as usize] = Mover { is_listed, ..mover };
        }
        self.places[id.index()] = place;
        self.list(place);
        self.deadlines.reserve(self.movers.len());
    }

    /// Removes a mover; its bounds in the scene stay as they are. Returns false if `id` is no mover.
    pub fn remove(&mut self, id: ObjectId) -> bool {
        let Some(place) = self.place(id) else { return false };
        self.release(place);
        self.places[id.index()] = NONE;
        true
    }

    /// Returns the number of movers.
    pub fn len(&self) -> usize {
        self.movers.len() - self.free.len()
    }

    /// Returns whether there are no movers.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    fn release(&mut self, place: u32) {
        self.movers[place as usize].state = State::Free;
        self.free.push(place);
    }

    /// Lists a mover without a volume in `active`.
    fn list(&mut self, place: u32) {
        let is_listed = &mut self.movers[place as usize].is_listed;
        if !core::mem::replace(is_listed, true) {
            self.active.push(place);
        }
    }

    fn place(&self, id: ObjectId) -> Option<u32> {
        let place = *self.places.get(id.index())?;
        self.movers
            .get(place as usize)
            .filter(|mover| mover.id == id && mover.state != State::Free)
            .map(|_| place)
    }

    /// Begins the frame at `time`: gives the movers that the last frame hid their volumes, and replaces the
    /// content of `due` with the movers whose exact bounds the caller must set before it culls. Any unit of
    /// time will do that [`Motion::max_speed`] is given in. Movers that the scene no longer contains are
    /// removed.
    pub fn begin_frame(&mut self, scene: &mut Scene, time: f64, due: &mut Vec<ObjectId>) {
        due.clear();
        self.take_changes(scene);
        let last = core::mem::replace(&mut self.time, time);
        self.frame_time = time - last;
        if self.frame_time.is_nan() || self.frame_time < 0.0 {
            self.frame_time = 0.0;
            self.activate_all();
        }
        while let Some(place) = self.deadlines.pop_before(time, is_volume(&self.movers)) {
            // The whole span went by unseen.
            let mover = &mut self.movers[place as usize];
            mover.span = (mover.span * 2.0).min(SPANS[2]);
            mover.state = State::Active;
            self.list(place);
        }
        let mut active = core::mem::take(&mut self.active);
        active.retain(|&place| {
            let is_due = !self.enter_volume(scene, place, last);
            self.movers[place as usize].is_listed = is_due;
            is_due
        });
        due.extend(active.iter().map(|&place| self.movers[place as usize].id));
        self.active = active;
        // All ids are in the scene, so nothing is refused.
        let _ = scene.set_bounds_batch(&self.moved);
        self.moved.clear();
        self.cursor = SceneCursor::at(scene);
    }

    /// Lets a mover that the frame at time `last` hid have a volume, if one holds beyond the present frame.
    /// Returns whether the mover has a volume, or is gone; false if it is due.
    fn enter_volume(&mut self, scene: &Scene, place: u32, last: f64) -> bool {
        let mover = self.movers[place as usize];
        if mover.state == State::Free {
            return true;
        }
        let Ok(bounds) = scene.bounds(mover.id) else {
            self.movers[place as usize].state = State::Free;
            self.places[mover.id.index()] = NONE;
            self.free.push(place);
            return true;
        };
        self.movers[place as usize].state = State::Active;
        if mover.state != State::Hidden {
            return false;
        }
        // Spans that differ by up to a half keep movers that were hidden together from being due together.
        let spread = f64::from(mover.id.index().wrapping_mul(0x9e37_79b9) as u32) / f64::from(u32::MAX);
        let deadline = last + self.frame_time * f64::from(mover.span) * (0.75 + 0.5 * spread);
        let Some(volume) = mover.motion.volume(&bounds, deadline - last) else { return false };
        if deadline.is_nan() || deadline <= self.time {
            return false;
        }
        self.moved.push((mover.id, volume));
        let mover = &mut self.movers[place as usize];
        (mover.state, mover.deadline) = (State::Volume, deadline);
        self.deadlines.push(deadline, place, self.movers.len(), is_volume(&self.movers));
        true
    }

    /// Ends a frame after culling, before `visible` is drawn. Replaces the content of `seen` with the movers
    /// in `visible` that were not due, whose volumes are seen: the caller finds out where these movers are.
    /// `visible` must hold what any view of the frame shows: for several views the
    /// [`union`](VisibleSet::union) of their sets.
    pub fn end_frame(&mut self, scene: &Scene, visible: &VisibleSet, seen: &mut Vec<ObjectId>) {
        seen.clear();
        for id in visible.iter(scene) {
            let Some(place) = self.place(id) else { continue };
            let mover = &mut self.movers[place as usize];
            if mover.state == State::Volume {
                mover.span = (mover.span * 0.5).max(SPANS[0]);
                mover.state = State::New;
                self.list(place);
                seen.push(id);
            }
        }
        self.take_changes(scene);
        for &place in &self.active {
            let mover = &mut self.movers[place as usize];
            if mover.state == State::Active && !visible.contains(scene, mover.id) {
                mover.state = State::Hidden;
            }
        }
    }

    /// Makes every mover due whose bounds were set, or may have been, since the scene was last read.
    fn take_changes(&mut self, scene: &Scene) {
        match self.cursor.follow(scene) {
            Changes::Everything => self.activate_all(),
            Changes::Objects(ids) => {
                for &id in ids {
                    if let Some(place) = self.place(id) {
                        self.activate(place);
                    }
                }
            }
        }
    }

    fn activate_all(&mut self) {
        (0..self.movers.len() as u32).for_each(|place| self.activate(place));
    }

    /// Makes a mover due in the next frame, with an unchanged span.
    fn activate(&mut self, place: u32) {
        let mover = &mut self.movers[place as usize];
        match mover.state {
            State::Volume => {
                mover.state = State::New;
                self.list(place);
            }
            State::Hidden => mover.state = State::Active,
            State::Active | State::New | State::Free => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use visibility_testing::Random;

    /// Tests places that are exact in f64 and rounded to f32 by the caller, at both ends of a motion at
    /// exactly the greatest speed.
    #[test]
    fn a_volume_contains_the_rounded_bounds_at_its_end() {
        let mut rng = Random(1);
        let mut number = |low, high| (rng.range(-1.0, 1.0) as f32, 2f64.powi(rng.between(low, high)));
        for _ in 0..200_000 {
            let ((start, scale), (more, small)) = (number(-10, 20), number(-40, -20));
            let start = (f64::from(start) + f64::from(more) * small) * scale;
            let ((speed, scale), (_, time)) = (number(-10, 20), number(-4, 4));
            let speed = speed.abs() * scale as f32;
            let bounds = |at: f64| Aabb::new(DVec3::splat(at).as_vec3(), DVec3::splat(at).as_vec3());
            let volume = Motion::new(speed).volume(&bounds(start), time).unwrap();
            for end in [start - f64::from(speed) * time, start + f64::from(speed) * time] {
                // The caller rounds outwards here.
                let end = Aabb::from_world(DVec3::splat(end), DVec3::splat(end), DVec3::ZERO);
                assert!(
                    volume.contains_point(end.min) && volume.contains_point(end.max),
                    "{volume:?} {end:?}"
                );
            }
        }
    }
}
