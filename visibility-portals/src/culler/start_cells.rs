//! The cells in which lines of sight begin: those that the front of the view (near plane and clip planes)
//! reaches into. One, as a rule; several where the front crosses a portal.

use super::scene_cells::SceneCells;
use alloc::vec::Vec;
use visibility_core::glam::DVec3;
use visibility_core::{View, cells::CellId, pvs::ViewcellId};

/// Memory for finding the cells in which lines of sight begin.
#[derive(Clone, Debug, Default)]
pub(super) struct StartCells {
    touching: Vec<ViewcellId>,
}

impl StartCells {
    /// Calls `each` with the cells that lines of sight begin in, some maybe more than once. False if some
    /// begin in no cell, or if it cannot be told where. Points are taken relative to `anchor`, a point of the
    /// world.
    pub(super) fn find(
        &mut self,
        cells: &SceneCells,
        view: &View,
        anchor: DVec3,
        mut each: impl FnMut(CellId),
    ) -> bool {
        let mut covered = true;
        let known = view.for_each_sight_start(anchor, |corners, error| {
            let margin = cells.tolerance + error;
            covered &= cells.viewcells.reached(corners, anchor, margin, &mut self.touching);
            self.touching.iter().for_each(|&viewcell| each(CellId(viewcell.0)));
        });
        known && covered
    }
}
