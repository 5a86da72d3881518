//! Climbs towards boxes that portals hide and a line of sight through all portals reaches. Rooms stand in a
//! row, with a rectangular portal in each wall between them; all is in integers, and lines are judged
//! exactly.

use visibility_core::cells::{CellGraph, CellId};
use visibility_core::geometry::ConvexPolygon;
use visibility_core::glam::{DMat4, DVec3, DVec4};
use visibility_core::pvs::{Viewcell, Viewcells};
use visibility_core::view::Depth;
use visibility_core::{Aabb, Scene, View, VisibleSet};
use visibility_portals::{Narrowing, PortalEye, SceneCells};
use visibility_testing::{ClimbInput, Random, climb, judged, told_enough};

type Point = [i64; 3];

/// Depth of a room and half of its width and height, in units.
const ROOM: i64 = 1 << 20;

/// Metres in a unit.
const UNIT: f64 = 1.0 / 32_768.0;

/// Rooms in a row along the first axis, the first from 0 to [`ROOM`].
#[derive(Clone, Debug)]
struct Row {
    /// For each wall the portal's least y and z, then its greatest; then the eye, then the target's least
    /// corner.
    numbers: Vec<i64>,
    target_size: Point,
    /// Axis of the scene of each coordinate, and its sign.
    axes: [(usize, i64); 3],
    near: i64,
}

impl Row {
    fn random(random: &mut Random) -> Self {
        let walls = 1 + random.below(4);
        let mut some = |by: i64| i64::from(random.between(-by as i32, by as i32));
        let eye = [ROOM / 2 + some(ROOM / 2 - 1), some(ROOM / 2), some(ROOM / 2)];
        let end = walls as i64 * ROOM + ROOM / 2;
        let target = [end + some(ROOM / 4), some(ROOM - ROOM / 8), some(ROOM - ROOM / 8)];
        let mut numbers = Vec::new();
        // Portals lie around the line from the eye to the target, or a little beside it.
        for wall in 1..=walls as i64 {
            let share = (wall * ROOM - eye[0]) as f64 / (target[0] - eye[0]) as f64;
            let half = ROOM / 32 + some(ROOM / 33);
            let at = [1, 2].map(|k| eye[k] + ((target[k] - eye[k]) as f64 * share) as i64);
            let at = at.map(|at| at + if some(2) > 0 { some(2 * half) } else { 0 });
            numbers.extend([at[0] - half, at[1] - half, at[0] + half, at[1] + half]);
        }
        numbers.extend(eye.into_iter().chain(target));
        let target_size = if random.one_in(2) { [0; 3] } else { [0; 3].map(|_| random.magnitude(10)) };
        let first = random.below(3);
        let turn = if random.one_in(2) { 1 } else { 2 };
        let axes = [0, turn, 3 - turn].map(|k| ((first + k) % 3, random.pick(&[-1, 1])));
        Self { numbers, target_size, axes, near: random.magnitude(16) }
    }

    fn walls(&self) -> usize {
        self.numbers.len() / 4 - 1
    }

    fn portal(&self, wall: usize) -> [i64; 4] {
        [0, 1, 2, 3].map(|k| self.numbers[4 * wall + k])
    }

    /// Returns the eye for 0, the least corner of the target for 1.
    fn end(&self, which: usize) -> Point {
        [0, 1, 2].map(|k| self.numbers[4 * self.walls() + 3 * which + k])
    }

    fn place(&self, p: Point) -> DVec3 {
        let mut scene = DVec3::ZERO;
        for (x, (axis, sign)) in p.into_iter().zip(self.axes) {
            scene[axis] = (x * sign) as f64 * UNIT;
        }
        scene
    }

    fn between(&self, a: Point, b: Point) -> [DVec3; 2] {
        let (a, b) = (self.place(a), self.place(b));
        [a.min(b), a.max(b)]
    }

    /// Returns how far a line of sight is outside of the portals that it must pass: at most 0 if and only if
    /// it passes inside all of them.
    fn outside(&self, eye: Point, to: Point) -> f64 {
        let along = to[0] - eye[0];
        let mut most = f64::NEG_INFINITY;
        for wall in 0..self.walls() {
            let ahead = (wall as i64 + 1) * ROOM - eye[0];
            // A wall before the near plane is not drawn.
            if ahead < self.near {
                continue;
            }
            let [y0, z0, y1, z1] = self.portal(wall);
            for (k, low, high) in [(1, y0, y1), (2, z0, z1)] {
                let at = eye[k] * along + (to[k] - eye[k]) * ahead;
                let beyond = (low * along - at).max(at - high * along);
                let beyond = if beyond == 0 { f64::MIN_POSITIVE } else { beyond as f64 / along as f64 };
                most = most.max(beyond);
            }
        }
        most.max(-1e30)
    }

