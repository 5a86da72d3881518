//! Hierarchical occlusion maps, and the database of occluders that are worth drawing into them.

pub(crate) mod depth_estimate;
mod occluder_database;
mod occlusion_maps;
pub(crate) mod opacity_pyramid;
mod opacity_thresholds;
pub(crate) mod overlap;
pub(crate) mod tile_range;

#[cfg(feature = "papers")]
pub use depth_estimate::DepthEstimate;
pub use occluder_database::{OccluderCriteria, OccluderDatabase};
pub use occlusion_maps::Hom;
