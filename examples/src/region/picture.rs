//! Picture of a viewcell from above: the objects that samples see, those that a method reports, and lines
//! that show how the method found them.

use super::methods::Method;
use super::output::Judged;
use super::trial::Trial;
use crate::walkthrough::World;
use crate::walkthrough::canvas::{Canvas, Color};
use crate::walkthrough::map_picture::Map;
use crate::walkthrough::palette::{HIDDEN, INK, LOST, PAPER, REPORTED, VIEW, VISIBLE};
use glam::{DVec3, Vec3};
use visibility_core::pvs::Viewcell;
use visibility_core::{Aabb, VisibleSet};
use visibility_measure::MeasureError;

const UMBRA: Color = [70, 70, 80];
const LINE: Color = [150, 120, 200];
/// Number of probe boxes along the longer side of the scene.
const PROBES: f64 = 120.0;
/// Height of the legend below the map, in pixels.
pub(crate) const LEGEND: u32 = 64;

/// Draws the answer of a trial. `lines` are segments in world space. Runs `method` once more to find its
/// umbra.
///
/// # Errors
///
/// Returns [`MeasureError`] when the item buffer cannot draw the map.
pub fn draw(
    world: &World,
    judged: &Judged,
    trial: &Trial,
    lines: &[[DVec3; 2]],
    method: &mut dyn Method,
) -> Result<Canvas, MeasureError> {
    let (low, high) = world.source.bounds().unwrap_or((Vec3::ZERO, Vec3::ONE));
    let (cell_min, cell_max) = (judged.cell.min, judged.cell.max);
    let map = Map::of(world, low.as_dvec3().min(cell_min), high.as_dvec3().max(cell_max));
    let mut canvas = Canvas::new(map.width, map.height + LEGEND, PAPER);
    let lost = judged.sampled_and_left_out(trial);
    let color = |object: u32| {
        let sampled = judged.sampled[object as usize];
        match trial.reported.binary_search(&object).is_ok() {
            true if sampled => VISIBLE,
            true => REPORTED,
            false if sampled => LOST,
            false => HIDDEN,
        }
    };
    map.paint(&mut canvas, world, |_, _| true, color)?;
    for middle in umbra(world, &judged.cell, method) {
        let [x, y] = map.place(middle).map(|at| at as i64);
        canvas.rectangle(x - 1, y - 1, 2, 2, UMBRA);
    }
    for [from, to] in lines {
        canvas.line(map.place(*from), map.place(*to), LINE);
    }
    let outline = outline(&judged.cell, map.right, map.ahead);
    for (i, &from) in outline.iter().enumerate() {
        canvas.line(map.place(from), map.place(outline[(i + 1) % 4]), VIEW);
    }
    for &object in &lost {
        if let Some((low, high)) = world.source.objects[object as usize].bounds() {
            let middle = ((low + high) * 0.5).as_dvec3() + world.origin();
            canvas.disc(map.place(middle), 14.0, true, LOST);
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
        (VISIBLE, "sampled"),
        (REPORTED, "reported, not sampled"),
        (HIDDEN, "hidden"),
        (LOST, "sampled, but hidden"),
        (VIEW, "viewcell"),
        (UMBRA, "umbra"),
        (LINE, "how it was found"),
    ];
    canvas.legend(10, top + 20, &entries, INK);
    Ok(canvas)
}

/// Returns the umbra: centres of the probe boxes that the method finds hidden. The probe boxes are a grid
/// over the scene at the height of the viewcell, and are culled as if they were objects.
fn umbra(world: &World, cell: &Viewcell, method: &mut dyn Method) -> Vec<DVec3> {
    let (low, high) = world.source.bounds().unwrap_or_default();
    let (low, high, up) = (low.as_dvec3(), high.as_dvec3(), world.source.up.as_dvec3().abs());
    let middle = (cell.min + cell.max) * 0.5 - world.origin();
    let step = ((high - low) * (1.0 - up)).max_element() / PROBES;
    let side = step.max(1e-3);
    let [right, ahead] = if up.x > 0.5 {
        [1, 2]
    } else if up.y > 0.5 {
        [0, 2]
    } else {
        [0, 1]
    };
    let count = |axis: usize| ((high[axis] - low[axis]) / side) as usize + 1;
    let mut scene = world.scene.clone();
    let probes = (0..count(right)).flat_map(|i| (0..count(ahead)).map(move |j| (i, j))).map(|(i, j)| {
        let mut at = middle;
        at[right] = low[right] + (i as f64 + 0.5) * side;
        at[ahead] = low[ahead] + (j as f64 + 0.5) * side;
        at
    });
    // The side of a probe box is half the distance between probes.
    let probes: Vec<DVec3> = probes.collect();
    let bounds =
        probes.iter().map(|at| Aabb::new((at - 0.25 * side).as_vec3(), (at + 0.25 * side).as_vec3()));
    let ids = scene.insert_batch(bounds.collect::<Vec<_>>());
    scene.rebuild();
    let mut visible = VisibleSet::new();
    method.cull(&scene, cell, &mut visible);
    let hidden = ids.into_iter().zip(probes).filter(|(id, _)| !visible.contains(&scene, *id));
    hidden.map(|(_, at)| at + world.origin()).collect()
}

/// Returns the corners, in order, of a viewcell's horizontal section through its middle: of its box, cut by
/// its planes.
pub(crate) fn outline(cell: &Viewcell, right: DVec3, ahead: DVec3) -> Vec<DVec3> {
    let (middle, half) = ((cell.min + cell.max) * 0.5, (cell.max - cell.min) * 0.5);
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let mut corners: Vec<DVec3> = corners
        .map(|[x, y]| middle + right * (half * right).length() * x + ahead * (half * ahead).length() * y)
        .to_vec();
    for plane in &cell.planes {
        let heights: Vec<f64> = corners.iter().map(|&p| plane.signed_distance(p)).collect();
        let count = corners.len();
        corners = (0..count)
            .flat_map(|i| {
                let (p, q, a, b) =
                    (corners[i], corners[(i + 1) % count], heights[i], heights[(i + 1) % count]);
                let crossing = ((a < 0.0) != (b < 0.0)).then(|| p + (q - p) * (a / (a - b)));
                (a >= 0.0).then_some(p).into_iter().chain(crossing)
            })
            .collect();
    }
    corners
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::region::cells;

    #[test]
    fn the_outline_of_a_turned_viewcell_has_its_corners() {
        let given = cells::parse("-4,-1,0,4,1,2@45").unwrap();
        let outline = outline(&cells::viewcell(&given, Vec3::Z), DVec3::X, DVec3::Y);
        for (x, y) in [(4.0, 1.0), (-4.0, 1.0), (4.0, -1.0), (-4.0, -1.0)] {
            let corner = DVec3::new((x - y) * 0.5f64.sqrt(), (x + y) * 0.5f64.sqrt(), 1.0);
            assert!(outline.iter().any(|p| p.distance(corner) < 1e-9), "{corner} {outline:?}");
        }
        // Clipping leaves some cut-off corners of the box behind, as edges of no length.
        assert!(outline.len() <= 8, "{outline:?}");
    }
}
