//! Choice of a culler for a scene by measurement: the advisor samples the visible objects of a few views,
//! then measures each candidate's time and reported objects.
//!
//! Culling takes time and saves drawing time. Both times are added, with the engine's drawing cost
//! ([`DrawCost`]). A candidate is rejected if it hides a visible object, or if its accuracy does not promise
//! that it never does.

use crate::compare::Comparison;
use crate::error::MeasureError;
use crate::item_buffer::{DrawnObject, ItemBuffer};
use alloc::vec::Vec;
use core::fmt;
use visibility_core::{Pipeline, Scene, View, VisibleSet};

/// Cost of drawing in microseconds. The default, 1 us per object and 0.001 us per triangle, suits an engine
/// that issues one draw call per object.
///
/// ```
/// use visibility_measure::DrawCost;
/// let cost = DrawCost::default();
/// assert_eq!(cost.of(10.0, 5000.0), 15.0);
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct DrawCost {
    /// Cost of one object (its draw call), in microseconds.
    pub object_us: f64,
    /// Cost of one triangle, in microseconds.
    pub triangle_us: f64,
}

impl Default for DrawCost {
    fn default() -> Self {
        Self { object_us: 1.0, triangle_us: 0.001 }
    }
}

impl DrawCost {
    /// Returns the time in microseconds to draw the given numbers of objects and triangles.
    pub fn of(&self, objects: f64, triangles: f64) -> f64 {
        self.object_us * objects + self.triangle_us * triangles
    }
}

/// Facts about a scene, found by drawing it in software from a few views. Visible counts are means over the
/// views.
///
/// ```
/// use visibility_measure::SceneFacts;
/// let facts = SceneFacts { objects: 100, depth_complexity: 4.0, ..SceneFacts::default() };
/// assert!(facts.to_string().starts_with("100 objects"));
/// ```
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct SceneFacts {
    /// Number of objects in the scene.
    pub objects: usize,
    /// Number of triangles of all objects of the scene.
    pub triangles: usize,
    /// Mean number of objects that a view shows in at least one pixel.
    pub visible_objects: f64,
    /// Mean number of triangles that a view shows in at least one pixel.
    pub visible_triangles: f64,
    /// Mean number of objects that a culler must report if it tests only their boxes, against the triangles
    /// of all occluders ([`Object::occluder`](visibility_core::Object::occluder)): see
    /// [`ItemBuffer::box_limit`]. At least the number of visible objects on the layers of the views.
    pub box_limit: f64,
    /// Mean number of triangles that cover a covered pixel, visible or hidden behind one another. 0 if no
    /// pixel is covered.
    pub depth_complexity: f64,
}

impl fmt::Display for SceneFacts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { objects, triangles, visible_objects, visible_triangles, box_limit, depth_complexity } =
            self;
        write!(
            f,
            "{objects} objects of {triangles} triangles; a view shows {visible_objects:.1} of them \
             by {visible_triangles:.0} triangles, the nearest of {depth_complexity:.1} layers; \
             {box_limit:.1} have a box with a free pixel"
        )
    }
}

/// Measurements of one candidate culler on the advisor's views.
///
/// ```
/// use visibility_measure::CullerTrial;
/// let trial = CullerTrial { cull_us: 5.0, objects: 10.0, triangles: 0.0, false_hidden: 0, total_us: 15.0 };
/// assert!(trial.is_sound());
/// ```
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct CullerTrial {
    /// Time to cull a view in microseconds: the mean over the views of the cheapest of five runs, by the time
    /// to cull the view and to draw the reported objects.
    pub cull_us: f64,
    /// Mean number of objects that the candidate culler reports as visible per view, in the same runs.
    pub objects: f64,
    /// Mean number of triangles, per view, of the objects that the candidate culler reports as visible, in
    /// the same runs.
    pub triangles: f64,
    /// Total over all views of the visible objects that the candidate culler did not report, in the worst run
    /// of each view. A lower bound on its errors, since visibility is sampled at pixel centres.
    pub false_hidden: u64,
    /// Mean time to cull a view and to draw the reported objects, in microseconds, by the advisor's
    /// [`DrawCost`].
    pub total_us: f64,
}

