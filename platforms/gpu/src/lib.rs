//! Culling together with a graphics card, through wgpu: pictures drawn from draw lists, an item buffer on the
//! card, the card's occlusion queries, and a depth pyramid in compute shaders.
//!
//! - [`Gpu`] is a device, with or without a window.
//! - [`World`] is a built-in scene with the views of its walks, [`Meshes`] are its meshes on the card.
//! - [`Painter`] draws objects into a [`Target`]: a picture and an item buffer, which has the object visible
//!   in each pixel.
//! - [`CardQueries`] implements core's `QueryDevice` with occlusion queries of the card.
//! - [`Method`] is a way of culling and drawing a frame, [`Viewer`] has the scene and device that all methods
//!   need.
//! - [`CardMap`] implements core's `OcclusionMap` with the depth pyramid, read back to the processor.
//! - [`TwoPhaseCuller`] culls on the card with a depth pyramid of the objects visible in the last frame.

// The built-in scenes, which are recipes of the example programs. This crate does not use all items of these
// modules.
#[allow(dead_code, unreachable_pub, unused_imports)]
#[path = "../../../examples/src/error.rs"]
mod error;
#[allow(dead_code, unreachable_pub)]
#[path = "../../../examples/src/object_name.rs"]
mod object_name;
#[path = "../../../examples/src/other_formats.rs"]
mod other_formats;
#[allow(dead_code, unreachable_pub, unused_imports)]
#[path = "../../../examples/src/recipes/mod.rs"]
mod recipes;
#[allow(dead_code, unreachable_pub, unused_imports)]
#[path = "../../../examples/src/source.rs"]
mod source;
#[allow(dead_code, unreachable_pub, unused_imports)]
#[path = "../../../examples/src/walk.rs"]
mod walk;

mod card_map;
mod gpu;
mod meshes;
mod methods;
mod painter;
mod picture;
mod pyramid;
mod queries;
mod target;
mod two_phase;
mod viewer;
#[cfg(feature = "window")]
mod window;
mod world;

pub use card_map::CardMap;
pub use gpu::{Gpu, GpuError};
pub use meshes::Meshes;
pub use methods::{Culling, Method};
pub use painter::Painter;
pub use queries::{CardQueries, Delay};
pub use target::{NO_ITEM, Target};
pub use two_phase::TwoPhaseCuller;
pub use viewer::Viewer;
#[cfg(feature = "window")]
pub use window::fly;
pub use world::World;
