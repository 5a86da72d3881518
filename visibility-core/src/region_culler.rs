//! The [`RegionCuller`] trait: visibility from a region, as needed to bake a potentially visible set (PVS).

use crate::{Accuracy, CullStats, Scene, VisibleSet, pvs::Viewcell};

/// Removes from a set of objects those that cannot be seen from any point of a viewcell.
///
/// The from-region counterpart of [`Culler`](crate::Culler), which answers for one point of view. Every point
/// of the viewcell, its boundary included, looks in all directions without near or far plane. One value owns
/// the scratch memory of one thread; several threads use one value each over one `&Scene`.
///
/// ```
/// use visibility_core::glam::DVec3;
/// use visibility_core::{
///     pvs::Viewcell, Aabb, Accuracy, CullStats, Pose, RegionCuller, Scene, View, VisibleSet,
/// };
/// /// Hides objects that are farther away than anything is ever drawn.
/// struct Within(f64);
/// impl RegionCuller for Within {
///     fn accuracy(&self) -> Accuracy { Accuracy::Approximate }
///     fn cull(&mut self, scene: &Scene, cell: &Viewcell, visible: &mut VisibleSet) -> CullStats {
///         let origin = scene.origin();
///         visible.retain(scene, |_, bounds| {
///             let (min, max) = (bounds.min.as_dvec3() + origin, bounds.max.as_dvec3() + origin);
///             (min - cell.max).max(cell.min - max).max(DVec3::ZERO).length() <= self.0
///         })
///     }
/// }
/// let mut scene = Scene::new();
/// let near = scene.insert(Aabb::from_arrays([5.0, 0.0, 0.0], [6.0, 1.0, 1.0]));
/// let far = scene.insert(Aabb::from_arrays([500.0, 0.0, 0.0], [501.0, 1.0, 1.0]));
/// let mut visible = VisibleSet::new();
/// // All objects on the layers of a view. `fill` reads only the layers of the view.
/// let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
/// visible.fill(&scene, &View::perspective(pose, 1.0, 1.0, 0.1, 10.0)?);
/// Within(100.0).cull(&scene, &Viewcell::from_box(DVec3::ZERO, DVec3::ONE), &mut visible);
/// assert!(visible.contains(&scene, near) && !visible.contains(&scene, far));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait RegionCuller {
    /// Returns the accuracy that the culler guarantees with its present settings. Conservative means that an
    /// object stays if an unobstructed segment runs to it from some point of the viewcell.
    fn accuracy(&self) -> Accuracy;

    /// Removes from `visible`, which holds the candidates, the objects that this culler finds hidden from all
    /// of `cell`. From an empty viewcell nothing is visible; any result is then valid. Returns counters of
    /// the work done.
    fn cull(&mut self, scene: &Scene, cell: &Viewcell, visible: &mut VisibleSet) -> CullStats;
}
