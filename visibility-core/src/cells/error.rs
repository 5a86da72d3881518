//! Errors of cells and portals, and which of them is wrong.

use super::{CellId, PortalId};
use crate::{ObjectId, geometry::PolygonError};
use core::fmt;

/// Why cells and portals cannot make a graph, or fail a check.
#[derive(Clone, Copy, PartialEq, Debug)]
#[non_exhaustive]
pub enum CellGraphError {
    /// More cells, portals or objects in cells than a graph can have: see
    /// [`CellGraph::LIMIT`](super::CellGraph::LIMIT).
    TooMany {
        /// Of what.
        what: &'static str,
        /// How many at least.
        count: usize,
    },
    /// A portal joins a cell that does not exist.
    UnknownCell {
        /// The portal.
        portal: PortalId,
        /// The cell that it names.
        cell: CellId,
        /// How many cells there are.
        cells: usize,
    },
    /// A portal joins a cell to itself.
    SameCell {
        /// The portal.
        portal: PortalId,
        /// The cell.
        cell: CellId,
    },
    /// A portal has no area.
    NoPlane {
        /// The portal.
        portal: PortalId,
    },
    /// The vertices of a portal make no convex polygon: it is bent, not convex, or has no area.
    Polygon {
        /// The portal.
        portal: PortalId,
        /// What is wrong with it.
        error: PolygonError,
    },
    /// An object is listed in a cell that does not exist.
    UnknownObjectCell {
        /// The object.
        object: ObjectId,
        /// The cell.
        cell: CellId,
        /// How many cells there are.
        cells: usize,
    },
    /// A portal of a cell reaches behind another, so they cannot both be on the boundary of a convex body:
    /// the cell is not convex, a portal is not on its boundary, or a normal points the wrong way.
    NotOnBoundary {
        /// The cell.
        cell: CellId,
        /// The portal that reaches behind the other.
        portal: PortalId,
        /// The other.
        behind: PortalId,
        /// How far it reaches.
        distance: f64,
    },
    /// The number of bodies is not that of the cells.
    Bodies {
        /// How many cells.
        cells: usize,
        /// How many bodies.
        bodies: usize,
    },
    /// A portal does not lie in a face of the body of one of its cells.
    OffBody {
        /// The portal.
        portal: PortalId,
        /// The cell.
        cell: CellId,
        /// How far it reaches out of the body, or how far it is from the nearest face, whichever is more.
        distance: f64,
    },
    /// The normal of a portal does not point from the body of its first cell into that of the second.
    WrongWay {
        /// The portal.
        portal: PortalId,
        /// The cell on whose wrong side it is.
        cell: CellId,
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
            Self::OffBody { portal, cell, distance } => {
                write!(f, "portal {} is {distance} off the boundary of cell {}", portal.0, cell.0)
            }
            Self::WrongWay { portal, cell } => {
                write!(f, "portal {} points the wrong way through the boundary of cell {}", portal.0, cell.0)
            }
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

impl core::error::Error for CellGraphError {}
