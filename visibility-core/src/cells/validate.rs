//! Whether portals can bound convex cells.

use super::{CellGraph, CellGraphError, CellId};

impl CellGraph {
    /// Checks that the portals of each cell can lie on the boundary of one convex body: each is on the inner side of all others, up to
    /// `tolerance` in the world's units (text with d decimals needs about 10^-d times the extent of the map over that of its smallest
    /// portal).
    ///
    /// Visibility through portals is conservative whether or not this holds; it is a check of whoever made the cells. Takes time in
    /// proportion to the sum over cells of their portals, squared.
    ///
    /// # Errors
    /// [`CellGraphError::NotOnBoundary`], for the first such cell.
    pub fn validate(&self, tolerance: f64) -> Result<(), CellGraphError> {
        for cell in (0..self.cell_count() as u32).map(CellId) {
            for &behind in self.portals_of(cell) {
                let portal = &self.portals[behind.index()];
                let plane = if portal.cells[1] == cell { portal.plane } else { portal.plane.flipped() };
                for &id in self.portals_of(cell) {
                    let vertices = self.portals[id.index()].polygon.vertices();
                    let distance = vertices.iter().map(|&v| -plane.signed_distance(v)).fold(0.0, f64::max);
                    // Coordinates so large that distances are no numbers are not a proof that the cell is wrong.
                    if distance > tolerance {
                        return Err(CellGraphError::NotOnBoundary { cell, portal: id, behind, distance });
                    }
                }
            }
        }
        Ok(())
    }
}
