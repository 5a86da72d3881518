//! Viewcells in free space: cameras that walk at random through houses never leave them, and closed rooms
//! have none. The oracle measures distances to boxes and does not use voxels.

use std::collections::HashSet;
use visibility_bake::{CameraRange, Grid, GridError};
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::pvs::{Viewcell, Viewcells};
use visibility_core::scene::{DrawRange, Triangle};
use visibility_core::{Aabb, Object, ObjectId, Scene};
use visibility_testing::Random;

/// Returns the triangles of a box.
fn sides(min: DVec3, max: DVec3) -> Vec<Triangle> {
    let corners = Aabb::from_arrays(min.as_vec3().to_array(), max.as_vec3().to_array()).corners();
    let mut triangles = Vec::new();
    for axis in 0..3 {
        for plane in [min.as_vec3()[axis], max.as_vec3()[axis]] {
            let side: Vec<Vec3> = corners.iter().copied().filter(|corner| corner[axis] == plane).collect();
            triangles.push([side[0], side[1], side[2]]);
            triangles.push([side[1], side[2], side[3]]);
        }
    }
    triangles
}

/// A world of solid boxes on a floor. `up` is the axis that points up.
struct World {
    boxes: Vec<(DVec3, DVec3)>,
    up: usize,
}

impl World {
    fn scene(&self) -> Scene {
        let mut scene = Scene::new();
        for &(min, max) in &self.boxes {
            let bounds = Aabb::from_arrays(min.as_vec3().to_array(), max.as_vec3().to_array());
            let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
            scene.set_triangles(id, sides(min, max)).unwrap();
        }
        scene
    }

    /// Returns the distance in metres from a point to the nearest box, 0 inside a box.
    fn distance(&self, p: DVec3) -> f64 {
        let of = |&(min, max): &(DVec3, DVec3)| (p - p.clamp(min, max)).length();
        self.boxes.iter().map(of).fold(f64::INFINITY, f64::min)
    }

    /// Returns whether a point is at a height from `low` to `high` above a box's top.
    fn stands(&self, p: DVec3, [low, high]: [f64; 2]) -> bool {
        self.boxes.iter().any(|&(min, max)| {
            let height = p[self.up] - max[self.up];
            let is_over =
                (0..3).all(|axis| axis == self.up || (min[axis] <= p[axis] && p[axis] <= max[axis]));
            is_over && low <= height && height <= high
        })
    }
}

/// Makes a house of 16 x 16 m with walls. The walls have doors 0.7 m wide, apart from those of one room.
fn house(random: &mut Random, up: usize) -> World {
    let axes = [(up + 1) % 3, (up + 2) % 3];
    let point = |x: f64, y: f64, z: f64| {
        let mut point = DVec3::ZERO;
        (point[axes[0]], point[axes[1]], point[up]) = (x, y, z);
        point
    };
    let mut boxes = vec![(point(0.0, 0.0, -0.3), point(16.0, 16.0, 0.0))];
    boxes.push((point(0.0, 0.0, 2.8), point(16.0, 16.0, 3.0)));
    let mut wall =
        |from: [f64; 2], to: [f64; 2]| boxes.push((point(from[0], from[1], -0.1), point(to[0], to[1], 2.9)));
    let thick = 0.1;
    for i in 0..=4 {
        let at = f64::from(i) * 3.975;
        for j in 0..4 {
            let (start, end) = (f64::from(j) * 3.975, f64::from(j + 1) * 3.975 + thick);
            // The room in the corner has no door.
            let has_door = |i: u32, j: u32| (1..4).contains(&i) && !(i == 1 && j == 0);
            let door = start + 0.5 + random.unit() * 2.0;
            let pieces =
                if has_door(i, j) { vec![[start, door], [door + 0.7, end]] } else { vec![[start, end]] };
            for [a, b] in pieces {
                wall([at, a], [at + thick, b]);
                wall([a, at], [b, at + thick]);
            }
        }
    }
    for _ in 0..6 {
        let [x, y] = [(); 2].map(|()| 1.0 + 13.0 * random.unit());
        boxes.push((point(x, y, 0.0), point(x + 0.5, y + 0.8, random.unit() * 1.5)));
    }
    // Coordinates are rounded to `f32`, as the bounds of objects are.
    let boxes = boxes.into_iter().map(|(a, b)| (a.as_vec3().as_dvec3(), b.as_vec3().as_dvec3())).collect();
    World { boxes, up }
}

