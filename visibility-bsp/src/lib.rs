//! Object-space visibility: BSP trees, occlusion trees, shadow frusta and large occluders.
#![no_std]
#![forbid(unsafe_code)]
// `!(a > b)` is meant: it also holds where one is not a number.
#![allow(clippy::neg_cmp_op_on_partial_ord)]
extern crate alloc;
#[cfg(any(feature = "std", test))]
extern crate std;

mod bsp_order_culler;
mod clip_projection;
mod large_occluders;
mod merge;
mod naylor;
mod occluders;
mod occlusion_tree;
mod polygon_cut;
mod scene_tree;
mod shadow;
mod shadow_frusta;
pub mod tree;
mod view_volume;

pub use bsp_order_culler::BspOrderCuller;
pub use large_occluders::LargeOccludersCuller;
pub use merge::{Solid, SolidError};
pub use naylor::{NaylorCuller, Witness};
pub use occluders::Occluders;
pub use occlusion_tree::{OcclusionTree, OcclusionTreeCuller};
pub use scene_tree::SceneTree;
pub use shadow_frusta::{ShadowFrusta, ShadowFrustaCuller};
pub use tree::{BspError, BspTree, Fragment, Fragments, Leaf, Order, Subtree, Walk};
