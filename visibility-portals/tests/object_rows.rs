//! Rows of objects seen from a cell: each object that a segment from the cell reaches through doors is in the
//! cell's row, with any limit of steps. Longer searches, and stages with tighter tests, leave out more
//! objects.
//!
//! `cargo test --release -p visibility-portals object_rows -- --ignored` shoots a hundred times as
//! many segments.

use visibility_core::bake::Bake;
use visibility_core::glam::{DVec2, DVec3};
use visibility_core::{
    Aabb, ObjectId, Scene,
    cells::{CellGraph, CellId},
    geometry::ConvexPolygon,
};
use visibility_portals::{BakeError, BakerSettings, CellBaker, ObjectBaker};
use visibility_testing::{Random, judged, told_enough};

/// Number of rooms along x and along y. Rooms are squares of `SIDE` metres.
const ROOMS: u32 = 7;
const SIDE: f64 = 4.0;
/// Height of the doors in metres.
const HEIGHT: f64 = 2.0;
const CLEARANCE: f64 = 1e-6;
/// Number of boxes in each room.
const BOXES: usize = 5;

/// A door in the wall between room `from` and the next room along `axis`, with the coordinates of its two
/// ends along the wall.
struct Door {
    from: [u32; 2],
    axis: usize,
    ends: [f64; 2],
}

fn cell([x, y]: [u32; 2]) -> CellId {
    CellId(x * ROOMS + y)
}

/// Returns doors in most of the walls between neighbouring rooms, at most one in each wall.
fn doors(random: &mut Random) -> Vec<Door> {
    let mut doors = Vec::new();
    for (x, y) in (0..ROOMS).flat_map(|x| (0..ROOMS).map(move |y| (x, y))) {
        for axis in 0..2 {
            let start = f64::from([y, x][axis]) * SIDE + random.fine_range(0.1, 2.9);
            let width = random.fine_range(0.3, 1.0);
            if [x, y][axis] + 1 < ROOMS && random.fine_unit() < 0.9 {
                doors.push(Door { from: [x, y], axis, ends: [start, start + width] });
            }
        }
    }
    doors
}

fn graph(doors: &[Door]) -> CellGraph {
    let portals = doors.iter().map(|&Door { from, axis, ends: [start, end] }| {
        let wall = f64::from(from[axis] + 1) * SIDE;
        let at = |along: f64, z: f64| if axis == 0 { [wall, along, z] } else { [along, wall, z] };
        let mut quad = [at(start, 0.0), at(end, 0.0), at(end, HEIGHT), at(start, HEIGHT)];
        if axis == 1 {
            quad.reverse();
        }
        let mut to = from;
        to[axis] += 1;
        (ConvexPolygon::new(quad.map(DVec3::from)).unwrap(), [cell(from), cell(to)])
    });
    CellGraph::new((ROOMS * ROOMS) as usize, portals.collect::<Vec<_>>()).unwrap()
}

/// Tests whether a segment within the building crosses walls only in doors, at least ten clearances from
/// their frames.
fn is_clear(doors: &[Door], a: DVec3, b: DVec3) -> bool {
    (0..2).all(|axis| {
        (1..ROOMS).all(|wall| {
            let plane = f64::from(wall) * SIDE;
            if (a[axis] - plane) * (b[axis] - plane) > 0.0 {
                return true;
            }
            let p = a + (b - a) * ((plane - a[axis]) / (b[axis] - a[axis]));
            let across = DVec2::new(p.x, p.y)[1 - axis];
            let passes = |door: &&Door| {
                let margin = 10.0 * CLEARANCE;
                (door.axis, door.from[axis] + 1) == (axis, wall)
                    && door.ends[0] + margin < across
                    && across < door.ends[1] - margin
                    && margin < p.z
                    && p.z < HEIGHT - margin
            };
            doors.iter().any(|door| passes(&door))
        })
    })
}

