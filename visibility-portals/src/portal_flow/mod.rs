//! What can be seen through one portal: depth first through chains of portals, with the possible targets
//! flooded again at every depth.
//!
//! From a portal, the source, lines go on through the next portal of the cell behind it, and so on. Two
//! polygons bound them: the part of the source that they can come from, and the part of the last portal that
//! they can go through. The planes that [separate](crate::separating_planes) these bound everything farther
//! on. At each depth a flood through cells finds the portals that can still be reached without leaving those
//! planes; where none of them leads to a cell that is not already known to be seen, the chain ends.
//!
//! All sets are of the source's own candidates, numbered in the order of the cells that they lead from: short
//! bit masks, in which the portals of a cell stand side by side.

mod chain;
mod flow;
mod known;
mod scratch;
mod witness;

pub(crate) use flow::portal_flow;
pub(crate) use known::{Found, Known};
pub(crate) use scratch::Scratch;
