//! Pictures of a bake from above: a heat map of the gaps of all viewcells, and the objects seen from the
//! viewcells with the greatest gaps.

use super::level::Level;
use super::report::{Cell, Report};
use crate::region::picture::{LEGEND, outline};
use crate::walkthrough::World;
use crate::walkthrough::canvas::{Canvas, Color};
use crate::walkthrough::map_picture::Map;
use crate::walkthrough::palette::{HIDDEN, INK, PAPER, REPORTED, VIEW, VISIBLE};
use glam::DVec3;
use std::fmt::Write;
use std::path::Path;
use visibility_bake::CellSandwich;

/// Number of viewcells that get pictures of their own: those with the largest share of undecided triangles.
const WORST: usize = 4;

/// Colors of the heat map: for a viewcell without undecided triangles (no gap), with half the greatest gap,
/// and with the greatest gap.
const RAMP: [Color; 3] = [VISIBLE, [246, 222, 110], [190, 28, 40]];

/// Writes the pictures of a bake to a folder: `gaps.png` and `gaps.svg`, and `worst-N.png` for viewcell N.
///
/// # Errors
///
/// Returns a message if a picture cannot be drawn or written.
pub fn draw(level: &Level, cells: &[CellSandwich], report: &Report, folder: &Path) -> Result<(), String> {
    let world = level.world().ok_or("pictures need the scene in memory: leave out --memory")?;
    std::fs::create_dir_all(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for cell in level.viewcells.cells() {
        (low, high) = (low.min(cell.min), high.max(cell.max));
    }
    let map = Map::of(world, low, high);
    let greatest = report.viewcells.iter().map(|cell| cell.gap).fold(0.0, f64::max);
    // Viewcells with greater gaps are drawn later, on top of viewcells above or below them.
    let mut order: Vec<(usize, &Cell)> = report.viewcells.iter().enumerate().collect();
    order.sort_by(|(_, a), (_, b)| a.gap.total_cmp(&b.gap));
    let tiles: Vec<Tile<'_>> = order
        .iter()
        .map(|&(number, cell)| Tile {
            number,
            cell,
            color: color(cell.gap, greatest),
            bounds_px: bounds_px(&map, cell),
        })
        .collect();

    let mut canvas = Canvas::new(map.width, map.height + LEGEND, PAPER);
    map.paint(&mut canvas, world, |_, _| true, |_| HIDDEN).map_err(|error| error.to_string())?;
    for Tile { color, bounds_px: [x, y, width, height], .. } in &tiles {
        let (width, height) = (width.ceil().max(2.0) as i64, height.ceil().max(2.0) as i64);
        canvas.rectangle(*x as i64, *y as i64, width, height, *color);
    }
    let title = title(report);
    let [none, half, all] = [0.0, greatest * 50.0, greatest * 100.0].map(|part| format!("{part:.1} %"));
    legend(&mut canvas, &map, &title, &[(RAMP[0], &none), (RAMP[1], &half), (RAMP[2], &all)]);
    canvas.save(&folder.join("gaps.png"))?;
    crate::output_file::write(
        &folder.join("gaps.svg"),
        svg([map.width, map.height], &title, &tiles).as_bytes(),
    )?;

    for &(number, cell) in order.iter().rev().take(WORST).filter(|(_, cell)| cell.gap > 0.0) {
        let picture = draw_viewcell(level, world, number, &cells[number], cell)?;
        picture.save(&folder.join(format!("worst-{number}.png")))?;
    }
    Ok(())
}

/// A viewcell on the heat map.
struct Tile<'a> {
    number: usize,
    cell: &'a Cell,
    color: Color,
    /// Left, top, width and height in pixels.
    bounds_px: [f64; 4],
}

/// Returns left, top, width and height in pixels of a viewcell on a map.
fn bounds_px(map: &Map, cell: &Cell) -> [f64; 4] {
    let [a, b, c, d, e, f] = cell.cell;
    let [p, q] = [map.place(DVec3::new(a, b, c)), map.place(DVec3::new(d, e, f))];
    [p[0].min(q[0]), p[1].min(q[1]), (p[0] - q[0]).abs(), (p[1] - q[1]).abs()]
}

/// Returns the color of a gap (a viewcell's share of undecided triangles), on a scale that ends at the
/// greatest gap.
fn color(gap: f64, greatest: f64) -> Color {
    let at = if greatest > 0.0 { (gap / greatest * 2.0).clamp(0.0, 2.0) } else { 0.0 };
    let (first, part) = if at < 1.0 { (0, at) } else { (1, at - 1.0) };
    let mix = |channel: usize| {
        let [from, to] = [first, first + 1].map(|i| f64::from(RAMP[i][channel]));
        (from + (to - from) * part).round() as u8
    };
    [mix(0), mix(1), mix(2)]
}

/// Returns the title of the heat map.
fn title(report: &Report) -> String {
    let (count, gap) = (report.viewcells.len(), report.gap * 100.0);
    format!("{}: triangles neither seen nor proven hidden, {gap:.2} % over {count} viewcells", report.scene)
}

