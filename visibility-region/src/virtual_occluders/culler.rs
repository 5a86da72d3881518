//! `VirtualSweepCuller`: culls a viewcell with its virtual occluders alone, which shows how much of a sweep's
//! occlusion a few rectangles keep.

use super::VirtualOccluders;
use crate::ExtendedProjectionCuller;
use crate::remove::remove_hidden;
use crate::solids::occluding;
use crate::sweep::cell_extent::CellExtent;
use visibility_core::occlusion::Occlusion;
use visibility_core::pvs::Viewcell;
use visibility_core::{Accuracy, CullStats, OcclusionMap, RegionCuller, Scene, VisibleSet};

/// Removes objects that the [`VirtualOccluders`] of a viewcell hide from all of it. Conservative.
///
/// An object that the sweep of [`ExtendedProjectionCuller`] hides is found visible here if no single virtual
/// occluder hides it. Hides nothing if an occluder of the scene is no candidate, since the virtual occluders
/// stand for all occluders.
///
/// ```
/// use visibility_core::{glam::{Affine3A, DVec3}, pvs::Viewcell};
/// use visibility_core::{Aabb, Object, OccluderMesh, RegionCuller, Scene, VisibleSet};
/// use visibility_region::VirtualSweepCuller;
/// let wall = Aabb::from_arrays([5.0, -9.0, -9.0], [5.2, 9.0, 9.0]);
/// let mut scene = Scene::new();
/// let id = scene.insert(Object { occluder: true, ..Object::new(wall) });
/// let mesh = scene.add_mesh(OccluderMesh::cuboid(&wall)?);
/// scene.set_mesh(id, mesh, Affine3A::IDENTITY)?;
/// let post = scene.insert(Aabb::from_arrays([20.0, 0.0, 0.0], [20.5, 0.5, 1.0]));
/// let mut visible = VisibleSet::new();
/// let mut culler = VirtualSweepCuller::new();
/// culler.cull(&scene, &Viewcell::from_box(DVec3::ZERO, DVec3::ONE), &mut visible);
/// assert!(!visible.contains(&scene, post));
/// assert_eq!(culler.last().map(|last| last.occluders().len()), Some(1));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct VirtualSweepCuller {
    sweep: ExtendedProjectionCuller,
    last: Option<VirtualOccluders>,
    most: usize,
}

impl Default for VirtualSweepCuller {
    fn default() -> Self {
        Self::new()
    }
}

impl VirtualSweepCuller {
    /// Makes a culler with at most [`VirtualOccluders::MAX`] virtual occluders for each viewcell.
    pub fn new() -> Self {
        Self { sweep: ExtendedProjectionCuller::new(), last: None, most: VirtualOccluders::MAX }
    }

    /// Sets the greatest number of virtual occluders for each viewcell. Numbers above
    /// [`VirtualOccluders::MAX`] count as that.
    #[must_use]
    pub fn with_max(mut self, most: usize) -> Self {
        self.most = most;
        self
    }

    /// Returns the virtual occluders of the last call. `None` before the first call.
    pub fn last(&self) -> Option<&VirtualOccluders> {
        self.last.as_ref()
    }
}

impl RegionCuller for VirtualSweepCuller {
    /// Returns [`Accuracy::Conservative`].
    fn accuracy(&self) -> Accuracy {
        Accuracy::Conservative
    }

    fn cull(&mut self, scene: &Scene, cell: &Viewcell, visible: &mut VisibleSet) -> CullStats {
        let mut map = self.sweep.virtual_occluders(scene, cell);
        map.occluders.truncate(self.most);
        if map.occluding.is_subset(&occluding(scene, visible))
            && let Some(start) = CellExtent::new(cell, scene.origin())
        {
            map.activate(&start, scene.origin());
        }
        let stats = remove_hidden(scene, visible, &[], Some(&|b| map.test(b) == Occlusion::Hidden));
        map.active.clear();
        self.last = Some(map);
        stats
    }
}
