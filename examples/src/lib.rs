//! Library of the example programs: scene sources, camera walks, and the code that several programs share.
//!
//! A scene comes from a recipe ([`built_in`]) or from a file ([`load()`]). Either way it is a
//! [`SceneSource`]: objects as plain triangles, and walks to move the camera along.

#![warn(clippy::print_stdout, clippy::print_stderr)]

pub mod arguments;
pub mod bake;
#[cfg(feature = "maps")]
mod bsp_file;
pub mod cameras;
pub mod description;
pub mod engine;
pub mod error;
pub mod floor_plans;
pub mod gltf_file;
mod json;
pub mod level_occluders;
pub mod load;
pub mod made_up_walks;
pub mod object_name;
pub mod ordinary_file;
mod other_formats;
pub mod output_file;
pub mod pieces;
pub mod plp;
pub mod print;
pub mod progress;
pub mod pvs;
pub mod queries;
pub mod reading;
pub mod recipes;
pub mod region;
pub mod server;
pub mod source;
pub mod streaming_cache;
pub mod tradeoff;
pub mod unit_and_axis_hints;
pub mod visc;
pub mod vscn;
pub mod walk;
pub mod walkthrough;

pub use cameras::Cameras;
pub use description::load_walks;
pub use error::SourceError;
pub use load::{cars5, load, load_as, open, open_as, open_by_object};
pub use print::exit_code;
pub use reading::Reading;
pub use recipes::built_in;
pub use source::{Hint, SceneSource, SourceObject};
pub use walk::{CameraKey, Frame, Walk, frames};

/// Holder of the README's code blocks, so that documentation tests compile them.
#[cfg(doctest)]
#[doc = include_str!("../../README.md")]
pub struct Readme;
