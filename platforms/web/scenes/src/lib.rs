//! The built-in scenes as lists of numbers, for the page and for tests: a separate WebAssembly module without
//! culling. The recipes are those of the example programs.
//!
//! `scenes_make` makes a scene; `scenes_numbers` and `scenes_length` then return its lists, which stay at
//! their addresses until the next scene is made.

// The page does not use all items of these modules of the example programs.
#![allow(dead_code, unreachable_pub, unused_imports)]

#[path = "../../../../examples/src/error.rs"]
mod error;
#[path = "../../../../examples/src/object_name.rs"]
mod object_name;
#[path = "../../../../examples/src/other_formats.rs"]
mod other_formats;
#[path = "../../../../examples/src/recipes/mod.rs"]
mod recipes;
#[path = "../../../../examples/src/source.rs"]
mod source;
#[path = "../../../../examples/src/walk.rs"]
mod walk;

mod lists;

pub use lists::Lists;
pub use recipes::built_in;
pub use source::SceneSource;
