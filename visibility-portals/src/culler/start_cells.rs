//! The cells in which lines of sight begin: the cells that contain part of the front of the view, which is
//! the near plane and the clip planes. Usually one cell; several where the front crosses a portal.

use super::scene_cells::SceneCells;
use alloc::vec::Vec;
use visibility_core::glam::DVec3;
use visibility_core::view::ViewRegion;
use visibility_core::{View, cells::CellId, pvs::ViewcellId};

/// Scratch memory for finding the cells in which lines of sight begin.
#[derive(Clone, Debug, Default)]
pub(super) struct StartCells {
    touching: Vec<ViewcellId>,
    /// Cells beyond a face that crosses a ball.
    beyond: Vec<ViewcellId>,
}

impl StartCells {
    /// Calls `each` with every cell in which lines of sight begin; a cell may be passed more than once.
    /// Returns `false` if some lines of sight begin outside all cells, or if the start points cannot be
    /// computed: `each` may then not have been called with all such cells. Computes relative to `anchor`, a
    /// point in world space.
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

    /// As [`find`](Self::find), for all views of a region: with every cell that reaches into the ball in
    /// which their lines of sight begin, around `anchor`.
    pub(super) fn find_around(
        &mut self,
        cells: &SceneCells,
        region: &ViewRegion,
        anchor: DVec3,
        mut each: impl FnMut(CellId),
    ) -> bool {
        let Self { touching, beyond } = self;
        let (radius, error) = (region.start_radius(), cells.tolerance);
        let covered = cells.viewcells.reached_by_ball(anchor, radius, error, beyond, touching);
        self.touching.iter().for_each(|&viewcell| each(CellId(viewcell.0)));
        covered
    }
}
