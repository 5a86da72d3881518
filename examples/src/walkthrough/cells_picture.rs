//! Picture of portal culling: a plan of the storey with the eye, the visible cells, the visible part of each
//! portal, and for each visible cell a ray from the eye through all portals on the way.

use super::canvas::{Canvas, Color, LETTER};
use super::map_picture::Map;
use super::{Trial, World, cullers};
use crate::source::SourceCells;
use glam::DVec3;
use visibility_core::{Culler, VisibleSet, cells::CellId, geometry::Plane, pvs::Viewcell};
use visibility_measure::MeasureError;

const PAPER: Color = [250, 250, 247];
/// Color of cells that are not seen from the eye.
const CELL: Color = [232, 232, 230];
const SEEN: Color = [255, 243, 196];
/// Color of the cell that contains the eye.
const BEGINS: Color = [255, 226, 138];
const WALL: Color = [120, 120, 120];
const PORTAL: Color = [150, 190, 235];
/// Color of the part of a portal that is visible from the eye.
const WINDOW: Color = [206, 66, 20];
/// Color of the eye and the stabbing lines.
const LINE: Color = [32, 84, 190];
const VISIBLE: Color = [74, 152, 96];
const FALSE_VISIBLE: Color = [228, 160, 50];
const CULLED: Color = [190, 192, 196];
const INK: Color = [40, 40, 40];
/// Height of the legend, in pixels.
const LEGEND: u32 = 84;
/// Fraction of the map's area above which an object counts as floor or ceiling and is not drawn.
const GROUND: f64 = 0.02;

/// Draws a frame. `exact` are the visible objects of the frame by ascending index. The inner `Err` is the
/// reason why there is no picture: the scene has no cells, or the frame was not culled by portals.
///
/// # Errors
///
/// Returns [`MeasureError`] when the item buffer cannot draw the plan.
pub fn draw(
    world: &World,
    trial: &Trial,
    exact: &[u32],
    frame: usize,
) -> Result<Result<Canvas, String>, MeasureError> {
    let Ok(cells) = world.cells_to_look_through() else { return Ok(Err("no cells".into())) };
    let dial = trial.name.contains("rectangle").then_some("rectangle");
    let mut culler = match cullers::portals::portals(dial, world) {
        Ok(culler) => culler,
        Err(why) => return Ok(Err(why)),
    };
    let mut visible = VisibleSet::new();
    visible.fill(&world.scene, &world.views[frame]);
    culler.cull(&world.scene, &world.views[frame], &mut visible);
    let seen: Vec<CellId> = culler.eye().seen_cells().collect();
    if seen.is_empty() {
        return Ok(Err(format!("{:?}", culler.eye().stats().fallback)));
    }
    let eye = world.poses[frame].0.eye;
    let (mut low, mut high) = (eye, eye);
    for cell in &seen {
        let cell = &cells.viewcells.cells()[cell.index()];
        (low, high) = (low.min(cell.min), high.max(cell.max));
    }
    let map = Map::of(world, low, high);
    let mut canvas = Canvas::new(map.width, map.height + LEGEND, PAPER);
    let plan: Vec<_> = cells.viewcells.cells().iter().map(|cell| footprint(&map, cell, eye)).collect();
    for (number, outline) in (0..).map(CellId).zip(&plan) {
        let color = match seen.contains(&number) {
            true if culler.eye().path_to(number).next().is_none() => BEGINS,
            true => SEEN,
            false => CELL,
        };
        fill(&mut canvas, outline, map.height, color);
    }
    let on_storey = |object: u32| {
        let bounds = world.source.objects.get(object as usize).and_then(|object| object.bounds());
        let (at, up) = (eye.dot(map.up), map.up);
        // An object is on the eye's storey if it reaches into the height range from 1.7 m below to 0.5 m
        // above the eye.
        bounds.is_some_and(|(low, high)| {
            let (a, b) = (low.as_dvec3().dot(up), high.as_dvec3().dot(up));
            a.min(b) < at + 0.5 && a.max(b) > at - 1.7
        })
    };
    let reported = &trial.reported[frame];
    map.paint(
        &mut canvas,
        world,
        |object, share| share < GROUND && on_storey(object),
        |object| match reported.binary_search(&object).is_ok() {
            true if exact.binary_search(&object).is_ok() => VISIBLE,
            true => FALSE_VISIBLE,
            false => CULLED,
        },
    )?;
    for outline in &plan {
        for (i, &a) in outline.iter().enumerate() {
            canvas.line(a, outline[(i + 1) % outline.len()], WALL);
        }
    }
    let is_near = |portal: &visibility_core::cells::Portal| {
        portal.cells().iter().any(|cell| !plan[cell.index()].is_empty())
    };
    for portal in cells.graph.portals().iter().filter(|portal| is_near(portal)) {
        thick(&mut canvas, &map, portal.polygon().vertices().iter().copied(), PORTAL);
    }
    for (_, cell, corners) in culler.eye().windows() {
        let corners: Vec<DVec3> = corners.collect();
        let middle = corners.iter().sum::<DVec3>() / corners.len() as f64;
        // The line ends at the boundary of the cell, since it is only known to be unobstructed inside the
        // cell.
        let beyond = leave(&cells.viewcells.cells()[cell.index()], eye, middle);
        canvas.line(map.place(eye), map.place(beyond), LINE);
    }
    for (_, _, corners) in culler.eye().windows() {
        thick(&mut canvas, &map, corners, WINDOW);
    }
    canvas.disc(map.place(eye), 7.0, false, LINE);
    legend(&mut canvas, &map, world, trial, frame, cells, &seen);
    Ok(Ok(canvas))
}

