//! Occluders of a level: the surfaces of a level as few large polygons.
//!
//! Most objects of a level are too small and too many to be good occluders. A wall of a game's level is made
//! of dozens of pieces with open edges, so that no pixel along a seam between pieces counts as covered.
//! [`LevelOccluders`] takes all opaque, static triangles of a level at once. It welds corners at equal
//! positions, resolves T-junctions, joins neighbours that are flat together, or nearly so, into polygons with
//! one outline each, leaves out the smallest polygons, and puts the others into clusters. The polygons hide
//! only what the triangles hide: no vertex is moved and no gap is closed.
#![no_std]
#![warn(missing_debug_implementations)]
#![forbid(unsafe_code)]
extern crate alloc;
#[cfg(any(feature = "std", test))]
extern crate std;

mod clusters;
mod faces;
mod file;
mod level;
mod outlines;
mod pieces;
mod regions;
#[cfg(feature = "serde")]
mod serde_records;
mod t_junctions;

pub use faces::LevelTriangle;
pub use file::LevelFileError;
pub use level::{
    LevelOccluders, LevelOccludersError, LevelReport, LevelSettings, OccluderCluster, OccluderPolygon,
};
