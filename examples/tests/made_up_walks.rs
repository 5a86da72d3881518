//! Tests of walks made up for scenes without cameras: they lead where a person can stand, and through doors.

use visibility_core::glam::{DVec3, Vec3};
use visibility_examples::{CameraKey, Cameras, Reading, SceneSource, SourceObject, Walk};

/// Returns the triangles of a box, with its faces outwards.
fn cuboid(low: [f32; 3], high: [f32; 3]) -> Vec<[Vec3; 3]> {
    let corner =
        |i: usize| Vec3::from_array([0, 1, 2].map(|axis| if i >> axis & 1 == 0 { low } else { high }[axis]));
    let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    sides.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]].map(|t| t.map(corner))).collect()
}

fn scene(objects: Vec<(&str, Vec<[Vec3; 3]>)>) -> SceneSource {
    let objects = objects.into_iter().map(|(name, triangles)| SourceObject::new(name, triangles)).collect();
    SceneSource { objects, ..SceneSource::new("test", Vec3::Z, 1.0) }
}

/// Makes a house of two rooms of 5 by 5 m, with a flat roof and walls of 30 cm. A doorway of 1 m joins the
/// rooms, with a door leaf of the given name. The outer wall has a window from 1 m up without glass, and a
/// terrace is outside of it.
fn house(leaf: &str) -> SceneSource {
    scene(vec![
        ("floor", cuboid([-5.3, -0.3, -0.3], [5.3, 5.3, 0.0])),
        ("roof", cuboid([-5.3, -0.3, 2.5], [5.3, 5.3, 2.8])),
        ("south", cuboid([-5.3, -0.3, 0.0], [5.3, 0.0, 2.5])),
        ("north", cuboid([-5.3, 5.0, 0.0], [5.3, 5.3, 2.5])),
        ("west", cuboid([-5.3, 0.0, 0.0], [-5.0, 5.0, 2.5])),
        ("east below", cuboid([5.0, 0.0, 0.0], [5.3, 5.0, 1.0])),
        ("middle south", cuboid([-0.15, 0.0, 0.0], [0.15, 2.0, 2.5])),
        ("middle north", cuboid([-0.15, 3.0, 0.0], [0.15, 5.0, 2.5])),
        ("lintel", cuboid([-0.15, 2.0, 2.1], [0.15, 3.0, 2.5])),
        ("terrace", cuboid([5.3, -0.3, -0.3], [9.0, 5.3, 0.0])),
        (leaf, cuboid([-0.03, 2.0, 0.0], [0.03, 3.0, 2.1])),
    ])
}

/// Returns whether the segment between two points crosses a triangle, by the signs of tetrahedra volumes.
fn crosses(from: DVec3, to: DVec3, triangle: [DVec3; 3]) -> bool {
    let volume = |a: DVec3, b: DVec3, c: DVec3, d: DVec3| (b - a).cross(c - a).dot(d - a);
    let [a, b, c] = triangle;
    let sides = [(a, b), (b, c), (c, a)].map(|(p, q)| volume(from, to, p, q));
    let is_within = sides.iter().all(|&x| x > 0.0) || sides.iter().all(|&x| x < 0.0);
    is_within && volume(a, b, c, from) * volume(a, b, c, to) < 0.0
}

fn made(scene: SceneSource) -> (SceneSource, Vec<String>) {
    let mut scene = scene.with_walks();
    let names = scene.walks.iter().map(|walk| walk.name.clone()).collect();
    scene.objects.retain(|object| !object.name.to_string().contains("oor "));
    (scene, names)
}

fn eyes(walk: &Walk) -> Vec<DVec3> {
    walk.keys.iter().map(|key| key.eye).collect()
}