/// Returns the horizontal section of a cell at the height of the eye, as a convex polygon in pixels of the
/// map. Empty when the cell does not reach that height.
fn footprint(map: &Map, cell: &Viewcell, eye: DVec3) -> Vec<[f64; 2]> {
    let height = eye.dot(map.up);
    let (a, b) = (cell.min.dot(map.up), cell.max.dot(map.up));
    if height < a.min(b) || height > a.max(b) {
        return Vec::new();
    }
    let at = |right: DVec3, ahead: DVec3| {
        map.right * right.dot(map.right) + map.ahead * ahead.dot(map.ahead) + map.up * height
    };
    let (min, max) = (cell.min, cell.max);
    let mut outline = vec![at(min, min), at(max, min), at(max, max), at(min, max)];
    for plane in &cell.planes {
        outline = cut(&outline, plane);
    }
    outline.into_iter().map(|p| map.place(p)).collect()
}

/// Clips a convex polygon to the inner half-space of a plane, where the signed distance is not negative.
fn cut(outline: &[DVec3], plane: &Plane) -> Vec<DVec3> {
    let mut out = Vec::new();
    for (i, &a) in outline.iter().enumerate() {
        let b = outline[(i + 1) % outline.len()];
        let (ha, hb) = (plane.signed_distance(a), plane.signed_distance(b));
        if ha >= 0.0 {
            out.push(a);
        }
        if (ha >= 0.0) != (hb >= 0.0) {
            out.push(a + (b - a) * (ha / (ha - hb)));
        }
    }
    out
}

/// Fills a convex polygon, given in pixels with either winding, above the row `bottom`.
fn fill(canvas: &mut Canvas, outline: &[[f64; 2]], bottom: u32, color: Color) {
    let bounds = |axis: usize, most: f64| {
        let low = outline.iter().fold(most, |low, p| low.min(p[axis])).max(0.0);
        let high = outline.iter().fold(0.0, |high: f64, p| high.max(p[axis])).min(most);
        (low as i64, high as i64)
    };
    let (left, right) = bounds(0, f64::from(canvas.width));
    let (top, bottom) = bounds(1, f64::from(bottom) - 1.0);
    for (x, y) in (top..=bottom).flat_map(|y| (left..=right).map(move |x| (x, y))) {
        let (px, py) = (x as f64 + 0.5, y as f64 + 0.5);
        let turns = outline.iter().enumerate().map(|(i, a)| {
            let b = outline[(i + 1) % outline.len()];
            (b[0] - a[0]) * (py - a[1]) - (b[1] - a[1]) * (px - a[0])
        });
        let (mut left, mut right) = (false, false);
        turns.for_each(|turn| (left, right) = (left || turn > 0.0, right || turn < 0.0));
        if !(left && right) {
            canvas.set(x, y, color);
        }
    }
}

/// Draws the longest of the segments between two corners of a polygon as a thick line: a vertical portal as
/// seen from above. Corners are in world space.
fn thick(canvas: &mut Canvas, map: &Map, corners: impl Iterator<Item = DVec3>, color: Color) {
    let corners: Vec<[f64; 2]> = corners.map(|corner| map.place(corner)).collect();
    let pairs = corners.iter().flat_map(|a| corners.iter().map(move |b| (*a, *b)));
    let length = |(a, b): &([f64; 2], [f64; 2])| (a[0] - b[0]).hypot(a[1] - b[1]);
    let Some((a, b)) = pairs.max_by(|a, b| length(a).total_cmp(&length(b))) else { return };
    for (dx, dy) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)] {
        canvas.line([a[0] + dx, a[1] + dy], [b[0] + dx, b[1] + dy], color);
    }
}

/// Returns the point where the ray from the eye through a point leaves the bounding box of a viewcell, but no
/// point nearer than `through`. World space.
fn leave(cell: &Viewcell, eye: DVec3, through: DVec3) -> DVec3 {
    let along = through - eye;
    let ends = [0, 1, 2].into_iter().filter(|&axis| along[axis] != 0.0).map(|axis| {
        ((cell.min[axis] - eye[axis]) / along[axis]).max((cell.max[axis] - eye[axis]) / along[axis])
    });
    eye + along * ends.fold(f64::INFINITY, f64::min).clamp(1.0, 1e6)
}

fn legend(
    canvas: &mut Canvas,
    map: &Map,
    world: &World,
    trial: &Trial,
    frame: usize,
    cells: &SourceCells,
    seen: &[CellId],
) {
    let top = i64::from(map.height);
    canvas.rectangle(0, top, map.width.into(), LEGEND.into(), PAPER);
    let most = (i64::from(map.width) - 20) / LETTER;
    let short = |text: String| text.chars().take(most.max(0) as usize).collect::<String>();
    let title = format!(
        "{} through portals, frame {frame}, culler {}: {} of {} cells seen, plan at the height of the eye",
        world.source.name,
        trial.name,
        seen.len(),
        cells.graph.cell_count(),
    );
    canvas.text(10, top + 8, &short(title), INK);
    let name = |cell: &CellId| cells.names.get(cell.index()).cloned().unwrap_or_default();
    let names: Vec<String> = seen.iter().map(name).collect();
    canvas.text(10, top + 24, &short(format!("seen: {}", names.join(" "))), INK);
    let entries = [
        (LINE, "eye, stabbing lines"),
        (BEGINS, "cell of the eye"),
        (SEEN, "cell seen"),
        (CELL, "not seen"),
        (PORTAL, "portal"),
        (WINDOW, "seen through it"),
        (VISIBLE, "visible"),
        (FALSE_VISIBLE, "reported, not visible"),
        (CULLED, "culled"),
    ];
    canvas.legend(10, top + 46, &entries, INK);
}
