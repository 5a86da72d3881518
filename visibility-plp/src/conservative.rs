//! The conservative form of prioritized-layered projection.

use crate::sight::Sight;
use crate::walk::{Budget, Projected, Rules, Stage, Walk};
use crate::{Solidity, Tessellation};
use alloc::vec::Vec;
use core::ops::Deref;
use visibility_core::glam::{Affine3A, DVec3, Vec3};
use visibility_core::{
    Aabb, Accuracy, CullStats, Culler, ObjectId, OccluderMesh, Occlusion, OcclusionMap, Scene, View,
    VisibleSet,
};

/// Projects a budget's worth as [`PlpCuller`](crate::PlpCuller) does, then fills the holes: the cells in the front are tested against an
/// occlusion map of what was projected, and from those that are not hidden the walk goes on, to cells that are not hidden, until the front
/// is empty. Hidden cells of the front hide all that lies behind them, without being looked at.
///
/// As conservative as the map: what is seen is seen along a line of sight, which goes from cell to cell through points that are themselves
/// seen, so that none of these cells is found hidden. Objects that no cell holds are kept. An object hides others if the scene has an
/// [occluder](Scene::occluder) of it, and is kept if any cell that it meets is reached.
///
/// Klosowski and Silva, "Efficient Conservative Visibility Culling Using the Prioritized-Layered Projection Algorithm", 2001.
///
/// # Cost
/// That of the budget, and a test for each cell in the front or next to a cell that is projected afterwards: far fewer than there are cells.
///
/// ```
/// use std::sync::Arc;
/// use visibility_core::{glam::DVec3, Aabb, FrustumCuller, Pipeline, Pose, Scene, View, VisibleSet};
/// use visibility_plp::{Budget, ConservativePlpCuller, OctreeTessellation};
/// # use visibility_core::{glam::Affine3A, Accuracy, Occlusion, OccluderMesh, OcclusionMap};
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
/// let mut scene = Scene::new();
/// let id = scene.insert(Aabb::from_arrays([5.0, -1.0, -1.0], [6.0, 1.0, 1.0]));
/// let cells = Arc::new(OctreeTessellation::new(&scene));
/// // `map`: a hierarchical z-buffer, say.
/// let culler = ConservativePlpCuller::new(cells, Budget::Cost(10_000), map);
/// let mut pipeline = Pipeline::new().with(FrustumCuller::new()).with(culler);
/// let view = View::perspective(Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z), 1.0, 1.5, 0.1, f64::INFINITY)?;
/// let mut visible = VisibleSet::new();
/// pipeline.cull(&scene, &view, &mut visible);
/// assert!(visible.contains(&scene, id));
/// # Ok::<(), visibility_core::ViewError>(())
/// ```
#[derive(Clone, Debug)]
pub struct ConservativePlpCuller<S, M> {
    tessellation: S,
    rules: Rules,
    map: M,
    walk: Walk,
    waiting: Vec<u32>,
    sorted: Vec<(u32, Aabb)>,
    report: Report,
}

/// What the conservative culler did in a frame, as the paper's table 1 counts it.
///
/// ```
/// assert_eq!(visibility_plp::Report::default().tests, 0);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Report {
    /// Boxes tested against the map: of cells, and of cells together.
    pub tests: u64,
    /// Cells that were not hidden.
    pub visible_cells: u64,
    /// The most cells that were in the front at once after the budget was spent.
    pub front: u64,
    /// Cells projected, in all.
    pub projected_cells: u64,
}

impl<S: Deref<Target: Tessellation>, M: OcclusionMap> ConservativePlpCuller<S, M> {
    /// Over a tessellation, with a budget for what is projected without tests.
    pub fn new(tessellation: S, budget: Budget, map: M) -> Self {
        let rules = Rules { budget, solidity: Solidity::default(), one_sided: false };
        let (walk, waiting, sorted) = (Walk::default(), Vec::new(), Vec::new());
        Self { tessellation, rules, map, walk, waiting, sorted, report: Report::default() }
    }

    /// Estimates solidity otherwise.
    pub fn with_solidity(mut self, solidity: Solidity) -> Self {
        self.rules.solidity = solidity;
        self
    }

    /// As for [`PlpCuller`](crate::PlpCuller::with_one_sided). Conservative for scenes that are drawn one-sided, and only for these.
    pub fn with_one_sided(mut self, one_sided: bool) -> Self {
        self.rules.one_sided = one_sided;
        self
    }

    /// Sets the budget of the frames to come.
    pub fn set_budget(&mut self, budget: Budget) {
        self.rules.budget = budget;
    }

    /// The tessellation, to bring it up to date, if it is this culler's own.
    pub fn shared_mut(&mut self) -> &mut S {
        &mut self.tessellation
    }

    /// The map, as the last frame left it.
    pub fn map(&self) -> &M {
        &self.map
    }

    /// What the last frame did.
    pub fn report(&self) -> Report {
        self.report
    }
}

/// Adds those of the projected objects to a map that hide others.
fn feed<M: OcclusionMap>(map: &mut M, scene: &Scene, view: &View, projected: &[ObjectId]) {
    let mut added = false;
    for &id in projected {
        if let Some((mesh, transform)) = scene.occluder(id)
            && is_whole(mesh, transform, view, scene.origin())
        {
            map.add(mesh, transform);
            added = true;
        }
    }
    if added {
        map.flush();
    }
}

