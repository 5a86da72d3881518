//! Occlusion culling on the scenes and in the file formats on which other cullers were measured; used by the
//! program `occlusion`.

pub mod frame;
pub mod picture;
pub mod scene_file;
pub mod visibility_file;
