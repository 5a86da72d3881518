//! Conservative culling with a constrained Delaunay triangulation of the image.
//!
//! This work is based on: "CDT-Assisted Conservative Visibility and a Visibility API", a proposal of 1999 or
//! later without figures (`cdt-and-visapi`), after Kevin Weiler and Peter Atherton, "Hidden Surface Removal
//! Using Polygon Area Sorting", 1977.
//!
//! Outlines of occluders are entered front to back into a triangulation of the image, at the precision of the
//! objects and not of pixels: a triangle of the image is filled by one occluder, or open. A box is hidden if
//! all triangles that it meets are filled by nearer occluders, so that several occluders hide together what
//! none of them hides alone.
//!
//! Outlines are moved inwards to a grid of 2^20 by 2^20 points, and boxes outwards. What the proposal leaves
//! open was measured, and what lost was deleted: an occluder that is partly hidden by others is cut at the
//! outlines that it crosses (left out, it hid less on every scene), and each occluder keeps planes of depth
//! (cells of doubling distance hid less).
//!
//! - `screen.rs`: projection with bounds on rounding.
//! - `shape.rs`: what an occluder certainly covers, as half-planes, and how far it is.
//! - `image.rs`: the triangulation with the occluder that fills each triangle.

mod image;
mod map;
mod screen;
mod shape;

pub use map::ViewCdt;
