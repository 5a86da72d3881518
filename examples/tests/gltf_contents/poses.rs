//! Tests of moving objects in glTF files: bounds over all poses of skins, animations and morph targets.

use super::{CORNERS, File, door, points, reported, triangle};
use glam::{DQuat, DVec3, Quat, Vec3};
use proptest::prelude::*;
use serde_json::json;
use std::path::Path;
use visibility_examples::gltf_file::parse;
use visibility_examples::pvs::built::polygons;
use visibility_examples::walkthrough::{World, auto::advise};
use visibility_examples::{CameraKey, Hint, SourceObject, Walk};
use visibility_testing::allocations::{LIVE, PEAK};

/// Returns a file with a triangle skinned to two joints. The first two corners follow the first joint only,
/// and the third corner follows both joints equally. The node of the mesh itself is elsewhere.
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
    // The third corner (0, 2, 0) becomes (10, 2, 0) by the first joint, and 2 (1, 2, 0) + (0, 4, 0) = (2, 8,
    // 0) by the second.
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

#[test]
fn what_a_clip_moves_hides_nothing_and_is_seen_wherever_it_goes() {
    let mut file = door();
    assert_bounds(&file, [[-2.0, -2.0, 0.0], [2.0, 7.0, 0.0]]);
    let ahead = |file: &File| reported(file.scene(), "hzb", DVec3::new(0.0, 0.0, 2.0), DVec3::ZERO);
    assert_eq!(ahead(&file), [0, 1], "objects seen behind the moving door");
    let mut hinted = file.scene();
    hinted.objects[0].take(Hint::Occluder);
    assert_eq!(polygons(&hinted).0.len(), 2, "triangles of walls of cells: the box, and not the moving door");
    // A camera above the closed door that looks up could only see the open door.
    let above =
        |file: &File| reported(file.scene(), "frustum", DVec3::new(0.0, 4.0, 2.0), DVec3::new(0.0, 9.0, 0.0));
    assert_eq!(above(&file), [0], "objects seen from above, looking up");
    assert_eq!(file.scene().notes.len(), 1, "notes of a file with a clip");
    // A clip that keeps the door in its rest pose does not make it a moving object.
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
    // A node that `KHR_animation_pointer` moves may be anywhere, so its object is never culled.
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
    // Hinges rotate from -60 to 60 degrees about y. A point on the hinge's x axis is farthest along x in the
    // middle.
    let ends = [-60.0f32, 60.0].map(|degrees| Quat::from_rotation_y(degrees.to_radians()).to_array());
    let leaf = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.5, 0.0]];
    // Cases: a leaf, an arm with a leaf at its end, and an arm with a leaf that rotates as well.
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
    // A cubic spline that leaves its first key and returns: it is 8 (t^3 - 2 t^2 + t) at time t.
    let mut file = triangle();
    let still = [0.0; 3];
    let values = file.floats(&[still, still, [8.0, 0.0, 0.0], still, still, still]);
    file.clip(0, "translation", &[0.0, 1.0], values, "CUBICSPLINE");
    let (low, high) = motion(&file);
    assert!((59.0 / 27.0..2.3).contains(&high.x) && low.x > -0.1, "{low} {high}");
    // Scale and translation at the clip's only key differ from the rest pose.
    for (path, farthest) in [("scale", 3.0), ("translation", 4.0)] {
        let mut file = triangle();
        let values = file.floats(&[[3.0, 1.0, 1.0], [1.0, 1.0, 1.0], [1.0, 1.0, 1.0]]);
        file.clip(0, path, &[0.0, 1.0, 2.0], values, "LINEAR");
        let (_, high) = motion(&file);
        assert!((farthest..farthest * 1.15).contains(&high.x), "{path}: {high}");
    }
}

