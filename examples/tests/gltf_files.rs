//! Tests of the glTF loader: valid files give the right triangles, and hostile files give errors.

use glam::{DVec3, Vec3};
use proptest::prelude::*;
use serde_json::{Value, json};
use std::path::Path;
use visibility_examples::gltf_file::parse;
use visibility_examples::{SceneSource, SourceError};
use visibility_testing::allocations::{LIVE, PEAK};

/// Returns the buffer of the test document: four corners of the unit square in z = 0 as f32, then the indices
/// 0 1 2 3 as u16.
fn square_bytes() -> Vec<u8> {
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0_f32]];
    let mut bytes: Vec<u8> = corners.iter().flatten().flat_map(|c| c.to_le_bytes()).collect();
    bytes.extend([0, 1, 2, 3_u16].iter().flat_map(|i| i.to_le_bytes()));
    bytes
}

/// Returns a valid document with the square as a triangle strip, scaled by two by its node and translated to
/// x = 10 by the parent node.
fn square() -> Value {
    json!({
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [
            {"children": [1], "translation": [10.0, 0.0, 0.0]},
            {"mesh": 0, "scale": [2.0, 2.0, 2.0], "name": "tile"}
        ],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "mode": 5}]}],
        "buffers": [{"byteLength": 56}],
        "bufferViews": [
            {"buffer": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 8}
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]},
            {"bufferView": 1, "componentType": 5123, "count": 4, "type": "SCALAR"}
        ]
    })
}

/// Packs a document and its binary chunk into the bytes of a GLB file.
pub(crate) fn glb(document: &Value, data: &[u8]) -> Vec<u8> {
    let mut text = document.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut data = data.to_vec();
    data.resize(data.len().next_multiple_of(4), 0);
    let total = 12 + 8 + text.len() + 8 + data.len();
    let mut bytes = b"glTF".to_vec();
    for number in [2, total as u32, text.len() as u32] {
        bytes.extend(number.to_le_bytes());
    }
    bytes.extend(b"JSON");
    bytes.extend(text);
    bytes.extend((data.len() as u32).to_le_bytes());
    bytes.extend(b"BIN\0");
    bytes.extend(data);
    bytes
}

/// Parses a document as a GLB file whose binary chunk is the square's buffer, and returns the loader's
/// result.
fn read(document: &Value) -> Result<SceneSource, SourceError> {
    parse(&glb(document, &square_bytes()), Path::new("test.glb"))
}

/// Returns the square's document with the value at a JSON pointer replaced. Panics if the pointer's parent
/// does not exist.
fn with(pointer: &str, value: Value) -> Value {
    let mut document = square();
    let (parent, key) = pointer.rsplit_once('/').expect("a pointer");
    match document.pointer_mut(parent).expect("a place in the square") {
        Value::Array(items) => items[key.parse::<usize>().expect("an index")] = value,
        Value::Object(items) => drop(items.insert(key.into(), value)),
        other => panic!("{other} has no members"),
    }
    document
}

/// Returns the point (x, y, 0).
fn p(x: f32, y: f32) -> Vec3 {
    Vec3::new(x, y, 0.0)
}

#[test]
fn extras_of_nodes_are_hints() {
    let hinted = |hint: Value| read(&with("/nodes/1/extras", json!({"visibility": hint, "other": [1]})));
    let of = |hint: &str| {
        let object = &hinted(hint.into()).expect("a good file").objects[0];
        (object.opaque, object.door, object.never_cull)
    };
    for (hint, flags) in [
        ("occluder", (true, false, false)),
        ("detail", (false, false, false)),
        ("door", (true, true, false)),
        ("mover", (false, false, true)),
        ("never-cull", (true, false, true)),
    ] {
        assert_eq!(of(hint), flags, "opaque, door and never culled by the hint `{hint}`");
    }
    assert_eq!(of("moover"), (false, false, false), "an unknown word makes the object hide nothing");
    for value in [json!(3), json!(false), json!(["glass"])] {
        let scene = hinted(value.clone()).expect("a good file");
        assert!(!scene.objects[0].opaque, "{value}, which is no text, makes the object hide nothing");
        let note = format!("`{value}` is none of occluder");
        assert!(scene.notes.iter().any(|line| line.contains(&note)), "a note on {value}: {:?}", scene.notes);
    }
    // Extras of other programs are ignored.
    for other in [json!(5), json!(null), json!(["visibility"]), json!({"visible": false})] {
        assert!(read(&with("/nodes/1/extras", other)).is_ok(), "extras of other tools are ignored");
    }
}

