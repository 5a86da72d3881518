//! The conservative form of prioritized-layered projection.

use crate::cell_frustum::CellFrustum;
use crate::solidity::Solidity;
use crate::tessellation::Tessellation;
use crate::walk::{Budget, FrameContext, PlpSettings, Projected, Walk};
use alloc::vec::Vec;
use core::ops::Deref;
use visibility_core::{
    Aabb, Accuracy, CullStats, Culler, ObjectId, OcclusionMap, Scene, View, VisibleSet, occlusion::Occlusion,
};

/// Keeps everything that may be seen: projects a budget like [`PlpCuller`](crate::PlpCuller), then tests the
/// rest against an occlusion map of what was projected.
///
/// After the budget is spent, the cells in the front are tested against the map. Hidden cells are dropped,
/// and with them all that lies behind them, untested. The others are projected in full, which adds their
/// objects to the map and their neighbours to the front, until the front is empty.
///
/// As accurate as the map, at best conservative: a line of sight passes from cell to cell through points that
/// are themselves seen, so none of its cells is found hidden. An object is kept if any cell that it meets is
/// reached, or if no cell holds it. An object occludes others if the scene has an [occluder](Scene::occluder)
/// of it. If the tessellation was made from another scene, the set is left as it is.
///
/// Klosowski and Silva, "Efficient Conservative Visibility Culling Using the Prioritized-Layered Projection
/// Algorithm", 2001.
///
/// # Cost
/// That of the budget, and a test for each cell in the front or next to a cell that is projected afterwards:
/// far fewer than there are cells. The first frame of a tessellation allocates; later ones do not, whatever
/// the view, if the map does not.
///
/// ```
/// use std::sync::Arc;
/// use visibility_core::{glam::DVec3, Aabb, FrustumCuller, Pipeline, Pose, Scene, View, VisibleSet};
/// use visibility_plp::{Budget, ConservativePlpCuller, OctreeTessellation};
/// # use visibility_core::{
/// #     glam::Affine3A, occlusion::Occlusion, Accuracy, OcclusionMap,
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
/// let mut scene = Scene::new();
/// let id = scene.insert(Aabb::from_arrays([5.0, -1.0, -1.0], [6.0, 1.0, 1.0]));
/// let cells = Arc::new(OctreeTessellation::new(&scene));
/// // `map`: a hierarchical z-buffer, say.
/// let culler = ConservativePlpCuller::new(cells, Budget::Cost(10_000), map);
/// let mut pipeline = Pipeline::new().with(FrustumCuller::new()).with(culler);
/// let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
/// let view = View::perspective(pose, 1.0, 1.5, 0.1, f64::INFINITY)?;
/// let mut visible = VisibleSet::new();
/// pipeline.cull(&scene, &view, &mut visible);
/// assert!(visible.contains(&scene, id));
/// # Ok::<(), visibility_core::view::ViewError>(())
/// ```
#[derive(Clone, Debug)]
pub struct ConservativePlpCuller<S, M> {
    tessellation: S,
    settings: PlpSettings,
    map: M,
    walk: Walk,
    /// Cells taken from the front that are to be tested.
    waiting: Vec<u32>,
    /// Those of them that may be found hidden, with their boxes, by cell number.
    sorted: Vec<(u32, Aabb)>,
    stats: ConservativeStats,
}

/// Counts of a frame of the conservative culler, as in the paper's table 1.
///
/// ```
/// assert_eq!(visibility_plp::ConservativeStats::default().tests, 0);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct ConservativeStats {
    /// Boxes tested against the map: of single cells, and around groups of cells.
    pub tests: u64,
    /// Tested cells that were not hidden.
    pub visible_cells: u64,
    /// Greatest number of cells in the front after the budget was spent.
    pub front: u64,
    /// Cells projected, before and after the budget was spent.
    pub projected_cells: u64,
}

impl<S: Deref<Target: Tessellation>, M: OcclusionMap> ConservativePlpCuller<S, M> {
    /// A culler over a tessellation. `budget` is what is projected without tests in each frame; the result
    /// may be larger.
    pub fn new(tessellation: S, budget: Budget, map: M) -> Self {
        let settings = PlpSettings { budget, solidity: Solidity::default(), one_sided: false };
        let (walk, waiting, sorted) = (Walk::default(), Vec::new(), Vec::new());
        Self { tessellation, settings, map, walk, waiting, sorted, stats: ConservativeStats::default() }
    }

    /// Chooses how solidity is estimated.
    pub fn with_solidity(mut self, solidity: Solidity) -> Self {
        self.settings.solidity = solidity;
        self
    }

    /// As [`PlpCuller::with_one_sided`](crate::PlpCuller::with_one_sided). Conservative only if the scene is
    /// drawn with back-face culling.
    pub fn with_one_sided(mut self, one_sided: bool) -> Self {
        self.settings.one_sided = one_sided;
        self
    }

