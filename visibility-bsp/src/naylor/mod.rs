//! Exact culling with a BSP tree of the scene (Naylor, "Partitioning Tree ProjectedPolygon Representation and
//! Generation from 3D Geometric Models", 1992).
//!
//! The scene's tree is walked front to back, and each polygon cut off by those before it: what they cover is
//! kept in a tree of the [picture](beams). Naylor merges the two trees; here the fragments of the scene's
//! tree, and before them the box around each subtree, are inserted into the picture's tree one by one. The
//! answer is the same, since the merge too visits an unhidden node of the scene for each open beam that its
//! region reaches; what is merged here is only the box of a subtree in place of its region.

mod beams;
mod culler;
mod screen_projection;

pub use beams::Witness;
pub use culler::NaylorCuller;
