//! The driver: selects and draws occluders, then walks a hierarchy of boxes and drops the objects that the
//! map hides.
//!
//! If a node is hidden, all objects below it are dropped without further tests. If no occluder in the map
//! covers any part of a node, all objects below it are kept. Only the children of other nodes are tested
//! (Cohen-Or, Chrysanthou, Silva and Durand, "A Survey of Visibility for Walkthrough Applications", 2003,
//! section 6: all image-space methods "place a hierarchy on the scene").

use super::budget::{Budget, Experience, LeafSampling};
use super::selection::{MIN_BEHIND, OccluderSearch, Queue, objects_of};
use super::{Occlusion64, OcclusionMap};
use crate::culler::Lack;
use crate::jobs::Jobs;
use crate::scene::lanes;
use crate::stamp::Stamp;
use crate::view::ViewRegion;
use crate::walk::{Block, BoxHierarchy, Child, IsOfScene, NodeTest, SceneHierarchy, Walk, retain_on};
use crate::{Accuracy, CullStats, Culler, Scene, View, VisibleSet, scene::SceneCursor};

/// Default [price](OcclusionCuller::with_price): the number of occluder triangles that may be drawn for each
/// object that they are expected to hide. With larger prices, frames of some scenes took over 1.2 times as
/// long as with the occluders that were best for the frame (measured).
const DEFAULT_PRICE: u32 = 24;

/// Default bound on the work of a frame, in triangles: some milliseconds, more than an engine has to spare. A
/// guard against extreme frames.
const DEFAULT_WORK_LIMIT: u32 = 1 << 15;

/// Removes the objects that an occlusion map finds hidden behind the scene's occluders.
///
/// Occluders are the objects of the set that are flagged as occluders and have a mesh ([`Scene::set_mesh`],
/// [`Scene::prepare_occluders`]). Objects that the map [draws by itself](OcclusionMap::draws) are not drawn
/// again. Put the culler after the frustum in a pipeline: only objects that are still in the set are drawn
/// and tested.
///
/// # Cost
/// Occluders are drawn nearest first, and only if they are expected to hide enough objects for their
/// [price](Self::with_price). Hidden nodes and occluders are skipped. Work is counted in triangles (about 0.1
/// microseconds each with the z-buffer). Each object found hidden allows more work. The work of a frame is
/// proportional to the nodes and occluders that are seen, plus at most a constant for occluders that turn out
/// to hide nothing. A frame that has spent this constant and found nearly nothing hidden backs off: it tests
/// the objects of fewer and fewer leaves of the hierarchy and leaves all others visible.
/// [`with_work_limit`](Self::with_work_limit) bounds the work of a frame altogether.
///
/// After eight frames in a row whose work was worth more than the objects found hidden, whole frames are left
/// out: their objects stay visible. Frames are tested again after 64 left out in a row, once these have saved
/// the work spent in vain, once the camera has turned by 30 degrees, or once twice as many objects are in
/// view. Otherwise the answer depends on scene, set, view and settings alone, unless the map itself remembers
/// earlier frames.
///
/// ```
/// # use visibility_core::{
/// #     glam::{Affine3A, DVec3}, occlusion::Occlusion, Aabb, Accuracy, OccluderMesh,
/// #     OcclusionMap, View,
/// # };
/// # struct Blank;
/// # impl OcclusionMap for Blank {
/// #     fn name(&self) -> &str { "blank" }
/// #     fn accuracy(&self) -> Accuracy { Accuracy::Conservative }
/// #     fn begin(&mut self, _: &View, _: DVec3) {}
/// #     fn add(&mut self, _: &OccluderMesh, _: &Affine3A) {}
/// #     fn flush(&mut self) {}
/// #     fn test(&self, _: &Aabb) -> Occlusion { Occlusion::Partial }
/// # }
/// # let map = Blank;
/// use visibility_core::{FrustumCuller, OcclusionCuller, Pipeline};
/// let pipeline = Pipeline::new().with(FrustumCuller::new()).with(OcclusionCuller::new(map));
/// # let _ = pipeline;
/// ```
#[derive(Clone, Debug)]
pub struct OcclusionCuller<M, H = SceneHierarchy> {
    map: M,
    hierarchy: H,
    /// Price: the number of occluder triangles that may be drawn for each object that they are expected to
    /// hide. With 0 no occluder is drawn.
    price: u32,
    /// Greatest work of a frame, in triangles.
    work_limit: u32,
    /// Balance of earlier frames, which decides whether a frame draws occluders.
    experience: Experience,
    /// Memory of the search for occluders. Its content does not outlive a frame.
    queue: Queue,
    /// The scene of the last frame, in the state that the map's memory of earlier frames belongs to.
    scene: SceneCursor,
    /// Fingerprint of the incoming set of the last frame, for a map with delayed answers.
    candidates: Option<(Stamp, u64)>,
    /// False once the map or the hierarchy may have been changed since the last answer.
    answer_holds: bool,
}

