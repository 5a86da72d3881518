//! The conservative form of prioritized-layered projection.

use crate::sight::Sight;
use crate::walk::{Budget, Projected, Rules, Stage, Walk};
use crate::{Solidity, Tessellation};
use alloc::vec::Vec;
use core::ops::Deref;
use visibility_core::glam::{Affine3A, DVec3, Vec3};
use visibility_core::{
    Accuracy, CullStats, Culler, ObjectId, OccluderMesh, Occlusion, OcclusionMap, Scene, View, VisibleSet,
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
    report: Report,
}

/// What the conservative culler did in a frame, as the paper's table 1 counts it.
///
/// ```
/// assert_eq!(visibility_plp::Report::default().tests, 0);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Report {
    /// Cells tested against the map.
    pub tests: u64,
    /// Those of them that were not hidden.
    pub visible_cells: u64,
    /// Cells in the front when the budget was spent.
    pub front: u64,
    /// Cells projected, in all.
    pub projected_cells: u64,
}

impl<S: Deref<Target: Tessellation>, M: OcclusionMap> ConservativePlpCuller<S, M> {
    /// Over a tessellation, with a budget for what is projected without tests.
    pub fn new(tessellation: S, budget: Budget, map: M) -> Self {
        let rules = Rules { budget, solidity: Solidity::default(), one_sided: false };
        let (walk, waiting, report) = (Walk::default(), Vec::new(), Report::default());
        Self { tessellation, rules, map, walk, waiting, report }
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

impl<S: Deref<Target: Tessellation>, M: OcclusionMap> Culler for ConservativePlpCuller<S, M> {
    fn name(&self) -> &str {
        "cplp"
    }

    fn accuracy(&self) -> Accuracy {
        Accuracy::Conservative.and(self.map.accuracy())
    }

    fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats {
        let Self { tessellation, rules, map, walk, waiting, report } = self;
        let tessellation = &**tessellation;
        *report = Report::default();
        map.begin(view, scene.origin());
        map.flush();
        let sight = Sight::new(view, scene.origin(), &tessellation.bounds());
        let stage = Stage { tessellation, scene, visible, sight, rules: *rules };
        if !walk.begin(&stage) {
            return CullStats { visible: visible.count(scene) as u64, ..CullStats::default() };
        }
        while let Some(cell) = walk.next() {
            if walk.project(&stage, cell, false) == Projected::Cut {
                // The rest of it is yet to be looked at.
                walk.put_back(&stage, cell);
                break;
            }
            walk.hand_on(&stage, cell, |_| true);
        }
        feed(map, scene, view, &walk.order);
        let mut is_seen = |map: &M, cell: u32| {
            let bounds = tessellation.cell_bounds(cell);
            if !stage.sight.is_beyond_near(&bounds) {
                // Lines of sight go through it before anything is in view.
                return true;
            }
            report.tests += 1;
            let seen = map.test(&bounds) != Occlusion::Hidden;
            report.visible_cells += u64::from(seen);
            seen
        };
        walk.drain(waiting);
        report.front = waiting.len() as u64;
        for &cell in &*waiting {
            if is_seen(map, cell) {
                walk.put_back(&stage, cell);
            }
        }
        while let Some(cell) = walk.next() {
            let before = walk.order.len();
            walk.project(&stage, cell, true);
            feed(map, scene, view, &walk.order[before..]);
            walk.hand_on(&stage, cell, |neighbour| is_seen(map, neighbour));
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
