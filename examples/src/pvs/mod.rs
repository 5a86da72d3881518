//! What the program `pvs` does: reads a map of cells and portals, bakes which cells see which, and says what
//! came of it.

mod bake;
pub mod built;
pub mod maps;
mod report;
pub mod solids;
pub mod stabs;

pub use bake::{Baked, Map, bake, read};
pub use report::{Line, summary};
