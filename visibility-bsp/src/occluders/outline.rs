//! Input triangles and intermediate polygons of the making of occluder polygons.

use alloc::vec::Vec;
use visibility_core::glam::DVec3;

/// A triangle of an occluder, in metres relative to `Scene::origin`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OccluderTriangle {
    /// Corners in metres relative to `Scene::origin`, counter-clockwise as seen from the front.
    pub(crate) corners: [DVec3; 3],
    /// Index of the triangle's object in the list of objects given to `Occluders::add_from`.
    pub(crate) source: u32,
    /// Whether the triangle also hides for eyes behind its front; if false, only for eyes in front.
    pub(crate) two_sided: bool,
}

/// An occluder polygon under construction, not yet stored in `Occluders`.
#[derive(Clone, Debug)]
pub(crate) struct Outline {
    /// Vertices in metres relative to `Scene::origin`, counter-clockwise as seen from the front.
    pub(crate) vertices: Vec<DVec3>,
    /// Vertices of the polygon's triangles that are not in `vertices`, since other triangles surround them,
    /// in metres relative to `Scene::origin`.
    pub(crate) inner: Vec<DVec3>,
    /// Indices of the polygon's objects in the list given to `Occluders::add_from`, ascending.
    pub(crate) sources: Vec<u32>,
    /// For a section (a rectangle inside closed boxes): indices of these boxes in the list returned by
    /// `sections::solids`. Empty for other polygons.
    pub(crate) solids: Vec<u32>,
    /// Whether the polygon also hides for eyes behind its front; if false, only for eyes in front.
    pub(crate) two_sided: bool,
}
