//! Visibility on a plan: among walls, houses, hills and trees that stand on a ground.
//!
//! Many objects that engines cull stand on a ground. On its plan, visibility is exact, cheap and useful by
//! itself: fog of war, guards, robots, perception, servers that decide who may see whom.
//!
//! - [`cdt`]: exact visibility among walls, which are segments, by a triangulation.
//! - [`discs`]: exact visibility among round obstacles, such as the trunks of a forest.
//! - `view_cdt` (feature `papers`, see `docs/papers.md` in the repository): culls objects behind occluders
//!   whose outlines are in a triangulation of the image.
//! - [`horizon`]: culls objects below the skyline of houses and tree crowns.
//! - [`virtual_occluders`]: a few upright rectangles that stand for the occlusion of all houses around a
//!   viewcell.
//! - [`viewshed`]: which samples of a raster of heights an observer sees over the terrain.
#![no_std]
#![warn(missing_debug_implementations)]
#![forbid(unsafe_code)]
extern crate alloc;
#[cfg(any(feature = "std", test))]
extern crate std;

pub mod cdt;
mod directions;
pub mod discs;
pub mod horizon;
mod median_order;
#[cfg(feature = "serde")]
mod serde_records;
#[cfg(feature = "papers")]
pub mod view_cdt;
pub mod viewshed;
pub mod virtual_occluders;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
