//! Input triangles and intermediate polygons of the making of occluder polygons.

use alloc::vec::Vec;
use visibility_core::glam::DVec3;

/// A triangle of an occluder, in scene coordinates.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OccluderTriangle {
    /// Corners, counter-clockwise as seen from the front.
    pub(crate) corners: [DVec3; 3],
    /// Index of the triangle's object in the list of objects being processed.
    pub(crate) source: u32,
    /// Whether the triangle also hides for eyes behind it.
    pub(crate) two_sided: bool,
}

/// An occluder polygon under construction.
#[derive(Clone, Debug)]
pub(crate) struct Outline {
    /// Vertices in scene coordinates, counter-clockwise as seen from the front.
    pub(crate) vertices: Vec<DVec3>,
    /// Indices of the polygon's objects in the list of objects being processed, ascending.
    pub(crate) sources: Vec<u32>,
    /// For a section, the indices of the boxes that contain it; empty for other polygons.
    pub(crate) solids: Vec<u32>,
    /// Whether the polygon also hides for eyes behind it.
    pub(crate) two_sided: bool,
}