#[test]
fn a_walk_leads_through_a_door_and_no_wall() {
    let (house, names) = made(house("IfcDoor a"));
    assert_eq!(names, ["indoors"], "names of walks");
    assert_eq!(house.notes, ["walks are made up: 1 indoors"], "the note on walks");
    assert!(house.near <= 0.05, "the near plane is at {} m", house.near);
    let eyes = eyes(&house.walks[0]);
    assert!(eyes.iter().any(|eye| eye.x < -2.0) && eyes.iter().any(|eye| eye.x > 2.0), "{eyes:?}");
    assert!(eyes.iter().all(|eye| (eye.z - 1.6).abs() < 1e-3 && eye.x < 5.0), "{eyes:?}");
    for pair in eyes.windows(2) {
        for object in house.objects.iter().filter(|object| !object.name.to_string().contains("Door")) {
            let is_crossed =
                object.triangles.iter().any(|t| crosses(pair[0], pair[1], t.map(Vec3::as_dvec3)));
            assert!(!is_crossed, "from {} to {} through {}", pair[0], pair[1], object.name);
        }
        assert!(pair[0].distance(pair[1]) <= 2.5 + 1e-9, "{} and {} are too far apart", pair[0], pair[1]);
    }
    // Eyes also keep a distance from walls.
    let walls = [-5.0, 5.0];
    assert!(
        eyes.iter().all(|eye| walls.iter().all(|wall| (eye.x - wall).abs() >= 0.25)),
        "an eye is too near to a wall: {eyes:?}"
    );
}

#[test]
fn what_is_no_door_closes_a_room() {
    for name in ["plank", "door mat"] {
        let mut closed = house(name);
        if name == "door mat" {
            // A shape that is not a door's.
            closed.objects[10].triangles = cuboid([-0.5, 1.9, 0.0], [0.5, 3.1, 2.1]).into();
        }
        let (closed, names) = made(closed);
        assert_eq!(names, ["indoors", "indoors"], "{name}");
        for walk in &closed.walks {
            let sides: Vec<bool> = eyes(walk).iter().map(|eye| eye.x > 0.0).collect();
            assert!(sides.iter().all(|&side| side == sides[0]), "{name}: {sides:?}");
        }
    }
    // A leaf that moves is ignored, so the doorway is open.
    let mut moving = house("plank");
    moving.objects[10].motion = Some(Box::new((Vec3::ZERO, Vec3::ONE)));
    assert_eq!(made(moving).1, ["indoors"], "a wall that moves closes no room");
}

#[test]
fn a_house_with_an_open_door_is_walked_inside_and_outside() {
    let mut house = house("Door");
    house.objects.push(SourceObject::new("ground", cuboid([-40.0, -40.0, -0.5], [40.0, 40.0, -0.1])));
    // The exit is a gap of 1.2 m in the east wall, under eaves all around the house.
    house.objects[1].triangles = cuboid([-6.2, -1.2, 2.5], [6.2, 6.2, 2.8]).into();
    house.objects[5].triangles = cuboid([5.0, 1.2, 0.0], [5.3, 5.0, 2.5]).into();
    let (walked, names) = made(house.clone());
    assert_eq!(names, ["indoors", "outdoors"], "names of walks");
    let is_inside = |eye: &DVec3| eye.x.abs() < 5.0 && (0.0..5.0).contains(&eye.y);
    assert!(eyes(&walked.walks[0]).iter().all(is_inside), "{:?}", eyes(&walked.walks[0]));
    // A roof on only two walls makes no room.
    house.objects.drain(2..6);
    assert_eq!(made(house).1, ["outdoors"], "names of walks of a house without outer walls");
}

/// Closed blocks of 10 by 10 by 8 m, 6 m apart, on the ground.
fn town() -> Vec<(&'static str, Vec<[Vec3; 3]>)> {
    let at = |i: i32| (i as f32) * 16.0;
    let blocks = (0..9).map(|i| {
        let [x, y] = [at(i % 3), at(i / 3)];
        ("block", cuboid([x, y, 100.0], [x + 10.0, y + 10.0, 108.0]))
    });
    blocks.collect()
}

#[test]
fn streets_are_walked_and_roofs_are_not() {
    // The same scene with level ground, to compare with a file without ground.
    let with_ground = || {
        let mut all = town();
        all.push(("ground", cuboid([-20.0, -20.0, 99.0], [60.0, 60.0, 100.0])));
        all
    };
    for objects in [town(), with_ground()] {
        // Blocks are solid, so no walk leads inside.
        let mut town = scene(objects);
        town.objects.iter_mut().for_each(|object| object.one_sided = true);
        let (town, names) = made(town);
        assert_eq!(names, ["outdoors"], "names of walks");
        let eyes = eyes(&town.walks[0]);
        assert!(eyes.iter().all(|eye| (eye.z - 101.6).abs() < 1e-3), "{eyes:?}");
        assert!(
            eyes.len() > 10 && !town.floors.is_empty(),
            "{} eyes, {} floors",
            eyes.len(),
            town.floors.len()
        );
        for (floor, free) in &town.floors {
            assert!(
                (floor.z - 100.0).abs() < 1e-3 && *free >= 1.7,
                "the floor {floor} has {free} m above it"
            );
            let is_in_block =
                |x: f64| (0..3).any(|i| (f64::from(i) * 16.0..f64::from(i) * 16.0 + 10.0).contains(&x));
            assert!(!(is_in_block(floor.x) && is_in_block(floor.y)), "{floor}");
        }
    }
}

