//! Parts of the program `bake`: the job that a user states, the level with its viewcells, the run, the report
//! and its pictures.

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
pub use run::{Run, forget, run};
