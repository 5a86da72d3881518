//! Scene, cells, PVS, doors and mirrors are swapped, mixed, cloned, reverted and dropped between frames of
//! one eye. Each frame gives the same result as a new eye with new cells.

use crate::maze::{Camera, Maze, Style};
use crate::room_row::{along, boxes, indices, row_of_rooms, seen};
use visibility_core::glam::DVec3;
use visibility_core::{
    Aabb, Culler, ObjectId, Scene, View, VisibleSet,
    cells::{CellGraph, CellId, PortalId},
    geometry::ConvexPolygon,
    pvs::{Pvs, PvsTargets},
};
use visibility_portals::{NotCulled, Passage, PortalCuller, PortalEye, PortalStats, SceneCells};
use visibility_testing::Random;

/// Returns a [row of rooms](row_of_rooms) with a PVS in which each room sees `sight` rooms to either side.
fn row(rooms: u32, sight: u32) -> SceneCells {
    let rows: Vec<Vec<u32>> =
        (0..rooms).map(|a| (0..rooms).filter(|&b| a.abs_diff(b) <= sight).collect()).collect();
    let pvs = Pvs::new(PvsTargets::Cells, rooms as usize, &rows, |_| []).unwrap();
    row_of_rooms(rooms).with_pvs(pvs).unwrap()
}

fn seen_by(culler: &mut PortalCuller, scene: &Scene, view: &View) -> Vec<usize> {
    let mut visible = VisibleSet::new();
    visible.fill(scene, view);
    culler.cull(scene, view, &mut visible);
    indices(scene, &visible)
}

#[test]
fn an_eye_takes_the_pvs_of_the_cells_that_it_is_given() {
    let (scene, view) = (boxes(5).0, along());
    let [mut near, mut far] = [row(5, 1), row(5, 4)];
    near.sync(&scene);
    far.sync(&scene);
    let mut eye = PortalEye::new();
    for _ in 0..2 {
        assert_eq!(seen(&mut eye, &near, &scene, &view), [0, 1], "the cells whose set ends at the next room");
        assert_eq!(seen(&mut eye, &far, &scene, &view), [0, 1, 2, 3, 4], "the cells whose set has all rooms");
    }
}

#[test]
fn a_culler_takes_the_pvs_of_cells_that_are_put_in_the_place_of_others() {
    let (scene, view) = (boxes(5).0, along());
    let mut culler = PortalCuller::new(row(5, 1));
    for reset in [false, true] {
        *culler.cells_mut() = row(5, 1);
        assert_eq!(
            seen_by(&mut culler, &scene, &view),
            [0, 1],
            "reset: {reset}: the set that ends at the next room"
        );
        *culler.cells_mut() = row(5, 4);
        if reset {
            culler.reset();
        }
        assert_eq!(seen_by(&mut culler, &scene, &view), [0, 1, 2, 3, 4], "reset: {reset}");
    }
}

#[test]
fn a_culler_that_is_reset_is_as_new() {
    let (scene, view) = (boxes(5).0, along());
    let mut culler = PortalCuller::new(row(5, 4)).with_eye(PortalEye::new().with_step_limit(1));
    seen_by(&mut culler, &scene, &view);
    assert_eq!(culler.eye().stats().fallback, Some(NotCulled::Steps), "one step is too few");
    culler.reset();
    let eye = culler.eye();
    assert_eq!(eye.stats(), PortalStats::default(), "counts after a reset");
    assert_eq!(
        (eye.seen_cells().count(), eye.windows().count(), eye.reflections().len()),
        (0, 0, 0),
        "cells seen, windows and reflections after a reset"
    );
    seen_by(&mut culler, &scene, &view);
    assert_eq!(culler.eye().stats().fallback, Some(NotCulled::Steps), "settings stay");
}

#[test]
fn an_eye_that_gave_up_in_a_large_building_looks_into_a_small_one() {
    let (scene, view) = (boxes(9).0, along());
    let [mut large, mut small] = [row(9, 8), row(2, 1)];
    large.sync(&scene);
    small.sync(&scene);
    for steps in 0..20 {
        let mut eye = PortalEye::new().with_step_limit(steps);
        seen(&mut eye, &large, &scene, &view);
        let mut eye = eye.with_step_limit(100);
        // Objects outside all cells of the small building stay visible.
        assert_eq!(
            seen(&mut eye, &small, &scene, &view),
            [0, 1, 2, 3, 4, 5, 6, 7, 8],
            "{steps} steps before: objects outside the small building stay"
        );
        assert_eq!(eye.stats().fallback, None, "{steps} steps before: the walk of the small building ends");
    }
}

