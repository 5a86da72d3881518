//! Errors of cell graphs, which name the faulty cell, portal or object.

use super::{CellId, PortalId};
use crate::{ObjectId, geometry::PolygonError};
use core::fmt;

/// The reason why cells and portals cannot make a graph, or fail a check.
#[derive(Clone, Copy, PartialEq, Debug)]
#[non_exhaustive]
pub enum CellGraphError {
    /// There are more than [`CellGraph::LIMIT`](super::CellGraph::LIMIT) cells or portals, or 2^32 or more
    /// objects in cells.
    TooMany {
        /// Plural name of the items: "cells", "portals" or "objects in cells".
        what: &'static str,
        /// Number of cells, portals or objects in cells that were given, or a lower bound on that number.
        count: usize,
    },
    /// A portal joins a cell that does not exist.
    UnknownCell {
        /// Portal that joins a cell that does not exist.
        portal: PortalId,
        /// Cell that the portal joins and the graph does not have.
        cell: CellId,
        /// Number of cells in the graph, numbered from 0.
        cells: usize,
    },
    /// A portal joins a cell to itself.
    SameCell {
        /// Portal that joins a cell to itself.
        portal: PortalId,
        /// Cell on both sides of the portal.
        cell: CellId,
    },
    /// A portal has no area, and therefore no plane.
    NoPlane {
        /// Portal whose polygon has no area.
        portal: PortalId,
    },
    /// The vertices of a portal are not a convex polygon: not planar, not convex, not finite, without area or
    /// too few.
    Polygon {
        /// Portal whose vertices are not a convex polygon.
        portal: PortalId,
        /// The fault of the portal's vertices.
        error: PolygonError,
    },
    /// An object is listed in a cell that does not exist.
    UnknownObjectCell {
        /// Object that is listed in a cell that does not exist.
        object: ObjectId,
        /// Cell in whose list the object is, and which the graph does not have.
        cell: CellId,
        /// Number of cells in the graph, numbered from 0.
        cells: usize,
    },
    /// A portal of a cell has a vertex beyond the plane of another portal of the cell, on the side of that
    /// plane away from the cell. Two such portals cannot both be on the boundary of a convex body: the cell
    /// is not convex, a portal is not on its boundary, or a normal points the wrong way.
    NotOnBoundary {
        /// Cell to which both portals belong.
        cell: CellId,
        /// Portal of `cell` that has a vertex on the outer side of the plane of the portal `behind`, the
        /// side away from `cell`.
        portal: PortalId,
        /// Portal of `cell` whose plane the other portal, `portal`, crosses: a vertex of `portal` lies on
        /// the side of this plane away from `cell`.
        behind: PortalId,
        /// Greatest distance in metres of a vertex of `portal` from the plane of the portal `behind`, on the
        /// side of that plane away from `cell`.
        distance: f64,
    },
    /// The number of bodies (volumes of cells) given to `validate_bodies` or `turn_portals` differs from the
    /// number of cells.
    Bodies {
        /// Number of cells in the graph.
        cells: usize,
        /// Number of cell bodies that were given.
        bodies: usize,
    },
    /// A portal does not lie in a face of the body of one of its cells.
    NotOnBody {
        /// Portal that does not lie in any face of the body of `cell`.
        portal: PortalId,
        /// One of the two cells of the portal: no face of this cell's body holds the portal.
        cell: CellId,
        /// Distance in metres, the greater of two: the greatest distance of a vertex of the portal outside
        /// the body of `cell`, and the greatest distance of a vertex from the plane of the body's nearest
        /// face.
        distance: f64,
    },
    /// The normal of a portal does not point from the body of its first cell into the body of its second
    /// cell.
    Normal {
        /// Portal whose normal has the wrong direction.
        portal: PortalId,
        /// Cell of the portal on whose side the normal is wrong: the normal points into the body of the first
        /// cell, or out of the body of the second.
        cell: CellId,
    },
    /// The bodies of a portal's cells do not tell which side of the portal belongs to which cell: both bodies
    /// reach across the portal's plane, or both lie on the same side of it.
    NotBetween {
        /// Portal whose plane does not separate the bodies of its two cells.
        portal: PortalId,
        /// The two cells of the portal.
        cells: [CellId; 2],
    },
}

impl fmt::Display for CellGraphError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::TooMany { what, count } => write!(f, "{count} {what} are too many"),
            Self::UnknownCell { portal, cell, cells } => {
                write!(f, "portal {} leads to cell {}, but there are only {cells}", portal.0, cell.0)
            }
            Self::SameCell { portal, cell } => {
                write!(f, "portal {} leads from cell {} to itself", portal.0, cell.0)
            }
            Self::NoPlane { portal } => write!(f, "portal {} has no area", portal.0),
            Self::Polygon { portal, error } => write!(f, "portal {}: {error}", portal.0),
            Self::Bodies { cells, bodies } => {
                write!(f, "{bodies} bodies for {cells} cells: each cell needs one")
            }
            Self::NotOnBody { portal, cell, distance } => {
                write!(f, "portal {} is {distance} off the boundary of cell {}", portal.0, cell.0)
            }
            Self::Normal { portal, cell } => {
                write!(f, "portal {} points the wrong way through the boundary of cell {}", portal.0, cell.0)
            }
            Self::NotBetween { portal, cells: [first, second] } => write!(
                f,
                "portal {} is not between cells {} and {}: up to the tolerance, their bodies are not on opposite \
                 sides of its plane",
                portal.0, first.0, second.0
            ),
            Self::UnknownObjectCell { object, cell, cells } => {
                write!(f, "object {} is put into cell {}, but there are only {cells}", object.index(), cell.0)
            }
            Self::NotOnBoundary { cell, portal, behind, distance } => write!(
                f,
                "portal {} of cell {} reaches {distance} behind portal {}: not on the boundary of a convex cell",
                portal.0, cell.0, behind.0
            ),
        }
    }
}

impl core::error::Error for CellGraphError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            Self::Polygon { error, .. } => Some(error),
            _ => None,
        }
    }
}
