//! Tests of the recipes: pinned counts and positions, and walks that follow the stored ones.

use crate::shared_scenes::stored;
use glam::{DVec3, Vec3};
use visibility_examples::recipes::office;
use visibility_examples::{SceneSource, Walk, built_in, description::Description};

/// Returns the number of objects and the number of triangles of a scene.
fn counts(scene: &SceneSource) -> (usize, usize) {
    (scene.objects.len(), scene.triangle_count())
}

#[test]
fn sample_sizes_have_their_counts() {
    let samples = [
        ("plpcity", (2_376, 232_224)),
        ("london", (3_674, 35_588)),
        ("town", (698, 190_400)),
        ("forest", (216, 202_048)),
        ("office", (779, 89_664)),
    ];
    for (name, expected) in samples {
        let scene = built_in(name).expect(name);
        assert_eq!(counts(&scene), expected, "{name}");
        assert_eq!(scene.up, Vec3::Z, "{name}: the axis up");
        assert_eq!(scene.walks.len(), 3, "{name}");
    }
}

#[test]
fn larger_sizes_have_their_counts() {
    assert_eq!(built_in("plpcity:3,3").expect("small").triangle_count(), 522_504, "triangles of plpcity:3,3");
    for (name, expected) in [
        ("plpcity:6,6", (21_384, 2_090_016)),
        ("town:8", (2_357, 1_027_034)),
        ("forest:1450,226", (1_571, 1_465_488)),
    ] {
        assert_eq!(counts(&built_in(name).expect(name)), expected, "objects and triangles of {name}");
    }
    assert_eq!(
        counts(&office(7, 24).expect("in bounds").scene),
        (4_020, 468_960),
        "objects and triangles of office:7,24"
    );
    let city = built_in("london:101,101").expect("in bounds");
    assert_eq!(counts(&city), (249_851 + 101 * 101, 2_518_912), "objects and triangles of london:101,101");
    let buildings = city.objects.iter().filter(|o| o.name != *"ground");
    assert_eq!(buildings.count(), 249_851, "buildings of london:101,101");
}

#[test]
fn every_size_that_is_refused_is_refused_before_it_is_made() {
    // The estimates that limit sizes must not be below the actual number of triangles.
    for (spec, at_most) in [
        ("plpcity:4,1", 4 * 58_056),
        ("london:9,9", 81 * 250),
        ("town:1", 60_000),
        ("town:6", 6 * 45_000 + 36 * 15_000),
        ("office:1,5", 5 * 3_000),
    ] {
        let made = built_in(spec).expect(spec).triangle_count();
        assert!(made <= at_most, "{spec}: {made} > {at_most}");
    }
}

#[test]
fn positions_are_pinned() {
    // Scene, object index, triangle index, and the expected second vertex in metres.
    let pinned = [
        ("plpcity", 792, 52, [22.11301, 58.18973, 4.4]),
        ("plpcity", 1584, 36, [113.41132, 32.14983, 0.0]),
        ("london", 1224, 5, [479.4993, 112.75421, 15.08856]),
        ("london", 2449, 5, [807.75616, 204.04257, 16.163]),
        ("town", 232, 291, [-79.9292, -13.47367, 7.45267]),
        ("town", 465, 1, [-105.0, 0.0, 0.0]),
        ("forest", 72, 500, [64.69547, 80.1877, 9.64693]),
        ("forest", 144, 500, [67.03707, 64.57973, 10.70395]),
        ("office", 259, 30, [17.88, 6.89, 0.74]),
        ("office", 519, 44, [35.45, -3.6, 3.5]),
    ];
    for (name, object, triangle, expected) in pinned {
        let scene = built_in(name).expect(name);
        let found = scene.objects[object].triangles.view().get(triangle).expect(name)[1];
        let error = (found - Vec3::from_array(expected)).abs().max_element();
        assert!(error < 1e-4, "{name}, object {object}: {found}");
    }
}

#[test]
fn the_sums_of_all_coordinates_are_pinned() {
    // Weights from 1 to 7 in turn reveal exchanged coordinates. Moving one piece of furniture by a centimetre
    // changes a sum by tens; rounding errors of all sines together change it by less than one.
    let sums: [(&str, f64); 5] = [
        ("plpcity", 329062664.0),
        ("london", 419011144.9),
        ("town", 10863565.7),
        ("forest", 229803101.6),
        ("office", 38608362.6),
    ];
    for (name, expected) in sums {
        let scene = built_in(name).expect(name);
        let vertices = scene.objects.iter().flat_map(|o| o.triangles.iter().flatten());
        let coordinates = vertices.flat_map(|p| p.to_array());
        let sum: f64 =
            coordinates.zip((1..=7).cycle()).map(|(c, weight)| f64::from(c) * f64::from(weight)).sum();
        assert!((sum - expected).abs() < 1.0, "{name}: {sum}");
    }
}

