//! What the eye sees, coloured by object.

use super::World;
use super::canvas::{Canvas, Color};
use glam::Vec3;
use visibility_core::measure::{ItemBuffer, MeasureError, NONE};

const SKY: Color = [198, 215, 232];

/// Draws a frame: each object in a color of its own, faces shaded by their direction so that shapes can be made out.
pub fn draw(world: &World, frame: usize) -> Result<Canvas, MeasureError> {
    let (width, height) = world.size;
    let mut buffer = ItemBuffer::new(width, height)?;
    buffer.draw(&world.views[frame], world.origin(), world.items())?;
    let triangles: Vec<_> = world.source.objects.iter().flat_map(|object| &object.triangles).collect();
    let mut canvas = Canvas::new(width, height, SKY);
    for row in 0..height {
        for column in 0..width {
            let item = buffer.items()[row as usize * width as usize + column as usize];
            if let (true, Some(object)) = (item != NONE, buffer.object_at(column, row)) {
                let color = shade(own_color(object), triangles[item as usize]);
                canvas.set(column.into(), row.into(), color);
            }
        }
    }
    Ok(canvas)
}

/// A color that tells an object from its neighbours: hues a golden section of the circle apart, two brightnesses.
fn own_color(object: usize) -> [f32; 3] {
    let hue = (object as f64 * 0.618_033_988_75).fract() as f32 * 6.0;
    let strength = if object.is_multiple_of(2) { 0.55 } else { 0.35 };
    // How far a hue is from red, green and blue, as in any textbook's conversion.
    [0.0, 2.0, 4.0].map(|primary| {
        let distance = (hue - primary).rem_euclid(6.0);
        let level = ((distance - 3.0).abs() - 1.0).clamp(0.0, 1.0);
        1.0 - strength * (1.0 - level)
    })
}

fn shade(color: [f32; 3], triangle: &[Vec3; 3]) -> Color {
    let [a, b, c] = *triangle;
    let normal = (b - a).cross(c - a).normalize_or_zero();
    let light = 0.55 + 0.45 * normal.dot(Vec3::new(0.48, 0.64, 0.6)).abs();
    color.map(|level| (level * light * 255.0) as u8)
}