#[test]
fn keys_half_a_turn_apart_bound_both_arcs() {
    // In f64 the dot product of the first two rotations is -6e-9, and in f32 it is 0: they turn one way or
    // the other. The second two are exactly half a turn about z apart.
    let a = [0.023_293_352_f32, 0.046_586_704, 0.069_880_05, 0.996_194_7];
    let b = [0.266_244_23_f32, 0.532_488_47, 0.798_732_7, -0.087_155_744];
    let line = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [1.0, 0.0, 0.0]];
    for (a, b, corners) in [(a, b, CORNERS), ([0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 0.0], line)] {
        let mut file = File::new();
        let mesh = file.mesh(&corners);
        file.node(json!({"mesh": mesh, "rotation": a}));
        let values = file.floats(&[a, b]);
        file.clip(0, "rotation", &[0.0, 1.0], values, "LINEAR");
        let (low, high) = motion(&file);
        let most = 6.0; // the length of the longest edge, and what two quarter turns may add
        assert!(low.min_element() > -most && high.max_element() < most, "{low} to {high}: not far beyond");
        let [a, b] = [a, b].map(|q| DQuat::from_array(q.map(f64::from)));
        for step in 0..=100 {
            let (sin, cos) = (f64::from(step) / 100.0 * std::f64::consts::FRAC_PI_2).sin_cos();
            for (arc, b) in [("one arc", b), ("the other arc", -b)] {
                let turn = (a * cos + b * sin).normalize();
                for corner in corners {
                    let p = (turn * Vec3::from_array(corner).as_dvec3()).as_vec3();
                    let is_within = low.cmple(p + 1e-5).all() && p.cmple(high + 1e-5).all();
                    assert!(is_within, "step {step} of {arc}: {p} is not within {low} to {high}");
                }
            }
        }
    }
}

#[test]
fn keys_take_few_bytes_and_their_times_increase() {
    const KEYS: usize = 1 << 16;
    let mut file = triangle();
    let times: Vec<f32> = (0..KEYS).map(|key| key as f32).collect();
    let zeros = json!({"componentType": 5126, "count": KEYS, "type": "VEC3"});
    let values = file.push("accessors", zeros);
    let node = file.node(json!({"translation": [1, 0, 0]}));
    file.clip(node, "translation", &times, values, "LINEAR");
    for _ in 1..16 {
        let node = file.node(json!({"translation": [1, 0, 0]}));
        let channel = json!({"sampler": 0, "target": {"node": node, "path": "translation"}});
        file.root["animations"][0]["channels"].as_array_mut().expect("channels").push(channel);
    }
    let glb = file.glb();
    let before = LIVE.get();
    PEAK.set(before);
    parse(&glb, Path::new("test.glb")).expect("a valid file");
    let bytes = (PEAK.get() - before) as f64 / (16 * KEYS) as f64;
    // 20 bytes of a key of a channel, and 8 while all times of the clip are sorted.
    assert!(bytes < 40.0, "{bytes} bytes for each key of each channel");

    // Times that are not there are all 0, which is one time at most.
    let input = file.root["animations"][0]["samplers"][0]["input"].as_u64().expect("an index");
    for (count, part) in [(1, ""), (2, "the times of its keys must increase")] {
        for path in ["translation", "weights"] {
            let mut file = file.clone();
            file.root["accessors"][input as usize] =
                json!({"componentType": 5126, "count": count, "type": "SCALAR"});
            file.root["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": 0}]);
            file.root["animations"][0]["channels"][0]["target"] = json!({"node": 0, "path": path});
            if path == "weights" {
                let output = file.floats(&[[0.0]]);
                file.root["animations"][0]["samplers"][0]["output"] = json!(output);
                file.root["animations"][0]["channels"].as_array_mut().expect("channels").truncate(1);
            }
            let error = file.read().err().map(|error| error.to_string()).unwrap_or_default();
            assert!(error.contains(part) && error.is_empty() == part.is_empty(), "{count}, {path}: {error}");
        }
    }
}

