//! `OnlinePvs`: the objects visible from the surroundings of a moving eye, in a scene that changes.
//!
//! Boxes of two sizes make a viewcell cheap. An object that is hidden from a wide box, of some metres, is
//! hidden from every viewcell inside it. It also hides nothing there that other objects do not hide as well,
//! since a ray that reaches it has met another occluder before. So a viewcell tests only the objects that the
//! wide box sees, with these as the only occluders. Further, the objects that the last viewcell saw are
//! assumed to be seen, since nearly all of them are: a sweep ends early where no other object needs a test.
//! To drop objects that are no longer visible, each viewcell tests all objects in one of the six directions,
//! in turn.

use crate::sight_start::sight_start;
use crate::solids::occluding;
use crate::sweep::{Ask, Asked, Effort, ExtendedProjectionCuller, Surfaces, Work};
use alloc::sync::Arc;
use alloc::vec::Vec;
use visibility_core::bits::Bits;
use visibility_core::culler::Lack;
use visibility_core::glam::DVec3;
use visibility_core::pvs::Viewcell;
use visibility_core::scene::{Changes, SceneCursor};
use visibility_core::stamp::Stamp;
use visibility_core::view::Eye;
use visibility_core::{Accuracy, CullStats, Culler, ObjectId, Scene, View, VisibleSet};

/// Number of boxes of each size that are kept, besides those that hold a place given by the caller.
const KEPT: usize = 32;

