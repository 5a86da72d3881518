//! The bake of sandwiches: for each viewcell methods from cheap to exact, each for what the one before left
//! open.

use crate::cell_sandwich::CellSandwich;
use crate::fingerprint::scene_fingerprint;
use crate::method_times::MethodTimes;
use crate::settings::Settings;
use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;
use visibility_core::bake::Baker;
use visibility_core::binary_format::{Fingerprint, FormatError, Reader, Writer};
use visibility_core::glam::DVec3;
use visibility_core::pvs::{Viewcell, Viewcells};
use visibility_core::{ObjectId, RegionCuller, Scene, VisibleSet};
use visibility_exact::{Effort, ExactCuller, SceneTriangles, Settings as ExactSettings, Verdict};
use visibility_region::ExtendedProjectionCuller;

/// Finds the sandwiches of a range of viewcells, as a [`Baker`] for a [`Bake`](visibility_core::bake::Bake):
/// with progress, stopping and resuming, on any number of threads with the same result.
///
/// For each viewcell the sweep of extended projections removes what is hidden behind many occluders together;
/// rays find what is seen; then proofs are tried, for the most costly of the open objects first, until the
/// [gap](Settings::gap) is met. Occluders are the objects of the scene that are flagged so; the sweep uses
/// their meshes, the proofs their triangles.
///
/// ```
/// use visibility_bake::{SandwichBaker, Settings};
/// use visibility_core::{bake::Bake, glam::{DVec3, Vec3}, pvs::{Viewcell, Viewcells}, Aabb, Object, Scene};
/// // A wall, and a plate behind it.
/// let square = |x: f32, r: f32| {
///     let [a, b, c, d] = [(-r, -r), (r, -r), (r, r), (-r, r)].map(|(y, z)| Vec3::new(x, y, z));
///     [[a, b, c], [a, c, d]]
/// };
/// let mut scene = Scene::new();
/// for triangles in [square(5.0, 10.0), square(9.0, 1.0)] {
///     let bounds = Aabb::from_points(triangles.as_flattened().iter().copied());
///     let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
///     scene.set_triangles(id, triangles)?;
/// }
/// let cells = Viewcells::new([Viewcell::from_box(DVec3::ZERO, DVec3::ONE)]);
/// let outcome = Bake::new(SandwichBaker::new(&scene, &cells, Settings::default())).run();
/// assert_eq!(outcome.cells[0].seen, [0]);
/// assert!(outcome.cells[0].open.is_empty() && outcome.complete);
/// # Ok::<(), visibility_core::scene::SceneError>(())
/// ```
pub struct SandwichBaker<'a> {
    scene: &'a Scene,
    viewcells: &'a Viewcells,
    settings: Settings,
    range: Range<usize>,
    /// Hash of the scene, all viewcells and the settings: the same for all shards of a bake.
    fingerprint: u64,
    methods: Methods,
    /// Returns the time passed since any fixed moment.
    clock: fn() -> Duration,
    done: Vec<Option<(CellSandwich, MethodTimes)>>,
}

/// The result of a bake.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct SandwichOutcome {
    /// Number of the first viewcell.
    pub first: usize,
    /// By viewcell. In a viewcell that was not worked on, all objects are open.
    pub cells: Vec<CellSandwich>,
    /// By viewcell, the time that each method took: 0 without a [clock](SandwichBaker::with_clock), and in a
    /// viewcell that was not worked on. All else of the outcome is the same whatever the times.
    pub times: Vec<MethodTimes>,
    /// Whether all viewcells were worked on.
    pub complete: bool,
}

/// Memory of one thread of a bake.
#[derive(Default)]
pub struct BakeScratch(Option<Methods>);

struct Methods {
    triangles: Arc<SceneTriangles>,
    sweep: ExtendedProjectionCuller,
    rays: ExactCuller,
    proofs: ExactCuller,
}

impl Methods {
    fn new(triangles: Arc<SceneTriangles>, sweep: ExtendedProjectionCuller, settings: &Settings) -> Self {
        let rays = ExactSettings::new(Effort::Rays(settings.rays));
        // What rays can find, the method before has found.
        let proofs =
            ExactSettings { rays: 0, aimed_rays: 0, ..ExactSettings::new(Effort::Exact(settings.clearance)) };
        Self {
            sweep,
            rays: ExactCuller::new(triangles.clone(), rays),
            proofs: ExactCuller::new(triangles.clone(), proofs),
            triangles,
        }
    }
}

