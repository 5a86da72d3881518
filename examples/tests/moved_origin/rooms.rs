//! Tests of cells, portals and visible sets in world space, with a scene whose origin moves. The rooms stay
//! in place in the world; objects are where the scene puts them. Certainly visible objects are found by
//! segments that cross each wall between rooms inside its door.

use super::world::{Camera, move_origin, world_boxes};
use glam::DVec3;
use std::sync::Arc;
use visibility_core::bake::Bake;
use visibility_core::cells::{CellGraph, CellId};
use visibility_core::geometry::ConvexPolygon;
use visibility_core::pvs::{PvsCuller, ScenePvs, Viewcell, Viewcells};
use visibility_core::{Aabb, Accuracy, CullStats, Culler, ObjectId, Scene, View, VisibleSet};
use visibility_portals::{BakerSettings, CellBaker, PortalCuller, PortalEye, SceneCells};
use visibility_testing::Random;

const ROOMS: usize = 6;

/// Sides in metres of a room, along x, y and z.
const ROOM: DVec3 = DVec3::new(4.0, 4.0, 3.0);

/// Least distance in metres between the oracle's segments and walls or door frames.
const DOUBT: f64 = 5e-3;

/// Rooms in a row along x, starting at `base`, with a door in each wall between two rooms.
struct Rooms {
    base: DVec3,
}

impl Rooms {
    /// Returns the two ends along y of the door to room `number`. Doors reach from the floor up to 2 m.
    fn door(number: usize) -> [f64; 2] {
        let from = [0.4, 2.4, 1.5][number % 3];
        [from, from + 1.1]
    }

    fn cells(&self) -> SceneCells {
        let corner = |number: usize| self.base + DVec3::X * ROOM.x * number as f64;
        let portals = (1..ROOMS).map(|number| {
            let [low, high] = Self::door(number);
            let corners = [[low, 0.0], [high, 0.0], [high, 2.0], [low, 2.0]];
            let polygon = ConvexPolygon::new(corners.map(|[y, z]| corner(number) + DVec3::new(0.0, y, z)));
            (polygon.unwrap(), [number - 1, number].map(|cell| CellId(cell as u32)))
        });
        let graph = CellGraph::new(ROOMS, portals).unwrap();
        let cells = (0..ROOMS).map(|number| Viewcell::from_box(corner(number), corner(number) + ROOM));
        SceneCells::new(graph, Viewcells::new(cells), 1e-4).unwrap()
    }

    fn is_inside(&self, point: DVec3) -> bool {
        let at = point - self.base;
        let size = ROOM * DVec3::new(ROOMS as f64, 1.0, 1.0);
        at.cmpgt(DVec3::splat(DOUBT)).all() && at.cmplt(size - DOUBT).all()
    }

    /// Returns whether a segment inside the building certainly meets no wall between rooms.
    fn is_free(&self, from: DVec3, to: DVec3) -> bool {
        let (a, b) = (from - self.base, to - self.base);
        (1..ROOMS).all(|number| {
            let wall = ROOM.x * number as f64;
            if (a.x < wall - DOUBT && b.x < wall - DOUBT) || (a.x > wall + DOUBT && b.x > wall + DOUBT) {
                return true;
            }
            if (a.x - wall).abs() <= DOUBT || (b.x - wall).abs() <= DOUBT {
                return false;
            }
            let at = a + (b - a) * ((wall - a.x) / (b.x - a.x));
            let [low, high] = Self::door(number);
            at.y > low + DOUBT && at.y < high - DOUBT && at.z > DOUBT && at.z < 2.0 - DOUBT
        })
    }
}

/// Portal eye whose cells are synced by the test.
struct Synced {
    cells: SceneCells,
    eye: PortalEye,
}

impl Culler for Synced {
    fn name(&self) -> &str {
        "portal eye"
    }

    fn accuracy(&self) -> Accuracy {
        Accuracy::Conservative
    }

    fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats {
        self.eye.cull(&self.cells, scene, view, visible)
    }
}

