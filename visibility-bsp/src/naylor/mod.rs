//! Exact culling with a BSP tree of the scene (Naylor, "Partitioning Tree Image Representation and Generation
//! from 3D Geometric Models", 1992).
//!
//! [`NaylorCuller`] walks the scene's BSP tree front to back and clips each polygon against the nearer ones.
//! The image area that nearer polygons cover is kept in a second, two-dimensional BSP tree, the [beam
//! tree](beams). Naylor merges the two trees. Here each fragment of the scene's tree is inserted into the
//! beam tree on its own, after a test of the box around its subtree. The answers are equal, since merging
//! also visits a visible scene node once for each open beam that the node's region reaches. The one
//! difference is that a subtree is tested by its bounding box instead of its region.

mod beams;
mod culler;
mod screen_projection;

pub use beams::VisiblePoint;
pub use culler::NaylorCuller;
