//! Shadow frusta: for each region of space, occluders are chosen in advance, and boxes are tested against the
//! pyramids of their shadows (Hudson, Manocha, Cohen, Lin, Hoff and Zhang, "Accelerated Occlusion Culling
//! Using Shadow Frusta", 1997).
//!
//! A kd-tree divides the scene into regions. For each region, the bake chooses the best occluders for eyes in
//! it, by the paper's three measures. Candidates have a large solid angle. Depth complexity is the number of
//! objects that an occluder hides, counted from eyes in the middle and near the corners of the region.
//! Coherence means that objects are hidden from all of these eyes and not only from one. Occluders are taken
//! greedily, by the number of hidden objects that each adds.

mod bake;
mod culler;

pub use bake::ShadowFrusta;
pub use culler::ShadowFrustaCuller;
