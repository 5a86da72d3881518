//! Levels of detail: small objects are not drawn, far ones cheaper or by a stand-in.
//!
//! - [`ContributionCuller`] removes objects that are smaller than a number of pixels, out of their [draw
//!   range](visibility_core::scene::DrawRange), or [stood in for](visibility_core::Scene::set_hlod_parent) by
//!   an HLOD parent.
//! - [`LodSelector`] gives each visible object its level of detail, with hysteresis and a cross-fade.
//! - [`PixelScale`] tells the size in pixels and the distance that both decide by.
//!
//! # Size and distance
//! The *distance* of an object is that from the eye to the nearest point of its bounds, 0 inside them. Where
//! one level of detail is the HLOD parent of another, the distance at which they change is measured to the
//! parent's bounds. The *size* of an object is the diameter of the sphere around its bounds, which is their
//! diagonal, in pixels in the middle of the picture, as if the whole sphere were at that distance: infinite
//! for an eye inside the bounds. Turning the camera changes neither, so nothing changes where only the view
//! direction does; towards the corners of a wide picture perspective stretches objects beyond this size. In a
//! parallel view the size does not depend on the distance, and the distance counts as 0, since there is no
//! eye to measure it from.
//!
//! Hiding what is small is an error that the user chose: cullers here are
//! [`Approximate`](visibility_core::Accuracy::Approximate), and `visibility-measure` counts their wrong
//! pixels. What they promise is the other half: no object as large as the limit is hidden, whatever the
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
