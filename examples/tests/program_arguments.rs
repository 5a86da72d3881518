//! Tests of command-line programs: a closed output pipe, and numbers too large to store or draw.

use std::process::{Command, Output, Stdio};

/// Runs a program with its standard output closed, and returns what it wrote to standard error. The program
/// runs in the folder for files of tests, in which it may leave pictures.
fn without_reader(program: &str, arguments: &str) -> Output {
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let mut command = Command::new(program);
    command.current_dir(env!("CARGO_TARGET_TMPDIR"));
    command.args(arguments.split(' ')).stdout(writer).stderr(Stdio::piped());
    command.output().unwrap()
}

#[test]
fn programs_end_quietly_when_their_reader_leaves() {
    for (program, arguments) in [
        (env!("CARGO_BIN_EXE_region"), "plpcity:1,1 --cells 1 --eyes 1 --rays 10"),
        (env!("CARGO_BIN_EXE_walkthrough"), "plpcity:1,1 --frames 1 --size 8x8"),
        (env!("CARGO_BIN_EXE_bake"), "fingerprint plpcity:1,1"),
    ] {
        let output = without_reader(program, arguments);
        let error = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{program} {arguments} ends with {}: {error}", output.status);
    }
}

#[test]
fn programs_write_their_files_when_their_reader_leaves() {
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("without_reader");
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    let plan = folder.join("plan.txt");
    std::fs::write(&plan, "2 1\n0 0 1 0\n1 0 0 1\n0.2 0.2\n").unwrap();
    for (program, arguments, file) in [
        (env!("CARGO_BIN_EXE_region"), "plpcity:1,1 --cells 1 --eyes 1 --rays 10 --csv", "region.csv"),
        (env!("CARGO_BIN_EXE_walkthrough"), "plpcity:1,1 --frames 1 --size 8x8 --json", "walkthrough.json"),
        (env!("CARGO_BIN_EXE_occluders"), "plpcity:1,1 -o", "level.occ"),
        (env!("CARGO_BIN_EXE_plan"), &format!("{} --json - --svg", plan.display()), "plan.svg"),
    ] {
        let path = folder.join(file);
        let output = without_reader(program, &format!("{arguments} {}", path.display()));
        let error = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success() && path.exists(), "{program} {arguments}: {error}");
    }
}

#[test]
fn numbers_beyond_what_can_be_kept_or_drawn_are_refused() {
    for (program, arguments, expected) in [
        (env!("CARGO_BIN_EXE_walkthrough"), "--frames 4000000000", "4000000000 is not in 1..=1000000"),
        (env!("CARGO_BIN_EXE_walkthrough"), "--frames 0", "0 is not in 1..=1000000"),
        (env!("CARGO_BIN_EXE_walkthrough"), "--size 0x0", "a side has at least 1 pixel"),
        (env!("CARGO_BIN_EXE_region"), "--cells 4000000000", "4000000000 is not in 1..=1000000"),
        (env!("CARGO_BIN_EXE_motion"), "--movers 4000000000", "4000000000 is not in 1..=1000000"),
    ] {
        let output = Command::new(program).args(arguments.split(' ')).output().unwrap();
        let error = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{program} {arguments}: {error}");
        assert!(error.contains(expected), "{program} {arguments}: expected `{expected}` in: {error}");
    }
}

#[test]
fn cameras_are_in_the_unit_of_the_scene() {
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("cameras_in_mm");
    std::fs::create_dir_all(&folder).unwrap();
    // Coordinates in millimetres: a triangle 2 m in front of the camera, and one 3 m behind it.
    let triangle = |z: f32| [[-500.0, -500.0, z], [500.0, -500.0, z], [0.0, 500.0, z]];
    let points = [triangle(0.0), triangle(5000.0)];
    let bytes: Vec<u8> = points.as_flattened().as_flattened().iter().flat_map(|x| x.to_le_bytes()).collect();
    std::fs::write(folder.join("scene.bin"), bytes).unwrap();
    let document = r#"{"asset": {"version": "2.0"}, "nodes": [{"mesh": 0}, {"mesh": 1}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}, {"primitives": [{"attributes": {"POSITION": 1}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3},
            {"bufferView": 0, "byteOffset": 36, "componentType": 5126, "type": "VEC3", "count": 3}],
        "bufferViews": [{"buffer": 0, "byteLength": 72}], "buffers": [{"byteLength": 72, "uri": "scene.bin"}]}"#;
    std::fs::write(folder.join("scene.gltf"), document).unwrap();
    let cameras = r#"{"near": 1000, "cameras": [{"fov_y_deg": 60, "up": [0, 1, 0],
        "keys": [{"eye": [0, 0, 2000], "target": [0, 0, 0]}]}]}"#;
    std::fs::write(folder.join("cameras.json"), cameras).unwrap();
    let arguments =
        "scene.gltf --unit mm --cameras cameras.json --cullers frustum --size 32x18 --dump dump.csv";
    let output = Command::new(env!("CARGO_BIN_EXE_walkthrough"))
        .args(arguments.split(' '))
        .current_dir(&folder)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let dump = std::fs::read_to_string(folder.join("dump.csv")).unwrap();
    assert!(dump.lines().any(|line| line.trim_end() == "0 frustum 0"), "{dump}");
    // The programs that walk take the same cameras; this one stands still.
    let scene = "scene.gltf --unit mm --cameras cameras.json";
    for (program, more, expected) in [
        (env!("CARGO_BIN_EXE_online"), "--frames 3", "no way to walk"),
        (env!("CARGO_BIN_EXE_server"), "--boxes 2 --players 1 --things 1 --ticks 1", "cells in"),
    ] {
        let arguments = format!("{scene} {more}");
        let output = Command::new(program).args(arguments.split(' ')).current_dir(&folder).output().unwrap();
        let said = String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned();
        assert!(said.contains(expected), "{program} {arguments}: {said}");
    }
}
