//! Architectural visibility: which cells of a building see which, through chains of portals.
//!
//! - [`from_geometry`] makes cells and portals from walls along the axes or from any polygons.
//! - [`prt`] reads the portal files of map compilers into a [`CellGraph`](visibility_core::CellGraph).
//! - [`CellBaker`] computes which cells see which: the potentially visible set of each, as a [`CellMatrix`].
//! - [`ObjectBaker`] computes which objects each cell sees.
//! - [`stabbing`] answers whether a line passes through a sequence of openings, in a floor plan or in space,
//!   and [`lp`] is the solver of small linear programs below it; both with certificates.
//!
//! # Promises
//! - No two cells are called hidden from each other between which a straight line passes that stays clear of
//!   all portal edges by the [clearance](Settings::clearance), whatever the rounding.
//! - The answer is symmetric, and the same on every machine, with any number of threads.
//! - No panic on any input; a bake can be stopped at any time, and what it has then is conservative too.
//!
//! # Features
//! `std` (default). Without it, `libm`. `rayon`: bakes on all threads.
#![no_std]
#![forbid(unsafe_code)]
extern crate alloc;
#[cfg(any(feature = "std", test))]
extern crate std;

mod antipenumbra;
mod bake_settings;
mod cell_baker;
mod cell_matrix;
mod clip_polygon;
mod coplanar_portals;
mod culler;
mod directed_portals;
pub mod from_geometry;
pub mod lp;
mod object_baker;
mod portal_flow;
pub mod prt;
mod separating_planes;
pub mod stabbing;
#[cfg(test)]
mod whole_numbers;

pub use antipenumbra::antipenumbra;
pub use bake_settings::{BakeError, Settings};
pub use cell_baker::{CellBaker, Fallback, Outcome};
pub use cell_matrix::CellMatrix;
pub use culler::{
    MirrorId, Narrowing, NotCulled, Passage, PortalCuller, PortalEye, PortalStats, Reflection, SceneCells,
    SceneCellsError,
};
pub use object_baker::{ObjectBaker, ObjectOutcome};
