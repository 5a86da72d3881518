//! Picture of the objects that the eye sees, each in its own color.

use super::World;
use super::canvas::{Canvas, Color};
use glam::Vec3;
use visibility_core::View;
use visibility_measure::{ItemBuffer, MeasureError, NONE};

pub(crate) const SKY: Color = [198, 215, 232];
const MARK: [f32; 3] = [1.0, 0.1, 0.1];

/// Selection and marking of the objects in a picture from the eye.
#[derive(Clone, Copy, Default)]
pub struct Shown<'a> {
    /// Indices, ascending, of the only objects that are drawn. `None` draws all objects.
    pub only: Option<&'a [u32]>,
    /// Index of an object that is drawn in red, or `None`.
    pub marked: Option<u32>,
}

/// Draws the objects that a view sees. Each object has its own color, and faces are shaded by their direction
/// so that shapes are recognizable. The nearest see-through object of a pixel tints what is behind it.
///
/// # Errors
///
/// Returns [`MeasureError`] when the item buffer cannot draw the world.
pub fn draw(world: &World, view: &View, shown: Shown<'_>) -> Result<Canvas, MeasureError> {
    let (width, height) = world.size;
    let mut buffer = ItemBuffer::new(width, height)?;
    let is_shown = |object: &u32| shown.only.is_none_or(|only| only.binary_search(object).is_ok());
    buffer.draw(view, world.origin(), world.items().filter(|item| is_shown(&item.key)))?;
    let mut canvas = Canvas::new(width, height, SKY);
    for row in 0..height {
        for column in 0..width {
            let color_of = |item: u32| {
                let Some((object, triangle)) = world.drawn_triangle(buffer.visible(), item) else {
                    return SKY;
                };
                let color = if shown.marked == Some(object) { MARK } else { own_color(object as usize) };
                shade(color, &triangle)
            };
            let item = buffer.items()[row as usize * width as usize + column as usize];
            let mut color = if item == NONE { SKY } else { color_of(item) };
            let pane = buffer.see_through_item(column, row);
            if pane != NONE {
                let tint = color_of(pane);
                color = std::array::from_fn(|i| ((2 * u16::from(color[i]) + u16::from(tint[i])) / 3) as u8);
            }
            canvas.set(column.into(), row.into(), color);
        }
    }
    Ok(canvas)
}

/// Returns a color, as fractions from 0 to 1, that differs from those of objects with neighbouring indices:
/// consecutive hues are a golden section of the circle apart, at two brightnesses.
fn own_color(object: usize) -> [f32; 3] {
    let hue = (object as f64 * 0.618_033_988_75).fract() as f32 * 6.0;
    let strength = if object.is_multiple_of(2) { 0.55 } else { 0.35 };
    // The distance of the hue from red, green and blue determines each channel, as in the usual conversion
    // from HSV.
    [0.0, 2.0, 4.0].map(|primary| {
        let distance = (hue - primary).rem_euclid(6.0);
        let level = ((distance - 3.0).abs() - 1.0).clamp(0.0, 1.0);
        1.0 - strength * (1.0 - level)
    })
}

/// Returns a color, given as fractions from 0 to 1, shaded by the direction of a triangle.
pub(crate) fn shade(color: [f32; 3], triangle: &[Vec3; 3]) -> Color {
    let [a, b, c] = *triangle;
    let normal = (b - a).cross(c - a).normalize_or_zero();
    let light = 0.55 + 0.45 * normal.dot(Vec3::new(0.48, 0.64, 0.6)).abs();
    color.map(|level| (level * light * 255.0) as u8)
}
