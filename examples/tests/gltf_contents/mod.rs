//! Tests of what the glTF loader makes of valid files: by extensions, compression, instances, skins, clips,
//! and far from the origin. Each test makes its file, and knows the right values.

use crate::gltf_files::glb;
use glam::{DQuat, DVec3, Quat, Vec3};
use proptest::prelude::*;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use visibility_examples::gltf_file::{parse, parse_as};
use visibility_examples::walkthrough::{World, cullers, run};
use visibility_examples::{CameraKey, Reading, SceneSource, SourceError, Walk, load, load_walks};

/// File in the making: a document whose accessors are appended to one buffer.
struct File {
    root: Value,
    bytes: Vec<u8>,
}

const FLOAT: u32 = 5126;

impl File {
    /// Makes a file with a node for each of the meshes to come.
    fn new() -> Self {
        let root = json!({
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}], "nodes": [], "meshes": [],
            "accessors": [], "bufferViews": [], "buffers": [{"byteLength": 0}]
        });
        Self { root, bytes: Vec::new() }
    }

    /// Appends to a list of the document, and returns the index.
    fn push(&mut self, list: &str, item: Value) -> usize {
        let list = self.root[list].as_array_mut().expect("a list");
        list.push(item);
        list.len() - 1
    }

    /// Appends a buffer view, and returns its index.
    fn view(&mut self, bytes: &[u8]) -> usize {
        let at = self.bytes.len();
        self.bytes.extend(bytes);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.push("bufferViews", json!({"buffer": 0, "byteOffset": at, "byteLength": bytes.len()}))
    }

    /// Appends an accessor of packed elements, and returns its index.
    fn accessor(&mut self, bytes: &[u8], component: u32, kind: &str, count: usize) -> usize {
        let view = self.view(bytes);
        self.push(
            "accessors",
            json!({"bufferView": view, "componentType": component, "type": kind, "count": count}),
        )
    }

    /// Appends an accessor of floats.
    fn floats<const N: usize>(&mut self, vectors: &[[f32; N]]) -> usize {
        let kind =
            ["", "SCALAR", "VEC2", "VEC3", "VEC4", "", "", "", "", "", "", "", "", "", "", "", "MAT4"][N];
        let bytes: Vec<u8> = vectors.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
        self.accessor(&bytes, FLOAT, kind, vectors.len())
    }

    /// Appends a mesh of the triangles between points in a row, and returns its index.
    fn mesh(&mut self, points: &[[f32; 3]]) -> usize {
        let positions = self.floats(points);
        self.push("meshes", json!({"primitives": [{"attributes": {"POSITION": positions}}]}))
    }

    /// Appends a node to the scene, and returns its index.
    fn node(&mut self, node: Value) -> usize {
        let index = self.push("nodes", node);
        self.root["scenes"][0]["nodes"].as_array_mut().expect("nodes").push(json!(index));
        index
    }

    /// Appends a clip with one channel.
    fn clip(&mut self, node: usize, path: &str, times: &[f32], values: usize, interpolation: &str) {
        let times: Vec<[f32; 1]> = times.iter().map(|&time| [time]).collect();
        let input = self.floats(&times);
        let clip = json!({
            "channels": [{"sampler": 0, "target": {"node": node, "path": path}}],
            "samplers": [{"input": input, "output": values, "interpolation": interpolation}]
        });
        match self.root.get_mut("animations") {
            Some(clips) => clips.as_array_mut().expect("clips").push(clip),
            None => self.root["animations"] = json!([clip]),
        }
    }

    /// Returns the bytes of a GLB.
    fn glb(&self) -> Vec<u8> {
        let mut root = self.root.clone();
        root["buffers"][0]["byteLength"] = json!(self.bytes.len());
        glb(&root, &self.bytes)
    }

    fn read(&self) -> Result<SceneSource, SourceError> {
        parse(&self.glb(), Path::new("test.glb"))
    }

    fn scene(&self) -> SceneSource {
        self.read().expect("a valid file")
    }

    /// Writes the file into the folder of test files, and returns its path.
    fn write(&self, name: &str) -> PathBuf {
        let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
        std::fs::write(&path, self.glb()).expect("a test file");
        path
    }
}

/// Returns the corners of the triangle that most tests use.
const CORNERS: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0]];

/// Returns a file with one triangle, placed by one node.
fn triangle() -> File {
    let mut file = File::new();
    let mesh = file.mesh(&CORNERS);
    file.node(json!({"mesh": mesh, "name": "it"}));
    file
}

