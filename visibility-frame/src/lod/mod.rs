//! Levels of detail: small objects are not drawn; far objects are drawn in less detail, or replaced by a
//! parent.
//!
//! - [`ContributionCuller`] removes objects that are smaller than a number of pixels, out of their [draw
//!   range](visibility_core::scene::DrawRange), or [replaced](visibility_core::Scene::set_hlod_parent) by an
//!   HLOD parent.
//! - [`LodSelector`] gives each visible object its level of detail, with hysteresis and a cross-fade.
//! - [`PixelScale`] computes the size in pixels and the distance by which both decide.
//!
//! # Size and distance
//! The *distance* of an object is that from the eye to the nearest point of its bounds, 0 inside them. Where
//! one level of detail is the HLOD parent of another, the distance at which they change is measured to the
//! parent's bounds. The *size* of an object is the diameter in pixels of the sphere around its bounds (their
//! diagonal), as if the whole sphere were at that distance in the middle of the picture; infinite for an eye
//! inside the bounds. Turning the camera changes neither distance nor size. Towards the corners of a wide
//! picture, perspective draws objects larger than this size. In a parallel view the size does not depend on
//! the distance, and the distance counts as 0, since there is no eye to measure it from.
//!
//! Hiding small objects is an error that the user chose: cullers here are
//! [`Approximate`](visibility_core::Accuracy::Approximate), and `visibility-measure` counts their wrong
//! pixels. They do promise that no object as large as the limit is hidden for its size, whatever the
//! rounding.
//!
//! # Sources
//! - Funkhouser and Séquin, "Adaptive Display Algorithm for Interactive Frame Rates During Visualization of
//!   Complex Virtual Environments", 1993: levels by size on screen, with hysteresis.
//! - Erikson, Manocha and Baxter, "HLODs for Faster Display of Large Static and Dynamic Environments", 2001.

mod culler;
mod eye_box;
mod pixel_scale;
mod selector;
mod size_threshold;

pub use culler::ContributionCuller;
pub use pixel_scale::PixelScale;
pub use selector::{Lod, LodSelector};
pub(crate) use size_threshold::{SizeTest, small_boxes};
