//! Tests of boxes against the buffer.

pub(crate) mod box_face_planes;
pub(crate) mod box_projection;
pub(crate) mod box_query;
pub(crate) mod box_queue;
pub(crate) mod face_query;
pub(crate) mod occluder_query;
