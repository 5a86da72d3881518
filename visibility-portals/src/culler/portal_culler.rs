//! The portal culler of a pipeline.

use super::portal_eye::PortalEye;
use super::scene_cells::SceneCells;
use visibility_core::{
    Accuracy, CullStats, Culler, Scene, View, VisibleSet, culler::Lack, jobs::Jobs, stamp::Stamp,
    view::ViewRegion,
};

/// Removes objects that cannot be seen through open portals: a [`PortalEye`] with [`SceneCells`] of its own.
/// Conservative.
///
/// Runs after a [`FrustumCuller`](visibility_core::FrustumCuller). Each call of `cull` first updates the
/// cells by the changes of the scene. A [`Pipeline`](visibility_core::Pipeline) owns its stages, so doors
/// cannot be opened from outside: where doors move, or several views share cells, use a `SharedPortalCuller`
/// (feature `std`). Where [reflections](PortalEye::reflections) in mirrors are drawn, keep one `SceneCells`,
/// and one `PortalEye` per view.
///
/// With [`VisibleSet::with_changes`] the visible set lists which objects became visible or hidden since the
/// frame before:
///
/// ```
/// use visibility_core::glam::DVec3;
/// use visibility_core::{
///     cells::{CellGraph, CellId, PortalId}, geometry::ConvexPolygon, Aabb, Culler, FrustumCuller,
///     Pose,
/// };
/// use visibility_core::{pvs::{Viewcell, Viewcells}, Scene, View, VisibleSet};
/// use visibility_portals::{PortalCuller, SceneCells};
/// let corners = [[4.0, 1.0, 0.0], [4.0, 3.0, 0.0], [4.0, 3.0, 2.0], [4.0, 1.0, 2.0]];
/// let door = ConvexPolygon::new(corners.map(DVec3::from))?;
/// let graph = CellGraph::new(2, [(door, [CellId(0), CellId(1)])])?;
/// let room = |x: f64| Viewcell::from_box(DVec3::new(x, 0.0, 0.0), DVec3::new(x + 4.0, 4.0, 3.0));
/// let cells = SceneCells::new(graph, Viewcells::new([room(0.0), room(4.0)]), 1e-6)?;
/// let mut scene = Scene::new();
/// let table = scene.insert(Aabb::from_arrays([5.0, 1.5, 0.0], [7.0, 2.5, 1.0]));
/// let corner = scene.insert(Aabb::from_arrays([4.2, 3.5, 0.0], [4.6, 3.9, 1.0]));
/// let pose = Pose::look_at(DVec3::new(1.0, 2.0, 1.5), DVec3::new(5.0, 2.0, 1.0), DVec3::Z);
/// let view = View::perspective(pose, 1.0, 1.5, 0.1, 100.0)?;
///
/// let (mut frustum, mut portals) = (FrustumCuller::new(), PortalCuller::new(cells));
/// let mut visible = VisibleSet::new().with_changes();
/// let mut told = Vec::new();
/// for open in [true, false, true] {
///     portals.cells_mut().set_open(PortalId(0), open)?;
///     visible.fill(&scene, &view);
///     frustum.cull(&scene, &view, &mut visible);
///     portals.cull(&scene, &view, &mut visible);
///     visible.finish(&scene);
///     // The callbacks: a guard who hears of what he sees.
///     told.extend(visible.newly_visible().map(|id| (id, "seen")));
///     told.extend(visible.newly_hidden().map(|id| (id, "gone")));
/// }
/// assert_eq!(told, [(table, "seen"), (table, "gone"), (table, "seen")]);
/// assert!(!visible.contains(&scene, corner), "in view, but beside the door");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct PortalCuller {
    cells: SceneCells,
    eye: PortalEye,
    /// Stamp of the cells that the last answer for a region was made from.
    region_cells: Stamp,
}

impl PortalCuller {
    /// Returns a culler for one view, with the default [settings](PortalEye::new).
    pub fn new(cells: SceneCells) -> Self {
        Self { cells, eye: PortalEye::new(), region_cells: Stamp::NONE }
    }

    /// Returns the culler with `eye` in place of its own eye; the cells are kept. `eye` brings its settings
    /// and its state of the last frame.
    #[must_use]
    pub fn with_eye(self, eye: PortalEye) -> Self {
        Self { eye, ..self }
    }

    /// Returns the cells, to query which objects they hold and which doors are open.
    pub fn cells(&self) -> &SceneCells {
        &self.cells
    }

    /// Returns a mutable reference to the cells: to open and close doors, to add and cover mirrors, or to
    /// assign other cells. The next `cull` detects the change.
    pub fn cells_mut(&mut self) -> &mut SceneCells {
        &mut self.cells
    }

    /// Returns the eye, to query the results of the last frame.
    pub fn eye(&self) -> &PortalEye {
        &self.eye
    }
}

impl Culler for PortalCuller {
    fn name(&self) -> &str {
        "portals"
    }

    fn accuracy(&self) -> Accuracy {
        if self.cells.is_pvs_checked() { Accuracy::Conservative } else { Accuracy::Approximate }
    }

    fn hides_behind_undrawn(&self) -> bool {
        true
    }

    fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats {
        self.cells.sync(scene);
        self.eye.cull(&self.cells, scene, view, visible)
    }

    fn cull_region(
        &mut self,
        _jobs: Option<&dyn Jobs>,
        scene: &Scene,
        region: &ViewRegion,
        visible: &mut VisibleSet,
    ) -> Option<CullStats> {
        self.cells.sync(scene);
        self.region_cells = self.cells.stamp();
        self.eye.cull_region(&self.cells, scene, region, visible)
    }

    fn answer_holds(&self) -> bool {
        self.region_cells == self.cells.stamp()
    }

    fn reset(&mut self) {
        self.eye.reset();
    }

    fn for_each_lack(&self, scene: &Scene, each: &mut dyn FnMut(Lack)) {
        self.eye.for_each_lack(&self.cells, scene, each);
    }
}