/// Conservative sets of visible objects around a moving eye, computed a little ahead of it, in a scene that
/// changes.
///
/// [`step`](Self::step) works ahead: each call sweeps one of the six directions of a box, or a part of it.
/// Boxes have two sizes: a *wide box* finds the objects of the whole scene that are hidden from it, and a
/// small *viewcell* in it finds more hidden ones among the rest. The caller says how much work a call may do,
/// and names the places where the eye is and may be next. [`cull`](Culler::cull) answers at once, by a
/// viewcell that holds the eye, otherwise by a wide box that does. If no box holds the eye, all candidates
/// stay. Lines of sight begin on the near plane, so the box must hold the near plane too.
///
/// An object that was inserted, moved or otherwise changed counts as visible until the next wide box is made,
/// and it is not an occluder of the next boxes, so that a moving object does not invalidate boxes each frame.
/// A change of an object that was an occluder of a box drops all boxes: doors and other moving objects should
/// not be flagged as occluders, or should occlude in a per-frame culler. All boxes are also dropped for
/// another scene, including a clone, and if more objects change between two calls than the scene's log holds:
/// 1,024, or a quarter of the objects if that is more. If a view's layers leave out an occluder of the boxes,
/// all candidates stay. Objects that earlier stages of a pipeline remove still occlude, as in a baked set.
///
/// # Cost
/// A viewcell of 0.6 m takes 2 to 20 milliseconds in scenes of some thousand objects, and a wide box 15 to
/// 80. A step does a sixth of that, or the part that its budget allows. Three kinds of work are not divided
/// between steps: the first step in a scene of walls (at most 32 triangles for each occluder on average)
/// sorts all their edges; beginning and finishing a box take some nanoseconds for each object of the scene;
/// and once the hierarchy of the scene has changed during more than two steps of a wide box, each remaining
/// direction is one step. Steps allocate. A frame takes a few nanoseconds for each candidate, and reads one
/// bit for each object of the scene. A kept box takes one bit for each object of the scene, and 8 bytes for
/// each visible object.
///
/// ```
/// use visibility_core::{glam::{Affine3A, DVec3}, Aabb, Culler, Object, OccluderMesh, Pose, Scene, View,
///     VisibleSet};
/// use visibility_region::OnlinePvs;
/// let wall = Aabb::from_arrays([5.0, -9.0, -9.0], [5.2, 9.0, 9.0]);
/// let mut scene = Scene::new();
/// let id = scene.insert(Object { occluder: true, ..Object::new(wall) });
/// let mesh = scene.add_mesh(OccluderMesh::cuboid(&wall)?);
/// scene.set_mesh(id, mesh, Affine3A::IDENTITY)?;
/// let post = scene.insert(Aabb::from_arrays([20.0, 0.0, 0.0], [20.5, 0.5, 1.0]));
/// let mut online = OnlinePvs::new(DVec3::splat(0.6), DVec3::new(4.0, 4.0, 0.6));
/// // Each frame: places where the eye is, and where it will be; then as many steps as there is time.
/// let (eye, velocity) = (DVec3::splat(0.5), DVec3::X);
/// let places = [0.0, 0.1, 0.2, 0.4].map(|seconds| eye + velocity * seconds);
/// while online.step(&scene, &places, 1000).is_some() {}
/// let view = View::perspective(Pose::look_at(eye, eye + DVec3::X, DVec3::Z), 1.0, 1.5, 0.1, 100.0)?;
/// let mut visible = VisibleSet::new();
/// online.cull(&scene, &view, &mut visible);
/// assert!(online.is_ready() && !visible.contains(&scene, post) && visible.contains(&scene, id));
/// scene.set_bounds(post, Aabb::from_arrays([30.0, 0.0, 0.0], [30.5, 0.5, 1.0]))?;
/// let mut visible = VisibleSet::new();
/// online.cull(&scene, &view, &mut visible);
/// assert!(visible.contains(&scene, post), "what moves counts as visible at once");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct OnlinePvs {
    /// Sizes of the boxes along x, y and z in metres: `sizes[WIDE]` for wide boxes, `sizes[NEAR]` for
    /// viewcells.
    sizes: [DVec3; 2],
    margin: f64,
    culler: ExtendedProjectionCuller,
    /// Surfaces of the occluders, joined across objects in a scene of walls, otherwise for each object by
    /// itself. `None` if they must be collected again.
    surfaces: Option<Arc<Surfaces>>,
    /// Indices of the objects whose surfaces are not in `surfaces`, or are outdated there.
    unlisted: Bits,
    /// State of the scene to which all fields below belong.
    cursor: SceneCursor,
    /// Finished boxes, each with the objects hidden from it: `made[WIDE]` holds the wide boxes, `made[NEAR]`
    /// the viewcells.
    made: [Vec<Made>; 2],
    /// The box that steps work on. `None` before the first step, and between two boxes.
    job: Option<Job>,
    /// Indices of the objects that were occluders of a box in `made` or of the box of `job`.
    occluding: Bits,
    /// Layer masks of the objects in `occluding`, each mask once.
    layers: Vec<u32>,
    /// Indices of the objects that have changed. `changed[0]`: since the last wide box was begun.
    /// `changed[1]`: between the beginnings of the last two wide boxes.
    changed: [Bits; 2],
    /// Objects that the last finished viewcell sees. The next viewcell assumes that it sees them too.
    known: Vec<ObjectId>,
    /// Direction, 0 to 5, in which the next viewcell tests all objects that the wide box sees. In the other
    /// five it tests only those that are not in `known`. The direction changes with each viewcell, so that in
    /// time all objects of `known` are tested in all directions.
    full_direction: usize,
    /// Counter of uses of boxes. [`Made::used`] holds its value at a box's last use.
    clock: u64,
    /// Size ([`WIDE`] or [`NEAR`]) and box that answered the last frame. `None` if no box did, so that all
    /// candidates stayed.
    answer: Option<(usize, Viewcell)>,
    /// Indices of the objects hidden from the box that answered the last frame; empty if no box answered it.
    /// The next frame finds `came` and `went` by the differences from its own hidden objects.
    last_hidden: Bits,
    came: Vec<ObjectId>,
    went: Vec<ObjectId>,
    /// Scratch memory: objects with their importance.
    ranked: Vec<(f64, ObjectId)>,
}

/// Number of times that the sweep of a direction of a wide box starts again because the hierarchy of the
/// scene has changed. After that, each direction of the box is one step.
const RESTARTS: u32 = 2;

/// Cost of listing the surfaces of one triangle, in nanoseconds of [`Work`].
const LISTED_TRIANGLE: u64 = 500;

/// Index of the wide boxes, the larger of two sizes of boxes, in arrays by size.
const WIDE: usize = 0;
/// Index of the viewcells, the smaller of two sizes of boxes, in arrays by size.
const NEAR: usize = 1;

/// Report of the work that one [step](OnlinePvs::step) has done.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[non_exhaustive]
pub struct OnlineStep {
    /// Whether the step worked on a wide box, not on a viewcell.
    pub is_wide: bool,
    /// Whether the step has finished its box, which answers frames from now on.
    pub is_last: bool,
    /// Work counters of the step.
    pub stats: CullStats,
}

