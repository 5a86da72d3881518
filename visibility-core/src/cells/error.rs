//! Errors of cell graphs, which name the faulty cell, portal or object.

use super::{CellId, PortalId};
use crate::{ObjectId, geometry::PolygonError};
use core::fmt;

/// The reason why cells and portals cannot make a graph, or fail a check.
#[derive(Clone, Copy, PartialEq, Debug)]
#[non_exhaustive]
pub enum CellGraphError {
    /// There are more cells, portals or objects in cells than a graph can have: see
    /// [`CellGraph::LIMIT`](super::CellGraph::LIMIT).
    TooMany {
        /// Plural name of the items: "cells", "portals" or "objects in cells".
        what: &'static str,
        /// Number of items, or a lower bound on it.
        count: usize,
    },
    /// A portal joins a cell that does not exist.
    UnknownCell {
        /// The faulty portal.
        portal: PortalId,
        /// The cell that the portal names.
        cell: CellId,
        /// Number of cells in the graph.
        cells: usize,
    },
    /// A portal joins a cell to itself.
    SameCell {
        /// The faulty portal.
        portal: PortalId,
        /// The cell on both sides of the portal.
        cell: CellId,
    },
    /// A portal has no area, and therefore no plane.
    NoPlane {
        /// The faulty portal.
        portal: PortalId,
    },
    /// The vertices of a portal are not a convex polygon: not planar, not convex, not finite, without area or
    /// too few.
    Polygon {
        /// The faulty portal.
        portal: PortalId,
        /// The fault of the portal's polygon.
        error: PolygonError,
    },
    /// An object is listed in a cell that does not exist.
    UnknownObjectCell {
        /// The object.
        object: ObjectId,
        /// The cell that does not exist.
        cell: CellId,
        /// Number of cells in the graph.
        cells: usize,
    },
    /// A portal of a cell reaches behind the plane of another portal of the cell, so the two cannot both be
    /// on the boundary of a convex body: the cell is not convex, a portal is not on its boundary, or a normal
    /// points the wrong way.
    NotOnBoundary {
        /// The cell of both portals.
        cell: CellId,
        /// The portal that reaches behind the plane of `behind`.
        portal: PortalId,
        /// The portal whose plane has `portal` partly outside the cell.
        behind: PortalId,
        /// Greatest distance of a vertex of `portal` behind the plane, in metres.
        distance: f64,
    },
    /// The number of given bodies differs from the number of cells.
    Bodies {
        /// Number of cells in the graph.
        cells: usize,
        /// Number of bodies given.
        bodies: usize,
    },
    /// A portal does not lie in a face of the body of one of its cells.
    OffBody {
        /// The faulty portal.
        portal: PortalId,
        /// The cell whose body it is.
        cell: CellId,
        /// Greatest distance of a vertex outside the body, or distance of the portal from the nearest face,
        /// whichever is greater, in metres.
        distance: f64,
    },
    /// The normal of a portal does not point from the body of its first cell into the body of its second
    /// cell.
    WrongWay {
        /// The faulty portal.
        portal: PortalId,
        /// The cell whose face has the wrong orientation with respect to the portal.
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
