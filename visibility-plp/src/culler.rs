//! Prioritized-layered projection as a culler.

use crate::sight::Sight;
use crate::walk::{Budget, Projected, Rules, Stage, Walk};
use crate::{Solidity, Tessellation};
use core::ops::Deref;
use visibility_core::{Accuracy, CullStats, Culler, Scene, View, VisibleSet};

/// Keeps, of what may be visible, what most likely is, up to a budget.
///
/// Cells are projected one by one, from the eye outwards, always the one of the front that is least likely to be hidden, and with
/// each what it holds, until the budget is spent (Klosowski and Silva, "The Prioritized-Layered Projection Algorithm for Visible Set
/// Estimation", 2000). Approximate: what is hidden may be kept, what is visible dropped. The set is left in the order of projection, so that a
/// drawing loop may stop at any time and have drawn what mattered most.
///
/// Owns one view's memory; the tessellation is shared, by reference or by `Arc`. Objects that have changed since it was told come first, since
/// nothing is known of them; if it is of another scene, the set is left as it is.
///
/// # Cost
/// In proportion to the budget and the cells that it reaches: some 100 ns a cell and 30 ns an object.
///
/// ```
/// use std::sync::Arc;
/// use visibility_core::{glam::DVec3, Aabb, FrustumCuller, Pipeline, Pose, Scene, View, VisibleSet};
/// use visibility_plp::{Budget, OctreeTessellation, PlpCuller};
/// let mut scene = Scene::new();
/// let ids = scene.insert_batch((1..100).map(|i| Aabb::from_arrays([i as f32, -1.0, -1.0], [i as f32 + 0.5, 1.0, 1.0])));
/// let cells = Arc::new(OctreeTessellation::new(&scene));
/// let mut pipeline = Pipeline::new().with(FrustumCuller::new()).with(PlpCuller::new(cells, Budget::Objects(10)));
/// let view = View::perspective(Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z), 1.0, 1.5, 0.1, f64::INFINITY)?;
/// let mut visible = VisibleSet::new();
/// pipeline.cull(&scene, &view, &mut visible);
/// assert_eq!(visible.count(&scene), 10);
/// assert!(visible.contains(&scene, ids[0]));
/// # Ok::<(), visibility_core::ViewError>(())
/// ```
#[derive(Clone, Debug)]
pub struct PlpCuller<S> {
    tessellation: S,
    rules: Rules,
    keep_all: bool,
    walk: Walk,
}

impl<S: Deref<Target: Tessellation>> PlpCuller<S> {
    /// Over a tessellation, with a budget.
    pub fn new(tessellation: S, budget: Budget) -> Self {
        let rules = Rules { budget, solidity: Solidity::default(), one_sided: false };
        Self { tessellation, rules, keep_all: false, walk: Walk::default() }
    }

    /// Estimates solidity otherwise.
    pub fn with_solidity(mut self, solidity: Solidity) -> Self {
        self.rules.solidity = solidity;
        self
    }

    /// Leaves out objects of up to four triangles that all turn their backs to the eye, for scenes that are drawn one-sided. Off unless set.
    pub fn with_one_sided(mut self, one_sided: bool) -> Self {
        self.rules.one_sided = one_sided;
        self
    }

    /// Drops nothing and only puts the set in order: what the budget buys first, the rest after it. For
    /// [`Selection::Ordered`](visibility_core::Selection::Ordered), which chooses occluders in that order.
    pub fn with_all_kept(mut self, keep_all: bool) -> Self {
        self.keep_all = keep_all;
        self
    }

    /// Sets the budget of the frames to come.
    pub fn set_budget(&mut self, budget: Budget) {
        self.rules.budget = budget;
    }

    /// The tessellation.
    pub fn tessellation(&self) -> &S::Target {
        &self.tessellation
    }

    /// The tessellation, to bring it up to date, if it is this culler's own.
    pub fn shared_mut(&mut self) -> &mut S {
        &mut self.tessellation
    }

    /// How many cells the last frame went through.
    pub fn projected_cells(&self) -> u64 {
        self.walk.projected
    }
}

impl<S: Deref<Target: Tessellation>> Culler for PlpCuller<S> {
    fn name(&self) -> &str {
        "plp"
    }

    fn accuracy(&self) -> Accuracy {
        if self.keep_all { Accuracy::Conservative } else { Accuracy::Approximate }
    }

    fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats {
        let tessellation = &*self.tessellation;
        let sight = Sight::new(view, scene.origin(), &tessellation.bounds());
        let stage = Stage { tessellation, scene, visible, sight, rules: self.rules };
        let walk = &mut self.walk;
        if !walk.begin(&stage) {
            return CullStats { visible: visible.count(scene) as u64, ..CullStats::default() };
        }
        while let Some(cell) = walk.next() {
            if walk.step(&stage, cell) == Projected::Cut {
                break;
            }
        }
        walk.settle(&stage, false);
        let stats = CullStats { nodes: walk.projected, tests: walk.reached, ..CullStats::default() };
        if self.keep_all {
            visible.put_first(scene, &walk.order);
            CullStats { visible: visible.count(scene) as u64, ..stats }
        } else {
            visible.keep_in_order(scene, &walk.order);
            CullStats { visible: visible.count(scene) as u64, ..stats }
        }
    }

    fn reset(&mut self) {}
}
