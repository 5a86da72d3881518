//! Object-space visibility: BSP trees, occlusion trees, shadow frusta and large occluders.
#![no_std]
#![forbid(unsafe_code)]
extern crate alloc;
#[cfg(any(feature = "std", test))]
extern crate std;

mod occluders;
mod occlusion_tree;
mod shadow;
mod sight;

pub use occluders::Occluders;
pub use occlusion_tree::{OcclusionTree, OcclusionTreeCuller};
