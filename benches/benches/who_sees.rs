//! Benchmarks of visibility between movers in a building of 16 x 16 rooms of 8 m with doors: a tick of a
//! shooter's server (64 players, and 5,000 things of which every tenth moves), and 4,000 movers among
//! themselves. Methods are the plan, the matrix of its rooms, and, for one player, nine rays to each target.

use criterion::{Criterion, criterion_group, criterion_main};
use std::hint::black_box;
use visibility_2d::cdt::{Plan, PlanCells, Wall};
use visibility_core::glam::DVec3;
use visibility_core::pvs::{Viewcell, Viewcells};
use visibility_core::random::Random;
use visibility_core::who_sees::{Reach, SightCells, ViewcellMatrix, WhoSees};

/// Number of rooms along each axis, and their width and height in metres.
const ROOMS: u32 = 16;
const WIDTH: f64 = 8.0;
const HEIGHT: f64 = 3.0;

/// Returns the walls between the rooms. Two walls in three have a door of a metre.
fn plan(random: &mut Random) -> Plan {
    let mut walls = Vec::new();
    for (axis, line, room) in (0..2)
        .flat_map(|axis| (0..=ROOMS).flat_map(move |line| (0..ROOMS).map(move |room| (axis, line, room))))
    {
        let at = |along: f64| {
            let mut point = [f64::from(line) * WIDTH; 2];
            point[axis] = f64::from(room) * WIDTH + along;
            point
        };
        let door = 1.0 + random.unit() * (WIDTH - 3.0);
        if line == 0 || line == ROOMS || random.unit() < 1.0 / 3.0 {
            walls.push(Wall::new(at(0.0), at(WIDTH)));
        } else {
            walls.extend([Wall::new(at(0.0), at(door)), Wall::new(at(door + 1.0), at(WIDTH))]);
        }
    }
    Plan::new(&walls).expect("finite walls")
}

/// Returns the visibility matrix of the rooms. Each room is the reach of a mover that fills it.
fn matrix(plan: &Plan) -> ViewcellMatrix {
    let rooms: Vec<Viewcell> = (0..ROOMS * ROOMS)
        .map(|room| {
            let min = DVec3::new(f64::from(room % ROOMS), f64::from(room / ROOMS), 0.0) * WIDTH;
            Viewcell::from_box(min, min + DVec3::new(WIDTH, WIDTH, HEIGHT))
        })
        .collect();
    let reaches: Vec<Reach> = rooms.iter().map(|room| Reach::new(room.min, room.max)).collect();
    let mut who = WhoSees::new();
    who.look(&mut PlanCells::new(plan.clone(), [0, 1]).expect("axes"), &reaches, &reaches);
    let rows: Vec<Vec<u32>> =
        (0..reaches.len()).map(|room| who.seen_by(room).map(|room| room as u32).collect()).collect();
    ViewcellMatrix::new(Viewcells::new(rooms), &rows)
}

/// Returns the movers at two ticks, at random places. Every `moving`-th mover moves between the two.
fn ticks(random: &mut Random, count: usize, moving: usize) -> [Vec<Reach>; 2] {
    let extent = f64::from(ROOMS) * WIDTH - 2.0;
    let mut person = || {
        let min = DVec3::new(1.0 + random.unit() * extent, 1.0 + random.unit() * extent, 0.7);
        Reach::new(min, min + DVec3::new(0.6, 0.6, 1.7))
    };
    let first: Vec<Reach> = (0..count).map(|_| person()).collect();
    let step = DVec3::new(0.1, 0.1, 0.0);
    let at = |shift: DVec3| {
        first
            .iter()
            .enumerate()
            .map(|(i, &Reach { min, max, .. })| match i % moving {
                0 => Reach::new(min + shift, max + shift).within(0.1, 6.0),
                _ => Reach::new(min, max),
            })
            .collect()
    };
    [at(DVec3::ZERO), at(step)]
}

fn who_sees(c: &mut Criterion) {
    let mut random = Random(42);
    let plan = plan(&mut random);
    let mut levels: [(&str, Box<dyn SightCells>); 2] = [
        ("plan", Box::new(PlanCells::new(plan.clone(), [0, 1]).expect("axes"))),
        ("matrix", Box::new(matrix(&plan))),
    ];
    let players = ticks(&mut random, 64, 1);
    let things = ticks(&mut random, 5000, 10);
    let targets = [0, 1].map(|tick| [players[tick].as_slice(), &things[tick]].concat());
    let crowd = ticks(&mut random, 4000, 1);
    let mut tick = 0;
    for (name, level) in &mut levels {
        for (label, observers, targets) in
            [("64 players x 5,064", &players, &targets), ("4,000 x 4,000", &crowd, &crowd)]
        {
            let mut who = WhoSees::new();
            who.look(&mut **level, &observers[0], &targets[0]);
            let seen: usize = (0..observers[0].len()).map(|i| who.seen_by(i).count()).sum();
            let share = 100.0 * seen as f64 / (observers[0].len() * targets[0].len()) as f64;
            println!("{label}, {name}: {share:.1} % of the pairs are reported");
            c.bench_function(&format!("who sees whom, {label}, {name}"), |b| {
                b.iter(|| {
                    tick ^= 1;
                    who.look(&mut **level, black_box(&observers[tick]), &targets[tick]);
                });
            });
        }
    }
    let eye = (players[0][0].min + players[0][0].max) * 0.5;
    c.bench_function("nine rays to each of 5,064 targets, one player of 64", |b| {
        b.iter(|| {
            let reached = |target: &&Reach| {
                let middle = (target.min + target.max) * 0.5;
                let corners = (0..8).map(|i| [i & 1, i >> 1 & 1].map(|side| side != 0));
                let corner = |[x, y]: [bool; 2]| {
                    [if x { target.max.x } else { target.min.x }, if y { target.max.y } else { target.min.y }]
                };
                std::iter::once([middle.x, middle.y])
                    .chain(corners.map(corner))
                    .any(|to| plan.sees([eye.x, eye.y], to).unwrap_or(true))
            };
            black_box(targets[0].iter().filter(reached).count())
        });
    });
}

criterion_group!(benches, who_sees);
criterion_main!(benches);
