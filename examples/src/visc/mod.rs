//! Occlusion culling on VISC files, the scenes on which other cullers were measured. Used by the program
//! `occlusion`.

pub mod frame;
pub mod picture;
pub mod scene_file;
pub mod visibility_file;