/// Bakes buildings with boxes in each room and shoots segments at boxes. Fails if a cell does not see a
/// box that a segment from the cell reaches, or if too little is hidden.
fn check(buildings: u64, segments: usize) {
    let (mut reached, mut beyond) = (0, 0);
    for seed in 0..buildings {
        let mut random = Random(seed);
        let doors = doors(&mut random);
        let mut graph = graph(&doors);
        let mut scene = Scene::new();
        let (mut boxes, mut pairs) = (Vec::new(), Vec::new());
        for room in (0..ROOMS).flat_map(|x| (0..ROOMS).map(move |y| [x, y])) {
            for _ in 0..BOXES {
                let corner = room.map(|i| f64::from(i) * SIDE);
                let min = DVec3::new(corner[0], corner[1], 0.0)
                    + DVec3::from([3.4, 3.4, 1.5].map(|most| random.fine_range(0.1, most)));
                let size = DVec3::from([0.5; 3].map(|most| random.fine_range(0.01, most)));
                pairs.push((cell(room), scene.insert(Aabb::from_world(min, min + size, DVec3::ZERO))));
                boxes.push([min, min + size]);
            }
        }
        graph.set_objects(pairs.iter().copied()).unwrap();
        let settings = BakerSettings::default().with_clearance(CLEARANCE);
        let cells = Bake::new(CellBaker::new(&graph, settings).unwrap()).run();
        let previews = [0, 1, 2]
            .map(|depth| Bake::new(CellBaker::new(&graph, settings.with_depth(depth)).unwrap()).run());
        let bounds = |id: ObjectId| boxes.get(id.index()).copied();
        // Limits of steps that allow no chain, too few chains, and all chains.
        let rows = [0, 6, u64::MAX].map(|steps_per_cell| {
            let settings = settings.with_steps_per_cell(steps_per_cell);
            Bake::new(ObjectBaker::new(&graph, &cells, bounds, settings).unwrap()).run()
        });
        // The pairs of portals of a preview leave more chains to the bake of objects.
        let of_preview = Bake::new(ObjectBaker::new(&graph, &previews[1], bounds, settings).unwrap()).run();
        for _ in 0..segments {
            let (target, part) =
                (random.below(boxes.len()), DVec3::from([1.0; 3].map(|_| random.fine_unit())));
            let b = boxes[target][0] + (boxes[target][1] - boxes[target][0]) * part;
            // Half of the eyes are behind a random door, on a line through it.
            let door = &doors[random.below(doors.len())];
            let wall = f64::from(door.from[door.axis] + 1) * SIDE;
            let along = random.fine_range(door.ends[0], door.ends[1]);
            let z = random.fine_range(0.0, HEIGHT);
            let through =
                if door.axis == 0 { DVec3::new(wall, along, z) } else { DVec3::new(along, wall, z) };
            let extent = f64::from(ROOMS) * SIDE;
            let a = if random.fine_unit() < 0.5 {
                b + (through - b) * random.fine_range(1.0, 3.0)
            } else {
                DVec3::new(random.fine_range(0.0, extent), random.fine_range(0.0, extent), z)
            };
            if a.x.min(a.y) <= 0.0 || a.x.max(a.y) >= extent || !is_clear(&doors, a, b) {
                continue;
            }
            reached += 1;
            let from = cell([a.x, a.y].map(|at| (at / SIDE) as u32));
            beyond += usize::from(from != pairs[target].0);
            for (depth, preview) in previews.iter().enumerate() {
                assert!(
                    preview.matrix.sees(from, pairs[target].0),
                    "building {seed}: with chains of depth {depth}, {from:?} does not see the cell of object \
                     {target}: {a} to {b}"
                );
            }
            for rows in rows.iter().chain([&of_preview]) {
                assert!(
                    rows.rows[from.index()].binary_search(&(target as u32)).is_ok(),
                    "building {seed}: {from:?} does not see object {target}: {a} to {b}"
                );
            }
        }
        let counts = previews.each_ref().map(|preview| preview.matrix.count());
        assert!(
            cells.matrix.count() <= counts[2] && counts[2] <= counts[1] && counts[1] < counts[0],
            "building {seed}: pairs by depth: {counts:?}, of all chains {}",
            cells.matrix.count()
        );
        let means = rows.each_ref().map(|rows| rows.mean_visible());
        let by_cells = cells.matrix.mean_visible() * BOXES as f64;
        assert!(means[2] <= means[1] && means[1] <= means[0], "{seed}: {means:?}");
        assert!(means[0] < 0.95 * by_cells && means[2] < means[0], "{seed}: {means:?} of {by_cells}");
        assert!(
            rows[2].fallbacks.is_empty() && !rows[1].fallbacks.is_empty(),
            "seed {seed}: cells without chains of portals fall back, with all chains none does"
        );
        // Results of a bake of cells are refused if they are of another clearance or of another graph.
        let wide = settings.with_clearance(1e-3);
        assert_eq!(
            ObjectBaker::new(&graph, &cells, bounds, wide).err(),
            Some(BakeError::Cells),
            "seed {seed}: rows of cells with another clearance"
        );
    }
    judged(reached as u64);
    told_enough(
        beyond > 20 * buildings as usize && reached > beyond,
        format_args!("{beyond} of {reached} segments pass a door"),
    );
}

#[test]
fn what_segments_through_doors_reach_is_in_the_row() {
    check(40, 20_000);
}
