//! The approximate culler: prioritized-layered projection up to a budget.

use crate::cell_frustum::CellFrustum;
use crate::solidity::Solidity;
use crate::tessellation::Tessellation;
use crate::walk::{Budget, FrameContext, PlpSettings, Projected, Walk};
use core::ops::Deref;
use visibility_core::{Accuracy, CullStats, Culler, Scene, View, VisibleSet};

/// Keeps the objects of the visible set that are most likely seen, up to a budget per frame.
///
/// The front is a priority queue of cells that starts with the eye's cell. Each step takes the cell with the
/// least solidity, the estimate of how likely earlier cells hide it, keeps the cell's objects and adds the
/// neighbouring cells to the front. The frame ends when the budget is spent (Klosowski and Silva, "The
/// Prioritized-Layered Projection Algorithm for Visible Set Estimation", 2000). The set's order afterwards is
/// the order in which objects were kept, most likely visible first. A drawing loop may therefore stop at any
/// object.
///
/// Approximate: hidden objects may be kept and visible objects dropped. With
/// [`with_all_kept`](Self::with_all_kept) the culler only sorts the set and is conservative.
///
/// One culler serves one view. `S` is a reference, `Arc` or `Box` of a tessellation, which several cullers
/// may share. Objects that have changed since the tessellation's last `sync` are in no cell: such objects are
/// kept and come first. If the tessellation was made from another scene, the set is left unchanged.
///
/// # Cost
/// Proportional to the budget and to the number of cells reached: about 100 ns per cell and 30 ns per object.
/// The first frame with a tessellation allocates. Later frames do not allocate, whatever the view.
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
    /// True if objects beyond the budget stay in the set, so that the culler only sorts.
    keep_all: bool,
    walk: Walk,
}

impl<S: Deref<Target: Tessellation>> PlpCuller<S> {
    /// Makes a culler that keeps at most `budget` per frame of the objects in `tessellation`'s cells.
    /// Defaults: [`Solidity::Coverage`], back faces count as visible, objects beyond the budget are dropped.
    /// O(1).
    pub fn new(tessellation: S, budget: Budget) -> Self {
        Self { tessellation, settings: PlpSettings::new(budget), keep_all: false, walk: Walk::default() }
    }

    /// Sets the estimate of how likely a cell is hidden, which orders the cells. [`Solidity::Coverage`] by
    /// default.
    #[must_use]
    pub fn with_solidity(mut self, solidity: Solidity) -> Self {
        self.settings.solidity = solidity;
        self
    }

    /// Drops objects of one to four triangles when all their triangles certainly face away from the eye. For
    /// scenes that are drawn with back-face culling and triangles that are anticlockwise seen from the front.
    /// Undecided triangles count as facing the eye.
    #[must_use]
    pub fn with_one_sided(mut self) -> Self {
        self.settings.one_sided = true;
        self
    }

    /// Keeps objects beyond the budget in the set. The culler then only sorts: the objects within the budget
    /// come first, the other objects follow.
    #[must_use]
    pub fn with_all_kept(mut self) -> Self {
        self.keep_all = true;
        self
    }

    /// Returns a mutable reference to the pointer to the tessellation. Call `sync` on the tessellation
    /// through it, or assign a pointer to another tessellation. The next frame uses what the pointer then
    /// points to.
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
            return CullStats::default().with_visible(visible.count(scene) as u64);
        }
        while let Some(cell) = walk.next() {
            if walk.step(&frame, cell) == Projected::OutOfBudget {
                break;
            }
        }
        walk.check_candidates(&frame, false);
        let stats = CullStats::default().with_nodes(walk.projected).with_tests(walk.reached);
        if self.keep_all {
            visible.order_first(scene, &walk.order);
        } else {
            visible.keep_in_order(scene, &walk.order);
        }
        stats.with_visible(visible.count(scene) as u64)
    }

    fn reset(&mut self) {}
}