/// Whether an occluder lies surely inside all of the view's own clip planes: what they cut away is not drawn, and must not hide.
fn is_whole(mesh: &OccluderMesh, transform: &Affine3A, view: &View, origin: DVec3) -> bool {
    let shift = origin - view.origin();
    view.clip_planes().iter().all(|plane| {
        mesh.bounds().corners().iter().all(|&corner: &Vec3| {
            let p = transform.transform_point3(corner).as_dvec3() + shift;
            // Far above the rounding of the transform, far below the size of anything that hides.
            let magnitude =
                plane.normal.abs().max_element() * (p.abs().element_sum() + shift.abs().element_sum());
            plane.signed_distance(p) > 1e-5 * (magnitude + plane.offset.abs())
        })
    })
}

/// The most cells that are tested together.
const GROUP: usize = 16;

/// Shuts those of the waiting cells that are hidden. Cells that lie close together (numbers of neighbours are often near each other) are
/// tested by the box around them first: most of what lies behind a wall needs one test a dozen. Where that is not hidden, cells that hold
/// something are tested by themselves; others cost nothing to go through.
fn sieve<T: Tessellation + ?Sized, M: OcclusionMap>(
    stage: &Stage<'_, T>,
    map: &M,
    walk: &mut Walk,
    waiting: &[u32],
    sorted: &mut Vec<(u32, Aabb)>,
    report: &mut Report,
) {
    sorted.clear();
    let bounds = waiting.iter().map(|&cell| (cell, stage.tessellation.cell_bounds(cell)));
    // Lines of sight go through the others before anything is in view.
    sorted.extend(bounds.filter(|(_, bounds)| stage.sight.is_beyond_near(bounds)));
    sorted.sort_unstable_by_key(|&(cell, _)| cell);
    let mut rest = &sorted[..];
    while !rest.is_empty() {
        let (group, all, others) = compact(rest);
        rest = others;
        report.tests += 1;
        let answer = map.test(&all);
        for (cell, bounds) in group {
            let is_asked = answer == Occlusion::Partial && group.len() > 1;
            let hidden = if is_asked && walk.has_content(*cell) {
                report.tests += 1;
                map.test(bounds) == Occlusion::Hidden
            } else {
                answer == Occlusion::Hidden
            };
            if hidden {
                walk.shut(*cell);
            } else {
                report.visible_cells += 1;
            }
        }
    }
}

/// Some cells, each with its box.
type Boxes = [(u32, Aabb)];

/// The first of some cells that fill a good part of the box around them, that box, and the others.
fn compact(cells: &Boxes) -> (&Boxes, Aabb, &Boxes) {
    let (mut all, mut sum, mut count) = (Aabb::EMPTY, 0.0, 0);
    for (_, bounds) in cells.iter().take(GROUP) {
        let (more, filled) = (all.union(bounds), sum + volume(bounds));
        if count > 0 && volume(&more) > 3.0 * filled {
            break;
        }
        (all, sum, count) = (more, filled, count + 1);
    }
    let (group, others) = cells.split_at(count);
    (group, all, others)
}

fn volume(bounds: &Aabb) -> f64 {
    let size = (bounds.max - bounds.min).as_dvec3();
    size.x * size.y * size.z
}

impl<S: Deref<Target: Tessellation>, M: OcclusionMap> Culler for ConservativePlpCuller<S, M> {
    fn name(&self) -> &str {
        "cplp"
    }

    fn accuracy(&self) -> Accuracy {
        Accuracy::Conservative.and(self.map.accuracy())
    }

    fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats {
        let Self { tessellation, rules, map, walk, waiting, sorted, report } = self;
        let tessellation = &**tessellation;
        *report = Report::default();
        map.begin(view, scene.origin());
        map.flush();
        let sight = Sight::new(view, scene.origin(), &tessellation.bounds());
        let stage = Stage { tessellation, scene, visible, sight, rules: *rules };
        if !walk.begin(&stage) {
            return CullStats { visible: visible.count(scene) as u64, ..CullStats::default() };
        }
        let cells = tessellation.content().cell_count();
        waiting.clear();
        waiting.reserve(cells);
        sorted.clear();
        sorted.reserve(cells);
        while let Some(cell) = walk.next() {
            if walk.step(&stage, cell) == Projected::Cut {
                // The rest of it is yet to be looked at.
                walk.put_back(cell);
                break;
            }
        }
        walk.settle(&stage, false);
        feed(map, scene, view, &walk.order);
        loop {
            waiting.clear();
            while let Some(cell) = walk.next() {
                waiting.push(cell);
            }
            if waiting.is_empty() {
                break;
            }
            report.front = report.front.max(waiting.len() as u64);
            sieve(&stage, map, walk, waiting, sorted, report);
            let before = walk.order.len();
            for &cell in &*waiting {
                walk.finish(&stage, cell);
            }
            feed(map, scene, view, &walk.order[before..]);
        }
        report.projected_cells = walk.projected;
        let (nodes, tests) = (walk.projected, report.tests);
        visible.keep_in_order(scene, &walk.order);
        CullStats { nodes, tests, visible: visible.count(scene) as u64, ..CullStats::default() }
    }

    fn reset(&mut self) {
        self.map.reset();
    }
}
