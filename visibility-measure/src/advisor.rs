//! Which culler for this scene? Answered by measuring: what a few views of it really show, and what each
//! candidate costs and leaves.
//!
//! The time to cull buys time that need not be spent on drawing, so both are added up, by what drawing costs
//! in the engine at hand ([`DrawCost`]). A candidate that hides something visible, or that does not promise
//! not to, is out.

use crate::compare::Comparison;
use crate::error::MeasureError;
use crate::item_buffer::ItemBuffer;
use alloc::vec::Vec;
use core::fmt;
use visibility_core::{Pipeline, Scene, View, VisibleSet};

/// What drawing takes, in microseconds. The default, one for an object and a thousandth for a triangle, suits
/// an engine that issues a draw call an object.
///
/// ```
/// use visibility_measure::DrawCost;
/// let cost = DrawCost::default();
/// assert_eq!(cost.of(10.0, 5000.0), 15.0);
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct DrawCost {
    /// For each object.
    pub object_us: f64,
    /// For each triangle.
    pub triangle_us: f64,
}

impl Default for DrawCost {
    fn default() -> Self {
        Self { object_us: 1.0, triangle_us: 0.001 }
    }
}

impl DrawCost {
    /// Microseconds to draw so many.
    pub fn of(&self, objects: f64, triangles: f64) -> f64 {
        self.object_us * objects + self.triangle_us * triangles
    }
}

/// What the probes found of a scene. Counts are means over the views.
///
/// ```
/// use visibility_measure::SceneFacts;
/// let facts = SceneFacts { objects: 100, depth_complexity: 4.0, ..SceneFacts::default() };
/// assert!(facts.to_string().starts_with("100 objects"));
/// ```
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct SceneFacts {
    /// Objects in the scene.
    pub objects: usize,
    /// Triangles of all objects of the scene.
    pub triangles: usize,
    /// Objects of which a pixel shows.
    pub visible_objects: f64,
    /// Triangles of which a pixel shows.
    pub visible_triangles: f64,
    /// How many triangles lie behind each other in a pixel that shows anything.
    pub depth_complexity: f64,
}

impl fmt::Display for SceneFacts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { objects, triangles, visible_objects, visible_triangles, depth_complexity } = self;
        write!(
            f,
            "{objects} objects of {triangles} triangles; a view shows {visible_objects:.1} of them \
             by {visible_triangles:.0} triangles, the nearest of {depth_complexity:.1} layers"
        )
    }
}

/// What one candidate did on the views.
///
/// ```
/// use visibility_measure::CullerTrial;
/// let trial = CullerTrial { cull_us: 5.0, objects: 10.0, triangles: 0.0, false_hidden: 0, total_us: 15.0 };
/// assert!(trial.is_sound());
/// ```
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct CullerTrial {
    /// Time to cull a view, the mean over the views of the least of a few runs.
    pub cull_us: f64,
    /// Objects reported, on average.
    pub objects: f64,
    /// Triangles of these.
    pub triangles: f64,
    /// Objects hidden of which a pixel shows, of all views together.
    pub false_hidden: u64,
    /// Time to cull a view and to draw what was reported.
    pub total_us: f64,
}

impl CullerTrial {
    /// Whether nothing visible was hidden.
    pub fn is_sound(&self) -> bool {
        self.false_hidden == 0
    }
}

/// How often the views are culled against the clock.
const RUNS: usize = 5;

/// Probes of one scene, to hold candidates against.
///
/// The probes need the triangles of the scene's objects ([`Scene::set_triangles`]); one without any counts as
/// invisible. Meant for the time when a level is loaded or built: it draws each view once in software.
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
    scene: &'a Scene,
    views: &'a [View],
    draw: DrawCost,
    facts: SceneFacts,
    probes: Vec<ItemBuffer>,
}

/// Columns and rows of a probe.
const PROBE: (u32, u32) = (320, 180);

impl<'a> Advisor<'a> {
    /// Draws each of the views in software: a few that are typical suffice.
    ///
    /// # Errors
    /// [`MeasureError`], if the scene has too many triangles to number.
    pub fn new(scene: &'a Scene, views: &'a [View], draw: DrawCost) -> Result<Self, MeasureError> {
        let triangles = |id| scene.triangles(id).unwrap_or(&[]);
        let mut facts = SceneFacts {
            objects: scene.len(),
            triangles: scene.ids().map(|id| triangles(id).len()).sum(),
            ..SceneFacts::default()
        };
        let mut probes = Vec::with_capacity(views.len());
        for view in views {
            let mut buffer = ItemBuffer::new(PROBE.0, PROBE.1)?;
            let seen = buffer.draw(
                view,
                scene.origin(),
                scene.ids().map(|id| (id.index() as u32, triangles(id))),
            )?;
            let share = 1.0 / views.len() as f64;
            facts.visible_objects += share * f64::from(seen.visible_objects());
            facts.visible_triangles += share * f64::from(seen.visible_triangles());
            facts.depth_complexity += share * seen.depth_complexity();
            probes.push(buffer);
        }
        Ok(Self { scene, views, draw, facts, probes })
    }

