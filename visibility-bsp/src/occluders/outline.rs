//! What occluder polygons are made from, and what they are while they are made.

use alloc::vec::Vec;
use visibility_core::glam::DVec3;

/// A triangle of an occluder, in scene coordinates.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OccluderTriangle {
    pub(crate) corners: [DVec3; 3],
    /// Which of the objects looked at it comes from.
    pub(crate) source: u32,
    pub(crate) two_sided: bool,
}

/// An occluder polygon under construction.
#[derive(Clone, Debug)]
pub(crate) struct Outline {
    pub(crate) vertices: Vec<DVec3>,
    pub(crate) sources: Vec<u32>,
    /// Of a section, the boxes that it is inside of.
    pub(crate) solids: Vec<u32>,
    pub(crate) two_sided: bool,
}
