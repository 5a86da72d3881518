//! Questions about plans beyond a single eye, and their pictures: shortest paths, guards, hiding places.

use super::drawing::Drawing;
use std::time::Instant;
use visibility_2d::cdt::{Guards, Plan, PlanError, ShortestPath, UnseenRegion, VisibilityGraph};

/// Colours of connected hiding places, by turns.
const PLACES: [&str; 6] = ["#8a4f9e", "#b5503c", "#3c6fb5", "#3f8f5a", "#a8862a", "#5a5a6e"];

fn milliseconds(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}

/// Draws what none of the eyes sees of all that can be reached from `start`. Returns a line for the user.
///
/// # Errors
///
/// Returns the errors of [`UnseenRegion::reachable`] and [`UnseenRegion::look`].
pub fn hide(
    plan: &Plan,
    start: [f64; 2],
    eyes: &[[f64; 2]],
    drawing: &mut Drawing,
) -> Result<String, PlanError> {
    let begin = Instant::now();
    let mut unseen = UnseenRegion::reachable(plan, &[start])?;
    let whole = unseen.area();
    for &eye in eyes {
        unseen.look(plan, eye)?;
    }
    let places = unseen.hiding_places(plan)?;
    let ms = milliseconds(begin);
    for (polygon, &place) in unseen.polygons().zip(places.of_polygons()) {
        let color = PLACES[place as usize % PLACES.len()];
        drawing.polygon(&polygon, &format!("fill:{color};stroke:{color};stroke-width:.3"));
    }
    let (left, count) = (unseen.area(), places.len());
    Ok(format!("{} eyes leave {left:.1} of {whole:.1} unseen, in {count} places; {ms:.2} ms", eyes.len()))
}

/// Draws guards that see all that can be reached from `start`, green, and witnesses of which no guard sees
/// two, red. Returns a line for the user.
///
/// # Errors
///
/// Returns the errors of [`Guards::new`].
pub fn guard(plan: &Plan, start: [f64; 2], drawing: &mut Drawing) -> Result<String, PlanError> {
    let begin = Instant::now();
    let guards = Guards::new(plan, &[start])?;
    let ms = milliseconds(begin);
    guards.witnesses().iter().for_each(|&at| drawing.dot(at, "#c22"));
    guards.positions().iter().for_each(|&at| drawing.dot(at, "#2a2"));
    let uncovered = guards.uncovered().area();
    let (count, least) = (guards.positions().len(), guards.witnesses().len());
    Ok(format!("{count} guards, at least {least} are needed, {uncovered} is not covered; {ms:.0} ms"))
}

/// Draws the shortest path along `stops`, and the corners of the visibility graph. Returns a line for the
/// user.
///
/// # Errors
///
/// Returns the errors of [`VisibilityGraph::new`] and [`VisibilityGraph::find_path`].
pub fn walk(plan: &Plan, stops: &[[f64; 2]], drawing: &mut Drawing) -> Result<String, PlanError> {
    let begin = Instant::now();
    let graph = VisibilityGraph::new(plan)?;
    let made = milliseconds(begin);
    let corners = (0..graph.corner_count() as u32).filter_map(|corner| graph.corner(plan, corner));
    drawing.lines(corners.map(|at| [at, at]), "stroke:#5a9bd4;stroke-width:4;stroke-linecap:round");
    let mut path = ShortestPath::new();
    let (mut length, mut ms, mut blocked) = (0.0, 0.0, 0);
    for pair in stops.windows(2) {
        // The first search makes room for the next ones.
        graph.find_path(plan, pair[0], pair[1], &mut path)?;
        let begin = Instant::now();
        graph.find_path(plan, pair[0], pair[1], &mut path)?;
        ms += milliseconds(begin);
        length += path.length().unwrap_or_default();
        blocked += usize::from(path.length().is_none());
        let legs = path.points().windows(2).map(|leg| [leg[0], leg[1]]);
        drawing.lines(legs, "stroke:#d9775a;stroke-width:3;stroke-linecap:round");
    }
    stops.iter().for_each(|&stop| drawing.dot(stop, "#d9775a"));
    let (corners, legs) = (graph.corner_count(), graph.leg_count());
    Ok(format!(
        "{corners} corners, {legs} legs, made in {made:.1} ms; path of {length:.2}, {blocked} parts without \
         a way, found in {ms:.3} ms"
    ))
}