/// A finished box, wide or a viewcell, with the objects that are hidden from all points of it.
#[derive(Clone, Debug)]
struct Made {
    cell: Viewcell,
    /// Indices of the hidden objects, except those that have changed since the box was finished.
    hidden: Bits,
    /// Objects that were not hidden when the box was finished. For a wide box, these are among all objects of
    /// the scene; for a viewcell, only among those that the wide box around it sees.
    seen: Vec<ObjectId>,
    /// Value of [`OnlinePvs::clock`] when the box was last used, or when it was finished.
    used: u64,
}

/// A box that [`step`](OnlinePvs::step) works on, one direction at a time. It answers no frame until it is
/// finished.
#[derive(Clone, Debug)]
struct Job {
    level: usize,
    cell: Viewcell,
    /// Direction that the next step sweeps, 0 to 5.
    next: usize,
    occluding: Bits,
    /// For a viewcell: indices of the objects hidden from the wide box around it, except those that changed
    /// later.
    hidden: Bits,
    /// Indices of the objects that have changed since work on the box began.
    stale: Bits,
    /// Layout of the scene's hierarchy when the sweep of the present direction was begun. `restarts` is how
    /// often a sweep for this box was started again because the layout had changed.
    layout: Stamp,
    restarts: u32,
    /// For a viewcell: the objects that the wide box sees.
    seen: Vec<ObjectId>,
    /// The objects of `seen` that are not in [`OnlinePvs::known`]: the last viewcell did not see them.
    new: Vec<ObjectId>,
}

impl OnlinePvs {
    /// Makes an empty store of boxes for one eye. `viewcell` and `wide` are the sizes of the boxes along x, y
    /// and z in metres. A viewcell of 0.6 m lasts for a quarter of a second of walking. The wide box should
    /// be several times as wide, but not higher than the viewcell: from above walls much more is visible.
    ///
    /// # Panics
    /// If a size is not positive and finite, or the viewcell is larger than the wide box on an axis.
    pub fn new(viewcell: DVec3, wide: DVec3) -> Self {
        let is_usable = viewcell.min_element() > 0.0 && viewcell.cmple(wide).all() && wide.is_finite();
        assert!(is_usable, "sizes of boxes must be positive, and those of viewcells at most the wide ones");
        Self {
            sizes: [wide, viewcell],
            margin: viewcell.min_element() / 8.0,
            culler: ExtendedProjectionCuller::new(),
            surfaces: None,
            unlisted: Bits::EMPTY,
            cursor: SceneCursor::START,
            made: [Vec::new(), Vec::new()],
            job: None,
            occluding: Bits::EMPTY,
            layers: Vec::new(),
            changed: [Bits::EMPTY, Bits::EMPTY],
            known: Vec::new(),
            full_direction: 0,
            clock: 0,
            answer: None,
            last_hidden: Bits::EMPTY,
            came: Vec::new(),
            went: Vec::new(),
            ranked: Vec::new(),
        }
    }

    /// Sets how far, in metres, a viewcell must extend around each place that it holds: to the corners of the
    /// near plane and to both eyes of a headset. At most half the least size of the viewcell; an eighth by
    /// default. NaN counts as 0.
    #[must_use]
    pub fn with_margin(self, margin: f64) -> Self {
        Self { margin: margin.max(0.0).min(self.sizes[NEAR].min_element() / 2.0), ..self }
    }