    /// What the probes found.
    pub fn facts(&self) -> &SceneFacts {
        &self.facts
    }

    /// Time that a culler without error and without cost would leave: what shows must be drawn.
    pub fn least_us(&self) -> f64 {
        self.draw.of(self.facts.visible_objects, self.facts.visible_triangles)
    }

    /// Runs a candidate on the views, by a clock that tells seconds. Gives up, with `None`, once it is
    /// certain that a view takes longer than `limit` microseconds, on average: the best total so far, so that
    /// slow candidates do not hold up the rest.
    pub fn trial(
        &self,
        pipeline: &mut Pipeline,
        limit: f64,
        mut clock: impl FnMut() -> f64,
    ) -> Option<CullerTrial> {
        let mut visible = VisibleSet::new();
        let mut comparison = Comparison::default();
        let mut reported = alloc::vec![false; self.scene.index_limit()];
        let mut trial = CullerTrial::default();
        let share = 1.0 / self.views.len().max(1) as f64;
        let mut least = alloc::vec![f64::INFINITY; self.views.len()];
        pipeline.reset();
        // All views in turn, several times: the same view again and again would flatter cullers that remember
        // the frame before.
        for run in 0..RUNS {
            let mut sum = 0.0;
            for ((view, probe), least) in self.views.iter().zip(&self.probes).zip(&mut least) {
                let start = clock();
                pipeline.cull(self.scene, view, &mut visible);
                *least = least.min((clock() - start) * 1e6);
                sum += share * *least;
                // The first run grows buffers; from the second on, time that is far too much stays so.
                if run > 0 && sum > limit {
                    return None;
                }
                if run > 0 {
                    continue;
                }
                reported.fill(false);
                visible.iter(self.scene).for_each(|id| reported[id.index()] = true);
                probe.visible().compare(|_, key| reported[key as usize], &mut comparison);
                trial.objects += share * f64::from(comparison.reported_objects);
                trial.triangles += share * f64::from(comparison.reported_triangles);
                trial.false_hidden += u64::from(comparison.false_hidden_objects);
            }
            trial.cull_us = sum;
        }
        trial.total_us = trial.cull_us + self.draw.of(trial.objects, trial.triangles);
        Some(trial)
    }

    /// Runs all candidates and returns the index of the best that promises to hide nothing visible and kept
    /// it here, with its trial; `None` if there is no such candidate. Candidates that are likely to be good
    /// go first, since the rest is then given up sooner.
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

    /// Keeps what a function keeps, and takes a while by a clock of its own.
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

    /// A tile before the eye, one hidden behind it, and one behind the eye.
    fn scene() -> Scene {
        let mut scene = Scene::new();
        for (x, size) in [(3.0, 2.0), (6.0, 1.0), (-3.0, 1.0)] {
            let [a, b, c] = [(-size, -size), (size, -size), (0.0, size)].map(|(y, z)| Vec3::new(x, y, z));
            let id = scene.insert(Aabb::from_points([a, b, c]));
            scene.set_triangles(id, [[a, b, c]]).unwrap();
        }
        scene
    }

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
        assert_eq!((advisor.facts().objects, advisor.facts().visible_objects), (3, 1.0));
        assert!(advisor.facts().depth_complexity > 1.0 && advisor.facts().depth_complexity < 2.0);
        let one = |id: ObjectId| id.index() == 0;
        let mut candidates = [
            Pipeline::new(),
            Pipeline::new().with(FrustumCuller::new()),
            // What shows, and no more: but one promises nothing, one breaks its promise.
            Pipeline::new().with(Keep(one, Accuracy::Approximate)),
            Pipeline::new().with(Keep(|_| false, Accuracy::Conservative)),
            Pipeline::new().with(Keep(one, Accuracy::Conservative)),
        ];
        let (best, trial) = advisor.best(&mut candidates, || 0.0).unwrap();
        assert_eq!((best, trial.objects, trial.false_hidden), (4, 1.0, 0));
        assert!(trial.total_us <= advisor.least_us() + 1e-9);
        assert_eq!(advisor.best(&mut candidates[..2], || 0.0).unwrap().0, 1);
        assert!(advisor.best(&mut candidates[2..4], || 0.0).is_none());
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
        assert!(advisor.trial(&mut Pipeline::new(), 100.0, slow).is_none());
        assert_eq!(time.get(), 6.0, "given up after the first view of the second run");
        assert!(advisor.trial(&mut Pipeline::new(), 1e9, slow).is_some());
    }

    #[test]
    fn scenes_of_nothing_and_no_views_have_answers() {
        let empty = Scene::new();
        let advisor = Advisor::new(&empty, &[], DrawCost::default()).unwrap();
        assert_eq!(advisor.facts(), &SceneFacts::default());
        let (index, trial) = advisor.best(&mut [Pipeline::new()], || 0.0).unwrap();
        assert_eq!((index, trial.total_us), (0, 0.0));
    }
}