#[test]
fn no_camera_leaves_the_viewcells_and_closed_rooms_have_none() {
    let mut random = Random(17);
    let mut rooms = HashSet::new();
    for (round, up) in [2, 1, 0, 2].into_iter().enumerate() {
        let world = house(&mut random, up);
        let scene = world.scene();
        let camera = CameraRange { radius: 0.25, heights: Some([1.0, 2.0]), up: DVec3::AXES[up] };
        let mut size = DVec3::splat(1.1);
        size[up] = 0.9;
        let grid = Grid::new(DVec3::splat(-0.37), size).unwrap();
        let axes = [(up + 1) % 3, (up + 2) % 3];
        let mut start = DVec3::ZERO;
        (start[axes[0]], start[axes[1]], start[up]) = (7.0, 6.2, 1.6);
        while world.distance(start) < 0.26 || !world.stands(start, [1.0, 2.0]) {
            start[axes[0]] += 0.05;
        }
        let [low, high] = [DVec3::splat(-1.0), DVec3::splat(17.0)];
        let found = grid.free(&scene, &[start], &camera, low, high).unwrap();
        let all = grid.over(low, high).unwrap();
        assert!(found.len() * 4 < all.len(), "{} of {}", found.len(), all.len());
        // The closed room extends from 0.1 to 3.9 m on both axes.
        let is_closed =
            |cell: &&Viewcell| axes.iter().all(|&axis| cell.min[axis] > 0.2 && cell.max[axis] < 3.8);
        assert_eq!(found.iter().find(is_closed), None, "a room without a door");
        // Viewcells below the floor or above the ceiling.
        let is_outside = |cell: &&Viewcell| cell.max[up] < 0.9 || cell.min[up] > 2.8;
        assert_eq!(found.iter().find(is_outside), None, "at a wrong height");

        let cells = Viewcells::new(found);
        let (mut at, mut heading) = (start, DVec3::X);
        for _ in 0..60_000 {
            if random.one_in(12) {
                heading = DVec3::from_array([(); 3].map(|()| random.unit() - 0.5)).normalize();
            }
            // The whole step keeps the distance, since no point of it is more than 3 cm from one of its ends.
            let next = at + heading * 0.06;
            let is_clear = |p: DVec3| world.distance(p) > 0.28 && world.stands(p, [1.0, 2.0]);
            if is_clear(next) && is_clear((at + next) * 0.5) {
                at = next;
                assert!(cells.locate(at).is_some(), "round {round}: {at} is in no viewcell");
                rooms.insert((round, [0, 1].map(|side| (at[axes[side]] / 3.975) as u32)));
            } else {
                heading = DVec3::from_array([(); 3].map(|()| random.unit() - 0.5)).normalize();
            }
        }
    }
    assert!(rooms.len() > 30, "the cameras have passed doors: {} rooms", rooms.len());
}

#[test]
fn a_camera_that_flies_goes_over_walls_and_not_through_them() {
    let wall = (DVec3::new(5.0, 0.0, 0.0), DVec3::new(5.2, 10.0, 4.0));
    let world = World { boxes: vec![wall], up: 2 };
    let grid = Grid::new(DVec3::ZERO, DVec3::ONE).unwrap();
    let flying = CameraRange { heights: None, ..CameraRange::default() };
    let free = |height: f64| {
        let max = DVec3::new(9.99, 9.99, height);
        grid.free(&world.scene(), &[DVec3::splat(1.5)], &flying, DVec3::ZERO, max).unwrap().len()
    };
    assert_eq!(free(3.9), 5 * 10 * 4, "the wall closes the box");
    assert_eq!(free(4.9), 10 * 10 * 5, "a way over the wall");
    let standing = CameraRange::default();
    let max = DVec3::splat(9.99);
    let none = grid.free(&world.scene(), &[DVec3::splat(1.5)], &standing, DVec3::ZERO, max).unwrap();
    assert_eq!(none, [], "there is no floor");
    let begun = |from: &[DVec3]| grid.free(&world.scene(), from, &flying, DVec3::ZERO, max).unwrap().len();
    assert_eq!(begun(&[DVec3::splat(f64::NAN), DVec3::splat(-1.0)]), 0, "begun outside");
    assert_eq!(begun(&[DVec3::new(5.1, 5.0, 1.0)]), 1000, "begun in the wall");
}

