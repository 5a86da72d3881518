//! Occluders of a level: what the world is made of, as few large pieces.
//!
//! Objects are what is drawn, and mostly too many and too small to hide anything: a wall of a game's level is
//! made of dozens, each with open edges, so that no pixel along a seam counts as covered. [`LevelOccluders`]
//! takes all opaque, static triangles of a level at once. It welds corners at equal positions, resolves
//! T-junctions, joins neighbours that are flat together, or nearly so, into polygons with one outline, leaves
//! out the smallest, and puts the others in clusters. What the polygons hide, the triangles hide: nothing is
//! moved or closed.
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
mod t_junctions;

pub use faces::LevelTriangle;
pub use file::LevelFileError;
pub use level::{
    LevelOccluders, LevelOccludersError, LevelReport, LevelSettings, OccluderCluster, OccluderPolygon,
};
