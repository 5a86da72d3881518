//! Bakes of whole scenes: which viewcells, how far, and where the work is kept. Used by the program `bake`.

mod failure;
mod job;
mod level;
pub mod pictures;
pub mod report;
mod run;
pub mod viewcells;

pub use failure::Failure;
pub use job::Job;
pub use level::Level;
pub use run::{Run, forget, run, write};