#[test]
fn extras_of_groups_are_hints_for_the_meshes_below() {
    let read_with = |group: &str, own: Option<&str>| {
        let mut document = with("/nodes/0/extras", json!({"visibility": group}));
        if let Some(own) = own {
            document["nodes"][1]["extras"] = json!({"visibility": own});
        }
        read(&document)
    };
    let of = |group: &str, own: Option<&str>| {
        let object = &read_with(group, own).expect("a good file").objects[0];
        (object.opaque, object.door, object.never_cull)
    };
    for (group, own, flags) in [
        ("detail", None, (false, false, false)),
        ("door", None, (true, true, false)),
        ("mover", None, (false, false, true)),
        ("never-cull", None, (true, false, true)),
        ("mover", Some("detail"), (false, false, true)),
        ("mover", Some("occluder"), (false, false, true)),
        ("door", Some("occluder"), (true, true, false)),
    ] {
        assert_eq!(of(group, own), flags, "opaque, door, never culled: group `{group}`, own hint {own:?}");
    }
    let error = read_with("occluder", None).expect_err("no hint for a group").to_string();
    assert!(error.contains("node 0") && error.contains("occluder"), "{error}");
}

#[test]
fn a_mesh_below_an_occluder_keeps_its_glass() {
    let mut document = with("/nodes/0/mesh", json!(0));
    document["nodes"][0]["extras"] = json!({"visibility": "occluder"});
    document["materials"] = json!([{"alphaMode": "BLEND"}]);
    document["meshes"][0]["primitives"][0]["material"] = json!(0);
    let objects = read(&document).expect("a good file").objects;
    let is_opaque: Vec<bool> = objects.iter().map(|object| object.opaque).collect();
    assert_eq!(is_opaque, [true, false], "opaque: the occluder, and the glass below it");
}

#[test]
fn perspective_cameras_of_nodes_are_walks() {
    let mut document = square();
    document["cameras"] = json!([
        {"type": "perspective", "name": "wide", "perspective": {"yfov": 1.5, "znear": 0.0002}},
        {"type": "orthographic", "orthographic": {"xmag": 1, "ymag": 1, "zfar": 1, "znear": 0}}
    ]);
    // The first camera looks along -x, since its node rotates -z to that direction.
    let half = 0.5_f64.sqrt();
    let nodes = document["nodes"].as_array_mut().expect("nodes");
    nodes.push(json!({"camera": 0, "translation": [1, 2, 3], "rotation": [0, half, 0, half]}));
    nodes.push(json!({"camera": 1}));
    nodes.push(json!({"camera": 0, "name": "in no scene"}));
    document["scenes"][0]["nodes"] = json!([0, 2, 3]);
    let scene = read(&document).expect("a good file");
    assert_eq!(scene.walks.len(), 1, "walks: perspective cameras of the scene");
    let walk = &scene.walks[0];
    assert_eq!((&walk.name[..], walk.keys.len()), ("wide", 1), "the walk's name and keys");
    assert!(
        (walk.fov_y_degrees - 1.5_f32.to_degrees()).abs() < 1e-3 && scene.near <= 0.0002,
        "field of view of {} degrees, near {}",
        walk.fov_y_degrees,
        scene.near
    );
    let (eye, ahead) = (walk.keys[0].eye, (walk.keys[0].target - walk.keys[0].eye).normalize());
    assert!(eye.distance(DVec3::new(1.0, 2.0, 3.0)) < 1e-9 && ahead.distance(-DVec3::X) < 1e-9, "{ahead}");
    assert!(walk.up.distance(Vec3::Y) < 1e-6, "the walk's axis up is {}", walk.up);
    assert_eq!(
        scene.notes,
        ["not read: 2 cameras", "walks are the cameras of the file: 1"],
        "notes on cameras: one is orthographic, and one in no scene"
    );
    let mut without = scene;
    without.drop_walks();
    assert_eq!(
        (without.walks.len(), &without.notes[..]),
        (0, &["not read: 2 cameras".to_owned()][..]),
        "no walks"
    );
}