#[test]
fn what_is_near_a_walk_stays_in_its_viewcells_also_in_walls() {
    let mut random = Random(41);
    let mut cut_off = 0.0;
    for up in [2, 1, 2] {
        let scene = house(&mut random, up).scene();
        let camera = CameraRange { radius: 0.2, up: DVec3::AXES[up], ..CameraRange::default() };
        let grid = Grid::new(DVec3::splat(-0.37), DVec3::new(2.2, 1.7, 1.9)).unwrap();
        let mut point = || DVec3::from_array([(); 3].map(|()| 16.0 * random.unit()));
        let walks = [vec![point(), point(), point()], vec![point()], vec![], vec![point(), point()]];
        let found = grid.along_free(&scene, walks.iter().map(Vec::as_slice), &camera).unwrap();
        let whole: Vec<Viewcell> = walks.iter().flat_map(|walk| grid.along(walk).unwrap()).collect();
        for cell in &found {
            let is_in = |a: &&Viewcell| a.min.cmple(cell.min).all() && cell.max.cmple(a.max).all();
            let whole = whole.iter().find(is_in).expect("a part of a box that a walk passes");
            cut_off += (whole.max - whole.min).element_product() - (cell.max - cell.min).element_product();
        }
        let cells = Viewcells::new(found);
        for walk in &walks {
            for (number, &to) in walk.iter().enumerate() {
                let from = walk[number.saturating_sub(1)];
                for step in 0..=2000 {
                    let at = from.lerp(to, f64::from(step) / 2000.0);
                    let whole = &grid.along(&[at]).unwrap()[0];
                    let around = DVec3::from_array([(); 3].map(|()| 0.39 * (random.unit() - 0.5)));
                    let near = (at + around).clamp(whole.min, whole.max);
                    for eye in [at, near] {
                        // The walk may touch a box within rounding.
                        let mut is_in = false;
                        cells.for_each_touching(eye - 1e-9, eye + 1e-9, |_| is_in = true);
                        assert!(is_in, "{eye} near {at} is in no viewcell");
                    }
                }
            }
        }
    }
    assert!(cut_off > 10.0, "{cut_off} cubic metres are cut off");
    // Single viewpoints inside a wall.
    let world = house(&mut random, 2);
    let (scene, grid) = (world.scene(), Grid::new(DVec3::ZERO, DVec3::splat(1.9)).unwrap());
    for _ in 0..40 {
        let eye = DVec3::new(7.95 + 0.1 * random.unit(), 1.0 + 14.0 * random.unit(), 1.0 + random.unit());
        let found = grid.along_free(&scene, [&[eye][..]], &CameraRange::default()).unwrap();
        let whole = &grid.along(&[eye]).unwrap()[0];
        let corners = [-0.25, 0.25].map(|radius| (eye + radius).clamp(whole.min, whole.max));
        assert!(found.iter().any(|cell| corners.iter().all(|&corner| cell.contains(corner))), "{eye}");
    }
}

