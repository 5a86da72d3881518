//! What can be seen through one portal, the source: depth first through chains of portals, with the reachable
//! portals computed anew at every depth.
//!
//! From the source, lines go on through a portal of the cell behind it, and so on. Two polygons bound them:
//! the part of the source that they can come from, and the part of the last portal that they can pass. The
//! planes that [separate](crate::separating_planes) these bound all that lines can reach beyond. At each
//! depth a flood through cells finds the portals that can be reached inside of those planes; where none of
//! them leads to a cell that is not already known to be seen, the chain ends.
//!
//! Sets are of the candidates of the source, numbered in the order of the cells that they lead from: short
//! bit masks, in which the portals of one cell are neighbours.

mod chain;
mod flow;
mod known;
mod scratch;
mod witness;

pub(crate) use flow::portal_flow;
pub(crate) use known::{Found, Known};
pub(crate) use scratch::Scratch;
