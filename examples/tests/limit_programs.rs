//! Tests of the box limit and the cost over the ideal, as `walkthrough` and `tradeoff` print them, on a wall
//! in front of a plate.

use crate::bake_program::{WHOLE, folder, names, run, text, write_wall};
use std::fs;
use std::path::Path;
use visibility_core::glam::DVec3;
use visibility_examples::walkthrough::judge::over_ideal;
use visibility_examples::walkthrough::{World, judge_with_limits};
use visibility_examples::{CameraKey, load};

/// Writes a scene with the wall, the plate and a camera in front of the wall. The scene's name is not a valid
/// file name.
fn write_scene(folder: &Path) {
    write_wall(&folder.join("wall.vscn"), WHOLE);
    let cameras = r#"{"name": "a/b", "up_axis": "z", "near": 0.05, "cameras": [{"name": "w", "fov_y_deg": 60,
        "up": [0, 0, 1], "keys": [{"eye": [0, -1, 1], "target": [0, 5, 1]}]}]}"#;
    fs::write(folder.join("wall.json"), cameras).unwrap();
}

#[test]
fn glass_hides_no_box_from_the_limit() {
    let folder = folder("limit_glass");
    write_scene(&folder);
    for (opaque, eye, limit) in [(true, -1.0, 1), (false, -1.0, 2), (true, 7.0, 1), (true, 20.0, 0)] {
        let mut source = load(&folder.join("wall.vscn")).unwrap();
        source.objects[0].opaque = opaque;
        let target = DVec3::new(0.0, 30.0, 1.0);
        source.walks[0].keys = vec![CameraKey { eye: DVec3::new(0.0, eye, 1.0), target }];
        let world = World::new(source, (64, 36), None).unwrap();
        let judgement = judge_with_limits(&world, &[], || ()).unwrap();
        assert_eq!(judgement.limits.as_deref(), Some(&[limit][..]), "{opaque}, {eye}");
        assert_eq!(judgement.exact[0].len(), limit.min(1), "{opaque}, {eye}");
    }
}

#[test]
fn the_cost_over_the_ideal_counts_culling_and_what_is_drawn() {
    assert_eq!(over_ideal(4.0, [10.0, 2000.0], [3.0, 1000.0]), 4.0, "four times as long as the ideal");
    assert_eq!(over_ideal(0.0, [3.0, 1000.0], [3.0, 1000.0]), 1.0, "the ideal itself");
    // If nothing is visible, the ideal counts as 1 us.
    assert_eq!(over_ideal(2.0, [5.0, 0.0], [0.0, 0.0]), 7.0, "a frame in which nothing is visible");
}

#[test]
fn walkthrough_says_limit_and_cost_over_the_ideal() {
    let folder = folder("limit_walkthrough");
    write_scene(&folder);
    let arguments =
        ["wall.vscn", "--size", "64x36", "--cullers", "frustum", "--rays", "1000", "--json", "out.json"];
    let output = run(env!("CARGO_BIN_EXE_walkthrough"), &folder, &arguments);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let said = text(&output.stdout);
    assert!(
        said.contains("1.0 objects visible by 2 triangles; box limit 1.0 objects; ideal 1.0 us"),
        "{said}"
    );
    // The frustum's own ratio is its time over 4 times its time: 0.25.
    assert!(said.contains(" 0.25 ") && said.contains(" frustum: 0 objects were met and hidden\n"), "{said}");
    let line: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(folder.join("out.json")).unwrap()).unwrap();
    assert_eq!(
        (line["mean_visible"].as_f64(), line["mean_box_limit"].as_f64()),
        (Some(2.0), Some(1.0)),
        "mean visible triangles and box limit"
    );
    // Two objects of two triangles each are drawn, and only one is visible. Culling takes additional time.
    assert!(line["over_ideal"].as_f64().unwrap() > 2.004 / 1.002, "{line}");
}

#[test]
fn tradeoff_takes_files_and_tells_scenes_of_one_name_apart() {
    let folder = folder("limit_tradeoff");
    write_scene(&folder);
    let arguments = ["wall.vscn", "wall.vscn", "--quick", "--cullers", "frustum", "--out", "made"];
    let output = run(env!("CARGO_BIN_EXE_tradeoff"), &folder, &arguments);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let plots = ["a_b-2-overdraw.svg", "a_b-2-wrong-pixels.svg", "a_b-overdraw.svg", "a_b-wrong-pixels.svg"];
    assert_eq!(names(&folder.join("made")), [&plots[..], &["points.csv"]].concat(), "files made");
    let points = fs::read_to_string(folder.join("made/points.csv")).unwrap();
    let mut lines = points.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let header = lines.next().unwrap();
    let column = |name: &str| header.iter().position(|&column| column == name).unwrap();
    let rows: Vec<_> = lines.map(|row| [row[0].to_owned(), row[column("box_limit")].to_owned()]).collect();
    assert_eq!(rows, [["a/b", "1.0"], ["a/b-2", "1.0"]], "scene and box limit by row");
    assert!(text(&output.stdout).contains("over the ideal: "), "{}", text(&output.stdout));
}
