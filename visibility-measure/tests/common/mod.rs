//! A view whose world coordinates are pixels, shared by the tests.

use visibility_core::glam::{DMat4, DVec4};
use visibility_core::{View, view::Depth};

/// Returns a parallel view in which world x points right and y down, in pixels of a `width` x `height` image.
/// z is the depth, from 0 (nearest) to 1.
pub(crate) fn pixels(width: f64, height: f64) -> View {
    let matrix = DMat4::from_cols(
        DVec4::X * 2.0 / width,
        DVec4::Y * -2.0 / height,
        DVec4::Z,
        DVec4::new(-1.0, 1.0, 0.0, 1.0),
    );
    View::from_clip_from_world(matrix, Depth::ZeroToOne).unwrap()
}