#[test]
fn mirrors_show_all_that_is_in_view_where_the_cells_do_not_know_the_scene() {
    let (scene, view) = (boxes(2).0, along());
    let mut cells = row(2, 1);
    // A mirror at the end of the second room, facing the eye.
    let corners = [[1.0, 0.5], [1.0, 2.0], [3.0, 2.0], [3.0, 0.5]];
    let glass = ConvexPolygon::new(corners.map(|[y, z]| DVec3::new(8.0, y, z))).unwrap();
    cells.add_mirror(CellId(1), &glass).unwrap();
    let mut eye = PortalEye::new();
    let shown = |eye: &PortalEye| {
        eye.reflections().iter().map(|one| indices(&scene, one.visible())).collect::<Vec<_>>()
    };
    assert_eq!(seen(&mut eye, &cells, &scene, &view), [0, 1], "objects seen before the sync");
    assert_eq!(
        (eye.stats().fallback, shown(&eye)),
        (Some(NotCulled::NotSynced), vec![vec![0, 1]]),
        "why nothing is culled, and objects in the mirror"
    );
    cells.sync(&scene);
    assert_eq!(seen(&mut eye, &cells, &scene, &view), [0, 1], "objects seen after the sync");
    assert_eq!(
        (eye.stats().fallback, shown(&eye)),
        (None, vec![vec![0, 1]]),
        "objects in the mirror after the sync"
    );
}

#[test]
fn mirrors_in_mirrors_are_shown_where_the_cells_do_not_know_the_scene() {
    let (scene, view) = (boxes(2).0, along());
    let mut cells = row(2, 1);
    // Mirrors at both ends of the row, which face each other.
    let corners = [[1.0, 0.5], [1.0, 2.0], [3.0, 2.0], [3.0, 0.5]];
    let far = ConvexPolygon::new(corners.map(|[y, z]| DVec3::new(8.0, y, z))).unwrap();
    let back =
        ConvexPolygon::new([0, 3, 2, 1].map(|i| DVec3::new(0.0, corners[i][0], corners[i][1]))).unwrap();
    let ends = [cells.add_mirror(CellId(1), &far).unwrap(), cells.add_mirror(CellId(0), &back).unwrap()];
    let mut eye = PortalEye::new();
    for is_synced in [false, true] {
        if is_synced {
            cells.sync(&scene);
        }
        seen(&mut eye, &cells, &scene, &view);
        assert_eq!(eye.stats().fallback.is_none(), is_synced, "the frame is culled after the sync");
        let shown: Vec<_> = eye.reflections().iter().map(|one| (one.mirror(), one.depth())).collect();
        assert_eq!(
            shown,
            [(ends[0], 1), (ends[1], 2)],
            "synced {is_synced}: the far mirror, and in it the other"
        );
        let left_out = eye.stats().reflections_left_out;
        assert_eq!(left_out, 1, "synced {is_synced}: the far mirror again is the third of a line of sight");
    }
}

/// Results of all queries of an eye after a frame.
#[derive(PartialEq, Debug)]
struct Answer {
    visible: Vec<usize>,
    stats: PortalStats,
    cells: Vec<CellId>,
    ways: Vec<Vec<PortalId>>,
    windows: usize,
    reflections: Vec<(u32, Option<usize>, Vec<usize>)>,
}

impl Answer {
    fn new(eye: &PortalEye, cells: &SceneCells, scene: &Scene, visible: &VisibleSet) -> Self {
        let all = (0..cells.graph().cell_count() as u32).map(CellId);
        let of = |one: &visibility_portals::Reflection| {
            (one.mirror().0, one.parent(), indices(scene, one.visible()))
        };
        Self {
            visible: indices(scene, visible),
            stats: eye.stats(),
            cells: eye.seen_cells().collect(),
            ways: all.map(|cell| eye.path_to(cell).collect()).collect(),
            windows: eye.windows().count(),
            reflections: eye.reflections().iter().map(of).collect(),
        }
    }
}

/// The inputs and changes that produced some cells, from which equal cells can be made again.
#[derive(Clone)]
struct Recipe {
    maze: usize,
    pvs: Option<Pvs>,
    doors: Vec<(bool, Passage)>,
    mirrors: Vec<(CellId, ConvexPolygon, bool)>,
}

