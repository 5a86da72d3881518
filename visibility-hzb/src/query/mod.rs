//! Tests of boxes against the buffer.

pub(crate) mod box_face_planes;
pub(crate) mod box_projection;
pub(crate) mod box_query;
pub(crate) mod box_queue;
pub(crate) mod face_query;
pub(crate) mod occluder_query;

use crate::buffer::pyramid::Pyramid;
use crate::buffer::tiles::Tiles;
use box_face_planes::FacePlaneSetup;
use box_projection::ScreenProjection32;

/// Parts of a z-buffer that a test of boxes reads: the view's projection, the tiles, the pyramid above them,
/// and bounds.
#[derive(Clone, Copy)]
pub(crate) struct BoxQuery<'a> {
    /// Projection of the current view.
    pub(crate) projection: &'a ScreenProjection32,
    /// Covered pixels and depth keys of all tiles.
    pub(crate) tiles: &'a Tiles,
    /// Pyramid of least depth keys (greater is nearer) above the tiles. May be older than `tiles`, which is
    /// conservative.
    pub(crate) pyramid: &'a Pyramid,
    /// Precomputed terms of the current view, with which the planes of a box's faces give bounds on the
    /// box's depth key.
    pub(crate) faces: &'a FacePlaneSetup,
    /// Upper bound on all depth keys in the buffer (greater is nearer). Negative infinity if the buffer is
    /// empty.
    pub(crate) nearest: f32,
}
