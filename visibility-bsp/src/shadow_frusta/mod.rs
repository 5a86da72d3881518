//! Shadow frusta: occluders chosen in advance for each region of space, each a pyramid that boxes are tested
//! against (Hudson, Manocha, Cohen, Lin, Hoff and Zhang, "Accelerated Occlusion Culling Using Shadow Frusta",
//! 1997).
//!
//! A kd-tree parts the scene into regions, and for each the occluders are found that serve best for eyes in
//! it. Their quality is, after the paper: solid angle, by which candidates are found; depth complexity, how
//! many objects they hide, counted from eyes in the middle and near the corners of the region; and coherence,
//! that they hide them from all of these and not from one. Occluders are taken by how much each adds to what
//! those before it hide.

mod bake;
mod culler;

pub use bake::ShadowFrusta;
pub use culler::ShadowFrustaCuller;