impl Recipe {
    fn cells(&self, mazes: &[Maze]) -> SceneCells {
        let source = &mazes[self.maze].cells;
        let cells = SceneCells::new(source.graph().clone(), source.viewcells().clone(), 1e-9).unwrap();
        let mut cells = match &self.pvs {
            Some(pvs) => cells.with_pvs(pvs.clone()).unwrap(),
            None => cells,
        };
        for (portal, &(open, passage)) in (0..).map(PortalId).zip(&self.doors) {
            cells.set_open(portal, open).unwrap();
            cells.set_passage(portal, passage).unwrap();
        }
        for (cell, polygon, uncovered) in &self.mirrors {
            let mirror = cells.add_mirror(*cell, polygon).unwrap();
            cells.set_mirror(mirror, *uncovered).unwrap();
        }
        cells
    }

    /// Returns a recipe for a random maze, with all doors open, no mirrors, and a random PVS or none.
    fn random(random: &mut Random, mazes: &[Maze]) -> Self {
        let maze = random.below(mazes.len());
        let graph = mazes[maze].cells.graph();
        let pvs = (random.below(3) > 0).then(|| random_pvs(random, graph));
        Self { maze, pvs, doors: vec![(true, Passage::BothWays); graph.portals().len()], mirrors: Vec::new() }
    }
}

/// Returns a PVS in which each cell sees itself and about half of the other cells.
fn random_pvs(random: &mut Random, graph: &CellGraph) -> Pvs {
    let cells = graph.cell_count() as u32;
    let rows: Vec<Vec<u32>> =
        (0..cells).map(|a| (0..cells).filter(|&b| a == b || random.below(2) == 0).collect()).collect();
    Pvs::new(PvsTargets::Cells, cells as usize, &rows, |_| []).unwrap()
}

/// Changes a random door, mirror or the PVS of `cells`, and records the change in `recipe`.
fn change(random: &mut Random, cells: &mut SceneCells, recipe: &mut Recipe) {
    let doors = recipe.doors.len();
    match random.below(4) {
        0 if doors > 0 => {
            let (at, open) = (random.below(doors), random.below(2) == 0);
            cells.set_open(PortalId(at as u32), open).unwrap();
            recipe.doors[at].0 = open;
        }
        1 if doors > 0 => {
            let at = random.below(doors);
            let passage = [Passage::BothWays, Passage::Forward, Passage::Backward][random.below(3)];
            cells.set_passage(PortalId(at as u32), passage).unwrap();
            recipe.doors[at].1 = passage;
        }
        2 if doors > 0 && recipe.mirrors.len() < 6 => {
            // The mirror fills the polygon of a door and faces the door's second cell.
            let portal = &cells.graph().portals()[random.below(doors)];
            let (cell, polygon) = (portal.cells()[1], portal.polygon().clone());
            cells.add_mirror(cell, &polygon).unwrap();
            recipe.mirrors.push((cell, polygon, true));
        }
        3 if !recipe.mirrors.is_empty() => {
            let (at, uncovered) = (random.below(recipe.mirrors.len()), random.below(2) == 0);
            cells.set_mirror(visibility_portals::MirrorId(at as u32), uncovered).unwrap();
            recipe.mirrors[at].2 = uncovered;
        }
        _ => {
            let pvs = random_pvs(random, cells.graph());
            *cells = cells.clone().with_pvs(pvs.clone()).unwrap();
            recipe.pvs = Some(pvs);
        }
    }
}

/// Moves, removes or inserts 1 to 4 random objects of a scene.
fn stir(random: &mut Random, scene: &mut Scene, maze: &Maze) {
    for _ in 0..1 + random.below(4) {
        let all: Vec<ObjectId> = scene.ids().collect();
        let room = random.below(maze.rooms());
        let at = maze.to_world(maze.point_in(random, room)).as_vec3();
        let bounds = Aabb::new(at - 0.2, at + 0.2);
        match random.below(3) {
            0 if !all.is_empty() => drop(scene.remove(all[random.below(all.len())])),
            1 if !all.is_empty() => scene.set_bounds(all[random.below(all.len())], bounds).unwrap(),
            _ => drop(scene.insert(bounds)),
        }
    }
}

