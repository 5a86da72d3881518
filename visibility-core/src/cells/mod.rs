//! Cells and portals: convex rooms, and the openings between rooms.
//!
//! A [`CellGraph`] divides the walkable space into convex cells. The boundary of a cell is opaque, except for
//! its portals: convex polygons, each of which the cell shares with one other cell. A line of sight leaves a
//! cell only through portals, so the portals are all that visibility needs to know of the walls (Airey,
//! "Increasing Update Rates in the Building Walkthrough System", 1990; Teller and Sequin, "Visibility
//! Preprocessing for Interactive Walkthroughs", 1991; Durand's survey, chapter 5, section 7).
//!
//! # Conventions
//! Coordinates are `f64` metres in world space. The vertices of a portal run counter-clockwise as seen from
//! the second of its two cells; its normal points into the second cell. Cells and portals are numbered from 0
//! in the order given.

mod error;
mod ids;
mod leak;
mod turn;
mod validate;

pub use error::CellGraphError;
pub use ids::{CellId, PortalId};
pub use leak::Leak;

use crate::{
    ObjectId,
    binary_format::Fingerprint,
    geometry::{ConvexPolygon, Plane},
    stamp::Stamp,
};
use alloc::vec::Vec;
use glam::DVec3;

/// A portal: an opening between two cells, as a convex polygon in world space.
#[derive(Clone, PartialEq, Debug)]
pub struct Portal {
    polygon: ConvexPolygon,
    cells: [CellId; 2],
    plane: Plane,
}

impl Portal {
    /// Returns the polygon in world space, with vertices counter-clockwise as seen from the second cell.
    pub fn polygon(&self) -> &ConvexPolygon {
        &self.polygon
    }

    /// Returns the two cells that the portal joins. Its normal points from the first into the second.
    pub fn cells(&self) -> [CellId; 2] {
        self.cells
    }

    /// Returns the cell on the opposite side of the portal from `cell`. Returns the first cell if the portal
    /// does not join `cell`.
    pub fn other(&self, cell: CellId) -> CellId {
        if self.cells[0] == cell { self.cells[1] } else { self.cells[0] }
    }

    /// Returns the plane fitted to the polygon, in world space. Its unit normal points into the second cell.
    pub fn plane(&self) -> Plane {
        self.plane
    }
}

/// A graph of convex cells and the portals that join them, with a list of objects for each cell.
///
/// ```
/// use visibility_core::{cells::{CellGraph, CellId}, geometry::ConvexPolygon, glam::DVec3};
/// // Two rooms side by side along x, with a door at x = 4; its normal, +x, points into the second room.
/// let corners = [[4.0, 1.0, 0.0], [4.0, 2.0, 0.0], [4.0, 2.0, 2.0], [4.0, 1.0, 2.0]];
/// let door = ConvexPolygon::new(corners.map(DVec3::from))?;
/// let graph = CellGraph::new(2, [(door, [CellId(0), CellId(1)])])?;
/// assert_eq!(graph.portals_of(CellId(1)).len(), 1);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct CellGraph {
    stamp: Stamp,
    portals: Vec<Portal>,
    /// CSR offsets into `of_cells`: the portals of cell `i` are `first[i]..first[i + 1]`. One entry more
    /// than cells; empty in the default graph.
    first: Vec<u32>,
    of_cells: Vec<PortalId>,
    /// CSR offsets into `objects`: the objects of cell `i` are `first_object[i]..first_object[i + 1]`.
    first_object: Vec<u32>,
    objects: Vec<ObjectId>,
}

impl CellGraph {
    /// Greatest number of cells in a graph, and also of portals.
    pub const LIMIT: usize = 1 << 20;

