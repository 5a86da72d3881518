//! Test utilities shared by the visibility crates.
//!
//! A crate with this dev-dependency can use everything in integration tests and doc tests. Unit tests inside
//! `visibility-core` can only use [`Random`] and other items whose signatures have no type of core: cargo
//! compiles core twice for unit tests, and the types of the two builds differ.

pub mod allocations;
pub mod cameras;
mod climb;
mod distance;
pub mod enclosures;
mod ends;
mod exact;
mod forged_counts;
mod hash;
pub mod job_systems;
mod not_always_drawn;
mod notched_blade;
mod octree;
mod plain_map;
mod random;
mod sight_world;
mod slabs;
mod slots;
mod steps;
pub mod swapped;
mod trials;

pub use climb::{Climb, ClimbInput, climb};
pub use distance::distance;
pub use ends::{End, UNIT, ends, ends_f32};
pub use exact::{orientation_sign, sign_of_sum};
pub use forged_counts::{forge_counts, mend_header};
pub use hash::{FNV_START, fnv};
pub use not_always_drawn::NOT_ALWAYS_DRAWN;
pub use notched_blade::notched_blade;
pub use octree::Octree;
pub use plain_map::PlainMap;
pub use random::Random;
pub use sight_world::{Camera, SightWorld};
pub use slabs::is_clear;
pub use slots::{SlotScene, SlotSearch};
pub use steps::{step, steps_of};
pub use trials::{judged, told_enough};