#[test]
fn whatever_is_swapped_the_answer_is_that_of_a_new_eye_and_of_new_cells() {
    let style = Style { turned: false, slivers: false, mirrors: false, shift: 0.0, tolerance: 1e-9 };
    let mut random = Random(71);
    let mut fallbacks = [0; 2];
    for _ in 0..12 {
        // Two mazes of equal size, which counts alone cannot distinguish; one smaller, one larger.
        let mazes =
            [[3, 3, 1], [3, 3, 1], [2, 1, 1], [4, 3, 1]].map(|size| Maze::new(&mut random, size, style));
        let mut scenes: Vec<Scene> = mazes.iter().map(|maze| maze.scene.clone()).collect();
        let mut recipes = vec![Recipe::random(&mut random, &mazes), Recipe::random(&mut random, &mazes)];
        let mut live: Vec<SceneCells> = recipes.iter().map(|recipe| recipe.cells(&mazes)).collect();
        let mut eye = PortalEye::new();
        let mut culler = PortalCuller::new(live[0].clone());
        for frame in 0..150 {
            let (a, s) = (random.below(live.len()), random.below(scenes.len()));
            match random.below(12) {
                0 => {
                    // Replaces the cells by others; the old cells are dropped.
                    recipes[a] = Recipe::random(&mut random, &mazes);
                    live[a] = recipes[a].cells(&mazes);
                }
                1 if live.len() < 6 => {
                    // A clone that changes independently from here on.
                    live.push(live[a].clone());
                    recipes.push(recipes[a].clone());
                }
                2 => scenes[s] = scenes[random.below(scenes.len())].clone(),
                3 => scenes[s] = mazes[random.below(mazes.len())].scene.clone(),
                4 | 5 => stir(&mut random, &mut scenes[s], &mazes[0]),
                6 if live.len() > 2 => {
                    live.swap_remove(a);
                    recipes.swap_remove(a);
                }
                7 => eye = eye.with_step_limit([3, 20_000][random.below(2)]),
                8 => scenes[s].set_origin(random.fine_vector(1.0) * 1e-3).unwrap(),
                _ => change(&mut random, &mut live[a], &mut recipes[a]),
            }
            let (a, s) = (random.below(live.len()), random.below(scenes.len()));
            let scene = &scenes[s];
            let maze = &mazes[recipes[a].maze];
            let room = random.below(maze.rooms());
            let at = maze.to_world(maze.point_in(&mut random, room));
            let camera = Camera::new(&mut random, at, frame % 5 == 0);
            let told = random.below(6) > 0;
            if told {
                live[a].sync(scene);
            }
            let mut fresh_cells = recipes[a].cells(&mazes);
            fresh_cells.sync(scene);
            let mut visible = VisibleSet::new();
            visible.fill(scene, &camera.view);
            let candidates = visible.clone();
            eye.cull(&live[a], scene, &camera.view, &mut visible);
            // A new eye gets the same result from the same cells.
            let limit = if eye.stats().fallback == Some(NotCulled::Steps) { 3 } else { 20_000 };
            let mut fresh = PortalEye::new().with_step_limit(limit);
            let mut other = candidates.clone();
            fresh.cull(&live[a], scene, &camera.view, &mut other);
            let answer = Answer::new(&eye, &live[a], scene, &visible);
            assert_eq!(answer, Answer::new(&fresh, &live[a], scene, &other), "frame {frame}");
            // New cells give the same result if the old cells were synced; otherwise the old cells hide no
            // more objects.
            let mut newest = candidates.clone();
            fresh.cull(&fresh_cells, scene, &camera.view, &mut newest);
            let newest = Answer::new(&fresh, &fresh_cells, scene, &newest);
            if told {
                assert_eq!(answer, newest, "frame {frame}");
                assert!(
                    scene.ids().all(|id| live[a].cells_of(id) == fresh_cells.cells_of(id)),
                    "frame {frame}: cells of an object"
                );
            } else if answer.stats.fallback != Some(NotCulled::Steps) {
                assert!(newest.visible.iter().all(|id| answer.visible.contains(id)), "frame {frame}");
            }
            fallbacks[usize::from(answer.stats.fallback.is_some())] += 1;
            // The culler owns its cells, which are replaced by a clone every frame.
            *culler.cells_mut() = live[a].clone();
            let mut own = candidates.clone();
            culler.cull(scene, &camera.view, &mut own);
            if newest.stats.fallback != Some(NotCulled::Steps) {
                assert_eq!(indices(scene, &own), newest.visible, "frame {frame}");
            }
        }
    }
    assert!(fallbacks[0] > 800 && fallbacks[1] > 50, "{fallbacks:?}");
}
