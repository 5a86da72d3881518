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
//! open are settings: see [`PartlyHidden`] and [`DepthOrder`].
//!
//! - `screen.rs`: projection with bounds on rounding.
//! - `shape.rs`: what an occluder certainly covers, as half-planes, and how far it is.
//! - `image.rs`: the triangulation with the occluder that fills each triangle.

mod image;
mod map;
mod screen;
mod shape;

pub use map::ViewCdt;

/// What becomes of an occluder that is partly hidden by others.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum PartlyHidden {
    /// The outline of the occluder is cut at the outlines that it crosses, and what was open is filled.
    #[default]
    Split,
    /// The occluder is left out. Hides less, in less time.
    LeftOut,
}

/// How the map knows which occluders are nearer than a box.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum DepthOrder {
    /// Planes of depth are kept for each occluder. Boxes and occluders may come in any order.
    #[default]
    Planes,
    /// Space is divided into cells one behind the other: each begins at twice the distance of the one before,
    /// in a parallel view at multiples of a 16th of the depth range. An occluder within one cell hides what
    /// begins in a later cell; what is in the same cell counts as visible.
    Cells {
        /// Whether occluders that are incident on several cells keep their planes of depth. If not, they are
        /// left out.
        incident: bool,
    },
}
