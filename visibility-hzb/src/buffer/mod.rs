//! The depth buffer: tiles of 8 x 8 pixels, and a pyramid of minima above them.

#[cfg(test)]
mod cover_rule;
pub(crate) mod depth_planes;
pub(crate) mod pyramid;
pub(crate) mod row_spans;
mod tile_columns;
pub(crate) mod tile_layout;
pub(crate) mod tiles;
