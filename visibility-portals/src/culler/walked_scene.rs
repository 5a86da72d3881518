//! The test of objects against the windows (views through chains of portals) of a walk.

use super::portal_walk::PortalWalk;
use super::scene_cells::SceneCells;
use super::view_planes::PortalView;
use visibility_core::{CullStats, Scene, VisibleSet};

/// A finished walk, with the cells, the scene and the view that it was made for.
pub(super) struct WalkedScene<'a> {
    pub(super) cells: &'a SceneCells,
    pub(super) scene: &'a Scene,
    pub(super) walk: &'a PortalWalk,
    pub(super) eye_view: &'a PortalView,
}

impl WalkedScene<'_> {
    /// Removes from `visible` the objects whose bounds lie outside all windows of all cells that they belong
    /// to. Undecided objects stay, and so do objects in no cell, and objects that changed since the cells
    /// were synced: those whose entry in `unknown`, by object index, equals `frame`. Adds the number of
    /// windows tested to `tests`.
    pub(super) fn retain(
        &self,
        unknown: &[u64],
        frame: u64,
        visible: &mut VisibleSet,
        tests: &mut u64,
    ) -> CullStats {
        let origin = self.scene.origin() - self.eye_view.anchor;
        // Converting a box to anchor-relative coordinates rounds the difference of the origins, and then each
        // corner. The error of the eye is added to the box.
        let size = self.scene.origin().abs().max_element() + self.eye_view.anchor.abs().max_element();
        let error = self.eye_view.error + 4.0 * f64::EPSILON * size;
        visible.retain(self.scene, |id, bounds| {
            if unknown.get(id.index()) == Some(&frame) {
                return true;
            }
            let of = self.cells.cells_of(id);
            let (min, max) = (bounds.min.as_dvec3() + origin, bounds.max.as_dvec3() + origin);
            let error = error + f64::EPSILON * min.abs().max(max.abs()).max_element();
            of.is_empty() || of.iter().any(|&cell| self.walk.shows(cell, min, max, error, tests))
        })
    }
}