impl<M: OcclusionMap> OcclusionCuller<M> {
    /// Creates a culler that walks the scene's own hierarchy.
    pub fn new(map: M) -> Self {
        Self::over(map, SceneHierarchy)
    }
}

impl<M: OcclusionMap, H: BoxHierarchy> OcclusionCuller<M, H> {
    /// Creates a culler that walks another hierarchy over the objects of the scene.
    pub fn over(map: M, hierarchy: H) -> Self {
        let (queue, scene, experience) = (Queue::new(), SceneCursor::START, Experience::default());
        Self {
            map,
            hierarchy,
            price: DEFAULT_PRICE,
            work_limit: DEFAULT_WORK_LIMIT,
            experience,
            queue,
            scene,
            candidates: None,
            answer_holds: false,
        }
    }

    /// Sets how many triangles of occluders, as [`OcclusionMap::cost`] counts them, may be drawn for each
    /// object that they are expected to hide. 24 by default. A lower price saves time where objects are cheap
    /// to draw, but fewer objects are hidden. With 0 the culler draws no occluder of the scene: for maps that
    /// the caller fills.
    #[must_use]
    pub fn with_price(self, triangles_per_object: u32) -> Self {
        Self { price: triangles_per_object, ..self }
    }

    /// Bounds the work of a frame, in triangles: with the z-buffer, ten of them take about a microsecond.
    /// 32,768 by default; `u32::MAX` for no bound. A frame spends at most half of this work on occluders.
    /// Once all of it is spent, the frame tests no more objects and leaves the rest visible. The bound may be
    /// exceeded by the node tested last and the batch of occluders drawn last. A map that [draws a level by
    /// itself](OcclusionMap::draws) may exceed it by the search for the parts of the level in view, and by
    /// the part drawn last. The bound does not cover the time to empty the map, which is longer for larger
    /// maps.
    #[must_use]
    pub fn with_work_limit(self, triangles: u32) -> Self {
        Self { work_limit: triangles, ..self }
    }

    /// Returns the occlusion map, with the occluders of the last frame still in it. The map is empty if the
    /// last frame skipped the search for hidden objects.
    pub fn map(&self) -> &M {
        &self.map
    }

    /// Returns the occlusion map, to change its settings between frames.
    pub fn map_mut(&mut self) -> &mut M {
        self.answer_holds = false;
        &mut self.map
    }

    /// Returns the hierarchy, to bring it up to date with the scene between frames.
    pub fn hierarchy_mut(&mut self) -> &mut H {
        self.answer_holds = false;
        &mut self.hierarchy
    }