#[test]
fn nodes_place_strips_fans_and_lists() {
    let scene = read(&square()).expect("a good file");
    assert_eq!(scene.up, Vec3::Y, "the axis up");
    assert_eq!(scene.objects.len(), 1, "objects");
    assert_eq!(scene.objects[0].name.to_string(), "tile", "the object's name is the node's");
    let strip = [[p(10.0, 0.0), p(12.0, 0.0), p(10.0, 2.0)], [p(12.0, 0.0), p(12.0, 2.0), p(10.0, 2.0)]];
    assert_eq!(scene.objects[0].triangles, strip.into(), "triangles of a strip");
    assert!(scene.walks.is_empty() && scene.near > 0.0, "without cameras there is no walk, but a near plane");

    let triangles = |pointer, value| read(&with(pointer, value)).expect(pointer).triangle_count();
    assert_eq!(triangles("/meshes/0/primitives/0/mode", json!(6)), 2, "triangles of a fan");
    assert_eq!(triangles("/meshes/0/primitives/0/mode", json!(4)), 1, "triangles of a list");
    assert_eq!(triangles("/meshes/0/primitives/0/mode", json!(1)), 0, "triangles of lines");
    // Without indices, consecutive vertices make triangles.
    let bare = json!({"attributes": {"POSITION": 0}, "mode": 5});
    assert_eq!(triangles("/meshes/0/primitives/0", bare), 2, "triangles of a strip without indices");
    // Two nodes with the same mesh make two objects.
    let twice = json!([{"mesh": 0}, {"mesh": 0}]);
    let mut document = with("/nodes", twice);
    document["scenes"] = json!([{"nodes": [0, 1]}]);
    assert_eq!(read(&document).expect("instances").objects.len(), 2, "objects: two nodes with one mesh");
    // Without scenes, the nodes without a parent are the roots.
    let mut document = square();
    let members = document.as_object_mut().expect("an object");
    members.remove("scene");
    members.remove("scenes");
    assert_eq!(
        read(&document).expect("no scenes").objects[0].triangles,
        strip.into(),
        "triangles of a file without scenes"
    );
}

#[test]
fn a_mirrored_node_keeps_its_fronts_in_front() {
    let document = with("/nodes/1/scale", json!([-2.0, 2.0, 2.0]));
    let scene = read(&document).expect("a good file");
    for [a, b, c] in &scene.objects[0].triangles {
        assert!((b - a).cross(c - a).z > 0.0, "{a} {b} {c} faces away");
    }
    assert!(
        scene.objects[0].triangles.view().get(0).unwrap().contains(&p(8.0, 0.0)),
        "a corner of the mirrored node"
    );
}

#[test]
fn blended_and_masked_materials_are_not_opaque() {
    for (mode, opaque) in [("OPAQUE", true), ("MASK", false), ("BLEND", false)] {
        let mut document = with("/meshes/0/primitives/0/material", json!(0));
        document["materials"] = json!([{"alphaMode": mode}]);
        assert_eq!(read(&document).expect(mode).objects[0].opaque, opaque, "{mode}");
    }
}

#[test]
fn buffers_come_from_data_uris_and_files_beside() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("gltf_beside");
    std::fs::create_dir_all(&folder).expect("a folder for test files");
    std::fs::write(folder.join("my square.bin"), square_bytes()).expect("a test file");
    let path = folder.join("square.gltf");
    let read = |uri: &str| {
        let document = with("/buffers/0/uri", json!(uri));
        parse(document.to_string().as_bytes(), &path)
    };
    let beside = read("my%20square.bin").expect("a file beside");
    assert_eq!(beside.triangle_count(), 2, "triangles of a buffer in a file beside");
    assert_eq!(beside.name, "square", "the scene's name is the file's");

    // Eighty base64 digits encode sixty zero bytes.
    let zeros = format!("data:application/octet-stream;base64,{}", "A".repeat(80));
    assert_eq!(read(&zeros).expect("a data URI").triangle_count(), 2, "triangles of a buffer in the text");

    for (uri, part) in [
        ("nowhere.bin", "buffer 0: cannot read"),
        ("../gltf_beside/my square.bin", "is not opened"),
        ("/etc/passwd", "is not opened"),
        ("file:///etc/passwd", "is not opened"),
        ("https://example.org/x.bin", "is not opened"),
        ("data:text/plain,hello", "not in base64"),
        ("data:;base64,AAAA", "56 bytes are claimed, 3 are there"),
        ("data:;base64,A*AA", "not base64"),
        ("data:", "no comma"),
    ] {
        let message = read(uri).expect_err(uri).to_string();
        assert!(message.contains(part), "{uri}: {message}");
    }
}

