//! Pictures of right (white) and wrong (red) pixels, as in the paper's figure 14.

use super::TriangleWorld;
use crate::walkthrough::canvas::{Canvas, Color};
use visibility_core::View;
use visibility_measure::{ItemBuffer, MeasureError, NONE};

const RIGHT: Color = [255, 255, 255];
const WRONG: Color = [214, 30, 30];
const NOTHING: Color = [40, 48, 64];

/// Draws which pixels of a view are right when only the triangles `drawn` are drawn: white if the visible
/// triangle is drawn, red if not, and dark where no triangle is visible. `drawn` are triangle indices in
/// ascending order; the last parameter is the picture's width and height in pixels.
///
/// # Errors
///
/// Returns [`MeasureError`] when the item buffer cannot have this size or the world has too many triangles.
pub fn right_and_wrong(
    world: &TriangleWorld,
    view: &View,
    drawn: &[u32],
    [width, height]: [u32; 2],
) -> Result<Canvas, MeasureError> {
    let mut buffer = ItemBuffer::new(width, height)?;
    let seen = world.see(view, &mut buffer)?;
    buffer.draw(view, world.scene.origin(), seen.candidates.iter().map(|&i| world.item(i)))?;
    let mut canvas = Canvas::new(width, height, NOTHING);
    for row in 0..height {
        for column in 0..width {
            let pane = buffer.see_through_item(column, row);
            let item = if pane != NONE { pane } else { buffer.items()[(row * width + column) as usize] };
            if item != NONE {
                let triangle = seen.candidates[item as usize];
                let right = drawn.binary_search(&triangle).is_ok();
                canvas.set(column.into(), row.into(), if right { RIGHT } else { WRONG });
            }
        }
    }
    Ok(canvas)
}
