//! Occluders of a level, drawn at the beginning of a frame: nearest clusters first, each polygon by its
//! outline, at one plane of depth.

mod clip;
mod draw;
mod edges;
mod fill;
mod frame;
mod prepared;
mod union;
mod vertices;

pub(crate) use draw::{LevelScratch, draw_level};
pub(crate) use frame::LevelFrame;
pub(crate) use prepared::PreparedLevel;
