//! Tests of how the loader reads a file: extensions, accessors, instances, and missing or invalid content.

use super::{CORNERS, FLOAT, File, points, rectangle, triangle};
use glam::Vec3;
use serde_json::json;
use std::path::Path;
use visibility_examples::gltf_file::parse;
use visibility_examples::{load, load_walks};

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
    file.node(json!({"camera": 0}));
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
    // Zeros take no bytes of the file, so their number must be limited.
    file.root["accessors"][0] = json!({"componentType": FLOAT, "type": "VEC3", "count": 2_000_000});
    assert!(
        file.read().expect_err("many zeros").to_string().contains("without a buffer view"),
        "too many zeros without a view"
    );
}

/// A renderer takes the greatest index of a type for the end of a strip, whatever the number of vertices.
#[test]
fn the_greatest_index_of_a_type_is_no_vertex() {
    for (component, greatest) in [(5121, 255_u32), (5123, 65535)] {
        let mut file = File::new();
        let mesh = file.mesh(&vec![[1.0, 2.0, 3.0]; greatest as usize + 1]);
        file.node(json!({"mesh": mesh}));
        let size = if component == 5121 { 1 } else { 2 };
        let list = |last: u32| [0, 1, last].map(|index| index.to_le_bytes()[..size].to_vec()).concat();
        for (last, is_read) in [(greatest - 1, true), (greatest, false)] {
            let indices = file.accessor(&list(last), component, "SCALAR", 3);
            file.root["meshes"][0]["primitives"][0]["indices"] = json!(indices);
            assert_eq!(file.read().is_ok(), is_read, "index {last} of type {component}");
        }
    }
}

#[test]
fn draco_is_named_with_what_to_run() {
    let mut file = triangle();
    let extension = json!({"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0}}});
    file.root["meshes"][0]["primitives"][0]["extensions"] = extension;
    file.root["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]);
    // Uncompressed positions are read even beside a compressed form.
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
        // Bytes cut anywhere, except at the end of the text chunk with a matching length, are an error.
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
    // Two rotations as normalized bytes: none, and a quarter turn about z.
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
fn instances_have_the_number_of_any_attribute() {
    let mut file = triangle();
    let ids = file.floats(&[[1.0], [2.0], [3.0]]);
    let attributes = json!({"_ID": ids});
    file.root["nodes"][0]["extensions"] = json!({"EXT_mesh_gpu_instancing": {"attributes": attributes}});
    let names: Vec<String> = file.scene().objects.iter().map(|object| object.name.to_string()).collect();
    assert_eq!(names, ["it[0]", "it[1]", "it[2]"], "copies by an attribute that does not place them");
    let places = file.floats(&[[0.0; 3]; 2]);
    file.root["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["TRANSLATION"] =
        json!(places);
    let error = file.read().expect_err("three of one, two of another").to_string();
    assert!(error.contains("differ in number"), "{error}");
}

#[test]
#[ignore = "seconds, and a minute without optimization"]
fn copies_without_end_are_refused() {
    // Two hundred nodes with a million copies each, whose transforms are zeros without bytes in the file.
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

#[test]
fn whole_numbers_may_be_written_with_fractions() {
    let mut file = triangle();
    let places = file.floats(&[[0.0, 0.0, 0.0], [3.0, 0.0, 0.0]]);
    let instances = |index| json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": index}}});
    file.root["nodes"][0] = json!({"mesh": 0.0, "extensions": instances(json!(places as f64))});
    file.root["accessors"][0]["count"] = json!(3.0);
    file.root["materials"] = json!([{}, {"alphaMode": "BLEND"}]);
    let primitive = &mut file.root["meshes"][0]["primitives"][0];
    primitive["material"] = json!(0);
    primitive["extensions"] =
        json!({"KHR_materials_variants": {"mappings": [{"material": 1.0, "variants": [0]}]}});
    let scene = file.scene();
    assert_eq!(scene.objects.len(), 2, "instances");
    assert!(scene.objects[0].see_through, "the variant of the material is see-through");
    for wrong in [json!(places as f64 + 0.5), json!("0"), json!(-1), json!(77)] {
        file.root["nodes"][0]["extensions"] = instances(wrong.clone());
        let error = file.read().expect_err("no index").to_string();
        assert!(error.contains("TRANSLATION of its instances is no accessor"), "{wrong}: {error}");
    }
}

#[test]
fn a_sparse_morph_target_may_have_as_many_zeros_as_there_are_positions() {
    const COUNT: usize = (1 << 20) + 1;
    let mut file = File::new();
    let mut bytes = vec![0; 3 * COUNT];
    (bytes[3], bytes[7]) = (1, 1);
    let positions = file.accessor(&bytes, 5120, "VEC3", COUNT);
    let indices = file.accessor(&[0, 1, 2], 5121, "SCALAR", 3);
    let [place, value] = [file.view(&[1]), file.view(&[2, 0, 0])];
    let sparse = json!({
        "count": 1, "indices": {"bufferView": place, "componentType": 5121}, "values": {"bufferView": value}
    });
    let zeros = json!({"componentType": 5120, "type": "VEC3", "count": COUNT, "sparse": sparse});
    let target = file.push("accessors", zeros);
    let attributes = json!({"POSITION": positions});
    let primitive = json!({"attributes": attributes, "indices": indices, "targets": [{"POSITION": target}]});
    let mesh = file.push("meshes", json!({"primitives": [primitive], "weights": [1]}));
    file.node(json!({"mesh": mesh}));
    assert_eq!(
        points(&file.scene()),
        [[0.0; 3], [3.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        "the second corner is displaced"
    );
    file.root["accessors"][target]["count"] = json!(COUNT + 1);
    let error = file.read().expect_err("one displacement too many").to_string();
    assert!(error.contains("morph target 0 has 1048578 positions, the primitive 1048577"), "{error}");
}

#[test]
fn words_of_other_tools_hide_nothing() {
    let mut file = triangle();
    file.root["nodes"][0]["extras"] = json!({"visibility": "visible"});
    let scene = file.scene();
    let word = "its extra `visibility` makes it hide nothing: `visible` is none of occluder, detail, door, mover \
                and never-cull";
    assert_eq!(scene.notes, [format!("node 0: {word}")], "the note on a word");
    assert!(!scene.objects[0].opaque, "what an unknown word means may not hide anything");
    file.node(json!({"mesh": 0, "extras": {"visibility": "hidden"}}));
    assert_eq!(file.scene().notes, [format!("node 0: {word}; 1 more like it")], "the note on two words");
}

#[test]
fn only_a_pointer_at_its_visibility_shows_a_hidden_node() {
    for (end, is_read) in [("translation", false), ("extensions/KHR_node_visibility/visible", true)] {
        let mut file = triangle();
        file.node(json!({"mesh": 0, "extensions": {"KHR_node_visibility": {"visible": false}}}));
        let values = file.floats(&[[0.0; 3]; 2]);
        file.clip(1, "translation", &[0.0, 1.0], values, "STEP");
        let pointer = json!({"KHR_animation_pointer": {"pointer": format!("/nodes/1/{end}")}});
        file.root["animations"][0]["channels"][0]["target"] =
            json!({"path": "pointer", "extensions": pointer});
        assert_eq!(file.scene().objects.len(), 1 + usize::from(is_read), "objects with a pointer at {end}");
    }
}