#[test]
fn viewcells_along_a_walk_end_at_walls_and_floors() {
    // A room of 3 x 2.5 m, 2.4 m high, with a plate in mid-air, within a box of 4 m.
    let wall = |min: [f64; 3], max: [f64; 3]| (DVec3::from(min), DVec3::from(max));
    let room = vec![
        wall([-1.0, -1.0, 0.5], [5.0, 5.0, 0.75]),
        wall([-1.0, -1.0, 3.125], [5.0, 5.0, 3.5]),
        wall([-1.0, 3.0, 0.0], [9.0, 3.25, 4.0]),
        wall([2.5, -1.0, 0.0], [2.625, 5.0, 4.0]),
        wall([1.0, 1.0, 1.25], [1.5, 2.0, 1.5]),
    ];
    let world = World { boxes: room, up: 2 };
    let grid = Grid::new(DVec3::ZERO, DVec3::splat(4.0)).unwrap();
    let along = |walk: &[DVec3]| grid.along_free(&world.scene(), [walk], &CameraRange::default()).unwrap();
    let eye = DVec3::new(0.7, 0.8, 2.0);
    let is_close = |a: DVec3, b: [f64; 3]| (a - DVec3::from(b)).abs().max_element() < 0.01;
    let [cell] = &along(&[eye])[..] else { panic!("one viewcell") };
    assert!(
        cell.min.truncate() == DVec3::ZERO.truncate() && is_close(cell.min, [0.0, 0.0, 0.75]),
        "{cell:?}"
    );
    assert!(is_close(cell.max, [2.5, 3.0, 3.125]), "{cell:?}");
    // Walks on either side of the wall and through it. Both sides are in the same box of the grid.
    let far = eye.with_x(3.5);
    assert_eq!(
        along(&[eye, eye + DVec3::Y * 1.5])[..],
        *std::slice::from_ref(cell),
        "viewcells along a walk on one side of the wall"
    );
    assert_eq!(along(&[far]).len(), 1, "viewcells on the other side");
    let both: Vec<Viewcell> = [eye, far]
        .iter()
        .flat_map(|eye| grid.along_free(&world.scene(), [std::slice::from_ref(eye)], &CameraRange::default()))
        .flatten()
        .collect();
    let together = grid.along_free(&world.scene(), [&[eye][..], &[far]], &CameraRange::default()).unwrap();
    assert_eq!(together, both, "viewcells of two walks, together and each by itself");
    let [through] = &along(&[eye, far])[..] else { panic!("one viewcell") };
    assert!((through.min.x, through.max.x) == (0.0, 4.0) && through.max.y < 3.0, "{through:?}");
    assert_eq!(along(&[]), [], "viewcells along no walk");
}

#[test]
fn extremes_are_errors_or_answers() {
    let world = World { boxes: vec![(DVec3::ZERO, DVec3::splat(1e6))], up: 2 };
    let mut scene = world.scene();
    let id = scene.insert(Object { occluder: true, ..Object::new(Aabb::from_arrays([0.0; 3], [1.0; 3])) });
    scene.set_triangles(id, [[Vec3::NAN, Vec3::ONE, Vec3::ZERO], [Vec3::ZERO; 3]]).unwrap();
    let grid = Grid::new(DVec3::ZERO, DVec3::ONE).unwrap();
    let free = |radius: f64, reach: f64| {
        let camera = CameraRange { radius, ..CameraRange::default() };
        grid.free(&scene, &[DVec3::splat(0.5)], &camera, DVec3::ZERO, DVec3::splat(reach))
    };
    for radius in [0.0, -1.0, f64::NAN, 1e-3, f64::MIN_POSITIVE] {
        assert_eq!(free(radius, 5.0), Err(GridError::Radius), "a radius of {radius} m");
    }
    for reach in [f64::NAN, f64::INFINITY, 1e300] {
        assert_eq!(free(0.3, reach), Err(GridError::TooMany), "a box up to {reach}");
    }
    assert_eq!(free(0.3, -1.0), Ok(Vec::new()), "an inverted box");
    assert!(free(f64::INFINITY, 5.0).is_ok() && free(1e300, 5.0).is_ok(), "radii that leave nothing free");
    for radius in [f64::NAN, -1.0, 0.0, 1e300] {
        let camera = CameraRange { radius, ..CameraRange::default() };
        let along = |eye: DVec3| grid.along_free(&scene, [&[eye][..]], &camera).map(|cells| cells.len());
        assert_eq!(along(DVec3::splat(0.5)), Ok(1), "radius {radius}: viewcells around an eye");
        for far in [f64::NAN, f64::INFINITY, 1e300] {
            assert_eq!(along(DVec3::splat(far)), Err(GridError::TooMany), "radius {radius}: a walk to {far}");
        }
    }
    let camera = CameraRange { heights: Some([f64::NAN, f64::INFINITY]), ..CameraRange::default() };
    assert!(
        grid.free(&scene, &[DVec3::splat(0.5)], &camera, DVec3::ZERO, DVec3::splat(5.0)).is_ok(),
        "heights from NaN to infinity"
    );
    let huge = [DVec3::ZERO, DVec3::X * 1e9, DVec3::Y * 1e9];
    assert_eq!(grid.above(&[huge], &CameraRange::default()), Err(GridError::TooMany), "a ground of 1e9 m");
    assert!(
        grid.above(&[[DVec3::ZERO, DVec3::X, DVec3::Y]], &camera).is_err(),
        "a ground with heights from NaN to infinity"
    );
    assert_eq!(grid.above(&[[DVec3::NAN; 3]], &CameraRange::default()), Ok(Vec::new()), "a ground at NaN");
}

