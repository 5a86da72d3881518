//! Pictures of a hierarchical z-buffer: its pixels, and each level of its pyramid.

use crate::walkthrough::canvas::Canvas;
use std::path::Path;
use visibility_hzb::Hzb;

/// Writes `pixels.png` and `level-0.png` (tiles of 8 x 8 pixels) up to the level of a single texel. Near is
/// bright, far is dark, and blue marks texels that no occluder covers entirely. All pictures share one scale
/// of brightness.
///
/// # Errors
///
/// Returns a message when the folder or a file cannot be written.
pub fn save(hzb: &Hzb, folder: &Path) -> Result<(), String> {
    std::fs::create_dir_all(folder).map_err(|error| format!("cannot make {}: {error}", folder.display()))?;
    let pixels: Vec<f32> = (0..hzb.height())
        .flat_map(|row| (0..hzb.width()).map(move |column| hzb.depth_key(column, row)))
        .collect();
    // All levels share one scale: the range of depth keys of the pixels.
    let known = || pixels.iter().copied().filter(|nearness| nearness.is_finite());
    let (least, most) = (known().fold(f32::INFINITY, f32::min), known().fold(f32::NEG_INFINITY, f32::max));
    let draw = |columns: usize, rows: usize, values: &[f32], name: &str| {
        let mut canvas = Canvas::new(columns as u32, rows as u32, [20, 30, 90]);
        for (i, &nearness) in values.iter().enumerate().filter(|(_, nearness)| nearness.is_finite()) {
            // A depth key is proportional to 1/w; its fourth root makes far surfaces distinguishable, too.
            let share = ((nearness - least) / (most - least).max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
            let gray = (30.0 + 225.0 * share.sqrt().sqrt()) as u8;
            canvas.set((i % columns) as i64, (i / columns) as i64, [gray; 3]);
        }
        canvas.save(&folder.join(name))
    };
    draw(hzb.width(), hzb.height(), &pixels, "pixels.png")?;
    for level in 0..hzb.levels() {
        if let Some((columns, rows, values)) = hzb.level(level) {
            draw(columns, rows, values, &format!("level-{level}.png"))?;
        }
    }
    Ok(())
}
