//! Motion volumes: hidden movers that need no update until they may be seen.
//!
//! A mover that is hidden gets bounds that contain it for a span of time. While the span lasts and these
//! bounds stay hidden, neither its animation nor the scene needs an update. (Sudarsky and Gotsman,
//! "Output-Sensitive Visibility Algorithms for Dynamic Scenes with Applications to Virtual Reality", 1996,
//! who call such bounds temporal bounding volumes. Spans adapt as in their paper: a span that ends while its
//! volume is hidden was too short; a span whose volume is seen before its end was too long.)

mod deadlines;
mod places;

use alloc::vec::Vec;
use deadlines::Deadlines;
use places::Places;
use visibility_core::bits::Bits;
use visibility_core::glam::Vec3;
use visibility_core::scene::{Changes, SceneCursor, SceneError};
use visibility_core::{Aabb, ObjectId, Scene, VisibleSet};

/// Bounds on the motion of an object.
///
/// ```
/// use visibility_core::Aabb;
/// use visibility_frame::motion::Motion;
/// let walker = Motion::new(1.5).within(Aabb::from_arrays([-50.0, -50.0, 0.0], [50.0, 50.0, 2.0]));
/// assert_eq!(walker.max_speed, 1.5);
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Motion {
    /// Greatest speed of any side of the object's bounds, in metres per unit of the time that the caller
    /// counts in. A mover whose speed is negative or NaN never gets a volume; infinity means that only
    /// [`region`](Self::region) bounds the motion.
    pub max_speed: f32,
    /// Box that the bounds never leave, relative to the scene's origin in the next call of
    /// [`begin_frame`](MotionVolumes::begin_frame); the infinite box if none is known. While a region does
    /// not contain the bounds, it is ignored. A region is dropped when the scene's origin is set, and in
    /// another scene; [insert](MotionVolumes::insert) the mover again with a new region.
    pub region: Aabb,
}

impl Motion {
    /// Returns a motion of at most the speed `max_speed`, anywhere in space.
    pub const fn new(max_speed: f32) -> Self {
        Self { max_speed, region: Aabb::new(Vec3::NEG_INFINITY, Vec3::INFINITY) }
    }

    /// Returns the motion restricted to a box that the object's bounds never leave.
    ///
    /// The result must be used, as that of every builder method of this crate:
    /// ```
    /// # #![deny(unused_must_use)]
    /// # use visibility_core::Aabb;
    /// # use visibility_frame::motion::Motion;
    /// let motion = Motion::new(1.0).within(Aabb::EMPTY);
    /// ```
    /// ```compile_fail
    /// # #![deny(unused_must_use)]
    /// # use visibility_core::Aabb;
    /// # use visibility_frame::motion::Motion;
    /// Motion::new(1.0).within(Aabb::EMPTY); // an error: it does nothing
    /// ```
    #[must_use]
    pub const fn within(self, region: Aabb) -> Self {
        Self { region, ..self }
    }

