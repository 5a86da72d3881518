//! Movers in random mazes see every object that a ray through doorways reaches, from any place that they may
//! get to in time.

use crate::maze::{Maze, Style};
use visibility_core::bake::Bake;
use visibility_core::cells::{CellGraph, CellId};
use visibility_core::glam::DVec3;
use visibility_core::pvs::{Pvs, PvsTargets, Viewcells};
use visibility_core::who_sees::{OfPortalsError, Reach, ViewcellMatrix, WhoSees};
use visibility_portals::{BakerSettings, CellBaker};
use visibility_testing::{Random, judged, told_enough};

fn bake(maze: &Maze) -> Pvs {
    let graph = maze.cells.graph();
    let baked = Bake::new(CellBaker::new(graph, BakerSettings::default()).unwrap()).run();
    baked.matrix.to_pvs(graph).unwrap()
}

/// Returns the number of hidden pairs of observer and object, and the number of objects that rays reached
/// from places near the observers.
fn search(seed: u64, mazes: usize) -> [usize; 2] {
    let (mut rng, mut hidden, mut reached) = (Random(seed), 0, 0);
    for number in 0..mazes {
        let style = Style {
            turned: number % 2 == 0,
            slivers: false,
            mirrors: false,
            shift: rng.pick(&[0.0, 10.0, 1e5]),
            tolerance: 1e-6,
        };
        let maze = Maze::new(&mut rng, [4, 4, 2], style);
        let (graph, volumes) = (maze.cells.graph(), maze.cells.viewcells().clone());
        let mut level = ViewcellMatrix::of_portals(graph, volumes, &bake(&maze), 2e-6).unwrap();
        let targets: Vec<Reach> = maze.objects.iter().map(|&(_, min, max)| Reach::new(min, max)).collect();
        let starts: Vec<(usize, DVec3)> =
            (0..maze.rooms()).map(|room| (room, maze.to_world(maze.point_in(&mut rng, room)))).collect();
        let observers: Vec<Reach> =
            starts.iter().map(|&(_, eye)| Reach::new(eye, eye).within(0.5, rng.range(0.0, 4.0))).collect();
        let mut who = WhoSees::new();
        who.look(&mut level, &observers, &targets);
        for (i, &(room, eye)) in starts.iter().enumerate() {
            hidden += (0..targets.len()).filter(|&target| !who.sees(i, target)).count();
            for _ in 0..400 {
                // A place in the same room, or in the next one through a doorway, and the length of the
                // straight path there.
                let doors = maze.cells.graph().portals_of(CellId(room as u32));
                let mut from = maze.to_world(maze.point_in(&mut rng, room));
                let mut way = from.distance(eye);
                if let Some(&door) = doors.get(rng.below(doors.len() + 1)) {
                    let doorway = maze.targets[2 * door.index()];
                    let next = maze.cells.graph().portals()[door.index()].other(CellId(room as u32));
                    from = doorway.lerp(maze.to_world(maze.point_in(&mut rng, next.index())), rng.unit());
                    way = doorway.distance(eye) + from.distance(doorway);
                }
                let to = Maze::near(&mut rng, from, &maze.targets).unwrap_or(eye);
                if way < observers[i].margin {
                    maze.follow(from, (to - from) * rng.range(0.5, 2.0) + rng.vector(0.1), |object, _| {
                        reached += 1;
                        assert!(
                            who.sees(i, object),
                            "maze {number}: {object} is seen from {from} near {eye}"
                        );
                    });
                }
            }
        }
    }
    [hidden, reached]
}

#[test]
fn what_a_ray_through_doorways_reaches_is_reported() {
    let [hidden, reached] = search(19, 24);
    judged(reached as u64);
    told_enough(
        hidden > 10_000 && reached > 1_000,
        format_args!("{hidden} hidden, {reached} reached: too few to tell"),
    );
}

#[test]
fn a_set_of_another_graph_is_refused() {
    let style = Style { turned: false, slivers: false, mirrors: false, shift: 0.0, tolerance: 0.0 };
    let maze = Maze::new(&mut Random(4), [2, 2, 1], style);
    let (graph, volumes, pvs) = (maze.cells.graph(), maze.cells.viewcells(), bake(&maze));
    let is_made =
        |graph: &CellGraph, pvs: &Pvs| ViewcellMatrix::of_portals(graph, volumes.clone(), pvs, 1e-9).is_ok();
    assert!(is_made(graph, &pvs), "the set of the graph");
    assert!(!is_made(&CellGraph::new(4, []).unwrap(), &pvs), "a set of another graph");
    let rows = [[0u32]; 4];
    let made = |targets, count| Pvs::new(targets, count, &rows, |_| []).unwrap();
    assert!(!is_made(graph, &made(PvsTargets::Cells, 4)), "a set without a source");
    let source = graph.version();
    assert!(!is_made(graph, &made(PvsTargets::Objects, 4).with_source(source)), "a set of objects");
    assert!(!is_made(graph, &made(PvsTargets::Cells, 5).with_source(source)), "a set of five cells");
    for swap in [[0, 1], [0, 3], [1, 2]] {
        let mut cells = volumes.cells().to_vec();
        cells.swap(swap[0], swap[1]);
        let made = ViewcellMatrix::of_portals(graph, Viewcells::new(cells), &pvs, 1e-9);
        assert!(matches!(made, Err(OfPortalsError::Viewcells(_))), "volumes {swap:?} swapped: {made:?}");
    }
    let made = ViewcellMatrix::of_portals(graph, Viewcells::default(), &pvs, 1e-9);
    assert!(matches!(made, Err(OfPortalsError::Viewcells(_))), "no volumes: {made:?}");
}
