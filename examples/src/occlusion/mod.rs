//! Occlusion culling on the scenes and in the formats on which other cullers were measured: what the program
//! `occlusion` does.

pub mod frame;
pub mod picture;
pub mod visb;
pub mod visc;