impl CullerTrial {
    /// Tests whether the candidate culler kept every object that shows in a pixel of the advisor's images.
    /// False if it hid one in any run of any view.
    pub fn is_sound(&self) -> bool {
        self.false_hidden == 0
    }
}

/// Number of times that each view is culled in a trial. The cheapest run counts, and the errors of all runs.
const RUNS: usize = 5;

/// Reference images of one scene from several views, with which candidate cullers are compared.
///
/// The advisor needs the triangles of the scene's objects ([`Scene::set_triangles`]); an object without
/// triangles counts as invisible. Meant for the time when a level is loaded or built: [`new`](Self::new)
/// draws each view twice in software.
///
/// ```
/// use visibility_core::{glam::{DVec3, Vec3}, Aabb, FrustumCuller, Pipeline, Pose, Scene, View};
/// use visibility_measure::{Advisor, DrawCost};
/// let mut scene = Scene::new();
/// for x in [3.0, -3.0] {
///     let triangle = [[Vec3::new(x, -1.0, -1.0), Vec3::new(x, 1.0, -1.0), Vec3::new(x, 0.0, 1.0)]];
///     let id = scene.insert(Aabb::from_points(triangle.iter().flatten().copied()));
///     scene.set_triangles(id, triangle)?;
/// }
/// let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
/// let views = [View::perspective(pose, 1.0, 1.5, 0.1, f64::INFINITY)?];
/// let advisor = Advisor::new(&scene, &views, DrawCost::default())?;
/// assert_eq!(advisor.facts().visible_objects, 1.0);
/// let clock = std::time::Instant::now();
/// let now = || clock.elapsed().as_secs_f64();
/// let mut nothing = Pipeline::new();
/// let mut frustum = Pipeline::new().with(FrustumCuller::new());
/// let all = advisor.trial(&mut nothing, f64::INFINITY, now).expect("worth any time");
/// let fewer = advisor.trial(&mut frustum, all.total_us, now).expect("better than nothing");
/// assert!(fewer.is_sound() && fewer.objects < all.objects);
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Advisor<'a> {
    /// Scene that the candidate cullers are tested on.
    scene: &'a Scene,
    /// Views for which the candidate cullers are tested.
    views: &'a [View],
    /// Drawing cost of the engine, in microseconds per object and per triangle.
    draw: DrawCost,
    /// Facts about the scene, found by drawing its views in software.
    facts: SceneFacts,
    /// Item buffer of each view, used to judge the objects that a candidate culler reports.
    references: Vec<ItemBuffer>,
}

/// Width and height in pixels of the image in which each view is drawn.
const IMAGE_SIZE: (u32, u32) = (320, 180);

impl<'a> Advisor<'a> {
    /// Draws each view twice in software, at 320 x 180 pixels: once all objects, and once only occluders. A
    /// few typical views suffice. `draw` is the cost of drawing in the engine.
    ///
    /// # Errors
    /// [`MeasureError::TooMany`] if the scene has too many triangles to number; [`MeasureError::Size`] if
    /// memory for the images cannot be allocated.
    pub fn new(scene: &'a Scene, views: &'a [View], draw: DrawCost) -> Result<Self, MeasureError> {
        Self::with_judge(scene, scene, views, draw)
    }

