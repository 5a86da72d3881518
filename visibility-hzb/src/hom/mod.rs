//! Hierarchical occlusion maps.

pub(crate) mod depth_estimate;
mod occlusion_maps;
pub(crate) mod opacity_pyramid;
mod opacity_thresholds;
pub(crate) mod overlap;
pub(crate) mod tile_range;

#[cfg(feature = "papers")]
pub use depth_estimate::DepthEstimate;
pub use occlusion_maps::Hom;