    /// Works on the most urgent missing box: the one for the first of `places` without a viewcell. Sweeps one
    /// direction, or continues the direction that the last step left unfinished. Returns the work done, or
    /// `None` if all places have viewcells. `places` are in world space: the eye, then places where it may be
    /// next, such as points of its path at equal times. A viewcell is placed so that it holds as many
    /// successive places as possible. Places that are not finite are ignored.
    ///
    /// The step ends with the direction, or once `budget` is used up: the work of about that many
    /// microseconds of a 3 GHz core. Work is counted and not timed, so that the steps are the same on every
    /// machine. A step does a little work even with a budget of 0, and exceeds its budget by at most one
    /// indivisible unit: the surfaces of an object, the pieces of a cluster, the drawing of an occluder, the
    /// beginning of a plane. The results do not depend on budgets.
    pub fn step(&mut self, scene: &Scene, places: &[DVec3], budget: u32) -> Option<OnlineStep> {
        self.sync(scene);
        let finite = || places.iter().copied().filter(|place| place.is_finite());
        let number = finite().position(|place| self.find(NEAR, self.around(place)).is_none())?;
        // A begun box that some place needs is finished first, unless the eye itself has no viewcell.
        let mut needing = finite().take(if number == 0 { 1 } else { usize::MAX });
        let goes_on = self.job.as_ref().is_some_and(|job| {
            needing.any(|place| {
                let [low, high] = self.around(place);
                holds(&job.cell, low, high)
            })
        });
        let (mut work, mut stats) = (Work::microseconds(budget), CullStats::default());
        if !goes_on {
            self.job = None;
            self.culler.end();
            if !self.list(scene, &mut work) {
                return Some(OnlineStep { is_wide: true, is_last: false, stats });
            }
            // The box must also hold the place before, so that no gap is left between two viewcells.
            let rest: Vec<DVec3> = finite().skip(number.saturating_sub(1)).collect();
            let ends = finite().next().zip(finite().next_back());
            let heading = ends.map_or(DVec3::ZERO, |(first, last)| last - first);
            self.begin(scene, &rest, usize::from(number > 0), heading);
        }
        let job = self.job.as_mut()?;
        let all = VisibleSet::new();
        let asked = match job.level {
            WIDE => Asked::Set(&all),
            _ if job.next == self.full_direction => Asked::Objects(&job.seen),
            _ => Asked::Objects(&job.new),
        };
        let ask = Ask { occluding: &job.occluding, asked, stop: &|| false };
        // The hierarchy's nodes have changed since the sweep of this direction was begun.
        if job.level == WIDE && job.layout != scene.layout() {
            job.layout = scene.layout();
            job.restarts += u32::from(self.culler.restart());
        }
        if job.restarts > RESTARTS {
            work = Work::UNLIMITED;
        }
        if self.culler.sweep_direction(scene, &ask, job.next, &mut work, &mut stats) {
            job.next += 1;
        }
        let step = OnlineStep { is_wide: job.level == WIDE, is_last: job.next == 6, stats };
        if step.is_last {
            self.finish(scene, places);
        }
        Some(step)
    }

    /// Returns whether a viewcell answered the last frame. False if a wide box or no box answered it.
    pub fn is_ready(&self) -> bool {
        matches!(self.answer, Some((NEAR, _)))
    }

    /// Returns the viewcell or wide box that answered the last frame. `None` if all candidates stayed.
    pub fn answer(&self) -> Option<&Viewcell> {
        self.answer.as_ref().map(|(_, cell)| cell)
    }

    /// Returns the objects that the box of the last frame sees and the box of the frame before did not see,
    /// wherever the view looks. If no box answered the last frame, these are all objects that were hidden. An
    /// inserted object is among them only if it has the index of a removed object that was hidden. In another
    /// scene both this list and [`went`](Self::went) start again, as if nothing had been hidden.
    ///
    /// The most important object comes first: the one with the largest ratio of diagonal to distance from the
    /// box that answered. Equal ratios are ordered by [index](ObjectId::index). A stream with room for some
    /// bytes a frame therefore sends as many of the first objects as fit. An object that was never hidden is
    /// never listed: a stream begins with all objects of the scene, and adds those that are inserted.
    pub fn came(&self) -> &[ObjectId] {
        &self.came
    }

    /// Returns the objects that the box of the frame before saw and the box of the last frame does not see,
    /// except removed objects. In the order of [`came`](Self::came), so the last one should be unloaded
    /// first.
    pub fn went(&self) -> &[ObjectId] {
        &self.went
    }

    /// Returns the indices of the objects that are hidden from all points of a box in world space, from `min`
    /// to `max`. Only for observers for which all occluders of the scene are drawn, such as other players on
    /// a server. `None` if no finished box holds this one, or if `min` is not at most `max` on each axis.
    pub fn hidden_from(&mut self, scene: &Scene, min: DVec3, max: DVec3) -> Option<&Bits> {
        self.sync(scene);
        let (level, at) = min.cmple(max).all().then(|| self.best(min, max))??;
        Some(&self.made[level][at].hidden)
    }

