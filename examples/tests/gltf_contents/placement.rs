//! Tests of a glTF file's placement in the world: far from the origin, in other units, with another up axis.

use super::{CORNERS, File, door, rectangle, reported};
use glam::{DVec3, Vec3};
use serde_json::json;
use std::path::Path;
use visibility_examples::gltf_file::parse_as;
use visibility_examples::walkthrough::World;
use visibility_examples::{Hint, Reading, SceneSource};

/// Returns a file with a board and a box behind the board's edge. Both are below a root node at `x`.
fn edge(x: f64) -> File {
    let mut file = File::new();
    let board = file.mesh(&rectangle([-30.0, 0.13], [-3.0, 3.0], 0.0));
    let behind = file.mesh(&rectangle([-9.25, -8.25], [-0.5, 0.5], -40.0));
    file.node(json!({"translation": [x, 0, 0], "children": [1, 2]}));
    file.push("nodes", json!({"mesh": board}));
    file.push("nodes", json!({"mesh": behind}));
    file
}

#[test]
fn far_from_the_origin_coordinates_are_relative_to_a_point_near_the_content() {
    let (here, far) = (edge(0.0).scene(), edge(3_900_000.0).scene());
    assert_eq!(here.origin, DVec3::ZERO, "the origin of a scene near 0");
    assert_eq!(here.notes, Vec::<String>::new(), "notes of a scene near 0");
    assert!(
        far.origin.distance(DVec3::new(3_900_000.0, 0.0, 0.0)) < 40.0 && far.origin == far.origin.round(),
        "the origin {} is whole, and near the content",
        far.origin
    );
    assert!(far.notes[0].contains("relative to [38999"), "{:?}", far.notes);
    for (a, b) in here.objects.iter().zip(&far.objects) {
        for (a, b) in a.triangles.iter().flatten().zip(b.triangles.iter().flatten()) {
            let b = b.as_dvec3() + far.origin - DVec3::new(3_900_000.0, 0.0, 0.0);
            assert!(a.as_dvec3().distance(b) < 1e-5, "{a} {b}");
        }
    }
    let [eye, target] = [DVec3::new(0.75, 0.0, 2.0), DVec3::new(-9.0, 0.0, -40.0)];
    assert_eq!(reported(here, "hzb", eye, target), [0, 1], "objects seen near 0");
    let there = DVec3::new(3_900_000.0, 0.0, 0.0);
    assert_eq!(reported(far.clone(), "hzb", eye + there, target + there), [0, 1], "objects seen at 3,900 km");
    assert!(
        far.clone().with_walks().walks[0].keys[0].eye.distance(there) < 1000.0,
        "the walk is near the content"
    );
    // Coordinates in the JSON text are more precise than f32: 0.4 m are resolved at a distance of 3,900 km.
    let apart = edge(3_900_000.4).scene();
    let [a, b] = [&far, &apart]
        .map(|scene| scene.objects[0].triangles.view().get(0).unwrap()[0].as_dvec3() + scene.origin);
    assert!((b - a - DVec3::new(0.4, 0.0, 0.0)).length() < 1e-5, "{a} {b}");
    // A scene around the document's origin keeps this origin, however large.
    let mut wide = edge(0.0);
    wide.root["nodes"][0]["scale"] = json!([1000, 1000, 1000]);
    assert_eq!(wide.scene().origin, DVec3::ZERO, "the origin of a large scene around 0");
}

#[test]
fn movers_far_from_the_origin_are_relative_to_it_too() {
    let mut file = door();
    file.root["scenes"][0]["nodes"] = json!([2]);
    file.push("nodes", json!({"children": [0, 1], "translation": [0, 0, 6_400_000]}));
    let scene = file.scene();
    let (low, high) = *scene.objects[0].motion.as_deref().expect("a door");
    let [low, high] = [low, high].map(|corner| corner.as_dvec3() + scene.origin);
    assert!((low - DVec3::new(-2.0, -2.0, 6.4e6)).length() < 0.01, "{low}");
    assert!((high - DVec3::new(2.0, 7.0, 6.4e6)).length() < 0.01, "{high}");
}

/// Command-line arguments of a program that reads a scene file.
#[derive(clap::Parser)]
struct Arguments {
    #[command(flatten)]
    reading: Reading,
}

/// Returns the scene of a box with the given size, read with the given options.
fn boxed(size: [f32; 3], reading: &Reading) -> SceneSource {
    let [x, y, z] = size;
    let mut file = File::new();
    let sides = [rectangle([0.0, x], [0.0, y], 0.0), rectangle([0.0, x], [0.0, y], z)];
    let mesh = file.mesh(&sides.concat());
    file.node(json!({"mesh": mesh}));
    parse_as(&file.glb(), Path::new("box.glb"), reading).expect("a valid file")
}

#[test]
fn unit_and_axis_up_are_as_told_or_hinted_at() {
    let Arguments { reading } = clap::Parser::parse_from(["", "--unit", "mm", "--up", "z"]);
    let house = boxed([12_000.0, 9_000.0, 6_000.0], &reading);
    assert_eq!(
        house.bounds(),
        Some((Vec3::ZERO, Vec3::new(12.0, 9.0, 6.0))),
        "a house in millimetres with z up"
    );
    assert_eq!((house.up, house.notes.len()), (Vec3::Z, 0), "the axis up, and no notes");
    let silent = Reading::default();
    let hint = |size| boxed(size, &silent).notes.join("\n");
    assert!(
        hint([12_000.0, 6_000.0, 9_000.0]).ends_with("if it is in mm, say --unit mm"),
        "a house in millimetres gets a hint"
    );
    assert!(
        hint([1200.0, 600.0, 900.0]).ends_with("if it is in cm, say --unit cm"),
        "a house in centimetres gets a hint"
    );
    assert!(hint([500.0, 300.0, 20.0]).ends_with("if z is up, say --up z"), "a town on its side gets a hint");
    assert_eq!(
        hint([12.0, 6.0, 9.0]) + &hint([500.0, 20.0, 300.0]) + &hint([1.7, 1.8, 0.3]),
        "",
        "a house, a town and a person get no hint"
    );
}

