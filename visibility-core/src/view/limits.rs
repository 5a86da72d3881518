//! How many planes a view can have.

/// The most planes that a view can have.
pub const MAX_PLANES: usize = 16;

/// The most planes that [`View::with_clip_planes`](crate::View::with_clip_planes) takes: what is left beside
/// the six of the clip matrix.
pub const MAX_CLIP_PLANES: usize = MAX_PLANES - 6;