    fn is_hidden(&self, narrowing: Narrowing) -> bool {
        let rooms = self.walls() + 1;
        let mut portals = Vec::new();
        for wall in 0..self.walls() {
            let (x, [y0, z0, y1, z1]) = ((wall as i64 + 1) * ROOM, self.portal(wall));
            let corners = [[x, y0, z0], [x, y1, z0], [x, y1, z1], [x, y0, z1]].map(|p| self.place(p));
            let Ok(polygon) = ConvexPolygon::new(corners) else { return false };
            // The normal of a portal points into its second cell.
            let [before, after] = [wall, wall + 1].map(|cell| CellId(cell as u32));
            let ahead = self.place([1, 0, 0]) - self.place([0; 3]);
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
            let cells = if normal.dot(ahead) > 0.0 { [before, after] } else { [after, before] };
            portals.push((polygon, cells));
        }
        let Ok(graph) = CellGraph::new(rooms, portals) else { return false };
        let cells = (0..rooms as i64).map(|room| {
            let [min, max] = self.between([room * ROOM, -ROOM, -ROOM], [(room + 1) * ROOM, ROOM, ROOM]);
            Viewcell::from_box(min, max)
        });
        let Ok(mut cells) = SceneCells::new(graph, Viewcells::new(cells), 1e-9) else { return false };
        let mut scene = Scene::new();
        let least = self.end(1);
        let [min, max] = self.between(least, [0, 1, 2].map(|k| least[k] + self.target_size[k]));
        let target = scene.insert(Aabb::new(min.as_vec3(), max.as_vec3()));
        cells.sync(&scene);
        let Some(view) = self.view() else { return false };
        let (mut eye, mut visible) = (PortalEye::new().with_narrowing(narrowing), VisibleSet::new());
        visible.fill(&scene, &view);
        eye.cull(&cells, &scene, &view, &mut visible);
        !visible.contains(&scene, target)
    }

    /// Returns the view from the eye along the row, of 90 degrees or more, whose matrix is exact.
    fn view(&self) -> Option<View> {
        let eye = self.end(0);
        let row = |k: usize| {
            let (axis, sign) = self.axes[k];
            let mut row = DVec3::ZERO;
            row[axis] = sign as f64 / UNIT;
            row.extend(-eye[k] as f64)
        };
        let wide = row(0) * 4.0;
        let rows = [row(1), row(2), DVec4::new(0.0, 0.0, 0.0, 4.0 * self.near as f64), wide];
        let matrix = DMat4::from_cols(rows[0], rows[1], rows[2], rows[3]).transpose();
        View::from_clip_from_world(matrix, Depth::ReversedInfinite).ok()
    }
}

impl ClimbInput for Row {
    fn numbers(&mut self) -> &mut [i64] {
        &mut self.numbers
    }

    fn clearance(&self) -> Option<f64> {
        let (eye, least) = (self.end(0), self.end(1));
        let last = self.walls() as i64 * ROOM;
        let is_in =
            |p: Point, from: i64| p[0] > from && p[0] < from + ROOM && p[1].abs() < ROOM && p[2].abs() < ROOM;
        let most = [0, 1, 2].map(|k| least[k] + self.target_size[k]);
        let portals = (0..self.walls()).map(|wall| self.portal(wall));
        let are_portals = portals
            .into_iter()
            .all(|[y0, z0, y1, z1]| y0 < y1 && z0 < z1 && y0 > -ROOM && z0 > -ROOM && y1 < ROOM && z1 < ROOM);
        if !are_portals || !is_in(eye, 0) || !is_in(least, last) || !is_in(most, last) {
            return None;
        }
        let corners = (0..8).map(|i| [0, 1, 2].map(|k| if i >> k & 1 == 0 { least[k] } else { most[k] }));
        let is_in_picture = |p: &Point| {
            let wide = 4 * (p[0] - eye[0]);
            p[0] - eye[0] >= self.near && (p[1] - eye[1]).abs() <= wide && (p[2] - eye[2]).abs() <= wide
        };
        corners.filter(is_in_picture).map(|p| self.outside(eye, p)).min_by(f64::total_cmp)
    }
}

#[test]
fn no_climb_ends_at_a_box_that_portals_hide_and_a_line_reaches() {
    let mut random = Random(1);
    let (mut started, mut all) = (0, 0);
    for number in 0..1500 {
        let narrowing = random.pick(&[Narrowing::Polygon, Narrowing::Rectangle]);
        let row = Row::random(&mut random);
        let end = climb(row, &mut random, 60, |row| row.is_hidden(narrowing));
        let Some(end) = end else { continue };
        assert!(end.least > 0.0, "row {number}, {narrowing:?}: hidden and seen: {:?}", end.input);
        started += 1;
        all += end.judged;
    }
    judged(all);
    told_enough(started > 100 && all > 8 * started, format_args!("{started} rows, {all} inputs"));
}