#[test]
fn office_cells_and_portals_fit_together() {
    let office = office(3, 9).expect("in bounds");
    assert_eq!(office.cells.len(), 3 * (2 + 2 * 9), "cells of three floors");
    // Portals: stairs to corridors, stairs between floors, one door per room, and a doorway at the rooms 4
    // and 8 of each side.
    assert_eq!(office.portals.len(), 3 + 2 + 3 * 18 + 3 * 4, "portals of three floors");
    for portal in &office.portals {
        for cell in portal.cells.map(|cell| &office.cells[cell]) {
            for corner in portal.quad {
                let inside = corner.cmpge(cell.min - 1e-9) & corner.cmple(cell.max + 1e-9);
                assert!(inside.all(), "{portal:?} is not on {cell:?}");
            }
        }
    }
}

#[test]
#[cfg_attr(not(reference_scenes), ignore = "the reference scenes are not beside the checkout")]
fn office_cells_and_portals_are_the_stored_ones() {
    let path = stored("gen_office.json");
    let text = std::fs::read_to_string(path).expect("a readable file");
    let facts: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let list = |key: &str| facts[key].as_array().expect("a list").clone();
    let point = |value: &serde_json::Value| -> DVec3 {
        let number = |i: usize| value[i].as_f64().expect("a number");
        DVec3::new(number(0), number(1), number(2))
    };
    let office = office(2, 16).expect("in bounds");
    assert_eq!(
        (office.cells.len(), office.portals.len()),
        (list("cells").len(), list("portals").len()),
        "cells and portals, made and stored"
    );
    for (made, stored) in office.cells.iter().zip(list("cells")) {
        assert_eq!(stored["name"], *made.name, "the cell's name");
        assert!(made.min.distance(point(&stored["min"])) < 1e-9, "{made:?}");
        assert!(made.max.distance(point(&stored["max"])) < 1e-9, "{made:?}");
    }
    for (made, stored) in office.portals.iter().zip(list("portals")) {
        assert_eq!(stored["cells"], serde_json::json!(made.cells), "{made:?}: its cells");
        assert_eq!(stored["door"].as_bool().unwrap_or(false), made.door, "{made:?}: whether it is a door");
        for (i, corner) in made.quad.iter().enumerate() {
            assert!(corner.distance(point(&stored["quad"][i])) < 1e-9, "{made:?}");
        }
    }
}

/// Returns two distances in metres: the greatest between the walk's eyes and those of the stored walk, and
/// the third greatest between the targets. Two targets are ignored because, where a route turns back,
/// rounding decides whether the camera looks along the route or straight on.
fn distance(walk: &Walk, stored: &Walk) -> (f64, f64) {
    let distances = |pick: fn(&visibility_examples::CameraKey) -> DVec3| {
        let pairs = walk.keys.iter().zip(&stored.keys);
        let mut all: Vec<f64> = pairs.map(|(a, b)| pick(a).distance(pick(b))).collect();
        all.sort_by(f64::total_cmp);
        all
    };
    let eyes = distances(|key| key.eye);
    let targets = distances(|key| key.target);
    (eyes[eyes.len() - 1], targets[targets.len() - 3])
}

#[test]
#[cfg_attr(not(reference_scenes), ignore = "the reference scenes are not beside the checkout")]
fn walks_follow_the_stored_ones() {
    let scenes = [
        ("plpcity", "gen_plpcity", 0.1),
        ("london", "gen_london", 0.7),
        ("town", "gen_town16", 0.4),
        ("forest", "gen_forest", 0.2),
        ("office", "gen_office", 0.1),
    ];
    for (name, file, eye_tolerance) in scenes {
        let path = stored(&format!("{file}.json"));
        let facts = Description::load(&path).expect(file);
        let scene = built_in(name).expect(name);
        assert_eq!(scene.near, facts.near.expect("a near plane"), "{name}: the near plane");
        assert_eq!(Some(scene.objects.len() as u64), facts.objects, "{name}: objects");
        assert_eq!(Some(scene.triangle_count() as u64), facts.triangles, "{name}: triangles");
        for (object, stored) in scene.objects.iter().zip(&facts.object_names) {
            assert_eq!(&object.name.to_string(), stored, "{name}");
        }
        let (low, high) = scene.bounds().expect("a scene");
        let corners = [(low, facts.bounds_min), (high, facts.bounds_max)];
        for (made, stored) in corners {
            let stored = DVec3::from_array(stored.expect("bounds"));
            assert!(made.as_dvec3().distance(stored) < 2e-3, "{name}: {made} {stored}");
        }
        assert_eq!(scene.walks.len(), facts.walks.len(), "{name}: walks");
        for (walk, stored) in scene.walks.iter().zip(&facts.walks) {
            assert_eq!(walk.name, stored.name, "{name}: the walk's name");
            assert_eq!(walk.fov_y_degrees, stored.fov_y_degrees, "{name}, {}: the angle", walk.name);
            assert_eq!(walk.up, stored.up, "{name}, {}: the axis up", walk.name);
            assert_eq!(walk.keys.len(), stored.keys.len(), "{name}, {}: keys", walk.name);
            let (eye, target) = distance(walk, stored);
            println!("{name}, {}: eyes {eye:.3} m, targets {target:.3} m", walk.name);
            assert!(eye < eye_tolerance, "{name}, {}: {eye}", walk.name);
            assert!(target < 2.0 * eye_tolerance, "{name}, {}: {target}", walk.name);
        }
    }
}
