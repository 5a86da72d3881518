//! Occlusion trees: the shadows of several occluders in one BSP tree of planes through the eye (Bittner,
//! Havran and Slavík, "Hierarchical Visibility Culling with Occlusion Trees", 1998, after Chin and Feiner,
//! "Near Real-Time Shadow Generation Using BSP Trees", 1989).
//!
//! The tree begins as one visible leaf. Each occluder polygon is taken down the tree and cut by its
//! planes. Where a fragment reaches a visible leaf, the planes through the polygon's edges are inserted,
//! and the directions inside all of them are in the polygon's shadow. A box is taken down the same way.
//! It is hidden if all parts of it reach shadow leaves whose polygons they are behind, and visible if all
//! parts reach visible leaves. Occluders fuse: several can hide a box that none of them hides alone. The
//! cost of a test grows with the depth of the tree, not with the number of occluders.

mod box_query;
mod culler;
mod map;
mod nodes;
mod screen_density;

pub use culler::OcclusionTreeCuller;
pub use map::OcclusionTree;