    /// Same as [`new`](Self::new), except that the images and the facts are those of `judge`, a copy of
    /// `scene` with the same objects. For a scene whose moving objects have triangles only in the copy, since
    /// cullers must not use them. The candidates cull `scene` itself: what was prepared for a scene is not
    /// valid for a clone. An object that only `judge` has counts as hidden.
    ///
    /// # Errors
    /// Those of [`new`](Self::new).
    pub fn with_judge(
        scene: &'a Scene,
        judge: &Scene,
        views: &'a [View],
        draw: DrawCost,
    ) -> Result<Self, MeasureError> {
        let triangles = |id| judge.triangles(id).unwrap_or_default();
        let mut facts = SceneFacts {
            objects: judge.len(),
            triangles: judge.ids().map(|id| triangles(id).len()).sum(),
            ..SceneFacts::default()
        };
        let mut references = Vec::with_capacity(views.len());
        let mut surfaces = ItemBuffer::new(IMAGE_SIZE.0, IMAGE_SIZE.1)?;
        let mut is_seen = alloc::vec![false; judge.index_limit()];
        for view in views {
            let mut buffer = ItemBuffer::new(IMAGE_SIZE.0, IMAGE_SIZE.1)?;
            let seen = buffer.draw(
                view,
                judge.origin(),
                judge.ids().filter_map(|id| DrawnObject::of_scene(judge, id, view)),
            )?;
            let share = 1.0 / views.len() as f64;
            facts.visible_objects += share * f64::from(seen.visible_objects());
            facts.visible_triangles += share * f64::from(seen.visible_triangles());
            facts.depth_complexity += share * seen.depth_complexity();
            seen.objects().iter().for_each(|object| is_seen[object.key as usize] = object.is_visible());
            let occluders = judge.ids().filter(|&id| judge.object(id).is_ok_and(|object| object.occluder));
            let occluders = occluders.filter_map(|id| DrawnObject::of_scene(judge, id, view));
            surfaces.draw(view, judge.origin(), occluders)?;
            let limit = surfaces.box_limit(judge, |id| is_seen[id.index()]);
            facts.box_limit += share * limit.count() as f64;
            references.push(buffer);
        }
        Ok(Self { scene, views, draw, facts, references })
    }

    /// Returns facts about the scene, measured by drawing its views. All counts of visible objects and
    /// triangles are 0 without views.
    pub fn facts(&self) -> &SceneFacts {
        &self.facts
    }

    /// Returns the *ideal*, a lower bound on a candidate's total time per view in microseconds: the time to
    /// draw the visible objects' visible triangles, with no culling time. A candidate's
    /// [`total_us`](CullerTrial::total_us) divided by the ideal is its *cost over the ideal*.
    pub fn min_us(&self) -> f64 {
        self.draw.of(self.facts.visible_objects, self.facts.visible_triangles)
    }

    /// Measures a candidate culler on all views. `clock` returns a time in seconds. Returns `None` as soon as
    /// the mean culling time per view, of the cheapest runs so far, exceeds `limit` microseconds. `limit` is
    /// usually the best total so far, so that trials of slow candidates end early; with an infinite `limit`
    /// the trial is always completed. The candidate is reset first.
    pub fn trial(
        &self,
        pipeline: &mut Pipeline,
        limit: f64,
        mut clock: impl FnMut() -> f64,
    ) -> Option<CullerTrial> {
        let mut visible = VisibleSet::new();
        let mut comparison = Comparison::default();
        let mut reported = alloc::vec![false; self.scene.index_limit()];
        let share = 1.0 / self.views.len().max(1) as f64;
        // Of each view the cheapest run so far, and the most objects that a run hid.
        let mut cheapest = alloc::vec![CullerTrial::default(); self.views.len()];
        pipeline.reset();
        // Culls all views in turn, several times. Culling one view repeatedly would favour cullers that
        // exploit coherence with the previous frame.
        for run in 0..RUNS {
            let mut sum = 0.0;
            for ((view, reference), cheapest) in self.views.iter().zip(&self.references).zip(&mut cheapest) {
                let start = clock();
                pipeline.cull(self.scene, view, &mut visible);
                let cull_us = (clock() - start) * 1e6;
                reported.fill(false);
                visible.iter(self.scene).for_each(|id| reported[id.index()] = true);
                // An object that only the judge has is not reported.
                let is_reported = |_, key| reported.get(key as usize).copied().unwrap_or(false);
                reference.visible().compare(is_reported, &mut comparison);
                let [objects, triangles] =
                    [comparison.reported_objects, comparison.reported_triangles].map(f64::from);
                let total_us = cull_us + self.draw.of(objects, triangles);
                cheapest.false_hidden = cheapest.false_hidden.max(comparison.false_hidden_objects.into());
                if run == 0 || total_us < cheapest.total_us {
                    *cheapest = CullerTrial { cull_us, objects, triangles, total_us, ..*cheapest };
                }
                sum += share * cheapest.cull_us;
                // The first run grows buffers. From the second run on, the mean of the cheapest runs is
                // compared with the limit.
                if run > 0 && sum > limit {
                    return None;
                }
            }
        }
        let mut trial = CullerTrial::default();
        for view in &cheapest {
            trial.cull_us += share * view.cull_us;
            trial.objects += share * view.objects;
            trial.triangles += share * view.triangles;
            trial.false_hidden += view.false_hidden;
        }
        trial.total_us = trial.cull_us + self.draw.of(trial.objects, trial.triangles);
        Some(trial)
    }

