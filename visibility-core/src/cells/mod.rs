//! Cells and portals: rooms, and the openings through which they are seen from one another.
//!
//! A [`CellGraph`] divides the space that can be walked into convex cells. The boundary of a cell is opaque,
//! except for its portals: convex polygons, each of which it shares with one other cell. A line of sight
//! leaves a cell only through portals, and that is all that visibility needs to know of the walls (Airey,
//! "Increasing Update Rates in the Building Walkthrough System", 1990; Teller and Sequin, "Visibility
//! Preprocessing for Interactive Walkthroughs", 1991; Durand's survey, chapter 5, section 7).
//!
//! # Conventions
//! Coordinates are `f64`, in world space. The vertices of a portal run counter-clockwise as seen from the
//! second of its two cells; its normal points into that cell. Cells and portals are numbered from 0 in the
//! order given.

mod error;
mod ids;
mod leak;
mod validate;

pub use error::CellGraphError;
pub use ids::{CellId, PortalId};
pub use leak::Leak;

use crate::{
    ObjectId,
    geometry::{ConvexPolygon, Plane},
    stamp::Stamp,
};
use alloc::vec::Vec;
use glam::DVec3;

/// An opening between two cells: a convex polygon.
#[derive(Clone, PartialEq, Debug)]
pub struct Portal {
    polygon: ConvexPolygon,
    cells: [CellId; 2],
    plane: Plane,
}

impl Portal {
    /// The polygon in world space, its vertices counter-clockwise as seen from the second cell.
    pub fn polygon(&self) -> &ConvexPolygon {
        &self.polygon
    }

    /// The cells on both sides. The normal points into the second.
    pub fn cells(&self) -> [CellId; 2] {
        self.cells
    }

    /// The cell on the other side of `cell`; the first cell, if `cell` is not one of the two.
    pub fn other(&self, cell: CellId) -> CellId {
        if self.cells[0] == cell { self.cells[1] } else { self.cells[0] }
    }

    /// The plane fitted to the polygon. Its unit normal points into the second cell.
    pub fn plane(&self) -> Plane {
        self.plane
    }
}

/// Convex cells, the portals between them, and lists of the objects in each cell.
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
    /// By cell: where its portals begin in `of_cells`; one more entry marks the end of the last.
    first: Vec<u32>,
    of_cells: Vec<PortalId>,
    /// As `first`, for `objects`.
    first_object: Vec<u32>,
    objects: Vec<ObjectId>,
}

impl CellGraph {
    /// The most cells or portals of a graph.
    pub const LIMIT: usize = 1 << 20;

    /// Makes a graph from the number of its cells and from its portals, each with the two cells that it
    /// joins: its normal points into the second. Takes time and memory in proportion to cells and portals.
    ///
    /// Whether the portals of a cell can bound a convex body is not checked here: see
    /// [`validate`](Self::validate).
    ///
    /// # Errors
    /// [`CellGraphError::TooMany`]; [`CellGraphError::UnknownCell`], [`CellGraphError::SameCell`] and
    /// [`CellGraphError::NoPlane`] for the first such portal.
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
        // Counts become starts: each cell's portals in ascending order, by filling from the back.
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

    /// As [`new`](Self::new), from the vertices of each portal, in order around it.
    ///
    /// # Errors
    /// [`CellGraphError::Polygon`] for the first portal that is not planar or not convex, up to
    /// [`ConvexPolygon::TOLERANCE`]; otherwise as `new`.
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

    /// Identifies cells, portals and lists of objects. [`set_objects`](Self::set_objects) takes a new stamp.
    /// A clone has the same stamp until either changes.
    pub fn stamp(&self) -> Stamp {
        self.stamp
    }

    /// The number of cells.
    pub fn cell_count(&self) -> usize {
        self.first.len().saturating_sub(1)
    }

    /// All portals; portal `i` has number `i`.
    pub fn portals(&self) -> &[Portal] {
        &self.portals
    }

    /// The portal with a number. `None` for an unknown one.
    pub fn portal(&self, id: PortalId) -> Option<&Portal> {
        self.portals.get(id.index())
    }

    /// The portals of a cell, ascending. Empty for an unknown cell.
    pub fn portals_of(&self, cell: CellId) -> &[PortalId] {
        slice_of(&self.first, &self.of_cells, cell)
    }

    /// Replaces the lists of objects. A pair puts an object into a cell; an object may be in several. Pairs
    /// may come in any order, and twice. Takes time for sorting them.
    ///
    /// # Errors
    /// [`CellGraphError::UnknownObjectCell`], [`CellGraphError::TooMany`]; then nothing changes.
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

    /// The objects listed in a cell, ascending. Empty for an unknown cell.
    pub fn objects_in(&self, cell: CellId) -> &[ObjectId] {
        slice_of(&self.first_object, &self.objects, cell)
    }
}

impl Default for CellGraph {
    /// A graph without cells.
    fn default() -> Self {
        let (portals, first, of_cells) = (Vec::new(), Vec::new(), Vec::new());
        let (first_object, objects) = (Vec::new(), Vec::new());
        Self { stamp: Stamp::new(), portals, first, of_cells, first_object, objects }
    }
}

impl PartialEq for CellGraph {
    /// Whether both have the same cells, portals and lists of objects. Stamps are not compared.
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
