//! Walk through a tessellation's cells from the eye outwards, shared by both cullers.
//!
//! `state` holds the buffers of a walk, `remaining_layers` the layers not yet projected of each opened cell,
//! `projection` looks up the objects of a layer and moves objects from `ready` to the result, `ready` is the
//! queue of objects looked up and not kept yet, and `traversal` is the loop over cells.

mod projection;
mod ready;
mod remaining_layers;
mod state;
#[cfg(test)]
mod tests;
mod traversal;

pub use state::Budget;
#[cfg(feature = "papers")]
pub(crate) use state::Keep;
pub(crate) use state::{FrameContext, PlpSettings, Projected, Walk};
