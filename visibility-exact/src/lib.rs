//! Proven visibility from a region: for a viewcell and an object, either an unblocked line of sight is found,
//! or a proof that there is none.
//!
//! - [`SceneTriangles`] are the triangles of a scene, prepared once.
//! - [`ExactCuller`] decides the objects of a scene from a viewcell: seen, along a line of sight that
//!   certainly misses all triangles; hidden, with a [`Proof`]; or open, which counts as visible. An
//!   [`Effort`] chooses between rays alone, which miss barely visible objects, certified bounds on visible
//!   shares, and proofs.
//! - [`DynamicCell`] keeps the verdicts from one viewcell up to date while occluders move.
//! - [`CellQuery`] is one viewcell's query in steps, for a bake with a budget such as `visibility-bake`.
//!
//! Based on: Shaun Nirenstein, Edwin Blake and James Gain, "Exact From-Region Visibility Culling", 2002. Its
//! question and its query architecture are kept. Instead of subtracting blocked lines in Pluecker space, a
//! search for an unblocked line ends as soon as one is found, and divides the lines only where no proof
//! covers all of them.
#![no_std]
#![warn(missing_debug_implementations)]
#![forbid(unsafe_code)]
extern crate alloc;
#[cfg(any(feature = "std", test))]
extern crate std;

mod cell_query;
mod chain;
mod chain_scratch;
mod check;
mod corner_proof;
mod culler;
mod dynamic;
mod half;
mod line_side;
mod matrix_game;
mod polygon;
mod proof;
mod rays;
mod rows;
mod search;
#[cfg(feature = "serde")]
mod serde_records;
mod settings;
mod shaft;
mod share;
mod side_signs;
mod sight;
mod triangle_tree;
mod triangles;
mod verdict;

pub use cell_query::CellQuery;
pub use check::ProofError;
pub use culler::ExactCuller;
pub use dynamic::{DynamicCell, UpdateStats};
pub use proof::Proof;
pub use settings::{Effort, ExactSettings};
pub use triangles::SceneTriangles;
pub use verdict::{CellVerdicts, ProvenHidden, Verdict, Witness};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