/// A scene in memory and a level in a file have the same free space: both count occluders as levels do.
#[test]
fn walls_that_are_never_culled_or_not_always_drawn_are_not_solid() {
    let world = World {
        boxes: vec![
            (DVec3::new(0.0, 0.0, -0.5), DVec3::new(12.0, 2.0, 0.0)),
            (DVec3::new(7.0, 0.0, 0.0), DVec3::new(7.5, 2.0, 4.0)),
        ],
        up: 2,
    };
    let grid = Grid::new(DVec3::ZERO, DVec3::splat(2.0)).unwrap();
    let count = |scene: &Scene| {
        let (eye, max) = (DVec3::new(1.0, 1.0, 1.7), DVec3::new(12.0, 2.0, 4.0));
        grid.free(scene, &[eye], &CameraRange::default(), DVec3::ZERO, max).unwrap().len()
    };
    assert_eq!(count(&world.scene()), 8, "up to the wall");
    let changes: [fn(&mut Scene, ObjectId); 2] = [
        |scene, wall| scene.set_never_cull(wall, true).unwrap(),
        |scene, wall| scene.set_draw_range(wall, DrawRange { end: 50.0, ..DrawRange::ALWAYS }).unwrap(),
    ];
    for change in changes {
        let mut scene = world.scene();
        let wall = scene.id_at(1).unwrap();
        change(&mut scene, wall);
        assert_eq!(count(&scene), 12, "beyond the wall as well");
    }
}

#[test]
fn viewcells_above_triangles_hold_the_camera_and_little_else() {
    let mut random = Random(3);
    for up in [DVec3::Z, -DVec3::Y, DVec3::X] {
        let grid = Grid::new(DVec3::splat(0.21), DVec3::new(1.0, 0.7, 0.9)).unwrap();
        let mut point = || DVec3::from_array([(); 3].map(|()| (random.unit() - 0.5) * 8.0));
        let triangles: Vec<[DVec3; 3]> = (0..8).map(|_| [point(), point(), point()]).collect();
        let camera = CameraRange { heights: Some([0.6, 2.3]), up, ..CameraRange::default() };
        let found = grid.above(&triangles, &camera).unwrap();
        let cells = Viewcells::new(found.iter().cloned());
        let mut used = HashSet::new();
        for _ in 0..200_000 {
            let [a, b, c] = triangles[random.below(8)];
            let (s, t) = (random.unit(), random.unit());
            let (s, t) = if s + t > 1.0 { (1.0 - s, 1.0 - t) } else { (s, t) };
            let eye = a + (b - a) * s + (c - a) * t + up * (0.6 + 1.7 * random.unit());
            used.insert(cells.locate(eye).unwrap_or_else(|| panic!("{eye} is in no viewcell")));
        }
        // Viewcells of which the camera can reach only a corner are seldom hit by random positions.
        assert!(used.len() * 100 > found.len() * 93, "{} of {} are used", used.len(), found.len());
    }
}
