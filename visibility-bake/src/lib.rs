//! From a level to a file: the objects visible from each viewcell of a scene, with bounds on the error, baked
//! on one machine or in shards on many.
//!
//! - A [`Grid`] makes viewcells: over a box, along a walk, [where a camera can be](Grid::free), or [above
//!   walkable triangles](Grid::above).
//! - [`SandwichBaker`] finds for each viewcell the objects that are certainly seen and those that are not
//!   proven hidden, by methods from cheap to exact, until the difference is below a given
//!   [gap](SandwichSettings::with_gap).
//! - [`ViewcellFit`] halves viewcells whose sets are above a budget, and merges neighbours whose sets agree.
//! - [`Shard`] is the result for a range of viewcells, as bytes that another process can [assemble] with
//!   others.
//! - [`BakeCache`] keeps results with hashes of their input, so that a bake of an edited level only repeats
//!   work that the edit affects.
//! - [`DegreeSampler`] estimates how much of each object shows from a viewcell, by pictures from sampled
//!   eyes.
//! - [`BakedSet`] is the file that a game loads: viewcells with their potentially visible sets, and degrees
//!   of visibility if they were sampled.
//!
//! Objects that were not worked on always count as visible.
//!
//! Based on: the query architecture of Shaun Nirenstein, Edwin Blake and James Gain, "Exact From-Region
//! Visibility Culling", 2002; Fredo Durand, George Drettakis, Joelle Thollot and Claude Puech, "Conservative
//! Visibility Preprocessing using Extended Projections", 2000, for the first upper bound.
#![forbid(unsafe_code)]
#![warn(missing_debug_implementations)]

mod bake_cache;
mod baked_set;
mod cell_groups;
mod cell_sandwich;
mod deflated;
mod degree_sampler;
mod fingerprints;
mod found_cell;
mod free_space;
mod grid;
mod level_error;
mod method_times;
mod near_to_far;
mod object_classes;
mod object_facts;
mod sandwich_baker;
mod sandwich_outcome;
mod scratch_file;
mod search;
#[cfg(feature = "serde")]
mod serde_records;
mod settings;
mod shard;
mod spans;
mod tile_tree;
mod tiled_scene;
mod time_plan;
mod viewcell_fit;

pub use bake_cache::BakeCache;
pub use baked_set::{BakedSet, BakedSetError};
pub use cell_sandwich::CellSandwich;
pub use degree_sampler::DegreeSampler;
pub use fingerprints::BakeSource;
pub use found_cell::FoundCell;
pub use free_space::CameraRange;
pub use grid::{Grid, GridError};
pub use level_error::LevelError;
pub use method_times::MethodTimes;
pub use sandwich_baker::{BakeScratch, SandwichBaker};
pub use sandwich_outcome::SandwichOutcome;
pub use settings::SandwichSettings;
pub use shard::{AssembleError, Shard, assemble};
pub use tiled_scene::{TiledScene, TiledSceneWriter};
pub use time_plan::SWEEP_TIME;
pub use viewcell_fit::{Division, ViewcellBudget, ViewcellFit};
pub use visibility_core::level_version::level_version;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