    /// Sets the budget of each frame from the next one on.
    pub fn set_budget(&mut self, budget: Budget) {
        self.settings.budget = budget;
    }

    /// The tessellation's owner, to sync it or to exchange it for another at any time.
    pub fn shared_mut(&mut self) -> &mut S {
        &mut self.tessellation
    }

    /// The map, with the occluders of the last frame.
    pub fn map(&self) -> &M {
        &self.map
    }

    /// Counts of the last frame; zeros before the first, and for a scene that the tessellation was not made
    /// from.
    pub fn stats(&self) -> ConservativeStats {
        self.stats
    }
}

/// Adds the occluders of the `projected` objects to the map. Objects without an occluder mesh add nothing.
fn add_occluders<M: OcclusionMap>(map: &mut M, scene: &Scene, projected: &[ObjectId]) {
    let mut added = false;
    for &id in projected {
        if let Some((mesh, transform)) = scene.occluder(id) {
            map.add(mesh, transform);
            added = true;
        }
    }
    if added {
        map.flush();
    }
}

/// Maximum number of cells that are tested by the box around them.
const GROUP: usize = 16;

/// Shuts those of the waiting cells that are hidden.
///
/// Cells with near numbers often lie close together. A group of them is tested by the box around it first:
/// most of what lies behind a wall needs one test a dozen. In a group that is not hidden, cells with content
/// are tested one by one; passing through empty cells costs nothing.
fn shut_hidden<T: Tessellation + ?Sized, M: OcclusionMap>(
    frame: &FrameContext<'_, T>,
    map: &M,
    walk: &mut Walk,
    waiting: &[u32],
    sorted: &mut Vec<(u32, Aabb)>,
    stats: &mut ConservativeStats,
) {
    sorted.clear();
    let bounds = waiting.iter().map(|&cell| (cell, frame.tessellation.cell_bounds(cell)));
    // Lines of sight pass through the other cells before anything is in view, and the map knows nothing of
    // them.
    sorted.extend(bounds.filter(|(_, bounds)| frame.frustum.is_beyond_near(bounds)));
    sorted.sort_unstable_by_key(|&(cell, _)| cell);
    let mut rest = &sorted[..];
    while !rest.is_empty() {
        let (group, all, others) = split_group(rest);
        rest = others;
        stats.tests += 1;
        let answer = map.test(&all);
        for (cell, bounds) in group {
            let is_tested_alone = answer == Occlusion::Partial && group.len() > 1;
            let hidden = if is_tested_alone && walk.has_content(*cell) {
                stats.tests += 1;
                map.test(bounds) == Occlusion::Hidden
            } else {
                answer == Occlusion::Hidden
            };
            if hidden {
                walk.shut(*cell);
            } else {
                stats.visible_cells += 1;
            }
        }
    }
}

/// Cells, each with its box.
type CellBoxes = [(u32, Aabb)];

/// Splits off the first cells that fill at least a third of the box around them, at most [`GROUP`]. Returns
/// them, that box, and the other cells. At least one cell is split off unless there is none.
fn split_group(cells: &CellBoxes) -> (&CellBoxes, Aabb, &CellBoxes) {
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
        let Self { tessellation, settings, map, walk, waiting, sorted, stats } = self;
        let tessellation = &**tessellation;
        *stats = ConservativeStats::default();
        map.begin(view, scene.origin());
        map.flush();
        let frustum = CellFrustum::new(view, scene.origin(), &tessellation.bounds());
        let frame = FrameContext { tessellation, scene, visible, frustum, settings: *settings };
        if !walk.begin(&frame) {
            return CullStats { visible: visible.count(scene) as u64, ..CullStats::default() };
        }
        let cells = tessellation.content().cell_count();
        waiting.clear();
        waiting.reserve(cells);
        sorted.clear();
        sorted.reserve(cells);
        while let Some(cell) = walk.next() {
            if walk.step(&frame, cell) == Projected::OutOfBudget {
                // The layers that are left have yet to be tested.
                walk.put_back(cell);
                break;
            }
        }
        walk.settle(&frame, false);
        add_occluders(map, scene, &walk.order);
        loop {
            waiting.clear();
            while let Some(cell) = walk.next() {
                waiting.push(cell);
            }
            if waiting.is_empty() {
                break;
            }
            stats.front = stats.front.max(waiting.len() as u64);
            shut_hidden(&frame, map, walk, waiting, sorted, stats);
            let before = walk.order.len();
            for &cell in &*waiting {
                walk.finish(&frame, cell);
            }
            add_occluders(map, scene, &walk.order[before..]);
        }
        stats.projected_cells = walk.projected;
        let (nodes, tests) = (walk.projected, stats.tests);
        visible.keep_in_order(scene, &walk.order);
        CullStats { nodes, tests, visible: visible.count(scene) as u64, ..CullStats::default() }
    }

    fn reset(&mut self) {
        self.map.reset();
    }
}
