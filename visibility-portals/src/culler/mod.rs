//! Portals each frame: from the cell that the eye is in through those that are open, each narrowing what is
//! seen to what its polygon lets through.
//!
//! This work is based on David Luebke and Chris Georges, "Portals and Mirrors: Simple, Fast Evaluation of
//! Potentially Visible Sets", 1995 (no bake, doors and mirrors that move); where potentially visible sets
//! were baked, they limit the walk, as in Seth Teller and Carlo Sequin, "Visibility Preprocessing for
//! Interactive Walkthroughs", 1991 (eye-to-cell visibility).
//!
//! [`SceneCells`] is what all eyes share, [`PortalEye`] the memory of one view, and [`PortalCuller`] both
//! together, for a pipeline.

mod doors;
mod mirror;
mod outline;
mod portal_culler;
mod portal_eye;
mod portal_stats;
mod portal_view;
mod portal_walk;
mod reflection;
mod scene_cells;
mod scene_cells_error;
mod screen_rectangle;
mod seen_objects;
mod start_cells;
mod window_plane;

pub use doors::Passage;
pub use mirror::MirrorId;
pub use portal_culler::PortalCuller;
pub use portal_eye::PortalEye;
pub use portal_stats::{NotCulled, PortalStats};
pub use portal_walk::Narrowing;
pub use reflection::Reflection;
pub use scene_cells::SceneCells;
pub use scene_cells_error::SceneCellsError;