    /// Returns a box that contains all bounds that `bounds` can become within `time`. `None` if no finite box
    /// is known.
    fn volume(&self, bounds: &Aabb, time: f64) -> Option<Aabb> {
        let reach = f64::from(self.max_speed) * time;
        let known = bounds.is_finite() && reach >= 0.0;
        // The caller rounds the bounds at both times to f32, by less than one step each: a side of `bounds`
        // by at most `f32::EPSILON` of itself, and the later bounds by a step of the result. The conversion
        // here may round down the number that the caller rounds up, so one step outwards is taken for it, and
        // a second for the sums in f64.
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

/// State of a mover: whether its bounds in the scene are exact or a motion volume, and when it is due. The
/// caller must set the exact bounds of a mover that is due.
#[derive(Clone, Copy, PartialEq, Debug)]
enum State {
    /// The element of the list `movers` holds no mover.
    Free,
    /// The caller must set the mover's exact bounds in the next frame, the first since it was inserted. Its
    /// region is relative to the scene's origin in that frame, whatever the origin is now.
    Inserted,
    /// The caller must set the mover's exact bounds in the next frame. The bounds may be wrong until then:
    /// the volume was seen, bounds were set from outside, or the origin moved.
    New,
    /// The caller must set the mover's bounds in the present frame; they are exact once that is done.
    Active,
    /// Like `Active`, and the mover is visible in the present frame. Used within `end_frame` only.
    Visible,
    /// The mover was hidden in the last frame. At the start of the next frame its bounds in the scene are
    /// replaced by its motion volume, a box that contains it for some frames.
    Hidden,
    /// The mover has a motion volume: its bounds in the scene contain it until its deadline.
    Volume,
}

#[derive(Clone, Copy, Debug)]
struct Mover {
    id: ObjectId,
    motion: Motion,
    /// Number of frames for which the mover's next motion volume is to hold.
    span: f32,
    /// Bounds in the scene that contain the mover until its deadline. Meaningful in the state `Volume`.
    volume: Aabb,
}

/// Returns whether a mover may have a motion volume in place of its bounds. A volume may be nearer than the
/// begin of the draw range although the mover is not, and may reach out of the bounds of an HLOD parent, from
/// which the end of the draw range is measured. The volume of an HLOD parent may hold children that the
/// parent does not. The bounds of a volume would take local bounds, triangles and a mesh away.
fn may_have_volume(scene: &Scene, id: ObjectId) -> bool {
    let begins_near = scene.draw_range(id).is_ok_and(|range| range.begin == 0.0);
    let is_linked = scene.is_hlod_parent(id) || scene.hlod_parent(id).is_ok_and(|parent| parent.is_some());
    let has_shape = scene.has_mesh(id) || scene.triangles(id).is_ok_and(|triangles| !triangles.is_empty());
    begins_near && !is_linked && !has_shape && scene.local_bounds(id).is_none()
}

/// The movers of a scene, and the motion volumes of the hidden movers.
///
/// Each frame has two calls. [`begin_frame`](Self::begin_frame) lists the movers whose bounds must be set;
/// all others stay as they are. After culling, [`end_frame`](Self::end_frame) lists the movers whose volumes
/// are visible: the caller computes their exact positions before it draws them. Visible movers are due in
/// each frame.
///
/// # What is promised
/// No mover is hidden that would be visible with its exact bounds, as long as movers keep to their
/// [`Motion`], the due ones are set, and the culler is conservative: the bounds that it tests contain the
/// mover. A mover whose bounds the caller sets although it is not due (a teleport) is due again in the next
/// frame. All movers are due after the scene's origin was set, even to the same point, after another scene
/// took its place, and when time is NaN or runs backwards. Set the origin between `end_frame` and
/// `begin_frame`. If it is set in the middle of a frame, the movers that are not due stay where the new
/// origin puts them until the next frame. Movers that the scene does not contain are removed.
///
/// Give movers draw ranges, HLOD parents and HLOD children between `end_frame` and `begin_frame`, too. If a
/// mover that has a volume gets a draw range that begins above 0 in the middle of a frame, the volume is
/// tested against it in that frame, and may hide the mover as too near. In the next frame the mover is due.
///
/// Some movers never get a volume, so they are due in each frame:
/// - those with a [draw range](Scene::set_draw_range) that begins above 0: a volume could be nearer than
///   `begin`, and so not drawn, while the mover itself is beyond `begin`;
/// - those with an [HLOD parent](Scene::set_hlod_parent): the end of their range is measured from the
///   parent's bounds, of which a volume may reach out; and HLOD parents themselves, since a volume may hold a
///   child that the parent does not;
/// - those with [local bounds](Scene::set_local_bounds), triangles or an occluder mesh, which the bounds of a
///   volume would take away.
///
/// # Cost
/// `begin_frame` takes constant time per hidden mover that gets a volume, per volume that ends and per due
/// mover, and a comparison for each 64 movers. `end_frame` takes time in proportion to the visible objects,
/// the due movers and the changes of the scene. Other movers cost next to nothing, unless more objects change
/// in a frame than the scene's log lists (a quarter of them): then every volume is compared with the scene,
/// some 20 ns each. [`set_bounds_batch`](Self::set_bounds_batch) avoids this when it sets the due bounds.
/// Frames allocate nothing once the buffers have grown.
///
/// A due mover costs two to three times as much as one of a batch of all movers. So volumes save time by
/// themselves if at most a tenth of the movers are due, and else by what the animation of the others would
/// take.
///
/// ```
/// use visibility_frame::motion::{Motion, MotionVolumes};
/// use visibility_core::{glam::DVec3, Aabb, FrustumCuller, Pipeline, Pose, Scene, View, VisibleSet};
/// let mut scene = Scene::new();
/// let at = |x: f32| Aabb::from_arrays([x, 0.0, 0.0], [x + 1.0, 1.0, 1.0]);
/// let walker = scene.insert(at(-500.0)); // behind the camera
/// let mut volumes = MotionVolumes::new();
/// volumes.insert(walker, Motion::new(2.0));
/// let view = View::perspective(Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z), 1.0, 1.0, 0.1, 1e3)?;
/// let (mut pipeline, mut visible) = (Pipeline::new().with(FrustumCuller::new()), VisibleSet::new());
/// let (mut due, mut moved, mut seen, mut updates) = (Vec::new(), Vec::new(), Vec::new(), 0);
/// for frame in 0..100 {
///     let time = f64::from(frame) / 60.0;
///     volumes.begin_frame(&mut scene, time, &mut due);
///     moved.clear();
///     moved.extend(due.iter().map(|&id| (id, at(-500.0 + 2.0 * time as f32))));
///     volumes.set_bounds_batch(&mut scene, &moved)?;
///     updates += due.len();
///     pipeline.cull(&scene, &view, &mut visible);
///     volumes.end_frame(&scene, &visible, &mut seen);
///     // Here the movers in `seen` are put into their exact positions, and `visible` is drawn.
/// }
/// assert!(updates < 10);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct MotionVolumes {
    movers: Vec<Mover>,
    /// State of each mover, indexed like `movers`: a byte, so that all states stay in the cache.
    states: Vec<State>,
    /// Position in `movers` of each mover, by the index of its object.
    places: Places,
    free: Vec<u32>,
    /// Positions in `movers` of all movers without a volume. Some may be of movers that were removed. Frames
    /// go through them in the order in which memory holds movers, and mostly their objects in the scene.
    active: Bits,
    deadlines: Deadlines,
    /// Scratch memory: movers whose bounds in the scene `begin_frame` replaces, with their new volumes,
    /// relative to the scene's origin.
    moved: Vec<(ObjectId, Aabb)>,
    cursor: SceneCursor,
    time: f64,
    /// Time from the frame before to the present one, in the caller's unit.
    frame_time: f64,
}

/// Least, first and greatest span: numbers of frames for which a motion volume is to hold.
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
            states: Vec::new(),
            places: Places::new(),
            free: Vec::new(),
            active: Bits::EMPTY,
            deadlines: Deadlines::new(),
            moved: Vec::new(),
            cursor: SceneCursor::START,
            time: f64::NAN,
            frame_time: 0.0,
        }
    }

    /// Adds an object as a mover, or replaces its motion. The mover's exact bounds are due in the next frame.
    /// A mover that is not in the scene is dropped when the next frame begins.
    pub fn insert(&mut self, id: ObjectId, motion: Motion) {
        // The mover is this object, or an earlier object with the same index that was removed from the scene.
        if let Some(old) = self.places.get(id.index()) {
            self.release(old);
        }
        let place = self.free.pop().unwrap_or(self.movers.len() as u32);
        let mover = Mover { id, motion, span: SPANS[1], volume: Aabb::EMPTY };
        if place as usize == self.movers.len() {
            self.movers.push(mover);
            self.states.push(State::Inserted);
        } else {
            self.movers[place as usize] = mover;
            self.states[place as usize] = State::Inserted;
        }
        self.places.set(id.index(), Some(place));
        self.active.grow(self.movers.len());
        self.active.insert(place as usize);
        self.deadlines.grow(self.movers.len());
    }

    /// Removes a mover; its bounds in the scene stay as they are. Returns false if `id` is no mover.
    pub fn remove(&mut self, id: ObjectId) -> bool {
        let Some(place) = self.place(id) else { return false };
        self.release(place);
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
        self.states[place as usize] = State::Free;
        self.places.set(self.movers[place as usize].id.index(), None);
        self.free.push(place);
    }

    fn place(&self, id: ObjectId) -> Option<u32> {
        self.places.get(id.index()).filter(|&place| self.movers[place as usize].id == id)
    }

    /// Begins the frame at `time`: gives motion volumes to the movers that were hidden in the last frame, and
    /// replaces the content of `due` with the movers whose exact bounds the caller must set before it culls.
    /// `time` may be in any unit, if [`Motion::max_speed`] is in metres per that unit. Movers that the scene
    /// no longer contains are removed.
    pub fn begin_frame(&mut self, scene: &mut Scene, time: f64, due: &mut Vec<ObjectId>) {
        due.clear();
        self.take_changes(scene);
        let last = core::mem::replace(&mut self.time, time);
        self.frame_time = time - last;
        if self.frame_time.is_nan() || self.frame_time < 0.0 {
            self.frame_time = 0.0;
            (0..self.movers.len() as u32).for_each(|place| self.activate(place));
        }
        let Self { deadlines, movers, states, active, .. } = self;
        deadlines.take_before(time, |place| {
            let place = place as usize;
            if states[place] == State::Volume {
                // The span ended and the volume was never seen: the next span is longer.
                movers[place].span = (movers[place].span * 2.0).min(SPANS[2]);
                states[place] = State::Active;
                active.insert(place);
            }
        });
        let mut next = self.active.next(0);
        while let Some(place) = next {
            // A mover may be inserted after its object was removed, or with an id of another scene.
            if self.states[place] == State::Inserted && !scene.contains(self.movers[place].id) {
                self.release(place as u32);
            }
            let is_due = match self.states[place] {
                State::Free => false,
                State::Hidden => !self.enter_volume(scene, place as u32, last),
                _ => true,
            };
            if is_due {
                self.states[place] = State::Active;
                due.push(self.movers[place].id);
            } else {
                self.active.remove(place);
            }
            next = self.active.next(place + 1);
        }
        // All ids are in the scene, so the call cannot fail.
        let _ = scene.set_bounds_batch(&self.moved);
        self.moved.clear();
        self.cursor = SceneCursor::at(scene);
    }

    /// Sets bounds as [`Scene::set_bounds_batch`] does. For the exact bounds of the due movers this is
    /// quicker than the scene's own function where more than a quarter of the scene's objects are due.
    /// `bounds` may also contain objects that are no movers, and movers that are not due: these become due in
    /// the next frame.
    ///
    /// # Errors
    /// Returns the errors of [`Scene::set_bounds_batch`], and then changes nothing.
    pub fn set_bounds_batch(
        &mut self,
        scene: &mut Scene,
        bounds: &[(ObjectId, Aabb)],
    ) -> Result<(), SceneError> {
        self.take_changes(scene);
        scene.set_bounds_batch(bounds)?;
        for &(id, _) in bounds {
            self.activate_object(id);
        }
        self.cursor = SceneCursor::at(scene);
        Ok(())
    }

    /// Gives a mover that was hidden in the frame at time `last` a motion volume that holds beyond the
    /// present frame. Returns false if no such volume is known: the caller must then set the mover's bounds
    /// in this frame.
    fn enter_volume(&mut self, scene: &Scene, place: u32, last: f64) -> bool {
        let mover = &mut self.movers[place as usize];
        let Ok(bounds) = scene.bounds(mover.id) else { return false };
        if !may_have_volume(scene, mover.id) {
            return false;
        }
        // Spans are varied by up to a half, so that movers that were hidden together are not due together.
        let spread = f64::from(mover.id.index().wrapping_mul(0x9e37_79b9) as u32) / f64::from(u32::MAX);
        let deadline = last + self.frame_time * f64::from(mover.span) * (0.75 + 0.5 * spread);
        let Some(volume) = mover.motion.volume(&bounds, deadline - last) else { return false };
        if deadline.is_nan() || deadline <= self.time {
            return false;
        }
        self.moved.push((mover.id, volume));
        mover.volume = volume;
        self.states[place as usize] = State::Volume;
        self.deadlines.set(place, deadline);
        true
    }

    /// Ends a frame after culling, before `visible` is drawn. Replaces the content of `seen` with the movers
    /// in `visible` that were not due: their volumes are visible, so the caller must compute their exact
    /// positions. `visible` must hold what any view of the frame shows: for several views the
    /// [`union`](VisibleSet::union) of their sets.
    pub fn end_frame(&mut self, scene: &Scene, visible: &VisibleSet, seen: &mut Vec<ObjectId>) {
        seen.clear();
        for id in visible.iter(scene) {
            let Some(place) = self.places.get(id.index()) else { continue };
            match self.states[place as usize] {
                State::Active => self.states[place as usize] = State::Visible,
                State::Volume if self.movers[place as usize].id == id => {
                    let span = &mut self.movers[place as usize].span;
                    *span = (*span * 0.5).max(SPANS[0]);
                    self.states[place as usize] = State::New;
                    self.active.insert(place as usize);
                    seen.push(id);
                }
                _ => {}
            }
        }
        self.take_changes(scene);
        for place in self.active.iter() {
            let state = &mut self.states[place];
            *state = match *state {
                State::Active => State::Hidden,
                State::Visible => State::Active,
                other => other,
            };
        }
    }

    /// Makes a mover due (the caller must set its exact bounds) if its bounds were set, or may have been,
    /// since the scene was last read. Removes movers that the scene no longer contains.
    ///
    /// After the scene's origin was set, all movers are due: volumes, exact bounds and regions are in scene
    /// coordinates, and then stand for other places in the world, even if the scene still holds equal
    /// numbers.
    fn take_changes(&mut self, scene: &Scene) {
        let is_placed = self.cursor.is_at_origin_of(scene);
        match self.cursor.follow(scene) {
            // The origin has moved: all volumes begin anew from the next position of each mover.
            Changes::Everything if !is_placed => {
                for place in 0..self.movers.len() {
                    let state = self.states[place];
                    if state == State::Free {
                        continue;
                    }
                    if !scene.contains(self.movers[place].id) {
                        self.release(place as u32);
                    } else if state != State::Inserted {
                        let motion = &mut self.movers[place].motion;
                        *motion = Motion::new(motion.max_speed);
                        self.states[place] = State::New;
                        self.active.insert(place);
                    }
                }
            }
            // The log does not list all changes: every mover whose bounds are no longer its volume is made
            // due.
            Changes::Everything => {
                for place in 0..self.movers.len() {
                    let (Mover { id, volume, .. }, state) = (self.movers[place], self.states[place]);
                    match (state, scene.bounds(id)) {
                        (State::Free, _) => {}
                        (_, Err(_)) => self.release(place as u32),
                        (State::Volume, Ok(bounds)) if bounds == volume && may_have_volume(scene, id) => {}
                        (_, Ok(_)) => self.activate(place as u32),
                    }
                }
            }
            Changes::Objects(ids) => {
                for &id in ids {
                    self.activate_object(id);
                    if !scene.contains(id) {
                        self.remove(id);
                    }
                }
            }
        }
    }

    /// Makes an object due if it is a mover: the caller must set its exact bounds in the next frame.
    fn activate_object(&mut self, id: ObjectId) {
        if let Some(place) = self.places.get(id.index()) {
            self.activate(place);
        }
    }

    /// Makes a mover due, with an unchanged span: the caller must set its exact bounds in the next frame.
    fn activate(&mut self, place: u32) {
        let state = &mut self.states[place as usize];
        match *state {
            State::Volume => {
                *state = State::New;
                self.active.insert(place as usize);
            }
            State::Hidden => *state = State::Active,
            State::Active | State::Visible | State::New | State::Inserted | State::Free => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::glam::{Affine3A, DVec3};
    use visibility_core::scene::DrawRange;
    use visibility_core::{OccluderMesh, Pose, View};
    use visibility_testing::Random;

    /// Volumes of speeds and regions at their limits.
    #[test]
    fn volumes_are_of_what_is_known() {
        let bounds = Aabb::from_arrays([0.0; 3], [1.0; 3]);
        let volume = |motion: Motion| motion.volume(&bounds, 2.0);
        for speed in [-1.0, f32::NAN, f32::INFINITY] {
            assert_eq!(volume(Motion::new(speed)), None, "a speed of {speed}");
        }
        assert!(volume(Motion::new(0.0)).is_some(), "a mover that stands still");
        let infinite = Aabb::from_arrays([0.0; 3], [1.0, f32::INFINITY, 1.0]);
        assert_eq!(Motion::new(1.0).volume(&infinite, 2.0), None, "bounds that are not finite");
        let fast = |region: Aabb| volume(Motion::new(f32::INFINITY).within(region));
        assert_eq!(fast(bounds), Some(bounds), "of a region that is just the bounds");
        for axis in 0..3 {
            for (min, max) in [(0.5, 2.0), (-1.0, 0.5)] {
                let mut region = Aabb::from_arrays([-1.0; 3], [2.0; 3]);
                assert_eq!(fast(region), Some(region), "of a region around the bounds");
                (region.min[axis], region.max[axis]) = (min, max);
                assert_eq!(fast(region), None, "axis {axis}: a region that does not hold the bounds");
            }
        }
    }

    /// Only a mover that is its bounds alone may have others in their place.
    #[test]
    fn movers_with_ranges_parents_or_shapes_may_have_no_volume() {
        let mut scene = Scene::new();
        let bounds = Aabb::from_arrays([0.0; 3], [1.0; 3]);
        let ids = scene.insert_batch((0..8).map(|_| bounds));
        let [plain, near, begins, child, parent, meshed, drawn, local] = ids[..] else {
            unreachable!("8 ids")
        };
        scene.set_draw_range(near, DrawRange { end: 9.0, ..DrawRange::ALWAYS }).unwrap();
        scene.set_draw_range(begins, DrawRange { begin: 9.0, ..DrawRange::ALWAYS }).unwrap();
        scene.set_hlod_parent(child, Some(parent)).unwrap();
        let mesh = scene.add_mesh(OccluderMesh::cuboid(&bounds).unwrap());
        scene.set_mesh(meshed, mesh, Affine3A::IDENTITY).unwrap();
        scene.set_triangles(drawn, [[Vec3::ZERO, Vec3::X, Vec3::Y]]).unwrap();
        scene.set_local_bounds(local, bounds).unwrap();
        let may =
            [plain, near, begins, child, parent, meshed, drawn, local].map(|id| may_have_volume(&scene, id));
        assert_eq!(may, [true, true, false, false, false, false, false, false], "by what movers have");
    }

    /// All movers are due once time runs backwards or is unknown, and none are that have a volume otherwise.
    #[test]
    fn movers_are_due_when_time_jumps_back() {
        for (jump, is_due) in [(10.5, false), (9.0, true), (f64::NAN, true)] {
            let (mut scene, mut volumes, mut visible) =
                (Scene::new(), MotionVolumes::new(), VisibleSet::new());
            let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
            let nothing = View::perspective(pose, 1.0, 1.0, 0.1, 9.0).unwrap().with_layers(0);
            let bounds = Aabb::from_arrays([0.0; 3], [1.0; 3]);
            let id = scene.insert(bounds);
            volumes.insert(id, Motion::new(1.0));
            let (mut due, mut seen) = (Vec::new(), Vec::new());
            for time in [7.0, 8.0, 9.0, 10.0] {
                volumes.begin_frame(&mut scene, time, &mut due);
                let set: Vec<_> = due.iter().map(|&id| (id, bounds)).collect();
                volumes.set_bounds_batch(&mut scene, &set).unwrap();
                visible.fill(&scene, &nothing);
                volumes.end_frame(&scene, &visible, &mut seen);
            }
            assert!(due.is_empty() && scene.bounds(id) != Ok(bounds), "the mover has a volume");
            volumes.begin_frame(&mut scene, jump, &mut due);
            assert_eq!(due.contains(&id), is_due, "at the time {jump}");
        }
    }

    /// Tests positions that are exact in f64 and rounded to f32 by the caller, at both ends of a motion at
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
            // A caller that rounds inwards: each side is off by up to a step.
            let rounded = DVec3::splat(start).as_vec3();
            let low = if f64::from(rounded.x) < start { rounded.x.next_up() } else { rounded.x };
            let high = if f64::from(rounded.x) > start { rounded.x.next_down() } else { rounded.x };
            let of = |at: f32| {
                let bounds = Aabb::new(Vec3::splat(at), Vec3::splat(at));
                Motion::new(speed).volume(&bounds, time).unwrap()
            };
            let least = Aabb::new(of(low).min, of(high).max);
            for end in [start - f64::from(speed) * time, start + f64::from(speed) * time] {
                let end = Aabb::from_world(DVec3::splat(end), DVec3::splat(end), DVec3::ZERO);
                let holds = least.min.cmple(end.min).all() && end.max.cmple(least.max).all();
                assert!(holds, "{least:?} of sides rounded inwards, {end:?}");
            }
            for end in [start - f64::from(speed) * time, start + f64::from(speed) * time] {
                // The caller may also round outwards.
                let end = Aabb::from_world(DVec3::splat(end), DVec3::splat(end), DVec3::ZERO);
                assert!(
                    volume.contains_point(end.min) && volume.contains_point(end.max),
                    "{volume:?} {end:?}"
                );
            }
        }
    }
}
