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

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec;
    use visibility_core::cells::CellGraph;
    use visibility_core::glam::DMat4;
    use visibility_core::pvs::{Viewcell, Viewcells};
    use visibility_core::view::Depth;

    /// Returns the cells that lie west and east of `x`.
    fn beside(x: f64, tolerance: f64) -> SceneCells {
        let cell =
            |low: f64, high: f64| Viewcell::from_box(DVec3::new(low, -1e6, -1e6), DVec3::new(high, 1e6, 1e6));
        let viewcells = Viewcells::new([cell(-1e6, x), cell(x, 1e6)]);
        SceneCells::new(CellGraph::new(2, []).unwrap(), viewcells, tolerance).unwrap()
    }

    /// Returns the cells in which lines of sight of the view begin, ascending.
    fn found(cells: &SceneCells, view: &View, anchor: DVec3) -> Vec<CellId> {
        let mut found = vec![];
        let is_known = StartCells::default().find(cells, view, anchor, |cell| found.push(cell));
        assert!(is_known, "lines of sight begin in cells");
        found.sort_unstable();
        found.dedup();
        found
    }

    /// Lines of sight may begin in a cell that is nearer than the tolerance of cells and the error of where
    /// they begin, which is large for a matrix whose planes are nearly parallel.
    #[test]
    fn cells_within_the_errors_of_the_near_plane_are_begun_in() {
        // Clip x, y and w are x, y, and the sum of x, y and a small part of z.
        let w = DVec3::new(1.0, 1.0, 1e-4);
        let rows =
            [DVec3::X.extend(-3e3), DVec3::Y.extend(-5e3), (w * 0.5).extend(-4e3), w.extend(-8e3 - 1e-4)];
        let matrix = DMat4::from_cols(rows[0], rows[1], rows[2], rows[3]).transpose();
        let view = View::from_clip_from_world(matrix, Depth::NegativeOneToOne).unwrap();
        let anchor = DVec3::new(3e3, 5e3, 1.0);
        let (mut east, mut error) = (f64::NEG_INFINITY, 0.0);
        let is_known = view.for_each_sight_start(anchor, |corners, of_corners| {
            east = corners.iter().fold(east, |east, at| east.max(anchor.x + at.x));
            error = of_corners;
        });
        assert!(is_known && error > 1e-9, "{error}, the error of the polygon in which lines begin");
        for tolerance in [0.0, error] {
            let within = 0.9 * (tolerance + error);
            assert_eq!(
                found(&beside(east + within, tolerance), &view, anchor).len(),
                2,
                "cells within {within}"
            );
            let beyond = 3.0 * (tolerance + error);
            assert_eq!(found(&beside(east + beyond, tolerance), &view, anchor).len(), 1, "cells at {beyond}");
        }
    }

    /// Lines of sight that begin outside all cells, or at an unknown place, are told.
    #[test]
    fn lines_that_begin_outside_or_anywhere_are_told() {
        use visibility_core::{Pose, geometry::Plane};
        let at = |x: f64| {
            let pose = Pose::look_at(DVec3::new(x, 0.0, 0.0), DVec3::new(x + 1.0, 0.0, 0.0), DVec3::Z);
            View::perspective(pose, 1.0, 1.0, 0.1, 9.0).unwrap()
        };
        // Lines to one side never meet the plane behind which they would begin.
        let anywhere = at(0.0).with_clip_planes(&[Plane::new(DVec3::Y, -5.0)]).unwrap();
        for (what, view, is_known) in
            [("inside", at(0.0), true), ("outside", at(2e6), false), ("anywhere", anywhere, false)]
        {
            let found = StartCells::default().find(&beside(1.0, 0.0), &view, DVec3::ZERO, |_| {});
            assert_eq!(found, is_known, "lines of sight that begin {what}");
        }
    }

    /// The cells of a region are those within the tolerance of the ball in which lines of sight begin.
    #[test]
    fn cells_within_the_tolerance_of_a_ball_are_begun_in() {
        use visibility_core::{Pose, view::Reach};
        let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
        let view = View::perspective(pose, 1.0, 1.0, 0.1, 9.0).unwrap();
        let region = ViewRegion::around(&view, Reach::new(0.5, 0.1)).unwrap();
        for (by, count) in [(0.09, 2), (0.11, 1)] {
            let (cells, mut found) = (beside(region.start_radius() + by, 0.1), vec![]);
            let each = |cell| found.push(cell);
            let is_covered = StartCells::default().find_around(&cells, &region, DVec3::ZERO, each);
            assert_eq!((is_covered, found.len()), (true, count), "cells {by} beside the ball");
        }
    }
}
