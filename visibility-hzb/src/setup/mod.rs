//! Set-up of occluders for drawing: from scene coordinates to screen shapes.

pub(crate) mod box_join;
pub(crate) mod box_shape;
pub(crate) mod convex_shape;
pub(crate) mod depth_plane;
pub(crate) mod near_clip;
pub(crate) mod occluder_triangles;
pub(crate) mod screen_bounds;
pub(crate) mod screen_projection;
pub(crate) mod screen_shape;
