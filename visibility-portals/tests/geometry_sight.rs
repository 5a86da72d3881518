//! Cells made from geometry hide nothing that is seen: whatever a segment reaches past the polygons is
//! reported by the culler and by each baker, wherever the object and the eye are.

use crate::from_geometry::{blocked, triangles, upright};
use visibility_core::bake::Bake;
use visibility_core::geometry::ConvexPolygon;
use visibility_core::glam::{DMat3, DQuat, DVec3};
use visibility_core::pvs::Viewcells;
use visibility_core::who_sees::{Reach, ViewcellMatrix, WhoSees};
use visibility_core::{Aabb, ObjectId, Pose, Scene, View, VisibleSet, cells::CellId};
use visibility_portals::from_geometry::{
    PolygonSettings, Subdivision, WallSettings, from_polygons, from_walls,
};
use visibility_portals::{BakerSettings, CellBaker, ObjectBaker, PortalEye, SceneCells};
use visibility_testing::{Random, judged, told_enough};

/// Cells made from geometry, with all that is baked from them for the objects of a scene.
struct Level {
    scene: Scene,
    ids: Vec<ObjectId>,
    /// Without a PVS and with one.
    cells: [SceneCells; 2],
    viewcells: Viewcells,
    /// By cell, the indices of the objects seen from it.
    rows: Vec<Vec<u32>>,
    movers: ViewcellMatrix,
}

impl Level {
    fn new(made: &Subdivision, objects: &[[DVec3; 2]]) -> Self {
        let viewcells = made.viewcells.clone();
        let mut scene = Scene::new();
        let ids: Vec<ObjectId> =
            objects.iter().map(|&[min, max]| scene.insert(Aabb::from_world(min, max, DVec3::ZERO))).collect();
        let mut graph = made.graph.clone();
        let cells = SceneCells::new(graph.clone(), viewcells.clone(), 1e-6).unwrap();
        assert_eq!(cells.turned_portals(), [], "portals made from geometry are wound rightly");
        let mut pairs = Vec::new();
        for (&[min, max], &id) in objects.iter().zip(&ids) {
            viewcells.for_each_touching(min - 1e-6, max + 1e-6, |cell| pairs.push((CellId(cell.0), id)));
        }
        graph.set_objects(pairs).unwrap();
        let settings = BakerSettings::default();
        let baked = Bake::new(CellBaker::new(&graph, settings).unwrap()).run();
        let pvs = baked.matrix.to_pvs(&graph).unwrap();
        let bounds = |id: ObjectId| objects.get(id.index()).copied();
        let rows = Bake::new(ObjectBaker::new(&graph, &baked, bounds, settings).unwrap()).run().rows;
        let movers = ViewcellMatrix::of_portals(&graph, viewcells.clone(), &pvs, 1e-6).unwrap();
        let mut cells = [cells.clone(), cells.with_pvs(pvs).unwrap()];
        cells.iter_mut().for_each(|cells| cells.sync(&scene));
        Self { scene, ids, cells, viewcells, rows, movers }
    }

    /// Returns whether an object is reported to an eye that looks at a point of it: by the culler, by the
    /// culler with a PVS, by the sets of the cells in which the lines of sight begin, and as a mover by the
    /// matrix. `None` if lines of sight begin outside the cells.
    fn reports(&mut self, eye: DVec3, at: DVec3, object: usize) -> Option<[bool; 4]> {
        let up = if (at - eye).normalize().z.abs() > 0.9 { DVec3::X } else { DVec3::Z };
        let view = View::perspective(Pose::look_at(eye, at, up), 0.5, 1.0, 1e-5, f64::INFINITY).unwrap();
        let mut portals = [false; 2];
        for (cells, reports) in self.cells.iter().zip(&mut portals) {
            let (mut walk, mut visible) = (PortalEye::new(), VisibleSet::new());
            visible.fill(&self.scene, &view);
            walk.cull(cells, &self.scene, &view, &mut visible);
            if walk.stats().fallback.is_some() {
                return None;
            }
            *reports = visible.contains(&self.scene, self.ids[object]);
        }
        let mut begun = Vec::new();
        self.viewcells.reached(&[DVec3::ZERO], eye, 1e-6, &mut begun);
        let placed = self.cells[0].cells_of(self.ids[object]).is_empty();
        let listed = |cell: u32| self.rows[cell as usize].contains(&(object as u32));
        // The sets of no cell are for nobody: an eye in none sees everything.
        let rows = placed || begun.is_empty() || begun.iter().any(|cell| listed(cell.0));
        let bounds = self.scene.bounds(self.ids[object]).unwrap();
        let reach = |min: DVec3, max: DVec3| [Reach::new(min, max)];
        let mut who = WhoSees::new();
        let target = reach(bounds.min.as_dvec3(), bounds.max.as_dvec3());
        who.look(&mut self.movers, &reach(eye, eye), &target);
        Some([portals[0], portals[1], rows, who.sees(0, 0)])
    }
}