impl<'a> SandwichBaker<'a> {
    /// Prepares a bake of all objects of a scene from all viewcells.
    pub fn new(scene: &'a Scene, viewcells: &'a Viewcells, settings: Settings) -> Self {
        let mut sweep = ExtendedProjectionCuller::new();
        // From an empty viewcell nothing is visible: the culler only prepares what all threads share.
        let nowhere = Viewcell::from_box(DVec3::ONE, DVec3::ZERO);
        sweep.cull(scene, &nowhere, &mut VisibleSet::new());
        let count = viewcells.cells().len();
        Self {
            scene,
            viewcells,
            settings,
            range: 0..count,
            fingerprint: bake_fingerprint(scene, viewcells, &settings),
            methods: Methods::new(Arc::new(SceneTriangles::new(scene)), sweep, &settings),
            clock: || Duration::ZERO,
            done: vec![None; count],
        }
    }

    /// Returns the baker for a part of the viewcells: those with numbers in `range`, as far as there are any.
    #[must_use]
    pub fn with_range(mut self, range: Range<usize>) -> Self {
        let count = self.viewcells.cells().len();
        let start = range.start.min(count);
        self.range = start..range.end.clamp(start, count);
        self.done = vec![None; self.range.len()];
        self
    }

    /// Returns the baker with a clock, which measures the times of the methods: a function that returns the
    /// time passed since any fixed moment.
    #[must_use]
    pub fn with_clock(mut self, clock: fn() -> Duration) -> Self {
        self.clock = clock;
        self
    }

    /// Returns the sandwiches found so far, in the order of the viewcells.
    pub fn cells(&self) -> impl Iterator<Item = Option<&CellSandwich>> {
        self.done.iter().map(|done| done.as_ref().map(|(cell, _)| cell))
    }

    /// Returns the [`bake_fingerprint`] of all viewcells, whatever the range of this baker.
    pub fn whole_fingerprint(&self) -> u64 {
        self.fingerprint
    }

    /// Returns the cost of drawing some objects.
    fn cost(&self, objects: impl IntoIterator<Item = ObjectId>) -> f64 {
        let cost = |id| self.scene.object(id).map_or(0, |object| object.cost);
        // An object without cost counts a little, so that it is not left open for nothing.
        objects.into_iter().map(|id| f64::from(cost(id)).max(1e-3)).sum()
    }