    /// Applies the changes of the scene since the last call: drops boxes and marks changed objects.
    fn sync(&mut self, scene: &Scene) {
        let is_same = self.cursor.is_in(scene);
        let Changes::Objects(ids) = self.cursor.follow(scene) else {
            self.forget();
            self.changed = [Bits::EMPTY, Bits::EMPTY];
            self.surfaces = None;
            if !is_same {
                self.last_hidden = Bits::EMPTY;
            }
            return;
        };
        if ids.iter().any(|id| self.occluding.contains(id.index())) {
            self.forget();
        }
        for id in ids {
            self.changed[0].grow(id.index() + 1);
            self.changed[0].insert(id.index());
            let is_listed = self.surfaces.as_ref().is_some_and(|all| all.objects.contains(id.index()));
            if is_listed || Surfaces::has(scene, *id) {
                self.unlisted.grow(id.index() + 1);
                self.unlisted.insert(id.index());
            }
            self.made.iter_mut().flatten().for_each(|made| _ = made.hidden.remove(id.index()));
            if let Some(job) = &mut self.job {
                job.stale.grow(id.index() + 1);
                job.stale.insert(id.index());
            }
        }
    }

    /// Lists the surfaces that the next box needs, until `work` is used up. Returns whether all are listed.
    fn list(&mut self, scene: &Scene, work: &mut Work) -> bool {
        let surfaces = self.surfaces.take().filter(|surfaces| !surfaces.is_mostly_unused());
        let surfaces = self.surfaces.insert(surfaces.unwrap_or_else(|| {
            let surfaces = Surfaces::of_walls(scene);
            self.unlisted.reset(scene.index_limit());
            for id in scene.ids().filter(|&id| Surfaces::has(scene, id)) {
                self.unlisted.set(id.index(), !surfaces.objects.contains(id.index()));
            }
            Arc::new(surfaces)
        }));
        let surfaces = Arc::make_mut(surfaces);
        let mut at = 0;
        while let Some(index) = self.unlisted.next(at) {
            at = index + 1;
            if self.changed[0].contains(index) {
                continue;
            }
            if work.is_used_up() {
                return false;
            }
            work.use_up(1 + surfaces.list(scene, index), LISTED_TRIANGLE);
            self.unlisted.remove(index);
        }
        true
    }

    /// Drops all boxes, finished or begun.
    fn forget(&mut self) {
        self.made.iter_mut().for_each(Vec::clear);
        self.job = None;
        self.known.clear();
        self.occluding.clear();
        self.layers.clear();
    }

    /// Returns the box that a viewcell must hold for a place: the place with the margin around it.
    fn around(&self, place: DVec3) -> [DVec3; 2] {
        [place - self.margin, place + self.margin]
    }

    /// Returns the index in `made[level]` of the most recently used box among those that hold the box from
    /// `low` to `high`. `None` if none holds it.
    fn find(&self, level: usize, [low, high]: [DVec3; 2]) -> Option<usize> {
        let made = self.made[level].iter().enumerate();
        made.filter(|(_, made)| holds(&made.cell, low, high))
            .max_by_key(|(_, made)| made.used)
            .map(|(at, _)| at)
    }

    /// Returns the size and the index in `made` of the best finished box that holds the box from `low` to
    /// `high`: a viewcell, otherwise a wide box, otherwise `None`. Marks the box as used.
    fn best(&mut self, low: DVec3, high: DVec3) -> Option<(usize, usize)> {
        let (level, at) =
            [NEAR, WIDE].iter().find_map(|&level| Some((level, self.find(level, [low, high])?)))?;
        self.clock += 1;
        self.made[level][at].used = self.clock;
        Some((level, at))
    }

    /// Returns a box of size `level` that holds the box `first` and as many of the next `places` in a row as
    /// it can. Spare room is put ahead, along `heading`.
    fn fit(&self, level: usize, first: [DVec3; 2], places: &[DVec3], heading: DVec3) -> Viewcell {
        let size = self.sizes[level];
        let mut ends = first;
        for &place in places {
            let [low, high] = self.around(place);
            let wider = [ends[0].min(low), ends[1].max(high)];
            if !(wider[1] - wider[0]).cmple(size).all() {
                break;
            }
            ends = wider;
        }
        let room = (size - (ends[1] - ends[0])).max(DVec3::ZERO) * 0.5;
        let ahead = heading / heading.abs().max_element().max(f64::MIN_POSITIVE);
        let ahead = if ahead.is_finite() { ahead } else { DVec3::ZERO };
        let middle = ends[0] * 0.5 + ends[1] * 0.5 + room * ahead;
        // Rounding must not exclude a point that the box is to hold.
        Viewcell::from_box((middle - size * 0.5).min(ends[0]), (middle + size * 0.5).max(ends[1]))
    }