/// Makes the visible sets of the cells for the present state of a scene.
fn sets(rooms: &Rooms, scene: &Scene) -> Arc<ScenePvs> {
    let cells = rooms.cells();
    let outcome = Bake::new(CellBaker::new(cells.graph(), BakerSettings::default()).unwrap()).run();
    let pvs = outcome.matrix.to_pvs(cells.graph()).unwrap();
    let mut pairs = Vec::new();
    for (id, [min, max]) in world_boxes(scene) {
        cells.viewcells().for_each_touching(min - 1e-3, max + 1e-3, |cell| pairs.push((id, cell.0)));
    }
    Arc::new(ScenePvs::new(scene, pvs, cells.viewcells().clone(), pairs))
}

#[test]
fn cells_and_sets_hide_nothing_seen_wherever_the_origin_moves() {
    let mut counts = [[0; 2]; 3];
    for seed in 0..8 {
        let mut rng = Random(seed);
        let rooms = Rooms { base: rng.vector(1.0) * rng.pick(&[1.0, 1e3, 1e6]) };
        let mut scene = Scene::new();
        let homes: Vec<(ObjectId, DVec3, DVec3)> = (0..60)
            .map(|_| {
                let size = ROOM * DVec3::new(ROOMS as f64, 1.0, 1.0);
                let home = rooms.base + size * (rng.vector(0.48) + 0.5);
                (scene.insert(Aabb::EMPTY), home, rng.vector(0.15).abs() + 0.05)
            })
            .collect();
        let go_home = |scene: &mut Scene| {
            for &(id, home, half) in &homes {
                scene.set_bounds(id, Aabb::from_world(home - half, home + half, scene.origin())).unwrap();
            }
        };
        scene.set_origin(rooms.base).unwrap();
        go_home(&mut scene);
        let mut own = PortalCuller::new(rooms.cells());
        let mut eye = Synced { cells: rooms.cells(), eye: PortalEye::new() };
        eye.cells.sync(&scene);
        let mut by_sets = PvsCuller::new(sets(&rooms, &scene));
        for frame in 0..80 {
            if rng.one_in(3) {
                move_origin(&mut scene, &mut rng);
            }
            if rng.one_in(2) {
                go_home(&mut scene);
            }
            if rng.one_in(2) {
                eye.cells.sync(&scene);
                *by_sets.shared_mut() = sets(&rooms, &scene);
            }
            if rng.one_in(6) {
                move_origin(&mut scene, &mut rng);
            }
            let from = rooms.base + ROOM * DVec3::new(ROOMS as f64, 1.0, 1.0) * (rng.vector(0.45) + 0.5);
            let camera = Camera::new(from, rng.vector(1.0) * DVec3::new(1.0, 0.4, 0.2));
            let boxes = world_boxes(&scene);
            let seen = boxes.iter().filter(|(_, [min, max])| {
                (0..4).any(|_| {
                    let point = *min + (*max - *min) * (rng.vector(0.5) + 0.5);
                    let is_clear = rooms.is_inside(point) && rooms.is_free(from, point);
                    is_clear && rooms.is_inside(from) && camera.shows(point)
                })
            });
            let seen: Vec<ObjectId> = seen.map(|&(id, _)| id).collect();
            let cullers: [&mut dyn Culler; 3] = [&mut own, &mut eye, &mut by_sets];
            for (culler, [all, hidden]) in cullers.into_iter().zip(&mut counts) {
                let mut visible = VisibleSet::new();
                visible.fill(&scene, &camera.view);
                culler.cull(&scene, &camera.view, &mut visible);
                for &id in &seen {
                    let is_shown = visible.contains(&scene, id);
                    assert!(is_shown, "{}, seed {seed}, frame {frame}: object {id}", culler.name());
                }
                *all += seen.len();
                *hidden += scene.len() - visible.count(&scene);
            }
        }
    }
    println!("{counts:?}");
    assert!(counts.iter().all(|[all, hidden]| *all > 1000 && *hidden > 1000), "{counts:?}");
}