/// Returns the corners of two triangles of a rectangle that faces z, and the twelve triangles of a box.
fn rectangle([a, b]: [f32; 2], [c, d]: [f32; 2], z: f32) -> Vec<[f32; 3]> {
    vec![[a, c, z], [b, c, z], [b, d, z], [a, c, z], [b, d, z], [a, d, z]]
}

/// Returns the points of a scene's first object.
fn points(scene: &SceneSource) -> Vec<[f32; 3]> {
    scene.objects[0].triangles.iter().flatten().map(|p| p.to_array()).collect()
}

/// Returns the indices of the objects that a culler reports from `eye` looking at `target`.
fn reported(mut scene: SceneSource, culler: &str, eye: DVec3, target: DVec3) -> Vec<u32> {
    let keys = vec![CameraKey { eye, target }];
    scene.walks = vec![Walk { name: "look".into(), fov_y_degrees: 60.0, up: Vec3::Y, keys }];
    let world = World::new(scene, (160, 90), None).expect("a world");
    let (name, pipeline) = cullers::parse(culler, &world).expect("a culler").remove(0);
    run(name, pipeline, &world).reported[0].clone()
}

#[test]
fn extensions_that_are_required_are_let_through() {
    for name in [
        "KHR_texture_transform",
        "KHR_lights_punctual",
        "KHR_materials_unlit",
        "KHR_mesh_quantization",
        "EXT_texture_webp",
    ] {
        let mut file = triangle();
        file.root["extensionsUsed"] = json!([name]);
        file.root["extensionsRequired"] = json!([name]);
        let scene = file.scene();
        assert_eq!((points(&scene), scene.notes), (CORNERS.to_vec(), vec![]), "{name}");
    }
    let mut file = triangle();
    file.root["extensionsRequired"] = json!(["ABC_other_geometry"]);
    assert_eq!(
        file.scene().notes,
        ["not read: the extension ABC_other_geometry"],
        "the note names the extension"
    );
}

#[test]
fn pictures_and_their_buffers_may_be_missing() {
    let mut file = triangle();
    file.push("buffers", json!({"byteLength": 9, "uri": "nowhere.bin"}));
    file.push("bufferViews", json!({"buffer": 1, "byteLength": 9}));
    file.root["images"] = json!([{"bufferView": 1, "mimeType": "image/webp"}, {"uri": "nowhere.webp"}]);
    file.root["textures"] = json!([{"extensions": {"EXT_texture_webp": {"source": 1}}}, {"sampler": 77}]);
    let texture = json!({"index": 0});
    let extensions = json!({"KHR_materials_volume": {"thicknessTexture": texture}});
    let rough = json!({"baseColorTexture": texture});
    file.root["materials"] = json!([{"extensions": extensions, "pbrMetallicRoughness": rough}]);
    file.root["meshes"][0]["primitives"][0]["material"] = json!(0);
    assert_eq!(points(&file.scene()), CORNERS, "corners of a triangle whose pictures are missing");
}

#[test]
fn what_is_not_read_is_counted() {
    let mut file = triangle();
    let primitive = file.root["meshes"][0]["primitives"][0].clone();
    let primitives = file.root["meshes"][0]["primitives"].as_array_mut().expect("primitives");
    primitives.extend([0, 3].map(|mode| json!({"attributes": primitive["attributes"], "mode": mode})));
    primitives.push(json!({"attributes": {}}));
    file.root["cameras"] = json!([{"type": "orthographic"}]);
    file.root["extensions"] = json!({"KHR_lights_punctual": {"lights": [{}, {}]}});
    file.push("scenes", json!({"nodes": []}));
    let hidden = json!({"KHR_node_visibility": {"visible": false}});
    file.node(json!({"mesh": 0, "extensions": hidden, "children": []}));
    let scene = file.scene();
    let expected =
        "not read: 3 primitives without triangles, 1 hidden node, 1 camera, 2 lights, 1 other scene";
    assert_eq!(scene.notes, [expected], "the note counts what is not read");
    assert_eq!(scene.triangle_count(), 1, "triangles that are read");

    file.root["meshes"][0]["primitives"] = json!([{"attributes": {"POSITION": 0}, "mode": 0}]);
    let path = file.write("points.glb");
    let error = load(&path).expect_err("no triangles").to_string();
    assert!(error.contains("it has no triangles") && error.contains("1 primitive without"), "{error}");
}