    /// Begins the box that `places[missing]` needs. `missing` is 0 or 1; if it is 1, `places[0]` is the place
    /// before, which the box also holds if it is large enough. `heading` is the direction of the eye's path.
    fn begin(&mut self, scene: &Scene, places: &[DVec3], missing: usize, heading: DVec3) {
        let around = self.around(places[missing]);
        let from = self.around(places[0]);
        let both = [around[0].min(from[0]), around[1].max(from[1])];
        let fits = (both[1] - both[0]).cmple(self.sizes[NEAR]).all();
        let cell = self.fit(NEAR, if fits { both } else { around }, &places[missing..], heading);
        // A viewcell is clipped to the wide box, unless that would leave less than half of it on an axis.
        let clipped = |wide: &Viewcell| Viewcell::from_box(cell.min.max(wide.min), cell.max.min(wide.max));
        let least = (cell.max - cell.min) * 0.5;
        let is_enough = |clipped: &Viewcell| (clipped.max - clipped.min).cmpge(least).all();
        let wide = self.made[WIDE].iter().filter(|wide| holds(&wide.cell, around[0], around[1]));
        let wide = wide.map(|wide| (wide, clipped(&wide.cell))).filter(|(_, cell)| is_enough(cell));
        let mut occluding = occluding(scene, &VisibleSet::new());
        let (layout, stale) = (scene.layout(), Bits::new(scene.index_limit()));
        let (level, cell, hidden, seen, new) =
            if let Some((wide, cell)) = wide.max_by_key(|(wide, _)| wide.used) {
                let bits = |ids: &[ObjectId]| {
                    let mut bits = Bits::new(scene.index_limit());
                    ids.iter().for_each(|id| _ = bits.insert(id.index()));
                    bits
                };
                occluding.intersect(&bits(&wide.seen));
                let known = bits(&self.known);
                let new = wide.seen.iter().copied().filter(|id| !known.contains(id.index())).collect();
                let (hidden, seen) = (wide.hidden.clone(), wide.seen.clone());
                (NEAR, cell, hidden, seen, new)
            } else {
                let cell = self.fit(WIDE, [cell.min, cell.max], places, heading);
                let last = core::mem::replace(&mut self.changed[0], Bits::new(scene.index_limit()));
                self.changed[1] = last;
                (WIDE, cell, Bits::EMPTY, Vec::new(), Vec::new())
            };
        let job = Job { level, cell, next: 0, occluding, hidden, stale, layout, restarts: 0, seen, new };
        let surfaces = self.surfaces.clone().unwrap_or_default();
        self.culler.begin(scene, &job.cell, surfaces, Effort::QUICK);
        self.job = Some(self.without_movers(scene, job));
    }

    /// Removes the objects of [`OnlinePvs::changed`] from the occluders of a box. Adds the remaining
    /// occluders to [`OnlinePvs::occluding`], and their layers to [`OnlinePvs::layers`].
    fn without_movers(&mut self, scene: &Scene, mut job: Job) -> Job {
        for bits in &self.changed {
            bits.iter().for_each(|index| _ = job.occluding.remove(index));
        }
        self.occluding.grow(scene.index_limit());
        self.occluding.unite(&job.occluding);
        for object in job.occluding.iter().filter_map(|index| scene.object(scene.id_at(index)?).ok()) {
            if !self.layers.contains(&object.layers) {
                self.layers.push(object.layers);
            }
        }
        job
    }

    /// Keeps the box at work as finished. If there are many boxes of its size, drops the one used longest ago
    /// that no place needs.
    fn finish(&mut self, scene: &Scene, places: &[DVec3]) {
        let Some(job) = self.job.take() else { return };
        let mut hidden = job.hidden;
        hidden.grow(scene.index_limit());
        hidden.unite(self.culler.hidden());
        job.stale.iter().for_each(|index| _ = hidden.remove(index));
        let is_seen = |id: &ObjectId| !hidden.contains(id.index());
        let seen: Vec<ObjectId> = match job.level {
            WIDE => scene.ids().filter(is_seen).collect(),
            _ => job.seen.into_iter().filter(is_seen).collect(),
        };
        if job.level == NEAR {
            self.known.clone_from(&seen);
            self.full_direction = (self.full_direction + 1) % 6;
        }
        self.clock += 1;
        let made = &mut self.made[job.level];
        made.push(Made { cell: job.cell, hidden, seen, used: self.clock });
        let margin = self.margin;
        let is_free = |made: &&Made| !places.iter().any(|&p| holds(&made.cell, p - margin, p + margin));
        while made.len() > KEPT
            && let Some(used) = made.iter().filter(is_free).map(|made| made.used).min()
        {
            made.retain(|made| made.used != used);
        }
    }

