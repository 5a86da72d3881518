//! Output of points, as CSV for programs and as a table for people.

use super::pareto::best;
use super::point::Point;
use comfy_table::{CellAlignment, Table, presets};
use std::io::Write;
use visibility_core::Accuracy;

/// Writes all points as CSV, a line per point below a line of column names. Returns the error of the writer.
pub fn csv(out: impl Write, points: &[Point]) -> csv::Result<()> {
    let mut writer = csv::Writer::from_writer(out);
    points.iter().try_for_each(|point| writer.serialize(point))?;
    writer.flush()?;
    Ok(())
}

/// Returns the point with the least time to cull and draw, among the points that hid no visible object. With
/// `needed`, only points of exact or conservative cullers are considered. `None` if no point qualifies.
pub fn best_sound(points: &[Point], needed: bool) -> Option<&Point> {
    let safe = [Accuracy::Exact, Accuracy::Conservative].map(Accuracy::name);
    let promises = |point: &&Point| !needed || safe.contains(&point.accuracy);
    let sound = points.iter().filter(|point| point.false_hidden == 0).filter(promises);
    sound.min_by(|a, b| a.total_us().total_cmp(&b.total_us()))
}

/// Formats the Pareto-optimal points among `points` as a table, by ascending time per frame. All points must
/// be of one scene.
pub fn table(points: &[Point]) -> Table {
    let mut table = Table::new();
    table.load_style(presets::UTF8_HORIZONTAL_ONLY).set_header([
        "culler",
        "promises",
        "us a frame",
        "with drawing",
        "/ ideal",
        "reported",
        "/ limit",
        "overdraw",
        "hidden",
        "wrong pixels",
        "memory",
        "prepared",
    ]);
    for point in best(points).into_iter().map(|index| &points[index]) {
        table.add_row([
            point.culler.clone(),
            point.accuracy.to_owned(),
            format!("{:.1}", point.frame_us),
            format!("{:.0}", point.total_us()),
            format!("{:.1}", point.over_ideal),
            format!("{:.1}", point.objects),
            format!("{:.2}", point.objects / point.box_limit.max(1.0)),
            format!("{:.2}", point.overdraw()),
            point.false_hidden.to_string(),
            format!("{:.3} %", point.wrong_pixels_percent),
            format!("{:.2} MB", point.memory_bytes as f64 / 1e6),
            format!("{:.0} ms", point.preparation_ms),
        ]);
    }
    for column in table.column_iter_mut().skip(2) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

/// Explanation of the columns of [`table`], to be printed below it.
pub const LEGEND: &str = "\
Listed are the points that no other beats in time, triangles drawn and wrong pixels at once.
us a frame: median time to cull a frame, one thread; reported: objects a frame
with drawing: the same and 1 us for each object reported and 1 us for a thousand triangles of them
/ ideal: the same over the time to draw the visible triangles of the visible objects alone, without any time to cull
/ limit: reported objects for each one that a culler must report which tests only boxes (a pixel is free for its box)
overdraw: triangles of the reported objects for each triangle of which a pixel shows
hidden: visible objects that the culler hid, all frames together; wrong pixels: share of the picture
memory, prepared: what the culler holds besides the scene, and how long it took to make it ready";
