//! `OnlinePvs`: the objects visible from the surroundings of a moving eye, in a scene that changes.
//!
//! Two sizes of boxes make a viewcell cheap. What is hidden from a wide box, of some metres, is hidden from
//! every viewcell inside it, and hides nothing there that other objects do not hide as well: a ray that
//! reaches it has met another occluder before. So a viewcell asks about the objects that the wide box sees,
//! with these as the only occluders. Further, the objects that the last viewcell saw are taken as seen, since
//! nearly all of them are: a sweep ends early where no other object is asked. To forget what is out of sight
//! by now, each viewcell asks about all objects in one of the six directions, in turn.
//!
//! A sweep asks an object along the direction in which it is farthest. An object that is long along it, such
//! as a wall of the next storey, may be hidden along another: by the ceiling. So what the six directions
//! leave is asked in the others too, where that has paid.

use crate::sight_start::sight_start;
use crate::solids::occluding;
use crate::sweep::{Ask, Asked, Effort, ExtendedProjectionCuller, Surfaces, Work};
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::fmt;
use visibility_core::bits::Bits;
use visibility_core::culler::Lack;
use visibility_core::glam::DVec3;
use visibility_core::pvs::{HiddenSets, Viewcell, importance};
use visibility_core::scene::{Changes, SceneCursor};
use visibility_core::stamp::Stamp;
use visibility_core::view::Eye;
use visibility_core::{Accuracy, CullStats, Culler, ObjectId, Scene, View, VisibleSet};

/// Number of boxes of each size that are kept, besides those that hold a place given by the caller.
const KEPT: usize = 32;

/// Conservative sets of visible objects around a moving eye, computed a little ahead of it, in a scene that
/// changes.
///
/// [`step`](Self::step) works ahead: each call makes one of the up to twelve sweeps of a box, or a part of
/// it. The caller says how much work a call may do, and names the places where the eye is and may be next.
/// [`cull`](Culler::cull) answers at once: by the viewcell that holds the eye, otherwise by the wide box
/// around it, otherwise by nothing, so that all candidates stay. Lines of sight begin on the near plane, so
/// the viewcell must hold that as well.
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
/// A viewcell of .6 m takes 2 to 30 milliseconds in scenes of some thousand objects, a wide box 15 to 100. A
/// step takes as much of a sweep as its budget allows. Four things are not divided: the first step in a scene
/// of walls, of at most 32 triangles an occluder, sorts all their edges, and so does the step after the
/// origin has changed, or after most of the triangles in the list belong to occluders that have changed since
/// they were listed; beginning a sweep takes up to 60 nanoseconds for each object asked and, where objects
/// are asked one by one, for each occluder; beginning and finishing a box, and the step in the middle of a
/// wide one, take some nanoseconds for each object of the scene; and once the hierarchy of the scene has
/// changed at more than two steps of a wide box, each of the sweeps left is one step. Steps allocate. A frame
/// takes a few nanoseconds for each candidate, and looks at a bit for each object of the scene. A kept box
/// takes a bit for each object of the scene, and 8 bytes for each object that can be seen.
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
/// let mut online = OnlinePvs::new(DVec3::splat(0.6), DVec3::new(4.0, 4.0, 0.6))?;
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
    /// Extents along x, y and z in metres of the two sizes of boxes: `sizes[WIDE]` of the wide boxes,
    /// `sizes[NEAR]` of the viewcells, which lie in wide boxes.
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
    /// Number of boxes made, by size. `turns[NEAR]` modulo 6 is the direction in which the next viewcell asks
    /// about all objects that the wide box sees, `known` ones included.
    turns: [usize; 2],
    /// For each size of boxes and each direction: whether asking objects [beside](Asked::Beside) there paid
    /// the last time that it asked any. If not, it is tried again in one of [`TRIED`] boxes: in one that
    /// asks about all objects there.
    pays: [[bool; 6]; 2],
    /// Counter of uses of boxes, by which [`Made::used`] orders them: greater is later.
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

