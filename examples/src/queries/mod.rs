//! Hardware occlusion queries along camera walks: a simulated graphics card, and the counts of a run. Used by
//! the program `queries`.

mod card;
mod run;

pub use card::SoftwareCard;
pub use run::{Mode, Totals, run, successive_views};
