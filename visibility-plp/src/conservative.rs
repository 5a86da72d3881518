//! The conservative culler: prioritized-layered projection with an occlusion map.

use crate::cell_frustum::CellFrustum;
use crate::solidity::Solidity;
use crate::tessellation::Tessellation;
use crate::walk::{Budget, FrameContext, Keep, PlpSettings, Projected, Walk};
use alloc::vec::Vec;
use core::ops::Deref;
use visibility_core::{
    Aabb, Accuracy, CullStats, Culler, ObjectId, OcclusionMap, Scene, View, VisibleSet, occlusion::Occlusion,
    scene::SceneCursor, stamp::Stamp,
};

/// Keeps every object that may be visible: projects a budget like [`PlpCuller`](crate::PlpCuller), then tests
/// the remaining cells against an occlusion map of the projected objects.
///
/// After the budget is spent, the cells of the front (the priority queue of cells next to projected cells)
/// are tested against the map, and so are objects that the budget left over. Hidden cells are dropped, and
/// cells that can only be reached through hidden cells are never tested. The other cells are projected in
/// full: their objects are kept, their occluders are added to the map, and their neighbours join the front.
/// (A map with [delayed answers](OcclusionMap::answers_at_once) gets the occluders of the budget alone.) The
/// frame ends when the front is empty.
///
/// As accurate as the map, at best conservative. A view ray to a visible point passes only through visible
/// points, so no cell on its way is found hidden. An object is kept if any cell that the object meets is
/// reached, or if no cell lists the object. Objects that have an [occluder mesh](Scene::occluder) in the
/// scene occlude. If the tessellation was made from another scene, the set is left unchanged.
///
/// Klosowski and Silva, "Efficient Conservative Visibility Culling Using the Prioritized-Layered Projection
/// Algorithm", 2001.
///
/// # Cost
/// The cost of the budget, plus a map test for each cell that is in the front when the budget ends or next to
/// a cell projected afterwards: far fewer tests than cells. The first frame with a tessellation allocates.
/// Later frames do not allocate, whatever the view, if the map does not.
///
/// ```
/// use std::sync::Arc;
/// use visibility_core::{glam::DVec3, Aabb, FrustumCuller, Pipeline, Pose, Scene, View, VisibleSet};
/// use visibility_plp::{Budget, ConservativePlpCuller, OctreeTessellation};
/// # use visibility_core::{
/// #     glam::Affine3A, occlusion::Occlusion, Accuracy, OccluderMesh, OcclusionMap,
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
    /// Cells taken from the front (the queue of cells to project) that await an occlusion test.
    waiting: Vec<u32>,
    /// Cells of `waiting` that the map may find hidden, each with its scene-relative box, sorted by cell
    /// number.
    sorted: Vec<(u32, Aabb)>,
    /// Counters of the last frame.
    stats: ConservativeStats,
    /// The scene of the last frame, to which the map's memory of earlier frames belongs.
    scene: SceneCursor,
    /// Fingerprint of the incoming set of the last frame, for a map with delayed answers.
    candidates: Option<(Stamp, u64)>,
}

/// Counts of one frame of [`ConservativePlpCuller`], as in table 1 of Klosowski and Silva, 2001.
///
/// ```
/// assert_eq!(visibility_plp::ConservativeStats::default().tests, 0);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
#[non_exhaustive]
pub struct ConservativeStats {
    /// Number of boxes tested against the map: boxes of single cells, boxes around groups of cells, and boxes
    /// of objects that were looked up before the budget was spent and did not fit into it.
    pub tests: u64,
    /// Number of tested cells that were not found hidden.
    pub visible_cells: u64,
    /// Largest number of cells that were in the front at once after the budget was spent.
    pub front: u64,
    /// Number of cells projected, before and after the budget was spent.
    pub projected_cells: u64,
}

impl<S: Deref<Target: Tessellation>, M: OcclusionMap> ConservativePlpCuller<S, M> {
    /// Makes a culler over a tessellation with an occlusion map. `budget` limits the objects kept per frame
    /// before the first map test; the result may be larger. Default: [`Solidity::Coverage`]. O(1).
    pub fn new(tessellation: S, budget: Budget, map: M) -> Self {
        Self {
            tessellation,
            settings: PlpSettings::new(budget),
            map,
            walk: Walk::default(),
            waiting: Vec::new(),
            sorted: Vec::new(),
            stats: ConservativeStats::default(),
            scene: SceneCursor::START,
            candidates: None,
        }
    }

