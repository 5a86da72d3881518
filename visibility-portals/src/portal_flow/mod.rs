//! Visibility through one portal, the source: a depth-first search through chains of portals, with the set of
//! reachable portals recomputed at every depth.
//!
//! Lines pass the source, then a portal of the cell behind it, and so on. Two polygons bound the lines of a
//! chain: the part of the source from which they can come, and the part of the last portal that they can
//! pass. The planes that [separate](crate::separating_planes) the two polygons bound everything that the
//! lines can reach beyond. At each depth a flood fill through cells finds the portals inside those planes.
//! The chain ends where none of these portals leads to a cell that is not already known to be seen.
//!
//! Portal sets are bitsets over the source's candidates: the portals that may be seen through the source.
//! Candidates are numbered in the order of the cells that they lead from, so the sets are short and the
//! portals of one cell are adjacent.

mod chain_proofs;
mod extend_chain;
mod flow;
mod flow_input;
mod flow_scratch;

pub(crate) use flow::portal_flow;
pub(crate) use flow_input::{FlowInput, FlowResult};
pub(crate) use flow_scratch::FlowScratch;
