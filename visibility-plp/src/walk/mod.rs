//! The walk through the cells of a tessellation that both cullers share.
//!
//! `state` holds what a walk remembers, `remaining` opens cells, `projection` takes objects out of them,
//! `traversal` is the loop over cells.

mod projection;
mod remaining;
mod state;
mod traversal;

pub use state::Budget;
pub(crate) use state::{FrameContext, PlpSettings, Projected, Walk};