#[test]
fn whole_numbers_are_positions() {
    let quantized = |bytes: Vec<u8>, component: u32, normalized: bool| {
        let mut file = File::new();
        let at = file.accessor(&bytes, component, "VEC3", 3);
        file.root["accessors"][at]["normalized"] = json!(normalized);
        let mesh = file.push("meshes", json!({"primitives": [{"attributes": {"POSITION": at}}]}));
        file.node(json!({"mesh": mesh, "scale": [2, 2, 2]}));
        points(&file.scene())
    };
    let signed = |numbers: [i16; 9]| numbers.iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<u8>>();
    let unsigned = |numbers: [u16; 9]| numbers.iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<u8>>();
    let some = signed([0, 1, -1, 32767, -32767, -32768, 300, -2, 5]);
    assert_eq!(
        quantized(some.clone(), 5122, false),
        [[0.0, 2.0, -2.0], [65534.0, -65534.0, -65536.0], [600.0, -4.0, 10.0]],
        "signed 16-bit numbers, doubled"
    );
    let fractions = quantized(some, 5122, true);
    assert_eq!(fractions[1], [2.0, -2.0, -2.0], "signed 16-bit numbers as fractions, doubled");
    assert_eq!(fractions[2][0], 2.0 * (300.0 / 32767.0), "signed 16-bit numbers as fractions, doubled");
    let some = unsigned([0, 65535, 1, 0, 0, 0, 0, 0, 0]);
    assert_eq!(
        quantized(some.clone(), 5123, true)[0],
        [0.0, 2.0, 2.0 / 65535.0],
        "unsigned 16-bit numbers as fractions, doubled"
    );
    assert_eq!(quantized(some, 5123, false)[0], [0.0, 131_070.0, 2.0], "unsigned 16-bit numbers, doubled");
    let bytes = vec![0, 127, 128, 129, 255, 1, 2, 3, 4];
    assert_eq!(
        quantized(bytes.clone(), 5120, true)[0],
        [0.0, 2.0, -2.0],
        "signed bytes as fractions, doubled"
    );
    assert_eq!(quantized(bytes.clone(), 5120, false)[1], [-254.0, -2.0, 2.0], "signed bytes, doubled");
    assert_eq!(quantized(bytes, 5121, true)[1][1], 2.0, "unsigned bytes as fractions, doubled");
}

#[test]
fn sparse_accessors_replace_elements_of_a_view_or_of_zeros() {
    let mut file = triangle();
    let indices = file.view(&[0, 2]);
    let values: Vec<u8> = [7.0, 8.0, 9.0, 4.0, 5.0, 6.0_f32].iter().flat_map(|x| x.to_le_bytes()).collect();
    let values = file.view(&values);
    file.root["accessors"][0]["sparse"] = json!({
        "count": 2, "indices": {"bufferView": indices, "componentType": 5121}, "values": {"bufferView": values}
    });
    assert_eq!(
        points(&file.scene()),
        [[7.0, 8.0, 9.0], CORNERS[1], [4.0, 5.0, 6.0]],
        "elements 0 and 2 are replaced"
    );
    file.root["accessors"][0].as_object_mut().expect("an accessor").remove("bufferView");
    assert_eq!(
        points(&file.scene()),
        [[7.0, 8.0, 9.0], [0.0; 3], [4.0, 5.0, 6.0]],
        "elements 0 and 2 replace zeros"
    );
    file.root["accessors"][0]["count"] = json!(2);
    let error = file.read().expect_err("beyond").to_string();
    assert!(error.contains("accessor 0: sparse element 2 is beyond its 2 elements"), "{error}");
    // Zeros are no bytes of the file, so there may not be any number of them.
    file.root["accessors"][0] = json!({"componentType": FLOAT, "type": "VEC3", "count": 2_000_000});
    assert!(
        file.read().expect_err("many zeros").to_string().contains("without a buffer view"),
        "too many zeros without a view"
    );
}

