//! Occlusion trees: the shadows of several occluders as one tree of planes through the eye (Bittner, Havran
//! and Slavík, "Hierarchical Visibility Culling with Occlusion Trees", 1998, after Chin and Feiner, "Near
//! Real-Time Shadow Generation Using BSP Trees", 1989).
//!
//! The tree begins as one lit leaf. Each occluder goes down it, parted by the planes; where it comes to a lit
//! leaf, the planes through its edges are put there, and what is inside them is in its shadow. A box goes
//! down likewise: hidden if all of it comes to shadows of polygons that it is behind, visible if all of it
//! comes to lit leaves. So occluders fuse: a box may be hidden by several, none of which hides it alone, and
//! the cost of a test is the depth of the tree, not the number of occluders.

mod box_query;
mod culler;
mod map;
mod nodes;
mod screen_density;

pub use culler::OcclusionTreeCuller;
pub use map::OcclusionTree;
