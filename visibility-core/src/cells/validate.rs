//! Checks that the portals of a graph can bound convex cells.

use super::{CellGraph, CellGraphError, CellId};
use crate::pvs::Viewcell;
use glam::DVec3;

impl CellGraph {
    /// Checks that the portals of each cell can lie on the boundary of one convex body: no vertex of one
    /// portal may be more than `tolerance` metres beyond the plane of another, on the side of that plane away
    /// from the cell. For coordinates read from text with d decimals, `tolerance` should be about 10^-d times
    /// the ratio of the extent of the map to that of its smallest portal, because rounding a small portal's
    /// vertices tilts its plane.
    ///
    /// Visibility through portals is conservative only for a graph whose portals are where its cells have
    /// openings, with normals into their second cells. This check finds many faulty graphs, but not all: a
    /// cell with one portal passes, whichever way the portal is wound. Where the bodies of the cells are
    /// known, [`turn_portals`](Self::turn_portals) winds the portals rightly, and
    /// [`validate_bodies`](Self::validate_bodies) checks that they lie in the faces of the bodies. Time is
    /// proportional to the sum over all cells of the squared number of portals. NaN distances pass.
    ///
    /// # Errors
    /// [`CellGraphError::NotOnBoundary`] for the first cell with such a vertex.
    pub fn validate(&self, tolerance: f64) -> Result<(), CellGraphError> {
        for cell in (0..self.cell_count() as u32).map(CellId) {
            for &behind in self.portals_of(cell) {
                let portal = &self.portals[behind.index()];
                let plane = if portal.cells[1] == cell { portal.plane } else { portal.plane.flipped() };
                for &id in self.portals_of(cell) {
                    let vertices = self.portals[id.index()].polygon.vertices();
                    let distance = vertices.iter().map(|&v| -plane.signed_distance(v)).fold(0.0, f64::max);
                    // A NaN distance, from huge coordinates, does not prove that the cell is wrong.
                    if distance > tolerance {
                        return Err(CellGraphError::NotOnBoundary { cell, portal: id, behind, distance });
                    }
                }
            }
        }
        Ok(())
    }

    /// Checks the portals against the bodies of the cells, in world space; `bodies[i]` is the body of cell
    /// `i`. Each portal must lie in a face of both bodies, up to `tolerance` metres, and its normal must
    /// point into the body of its second cell.
    ///
    /// # Errors
    /// [`CellGraphError::Bodies`] if there is not one body for each cell. For the first faulty portal,
    /// [`CellGraphError::NotOnBody`] if it lies in no face of a body, [`CellGraphError::Normal`] if its
    /// normal points the wrong way.
    ///
    /// ```
    /// use visibility_core::{
    ///     cells::{CellGraph, CellId}, geometry::ConvexPolygon, glam::DVec3, pvs::Viewcell,
    /// };
    /// let room = |x: f64| Viewcell::from_box(DVec3::new(x, 0.0, 0.0), DVec3::new(x + 4.0, 4.0, 3.0));
    /// let corners = [[1.0, 0.0], [2.0, 0.0], [2.0, 2.0], [1.0, 2.0]];
    /// let door = |x: f64| ConvexPolygon::new(corners.map(|[y, z]| DVec3::new(x, y, z))).unwrap();
    /// let graph = |x: f64| CellGraph::new(2, [(door(x), [CellId(0), CellId(1)])]).unwrap();
    /// let check = |x: f64| graph(x).validate_bodies(&[room(0.0), room(4.0)], 1e-6);
    /// assert_eq!(check(4.0), Ok(()));
    /// assert_eq!(check(3.0).unwrap_err().to_string(), "portal 0 is 1 off the boundary of cell 0");
    /// ```
    pub fn validate_bodies(&self, bodies: &[Viewcell], tolerance: f64) -> Result<(), CellGraphError> {
        if bodies.len() != self.cell_count() {
            return Err(CellGraphError::Bodies { cells: self.cell_count(), bodies: bodies.len() });
        }
        for (portal, id) in self.portals.iter().zip((0..).map(super::PortalId)) {
            for (cell, inwards) in portal.cells.into_iter().zip([-portal.plane.normal, portal.plane.normal]) {
                let vertices = portal.polygon.vertices();
                let (mut outside, mut nearest, mut faces_in) = (0.0f64, f64::INFINITY, false);
                for face in bodies[cell.index()].faces(DVec3::ZERO) {
                    let heights = || vertices.iter().map(|&v| face.signed_distance(v));
                    let off = heights().fold(0.0, |off: f64, height| off.max(height.abs()));
                    outside = heights().fold(outside, |outside, height| outside.max(-height));
                    nearest = nearest.min(off);
                    faces_in |= off <= tolerance && face.normal.dot(inwards) > 0.0;
                }
                // The portal reaches beyond a face, or lies inside of all faces.
                let distance = outside.max(nearest);
                if distance > tolerance {
                    return Err(CellGraphError::NotOnBody { portal: id, cell, distance });
                }
                if !faces_in {
                    return Err(CellGraphError::Normal { portal: id, cell });
                }
            }
        }
        Ok(())
    }
}
