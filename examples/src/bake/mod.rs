//! Parts of the program `bake`: the user's job, the level with its viewcells, the forecast, the run, the
//! report and its pictures.

mod degrees;
mod failure;
mod fit;
mod job;
mod level;
pub mod pictures;
mod plan;
pub mod report;
mod run;
pub mod viewcells;

pub use degrees::Degrees;
pub use failure::Failure;
pub use fit::{Budget, Fitted, fit, forget_depths};
pub use job::Job;
pub use level::Level;
pub use plan::Plan;
pub use run::{Run, forget, run};
