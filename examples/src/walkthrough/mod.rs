//! The main job: walk a camera through a scene, cull every frame, and say how fast and how right the answers
//! were.
//!
//! [`trial`] runs the cullers and keeps what they report, [`judge`](mod@judge) holds that against the exact
//! answer, [`output`] prints it, and [`eye_picture`], [`map_picture`] and [`cells_picture`] draw it.

pub mod auto;
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
pub mod prepared;
pub mod trial;
pub mod world;

pub use judge::{Verdict, judge};
pub use prepared::Prepared;
pub use trial::{Trial, run, run_for};
pub use world::World;