#[test]
fn a_thing_without_inside_is_looked_at_from_around() {
    let (statue, names) = made(scene(vec![("statue", cuboid([10.0; 3], [12.0, 12.0, 15.0]))]));
    assert_eq!(
        (names, &statue.notes[0][..]),
        (vec!["around".to_owned()], "walks are made up: 1 around"),
        "names of walks, and the note"
    );
    assert!(statue.floors.is_empty(), "a statue has no floors");
    for CameraKey { eye, target } in &statue.walks[0].keys {
        assert!(
            eye.distance(*target) > 2.0 && target.distance(DVec3::new(11.0, 11.0, 12.5)) < 1e-3,
            "the eye {eye} looks at {target}"
        );
    }
    let point = made(scene(vec![("point", vec![[Vec3::ONE; 3]])])).0;
    assert!(
        point.walks[0].keys.iter().all(|key| key.eye.distance(key.target) > 1e-5),
        "eyes keep away from a point"
    );
    assert!(made(scene(Vec::new())).0.walks.is_empty(), "an empty scene has no walks");
}

#[test]
fn walks_are_the_same_every_time_and_turn_and_move_with_the_scene() {
    let plain = house("Door").with_walks();
    assert!(plain == house("Door").with_walks(), "walks are the same every time");
    let mut turned = house("Door");
    turned.up = Vec3::Y;
    turned.origin = DVec3::new(1e7, 2e7, 3e7);
    let turn = |p: Vec3| Vec3::new(p.y, p.z, p.x);
    for object in &mut turned.objects {
        object
            .edit_triangles(|triangles| triangles.as_flattened_mut().iter_mut().for_each(|p| *p = turn(*p)));
    }
    let turned = turned.with_walks();
    for (a, b) in plain.walks.iter().zip(&turned.walks) {
        assert_eq!(a.keys.len(), b.keys.len(), "keys of a walk and of the turned one");
        for (a, b) in a.keys.iter().zip(&b.keys) {
            let expected = DVec3::new(a.eye.y, a.eye.z, a.eye.x) + turned.origin;
            assert!(b.eye.distance(expected) < 1e-6, "{} {}", a.eye, b.eye);
        }
    }
}

#[test]
fn walks_that_are_saved_are_those_that_are_read() {
    let folder = crate::bake_program::folder("saved_cameras");
    let file = Some(folder.join("walks.json"));
    let reading = Reading { unit: Some(0.001), ..Reading::default() };
    let mut first = house("Door");
    let save = Cameras { cameras: None, save_cameras: file.clone() };
    save.give_whole(&mut first, &reading).unwrap();
    let mut second = house("Door");
    Cameras { cameras: file, save_cameras: None }.give_whole(&mut second, &reading).unwrap();
    assert_eq!(first.walks.len(), second.walks.len(), "walks saved and read");
    for (a, b) in first.walks.iter().zip(&second.walks) {
        assert_eq!(
            (&a.name, a.fov_y_degrees, a.up),
            (&b.name, b.fov_y_degrees, b.up),
            "name, angle and axis up of a walk"
        );
        for (a, b) in a.keys.iter().zip(&b.keys) {
            assert!(
                a.eye.distance(b.eye) < 1e-9 && a.target.distance(b.target) < 1e-9,
                "eyes and targets of a walk are the saved ones"
            );
        }
    }
    assert!(
        (first.near - second.near).abs() < 1e-6 && second.notes.is_empty(),
        "the near plane is saved, and there are no notes"
    );
    // Cameras that the scene has are kept.
    let walks = second.walks.clone();
    Cameras::default().give_whole(&mut second, &reading).unwrap();
    assert!(second.walks == walks && second.notes.is_empty(), "cameras of the scene stay");
}

#[test]
fn nothing_to_walk_around_is_said() {
    let scene = SceneSource::new("none", Vec3::Z, 0.1).with_walks();
    assert_eq!(
        (scene.walks.len(), &scene.notes[..]),
        (0, &["there is nothing to walk around: the scene has no triangle".to_owned()][..]),
        "walks of an empty scene, and the note"
    );
}