#[test]
fn what_an_extension_moves_or_replaces_is_never_culled_and_hides_nothing() {
    let graph = |pointer: &str| {
        let node = json!({"configuration": {"pointer": {"value": [pointer]}}});
        json!({"KHR_interactivity": {"graphs": [{"nodes": [node]}]}})
    };
    // Extensions of the node and of the document, and whether the first and second object may change.
    for (of_node, of_document, expected) in [
        (json!({}), json!({}), [false, false]),
        (json!({"KHR_physics_rigid_bodies": {"motion": {"mass": 1}}}), json!({}), [true, false]),
        (json!({"KHR_physics_rigid_bodies": {"collider": {}}}), json!({}), [false, false]),
        (json!({"OMI_physics_body": {"motion": {"type": "dynamic"}}}), json!({}), [true, false]),
        (json!({"OMI_physics_body": {"type": "kinematic"}}), json!({}), [true, false]),
        (json!({"OMI_physics_body": {"motion": {"type": "static"}}}), json!({}), [false, false]),
        (json!({"OMI_physics_body": {"type": "static"}}), json!({}), [false, false]),
        (json!({"OMI_physics_body": {"motion": {}}}), json!({}), [true, false]),
        (json!({"OMI_physics_body": {"collider": 0}}), json!({}), [false, false]),
        (json!({"MSFT_lod": {"ids": [2]}}), json!({}), [true, false]),
        (json!({"AGI_articulations": {"articulationName": "arm"}}), json!({}), [true, false]),
        (json!({"VRMC_node_constraint": {"constraint": {}}}), json!({}), [true, false]),
        (json!({"KHR_lights_punctual": {"light": 0}, "OTHER_tool": {}}), json!({}), [true, false]),
        (json!({"KHR_lights_punctual": {"light": 0}}), json!({}), [false, false]),
        (json!({}), json!({"VRMC_springBone": {"springs": []}}), [true, true]),
        (json!({}), json!({"OTHER_tool": {}}), [false, false]),
        (json!({}), graph("/nodes/1/translation"), [false, true]),
        (json!({}), graph("/nodes/{it}/translation"), [true, true]),
        (json!({}), graph("/meshes/0/weights"), [true, false]),
        (json!({}), graph("/meshes/{it}/weights"), [true, true]),
        (json!({}), graph("/nodes/9/translation"), [false, false]),
    ] {
        let mut file = triangle();
        let other = file.mesh(&CORNERS);
        file.node(json!({"mesh": other}));
        file.root["nodes"][0]["extensions"] = of_node.clone();
        file.root["extensions"] = of_document.clone();
        let scene = file.scene();
        let case = format!("{of_node}, {of_document}");
        let objects = || scene.objects.iter();
        assert_eq!(objects().map(|object| object.never_cull).collect::<Vec<_>>(), expected, "{case}");
        assert_eq!(objects().map(|object| !object.opaque).collect::<Vec<_>>(), expected, "hides: {case}");
    }
    // Extensions of the first mesh, its primitive, and the accessor of its positions.
    for (place, extension, expected) in [
        ("/meshes/0", "OTHER_tool", true),
        ("/meshes/0", "KHR_xmp_json_ld", false),
        ("/meshes/0/primitives/0", "OTHER_tool", true),
        ("/meshes/0/primitives/0", "EXT_mesh_features", false),
        ("/accessors/0", "MPEG_accessor_timed", true),
    ] {
        let mut file = triangle();
        file.root.pointer_mut(place).expect("a part")["extensions"] = json!({extension: {}});
        let scene = file.scene();
        let SourceObject { never_cull, opaque, .. } = scene.objects[0];
        assert_eq!((never_cull, opaque), (expected, !expected), "{extension} of {place}");
    }
    // A graph may also show what is hidden, and make a material transparent.
    let mut file = triangle();
    file.root["nodes"][0]["extensions"] = json!({"KHR_node_visibility": {"visible": false}});
    file.root["materials"] = json!([{}]);
    file.root["meshes"][0]["primitives"][0]["material"] = json!(0);
    assert_eq!(file.scene().objects.len(), 0, "a hidden node");
    for node in ["0", "{it}"] {
        file.root["extensions"] = graph(&format!("/nodes/{node}/extensions/KHR_node_visibility/visible"));
        assert_eq!(file.scene().objects.len(), 1, "a node that a graph may show, by {node}");
    }
    file.root["nodes"][0]["extensions"] = json!({});
    let factor = "extensions/KHR_materials_transmission/transmissionFactor";
    for material in ["0", "{it}"] {
        file.root["extensions"] = graph(&format!("/materials/{material}/{factor}"));
        assert!(file.scene().objects[0].see_through, "a material that a graph changes, by {material}");
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

#[test]
fn weights_that_clips_hold_may_be_any_from_0_to_1() {
    let mut file = triangle();
    let up = file.floats(&[[0.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 0.0]]);
    let back = file.floats(&[[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, -1.0]]);
    file.root["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": up}, {"POSITION": back}]);
    // A channel has values of both targets, though it changes the first alone.
    for (held, depth) in [(0.0, -1.0), (0.5, -1.0), (2.0, -2.0)] {
        let mut file = file.clone();
        let weights = file.floats(&[[0.0], [held], [1.0], [held]]);
        file.clip(0, "weights", &[0.0, 1.0], weights, "LINEAR");
        assert_bounds(&file, [[0.0, 0.0, depth], [1.0, 3.0, 0.0]]);
    }
    // Two clips that hold different values change the weight from one to the other.
    for held in [0.25, 0.5] {
        let weights = file.floats(&[[0.0], [held], [1.0], [held]]);
        file.clip(0, "weights", &[0.0, 1.0], weights, "LINEAR");
    }
    assert_bounds(&file, [[0.0, 0.0, -0.5], [1.0, 3.0, 0.0]]);
}

