//! Tests of VSCN files: written files are read back bit by bit, and hostile bytes give errors with their
//! position.

use glam::Vec3;
use proptest::prelude::*;
use std::path::{Path, PathBuf};
use visibility_examples::{Reading, SceneSource, SourceError, SourceObject, load, open_by_object, vscn};

/// Makes a scene of opaque objects, each from its list of triangles.
fn scene(objects: Vec<Vec<[Vec3; 3]>>) -> SceneSource {
    let objects = objects.into_iter().map(|triangles| SourceObject::new("object", triangles)).collect();
    SceneSource { objects, ..SceneSource::new("test", Vec3::Z, 0.1) }
}

/// Parses the bytes of a VSCN file named `test.vscn`, and returns the loader's result.
fn parse(bytes: &[u8]) -> Result<Vec<Vec<[Vec3; 3]>>, SourceError> {
    vscn::parse(bytes, Path::new("test.vscn"))
}

/// Returns the bytes of a file with three objects of 2, 0 and 1 triangles, with a NaN and an infinity among
/// the coordinates.
fn small() -> Vec<u8> {
    let triangle = [Vec3::X, Vec3::Y, Vec3::new(f32::NAN, f32::INFINITY, -0.0)];
    let objects = vec![vec![triangle; 2], Vec::new(), vec![triangle]];
    vscn::write(&scene(objects)).expect("few triangles")
}

/// Creates the folder `name` for test files, in the build's folder for temporary files, and returns its path.
fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::create_dir_all(&folder).expect("a folder for test files");
    folder
}

#[test]
fn what_is_written_is_read_bit_by_bit() {
    let bytes = small();
    let objects = parse(&bytes).expect("written here");
    let counts: Vec<_> = objects.iter().map(Vec::len).collect();
    assert_eq!(counts, [2, 0, 1], "triangles by object");
    assert!(objects[0][0][2].x.is_nan(), "a coordinate of NaN");
    assert_eq!(vscn::write(&scene(objects)), Some(bytes), "the bytes written again");
    let nothing = vscn::write(&scene(Vec::new())).expect("no triangles");
    assert_eq!(parse(&nothing).expect("no objects").len(), 0, "objects of an empty file");
}

#[test]
fn every_cut_is_an_error_with_a_place() {
    let bytes = small();
    for length in 0..bytes.len() {
        let message = parse(&bytes[..length]).expect_err("cut short").to_string();
        assert!(message.starts_with("test.vscn: byte "), "{length}: {message}");
    }
}

