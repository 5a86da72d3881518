//! Limits on the number of planes of a view.

/// Greatest number of planes of a view: the six of the clip matrix and its clip planes. Fixes the size of
/// plane arrays and of plane masks.
pub const MAX_PLANES: usize = 16;

/// Greatest number of planes that [`View::with_clip_planes`](crate::View::with_clip_planes) accepts:
/// [`MAX_PLANES`] less the six planes of the clip matrix.
pub const MAX_CLIP_PLANES: usize = MAX_PLANES - 6;
