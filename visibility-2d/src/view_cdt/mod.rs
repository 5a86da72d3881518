//! Conservative culling with a constrained Delaunay triangulation of the image.
//!
//! This work is based on: "CDT-Assisted Conservative Visibility and a Visibility API", a proposal of 1999 or
//! later without figures (`cdt-and-visapi`), after Kevin Weiler and Peter Atherton, "Hidden Surface Removal
//! Using Polygon Area Sorting", 1977.
//!
//! Outlines of occluders are entered front to back into a triangulation of the image, at object precision
//! instead of pixels: each triangle of the image is filled by one occluder, or open. A box is hidden if all
//! triangles that it meets are filled by nearer occluders, so several occluders together can hide a box that
//! none of them hides alone.
//!
//! Outlines are moved inwards to a grid of 2^20 by 2^20 points, and boxes outwards. Choices that the proposal
//! leaves open were measured, and only the winners kept. An occluder that others partly hide is cut at the
//! outlines that it crosses (leaving it out hid less on every scene). Each occluder stores depth planes
//! (cells of doubling distance hid less).
//!
//! - `screen.rs`: projection with bounds on rounding.
//! - `shape.rs`: the area that an occluder certainly covers, as half-planes, and its depth.
//! - `image.rs`: the triangulation with the occluder that fills each triangle.

mod image;
mod map;
mod screen;
mod shape;

pub use map::ViewCdt;