    /// Sets the estimate of how likely a cell is hidden, which orders the cells. [`Solidity::Coverage`] by
    /// default.
    #[must_use]
    pub fn with_solidity(mut self, solidity: Solidity) -> Self {
        self.settings.solidity = solidity;
        self
    }

    /// Returns a mutable reference to the pointer to the tessellation. Call `sync` on the tessellation
    /// through it, or assign a pointer to another tessellation. The next frame uses what the pointer then
    /// points to.
    pub fn shared_mut(&mut self) -> &mut S {
        &mut self.tessellation
    }

    /// Returns the occlusion map with the occluders of the last frame. Before the first frame, the map as
    /// given to [`new`](Self::new).
    pub fn map(&self) -> &M {
        &self.map
    }

    /// Returns the counts of the last frame. All zero before the first frame, and after a frame whose scene
    /// the tessellation was not made from.
    pub fn stats(&self) -> ConservativeStats {
        self.stats
    }
}

/// Adds the occluder meshes of the `projected` objects to the map and flushes the map if any was added.
/// Objects without an occluder mesh add nothing.
fn add_occluders<M: OcclusionMap>(map: &mut M, scene: &Scene, projected: &[ObjectId]) {
    let mut added = false;
    for &id in projected {
        if let Some((mesh, ref transform)) = scene.occluder(id) {
            map.add(mesh, transform);
            added = true;
        }
    }
    if added {
        map.flush();
    }
}

/// Maximum number of cells in a group that is tested by the box around the group.
const GROUP: usize = 16;

/// Drops the cells of `waiting` that the map finds hidden: their objects are not kept, and their neighbours
/// are not reached through them. Adds to `stats`; `sorted` is scratch memory.
///
/// Cells with close numbers often lie close together. A group of them is tested first by the box around the
/// group, so that behind a wall one test serves about a dozen cells. In a group that is partly visible, cells
/// with objects are tested one by one. Empty cells of a partly visible group count as visible, since passing
/// through them costs little.
fn drop_hidden<T: Tessellation + ?Sized, M: OcclusionMap>(
    frame: &FrameContext<'_, T>,
    map: &mut M,
    walk: &mut Walk,
    waiting: &[u32],
    sorted: &mut Vec<(u32, Aabb)>,
    stats: &mut ConservativeStats,
) {
    sorted.clear();
    let bounds = waiting.iter().map(|&cell| (cell, frame.tessellation.cell_bounds(cell)));
    // Only cells beyond the near plane are tested. The map has no depth for the space before it, which view
    // rays cross first.
    sorted.extend(bounds.filter(|(_, bounds)| frame.frustum.is_beyond_near(bounds)));
    sorted.sort_unstable_by_key(|&(cell, _)| cell);
    let mut rest = &sorted[..];
    while !rest.is_empty() {
        let (group, all, others) = split_group(rest);
        rest = others;
        stats.tests += 1;
        let answer = map.test_mut(&all);
        for (cell, bounds) in group {
            let is_tested_alone = answer == Occlusion::Partial && group.len() > 1;
            let hidden = if is_tested_alone && walk.has_content(*cell) {
                stats.tests += 1;
                map.test_mut(bounds) == Occlusion::Hidden
            } else {
                answer == Occlusion::Hidden
            };
            if hidden {
                walk.drop_cell(*cell);
            } else {
                stats.visible_cells += 1;
            }
        }
    }
}

/// Numbers of cells, each with the cell's scene-relative box.
type CellBoxes = [(u32, Aabb)];

/// Splits off the longest run of cells from the start of `cells`, at most [`GROUP`], that together fill at
/// least a third of the box around the run. Returns the run, the box around the run, and the remaining cells.
/// The run has at least one cell unless `cells` is empty.
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

