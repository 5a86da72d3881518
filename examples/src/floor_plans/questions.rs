//! Questions about plans beyond a single eye, and their pictures: shortest paths, guards, hiding places.

use super::drawing::Drawing;
use std::time::Instant;
use visibility_2d::cdt::{
    Guards, Plan, PlanError, PlanView, ShortestPath, UnseenRegion, Visibility, VisibilityGraph,
};

/// Colours of connected hiding places, by turns.
const PLACES: [&str; 6] = ["#8a4f9e", "#b5503c", "#3c6fb5", "#3f8f5a", "#a8862a", "#5a5a6e"];

/// Duration in seconds of a step of an animated walk.
const SECONDS: f64 = 0.2;

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

/// Draws the shortest path along `stops` and, one after another, what is seen at `count` places along it,
/// from its beginning to its end. `view` has the limits on what is seen; its eye is not used. Returns a line
/// for the user.
///
/// # Errors
///
/// Returns the errors of [`walk`] and [`Plan::look`].
pub fn look_around(
    plan: &Plan,
    stops: &[[f64; 2]],
    count: usize,
    view: &PlanView,
    drawing: &mut Drawing,
) -> Result<String, PlanError> {
    let graph = VisibilityGraph::new(plan)?;
    let (mut path, mut points) = (ShortestPath::new(), Vec::new());
    for pair in stops.windows(2) {
        graph.find_path(plan, pair[0], pair[1], &mut path)?;
        points.extend_from_slice(path.points());
    }
    let legs = points.windows(2).map(|leg| [leg[0], leg[1]]);
    drawing.lines(legs, "stroke:#d9775a;stroke-width:2;stroke-dasharray:6 4");
    let mut answer = Visibility::new();
    let mut areas = 0.0;
    for (index, eye) in along(&points, count).into_iter().enumerate() {
        plan.look(&PlanView { eye, ..*view }, &mut answer)?;
        areas += answer.area();
        drawing.begin_frame(index, count, SECONDS);
        drawing.polygon(answer.polygon(), "fill:#e8b04a;fill-opacity:.55");
        drawing.dot(eye, "#c22");
        drawing.end_frame();
    }
    Ok(format!("{count} places, which see {:.1} in the mean", areas / count.max(1) as f64))
}

/// Returns `count` points at equal distances along a chain, from its first point to its last. None for an
/// empty chain.
fn along(points: &[[f64; 2]], count: usize) -> Vec<[f64; 2]> {
    let legs = || {
        points.windows(2).map(|leg| (leg[0], leg[1], (leg[1][0] - leg[0][0]).hypot(leg[1][1] - leg[0][1])))
    };
    let length: f64 = legs().map(|(.., length)| length).sum();
    let at = |index: usize| {
        let mut left = length * index as f64 / (count.max(2) - 1) as f64;
        for (from, to, length) in legs() {
            if left <= length && length > 0.0 {
                return Some([0, 1].map(|k| from[k] + (to[k] - from[k]) * left / length));
            }
            left -= length;
        }
        points.last().copied()
    };
    (0..count).filter_map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_2d::cdt::Wall;

    #[test]
    fn places_lie_at_equal_distances() {
        let chain = [[0.0, 0.0], [3.0, 0.0], [3.0, 0.0], [3.0, 1.0]];
        assert_eq!(
            along(&chain, 5),
            [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0], [3.0, 1.0]],
            "five places along three metres and one"
        );
        assert_eq!(along(&chain, 1), [[0.0, 0.0]], "one place");
        assert_eq!(along(&[[1.0, 2.0]], 2), [[1.0, 2.0]; 2], "a chain of one point");
        assert_eq!(along(&[], 3), [[0.0; 2]; 0], "no chain");
    }

    #[test]
    fn a_walk_has_a_frame_for_each_place_and_goes_around_walls() {
        let plan = Plan::new(&[Wall::new([0.0, -1.0], [0.0, 1.0])]).unwrap();
        let mut drawing = Drawing::new(plan.bounds(), false);
        let view = PlanView::new([0.0, 0.0]).with_range(0.5);
        let line = look_around(&plan, &[[-1.0, 0.0], [1.0, 0.0]], 9, &view, &mut drawing).unwrap();
        let picture = drawing.finish();
        assert_eq!(picture.matches("<animate ").count(), 9, "frames");
        assert_eq!(picture.matches("<circle ").count(), 9, "eyes");
        // Discs with a radius of half a metre, of which the wall cuts something off.
        let area: f64 =
            line.split_whitespace().find_map(|word| word.parse().ok().filter(|&area| area < 1.0)).unwrap();
        assert!((0.6..=0.8).contains(&area), "area of {line}");
    }
}