#[test]
fn a_file_that_many_buffers_name_is_in_memory_once() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("gltf_many_buffers");
    std::fs::create_dir_all(&folder).expect("a folder for test files");
    let mut bytes = square_bytes();
    bytes.resize(200_000, 0);
    std::fs::write(folder.join("square.bin"), &bytes).expect("a test file");
    let mut document = square();
    let buffer = |i: usize| {
        let uri = ["square.bin", "./square.bin", "s%71uare.bin", "a/../square.bin"][i % 4];
        json!({"uri": uri, "byteLength": if i.is_multiple_of(2) { 200_000 } else { 56 }})
    };
    document["buffers"] = (0..40).map(buffer).collect();
    let text = document.to_string();
    let before = LIVE.get();
    PEAK.set(before);
    let scene = parse(text.as_bytes(), &folder.join("square.gltf")).expect("a file beside");
    let peak = PEAK.get() - before;
    assert!(peak < 200_000 + 100 * text.len() as isize, "{peak} bytes at once");
    assert_eq!(scene.triangle_count(), 2, "triangles of the first buffer");
}

/// Returns animations with one channel.
fn animation(node: usize, path: &str) -> Value {
    let channel = json!({"sampler": 0, "target": {"node": node, "path": path}});
    json!([{"channels": [channel], "samplers": [{"input": 1, "output": 0}]}])
}

#[test]
fn hostile_documents_are_explained() {
    let big = json!(u64::MAX);
    let wrong = [
        ("/accessors/0/count", json!(5), "accessor 0: it reaches beyond"),
        ("/accessors/0/count", json!(100_000_000), "accessor 0: it reaches beyond"),
        ("/accessors/0/count", big.clone(), "accessor 0: it reaches beyond"),
        ("/accessors/0/byteOffset", big.clone(), "accessor 0: it reaches beyond"),
        ("/accessors/1/count", json!(5), "accessor 1: it reaches beyond"),
        ("/accessors/1/componentType", json!(5126), "indices must be"),
        ("/accessors/0/type", json!("VEC2"), "vectors of 3"),
        ("/accessors/0/bufferView", json!(9), "bufferView"),
        ("/bufferViews/0/byteOffset", json!(1_000_000), "buffer view 0"),
        ("/bufferViews/0/byteOffset", big.clone(), "buffer view 0"),
        ("/bufferViews/0/byteLength", big.clone(), "buffer view 0"),
        ("/bufferViews/0/byteStride", json!(4), "stride"),
        ("/buffers/0/byteLength", big, "bytes are claimed"),
        ("/buffers", json!([]), "buffer"),
        ("/meshes/0/primitives/0/attributes", json!({"POSITION": 7}), "no accessor"),
        ("/meshes/0/primitives/0/indices", json!(7), "indices"),
        ("/meshes/0/primitives/0/mode", json!(99), "mode"),
        ("/nodes/1/mesh", json!(3), "mesh"),
        ("/nodes/1/children", json!([0]), "reached twice"),
        ("/nodes/1/children", json!([1]), "reached twice"),
        ("/nodes/1/children", json!([8]), "children"),
        ("/nodes/0/children", json!([1, 1]), "reached twice"),
        ("/scenes/0/nodes", json!([0, 1]), "reached twice"),
        ("/scene", json!(4), "scene"),
        ("/nodes/1/mesh", json!(1u64 << 32), "beyond all indices"),
        ("/scenes/0/nodes/0", json!(1u64 << 32), "beyond all indices"),
        ("/meshes/0/primitives/0/attributes/POSITION", json!(1u64 << 32), "beyond all indices"),
        ("/accessors/0/componentType", json!((1u64 << 32) + 5126), "beyond all indices"),
        ("/animations", animation(9, "scale"), "target.node"),
        ("/animations", animation(1, "size"), "target.path"),
        ("/asset/version", json!("1.0"), "version"),
    ];
    let mut failures = Vec::new();
    for (pointer, value, part) in wrong {
        match read(&with(pointer, value.clone())) {
            Ok(_) => failures.push(format!("{pointer} = {value} was read")),
            Err(error) => {
                let message = error.to_string();
                if !message.starts_with("test.glb: ") || !message.contains(part) {
                    failures.push(format!("{pointer} = {value}: {message}"));
                }
            }
        }
    }
    assert!(failures.is_empty(), "{failures:#?}");
}

