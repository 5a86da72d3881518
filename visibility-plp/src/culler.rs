//! The approximate culler: prioritized-layered projection up to a budget.

use crate::cell_frustum::CellFrustum;
use crate::solidity::Solidity;
use crate::tessellation::Tessellation;
use crate::walk::{Budget, FrameContext, PlpSettings, Projected, Walk};
use core::ops::Deref;
use visibility_core::{Accuracy, CullStats, Culler, ObjectId, Scene, View, VisibleSet};

/// Keeps the objects of the visible set that are most likely seen, up to a budget per frame.
///
/// The front is a priority queue of cells that starts with the eye's cell. Each step takes the cell with the
/// least solidity, the estimate of how likely earlier cells hide it, looks up the cell's objects and adds the
/// neighbouring cells to the front. Objects that were looked up are kept in the order of their own priority,
/// once no cell of the front promises a higher one. The frame ends when the budget is spent (Klosowski and
/// Silva, "The Prioritized-Layered Projection Algorithm for Visible Set Estimation", 2000). The set's order
/// afterwards is the order in which objects were kept, most likely visible first. A drawing loop may
/// therefore stop at any object.
///
/// Approximate: hidden objects may be kept and visible objects dropped. With
/// [`with_all_kept`](Self::with_all_kept) the culler only sorts the set and is conservative.
///
/// One culler serves one view. `S` is a reference, `Arc` or `Box` of a tessellation, which several cullers
/// may share. Objects that have changed since the tessellation's last `sync` are in no cell: such objects are
/// kept and come first. If the tessellation was made from another scene, the set is left unchanged.
///
/// # Cost
/// Proportional to the budget and to the number of cells reached: about 100 ns per cell and 400 ns per object
/// kept, since several objects are looked up for each one kept.
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
    /// Makes a culler that keeps the [`Budget`] per frame of the objects in `tessellation`'s cells.
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

    /// Sets the budget of later frames, such as that of a [`Pace`](crate::Pace).
    pub fn set_budget(&mut self, budget: Budget) {
        self.settings.budget = budget;
    }

    /// Returns how much of its [`Budget`] the last frame took: a number of objects, or a sum of costs.
    /// Includes the objects in no cell. 0 before the first frame, and after a frame whose scene the
    /// tessellation was not made from.
    pub fn spent(&self) -> u64 {
        self.walk.spent
    }

    /// Culls like [`cull`](Culler::cull), and asks `keep` before each object is kept: the object and its
    /// priority, about highest first. An object in a cell that is reached later may have a higher priority.
    /// The frame ends when `keep` returns false or the budget is spent; the object for which `keep` returned
    /// false is not kept.
    ///
    /// With a budget of `usize::MAX` objects, `keep` alone decides. It may draw the object and look at a
    /// clock, charge the cost of a level of detail in place of the object's own, or stop at a priority. The
    /// priority is an estimate from 0 to 1 of how likely the object is seen in a pixel or more.
    ///
    /// Objects that are in no cell come first, with the priority 1. They are kept whatever `keep` returns.
    /// `keep` is not called if the tessellation was made from another scene.
    ///
    /// ```
    /// use visibility_core::{glam::DVec3, Aabb, Pose, Scene, View, VisibleSet};
    /// use visibility_plp::{Budget, OctreeTessellation, PlpCuller};
    /// let mut scene = Scene::new();
    /// let box_at = |x: f32| Aabb::from_arrays([x, -1.0, -1.0], [x + 0.5, 1.0, 1.0]);
    /// scene.insert_batch((1..100).map(|i| box_at(i as f32)));
    /// let cells = OctreeTessellation::new(&scene);
    /// let mut plp = PlpCuller::new(&cells, Budget::Objects(usize::MAX));
    /// let view = View::perspective(Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z), 1.0, 1.5, 0.1, 1000.0)?;
    /// let mut visible = VisibleSet::new();
    /// visible.fill(&scene, &view);
    /// // Draws for 2 ms by the engine's own clock, here one that runs 130 us for each object drawn.
    /// let mut microseconds = 0;
    /// plp.cull_while(&scene, &view, &mut visible, |_id, _priority| {
    ///     let is_time_left = microseconds < 2000;
    ///     if is_time_left {
    ///         microseconds += 130; // draws the object
    ///     }
    ///     is_time_left
    /// });
    /// assert_eq!(visible.count(&scene), 16);
    /// # Ok::<(), visibility_core::view::ViewError>(())
    /// ```
    pub fn cull_while(
        &mut self,
        scene: &Scene,
        view: &View,
        visible: &mut VisibleSet,
        mut keep: impl FnMut(ObjectId, f32) -> bool,
    ) -> CullStats {
        let tessellation = &*self.tessellation;
        let frustum = CellFrustum::new(view, scene.origin(), &tessellation.bounds());
        let frame = FrameContext { tessellation, scene, visible, frustum, settings: self.settings };
        let walk = &mut self.walk;
        if !walk.begin(&frame, &mut keep) {
            return CullStats::default().with_visible(visible.count(scene) as u64);
        }
        let mut result = Projected::Complete;
        while result == Projected::Complete
            && let Some(cell) = walk.next()
        {
            result = walk.step(&frame, cell, &mut keep);
        }
        if result == Projected::Complete {
            walk.emit(&frame, 0.0, &mut keep);
        }
        let stats = CullStats::default().with_nodes(walk.projected).with_tests(walk.reached);
        if self.keep_all {
            visible.order_first(scene, &walk.order);
        } else {
            visible.keep_in_order(scene, &walk.order);
        }
        stats.with_visible(visible.count(scene) as u64)
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
        self.cull_while(scene, view, visible, |_, _| true)
    }

    fn reset(&mut self) {}
}