    fn bake(&self, cell: &Viewcell, methods: &mut Methods) -> (CellSandwich, MethodTimes) {
        let scene = self.scene;
        let mut last = (self.clock)();
        let mut lap = || {
            let now = (self.clock)();
            now.saturating_sub(std::mem::replace(&mut last, now))
        };
        let mut visible = VisibleSet::new();
        methods.sweep.cull(scene, cell, &mut visible);
        let mut open: Vec<ObjectId> = visible.iter(scene).collect();
        let swept = scene.len() - open.len();
        let sweep = lap();

        let (mut seen, mut proven, mut steps) = (Vec::new(), 0, 0);
        let asked = std::mem::take(&mut open);
        for (id, answer) in decide(scene, cell, &mut methods.rays, &methods.triangles, &asked, &mut steps) {
            let list = if answer == Answer::Seen { &mut seen } else { &mut open };
            list.push(id);
        }
        let rays = lap();

        let (mut seen_cost, mut left_cost) = (self.cost(seen.iter().copied()), 0.0);
        // Objects that proofs were tried for in vain.
        let mut left: Vec<ObjectId> = Vec::new();
        let gap = if self.settings.gap > 0.0 { self.settings.gap } else { 0.0 };
        open.sort_by(|&a, &b| self.cost([b]).total_cmp(&self.cost([a])).then(a.index().cmp(&b.index())));
        while !open.is_empty() {
            let open_cost = self.cost(open.iter().copied());
            let allowed = gap * (seen_cost + left_cost + open_cost);
            if left_cost + open_cost <= allowed {
                break;
            }
            // The most costly objects, as many as must be decided to meet the gap.
            let mut rest = open_cost;
            let enough = open.iter().position(|&id| {
                rest -= self.cost([id]);
                left_cost + rest <= allowed
            });
            let asked: Vec<ObjectId> = open.drain(..enough.map_or(open.len(), |last| last + 1)).collect();
            for (id, answer) in
                decide(scene, cell, &mut methods.proofs, &methods.triangles, &asked, &mut steps)
            {
                match answer {
                    Answer::Hidden => proven += 1,
                    Answer::Seen => {
                        seen_cost += self.cost([id]);
                        seen.push(id);
                    }
                    Answer::Open => {
                        left_cost += self.cost([id]);
                        left.push(id);
                    }
                }
            }
        }
        open.append(&mut left);

        let indices = |ids: Vec<ObjectId>| {
            let mut indices: Vec<u32> = ids.into_iter().map(|id| id.index() as u32).collect();
            indices.sort_unstable();
            indices
        };
        let times = MethodTimes { sweep, rays, proofs: lap() };
        let found =
            CellSandwich { seen: indices(seen), open: indices(open), swept: swept as u32, proven, steps };
        (found, times)
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Answer {
    Seen,
    Hidden,
    Open,
}

/// Asks a culler for some objects, and returns each with its answer. Adds the culler's work to `steps`.
fn decide(
    scene: &Scene,
    cell: &Viewcell,
    culler: &mut ExactCuller,
    triangles: &SceneTriangles,
    asked: &[ObjectId],
    steps: &mut u64,
) -> Vec<(ObjectId, Answer)> {
    let mut answers = vec![None; scene.index_limit()];
    for id in asked {
        answers[id.index()] = Some(Answer::Open);
    }
    let mut visible = VisibleSet::new();
    visible.retain(scene, |id, _| answers[id.index()].is_some());
    culler.cull(scene, cell, &mut visible);
    if let Some(found) = culler.last() {
        *steps += found.rays + found.nodes;
        for (id, verdict) in found.iter(triangles) {
            if let Some(answer) = &mut answers[id.index()] {
                *answer = match verdict {
                    Verdict::Seen(_) => Answer::Seen,
                    Verdict::Hidden => Answer::Hidden,
                    Verdict::Hardly(_) | Verdict::Open => Answer::Open,
                };
            }
        }
    }
    asked.iter().filter_map(|&id| Some((id, answers[id.index()]?))).collect()
}

/// Returns a hash of all that a bake depends on: the scene, all viewcells and the settings. Shards with the
/// same hash belong together. Time is linear in the numbers of triangles and viewcells.
pub fn bake_fingerprint(scene: &Scene, viewcells: &Viewcells, settings: &Settings) -> u64 {
    let hash = Fingerprint::new().with_u64(scene_fingerprint(scene));
    let hash =
        hash.with_u64(settings.gap.to_bits()).with_u64(settings.clearance.to_bits()).with(settings.rays);
    let vector =
        |hash: Fingerprint, v: DVec3| v.to_array().iter().fold(hash, |hash, x| hash.with_u64(x.to_bits()));
    let cells = viewcells.cells().iter().fold(hash, |hash, cell| {
        let hash = vector(vector(hash, cell.min), cell.max).with(cell.planes.len() as u32);
        cell.planes
            .iter()
            .fold(hash, |hash, plane| vector(hash, plane.normal).with_u64(plane.offset.to_bits()))
    });
    cells.value()
}

impl Baker for SandwichBaker<'_> {
    type Scratch = BakeScratch;
    type Found = (CellSandwich, MethodTimes);
    type Outcome = SandwichOutcome;

    // Threads wait for one another at the end of a round, so short rounds leave many threads idle.
    const ROUND: usize = 64;
    const KIND: u32 = 31;

    fn item_count(&self) -> usize {
        self.range.len()
    }

    fn work(&self, item: u32, scratch: &mut BakeScratch) -> (CellSandwich, MethodTimes) {
        let Methods { triangles, sweep, .. } = &self.methods;
        let methods =
            scratch.0.get_or_insert_with(|| Methods::new(triangles.clone(), sweep.clone(), &self.settings));
        self.bake(&self.viewcells.cells()[self.range.start + item as usize], methods)
    }

    fn take_in(&mut self, item: u32, found: (CellSandwich, MethodTimes)) -> u64 {
        let steps = found.0.steps;
        self.done[item as usize] = Some(found);
        steps
    }

    fn finish(self, waiting: &[u32]) -> SandwichOutcome {
        let mut all: Vec<u32> = self.scene.ids().map(|id| id.index() as u32).collect();
        all.sort_unstable();
        let unknown = || CellSandwich { open: all.clone(), ..CellSandwich::default() };
        let done =
            self.done.into_iter().map(|done| done.unwrap_or_else(|| (unknown(), MethodTimes::default())));
        let (cells, times) = done.unzip();
        SandwichOutcome { first: self.range.start, cells, times, complete: waiting.is_empty() }
    }

    fn fingerprint(&self) -> u64 {
        let hash = Fingerprint::new().with_u64(self.fingerprint);
        hash.with_u64(self.range.start as u64).with_u64(self.range.end as u64).value()
    }

    fn save(&self, state: &mut Writer) {
        for done in &self.done {
            state.u32(u32::from(done.is_some()));
            if let Some((cell, times)) = done {
                cell.save(state);
                times.save(state);
            }
        }
    }

    fn load(&mut self, state: &mut Reader<'_>) -> Result<(), FormatError> {
        let limit = self.scene.index_limit();
        for done in &mut self.done {
            *done = match state.u32()? {
                0 => None,
                _ => Some((CellSandwich::load(state, limit)?, MethodTimes::load(state)?)),
            };
        }
        Ok(())
    }
}
