//! Picture of a viewcell from above: the objects that samples see, those that a method reports, and lines
//! that show how the method found its answer.

use super::output::Judged;
use super::trial::Trial;
use crate::walkthrough::World;
use crate::walkthrough::canvas::{Canvas, Color};
use crate::walkthrough::map_picture::Map;
use glam::{DVec3, Vec3};
use visibility_measure::MeasureError;

const PAPER: Color = [250, 250, 247];
const HIDDEN: Color = [205, 207, 210];
const REPORTED: Color = [244, 190, 92];
const SAMPLED: Color = [74, 152, 96];
const LOST: Color = [214, 32, 44];
const CELL: Color = [32, 84, 190];
const LINE: Color = [150, 120, 200];
const INK: Color = [40, 40, 40];
/// Height of the legend below the map, in pixels.
const LEGEND: u32 = 64;

/// Draws the answer of a trial. `lines` are segments in world space.
///
/// # Errors
///
/// Returns [`MeasureError`] when the item buffer cannot draw the map.
pub fn draw(
    world: &World,
    judged: &Judged,
    trial: &Trial,
    lines: &[[DVec3; 2]],
) -> Result<Canvas, MeasureError> {
    let (low, high) = world.source.bounds().unwrap_or((Vec3::ZERO, Vec3::ONE));
    let (cell_min, cell_max) = (judged.cell.min, judged.cell.max);
    let map = Map::of(world, low.as_dvec3().min(cell_min), high.as_dvec3().max(cell_max));
    let mut canvas = Canvas::new(map.width, map.height + LEGEND, PAPER);
    let lost = judged.false_hidden(trial);
    let color = |object: u32| {
        let sampled = judged.sampled[object as usize];
        match trial.reported.binary_search(&object).is_ok() {
            true if sampled => SAMPLED,
            true => REPORTED,
            false if sampled => LOST,
            false => HIDDEN,
        }
    };
    map.paint(&mut canvas, world, |_, _| true, color)?;
    for [from, to] in lines {
        canvas.line(map.place(*from), map.place(*to), LINE);
    }
    let corner =
        |right: DVec3, ahead: DVec3| map.right * right.dot(map.right) + map.ahead * ahead.dot(map.ahead);
    let outline = [
        corner(cell_min, cell_min),
        corner(cell_max, cell_min),
        corner(cell_max, cell_max),
        corner(cell_min, cell_max),
    ];
    for (i, &from) in outline.iter().enumerate() {
        canvas.line(map.place(from), map.place(outline[(i + 1) % 4]), CELL);
    }
    for &object in &lost {
        if let Some((low, high)) = world.source.objects[object as usize].bounds() {
            canvas.disc(map.place(((low + high) * 0.5).as_dvec3()), 14.0, true, LOST);
        }
    }
    let top = i64::from(map.height) + 8;
    canvas.rectangle(0, map.height.into(), map.width.into(), LEGEND.into(), PAPER);
    let title = format!(
        "{} from above, {} ({}): {} objects, {} sampled, {} reported, {} sampled but hidden",
        world.source.name,
        trial.method,
        trial.accuracy,
        world.source.objects.len(),
        judged.sampled_count(),
        trial.reported.len(),
        lost.len(),
    );
    canvas.text(10, top, &title, INK);
    let entries = [
        (SAMPLED, "sampled"),
        (REPORTED, "reported, not sampled"),
        (HIDDEN, "hidden"),
        (LOST, "sampled, but hidden"),
        (CELL, "viewcell"),
        (LINE, "how it was found"),
    ];
    canvas.legend(10, top + 20, &entries, INK);
    Ok(canvas)
}
