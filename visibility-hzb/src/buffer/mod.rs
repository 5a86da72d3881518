//! The depth buffer: tiles of 8 x 8 pixels, and a pyramid of minima above them.

pub(crate) mod depth_planes;
pub(crate) mod pyramid;
pub(crate) mod row_spans;
pub(crate) mod tile_layout;
mod tile_rows;
pub(crate) mod tiles;
