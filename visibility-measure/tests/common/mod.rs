//! A view in which coordinates are pixels.

use visibility_core::glam::{DMat4, DVec4};
use visibility_core::{View, view::Depth};

/// Shows x right and y down, in pixels of a `width` x `height` image, nearer the smaller z, which is from 0
/// to 1.
pub(crate) fn pixels(width: f64, height: f64) -> View {
    let matrix = DMat4::from_cols(
        DVec4::X * 2.0 / width,
        DVec4::Y * -2.0 / height,
        DVec4::Z,
        DVec4::new(-1.0, 1.0, 0.0, 1.0),
    );
    View::from_clip_from_world(matrix, Depth::ZeroToOne).unwrap()
}
