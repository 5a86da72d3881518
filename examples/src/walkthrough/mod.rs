//! Camera walk through a scene in which every frame is culled by each culler, timed and judged. Used by the
//! program `walkthrough`.
//!
//! [`trial`] runs the cullers and keeps the objects that they report, [`judge`](mod@judge) compares these
//! with the exact answer, [`output`] prints the results, and [`eye_picture`], [`map_picture`] and
//! [`cells_picture`] draw them.

pub mod aimed_rays;
pub mod auto;
pub mod bake_advice;
pub mod canvas;
pub mod cell_sets;
pub mod cells_picture;
pub mod cullers;
pub mod explain;
pub mod eye_picture;
pub mod freeze;
pub mod judge;
pub mod map_picture;
pub mod output;
pub mod palette;
pub mod prepared;
pub mod trial;
pub mod world;

pub use judge::{Verdict, judge, judge_with_limits};
pub use prepared::Prepared;
pub use trial::{Trial, run, run_for};
pub use world::World;