/// Number of times that the sweep of a direction of a wide box begins anew because the hierarchy of the scene
/// has changed. After that, each sweep of the box is one step.
const RESTARTS: u32 = 2;

/// Cost of listing the surfaces of one triangle, in nanoseconds of [`Work`].
const LISTED_TRIANGLE: u64 = 500;

/// Greatest work in nanoseconds for each object that a sweep [beside](Asked::Beside) hides, if it is to pay,
/// by size of the box: what a wide box hides is asked by none of its viewcells.
const WORTH: [u64; 2] = [4_000_000, 1_000_000];

/// Number of boxes, by size, from one try of a sweep [beside](Asked::Beside) that does not pay to the next: a
/// multiple of 6. A try in a viewcell asks all objects of its wide box, most of them in vain.
const TRIED: [usize; 2] = [12, 48];

/// Index of the larger of the two sizes of boxes, the wide boxes, in arrays by size.
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

/// A box that [`step`](OnlinePvs::step) works on, one sweep at a time. It answers no frame before it is
/// finished.
#[derive(Clone, Debug)]
struct Job {
    level: usize,
    cell: Viewcell,
    /// Number of the next sweep. Sweeps 0 to 5 are of the six directions, and ask each object along which it
    /// is farthest. Sweeps 6 to 11 are of the same directions, and ask the objects that are left
    /// [beside](Asked::Beside). 12 once the box is finished.
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
    /// Number of objects found hidden before the present sweep.
    before: u32,
    /// Work of the present sweep so far, in nanoseconds.
    spent: u64,
    /// For a viewcell: the objects that the wide box sees; empty for a wide box. From sweep 6 on, the objects
    /// of these, or of the scene, that no sweep from 0 to 5 has found hidden.
    seen: Vec<ObjectId>,
    /// The objects of `seen` that are not in [`OnlinePvs::known`]: the last viewcell did not see them.
    new: Vec<ObjectId>,
}

/// Error of sizes of boxes that an [`OnlinePvs`] cannot have.
///
/// ```
/// use visibility_core::glam::DVec3;
/// let error = visibility_region::OnlinePvs::new(DVec3::ONE, DVec3::splat(0.5)).unwrap_err();
/// assert_eq!(error.to_string(), "on axis 0, viewcells of 1 m do not fit into wide boxes of 0.5 m");
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
#[non_exhaustive]
pub struct OnlineSizeError {
    /// Size of the viewcells along x, y and z in metres.
    pub viewcell: DVec3,
    /// Size of the wide boxes.
    pub wide: DVec3,
}

impl fmt::Display for OnlineSizeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let axis = unusable_axis(self.viewcell, self.wide).unwrap_or(0);
        let [viewcell, wide] = [self.viewcell[axis], self.wide[axis]];
        write!(f, "on axis {axis}, viewcells of {viewcell} m do not fit into wide boxes of {wide} m")
    }
}

impl core::error::Error for OnlineSizeError {}

/// Returns the first axis on which a size is not positive and finite, or the viewcell is larger than the wide
/// box.
fn unusable_axis(viewcell: DVec3, wide: DVec3) -> Option<usize> {
    (0..3).find(|&axis| !(0.0 < viewcell[axis] && viewcell[axis] <= wide[axis] && wide[axis].is_finite()))
}

impl OnlinePvs {
    /// Makes an empty store of boxes for one eye. `viewcell` and `wide` are the sizes of the boxes along x, y
    /// and z in metres. A viewcell of 0.6 m lasts for a quarter of a second of walking. The wide box should
    /// be several times as wide, but not higher than the viewcell: from above walls much more is visible.
    ///
    /// # Errors
    /// [`OnlineSizeError`] if a size is not positive and finite, or the viewcell is larger than the wide box
    /// on an axis.
    pub fn new(viewcell: DVec3, wide: DVec3) -> Result<Self, OnlineSizeError> {
        if unusable_axis(viewcell, wide).is_some() {
            return Err(OnlineSizeError { viewcell, wide });
        }
        Ok(Self {
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
            turns: [0; 2],
            pays: [[true; 6]; 2],
            clock: 0,
            answer: None,
            last_hidden: Bits::EMPTY,
            came: Vec::new(),
            went: Vec::new(),
            ranked: Vec::new(),
        })
    }