#[test]
fn weights_that_a_pointer_moves_may_be_any() {
    let mut file = triangle();
    let up = file.floats(&[[0.0, 3.0, 0.0]; 3]);
    file.root["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": up}]);
    let weights = file.floats(&[[0.0], [3.0]]);
    file.clip(0, "weights", &[0.0, 1.0], weights, "LINEAR");
    let mut skinned_file = skinned();
    let up = skinned_file.floats(&[[0.0, 3.0, 0.0]; 3]);
    skinned_file.root["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": up}]);
    skinned_file.root["animations"] = file.root["animations"].clone();
    for (name, mut file) in [("plain", file), ("skinned", skinned_file)] {
        let other = file.mesh(&CORNERS);
        file.node(json!({"mesh": other}));
        for pointer in ["/meshes/0/weights", "/meshes/0/weights/0", "/nodes/0/weights"] {
            let extensions = json!({"KHR_animation_pointer": {"pointer": pointer}});
            file.root["animations"][0]["channels"][0]["target"] =
                json!({"path": "pointer", "extensions": extensions});
            let is_unculled: Vec<bool> =
                file.scene().objects.iter().map(|object| object.never_cull).collect();
            assert_eq!(is_unculled, [true, false], "{name}: never culled, the mesh that `{pointer}` moves");
        }
    }
}

/// Returns the value of a channel at a time, by the formulas of appendix C of the glTF specification.
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
        // A chain of three nodes, each with channels for translation, rotation and scale.
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
        // The first pose is the rest pose.
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
        // The bounds may exceed the tight ones by the motion of one step, and more if cubic splines of
        // quaternions turn wildly.
        let (size, tight) = ((high - low).length(), (most - least).length());
        let is_wild = channels.iter().any(|(_, part, _, kind)| (*part, *kind) == (1, "CUBICSPLINE"));
        prop_assert!(is_wild || size <= 4.0 * tight + 0.1, "{size} for {tight}");
    }
}

/// A renderer turns an arm of 1 km in `f32`: errors of its turn are a thousand times as great at its end.
#[test]
fn poses_in_single_precision_are_within_the_bounds() {
    let turn = [0.361_030_7, -0.039_097_5, 0.858_816_3, 0.361_334_9];
    let cube = [[-0.05; 3], [0.05; 3], [0.05, -0.05, 0.05]];
    let arm = Vec3::Y * 1000.0;
    // A child at the end of an arm that a clip turns; its grandchild; a child that a clip moves to the end of
    // an arm that is turned at rest; a mesh with the arm in its bind matrix.
    for case in ["child", "grandchild", "turned at rest", "skin"] {
        let mut file = File::new();
        let mesh = file.mesh(&cube);
        let values = file.floats(&[turn]);
        match case {
            "child" => {
                file.node(json!({"children": [1]}));
                file.push("nodes", json!({"mesh": mesh, "translation": arm.to_array()}));
                file.clip(0, "rotation", &[0.0], values, "STEP");
            }
            "grandchild" => {
                file.node(json!({"children": [1]}));
                file.push("nodes", json!({"translation": arm.to_array(), "children": [2]}));
                file.push("nodes", json!({"mesh": mesh}));
                file.clip(0, "rotation", &[0.0], values, "STEP");
            }
            "turned at rest" => {
                file.node(json!({"rotation": turn, "children": [1]}));
                file.push("nodes", json!({"mesh": mesh}));
                let values = file.floats(&[arm.to_array()]);
                file.clip(1, "translation", &[0.0], values, "STEP");
            }
            _ => {
                file.node(json!({"mesh": mesh, "skin": 0}));
                file.node(json!({"rotation": turn}));
                let joints = file.accessor(&[0; 12], 5121, "VEC4", 3);
                let weights = file.floats(&[[1.0, 0.0, 0.0, 0.0]; 3]);
                let bind = file.floats(&[glam::Mat4::from_translation(arm).to_cols_array()]);
                file.root["skins"] = json!([{"joints": [1], "inverseBindMatrices": bind}]);
                let attributes = &mut file.root["meshes"][0]["primitives"][0]["attributes"];
                (attributes["JOINTS_0"], attributes["WEIGHTS_0"]) = (json!(joints), json!(weights));
            }
        }
        let (low, high) = motion(&file);
        let exact = DQuat::from_array(turn.map(f64::from)).normalize();
        for corner in cube.map(Vec3::from_array) {
            let pose = glam::Mat4::from_quat(Quat::from_array(turn)) * glam::Mat4::from_translation(arm);
            let point = pose.transform_point3(corner);
            let away = (exact * (arm + corner).as_dvec3()).distance(point.as_dvec3());
            assert!(low.cmple(point).all() && high.cmpge(point).all(), "{case}: {point} of {low} to {high}");
            assert!(away < 1e-3, "{case}: the pose is {away} m from the exact one");
        }
        // The margin is 1e-5 of the arm.
        let rest = if case == "skin" { Vec3::splat(0.2) } else { Vec3::splat(1e4) };
        assert!((high - low).cmplt(rest).all(), "{case}: not larger than need be: {low} to {high}");
    }
}

