//! Portal culling at run time: each frame walks from the cells of the eye through open portals, and each
//! portal narrows the view to the part that can be seen through its polygon.
//!
//! This work is based on David Luebke and Chris Georges, "Portals and Mirrors: Simple, Fast Evaluation of
//! Potentially Visible Sets", 1995. No bake is needed, and doors and mirrors may change at any time. A baked
//! PVS, if there is one, limits the walk to the cells of its rows, as in Seth Teller and Carlo Sequin,
//! "Visibility Preprocessing for Interactive Walkthroughs", 1991 (eye-to-cell visibility).
//!
//! [`SceneCells`] is shared by all views. [`PortalEye`] holds the state of one view. [`PortalCuller`] owns
//! one of each, for a pipeline; `SharedPortalCuller` (feature `std`) owns an eye, and shares the cells.

mod doors;
mod hung_mirrors;
mod mirror_reflections;
mod outline;
mod portal_culler;
mod portal_eye;
mod portal_stats;
mod portal_walk;
mod scene_cells;
mod scene_cells_error;
mod screen_rectangle;
#[cfg(feature = "std")]
mod shared_portal_culler;
mod start_cells;
mod view_planes;
mod walked_scene;
mod window_plane;

pub use doors::Passage;
pub use hung_mirrors::MirrorId;
pub use mirror_reflections::Reflection;
pub use portal_culler::PortalCuller;
pub use portal_eye::PortalEye;
pub use portal_stats::{NotCulled, PortalStats};
pub use portal_walk::Narrowing;
pub use scene_cells::SceneCells;
pub use scene_cells_error::SceneCellsError;
#[cfg(feature = "std")]
pub use shared_portal_culler::SharedPortalCuller;

/// Null index: the end of a linked list of mirrors or paths, and the parent of a path that begins at the eye.
const NONE: u32 = u32::MAX;