/// Returns the heat map as SVG. The tooltip of each viewcell shows its numbers.
fn svg([width, height]: [u32; 2], title: &str, tiles: &[Tile<'_>]) -> String {
    let plain = title.replace('&', "&amp;").replace('<', "&lt;");
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\">\n<title>{plain}</title>\n"
    );
    for Tile { number, cell, color: [r, g, b], bounds_px: [x, y, width, height] } in tiles {
        let (gap, seen, open) = (cell.gap * 100.0, cell.seen, cell.open);
        // Writing to a string cannot fail.
        let _ = writeln!(
            svg,
            "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{width:.1}\" height=\"{height:.1}\" \
             fill=\"#{r:02x}{g:02x}{b:02x}\"><title>viewcell {number}: {gap:.1} %, {seen} seen, {open} open\
             </title></rect>"
        );
    }
    svg + "</svg>\n"
}

/// Draws one viewcell, and all objects in the colors of seen, open and hidden ones.
fn draw_viewcell(
    level: &Level,
    world: &World,
    number: usize,
    found: &CellSandwich,
    cell: &Cell,
) -> Result<Canvas, String> {
    let viewcell = &level.viewcells.cells()[number];
    let (low, high) = world.source.bounds().unwrap_or_default();
    let map = Map::of(world, low.as_dvec3().min(viewcell.min), high.as_dvec3().max(viewcell.max));
    let mut canvas = Canvas::new(map.width, map.height + LEGEND, PAPER);
    let color = |object: u32| {
        if found.seen.binary_search(&object).is_ok() {
            VISIBLE
        } else if found.open.binary_search(&object).is_ok() {
            REPORTED
        } else {
            HIDDEN
        }
    };
    map.paint(&mut canvas, world, |_, _| true, color).map_err(|error| error.to_string())?;
    let corners = outline(viewcell, map.right, map.ahead);
    for (i, &from) in corners.iter().enumerate() {
        canvas.line(map.place(from), map.place(corners[(i + 1) % corners.len()]), VIEW);
    }
    let title = format!(
        "{}, viewcell {number}: {} objects seen, {} open, gap {:.1} %",
        world.source.name,
        cell.seen,
        cell.open,
        cell.gap * 100.0
    );
    let entries = [(VISIBLE, "seen"), (REPORTED, "open"), (HIDDEN, "hidden"), (VIEW, "viewcell")];
    legend(&mut canvas, &map, &title, &entries);
    Ok(canvas)
}

/// Draws a title and the meanings of colors below a map.
fn legend(canvas: &mut Canvas, map: &Map, title: &str, entries: &[(Color, &str)]) {
    canvas.rectangle(0, map.height.into(), map.width.into(), LEGEND.into(), PAPER);
    let top = i64::from(map.height) + 8;
    canvas.text(10, top, title, INK);
    canvas.legend(10, top + 20, entries, INK);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bake::{Degrees, Run, run};
    use std::time::Duration;

    #[test]
    fn colors_run_from_no_gap_to_the_greatest() {
        assert_eq!(
            [0.0, 0.1, 0.2, 9.0].map(|gap| color(gap, 0.2)),
            [RAMP[0], RAMP[1], RAMP[2], RAMP[2]],
            "colours from no gap to more than the greatest"
        );
        assert_eq!(color(0.05, 0.2), [160, 187, 103], "a quarter of the greatest gap");
        assert_eq!(color(0.0, 0.0), RAMP[0], "no gap where the greatest is 0");
    }

    #[test]
    fn a_bake_has_its_pictures() {
        let folder = std::env::temp_dir().join(format!("bake-pictures-{}", std::process::id()));
        let level = Level::of_eight_viewcells();
        let settings =
            Run { threads: 1, limit: None, save_every: Duration::from_secs(60), state: folder.join("state") };
        let outcome = run(|| level.baker(), &settings, |_| {}).unwrap();
        let set = level.set(outcome.source, &outcome.cells, &Degrees::default()).unwrap();
        let report = Report::new(&level, &outcome.cells, &outcome.times, &set, 0.0, true);
        assert!(
            report.viewcells.iter().all(|cell| cell.seconds.sweep > 0.0 && cell.seconds.rays > 0.0),
            "each viewcell has times"
        );
        draw(&level, &outcome.cells, &report, &folder).unwrap();
        let svg = std::fs::read_to_string(folder.join("gaps.svg")).unwrap();
        assert_eq!(svg.matches("<rect ").count(), 8, "rectangles: viewcells in the picture");
        let decoder =
            png::Decoder::new(std::io::BufReader::new(std::fs::File::open(folder.join("gaps.png")).unwrap()));
        let mut reader = decoder.read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        let has = |color: Color| pixels.chunks_exact(3).any(|pixel| pixel == color);
        let worst = report.viewcells.iter().map(|cell| cell.gap).fold(0.0, f64::max);
        assert!(
            worst > 0.0 && report.viewcells.iter().all(|cell| has(color(cell.gap, worst))),
            "the colour of each viewcell is in the picture, the worst gap {worst}"
        );
        let names = std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().file_name());
        let own = names.filter(|name| name.to_string_lossy().starts_with("worst-")).count();
        assert_eq!(
            own,
            report.viewcells.iter().filter(|cell| cell.gap > 0.0).count().min(WORST),
            "pictures of the worst viewcells"
        );
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