#[test]
fn each_clip_begins_at_rest() {
    // The first clip moves the parent by 10 m, the second one the child by 5 m along the same axis.
    let mut file = triangle();
    file.node(json!({"children": [0]}));
    file.root["scenes"][0]["nodes"] = json!([1]);
    for (node, by) in [(1, 10.0), (0, 5.0)] {
        let values = file.floats(&[[0.0, 0.0, 0.0], [by, 0.0, 0.0]]);
        file.clip(node, "translation", &[0.0, 1.0], values, "LINEAR");
    }
    assert_bounds(&file, [[0.0, 0.0, 0.0], [11.0, 2.0, 0.0]]);
}

#[test]
fn of_too_much_motion_it_is_said_what_is_seen_from_everywhere() {
    // Each of `clips` clips moves one of `nodes` nodes, or all nodes by their parent.
    let notes = |nodes: usize, clips: usize, moves_all: bool| {
        let mut file = triangle();
        for _ in 1..nodes {
            file.node(json!({"mesh": 0}));
        }
        file.push("nodes", json!({"children": (0..nodes).collect::<Vec<_>>()}));
        file.root["scenes"][0]["nodes"] = json!([nodes]);
        let values = file.floats(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]);
        for clip in 0..clips {
            file.clip(if moves_all { nodes } else { clip }, "translation", &[0.0, 1.0], values, "LINEAR");
        }
        let scene = file.scene();
        (scene.objects.iter().filter(|object| object.never_cull).count(), scene.notes[0].clone())
    };
    let (unbounded, note) = notes(800, 800, false);
    assert_eq!(unbounded, 0, "objects that one clip each moves have bounds");
    assert!(note.starts_with("800 of 800 objects may move") && note.ends_with("over all clips"), "{note}");
    // 520 clips of 520 nodes and as many boxes, in 32 steps each, are above 2^24.
    let (unbounded, note) = notes(520, 520, true);
    assert_eq!(unbounded, 520, "objects without bounds are never culled");
    assert!(note.ends_with("; 520 of them count as visible from everywhere"), "{note}");
}

#[test]
fn the_advisor_sees_what_moves() {
    let mut file = door();
    file.root["scenes"][0]["nodes"] = json!([0]);
    let mut scene = file.scene();
    let keys = vec![CameraKey { eye: DVec3::new(0.0, 0.0, 2.0), target: DVec3::ZERO }];
    scene.walks = vec![Walk { name: "look".into(), fov_y_degrees: 60.0, up: Vec3::Y, keys }];
    let world = World::new(scene, (64, 36), None).expect("a world");
    let advice = advise(&world, &["frustum".to_owned()], true).expect("few triangles");
    assert_eq!(
        (advice.facts.visible_objects, advice.facts.triangles),
        (1.0, 2),
        "visible objects and triangles: the door at rest"
    );
}
