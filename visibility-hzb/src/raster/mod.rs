//! Occluders drawn into the tiles of the buffer.

pub(crate) mod contour_raster;
pub(crate) mod mesh_raster;
#[cfg(test)]
mod mesh_sides;
pub(crate) mod parallax;
pub(crate) mod shape_fill;