    /// Makes a graph of `cells` cells from its portals. Each portal is a polygon with the two cells that it
    /// joins; the polygon's normal points into the second. Object lists are empty. Time and memory are linear
    /// in the numbers of cells and portals.
    ///
    /// This function does not check whether the portals of a cell can bound a convex body, nor which way they
    /// are wound: see [`turn_portals`](Self::turn_portals), [`validate_bodies`](Self::validate_bodies) and,
    /// for cells without bodies, [`validate`](Self::validate).
    ///
    /// # Errors
    /// [`CellGraphError::TooMany`] for more than [`LIMIT`](Self::LIMIT) cells or portals. For the first
    /// faulty portal, [`CellGraphError::UnknownCell`] if it joins a cell that does not exist,
    /// [`CellGraphError::SameCell`] if it joins a cell to itself, [`CellGraphError::NoPlane`] if it has no
    /// area.
    pub fn new(
        cells: usize,
        portals: impl IntoIterator<Item = (ConvexPolygon, [CellId; 2])>,
    ) -> Result<Self, CellGraphError> {
        if cells > Self::LIMIT {
            return Err(CellGraphError::TooMany { what: "cells", count: cells });
        }
        let mut all = Vec::new();
        let mut first = alloc::vec![0u32; cells + 1];
        for (index, (polygon, ends)) in portals.into_iter().enumerate() {
            let portal = PortalId(index as u32);
            if index >= Self::LIMIT {
                return Err(CellGraphError::TooMany { what: "portals", count: index + 1 });
            }
            if let Some(&cell) = ends.iter().find(|cell| cell.index() >= cells) {
                return Err(CellGraphError::UnknownCell { portal, cell, cells });
            }
            if ends[0] == ends[1] {
                return Err(CellGraphError::SameCell { portal, cell: ends[0] });
            }
            let plane = polygon.plane().ok_or(CellGraphError::NoPlane { portal })?;
            ends.iter().for_each(|cell| first[cell.index()] += 1);
            all.push(Portal { polygon, cells: ends, plane });
        }
        // Prefix sums turn each cell's portal count into the end of its list. Filling every list from its end
        // then lowers the ends to starts, and leaves the portals of each cell in ascending order.
        let mut sum = 0;
        for count in &mut first {
            sum += *count;
            *count = sum;
        }
        let mut of_cells = alloc::vec![PortalId(0); sum as usize];
        for (index, portal) in all.iter().enumerate().rev() {
            for cell in portal.cells {
                first[cell.index()] -= 1;
                of_cells[first[cell.index()] as usize] = PortalId(index as u32);
            }
        }
        Ok(Self {
            stamp: Stamp::new(),
            portals: all,
            first,
            of_cells,
            first_object: alloc::vec![0; cells + 1],
            objects: Vec::new(),
        })
    }

    /// Returns the version of the graph: a hash of the number of cells, and of the cells and the vertices of
    /// each portal, but not of objects. A [`Pvs`](crate::pvs::Pvs) whose targets are the cells of this graph
    /// stores the version as its [source](crate::pvs::Pvs::source). Time is linear in the number of vertices.
    pub fn version(&self) -> u64 {
        let mut hash = Fingerprint::new().with_u64(self.cell_count() as u64);
        for portal in &self.portals {
            let vertices = portal.polygon.vertices();
            hash = portal.cells.iter().fold(hash, |hash, cell| hash.with(cell.0)).with(vertices.len() as u32);
            let numbers = vertices.iter().flat_map(|v| v.to_array()).map(f64::to_bits);
            hash = numbers.fold(hash, Fingerprint::with_u64);
        }
        hash.value()
    }

    /// Like [`new`](Self::new), with each portal given by its vertices in order around its boundary.
    ///
    /// # Errors
    /// [`CellGraphError::Polygon`] for the first portal that is not a planar convex polygon up to
    /// [`ConvexPolygon::TOLERANCE`]; otherwise the errors of `new`.
    pub fn from_vertices<V: IntoIterator<Item = DVec3>>(
        cells: usize,
        portals: impl IntoIterator<Item = (V, [CellId; 2])>,
    ) -> Result<Self, CellGraphError> {
        let mut all = Vec::new();
        for (portal, (vertices, ends)) in (0..).map(PortalId).zip(portals) {
            let polygon =
                ConvexPolygon::new(vertices).map_err(|error| CellGraphError::Polygon { portal, error })?;
            all.push((polygon, ends));
        }
        Self::new(cells, all)
    }