/// Asserts that all methods report an object that a segment from `eye` reaches at `at`.
fn assert_seen(level: &mut Level, eye: DVec3, at: DVec3, object: usize, what: &str) {
    let reports = level.reports(eye, at, object).unwrap_or_else(|| panic!("{what}: {eye} is in no cell"));
    assert_eq!(
        reports, [true; 4],
        "{what}: object {object} is seen from {eye} at {at}; reported by portals, portals with a PVS, rows, \
         as a mover"
    );
}

fn corners(min: [f64; 3], max: [f64; 3]) -> [DVec3; 2] {
    [DVec3::from(min), DVec3::from(max)]
}

/// Cells of the same boxes, made in both ways with the same margin and tolerance.
fn both_ways(boxes: &[[DVec3; 2]], margin: f64, tolerance: f64) -> [(&'static str, Subdivision); 2] {
    let walls = WallSettings::default().with_margin(margin).with_tolerance(tolerance);
    let polygons = PolygonSettings::default().with_margin(margin).with_tolerance(tolerance);
    let faces = triangles(boxes, DMat3::IDENTITY);
    [("walls", from_walls(boxes, &walls).unwrap()), ("polygons", from_polygons(&faces, &polygons).unwrap())]
}

/// A wall divides a yard up to the top of the divided box. A tower stands behind it, and is seen over it.
#[test]
fn what_reaches_out_of_the_divided_box_is_seen_over_walls() {
    let yard = [corners([0.0, 0.0, -0.2], [16.0, 8.0, 0.0]), corners([8.0, 0.0, 0.0], [8.2, 8.0, 3.0])];
    let objects = [
        corners([14.0, 3.0, 0.0], [15.0, 5.0, 6.0]),
        corners([14.0, 3.0, 0.0], [15.0, 5.0, 2.9]),
        corners([12.0, -3.0, 0.0], [13.0, 1.0, 2.0]),
    ];
    for (what, made) in both_ways(&yard, 0.0, 1e-4) {
        let mut level = Level::new(&made, &objects);
        let eye = DVec3::new(2.0, 4.0, 1.5);
        assert_seen(&mut level, eye, DVec3::new(14.0, 4.0, 5.5), 0, what);
        let hidden = level.reports(eye, DVec3::new(14.0, 4.0, 1.5), 1);
        assert_eq!(hidden, Some([false; 4]), "{what}: a hut behind the wall, in the box, is hidden");
        // Beside the wall: a line leaves the box to the south, and the hut reaches out there.
        assert_seen(&mut level, DVec3::new(6.0, 0.5, 1.0), DVec3::new(12.0, -2.9, 1.0), 2, what);
        assert_seen(&mut level, DVec3::new(10.0, 0.5, 1.0), DVec3::new(12.0, 0.5, 1.0), 2, what);
        // A mover that may get over the wall, outside of the box, sees what is behind it.
        let hut = [Reach::new(objects[1][0], objects[1][1])];
        let mut sees = |margin: f64| {
            let mut who = WhoSees::new();
            who.look(&mut level.movers, &[Reach::new(eye, eye).within(0.5, 2.0 * margin)], &hut);
            who.sees(0, 0)
        };
        assert_eq!([sees(1.4), sees(1.6)], [false, true], "{what}: a mover 1.5 m below the top of the wall");
    }
}

/// Walls that differ by less than the tolerance become one plane, and a poster hangs between the two.
#[test]
fn a_poster_before_a_displaced_wall_is_seen() {
    let tolerance = 0.02;
    let near = |at: f64, y: [f64; 2]| corners([at, y[0], 0.0], [at, y[1], 3.0]);
    for sign in [1.0, -1.0] {
        let walls = [
            near(0.0, [0.0, 8.0]),
            near(sign * 0.0045, [8.0, 9.0]),
            corners([-4.0, 0.0, -0.2], [4.0, 9.0, 0.0]),
        ];
        // The poster's back is on the second wall; the eye is far away, or as near.
        let (low, high) =
            (if sign > 0.0 { 0.0015 } else { -0.003 }, if sign > 0.0 { 0.003 } else { -0.0015 });
        let poster = [corners([low, 8.3, 1.0], [high, 8.7, 2.0])];
        for (what, made) in both_ways(&walls, 0.0, tolerance) {
            let mut level = Level::new(&made, &poster);
            for away in [3.0, 0.5, 0.0] {
                let eye = DVec3::new(-sign * away + sign * 0.001, 8.5, 1.2);
                assert_seen(&mut level, eye, DVec3::new(sign * 0.0015, 8.5, 1.6), 0, what);
            }
        }
    }
}

/// Returns the extents in y and z of the polygons of a wall at x = 0. The upper edges of 28 lie in steps of
/// less than a quarter of the tolerance. Above the lowest, the slot below a lintel is nine tolerances high.
fn steps(tolerance: f64) -> Vec<[[f64; 2]; 2]> {
    let step = |i: u32| [[f64::from(i), f64::from(i + 1)], [0.0, 1.0 + 0.23 * tolerance * f64::from(i)]];
    let mut walls: Vec<_> = (0..28).map(step).collect();
    walls.push([[0.0, 28.0], [1.0 + 9.0 * tolerance, 3.0]]);
    walls
}

#[test]
fn a_slot_above_steps_of_less_than_the_tolerance_stays_open() {
    let tolerance = 0.01;
    let walls = steps(tolerance);
    let polygons: Vec<_> = walls.iter().map(|&[y, z]| upright(0.0, y, z, false)).collect();
    let walls: Vec<_> = walls.iter().map(|[y, z]| corners([0.0, y[0], z[0]], [0.0, y[1], z[1]])).collect();
    let settings = PolygonSettings::default().with_margin(2.0).with_tolerance(tolerance);
    let made = from_polygons(&polygons, &settings).unwrap();
    let object = |z: f64| corners([1.0, 0.2, z - 0.001], [1.2, 0.8, z + 0.001]);
    let objects: Vec<_> = (0..9).map(|i| object(1.005 + 0.01 * f64::from(i))).collect();
    let mut level = Level::new(&made, &objects);
    let mut clear = 0;
    for (i, object) in objects.iter().enumerate() {
        let at = (object[0] + object[1]) * 0.5;
        let eye = DVec3::new(-1.0, 0.5, at.z);
        if !blocked(&walls, eye, at, 1.01 * tolerance) {
            clear += 1;
            assert_seen(&mut level, eye, at, i, "steps");
        }
    }
    assert_eq!(clear, 7, "objects before the slot");
}

/// A pane fills the lower part of the slot, and lines pass its back: no cell is behind it.
#[test]
fn a_leak_above_steps_of_less_than_the_tolerance_is_a_leak() {
    let tolerance = 0.01;
    let mut polygons: Vec<_> = steps(tolerance).iter().map(|&[y, z]| upright(0.0, y, z, false)).collect();
    let mut one_sided = vec![false; polygons.len()];
    polygons.push(upright(0.0, [0.0, 1.0], [1.0, 1.0 + 5.0 * tolerance], false));
    for is_one_sided in [false, true] {
        one_sided.push(is_one_sided);
        let settings = PolygonSettings::default().with_tolerance(tolerance).with_one_sided(&one_sided);
        let made = from_polygons(&polygons, &settings).unwrap();
        let behind = made.viewcells.locate(DVec3::new(-0.5, 0.5, 1.05));
        assert_eq!(behind.is_none(), is_one_sided, "a pane, one-sided: {is_one_sided}");
        one_sided.pop();
    }
}

/// Returns a floor of 16 by 12 m and upright walls on it, most on lines of a lattice that they miss by less
/// than `tolerance`.
fn yard(random: &mut Random, tolerance: f64) -> Vec<[DVec3; 2]> {
    let mut boxes = vec![corners([0.0, 0.0, -0.2], [16.0, 12.0, 0.0])];
    for _ in 0..10 {
        let along = random.below(2);
        let (mut min, mut max) = (DVec3::ZERO, DVec3::ZERO);
        min[1 - along] = 2.0 + 2.0 * random.below(5) as f64 + random.fine_range(0.0, tolerance);
        max[1 - along] = min[1 - along] + random.pick(&[0.0, 0.3]);
        let (start, length) = (random.fine_range(0.0, 8.0), random.fine_range(1.0, 8.0));
        min[along] = random.pick(&[0.0, start]);
        max[along] = random.pick(&[12.0, min[along] + length]).min(12.0);
        max.z = random.pick(&[1.2, 3.0, 3.0]);
        boxes.push([min, max]);
    }
    boxes
}

/// Returns the faces of a box, as boxes without a thickness.
fn faces(&[min, max]: &[DVec3; 2]) -> [[DVec3; 2]; 6] {
    core::array::from_fn(|face| {
        let (mut low, mut high) = (min, max);
        let at = if face < 3 { min } else { max }[face % 3];
        (low[face % 3], high[face % 3]) = (at, at);
        [low, high]
    })
}

/// Returns whether a segment from `far` to `end` ends before a face, or within a quarter of the tolerance of
/// it.
fn is_at([min, max]: &[DVec3; 2], end: DVec3, far: DVec3, tolerance: f64) -> bool {
    let is_before = |axis: usize| {
        let is_beside = (0..3).all(|k| k == axis || (min[k] <= end[k] && end[k] <= max[k]));
        let is_outside = end[axis].min(far[axis]) > max[axis] || end[axis].max(far[axis]) < min[axis];
        is_beside && is_outside
    };
    end.distance(end.clamp(*min, *max)) <= 0.25 * tolerance || (0..3).any(is_before)
}

/// Looks along random segments in random yards at boxes that reach out of the yard and at grains before
/// walls. Returns the numbers of segments that reach an object, and of those that do not and whose object no
/// method reports.
fn search_yards(seed: u64, levels: usize) -> [usize; 2] {
    let (mut random, mut reached, mut hidden) = (Random(seed), 0, 0);
    for number in 0..levels {
        let tolerance = random.pick(&[1e-4, 0.02]);
        let (walls, margin) = (yard(&mut random, tolerance), random.pick(&[0.0, 0.7]));
        let axis = random.vector(1.0).normalize_or(DVec3::Z);
        let turn = DMat3::from_quat(DQuat::from_axis_angle(axis, random.pick(&[0.0, 0.4])));
        let made = match number % 3 {
            0 => {
                let settings = WallSettings::default().with_margin(margin).with_tolerance(tolerance);
                from_walls(&walls, &settings)
            }
            _ => {
                let settings = PolygonSettings::default().with_margin(margin).with_tolerance(tolerance);
                from_polygons(&triangles(&walls, turn), &settings)
            }
        };
        let turn = if number % 3 == 0 { DMat3::IDENTITY } else { turn };
        // A point by a face of a wall, nearer than the tolerance.
        let beside = |random: &mut Random| {
            let [min, max] = walls[random.below(walls.len())];
            let mut p = min + (max - min) * DVec3::from([(); 3].map(|()| random.fine_unit()));
            let (axis, off) = (random.below(3), random.fine_range(0.1, 0.6) * tolerance);
            p[axis] = random.pick(&[min[axis] - off, max[axis] + off]);
            p
        };
        let inside = |random: &mut Random| {
            DVec3::new(
                random.fine_range(0.1, 15.9),
                random.fine_range(0.1, 11.9),
                random.fine_range(0.1, 2.9),
            )
        };
        let mut objects = Vec::new();
        for _ in 0..20 {
            let half = DVec3::splat(0.05 * tolerance);
            let grain = turn * beside(&mut random);
            objects.push([grain - half, grain + half]);
            let mut middle = inside(&mut random);
            middle[random.below(3)] = random.pick(&[0.0, 3.0, 12.0, 16.0]);
            let half = DVec3::from([(); 3].map(|()| random.fine_range(0.2, 3.0)));
            objects.push([turn * middle - half, turn * middle + half]);
        }
        let mut level = Level::new(&made.unwrap(), &objects);
        for _ in 0..200 {
            let object = random.below(objects.len());
            let [min, max] = objects[object];
            let at = min + (max - min) * DVec3::from([(); 3].map(|()| random.fine_unit()));
            let eye = turn * if random.one_in(4) { beside(&mut random) } else { inside(&mut random) };
            let [from, to] = [eye, at].map(|p| turn.transpose() * p);
            let end = (to - from).normalize() * (8.0 * tolerance).min(0.4 * to.distance(from));
            // Lines nearer than the tolerance to faces may be blocked, other than by faces at their ends.
            let is_clear_of = |face: [DVec3; 2]| {
                let is_at_end = is_at(&face, from, to, tolerance) || is_at(&face, to, from, tolerance);
                !blocked(&[face], from, to, 1.01 * tolerance)
                    || is_at_end && !blocked(&[face], from + end, to - end, 1.01 * tolerance)
            };
            let is_clear = !blocked(&walls, from, to, 0.0) && walls.iter().flat_map(faces).all(is_clear_of);
            match level.reports(eye, at, object) {
                Some(reports) if is_clear => {
                    reached += 1;
                    assert_eq!(reports, [true; 4], "{number}: object {object} is seen from {eye} at {at}");
                }
                Some([false, false, false, false]) => hidden += 1,
                _ => {}
            }
        }
    }
    [reached, hidden]
}

#[test]
fn what_a_segment_past_the_walls_reaches_is_reported() {
    let [reached, hidden] = search_yards(5, 18);
    judged((reached + hidden) as u64);
    told_enough(
        reached > 500 && hidden > 100,
        format_args!("{reached} reached, {hidden} hidden: too few to tell"),
    );
}

/// Looks through slots of random walls whose polygons end in steps of less than the tolerance. Returns the
/// number of segments that pass.
fn search_slots(seed: u64, levels: usize) -> usize {
    let (mut random, mut passed) = (Random(seed), 0);
    for number in 0..levels {
        let tolerance = random.pick(&[0.01, 0.02]);
        let count = 8 + random.below(20);
        let (mut walls, mut low, mut high) = (Vec::new(), 1.0, 1.5);
        let signs = [random.pick(&[1.0, -1.0, 0.0]), random.pick(&[1.0, -1.0, 0.0])];
        for i in 0..count {
            let y = [i as f64, (i + 1) as f64];
            low += signs[0] * random.fine_range(0.0, 0.26) * tolerance;
            high += signs[1] * random.fine_range(0.0, 0.26) * tolerance;
            walls.push([y, [0.0, low]]);
            walls.push([y, [high, 3.0]]);
        }
        let axis = random.vector(1.0).normalize_or(DVec3::Z);
        let turn = DMat3::from_quat(DQuat::from_axis_angle(axis, random.pick(&[0.0, 0.4])));
        let polygons = walls.iter().map(|&[y, z]| {
            let mut vertices: Vec<DVec3> =
                upright(0.0, y, z, random.one_in(2)).vertices().iter().map(|&v| turn * v).collect();
            vertices.rotate_left(random.below(4));
            ConvexPolygon::new(vertices).unwrap()
        });
        let polygons: Vec<_> = polygons.collect();
        let settings = PolygonSettings::default().with_tolerance(tolerance);
        let made = from_polygons(&polygons, &settings).unwrap();
        let walls: Vec<_> =
            walls.iter().map(|[y, z]| corners([0.0, y[0], z[0]], [0.0, y[1], z[1]])).collect();
        let length = count as f64;
        let ways: Vec<[DVec3; 2]> = (0..40)
            .map(|_| {
                let through = DVec3::new(0.0, random.fine_range(-0.5, length), random.fine_range(0.9, 1.6));
                let eye = DVec3::new(-0.5, random.fine_range(0.0, length), random.fine_range(0.2, 2.5));
                [eye, through + (through - eye).normalize() * 0.4]
            })
            .collect();
        let grain = |at: DVec3| [turn * at - 1e-3 * tolerance, turn * at + 1e-3 * tolerance];
        let objects: Vec<_> = ways.iter().map(|&[_, at]| grain(at)).collect();
        let mut level = Level::new(&made, &objects);
        for (object, &[eye, at]) in ways.iter().enumerate() {
            if !blocked(&walls, eye, at, 1.01 * tolerance) {
                passed += 1;
                assert_seen(&mut level, turn * eye, turn * at, object, &number.to_string());
            }
        }
    }
    passed
}

#[test]
fn what_a_segment_through_a_slot_reaches_is_reported() {
    let passed = search_slots(6, 60);
    judged(passed as u64);
    told_enough(passed > 500, format_args!("{passed} segments through slots are too few to tell"));
}
