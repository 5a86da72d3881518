//! Bake of cell-to-cell visibility: reading maps of cells and portals, baking them, and reporting the
//! results. Used by the program `pvs`.

mod bake;
pub mod built;
pub mod maps;
mod report;
pub mod solids;
pub mod stabs;

pub use bake::{Baked, Map, QUICK_DEPTH, bake, read};
pub use report::{Line, summary};