/// Returns the volume of a box in cubic metres.
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

    fn hides_behind_objects(&self) -> bool {
        true
    }

    fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats {
        if !self.scene.is_in(scene) {
            self.map.reset();
        } else if !self.scene.is_current(scene) {
            self.map.scene_changed();
        }
        self.scene = SceneCursor::at(scene);
        let Self { tessellation, settings, map, walk, waiting, sorted, stats, candidates, .. } = self;
        let tessellation = &**tessellation;
        *stats = ConservativeStats::default();
        map.begin(view, scene.origin());
        let at_once = map.answers_at_once();
        if at_once {
            map.flush();
        } else {
            // Answers to earlier frames are about pictures of their candidates.
            let set = Some(visible.fingerprint(scene));
            if core::mem::replace(candidates, set) != set {
                map.candidates_changed();
            }
        }
        let frustum = CellFrustum::new(view, scene.origin(), &tessellation.bounds());
        let frame = FrameContext { tessellation, scene, visible, frustum, settings: *settings };
        let keep: Keep<'_> = &mut |_, _| true;
        if !walk.begin(&frame, keep) {
            return CullStats::default().with_visible(visible.count(scene) as u64);
        }
        let cells = tessellation.content().cell_count();
        waiting.clear();
        waiting.reserve(cells);
        sorted.clear();
        sorted.reserve(cells);
        while let Some(cell) = walk.next() {
            if walk.step(&frame, cell, keep) == Projected::OutOfBudget {
                // The cell may have layers left.
                walk.put_back(cell);
                break;
            }
        }
        add_occluders(map, scene, &walk.order);
        if !at_once {
            // A map with delayed answers takes all occluders of a frame before its first test: those of the
            // budget, which are the same in each frame of a view. With occluders that depend on answers, each
            // answer would change the picture that the next answers are about.
            map.flush();
        }
        // Objects that were looked up but did not fit into the budget: each is tested by its own bounds.
        let budgeted = walk.order.len();
        while let Some(id) = walk.ready.pop() {
            let bounds = scene.bounds(id).ok().filter(|bounds| frame.frustum.is_beyond_near(bounds));
            stats.tests += u64::from(bounds.is_some());
            if bounds.is_none_or(|bounds| map.test_mut(&bounds) != Occlusion::Hidden) {
                walk.order.push(id);
            }
        }
        if at_once {
            add_occluders(map, scene, &walk.order[budgeted..]);
        }
        loop {
            waiting.clear();
            while let Some(cell) = walk.next() {
                waiting.push(cell);
            }
            if waiting.is_empty() {
                break;
            }
            stats.front = stats.front.max(waiting.len() as u64);
            drop_hidden(&frame, map, walk, waiting, sorted, stats);
            let before = walk.order.len();
            for &cell in &*waiting {
                walk.finish(&frame, cell);
            }
            if at_once {
                add_occluders(map, scene, &walk.order[before..]);
            }
        }
        stats.projected_cells = walk.projected;
        let (nodes, tests) = (walk.projected, stats.tests);
        visible.keep_in_order(scene, &walk.order);
        CullStats::default().with_nodes(nodes).with_tests(tests).with_visible(visible.count(scene) as u64)
    }

    fn draws_other_view(&mut self) {
        if !self.map.answers_at_once() {
            self.map.reset();
        }
    }

    fn reset(&mut self) {
        self.map.reset();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Neighbouring boxes are asked for together while their common box has up to three times the volume that
    /// they fill, and at most sixteen.
    #[test]
    fn groups_are_boxes_that_fill_a_third_of_their_common_box() {
        let row = |ends: &[[f32; 2]]| -> Vec<(u32, Aabb)> {
            let boxes = ends.iter().map(|&[low, high]| Aabb::from_arrays([low, 0.0, 0.0], [high, 1.0, 1.0]));
            (0..).zip(boxes).collect()
        };
        let length = |ends: &[[f32; 2]]| split_group(&row(ends)).0.len();
        assert_eq!(length(&[[0.0, 1.0], [5.0, 6.0], [6.0, 7.0]]), 3, "2 of 6, and 3 of 7");
        assert_eq!(length(&[[0.0, 1.0], [5.25, 6.25], [6.25, 9.0]]), 1, "2 of 6.25");
        assert_eq!(length(&[[0.0, 1.0]; 20]), 16, "the greatest group");
        let (cells, mut all) = (row(&[[0.0, 1.0], [2.0, 3.0], [90.0, 91.0]]), Aabb::EMPTY);
        let (group, together, others) = split_group(&cells);
        group.iter().for_each(|(_, bounds)| all = all.union(bounds));
        assert_eq!((together, others), (all, &cells[2..]), "the common box, and what is left");
    }
}
