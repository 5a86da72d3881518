//! A portal culler whose cells other views and the game share.

use super::portal_eye::PortalEye;
use super::scene_cells::SceneCells;
use std::sync::{Arc, RwLock};
use visibility_core::{
    Accuracy, CullStats, Culler, Scene, View, VisibleSet, culler::Lack, jobs::Jobs, stamp::Stamp,
    view::ViewRegion,
};

/// Removes objects that cannot be seen through open portals, as [`PortalCuller`](super::PortalCuller) does:
/// one [`PortalEye`], with cells behind a lock. Several views can use the same cells, on any number of
/// threads, while the game keeps a handle to the cells, to open and close doors between frames. Conservative.
///
/// Culling locks the cells for reading, and for writing only in the first frame after the scene has changed,
/// to sync them. A thread that holds the lock itself while it culls deadlocks. If a panic has poisoned the
/// lock, nothing is hidden any more.
///
/// ```
/// use std::sync::{Arc, RwLock};
/// use visibility_core::cells::{CellGraph, CellId, PortalId};
/// use visibility_core::geometry::ConvexPolygon;
/// use visibility_core::glam::DVec3;
/// use visibility_core::pvs::{Viewcell, Viewcells};
/// use visibility_core::{Aabb, FrustumCuller, Pipeline, Pose, Scene, View, VisibleSet};
/// use visibility_portals::{SceneCells, SharedPortalCuller};
/// let corners = [[4.0, 1.0, 0.0], [4.0, 3.0, 0.0], [4.0, 3.0, 2.0], [4.0, 1.0, 2.0]];
/// let door = ConvexPolygon::new(corners.map(DVec3::from))?;
/// let graph = CellGraph::new(2, [(door, [CellId(0), CellId(1)])])?;
/// let room = |x: f64| Viewcell::from_box(DVec3::new(x, 0.0, 0.0), DVec3::new(x + 4.0, 4.0, 3.0));
/// let cells = SceneCells::new(graph, Viewcells::new([room(0.0), room(4.0)]), 1e-6)?;
/// let cells = Arc::new(RwLock::new(cells));
/// let mut scene = Scene::new();
/// let table = scene.insert(Aabb::from_arrays([5.0, 1.5, 0.0], [7.0, 2.5, 1.0]));
///
/// let eye = |cells: &Arc<_>| SharedPortalCuller::new(Arc::clone(cells));
/// let mut pipelines = [0, 1].map(|_| Pipeline::new().with(FrustumCuller::new()).with(eye(&cells)));
/// let to = DVec3::new(5.0, 2.0, 1.0);
/// let views = [1.8, 2.2].map(|y| Pose::look_at(DVec3::new(1.0, y, 1.5), to, DVec3::Z));
/// let mut visible = VisibleSet::new();
/// for open in [true, false] {
///     cells.write().unwrap().set_open(PortalId(0), open)?;
///     for (pipeline, pose) in pipelines.iter_mut().zip(views) {
///         pipeline.cull(&scene, &View::perspective(pose, 1.0, 1.5, 0.1, 100.0)?, &mut visible);
///         assert_eq!(visible.contains(&scene, table), open);
///     }
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct SharedPortalCuller {
    cells: Arc<RwLock<SceneCells>>,
    eye: PortalEye,
    /// Stamp of the cells that the last answer for a region was made from.
    region_cells: Stamp,
}

impl SharedPortalCuller {
    /// Returns a culler for one view, with the default [settings](PortalEye::new).
    pub fn new(cells: Arc<RwLock<SceneCells>>) -> Self {
        Self { cells, eye: PortalEye::new(), region_cells: Stamp::NONE }
    }

    /// Returns the culler with `eye` in place of its own eye. `eye` brings its settings and its state of the
    /// last frame.
    #[must_use]
    pub fn with_eye(self, eye: PortalEye) -> Self {
        Self { eye, ..self }
    }

    /// Returns the cells, which other cullers may share.
    pub fn cells(&self) -> &Arc<RwLock<SceneCells>> {
        &self.cells
    }

    /// Returns the eye, to query the results of the last frame.
    pub fn eye(&self) -> &PortalEye {
        &self.eye
    }

    /// Removes from the reflections of the last frame what `culler` removes in their views: see
    /// [`PortalEye::cull_reflections`].
    pub fn cull_reflections(&mut self, scene: &Scene, culler: &mut dyn Culler) {
        self.eye.cull_reflections(scene, culler);
    }
}

impl Culler for SharedPortalCuller {
    fn name(&self) -> &str {
        "portals"
    }

    fn accuracy(&self) -> Accuracy {
        match self.cells.read() {
            Ok(cells) if !cells.is_pvs_checked() => Accuracy::Approximate,
            _ => Accuracy::Conservative,
        }
    }

    fn hides_behind_undrawn(&self) -> bool {
        true
    }

    fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats {
        let Self { cells, eye, .. } = self;
        for _ in 0..2 {
            let Ok(read) = cells.read() else { break };
            if read.is_synced(scene) {
                return eye.cull(&read, scene, view, visible);
            }
            drop(read);
            let Ok(mut write) = cells.write() else { break };
            write.sync(scene);
        }
        // Between two syncs, other views have twice used the cells with another scene or a changed one, or
        // the lock is poisoned.
        let Ok(mut write) = cells.write() else {
            return visible.retain(scene, |_, _| true);
        };
        write.sync(scene);
        eye.cull(&write, scene, view, visible)
    }

    fn cull_region(
        &mut self,
        _jobs: Option<&dyn Jobs>,
        scene: &Scene,
        region: &ViewRegion,
        visible: &mut VisibleSet,
    ) -> Option<CullStats> {
        let Self { cells, eye, region_cells } = self;
        if let Ok(read) = cells.read()
            && read.is_synced(scene)
        {
            *region_cells = read.stamp();
            return eye.cull_region(&read, scene, region, visible);
        }
        let mut write = cells.write().ok()?;
        write.sync(scene);
        *region_cells = write.stamp();
        eye.cull_region(&write, scene, region, visible)
    }

    /// Whether no door has moved since the last answer, nor anything else of the cells changed.
    fn answer_holds(&self) -> bool {
        self.cells.read().is_ok_and(|cells| cells.stamp() == self.region_cells)
    }

    fn for_each_lack(&self, scene: &Scene, each: &mut dyn FnMut(Lack)) {
        match self.cells.read() {
            Ok(cells) => self.eye.for_each_lack(&cells, scene, each),
            Err(_) => {
                each(Lack { what: "objects not culled, a panic having left the cells", count: scene.len() })
            }
        }
    }

    fn reset(&mut self) {
        self.eye.reset();
    }
}