#[test]
fn lying_headers_are_explained() {
    let with = |at: usize, value: u32| {
        let mut bytes = small();
        bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
        bytes
    };
    let mut longer = small();
    longer.push(0);
    let wrong = [
        (with(0, 7), "byte 0: the magic number is 0x00000007"),
        (with(4, u32::MAX), "byte 4: 4294967295 objects are claimed"),
        (with(4, 2), "byte 88: 40 bytes follow the last object"),
        (with(8, u32::MAX), "byte 8: object 0 claims 4294967295"),
        // 36 times this count wraps around to 8 in 32 bits.
        (with(8, 0x71C7_1C72), "byte 8: object 0 claims 1908874354"),
        (longer, "byte 128: 1 bytes follow"),
    ];
    for (bytes, part) in wrong {
        let message = parse(&bytes).expect_err(part).to_string();
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn the_description_beside_a_file_is_used_and_checked() {
    let folder = folder("vscn_beside");
    let file = folder.join("room.vscn");
    let facts = folder.join("room.json");
    std::fs::write(&file, small()).expect("a test file");
    let _ = std::fs::remove_file(&facts);
    let bare = load(&file).expect("no description is needed");
    assert_eq!((bare.name.as_str(), bare.up), ("room", Vec3::Z), "the file's name, and the default axis up");
    assert!(bare.walks.is_empty() && bare.near > 0.0, "no walks, and a near plane");

    std::fs::write(
        &facts,
        r#"{"up_axis": "y", "near": 0.5, "object_names": ["IfcDoor 1", "TREE", "glass"],
            "first_transparent_object": 2, "alpha_tested_name_prefixes": ["TREE"], "door_name_contains": "Door"}"#,
    )
    .expect("a test file");
    let room = load(&file).expect("a good description");
    assert_eq!((room.up, room.near), (Vec3::Y, 0.5), "axis up and near plane of the description");
    let kinds: Vec<_> = room.objects.iter().map(|o| (o.opaque, o.door)).collect();
    assert_eq!(
        kinds,
        [(true, true), (false, false), (false, false)],
        "opaque objects and doors of the description"
    );
    let names: Vec<_> = room.objects.iter().map(|o| o.name.to_string()).collect();
    assert_eq!(names, ["IfcDoor 1", "TREE", "glass"], "names of the description");

    for (text, part) in [
        (r#"{"objects": 4}"#, "room.json: objects: it says 4"),
        (r#"{"object_names": ["a"]}"#, "room.json: object_names"),
        (r#"{"cameras": 3}"#, "room.json: cameras: expected a list"),
    ] {
        std::fs::write(&facts, text).expect("a test file");
        let message = load(&file).expect_err(part).to_string();
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn files_are_read_object_by_object_and_damaged_ones_refused_as_bytes_are() {
    let file = folder("vscn_damaged").join("room.vscn");
    let at = file.display().to_string();
    let bytes = small();
    let mut damaged = vec![bytes.clone(), [&bytes[..], &[0]].concat()];
    damaged.extend([0, 7, 40, 83, 91].map(|length| bytes[..length].to_vec()));
    damaged.push([&bytes[..4], &[9; 4], &bytes[8..]].concat());
    for bytes in &damaged {
        std::fs::write(&file, bytes).expect("a test file");
        let mut passed = Vec::new();
        let read =
            open_by_object(&at, &Reading::default(), &mut |_, object| passed.push(object.triangles.len()));
        let expected = parse(bytes).map(|objects| objects.len()).map_err(|error| error.to_string());
        match (read, expected) {
            (Ok(scene), Ok(count)) => {
                assert!(scene.objects.is_empty() && passed.len() == count, "{} objects passed", passed.len())
            }
            (Err(found), Err(expected)) => {
                assert_eq!(
                    found.to_string(),
                    expected.replace("test.vscn", &at),
                    "the error of the file and of its bytes"
                );
            }
            (found, expected) => panic!("{found:?} where {expected:?} was expected"),
        }
        // Objects before the damage are still passed on.
        let before = if bytes.len() < 84 || bytes[4] == 9 { 0 } else { 3 };
        assert!(
            passed == [2, 0, 1][..before] || bytes.len() < 128 && passed == [2, 0][..passed.len()],
            "{} bytes: objects passed before the damage: {passed:?}",
            bytes.len()
        );
    }
    let failing = std::io::Read::chain(&bytes[..50], Failing);
    let error = vscn::read(failing, 128, Path::new("test.vscn"), &mut |_| {}).expect_err("a failing disk");
    assert!(matches!(error, SourceError::Io { .. }), "{error}");
}

/// Reader that fails like a broken disk.
struct Failing;

impl std::io::Read for Failing {
    fn read(&mut self, _: &mut [u8]) -> std::io::Result<usize> {
        Err(std::io::Error::other("the disk is broken"))
    }
}

#[test]
fn missing_and_unknown_files_are_errors() {
    for name in ["nowhere/scene.vscn", "nowhere/scene.glb", "scene.obj", "scene", ""] {
        assert!(load(Path::new(name)).is_err(), "{name}");
    }
    let message = load(Path::new("a.obj")).expect_err("unknown").to_string();
    assert!(message.contains("a.obj"), "{message}");
}

proptest! {
    #[test]
    fn any_bytes_are_read_or_refused(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
        let _ = parse(&bytes);
    }

    #[test]
    fn mutated_files_never_yield_more_than_they_hold(
        changes in proptest::collection::vec((0_usize..128, any::<u8>()), 1..8),
        length in 0_usize..140,
    ) {
        let mut bytes = small();
        for (at, value) in changes {
            bytes[at] = value;
        }
        bytes.resize(length, 0);
        if let Ok(objects) = parse(&bytes) {
            let triangles: usize = objects.iter().map(Vec::len).sum();
            prop_assert_eq!(8 + 4 * objects.len() + 36 * triangles, bytes.len());
        }
    }
}

#[test]
fn too_many_copies_of_a_car_are_refused() {
    let folder = folder("vscn_cars");
    let placements = vec![[0; 3]; 4097];
    let description = serde_json::json!({"cars5_placements_x_z_yawdeg": placements});
    // One object of 2^13 triangles is placed more than 2^12 times, and 2^10 objects of none.
    for objects in [vec![vec![[Vec3::ZERO; 3]; 1 << 13]], vec![Vec::new(); 1 << 10]] {
        let path = folder.join("car.vscn");
        std::fs::write(&path, vscn::write(&scene(objects)).expect("few triangles")).expect("a test file");
        std::fs::write(path.with_extension("json"), description.to_string()).expect("a test file");
        let name = format!("cars5:{}", path.display());
        let mut copies = 0;
        let scene = open_by_object(&name, &Reading::default(), &mut |_, _| copies += 1);
        let error = scene.expect_err("too many copies").to_string();
        assert!(error.contains("cars5_placements_x_z_yawdeg: with it, the scene has more than"), "{error}");
        assert_eq!(copies, 0, "objects before the error");
    }
}