#[test]
fn an_index_beyond_the_vertices_is_an_error() {
    let mut data = square_bytes();
    data[48] = 4;
    let message =
        parse(&glb(&square(), &data), Path::new("test.glb")).expect_err("index 4 of 4 vertices").to_string();
    assert!(message.contains("index 4 is beyond its 4 vertices"), "{message}");
}

#[test]
fn deep_hierarchies_do_not_overflow_the_stack() {
    const DEPTH: usize = 200_000;
    let mut nodes: Vec<Value> = (1..DEPTH).map(|next| json!({"children": [next]})).collect();
    nodes.push(json!({"mesh": 0}));
    let scene = read(&with("/nodes", json!(nodes))).expect("deep, but a tree");
    assert_eq!(scene.objects.len(), 1, "objects of a deep tree");
}

#[test]
fn many_copies_of_a_large_mesh_are_refused_early() {
    // Twenty thousand nodes with sixty thousand vertices each read 1.2e9 vertices in total.
    let vertices = 60_000;
    let mut document = square();
    document["buffers"] = json!([{"byteLength": vertices * 12}]);
    document["bufferViews"] = json!([{"buffer": 0, "byteLength": vertices * 12}]);
    document["accessors"][0]["count"] = json!(vertices);
    document["accessors"].as_array_mut().expect("a list").pop();
    // Because of the morph targets, nodes cannot share vertices, so each node reads its own.
    let morphed = json!({"attributes": {"POSITION": 0}, "targets": [{"POSITION": 0}], "mode": 0});
    document["meshes"] = json!([{"primitives": [morphed]}]);
    document["nodes"] = json!(vec![json!({"mesh": 0}); 20_000]);
    document["scenes"] = json!([{"nodes": (0..20_000).collect::<Vec<_>>()}]);
    let bytes = glb(&document, &vec![0; vertices * 12]);
    let message = parse(&bytes, Path::new("test.glb")).expect_err("too much").to_string();
    assert!(message.contains("would have to be read"), "{message}");
}

#[test]
fn cut_and_lying_glb_headers_are_errors() {
    let bytes = glb(&square(), &square_bytes());
    for length in 0..bytes.len() {
        assert!(parse(&bytes[..length], Path::new("test.glb")).is_err(), "{length}");
    }
    for length in [0, 11, 13, u32::MAX] {
        let mut lying = bytes.clone();
        lying[8..12].copy_from_slice(&u32::to_le_bytes(length));
        let _ = parse(&lying, Path::new("test.glb"));
    }
}

proptest! {
    #[test]
    fn mutated_bytes_are_read_or_refused(
        changes in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..12),
    ) {
        let mut bytes = glb(&square(), &square_bytes());
        for (at, value) in changes {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        let _ = parse(&bytes, Path::new("test.glb"));
    }

    #[test]
    fn changed_numbers_are_read_or_refused(
        digits in proptest::collection::vec((any::<prop::sample::Index>(), b'0'..=b'9'), 1..6),
    ) {
        // Only digits change, so that the JSON stays well-formed and the loader's own checks are reached.
        let mut text = square().to_string().into_bytes();
        let places: Vec<_> = (0..text.len()).filter(|&i| text[i].is_ascii_digit()).collect();
        for (at, digit) in digits {
            text[*at.get(&places)] = digit;
        }
        if let Ok(document) = serde_json::from_slice::<Value>(&text) {
            let _ = parse(&glb(&document, &square_bytes()), Path::new("test.glb"));
        }
    }
}
