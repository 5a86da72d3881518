//! Computes visibility on a plan: from walls, houses, hills and trees that stand on a ground.
//!
//! Much of what engines cull stands on a ground, and on a plan visibility is exact, cheap and of use by
//! itself: fog of war, guards, robots, perception, servers that decide who may see whom.
//!
//! - [`cdt`]: exact visibility among walls, which are segments, by a triangulation.
//! - [`discs`]: exact visibility among round obstacles, such as the trunks of a forest.
//! - `view_cdt` (feature `papers`, see `docs/papers.md` in the repository): culls in space behind outlines of
//!   occluders in a triangulation of the image.
//! - [`horizon`]: culls what is below the skyline of houses and crowns that stand on the ground.
//! - [`virtual_occluders`]: a few upright rectangles that stand for all that houses hide from a viewcell.
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
#[cfg(feature = "papers")]
pub mod view_cdt;
pub mod virtual_occluders;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
