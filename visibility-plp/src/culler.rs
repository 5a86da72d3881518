//! Prioritized-layered projection as a culler.

use crate::cell_frustum::CellFrustum;
use crate::solidity::Solidity;
use crate::tessellation::Tessellation;
use crate::walk::{Budget, FrameContext, PlpSettings, Projected, Walk};
use core::ops::Deref;
use visibility_core::{Accuracy, CullStats, Culler, Scene, View, VisibleSet};

/// Keeps the objects of the visible set that are most likely seen, up to a budget.
///
/// Cells are projected one by one from the eye outwards, always the one of the front that is least solid
/// (least likely to be hidden). Projecting a cell takes the objects that it holds, until the budget is spent
/// (Klosowski and Silva, "The Prioritized-Layered Projection Algorithm for Visible Set Estimation", 2000).
/// The set is left in the order of projection, so a drawing loop may stop at any time and has drawn what
/// matters most.
///
/// Approximate: hidden objects may be kept, visible ones dropped. With [all kept](Self::with_all_kept) it
/// only sorts.
///
/// One culler serves one view; the tessellation is shared between cullers by reference or by `Arc`. Objects
/// that have changed since the tessellation's last `sync` come first, since no cell holds them. If the
/// tessellation was made from another scene, the set is left as it is.
///
/// # Cost
/// Proportional to the budget and the cells that it reaches: some 100 ns a cell and 30 ns an object. The
/// first frame of a tessellation allocates; later ones do not, whatever the view.
///
/// ```
/// use std::sync::Arc;
/// use visibility_core::{glam::DVec3, Aabb, FrustumCuller, Pipeline, Pose, Scene, View, VisibleSet};
/// use visibility_plp::{Budget, OctreeTessellation, PlpCuller};
/// let mut scene = Scene::new();
/// let box_at = |x: f32| Aabb::from_arrays([x, -1.0, -1.0], [x + 0.5, 1.0, 1.0]);
/// let ids = scene.insert_batch((1..100).map(|i| box_at(i as f32)));
/// let cells = Arc::new(OctreeTessellation::new(&scene));
/// let plp = PlpCuller::new(cells, Budget::Objects(10));
/// let mut pipeline = Pipeline::new().with(FrustumCuller::new()).with(plp);
/// let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
/// let view = View::perspective(pose, 1.0, 1.5, 0.1, f64::INFINITY)?;
/// let mut visible = VisibleSet::new();
/// pipeline.cull(&scene, &view, &mut visible);
/// assert_eq!(visible.count(&scene), 10);
/// assert!(visible.contains(&scene, ids[0]));
/// # Ok::<(), visibility_core::view::ViewError>(())
/// ```
#[derive(Clone, Debug)]
pub struct PlpCuller<S> {
    tessellation: S,
    settings: PlpSettings,
    keep_all: bool,
    walk: Walk,
}

impl<S: Deref<Target: Tessellation>> PlpCuller<S> {
    /// A culler over a tessellation with a budget for each frame. Solidity by coverage, two-sided, not
    /// keeping all.
    pub fn new(tessellation: S, budget: Budget) -> Self {
        let settings = PlpSettings { budget, solidity: Solidity::default(), one_sided: false };
        Self { tessellation, settings, keep_all: false, walk: Walk::default() }
    }

    /// Chooses how solidity is estimated.
    pub fn with_solidity(mut self, solidity: Solidity) -> Self {
        self.settings.solidity = solidity;
        self
    }

    /// Whether objects of up to four triangles that all face away from the eye are left out, for scenes that
    /// are drawn with back-face culling. Triangles are anticlockwise seen from their front. Off by default.
    pub fn with_one_sided(mut self, one_sided: bool) -> Self {
        self.settings.one_sided = one_sided;
        self
    }

    /// Whether the set is only sorted: the objects that the budget buys first, the others after them. For
    /// [`Selection::Ordered`](visibility_core::occlusion::Selection::Ordered), which chooses occluders in
    /// that order.
    /// Off by default.
    pub fn with_all_kept(mut self, keep_all: bool) -> Self {
        self.keep_all = keep_all;
        self
    }

    /// Sets the budget of each frame from the next one on.
    pub fn set_budget(&mut self, budget: Budget) {
        self.settings.budget = budget;
    }

    /// The tessellation.
    pub fn tessellation(&self) -> &S::Target {
        &self.tessellation
    }

    /// The tessellation's owner, to sync it or to exchange it for another at any time.
    pub fn shared_mut(&mut self) -> &mut S {
        &mut self.tessellation
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
        let frustum = CellFrustum::new(view, scene.origin(), &tessellation.bounds());
        let frame = FrameContext { tessellation, scene, visible, frustum, settings: self.settings };
        let walk = &mut self.walk;
        if !walk.begin(&frame) {
            return CullStats { visible: visible.count(scene) as u64, ..CullStats::default() };
        }
        while let Some(cell) = walk.next() {
            if walk.step(&frame, cell) == Projected::OutOfBudget {
                break;
            }
        }
        walk.settle(&frame, false);
        let stats = CullStats { nodes: walk.projected, tests: walk.reached, ..CullStats::default() };
        if self.keep_all {
            visible.put_first(scene, &walk.order);
        } else {
            visible.keep_in_order(scene, &walk.order);
        }
        CullStats { visible: visible.count(scene) as u64, ..stats }
    }

    fn reset(&mut self) {}
}
