//! Where lines of sight begin: in the cells that the front of the view is in.
//!
//! Where the front lies in one cell, as it nearly always does, that is the cell; where it lies across a
//! portal, it is several. Where part of it is in no cell, nothing is known of what is seen from there.

use super::scene_cells::SceneCells;
use alloc::vec::Vec;
use visibility_core::glam::DVec3;
use visibility_core::{CellId, View, ViewcellId};

/// Memory for finding the cells of a front.
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