    /// Culls, on the threads of a job system if `jobs` is given. With a `region`, `view` is its picture, and
    /// only what no view of the region sees is removed; `None` if the map has no answers for regions.
    fn cull_with(
        &mut self,
        jobs: Option<&dyn Jobs>,
        scene: &Scene,
        view: &View,
        region: Option<&ViewRegion>,
        visible: &mut VisibleSet,
    ) -> Option<CullStats> {
        if !self.scene.is_in(scene) {
            Culler::reset(self);
        } else if !self.scene.is_current(scene) {
            self.map.scene_changed();
        }
        self.scene = SceneCursor::at(scene);
        let (objects, origin) = (visible.count(scene), scene.origin());
        let mut budget = Budget::new(self.price, self.work_limit);
        // A map with delayed answers, as from a graphics card, must be tested in every frame.
        let at_once = self.map.answers_at_once();
        // What a region costs and hides says little of single views.
        let learns = self.price > 0 && at_once && region.is_none();
        if learns && self.experience.leaves_out(objects, view.clip_from(origin).row(3).truncate()) {
            self.map.begin_within(view, origin, 0.0, jobs);
            return Some(self.sweep(None, scene, visible, &mut budget, SweepKind::Count));
        }
        let most = budget.for_own_occluders(MIN_BEHIND.max(objects as f32));
        let own = match region {
            None => self.map.begin_within(view, origin, most, jobs),
            Some(region) => self.map.begin_region(region, origin, most, jobs)?,
        };
        budget.spend_outside_search(own);
        if !at_once {
            let candidates = Some(visible.fingerprint(scene));
            if core::mem::replace(&mut self.candidates, candidates) != candidates {
                self.map.candidates_changed();
            }
        }
        let mut stats = CullStats::default();
        // Occluders that the map drew by itself can already hide objects: test these before the search for
        // more.
        let is_tested = own > 0.0 && at_once && H::IS_OF_SCENE;
        if is_tested {
            self.map.flush();
            stats = self.sweep(jobs, scene, visible, &mut budget, SweepKind::First);
        }
        let mut walk = Walk::new(scene, &self.hierarchy, visible);
        let search = OccluderSearch::new(&mut self.map, &mut self.queue, view, origin, budget, is_tested);
        let is_all_tested;
        (budget, is_all_tested) = search.run(&mut walk);
        if is_tested && is_all_tested {
            let searched = walk.finish();
            stats += CullStats { visible: stats.visible, ..searched };
        } else {
            let kind = match (is_all_tested, budget.is_spent_in_vain() && at_once) {
                (true, _) => SweepKind::Count,
                (false, true) => SweepKind::Sampled,
                // A map with delayed answers must be tested with every leaf: it learns only of boxes that it
                // is asked about.
                (false, false) => SweepKind::All,
            };
            stats += walk.stats;
            stats += self.sweep(jobs, scene, visible, &mut budget, kind);
        }
        if learns {
            self.experience.record(&budget, objects.saturating_sub(stats.visible as usize));
        }
        Some(stats)
    }

    /// Drops the objects that the map hides, as far as the budget allows, on the threads of a job system if
    /// `jobs` is given. Returns the work counters.
    fn sweep(
        &mut self,
        jobs: Option<&dyn Jobs>,
        scene: &Scene,
        visible: &mut VisibleSet,
        budget: &mut Budget,
        kind: SweepKind,
    ) -> CullStats {
        if let Some(jobs) = jobs
            && H::IS_OF_SCENE
            // With sampling or a limit on work, each test depends on the tests before it, so the sweep runs
            // on one thread.
            && matches!(kind, SweepKind::First | SweepKind::All)
            && let objects = visible.count(scene)
            && budget.can_test(objects)
            && let Some(map) = self.map.shared()
        {
            let stats = retain_on(jobs, scene, visible, &HiddenTest { map }, UNDECIDED);
            budget.spend_tests(stats.tests as u32);
            if kind == SweepKind::First {
                budget.earn(objects.saturating_sub(stats.visible as usize) as f32);
            }
            return stats;
        }
        let mut walk = Walk::new(scene, &self.hierarchy, visible);
        let mut sweep = Sweep { map: &mut self.map, budget, kind, sampling: LeafSampling::default() };
        sweep.keep_unhidden(&mut walk, None);
        walk.finish()
    }
}

/// Which boxes a sweep tests. A sweep is a walk that drops hidden objects.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum SweepKind {
    /// All nodes and leaves, before the search for occluders. Objects found hidden add to the search's
    /// credit. Once the credit is spent in vain, only some of the leaves are tested.
    First,
    /// All nodes and leaves that are left after the search.
    All,
    /// All nodes, but only some of the leaves.
    Sampled,
    /// No box: the walk only counts the objects that are left.
    Count,
}

impl<M: OcclusionMap, H: BoxHierarchy> Culler for OcclusionCuller<M, H> {
    fn name(&self) -> &str {
        self.map.name()
    }

    fn accuracy(&self) -> Accuracy {
        self.map.accuracy()
    }

    fn hides_behind_objects(&self) -> bool {
        true
    }

    fn hides_behind_undrawn(&self) -> bool {
        self.map.has_level()
    }

    fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats {
        self.cull_with(None, scene, view, None, visible).unwrap_or_default()
    }

    fn cull_on(
        &mut self,
        jobs: &dyn Jobs,
        scene: &Scene,
        view: &View,
        visible: &mut VisibleSet,
    ) -> CullStats {
        self.cull_with(Some(jobs), scene, view, None, visible).unwrap_or_default()
    }