#[test]
fn a_house_on_its_side_gets_a_hint() {
    let notes = |size: f32, floors: usize, is_y_up: bool| {
        let mut file = File::new();
        for floor in 0..floors {
            let level = rectangle([0.0, size], [0.0, size], floor as f32 * size / 20.0);
            let turned = level.iter().map(|&[x, y, z]| if is_y_up { [x, z, -y] } else { [x, y, z] });
            let mesh = file.mesh(&turned.collect::<Vec<_>>());
            file.node(json!({"mesh": mesh}));
        }
        file.scene().notes.join("\n")
    };
    assert_eq!(
        notes(8.0, 10, false),
        "its largest faces are level along z: if z is up, say --up z",
        "a house on its side gets a hint"
    );
    assert_eq!(
        notes(2000.0, 10, false),
        "its largest faces are level along z: if z is up, say --up z\nit is 2000 by 2000 by 900 m: if it is \
         in cm, say --unit cm",
        "the height is that along z"
    );
    // No notes for a house that stands upright, nor for a thing with few parts.
    assert_eq!(
        notes(8.0, 10, true) + &notes(8.0, 7, false),
        "",
        "a house that stands, and one of few floors, get no hint"
    );
}

#[test]
fn a_wide_scene_of_giants_gets_a_hint() {
    let notes = |count: usize, height: f32| {
        let mut file = File::new();
        let wall = rectangle([0.0, 2000.0], [0.0, height], 0.0);
        let other = wall.iter().map(|&[x, y, z]| [z, y, x]);
        let floor = rectangle([0.0, 2000.0], [0.0, 2000.0], 0.0).into_iter().map(|[x, y, z]| [x, z, y]);
        let mesh = file.mesh(&wall.iter().copied().chain(other).chain(floor).collect::<Vec<_>>());
        for i in 0..count {
            file.node(json!({"mesh": mesh, "translation": [12_000 * i, 0, 12_000 * (i % 5)]}));
        }
        file.scene().notes.join("\n")
    };
    assert!(notes(10, 1500.0).ends_with("if it is in mm, say --unit mm"), "trees in millimetres");
    assert_eq!(notes(10, 900.0) + &notes(9, 1500.0), "", "towers, and a few mountains");
}

#[test]
fn the_origin_of_coordinates_near_the_greatest_number_is_finite() {
    let mut file = edge(0.0);
    file.root["nodes"][0]["translation"] = json!([1.7e308, 0, 0]);
    let scene = file.scene();
    assert!(scene.origin.is_finite(), "the origin {}", scene.origin);
    let there = DVec3::new(1.7e308, 0.0, 0.0);
    assert!(
        World::new(scene.with_walks(), (8, 8), Some(1)).is_ok_and(|world| world.origin() == there),
        "a world"
    );
}

#[test]
fn flattened_surfaces_hide_only_if_both_sides_are_drawn() {
    // Transforms of a parent and of its child, and whether it is certain which side is the front.
    let turn = [0.5, 0.0, 0.0, 0.75_f64.sqrt()];
    for (parent, child, is_certain) in [
        (json!([1, 1, 1]), json!([1, 1, 1]), true),
        (json!([1, -1, 1]), json!([1, 1, 1e-9]), true),
        (json!([1e-9, 1e-9, 1e-9]), json!([1, 1, 1]), true),
        (json!([1, 1, 0]), json!([1, 1, 1]), false),
        (json!([1, 1, 1]), json!([0, 1, 1]), false),
        (json!([1, 1, 1e-9]), json!([1, 1, 1]), false),
    ] {
        for (two_sided, users) in [(false, 1), (false, 2), (true, 1), (true, 2)] {
            let mut file = File::new();
            let mesh = file.mesh(&CORNERS);
            file.root["materials"] = json!([{"doubleSided": two_sided}]);
            file.root["meshes"][0]["primitives"][0]["material"] = json!(0);
            file.node(json!({"scale": parent, "children": [1]}));
            file.push("nodes", json!({"mesh": mesh, "scale": child, "rotation": turn}));
            for _ in 1..users {
                file.node(json!({"mesh": mesh}));
            }
            let scene = file.scene();
            let case = format!("{parent}, {child}, two-sided: {two_sided}, {users} users");
            let first = &scene.objects[0];
            assert_eq!(first.opaque, two_sided || is_certain, "{case}");
            assert_eq!(first.see_through, !first.opaque, "nothing is behind it for sure: {case}");
            assert_eq!(first.one_sided, !two_sided && is_certain, "it may be seen from both sides: {case}");
            assert!(scene.objects[1..].iter().all(|object| object.opaque), "others: {case}");
            // A hint, as `--occluder` gives it, makes no wall of what may face either way.
            let mut hinted = first.clone();
            hinted.take(Hint::Occluder);
            assert_eq!(hinted, *first, "with a hint: {case}");
        }
    }
}