    /// Measures all candidate cullers and returns the index and trial of the candidate with the least total
    /// time. Only candidates that promise to hide no visible object, and hid none in the trial, qualify. Of
    /// equal total times the first counts. `None` if no candidate qualifies. `clock` returns a time in
    /// seconds. List promising candidates first: the trials of worse ones then end early.
    pub fn best<'p>(
        &self,
        candidates: impl IntoIterator<Item = &'p mut Pipeline>,
        mut clock: impl FnMut() -> f64,
    ) -> Option<(usize, CullerTrial)> {
        let mut best: Option<(usize, CullerTrial)> = None;
        for (index, pipeline) in candidates.into_iter().enumerate() {
            let limit = best.map_or(f64::INFINITY, |(_, trial)| trial.total_us);
            if !pipeline.accuracy().never_hides() {
                continue;
            }
            let Some(trial) = self.trial(pipeline, limit, &mut clock) else { continue };
            if trial.is_sound() && trial.total_us < limit {
                best = Some((index, trial));
            }
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::glam::{DVec3, Vec3};
    use visibility_core::{Aabb, Accuracy, CullStats, Culler, FrustumCuller, ObjectId, Pose};

    /// Culler that keeps the objects for which its function returns true, and claims the given accuracy.
    struct Keep(fn(ObjectId) -> bool, Accuracy);

    impl Culler for Keep {
        fn name(&self) -> &str {
            "keep"
        }
        fn accuracy(&self) -> Accuracy {
            self.1
        }
        fn cull(&mut self, scene: &Scene, _: &View, visible: &mut VisibleSet) -> CullStats {
            visible.retain(scene, |id, _| self.0(id))
        }
    }

    /// Returns a scene of three triangles: one in front of the eye, one hidden behind it, and one behind the
    /// eye.
    fn scene() -> Scene {
        let mut scene = Scene::new();
        for (x, size) in [(3.0, 2.0), (6.0, 1.0), (-3.0, 1.0)] {
            let [a, b, c] = [(-size, -size), (size, -size), (0.0, size)].map(|(y, z)| Vec3::new(x, y, z));
            let id = scene.insert(Aabb::from_points([a, b, c]));
            scene.set_triangles(id, [[a, b, c]]).unwrap();
        }
        scene
    }

    /// Returns two views along the x axis that both see the first triangle only.
    fn views() -> [View; 2] {
        [DVec3::ZERO, DVec3::X].map(|eye| {
            let pose = Pose::look_at(eye, eye + DVec3::X, DVec3::Z);
            View::perspective(pose, 1.0, 1.5, 0.1, f64::INFINITY).unwrap()
        })
    }

    #[test]
    fn the_best_is_the_cheapest_that_hides_nothing_visible() {
        let (scene, views) = (scene(), views());
        let advisor = Advisor::new(&scene, &views, DrawCost::default()).unwrap();
        assert_eq!(
            (advisor.facts().objects, advisor.facts().visible_objects),
            (3, 1.0),
            "objects of the scene, and those visible"
        );
        assert!(
            advisor.facts().depth_complexity > 1.0 && advisor.facts().depth_complexity < 2.0,
            "depth complexity {} of one wall and what is behind",
            advisor.facts().depth_complexity
        );
        let one = |id: ObjectId| id.index() == 0;
        let mut candidates = [
            Pipeline::new(),
            Pipeline::new().with(FrustumCuller::new()),
            // Both pipelines keep only the visible object. The first promises no accuracy, the second breaks
            // its promise.
            Pipeline::new().with(Keep(one, Accuracy::Approximate)),
            Pipeline::new().with(Keep(|_| false, Accuracy::Conservative)),
            Pipeline::new().with(Keep(one, Accuracy::Conservative)),
        ];
        let (best, trial) = advisor.best(&mut candidates, || 0.0).unwrap();
        assert_eq!(
            (best, trial.objects, trial.false_hidden),
            (4, 1.0, 0),
            "the best that hides nothing visible"
        );
        assert!(
            trial.total_us <= advisor.min_us() + 1e-9,
            "{} us, at least {} us",
            trial.total_us,
            advisor.min_us()
        );
        assert_eq!(
            advisor.best(&mut candidates[..2], || 0.0).unwrap().0,
            1,
            "the frustum is the best of two"
        );
        assert!(advisor.best(&mut candidates[2..4], || 0.0).is_none(), "none of the two is right");
    }

    #[test]
    fn a_judge_has_the_triangles_and_the_scene_itself_is_culled() {
        let (judge, views) = (scene(), views());
        let mut bare = judge.clone();
        bare.ids().collect::<Vec<_>>().into_iter().for_each(|id| bare.set_triangles(id, []).unwrap());
        let advisor = Advisor::with_judge(&bare, &judge, &views, DrawCost::default()).unwrap();
        assert_eq!(advisor.facts().visible_objects, 1.0, "objects visible by the triangles of the judge");
        /// Culler that hides all objects of a scene that has no triangles, and none of another.
        struct HideBare;
        impl Culler for HideBare {
            fn name(&self) -> &str {
                "hide bare"
            }
            fn accuracy(&self) -> Accuracy {
                Accuracy::Approximate
            }
            fn cull(&mut self, scene: &Scene, _: &View, visible: &mut VisibleSet) -> CullStats {
                visible.retain(scene, |id, _| !scene.triangles(id).unwrap().is_empty())
            }
        }
        let trial = advisor.trial(&mut Pipeline::new().with(HideBare), f64::INFINITY, || 0.0).unwrap();
        assert_eq!((trial.objects, trial.false_hidden), (0.0, 2), "objects of the bare scene, all hidden");
    }

    #[test]
    fn an_object_that_only_the_judge_has_counts_as_hidden() {
        let (scene, mut judge, views) = (scene(), scene(), views());
        let [a, b, c] = [[2.0, -1.0, 0.0], [2.0, 1.0, 0.0], [2.0, 0.0, 1.0]].map(Vec3::from_array);
        let id = judge.insert(Aabb::from_points([a, b, c]));
        judge.set_triangles(id, [[a, b, c]]).unwrap();
        let advisor = Advisor::with_judge(&scene, &judge, &views, DrawCost::default()).unwrap();
        let trial = advisor.trial(&mut Pipeline::new(), f64::INFINITY, || 0.0).unwrap();
        assert_eq!((trial.objects, trial.false_hidden), (3.0, 2), "objects of the scene, and hidden ones");
    }

    #[test]
    fn only_occluders_hide_boxes_and_what_is_seen_has_no_need_of_one() {
        let (mut scene, views) = (scene(), views());
        let limit = |scene: &Scene| {
            Advisor::new(scene, &views, DrawCost::default()).map(|advisor| advisor.facts().box_limit)
        };
        // The two triangles in front of the eye have boxes that no occluder can hide.
        assert_eq!(limit(&scene), Ok(2.0), "boxes before which no occluder is");
        let ids: Vec<ObjectId> = scene.ids().collect();
        scene.set_occluder(ids[1], true).unwrap();
        assert_eq!(limit(&scene), Ok(2.0), "the second triangle occludes nothing");
        scene.set_occluder(ids[0], true).unwrap();
        assert_eq!(limit(&scene), Ok(1.0), "the first triangle occludes the others");
        // The first triangle is visible, although its box is now elsewhere.
        scene.set_bounds(ids[0], Aabb::from_arrays([-9.0; 3], [-8.0; 3])).unwrap();
        assert_eq!(limit(&scene), Ok(1.0), "the first triangle is seen, wherever its box is");
    }

    #[test]
    fn the_back_of_a_one_sided_occluder_hides_no_box() {
        let (mut scene, views) = (scene(), views());
        let ids: Vec<ObjectId> = scene.ids().collect();
        scene.set_occluder(ids[0], true).unwrap();
        scene.insert(Aabb::from_arrays([6.0, -0.5, -0.5], [7.0, 0.0, 0.0]));
        let limit =
            |scene: &Scene| Advisor::new(scene, &views, DrawCost::default()).unwrap().facts().box_limit;
        assert_eq!(limit(&scene), 1.0, "the first triangle hides two boxes");
        // With its back to the eye, the one-sided first triangle is invisible: the second is visible, and no
        // box is hidden.
        scene.set_one_sided(ids[0], true).unwrap();
        assert_eq!(limit(&scene), 3.0, "the first triangle's back hides none");
    }

    /// Culler that keeps nothing in one frame, counted from 1, and everything in all others.
    struct HideIn {
        frame: usize,
        now: usize,
    }

    impl Culler for HideIn {
        fn name(&self) -> &str {
            "hide in"
        }
        fn accuracy(&self) -> Accuracy {
            Accuracy::Conservative
        }
        fn cull(&mut self, scene: &Scene, _: &View, visible: &mut VisibleSet) -> CullStats {
            self.now += 1;
            visible.retain(scene, |_, _| self.now != self.frame)
        }
    }

    #[test]
    fn what_hides_a_visible_object_in_any_run_is_no_candidate() {
        let (scene, views) = (scene(), views());
        let advisor = Advisor::new(&scene, &views, DrawCost::default()).unwrap();
        for frame in 1..=RUNS * views.len() {
            let mut pipeline = Pipeline::new().with(HideIn { frame, now: 0 });
            let trial = advisor.trial(&mut pipeline, f64::INFINITY, || 0.0).unwrap();
            assert_eq!(trial.false_hidden, 1, "hides all in frame {frame}");
            let mut pipeline = Pipeline::new().with(HideIn { frame, now: 0 });
            assert!(advisor.best([&mut pipeline], || 0.0).is_none(), "hides all in frame {frame}");
        }
    }

    #[test]
    fn a_cost_without_an_end_is_no_free_candidate() {
        let (scene, views) = (scene(), views());
        let draw = DrawCost { object_us: f64::MAX, ..DrawCost::default() };
        let advisor = Advisor::new(&scene, &views, draw).unwrap();
        let trial = advisor.trial(&mut Pipeline::new(), f64::INFINITY, || 0.0).unwrap();
        assert_eq!((trial.objects, trial.total_us), (3.0, f64::INFINITY), "three objects that cost too much");
        assert!(advisor.best([&mut Pipeline::new()], || 0.0).is_none(), "nothing is worth that");
    }

    #[test]
    fn times_and_objects_are_of_the_same_runs() {
        let (scene, views) = (scene(), views());
        let advisor = Advisor::new(&scene, &views[..1], DrawCost::default()).unwrap();
        // The frame that reports nothing takes a second, all others take none.
        let mut times = [0.0].into_iter().chain(core::iter::repeat(1.0));
        let mut pipeline = Pipeline::new().with(HideIn { frame: 1, now: 0 });
        let trial = advisor.trial(&mut pipeline, f64::INFINITY, || times.next().unwrap()).unwrap();
        assert_eq!((trial.cull_us, trial.objects), (0.0, 3.0), "time and objects of a quick run");
    }

    #[test]
    fn what_takes_longer_than_it_is_worth_is_given_up() {
        let (scene, views) = (scene(), views());
        let advisor = Advisor::new(&scene, &views, DrawCost::default()).unwrap();
        let time = core::cell::Cell::new(0.0);
        let slow = || {
            time.set(time.get() + 1.0);
            time.get()
        };
        assert!(advisor.trial(&mut Pipeline::new(), 100.0, slow).is_none(), "a trial of more than 100 us");
        assert_eq!(time.get(), 6.0, "given up after the first view of the second run");
        assert!(advisor.trial(&mut Pipeline::new(), 1e9, slow).is_some(), "a trial within its time");
    }

    #[test]
    fn scenes_of_nothing_and_no_views_have_answers() {
        let empty = Scene::new();
        let advisor = Advisor::new(&empty, &[], DrawCost::default()).unwrap();
        assert_eq!(advisor.facts(), &SceneFacts::default(), "facts of an empty scene");
        let (index, trial) = advisor.best(&mut [Pipeline::new()], || 0.0).unwrap();
        assert_eq!((index, trial.total_us), (0, 0.0), "the only candidate takes no time");
    }
}