    fn cull_region(
        &mut self,
        jobs: Option<&dyn Jobs>,
        scene: &Scene,
        region: &ViewRegion,
        visible: &mut VisibleSet,
    ) -> Option<CullStats> {
        let stats = self.cull_with(jobs, scene, region.picture(), Some(region), visible)?;
        self.answer_holds = true;
        Some(stats)
    }

    /// Whether nobody has had the map or the hierarchy to change since the last answer for a region.
    fn answer_holds(&self) -> bool {
        self.answer_holds
    }

    fn for_each_lack(&self, scene: &Scene, each: &mut dyn FnMut(Lack)) {
        if self.price > 0 {
            self.map.for_each_lack(scene, each);
        }
    }

    fn draws_other_view(&mut self) {
        if !self.map.answers_at_once() {
            self.map.reset();
        }
    }

    fn reset(&mut self) {
        self.experience = Experience::default();
        self.map.reset();
    }
}

/// A walk that tests objects against the map, as far as the budget allows.
struct Sweep<'a, M> {
    map: &'a mut M,
    budget: &'a mut Budget,
    kind: SweepKind,
    /// Choice of the leaves that are tested, if only some are.
    sampling: LeafSampling,
}

impl<M: OcclusionMap> Sweep<'_, M> {
    /// Returns whether only some of the leaves are tested.
    fn samples(&self) -> bool {
        match self.kind {
            SweepKind::First => self.budget.is_spent_in_vain(),
            SweepKind::Sampled => true,
            SweepKind::All | SweepKind::Count => false,
        }
    }

    /// Drops the objects below a node (`None`: all objects) that the map hides. Objects of untested leaves
    /// stay. Returns whether any object is left below the node. Always true in another hierarchy than the
    /// scene's own.
    fn keep_unhidden<H: BoxHierarchy>(&mut self, walk: &mut Walk<H>, node: Option<usize>) -> bool {
        walk.visit(node, |walk, block, candidates| {
            let objects = block.objects(candidates);
            // After many leaves in a row without a hidden object, only some leaves are tested. Objects of the
            // others stay.
            let is_leaf = objects == candidates;
            let is_sampled = is_leaf && self.samples();
            if is_sampled && !self.sampling.tests_next() {
                return candidates;
            }
            // One call tests all boxes of the block. A counting sweep tests none.
            let answer = if self.kind != SweepKind::Count {
                walk.stats.tests += u64::from(candidates.count_ones());
                self.budget.spend_tests(candidates.count_ones());
                self.map.test_64_mut(block.boxes(), candidates)
            } else {
                Occlusion64::default()
            };
            if is_sampled {
                self.sampling.record(answer.hidden != 0);
            }
            // Objects found hidden before the search add their worth to the budget for occluders.
            if self.kind == SweepKind::First {
                let hidden = lanes(answer.hidden).map(|lane| objects_of(walk, block.child(lane)));
                self.budget.earn(hidden.sum());
            }
            // Descend into nodes that are not hidden. A node that is certainly visible as a whole, and any
            // node once the limit of work is reached, keeps its objects without tests.
            let mut mask = candidates & !answer.hidden;
            for lane in lanes(mask & !objects) {
                let Child::Node(child) = block.child(lane) else { continue };
                let any = if answer.visible >> lane & 1 != 0 || self.budget.is_at_limit() {
                    walk.accept(child)
                } else {
                    self.keep_unhidden(walk, Some(child))
                };
                mask &= !(u64::from(!any) << lane);
            }
            mask
        })
    }
}

/// Value of `known` in [`HiddenTest`] for a node that occluders may hide: its children must be tested.
const UNDECIDED: u32 = 1;

/// The test of the walk after the search, for several threads. The number that the walk passes down to a node
/// is [`UNDECIDED`], or 0 if no occluder hides any part of the node.
struct HiddenTest<'a> {
    map: &'a (dyn OcclusionMap + Sync),
}

impl NodeTest for HiddenTest<'_> {
    /// Mask of the boxes of which no occluder hides any part, bit i for lane i. Their descendants need no
    /// test.
    type Found = u64;

    fn test(&self, block: &Block<'_>, candidates: u64, _: u32, stats: &mut CullStats) -> (u64, u64) {
        stats.tests += u64::from(candidates.count_ones());
        let answer = self.map.test_64(block.boxes(), candidates);
        (candidates & !answer.hidden, answer.visible)
    }

    fn below(&self, visible: &u64, _: u32, lane: usize) -> u32 {
        if visible >> lane & 1 != 0 { 0 } else { UNDECIDED }
    }
}