#[test]
fn draco_is_named_with_what_to_run() {
    let mut file = triangle();
    let extension = json!({"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0}}});
    file.root["meshes"][0]["primitives"][0]["extensions"] = extension;
    file.root["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]);
    // Positions that are there uncompressed are read.
    assert_eq!(points(&file.scene()), CORNERS, "uncompressed positions are read");
    file.root["accessors"][0].as_object_mut().expect("an accessor").remove("bufferView");
    let error = file.read().expect_err("Draco").to_string();
    assert!(error.contains("Draco") && error.contains("npx @gltf-transform/cli copy"), "{error}");
}

#[test]
fn forged_containers_hierarchies_and_keys_are_refused() {
    let file = triangle();
    let bytes = file.glb();
    let text = u32::from_le_bytes(bytes[12..16].try_into().expect("four")) as usize;
    let with_length = |length: usize| {
        let mut bytes = bytes.clone();
        bytes[8..12].copy_from_slice(&(length as u32).to_le_bytes());
        parse(&bytes, Path::new("test.glb")).map_err(|error| error.to_string())
    };
    assert!(with_length(bytes.len()).is_ok(), "the true length");
    for length in [12, 16, 20, 20 + text - 4, 20 + text, 28 + text, bytes.len() - 4, bytes.len() + 4] {
        let error = with_length(length).expect_err("another length");
        assert!(error.contains("the header claims"), "{length}: {error}");
        // The file itself may be as long as it says.
        if let Some(cut) = bytes.get(..length).filter(|_| length != 20 + text) {
            let mut cut = cut.to_vec();
            cut[8..12].copy_from_slice(&(length as u32).to_le_bytes());
            assert!(parse(&cut, Path::new("test.glb")).is_err(), "{length}");
        }
    }
    for (scenes, expected) in [(true, "node 1"), (false, "node 1")] {
        let mut file = triangle();
        file.push("nodes", json!({"children": [2]}));
        file.push("nodes", json!({"children": [1], "mesh": 0}));
        if !scenes {
            let root = file.root.as_object_mut().expect("a document");
            root.remove("scene");
            root.remove("scenes");
        }
        let error = file.read().expect_err("a cycle").to_string();
        assert!(error.contains(expected) && error.contains("must form trees"), "{error}");
    }
    let text = file.root.to_string().replacen("{", r#"{"scene": 0, "#, 1);
    let error = parse(text.as_bytes(), Path::new("test.gltf")).expect_err("a key twice").to_string();
    assert!(error.contains("`scene` is given twice"), "{error}");
}

#[cfg(unix)]
#[test]
fn pipes_are_not_waited_for() {
    for name in ["pipe.json", "pipe.glb", "pipe.vscn"] {
        let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
        let _ = std::fs::remove_file(&path);
        let made = std::process::Command::new("mkfifo").arg(&path).status().expect("mkfifo");
        assert!(made.success(), "{name}: the pipe is made");
        let error = if name.ends_with("json") {
            load_walks(&path).expect_err("a pipe").to_string()
        } else {
            load(&path).expect_err("a pipe").to_string()
        };
        assert!(error.contains("it is no ordinary file"), "{error}");
    }
}

#[test]
fn instances_are_placed_one_by_one() {
    let mut file = triangle();
    let translations = file.floats(&[[0.0, 0.0, 0.0], [10.0, 0.0, 0.0]]);
    // Two rotations: none, and a quarter turn about z, as bytes.
    let half = (127.0 * 0.5f32.sqrt()).round() as u8;
    let rotations = file.accessor(&[0, 0, 0, 127, 0, 0, half, half], 5120, "VEC4", 2);
    file.root["accessors"][rotations]["normalized"] = json!(true);
    let scales = file.floats(&[[1.0, 1.0, 1.0], [3.0, 1.0, 1.0]]);
    let attributes = json!({"TRANSLATION": translations, "ROTATION": rotations, "SCALE": scales});
    file.root["nodes"][0]["extensions"] = json!({"EXT_mesh_gpu_instancing": {"attributes": attributes}});
    file.root["nodes"][0]["translation"] = json!([0, 0, 5]);
    let scene = file.scene();
    let names: Vec<String> = scene.objects.iter().map(|object| object.name.to_string()).collect();
    assert_eq!(names, ["it[0]", "it[1]"], "names of instances");
    let is = |at: usize, expected: [[f32; 3]; 3]| {
        for (p, expected) in scene.objects[at].triangles.view().get(0).unwrap().iter().zip(expected) {
            assert!(p.distance(Vec3::from_array(expected)) < 1e-6, "{at}: {p}");
        }
    };
    is(0, [[0.0, 0.0, 5.0], [1.0, 0.0, 5.0], [0.0, 2.0, 5.0]]);
    is(1, [[10.0, 0.0, 5.0], [10.0, 3.0, 5.0], [8.0, 0.0, 5.0]]);
    let few = file.floats(&[[1.0, 1.0, 1.0]]);
    file.root["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["SCALE"] = json!(few);
    assert!(
        file.read().expect_err("1 of 2").to_string().contains("differ in number"),
        "attributes of different lengths"
    );
}

#[test]
#[ignore = "seconds, and a minute without optimization"]
fn copies_without_end_are_refused() {
    // Two hundred nodes with a million copies each, of zeros that no byte stands for.
    let mut file = triangle();
    let many = file.push("accessors", json!({"componentType": FLOAT, "type": "VEC3", "count": 1_000_000}));
    file.root["meshes"][0]["primitives"][0]["mode"] = json!(0);
    let extension = json!({"EXT_mesh_gpu_instancing": {"attributes": {"SCALE": many}}});
    for _ in 0..200 {
        file.node(json!({"mesh": 0, "extensions": extension}));
    }
    let error = file.read().expect_err("too many").to_string();
    assert!(error.contains("would have to be read"), "{error}");
}

/// Returns a file with a triangle that two joints move: the first two corners by the first alone, the third
/// half by each. The node itself is elsewhere.
fn skinned() -> File {
    let mut file = triangle();
    file.node(json!({"translation": [10, 0, 0], "name": "root joint"}));
    file.node(json!({"translation": [0, 4, 0], "scale": [2, 2, 2], "name": "tip joint"}));
    let joints = file.accessor(&[0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0], 5121, "VEC4", 3);
    let weights = file.floats(&[[1.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.25, 0.25, 0.0, 0.0]]);
    let matrix = |x: f32| [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, x, 0.0, 0.0, 1.0];
    let binds = file.floats(&[matrix(0.0), matrix(1.0)]);
    file.root["skins"] = json!([{"joints": [1, 2], "inverseBindMatrices": binds}]);
    file.root["nodes"][0]["skin"] = json!(0);
    file.root["nodes"][0]["scale"] = json!([0.1, 0.1, 0.1]);
    let attributes = &mut file.root["meshes"][0]["primitives"][0]["attributes"];
    attributes["JOINTS_0"] = json!(joints);
    attributes["WEIGHTS_0"] = json!(weights);
    file
}

#[test]
fn skins_are_placed_by_their_joints() {
    let scene = skinned().scene();
    // (0, 2, 0) by the first joint is (10, 2, 0), and by the second 2 (1, 2, 0) + (0, 4, 0) = (2, 8, 0).
    assert_eq!(
        points(&scene),
        [[10.0, 0.0, 0.0], [11.0, 0.0, 0.0], [6.0, 5.0, 0.0]],
        "corners placed by their joints"
    );
    let object = &scene.objects[0];
    assert!(!object.opaque && !object.never_cull, "a skin hides nothing, and is culled");
    let (low, high) = *object.motion.as_deref().expect("a skin moves");
    assert!(
        low.cmple(Vec3::new(6.0, 0.0, 0.0)).all() && high.cmpge(Vec3::new(11.0, 5.0, 0.0)).all(),
        "the bounds {low} to {high} hold all poses"
    );
    let mut wrong = skinned();
    wrong.root["skins"][0]["joints"] = json!([1]);
    assert!(
        wrong.read().expect_err("a joint too few").to_string().contains("joint 1 is beyond the 1"),
        "a joint that is missing"
    );
}

/// Returns the bounds over all clips of a file's first object.
fn motion(file: &File) -> (Vec3, Vec3) {
    let scene = file.scene();
    let object = &scene.objects[0];
    assert!(
        !object.opaque && !object.never_cull && object.fixed_triangles().is_empty(),
        "what moves hides nothing, and has no fixed triangles"
    );
    let bounds = object.object().bounds;
    assert!(!object.object().occluder, "what moves is no occluder");
    assert_eq!(object.motion.as_deref(), Some(&(bounds.min, bounds.max)), "bounds over all clips");
    (bounds.min, bounds.max)
}

/// Checks the bounds over all clips of a file's first object, up to a millimetre.
fn assert_bounds(file: &File, expected: [[f32; 3]; 2]) {
    let (bounds, expected) = (motion(file), expected.map(Vec3::from_array));
    let error = (bounds.0 - expected[0]).abs().max((bounds.1 - expected[1]).abs());
    assert!(error.max_element() < 1e-3, "{bounds:?}");
}

/// Returns a file with a door that slides up by 5 m, and a box behind it.
fn door() -> File {
    let mut file = File::new();
    let leaf = file.mesh(&rectangle([-2.0, 2.0], [-2.0, 2.0], 0.0));
    let behind = file.mesh(&rectangle([-0.5, 0.5], [-0.5, 0.5], -3.0));
    file.node(json!({"mesh": leaf, "name": "door", "extras": {"visibility": "occluder"}}));
    file.node(json!({"mesh": behind}));
    let values = file.floats(&[[0.0, 0.0, 0.0], [0.0, 5.0, 0.0]]);
    file.clip(0, "translation", &[0.0, 1.0], values, "LINEAR");
    file
}

#[test]
fn what_a_clip_moves_hides_nothing_and_is_seen_wherever_it_goes() {
    let mut file = door();
    assert_bounds(&file, [[-2.0, -2.0, 0.0], [2.0, 7.0, 0.0]]);
    let ahead = |file: &File| reported(file.scene(), "hzb", DVec3::new(0.0, 0.0, 2.0), DVec3::ZERO);
    assert_eq!(ahead(&file), [0, 1], "objects seen behind the moving door");
    // From above the closed door, looking up, only the open door could be seen.
    let above =
        |file: &File| reported(file.scene(), "frustum", DVec3::new(0.0, 4.0, 2.0), DVec3::new(0.0, 9.0, 0.0));
    assert_eq!(above(&file), [0], "objects seen from above, looking up");
    assert_eq!(file.scene().notes.len(), 1, "notes of a file with a clip");
    // A clip that keeps the door at rest moves nothing.
    file.root["animations"] = json!(null);
    file.root.as_object_mut().expect("a document").remove("animations");
    let values = file.floats(&[[0.0, 0.0, 0.0], [-0.0, 0.0, 0.0]]);
    file.clip(0, "translation", &[0.0, 1.0], values, "STEP");
    let turn = file.floats(&[[0.0, 0.0, 0.0, -1.0], [0.0, 0.0, 0.0, 1.0]]);
    file.clip(0, "rotation", &[0.0, 1.0], turn, "LINEAR");
    assert_eq!(
        (ahead(&file), above(&file), file.scene().notes),
        (vec![0], vec![], vec![]),
        "a clip that keeps the door at rest: seen ahead, seen above, and notes"
    );
    // A node that a pointer moves may be anywhere.
    let pointer = json!({"KHR_animation_pointer": {"pointer": "/nodes/0/translation"}});
    let target = json!({"path": "pointer", "extensions": pointer});
    file.root["animations"][0]["channels"][0]["target"] = target;
    assert!(
        file.scene().objects[0].never_cull && !file.scene().objects[0].opaque,
        "what a pointer moves is never culled, and hides nothing"
    );
    assert_eq!(ahead(&file), [0, 1], "objects seen behind what a pointer moves");
}

#[test]
fn poses_between_keys_are_within_the_bounds() {
    // Hinges turn from -60 to 60 degrees about y. What they turn reaches farthest along x in the middle.
    let ends = [-60.0f32, 60.0].map(|degrees| Quat::from_rotation_y(degrees.to_radians()).to_array());
    let leaf = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.5, 0.0]];
    // A leaf, an arm with a leaf at its end, and an arm with a leaf that turns as well.
    for (arm, turns, farthest) in [(false, 1, 1.0), (true, 1, 10.1), (true, 2, 10.1)] {
        let mut file = File::new();
        let size = if arm { 0.1 } else { 1.0 };
        let mesh = file.mesh(&leaf.map(|corner| corner.map(|x| x * size)));
        let rest = ends[0];
        if arm {
            file.node(json!({"rotation": rest, "children": [1]}));
            let own = if turns == 2 { rest } else { [0.0, 0.0, 0.0, 1.0] };
            file.push("nodes", json!({"mesh": mesh, "translation": [10, 0, 0], "rotation": own}));
        } else {
            file.node(json!({"mesh": mesh, "rotation": rest}));
        }
        let values = file.floats(&ends);
        file.clip(0, "rotation", &[0.0, 1.0], values, "LINEAR");
        if turns == 2 {
            let mut channel = file.root["animations"][0]["channels"][0].clone();
            channel["target"]["node"] = json!(1);
            file.root["animations"][0]["channels"].as_array_mut().expect("channels").push(channel);
        }
        let (_, high) = motion(&file);
        assert!((farthest..farthest * 1.15).contains(&high.x), "{arm} {turns}: {high}");
    }
    // A cubic spline leaves its first key, and comes back: its middle is at 8 (t^3 - 2 t^2 + t).
    let mut file = triangle();
    let still = [0.0; 3];
    let values = file.floats(&[still, still, [8.0, 0.0, 0.0], still, still, still]);
    file.clip(0, "translation", &[0.0, 1.0], values, "CUBICSPLINE");
    let (low, high) = motion(&file);
    assert!((59.0 / 27.0..2.3).contains(&high.x) && low.x > -0.1, "{low} {high}");
    // Sizes and places at a key that the pose at rest has not.
    for (path, farthest) in [("scale", 3.0), ("translation", 4.0)] {
        let mut file = triangle();
        let values = file.floats(&[[3.0, 1.0, 1.0], [1.0, 1.0, 1.0], [1.0, 1.0, 1.0]]);
        file.clip(0, path, &[0.0, 1.0, 2.0], values, "LINEAR");
        let (_, high) = motion(&file);
        assert!((farthest..farthest * 1.15).contains(&high.x), "{path}: {high}");
    }
}

#[test]
fn morph_targets_are_bounded_over_all_weights() {
    let mut file = triangle();
    let up = file.floats(&[[0.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 0.0]]);
    let back = file.floats(&[[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, -1.0]]);
    file.root["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": up}, {"POSITION": back}]);
    file.root["meshes"][0]["weights"] = json!([0.5, 0.0]);
    assert_eq!(
        points(&file.scene()),
        [CORNERS[0], [1.0, 1.5, 0.0], CORNERS[2]],
        "corners with half of the first target"
    );
    assert_bounds(&file, [[0.0, 0.0, -1.0], [1.0, 3.0, 0.0]]);
    let weights = file.floats(&[[0.0], [0.25], [2.0], [-1.0]]);
    file.clip(0, "weights", &[0.0, 1.0], weights, "LINEAR");
    assert_bounds(&file, [[0.0, 0.0, -0.25], [1.0, 6.0, 1.0]]);
}

/// Value of a channel at a time, by the formulas of the specification's appendix C.
fn at(times: &[f32], values: &[Vec<f64>], kind: &str, time: f64, is_rotation: bool) -> Vec<f64> {
    let cubic = kind == "CUBICSPLINE";
    let value = |key: usize| values[if cubic { 3 * key + 1 } else { key }].clone();
    let unit = |v: Vec<f64>| {
        let length = if is_rotation { v.iter().map(|x| x * x).sum::<f64>().sqrt() } else { 1.0 };
        v.into_iter().map(|x| x / length).collect::<Vec<_>>()
    };
    let last = times.len() - 1;
    if time <= f64::from(times[0]) {
        return unit(value(0));
    }
    if time >= f64::from(times[last]) {
        return unit(value(last));
    }
    let key = (0..last).find(|&key| time < f64::from(times[key + 1])).expect("between keys");
    let length = f64::from(times[key + 1]) - f64::from(times[key]);
    let t = (time - f64::from(times[key])) / length;
    let (a, b) = (value(key), value(key + 1));
    match kind {
        "STEP" => unit(a),
        "LINEAR" if is_rotation => {
            let [a, b] = [a, b].map(|q| DQuat::from_slice(&unit(q)));
            a.slerp(b, t).to_array().to_vec()
        }
        "LINEAR" => a.iter().zip(&b).map(|(a, b)| a * (1.0 - t) + b * t).collect(),
        _ => {
            let (out, into) = (&values[3 * key + 2], &values[3 * key + 3]);
            let (t2, t3) = (t * t, t * t * t);
            let mix = |i: usize| {
                (2.0 * t3 - 3.0 * t2 + 1.0) * a[i]
                    + length * (t3 - 2.0 * t2 + t) * out[i]
                    + (3.0 * t2 - 2.0 * t3) * b[i]
                    + length * (t3 - t2) * into[i]
            };
            unit((0..a.len()).map(mix).collect())
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn bounds_over_clips_hold_every_pose(
        numbers in proptest::collection::vec(-1.0f32..1.0, 400),
        kinds in proptest::collection::vec(0usize..3, 9),
        keys in 1usize..4,
        matrix in any::<bool>(),
    ) {
        // Three nodes in a row, each with channels for translation, rotation and scale.
        let mut numbers = numbers.into_iter().cycle();
        let mut next = || numbers.next().expect("numbers without end");
        let mut file = File::new();
        let mesh = file.mesh(&CORNERS);
        let root = if matrix {
            json!({"matrix": [0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 2, 0, 3, 0, 0, 1], "children": [1]})
        } else {
            json!({"children": [1], "translation": [1, 2, 3]})
        };
        file.node(root);
        file.push("nodes", json!({"children": [2]}));
        file.push("nodes", json!({"children": [3]}));
        file.push("nodes", json!({"mesh": mesh}));
        let mut channels = Vec::new();
        let times: Vec<f32> = (0..keys).map(|key| key as f32 * 0.75 + 0.25).collect();
        for (i, &kind) in kinds.iter().enumerate() {
            let (node, path) = (1 + i / 3, ["translation", "rotation", "scale"][i % 3]);
            let kind = ["LINEAR", "STEP", "CUBICSPLINE"][kind];
            let count = if kind == "CUBICSPLINE" { 3 * keys } else { keys };
            let mut values: Vec<Vec<f64>> = Vec::new();
            let output = if path == "rotation" {
                let list: Vec<[f32; 4]> = (0..count)
                    .map(|_| Quat::from_array([next(), next(), next(), next() + 1.5]).normalize().to_array())
                    .collect();
                values.extend(list.iter().map(|v| v.iter().map(|&x| f64::from(x)).collect()));
                file.floats(&list)
            } else {
                let list: Vec<[f32; 3]> = (0..count).map(|_| [next() * 2.0, next(), next() + 1.0]).collect();
                values.extend(list.iter().map(|v| v.iter().map(|&x| f64::from(x)).collect()));
                file.floats(&list)
            };
            channels.push((node, i % 3, values, kind));
            let times: Vec<[f32; 1]> = times.iter().map(|&time| [time]).collect();
            let input = file.floats(&times);
            if i == 0 {
                file.root["animations"] = json!([{"channels": [], "samplers": []}]);
            }
            let clip = &mut file.root["animations"][0];
            let target = json!({"node": node, "path": path});
            clip["channels"].as_array_mut().expect("a list").push(json!({"sampler": i, "target": target}));
            let sampler = json!({"input": input, "output": output, "interpolation": kind});
            clip["samplers"].as_array_mut().expect("a list").push(sampler);
        }
        let (low, high) = motion(&file);
        let (mut least, mut most) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        // The first pose is that at rest.
        for step in -1..=600 {
            let time = f64::from(step) * 2.5 / 600.0;
            for corner in CORNERS {
                let mut p = Vec3::from_array(corner).as_dvec3();
                for node in [3, 2, 1].into_iter().filter(|_| step >= 0) {
                    let of = |part: usize| {
                        let channel = channels.iter().find(|channel| (channel.0, channel.1) == (node, part));
                        let (.., values, kind) = channel.expect("a channel");
                        at(&times, values, kind, time, part == 1)
                    };
                    p = DQuat::from_slice(&of(1)) * (DVec3::from_slice(&of(2)) * p) + DVec3::from_slice(&of(0));
                }
                let turned = DVec3::new(3.0 - p.y, p.x, 2.0 * p.z);
                let p = if matrix { turned } else { p + DVec3::new(1.0, 2.0, 3.0) }.as_vec3();
                let is_within = low.cmple(p + 1e-5).all() && p.cmple(high + 1e-5).all();
                prop_assert!(is_within, "{p} at {time}: {low} {high}");
                (least, most) = (least.min(p), most.max(p));
            }
        }
        // The bounds are loose by the length of a step, and more where quaternions turn wildly.
        let (size, tight) = ((high - low).length(), (most - least).length());
        let is_wild = channels.iter().any(|(_, part, _, kind)| (*part, *kind) == (1, "CUBICSPLINE"));
        prop_assert!(is_wild || size <= 4.0 * tight + 0.1, "{size} for {tight}");
    }
}

/// Returns a file with a board and a box behind its edge, below a root at `x`.
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
    // Coordinates in the text are more exact than f32: 0.4 m apart at 3,900 km.
    let apart = edge(3_900_000.4).scene();
    let [a, b] = [&far, &apart]
        .map(|scene| scene.objects[0].triangles.view().get(0).unwrap()[0].as_dvec3() + scene.origin);
    assert!((b - a - DVec3::new(0.4, 0.0, 0.0)).length() < 1e-5, "{a} {b}");
    // A scene around its origin keeps it, however large.
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

/// Arguments of a program that reads a scene file.
#[derive(clap::Parser)]
struct Arguments {
    #[command(flatten)]
    reading: Reading,
}

/// Returns the scene of a box of a size, read in a way.
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
    // A house that stands, and a thing of few parts.
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
fn a_scene_without_nodes_is_empty() {
    let mut file = File::new();
    let mesh = file.mesh(&rectangle([0.0, 1.0], [0.0, 1.0], 0.0));
    file.node(json!({"mesh": mesh}));
    let scenes = file.root["scenes"].as_array_mut().expect("a list");
    scenes.push(json!({"name": "empty"}));
    assert_eq!(file.scene().triangle_count(), 2, "triangles of the first scene");
    file.root["scene"] = json!(1);
    assert_eq!(file.scene().triangle_count(), 0, "triangles of the empty scene");
}
