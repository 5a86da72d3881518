//! What the example programs share: scene sources and camera walks.
//!
//! A scene comes from a recipe ([`built_in`]) or from a file ([`load()`]); either way it is a
//! [`SceneSource`]: objects as plain triangles, and walks to fly the camera along.

pub mod description;
pub mod error;
mod gltf_buffers;
pub mod gltf_file;
pub mod load;
pub mod occlusion;
pub mod picture_size;
pub mod plp;
pub mod pvs;
pub mod recipes;
pub mod source;
pub mod streaming;
pub mod tradeoff;
pub mod vscn;
pub mod walk;
pub mod walkthrough;

pub use description::load_walks;
pub use error::SourceError;
pub use load::{cars5, load, open};
pub use recipes::built_in;
pub use source::{SceneSource, SourceObject};
pub use walk::{CameraKey, Frame, Walk, frames};

/// Compiles the code in the README.
#[cfg(doctest)]
#[doc = include_str!("../../README.md")]
pub struct Readme;