    /// Sets how far, in metres, a viewcell must extend around each place that it holds: to the corners of the
    /// near plane and to both eyes of a headset. At most half the least size of the viewcell; an eighth by
    /// default. NaN counts as 0.
    #[must_use]
    pub fn with_margin(self, margin: f64) -> Self {
        Self { margin: margin.max(0.0).min(self.sizes[NEAR].min_element() / 2.0), ..self }
    }

    /// Works on the most urgent box that is missing: that of the first of `places` without a viewcell. Sweeps
    /// one direction for it, or goes on with the sweep that the last step left. Returns the work done, or
    /// `None` if all places have viewcells. `places` are in world space: the eye, then places where it may be
    /// next, such as points of its path at equal times. A viewcell is put around as many places in a row as
    /// it holds. Places that are not finite are left out.
    ///
    /// The step ends with the sweep, or once `budget` is used up: work of about so many microseconds of a
    /// core of 3 GHz, counted and not timed, so that the steps are the same on every machine. A step does a
    /// little work even with a budget of 0, and exceeds its budget by at most one lump: an object of which
    /// the surfaces are listed, a sweep begun, a cluster of which pieces are found, an occluder drawn, a
    /// plane begun, with the tests of the objects asked on it. The answers do not depend on budgets.
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
        let is_full_direction = job.next % 6 == self.turns[NEAR] % 6;
        let list = if job.level == WIDE || is_full_direction { &job.seen } else { &job.new };
        let asked = match job.next {
            0..6 if job.level == WIDE => Asked::All,
            0..6 => Asked::Objects(list),
            next => Asked::Beside(list, next - 6),
        };
        let ask = Ask { occluding: &job.occluding, asked, stop: &|| false };
        // Nodes of the hierarchy are not what they were when the sweep of the direction was begun.
        if asked.is_by_node() && job.layout != scene.layout() {
            job.layout = scene.layout();
            job.restarts += u32::from(self.culler.restart());
        }
        if job.restarts > RESTARTS {
            work = Work::UNLIMITED;
        }
        let before = work.done();
        let is_done = self.culler.sweep_direction(scene, &ask, job.next % 6, &mut work, &mut stats);
        job.spent += work.done() - before;
        if is_done {
            self.go_to_next(scene);
        }
        let job = self.job.as_ref()?;
        let step = OnlineStep { is_wide: job.level == WIDE, is_last: job.next == 12, stats };
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

    /// Returns whether a view of some layers draws all objects that were occluders of the boxes.
    fn is_drawn_whole(&self, view: u32) -> bool {
        self.layers.iter().all(|layers| layers & view != 0)
    }

    /// Applies the changes of the scene since the last call: drops boxes and marks changed objects.
    fn sync(&mut self, scene: &Scene) {
        let is_same = self.cursor.is_in(scene);
        let Changes::Objects(ids) = self.cursor.follow(scene) else {
            self.forget();
            self.changed = [Bits::EMPTY, Bits::EMPTY];
            self.pays = [[true; 6]; 2];
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
                occluding.intersect(&bits_of(&wide.seen, scene));
                let known = bits_of(&self.known, scene);
                let new = wide.seen.iter().copied().filter(|id| !known.contains(id.index())).collect();
                let (hidden, seen) = (wide.hidden.clone(), wide.seen.clone());
                (NEAR, cell, hidden, seen, new)
            } else {
                let cell = self.fit(WIDE, [cell.min, cell.max], places, heading);
                let last = core::mem::replace(&mut self.changed[0], Bits::new(scene.index_limit()));
                self.changed[1] = last;
                (WIDE, cell, Bits::EMPTY, Vec::new(), Vec::new())
            };
        let (next, restarts, before, spent) = (0, 0, 0, 0);
        let job =
            Job { level, cell, next, occluding, hidden, stale, layout, restarts, seen, before, spent, new };
        let surfaces = self.surfaces.clone().unwrap_or_default();
        self.culler.begin(scene, &job.cell, surfaces, Effort::QUICK);
        self.job = Some(self.without_movers(scene, job));
    }