    /// Returns the stamp that identifies the cells, portals and object lists of the graph.
    /// [`set_objects`](Self::set_objects) assigns a new stamp. A clone of the graph has the same stamp until
    /// the clone or the original changes.
    pub fn stamp(&self) -> Stamp {
        self.stamp
    }

    /// Returns the number of cells.
    pub fn cell_count(&self) -> usize {
        self.first.len().saturating_sub(1)
    }

    /// Returns all portals, indexed by [`PortalId`].
    pub fn portals(&self) -> &[Portal] {
        &self.portals
    }

    /// Returns the portal with the given id, or `None` if the graph has no such portal.
    pub fn portal(&self, id: PortalId) -> Option<&Portal> {
        self.portals.get(id.index())
    }

    /// Returns the portals of a cell, ascending. Empty for an unknown cell.
    pub fn portals_of(&self, cell: CellId) -> &[PortalId] {
        slice_of(&self.first, &self.of_cells, cell)
    }

    /// Replaces the object lists of all cells. Each pair puts an object into a cell; an object may be in
    /// several cells. Pairs may come in any order, and repeatedly. Time is O(n log n) in the number of pairs.
    ///
    /// # Errors
    /// [`CellGraphError::UnknownObjectCell`] if a pair names a cell that does not exist,
    /// [`CellGraphError::TooMany`] for 2^32 pairs or more. The lists then stay as they were.
    pub fn set_objects(
        &mut self,
        pairs: impl IntoIterator<Item = (CellId, ObjectId)>,
    ) -> Result<(), CellGraphError> {
        let mut pairs: Vec<_> = pairs.into_iter().collect();
        let cells = self.cell_count();
        if let Some(&(cell, object)) = pairs.iter().find(|(cell, _)| cell.index() >= cells) {
            return Err(CellGraphError::UnknownObjectCell { object, cell, cells });
        }
        if pairs.len() > u32::MAX as usize {
            return Err(CellGraphError::TooMany { what: "objects in cells", count: pairs.len() });
        }
        pairs.sort_unstable();
        pairs.dedup();
        self.first_object.iter_mut().for_each(|first| *first = 0);
        pairs.iter().for_each(|(cell, _)| self.first_object[cell.index() + 1] += 1);
        for i in 1..self.first_object.len() {
            self.first_object[i] += self.first_object[i - 1];
        }
        self.objects = pairs.into_iter().map(|(_, object)| object).collect();
        self.stamp = Stamp::new();
        Ok(())
    }

    /// Returns the objects listed in a cell, ascending. Empty for an unknown cell.
    pub fn objects_in(&self, cell: CellId) -> &[ObjectId] {
        slice_of(&self.first_object, &self.objects, cell)
    }
}

impl Default for CellGraph {
    /// Makes a graph without cells.
    fn default() -> Self {
        let (portals, first, of_cells) = (Vec::new(), Vec::new(), Vec::new());
        let (first_object, objects) = (Vec::new(), Vec::new());
        Self { stamp: Stamp::new(), portals, first, of_cells, first_object, objects }
    }
}

impl PartialEq for CellGraph {
    /// Compares cells, portals and object lists. Stamps are not compared.
    fn eq(&self, other: &Self) -> bool {
        self.portals == other.portals
            && self.first_object == other.first_object
            && self.objects == other.objects
    }
}

fn slice_of<'a, T>(first: &[u32], items: &'a [T], cell: CellId) -> &'a [T] {
    match first.get(cell.index()..).and_then(|rest| rest.get(..2)) {
        Some(&[start, end]) => &items[start as usize..end as usize],
        _ => &[],
    }
}

#[cfg(test)]
mod tests;