    /// Notes which objects the box of this frame sees and that of the frame before did not, and the reverse.
    /// Sorts both lists by importance for a viewer in the box `around`, given by its minimum and maximum.
    fn note_differences(&mut self, scene: &Scene, at: Option<(usize, usize)>, around: (DVec3, DVec3)) {
        self.came.clear();
        self.went.clear();
        let nothing = Bits::EMPTY;
        let hidden = at.map_or(&nothing, |(level, at)| &self.made[level][at].hidden);
        let (old, new) = (self.last_hidden.words(), hidden.words());
        for at in 0..old.len().max(new.len()) {
            let [old, new] = [old, new].map(|words| words.get(at).copied().unwrap_or(0));
            let mut differ = old ^ new;
            while differ != 0 {
                let bit = differ.trailing_zeros() as usize;
                differ &= differ - 1;
                if let Some(id) = scene.id_at(at * 64 + bit) {
                    if old >> bit & 1 != 0 { self.came.push(id) } else { self.went.push(id) }
                }
            }
        }
        self.last_hidden.reset(new.len() * 64);
        self.last_hidden.unite(hidden);
        for list in [&mut self.came, &mut self.went] {
            self.ranked.clear();
            self.ranked.extend(list.iter().map(|&id| (importance(scene, id, around), id)));
            self.ranked.sort_unstable_by(|(a, i), (b, j)| b.total_cmp(a).then(i.index().cmp(&j.index())));
            list.clear();
            list.extend(self.ranked.iter().map(|&(_, id)| id));
        }
    }
}

/// Returns the diagonal of an object's bounds divided by their distance from a box in world space. For small
/// angles, this is about the greatest angle in radians at which the box sees the object. Infinite for an
/// object that reaches into the box, and 0 for an unknown one.
fn importance(scene: &Scene, id: ObjectId, (low, high): (DVec3, DVec3)) -> f64 {
    let Ok(bounds) = scene.bounds(id) else { return 0.0 };
    let [min, max] = [bounds.min, bounds.max].map(|corner| corner.as_dvec3() + scene.origin());
    let distance = (min - high).max(low - max).max(DVec3::ZERO).length();
    if distance > 0.0 { (max - min).length() / distance } else { f64::INFINITY }
}

/// Returns whether a viewcell's box holds the box from `low` to `high`.
fn holds(cell: &Viewcell, low: DVec3, high: DVec3) -> bool {
    cell.min.cmple(low).all() && high.cmple(cell.max).all()
}

impl Culler for OnlinePvs {
    fn name(&self) -> &str {
        "online pvs"
    }

    fn accuracy(&self) -> Accuracy {
        Accuracy::Conservative
    }

    fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats {
        self.sync(scene);
        let anchor = match view.eye(DVec3::ZERO) {
            Eye::Point(eye) => eye,
            Eye::Direction(_) => view.origin(),
        };
        let draws_all = self.layers.iter().all(|layers| layers & view.layers() != 0);
        let start = sight_start(view, anchor).filter(|_| draws_all);
        let found = start.and_then(|(low, high)| self.best(low, high));
        self.answer = found.map(|(level, at)| (level, self.made[level][at].cell.clone()));
        let cell = self.answer.as_ref().map(|(_, cell)| (cell.min, cell.max));
        self.note_differences(scene, found, cell.or(start).unwrap_or((anchor, anchor)));
        let hidden = found.map(|(level, at)| &self.made[level][at].hidden);
        visible.retain(scene, |id, _| !hidden.is_some_and(|hidden| hidden.contains(id.index())))
    }

    fn for_each_lack(&self, scene: &Scene, each: &mut dyn FnMut(Lack)) {
        if self.answer.is_none() && !scene.is_empty() {
            let what = "objects not culled, for want of a viewcell around the near plane, made for the view's layers";
            each(Lack { what, count: scene.len() });
        }
    }
}