    /// Goes on to the next sweep of the box at work. Those that ask beside are left out where that did not
    /// pay the last time.
    fn go_to_next(&mut self, scene: &Scene) {
        let Some(job) = &mut self.job else { return };
        let hidden = self.culler.hidden();
        let found = hidden.count() - job.before;
        // A sweep that asked nothing says nothing.
        if let Some(direction) = job.next.checked_sub(6)
            && job.spent > 0
        {
            self.pays[job.level][direction] = u64::from(found) * WORTH[job.level] > job.spent;
        }
        (job.before, job.spent, job.next) = (hidden.count(), 0, job.next + 1);
        if job.next == 6 {
            let is_left = |id: &ObjectId| !hidden.contains(id.index());
            match job.level {
                WIDE => job.seen = scene.ids().filter(is_left).collect(),
                _ => [&mut job.seen, &mut job.new].into_iter().for_each(|list| list.retain(is_left)),
            }
            job.occluding.intersect(&bits_of(&job.seen, scene));
        }
        let is_tried = |direction| self.turns[job.level] % TRIED[job.level] == direction;
        let is_due = |direction| self.pays[job.level][direction] || is_tried(direction);
        while (6..12).contains(&job.next) && !is_due(job.next - 6) {
            job.next += 1;
        }
    }

    /// Takes the objects that have changed from the occluders of a box, and notes the others.
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
        }
        self.turns[job.level] += 1;
        self.clock += 1;
        let needed: Vec<[DVec3; 2]> = places.iter().map(|&place| self.around(place)).collect();
        let is_free = |made: &&Made| !needed.iter().any(|&[low, high]| holds(&made.cell, low, high));
        let made = &mut self.made[job.level];
        made.push(Made { cell: job.cell, hidden, seen, used: self.clock });
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
            self.ranked.extend(list.iter().map(|&id| (importance(scene, id, around.0, around.1), id)));
            self.ranked.sort_unstable_by(|(a, i), (b, j)| b.total_cmp(a).then(i.index().cmp(&j.index())));
            list.clear();
            list.extend(self.ranked.iter().map(|&(_, id)| id));
        }
    }
}

/// Returns the indices of objects as bits.
fn bits_of(ids: &[ObjectId], scene: &Scene) -> Bits {
    let mut bits = Bits::new(scene.index_limit());
    ids.iter().for_each(|id| _ = bits.insert(id.index()));
    bits
}

/// Returns whether a viewcell's box holds the box from `low` to `high`.
fn holds(cell: &Viewcell, low: DVec3, high: DVec3) -> bool {
    cell.min.cmple(low).all() && high.cmple(cell.max).all()
}

impl HiddenSets for OnlinePvs {
    /// As [`hidden_from`](Self::hidden_from), which lends its answer. The eye's box must lie in one viewcell,
    /// so it should extend at most the [margin](Self::with_margin) around a place given to
    /// [`step`](Self::step).
    fn write_hidden(
        &mut self,
        scene: &Scene,
        layers: &[u32],
        min: DVec3,
        max: DVec3,
        hidden: &mut Bits,
    ) -> bool {
        self.sync(scene);
        if layers.iter().any(|&view| !self.is_drawn_whole(view)) {
            return false;
        }
        let Some(answer) = self.hidden_from(scene, min, max) else { return false };
        hidden.reset(scene.index_limit());
        hidden.unite(answer);
        true
    }
}

impl Culler for OnlinePvs {
    fn name(&self) -> &str {
        "online pvs"
    }

    fn accuracy(&self) -> Accuracy {
        Accuracy::Conservative
    }

    fn hides_behind_undrawn(&self) -> bool {
        true
    }

    fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats {
        self.sync(scene);
        let anchor = match view.eye(DVec3::ZERO) {
            Eye::Point(eye) => eye,
            Eye::Direction(_) => view.origin(),
        };
        let start = sight_start(view, anchor).filter(|_| self.is_drawn_whole(view.layers()));
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

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec;
    use visibility_core::glam::{Affine3A, Vec3};
    use visibility_core::{Aabb, Object, OccluderMesh, Pose};

    fn online(viewcell: f64, wide: f64, margin: f64) -> OnlinePvs {
        OnlinePvs::new(DVec3::splat(viewcell), DVec3::splat(wide)).unwrap().with_margin(margin)
    }

    /// Returns a scene of a few objects that hide nothing.
    fn scene() -> Scene {
        let mut scene = Scene::new();
        for i in 0..3 {
            let at = Vec3::splat(50.0 + i as f32);
            scene.insert(Aabb::new(at, at + 0.5));
        }
        scene
    }

    /// Adds an occluder that fills its bounds.
    fn occluder(scene: &mut Scene, bounds: Aabb) -> ObjectId {
        let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
        let mesh = scene.add_mesh(OccluderMesh::cuboid(&bounds).unwrap());
        scene.set_mesh(id, mesh, Affine3A::IDENTITY).unwrap();
        id
    }

    /// Steps until all places have viewcells.
    fn finish(online: &mut OnlinePvs, scene: &Scene, places: &[DVec3]) {
        let mut steps = 0;
        while online.step(scene, places, u32::MAX).is_some() {
            steps += 1;
            assert!(steps < 100, "the viewcells of {places:?} are not finished");
        }
    }

    #[test]
    fn sizes_are_positive_and_viewcells_fit_into_wide_boxes() {
        for (viewcell, wide, is_usable) in [
            (1.0, 2.0, true),
            (1.0, 1.0, true),
            (1.0, 0.9, false),
            (0.0, 1.0, false),
            (f64::NAN, 1.0, false),
            (1.0, f64::INFINITY, false),
        ] {
            for axis in 0..3 {
                let (mut cell, mut around) = (DVec3::ONE, DVec3::splat(2.0));
                (cell[axis], around[axis]) = (viewcell, wide);
                let expected = if is_usable { None } else { Some(axis) };
                assert_eq!(unusable_axis(cell, around), expected, "{cell} in {around}");
            }
        }
        let place = DVec3::new(1.0, 2.0, 3.0);
        for (given, margin) in [(0.25, 0.25), (1.0, 1.0), (9.0, 1.0), (-1.0, 0.0), (f64::NAN, 0.0)] {
            let around = online(2.0, 8.0, given).around(place);
            assert_eq!(around, [place - margin, place + margin], "a margin of {given}");
        }
    }

    /// A box holds the first box and as many places as fit, and has its spare room ahead.
    #[test]
    fn boxes_hold_as_many_places_as_fit() {
        let online = online(2.0, 8.0, 0.25);
        let first = [DVec3::ZERO, DVec3::splat(0.5)];
        let places = [[0.25, 0.25, 0.25], [1.25, -0.25, 0.25], [1.75, -0.25, 0.25], [1.76, 0.0, 0.25]];
        let places = places.map(DVec3::from_array);
        let of = |count: usize, heading: DVec3| {
            let cell = online.fit(NEAR, first, &places[..count], heading);
            [cell.min, cell.max].map(|corner| corner.to_array())
        };
        assert_eq!(of(1, DVec3::ZERO), [[-0.75; 3], [1.25; 3]], "room on all sides");
        assert_eq!(of(1, DVec3::X * 1e-3), [[0.0, -0.75, -0.75], [2.0, 1.25, 1.25]], "room ahead");
        assert_eq!(of(1, DVec3::Y * -9.0), [[-0.75, -1.5, -0.75], [1.25, 0.5, 1.25]], "room ahead");
        assert_eq!(of(1, DVec3::X * f64::INFINITY), [[-0.75; 3], [1.25; 3]], "no direction");
        assert_eq!(of(2, DVec3::ZERO), [[-0.25, -1.0, -0.75], [1.75, 1.0, 1.25]], "two places");
        for count in [3, 4] {
            let expected = [[0.0, -1.0, -0.75], [2.0, 1.0, 1.25]];
            assert_eq!(of(count, DVec3::ZERO), expected, "three places, and no room for a fourth");
        }
        // No room: the box is as large as what it holds, and not smaller by rounding.
        let wide = [DVec3::splat(0.1), DVec3::splat(9.3)];
        let cell = online.fit(WIDE, wide, &[], DVec3::ZERO);
        assert_eq!([cell.min, cell.max], wide, "a box larger than its size");
    }

    #[test]
    fn viewcells_hold_what_touches_their_sides() {
        let cell = Viewcell::from_box(DVec3::ZERO, DVec3::ONE);
        assert!(holds(&cell, DVec3::ZERO, DVec3::ONE), "the box itself");
        for axis in DVec3::AXES {
            assert!(!holds(&cell, axis * -1e-300, DVec3::ONE), "beyond the least corner");
            assert!(!holds(&cell, DVec3::ZERO, DVec3::ONE + axis * 1e-9), "beyond the greatest");
        }
    }

    /// Viewcells are within wide boxes, whose hidden objects they hide, and hold their place and the one
    /// before.
    #[test]
    fn viewcells_are_within_wide_boxes() {
        let scene = scene();
        for turn in [DVec3::ONE, DVec3::NEG_ONE] {
            let mut online = online(2.0, 3.0, 0.25);
            let at = |i: usize| turn * DVec3::new(i as f64 * 0.7, i as f64 * 0.3, 0.0);
            for i in 0..12 {
                let places: Vec<DVec3> = (i..i + 3).map(at).collect();
                finish(&mut online, &scene, &places);
                for made in &online.made[NEAR] {
                    let is_in = |wide: &Made| holds(&wide.cell, made.cell.min, made.cell.max);
                    assert!(online.made[WIDE].iter().any(is_in), "a viewcell beyond all wide boxes, {i}");
                }
                // No gap between the viewcells of places in a row.
                for pair in places.windows(2) {
                    let held = |made: &Made| pair.iter().all(|&place| holds(&made.cell, place, place));
                    assert!(online.made[NEAR].iter().any(held), "{pair:?} are in different viewcells");
                }
            }
            assert!(online.made[WIDE].len() > 3, "{} wide boxes", online.made[WIDE].len());
        }
    }

    /// A viewcell is the part of its box in the wide box around its place, if that is at least half of it
    /// along each axis; otherwise a wide box is begun.
    #[test]
    fn viewcells_are_clipped_to_wide_boxes() {
        let scene = scene();
        for axis in 0..3 {
            for (ends, clipped) in [
                ([-9.0, 9.0], Some([-1.0, 1.0])),
                ([-0.75, 9.0], Some([-0.75, 1.0])),
                ([-9.0, 0.5], Some([-1.0, 0.5])),
                ([-0.5, 0.75], Some([-0.5, 0.75])),
                ([-0.5, 0.25], None),
                ([0.0, 9.0], None),
            ] {
                let (mut online, mut wide) =
                    (online(2.0, 9.0, 0.25), [DVec3::splat(-9.0), DVec3::splat(9.0)]);
                (wide[0][axis], wide[1][axis]) = (ends[0], ends[1]);
                let cell = Viewcell::from_box(wide[0], wide[1]);
                online.made[WIDE].push(Made { cell, hidden: Bits::EMPTY, seen: Vec::new(), used: 1 });
                online.begin(&scene, &[DVec3::ZERO], 0, DVec3::ZERO);
                let job = online.job.unwrap();
                let found = (job.level == NEAR).then(|| [job.cell.min[axis], job.cell.max[axis]]);
                assert_eq!(found, clipped, "axis {axis}: a viewcell in a wide box from {ends:?}");
                let size = job.cell.max - job.cell.min;
                let others = (0..3).filter(|&other| other != axis && job.level == NEAR);
                assert!(others.into_iter().all(|other| size[other] == 2.0), "axis {axis}: a size of {size}");
            }
        }
    }

    /// Sweeps beside are left out in directions in which they did not pay, but for one that is tried anew.
    #[test]
    fn sweeps_beside_are_made_where_they_pay_and_where_they_are_tried() {
        let (scene, mut online) = (scene(), online(2.0, 3.0, 0.25));
        for (turn, pays, expected) in [
            (12, [false; 6], [6, 12, 12]),
            (13, [false, false, false, true, false, false], [7, 9, 12]),
            (18, [false, false, true, false, false, true], [8, 11, 12]),
            (6, [false; 6], [12, 12, 12]),
        ] {
            online.begin(&scene, &[DVec3::ZERO], 0, DVec3::ZERO);
            (online.turns[WIDE], online.pays[WIDE]) = (turn, pays);
            online.job.as_mut().unwrap().next = 5;
            let mut found = [0; 3];
            for next in &mut found {
                online.go_to_next(&scene);
                let job = online.job.as_mut().unwrap();
                *next = job.next;
                job.next = job.next.min(11);
            }
            assert_eq!(found, expected, "turn {turn}, where {pays:?} pay");
        }
    }

    /// A wide box asks all objects that are left beside: one above a ceiling begins farther aside than up,
    /// and is hidden upwards.
    #[test]
    fn wide_boxes_ask_all_objects_beside() {
        let (mut scene, mut online) = (scene(), online(2.0, 3.0, 0.25));
        occluder(&mut scene, Aabb::from_arrays([-30.0, -30.0, 3.0], [30.0, 30.0, 3.2]));
        let above = scene.insert(Aabb::from_arrays([5.0, -0.5, 4.0], [9.0, 0.5, 4.5]));
        finish(&mut online, &scene, &[DVec3::ZERO]);
        assert!(online.made[WIDE][0].hidden.contains(above.index()), "a box above the ceiling");
    }

    /// What the last viewcell saw is asked again within six viewcells.
    #[test]
    fn viewcells_forget_what_is_out_of_sight() {
        let mut scene = scene();
        occluder(&mut scene, Aabb::from_arrays([-3.0, 5.0, -9.0], [3.0, 5.2, 9.0]));
        let post = scene.insert(Aabb::from_arrays([0.0, 8.0, 0.0], [0.1, 8.1, 0.1]));
        let sizes = [DVec3::splat(0.5), DVec3::new(40.0, 1.0, 8.0)];
        let mut online = OnlinePvs::new(sizes[0], sizes[1]).unwrap().with_margin(0.1);
        let mut hides = |place: DVec3| {
            finish(&mut online, &scene, &[place]);
            assert_eq!(online.made[WIDE].len(), 1, "wide boxes around {place}");
            online.hidden_from(&scene, place, place).unwrap().contains(post.index())
        };
        assert!(!hides(DVec3::X * 15.0), "the post is seen past the wall's end");
        let hidden = (0..6).filter(|&i| hides(DVec3::Z * (f64::from(i) - 2.5))).count();
        assert!(hidden > 0, "the post is taken as seen behind the wall");
    }

    /// Lists of what came and went hold all objects whose answers differ, also where one of the frames has no
    /// box.
    #[test]
    fn differences_are_between_frames_with_and_without_boxes() {
        let (mut scene, mut online) = (Scene::new(), online(2.0, 3.0, 0.25));
        occluder(&mut scene, Aabb::from_arrays([-9.0, 5.0, -9.0], [9.0, 5.2, 9.0]));
        let post = scene.insert(Aabb::from_arrays([0.0, 8.0, 0.0], [0.1, 8.1, 0.1]));
        finish(&mut online, &scene, &[DVec3::ZERO]);
        for (x, came, went) in [(0.0, vec![], vec![post]), (0.0, vec![], vec![]), (90.0, vec![post], vec![])]
        {
            let eye = DVec3::X * x;
            let pose = Pose::look_at(eye, eye + DVec3::Y, DVec3::Z);
            let view = View::perspective(pose, 1.0, 1.0, 0.01, 9.0).unwrap();
            online.cull(&scene, &view, &mut VisibleSet::new());
            assert_eq!((online.came(), online.went()), (&came[..], &went[..]), "differences at {x}");
        }
    }

    /// A wall whose surfaces were collected is moved away by a transform, and back. Each time the next wide
    /// box takes it for a mover, which hides nothing, and the one after that has it where it is.
    #[test]
    fn occluders_that_were_moved_hide_where_they_are() {
        let (mut scene, mut online) = (scene(), online(2.0, 3.0, 0.25));
        let bounds = Aabb::from_arrays([-9.0, 5.0, -9.0], [9.0, 5.2, 9.0]);
        let wall = occluder(&mut scene, bounds);
        let post = scene.insert(Aabb::from_arrays([0.0, 8.0, 0.0], [0.1, 8.1, 0.1]));
        let hides = |online: &mut OnlinePvs, scene: &Scene, x: f64| {
            let place = DVec3::X * x;
            finish(online, scene, &[place]);
            online.hidden_from(scene, place, place).unwrap().contains(post.index())
        };
        assert!(hides(&mut online, &scene, 0.0), "the wall hides the post");
        // Moved by 8 m aside, the wall is before the post still, but rays pass its end.
        for (by, is_hidden) in
            [(Vec3::Z * 100.0, false), (Vec3::ZERO, true), (Vec3::X * 8.0, false), (Vec3::ZERO, true)]
        {
            let moved = Affine3A::from_translation(by);
            let mesh = scene.add_mesh(OccluderMesh::cuboid(&bounds).unwrap());
            scene.set_bounds(wall, bounds.transformed(&moved)).unwrap();
            scene.set_mesh(wall, mesh, moved).unwrap();
            assert!(!hides(&mut online, &scene, 3.5), "a wall that has just been moved by {by}");
            assert_eq!(hides(&mut online, &scene, -3.5), is_hidden, "a wall that stays moved by {by}");
        }
    }

    /// The 32 viewcells used last are kept beside the viewcells that a place needs.
    #[test]
    fn the_viewcells_used_last_are_kept() {
        let (scene, mut online) = (scene(), online(2.0, 3.0, 0.25));
        let place = |i: usize| DVec3::X * (100.0 * i as f64);
        for i in 0..40 {
            finish(&mut online, &scene, &[place(i)]);
            assert_eq!(online.made[NEAR].len(), (i + 1).min(KEPT), "viewcells after place {i}");
        }
        let kept = |i: usize| online.find(NEAR, online.around(place(i))).is_some();
        assert!((0..40).all(|i| kept(i) == (i >= 8)), "viewcells of the last places");
        let all: Vec<DVec3> = (0..40).map(place).collect();
        finish(&mut online, &scene, &all);
        assert_eq!(online.made[NEAR].len(), 40, "all viewcells are needed");
    }

    /// Hidden objects are told for a box and for a point, and what a frame lacks.
    #[test]
    fn answers_are_for_boxes_that_are_not_inverted() {
        let (scene, mut online) = (scene(), online(2.0, 3.0, 0.25));
        finish(&mut online, &scene, &[DVec3::ZERO]);
        let mut knows = |min: f64, max: f64| {
            online.hidden_from(&scene, DVec3::new(0.0, min, 0.0), DVec3::new(0.0, max, 0.0)).is_some()
        };
        assert!(knows(0.0, 0.0) && knows(-0.25, 0.25), "a point and a box");
        assert!(!knows(0.25, -0.25) && !knows(-9.0, 9.0), "an inverted box, and one beyond the viewcell");
        let lacks = |online: &OnlinePvs, scene: &Scene| {
            let mut counts = vec![];
            online.for_each_lack(scene, &mut |lack| counts.push(lack.count));
            counts
        };
        let view = |x: f64| {
            let eye = DVec3::X * x;
            View::perspective(Pose::look_at(eye, eye + DVec3::X, DVec3::Z), 1.0, 1.0, 0.01, 9.0).unwrap()
        };
        for (x, expected) in [(0.0, vec![]), (90.0, vec![3])] {
            online.cull(&scene, &view(x), &mut VisibleSet::new());
            assert_eq!(lacks(&online, &scene), expected, "objects not culled from {x}");
        }
        assert_eq!(lacks(&online, &Scene::new()), [], "an empty scene lacks nothing");
    }
}
