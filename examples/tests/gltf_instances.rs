//! Tests that instances stay instances: a mesh shown by several nodes, or several times by one node, is
//! stored once from the loader to the judge, and culling gives the same answers as with a separate mesh for
//! each node.

use crate::gltf_files::glb;
use glam::{DVec3, Vec3};
use serde_json::{Value, json};
use std::path::Path;
use visibility_core::scene::Triangle;
use visibility_examples::gltf_file::parse;
use visibility_examples::walkthrough::{Trial, World, cullers, judge, output, run};
use visibility_examples::{CameraKey, Reading, SceneSource, Walk};
use visibility_measure::ItemBuffer;
use visibility_testing::allocations::{LIVE, PEAK};

/// Document with a box without a floor: ten triangles that face outwards, drawn only from the front.
struct File {
    root: Value,
    bytes: Vec<u8>,
}

impl File {
    fn new() -> Self {
        let corner = |i: usize| [i & 1, i >> 1 & 1, i >> 2].map(|bit| bit as f32);
        let faces = [[4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let indices = faces.iter().flat_map(|&[a, b, c, d]| [a, b, c, a, c, d].map(|i: u16| i));
        let mut bytes: Vec<u8> = (0..8).flat_map(corner).flat_map(f32::to_le_bytes).collect();
        bytes.extend(indices.flat_map(u16::to_le_bytes));
        let root = json!({
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}], "nodes": [],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
            "buffers": [{}],
            "bufferViews": [
                {"buffer": 0, "byteLength": 96},
                {"buffer": 0, "byteOffset": 96, "byteLength": 60}
            ],
            "accessors": [
                {"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3"},
                {"bufferView": 1, "componentType": 5123, "count": 30, "type": "SCALAR"}
            ]
        });
        Self { root, bytes }
    }

    fn push(&mut self, list: &str, item: Value) -> usize {
        let list = self.root[list].as_array_mut().expect("a list");
        list.push(item);
        list.len() - 1
    }

    fn node(&mut self, node: Value) {
        let index = self.push("nodes", node);
        self.root["scenes"][0]["nodes"].as_array_mut().expect("nodes").push(json!(index));
    }

    /// Appends an accessor of float vectors, and returns its index.
    fn floats<const N: usize>(&mut self, vectors: &[[f32; N]]) -> usize {
        let at = self.bytes.len();
        self.bytes.extend(vectors.iter().flatten().flat_map(|x| x.to_le_bytes()));
        let view = json!({"buffer": 0, "byteOffset": at, "byteLength": self.bytes.len() - at});
        let view = self.push("bufferViews", view);
        let kind = ["", "", "", "VEC3", "VEC4"][N];
        let count = vectors.len();
        self.push(
            "accessors",
            json!({"bufferView": view, "componentType": 5126, "type": kind, "count": count}),
        )
    }

    /// Gives each node its own mesh with the same accessors.
    fn with_own_meshes(mut self) -> Self {
        for at in 0..self.root["nodes"].as_array().expect("nodes").len() {
            if let Some(mesh) = self.root["nodes"][at]["mesh"].as_u64() {
                let copy = self.root["meshes"][mesh as usize].clone();
                self.root["nodes"][at]["mesh"] = json!(self.push("meshes", copy));
            }
        }
        self
    }

    fn glb(&self) -> Vec<u8> {
        let mut root = self.root.clone();
        root["buffers"][0]["byteLength"] = json!(self.bytes.len());
        glb(&root, &self.bytes)
    }

    fn scene(&self) -> SceneSource {
        parse(&self.glb(), Path::new("test.glb")).expect("a valid file")
    }
}

/// Returns a file with nodes that place boxes around the origin: translated, rotated, stretched and mirrored,
/// below a rotated parent. With `exact`, all transforms are exact in `f32`.
fn yard(exact: bool) -> File {
    let mut file = File::new();
    let half = 0.5f64.sqrt();
    let mut children = Vec::new();
    for i in 0..300 {
        let [x, z] = [i % 20 - 10, i / 20 - 7].map(|step| f64::from(step) * 3.0);
        let turn = if exact {
            [0.0, 1.0, 0.0, 0.0]
        } else {
            [0.0, (0.1 * f64::from(i)).sin(), 0.0, (0.1 * f64::from(i)).cos()]
        };
        let sign = if i % 3 == 0 { -1.0 } else { 1.0 };
        let size = if exact { 2.0 } else { 1.0 + 0.37 * f64::from(i % 5) };
        let node = json!({
            "mesh": 0, "translation": [x, 0.0, z], "rotation": turn, "scale": [sign * 1.0, size, 0.5 * size],
        });
        children.push(json!(file.push("nodes", node)));
    }
    let turn = if exact { [0.0, 0.0, 0.0, 1.0] } else { [0.0, half, 0.0, half] };
    file.node(json!({"children": children, "rotation": turn}));
    file
}

/// Returns a scene with a walk through it.
fn with_walk(mut scene: SceneSource) -> SceneSource {
    let eyes =
        [[-28.5, 1.0, 1.7], [1.4, 0.4, 1.3], [0.4, 12.0, -20.0], [16.0, 0.7, 4.9]].map(DVec3::from_array);
    let keys = eyes.iter().map(|&eye| CameraKey { eye, target: eye * 0.1 + DVec3::Z * 0.3 }).collect();
    scene.walks = vec![Walk { name: "walk".into(), fov_y_degrees: 70.0, up: Vec3::Y, keys }];
    scene.near = 0.1;
    scene
}

#[test]
fn a_mesh_is_kept_once() {
    let mut file = File::new();
    for i in 0..500 {
        file.node(
            json!({"mesh": 0, "translation": [3 * i, 0, 0], "scale": [1.0 - 2.0 * f64::from(i % 2), 1, 1]}),
        );
    }
    let copies: Vec<[f32; 3]> = (0..700).map(|i| [3.0 * i as f32, 0.0, 9.0]).collect();
    let translations = file.floats(&copies);
    let extension = json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": translations}}});
    file.node(json!({"mesh": 0, "extensions": extension}));
    // A second mesh that only one node shows.
    let copy = file.root["meshes"][0].clone();
    let single = file.push("meshes", copy);
    file.node(json!({"mesh": single, "name": "single"}));
    let scene = file.scene();
    assert_eq!(
        (scene.objects.len(), scene.triangle_count(), scene.instances()),
        (1201, 12_010, [1200, 1]),
        "objects, triangles, instances and meshes that they share"
    );
    let first = &scene.objects[0].triangles;
    assert!(
        scene.objects[..1200].iter().all(|object| object.triangles.shares_mesh(first)),
        "instances share the first mesh"
    );
    assert!(first.mesh_memory() <= 10 * 36 + 100, "{}", first.mesh_memory());
    assert_eq!(
        scene.objects[1200].triangles.view().mesh().1,
        None,
        "the single mesh has no transform of its own"
    );
    let world = World::new(with_walk(scene), (64, 36), None).expect("a world");
    assert_eq!(world.scene.mesh_count(), 2, "occluders are prepared once");
    let shared = |index: usize| world.scene.shared_triangles(world.scene.id_at(index)?);
    assert!(
        (0..1200)
            .all(|index| shared(index).is_some_and(|triangles| triangles.shares_mesh(shared(0).unwrap()))),
        "objects of the scene share the first mesh"
    );
    let header = output::header(&world, &Reading::default());
    assert!(header.contains("1200 objects share 1 meshes"), "{header}");
}

#[test]
fn instances_are_what_nodes_with_their_own_meshes_are() {
    for exact in [true, false] {
        let [shared, own] = [yard(exact), yard(exact).with_own_meshes()].map(|file| with_walk(file.scene()));
        assert_eq!(
            (shared.instances(), own.instances()),
            ([300, 1], [0, 0]),
            "exact: {exact}: instances, with shared and with own meshes"
        );
        let triangles = |scene: &SceneSource| -> Vec<Vec<Triangle>> {
            scene.objects.iter().map(|object| object.triangles.iter().collect()).collect()
        };
        let [shared_triangles, own_triangles] = [triangles(&shared), triangles(&own)];
        assert!(!exact || shared_triangles == own_triangles, "bit for bit");
        let corners = |all: &[Vec<Triangle>]| all.iter().flatten().flatten().copied().collect::<Vec<Vec3>>();
        let moved = corners(&shared_triangles).into_iter().zip(corners(&own_triangles));
        let moved = moved.map(|(a, b)| (a - b).abs().max_element()).fold(0.0, f32::max);
        assert!(moved <= 8e-6, "{moved} m: four roundings of coordinates of up to 32 m");
        let worlds = [shared, own].map(|scene| World::new(scene, (160, 90), None).expect("a world"));
        let pictures = worlds.each_ref().map(|world| {
            let mut buffer = ItemBuffer::new(160, 90).expect("an image");
            let draw = |view| {
                buffer.draw(view, world.origin(), world.items()).expect("few triangles");
                (buffer.items().to_vec(), buffer.depth_keys().to_vec(), buffer.visible().clone())
            };
            world.views.iter().map(draw).collect::<Vec<_>>()
        });
        assert!(!exact || pictures[0] == pictures[1], "the pictures");
        for name in ["frustum", "hzb", "hzb-level", "naylor", "view-cdt", "occlusion-tree"] {
            let trials: [Trial; 2] = worlds.each_ref().map(|world| {
                let (name, pipeline) = cullers::parse(name, world).expect("a culler").remove(0);
                run(name, pipeline, world)
            });
            let counts = trials.each_ref().map(|trial| trial.reported.iter().map(Vec::len).sum::<usize>());
            if exact {
                assert_eq!(trials[0].reported, trials[1].reported, "{name}");
            }
            // Rounding moves vertices slightly, so a few answers at edges may differ.
            assert!(counts[0].abs_diff(counts[1]) <= counts[1] / 10 && counts[0] > 20, "{name}: {counts:?}");
            for (world, trial) in worlds.iter().zip(&trials) {
                let judged = judge(world, std::slice::from_ref(trial), || ()).expect("few triangles");
                assert_eq!(judged.verdicts[0].false_hidden, 0, "{name}");
            }
        }
    }
}

/// Two boxes, one of them mirrored, both open towards smaller z. Inside each is a plate whose front faces the
/// opening. From greater z, the box hides the plate; from the other side, the plate is visible through the
/// backs of the box.
#[test]
fn a_mirrored_instance_keeps_its_fronts_in_front() {
    let mut file = File::new();
    file.node(json!({"mesh": 0, "translation": [0, 0, -10]}));
    file.node(json!({"mesh": 0, "translation": [6, 0, -10], "scale": [-1, 1, 1]}));
    file.node(json!({"mesh": 0, "translation": [0.25, 0.25, -9.5], "scale": [0.5, 0.5, -0.01]}));
    let (turned, scale) = ([0, 1, 0, 0], [0.5, 0.5, 0.01]);
    file.node(json!({"mesh": 0, "translation": [5.75, 0.25, -9.5], "rotation": turned, "scale": scale}));
    let mut scene = file.scene();
    let look = |x: f64, z: f64| {
        let keys = vec![CameraKey { eye: DVec3::new(x + 0.1, 0.5, z), target: DVec3::new(x, 0.5, -10.0) }];
        Walk { name: "look".into(), fov_y_degrees: 4.0, up: Vec3::Y, keys }
    };
    scene.walks = vec![look(0.5, 5.0), look(5.5, 5.0), look(0.5, -25.0), look(5.5, -25.0)];
    let world = World::new(scene, (90, 90), None).expect("a world");
    let trials: Vec<Trial> = cullers::parse("hzb,hzb-level,naylor", &world)
        .expect("cullers")
        .into_iter()
        .map(|(name, pipeline)| run(name, pipeline, &world))
        .collect();
    let judged = judge(&world, &trials, || ()).expect("few triangles");
    assert_eq!(judged.exact, [[0], [1], [2], [3]], "objects visible by frame");
    for verdict in &judged.verdicts {
        assert_eq!(verdict.false_hidden, 0, "false hidden objects: {verdict:?}");
    }
    assert_eq!(trials[2].reported, judged.exact, "Naylor's tree is exact");
}

#[test]
fn deformed_meshes_are_not_shared() {
    let mut file = File::new();
    let lift = file.floats(&[[0.0, 4.0, 0.0]; 8]);
    file.root["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": lift}]);
    file.node(json!({"mesh": 0, "weights": [0.0]}));
    file.node(json!({"mesh": 0, "weights": [1.0]}));
    let scene = file.scene();
    assert_eq!(scene.instances(), [0, 0], "deformed meshes are not shared");
    let low = |at: usize| scene.objects[at].triangles.bounds().min.y;
    assert_eq!([low(0), low(1)], [0.0, 4.0], "lower sides of a mesh with and without its target");

    // One mesh with joints, shown by one node with a skin and by two without.
    let mut file = File::new();
    let weights = file.floats(&[[1.0, 0.0, 0.0, 0.0]; 8]);
    let at = file.bytes.len();
    file.bytes.extend([0; 32]);
    let view = file.push("bufferViews", json!({"buffer": 0, "byteOffset": at, "byteLength": 32}));
    let joints = json!({"bufferView": view, "componentType": 5121, "type": "VEC4", "count": 8});
    let joints = file.push("accessors", joints);
    let attributes = &mut file.root["meshes"][0]["primitives"][0]["attributes"];
    attributes["JOINTS_0"] = json!(joints);
    attributes["WEIGHTS_0"] = json!(weights);
    file.root["skins"] = json!([{"joints": [3]}]);
    file.node(json!({"mesh": 0, "skin": 0}));
    file.node(json!({"mesh": 0, "translation": [10, 0, 0]}));
    file.node(json!({"mesh": 0, "translation": [20, 0, 0]}));
    file.node(json!({"translation": [0, 7, 0]}));
    let scene = file.scene();
    assert_eq!(scene.instances(), [2, 1], "two of three nodes share a mesh with joints");
    let low = |at: usize| scene.objects[at].triangles.bounds().min;
    assert_eq!(
        [low(0), low(1), low(2)],
        [Vec3::Y * 7.0, Vec3::X * 10.0, Vec3::X * 20.0],
        "lower corners of the skin and of two instances"
    );
    assert!(!scene.objects[0].triangles.shares_mesh(&scene.objects[1].triangles), "the skin shares no mesh");
}

#[test]
fn limits_are_of_what_is_kept() {
    // 40,000 instances with 44 million triangles in total: more than the memory limit for distinct
    // triangles, in a file of half a megabyte.
    let mut file = File::new();
    let corners: Vec<[f32; 3]> = (0..3300)
        .map(|i| [(i / 3) as f32 * 0.01, (i % 3 == 1) as u8 as f32, (i % 3 == 2) as u8 as f32])
        .collect();
    let positions = file.floats(&corners);
    file.root["meshes"][0] = json!({"primitives": [{"attributes": {"POSITION": positions}}]});
    let copies: Vec<[f32; 3]> =
        (0..40_000).map(|i| [(i % 200) as f32 * 12.0, 0.0, (i / 200) as f32 * 3.0]).collect();
    let translations = file.floats(&copies);
    let extension = json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": translations}}});
    file.node(json!({"mesh": 0, "extensions": extension}));
    let scene = with_walk(file.scene());
    assert_eq!(
        (scene.triangle_count(), scene.instances()),
        (44_000_000, [40_000, 1]),
        "triangles, instances and meshes"
    );
    let mut world = World::new(scene, (64, 36), Some(1)).expect("a world");
    world.makes_cells = true;
    assert_eq!(
        cullers::parse("hzb", &world).expect("it reads shared meshes").len(),
        1,
        "the z-buffer reads shared meshes"
    );
    for name in ["hzb-level", "naylor", "plp:10%", "large-occluders", "horizon", "portals"] {
        let error = cullers::parse(name, &world).err().map(|error| error.to_string()).unwrap_or_default();
        assert!(error.contains("it copies the triangles of each instance"), "{name}: {error}");
    }
    // More triangles than the judge can number are refused before any is placed.
    for _ in 0..100 {
        file.node(json!({"mesh": 0, "extensions": extension}));
    }
    let error = parse(&file.glb(), Path::new("test.glb")).expect_err("too many").to_string();
    assert!(error.contains("triangles of all instances"), "{error}");
}

#[test]
fn too_many_objects_are_refused_before_they_take_memory() {
    // A file of a few kilobytes: copies without data of their own, of a mesh with a few primitives.
    let mut copies = File::new();
    let count = json!({"componentType": 5126, "count": 1 << 21, "type": "SCALAR"});
    let count = copies.push("accessors", count);
    let primitive = copies.root["meshes"][0]["primitives"][0].clone();
    copies.root["meshes"][0]["primitives"] = json!(vec![primitive; 3]);
    copies.node(json!({"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"_X": count}}}}));
    // Nodes and primitives of one mesh.
    let mut nodes = File::new();
    nodes.root["meshes"][0]["primitives"] = json!(vec![json!({"attributes": {}}); 2100]);
    (0..2000).for_each(|_| nodes.node(json!({"mesh": 0})));
    // The same nodes, each without a copy of its mesh.
    let mut none = File::new();
    none.root["meshes"] = nodes.root["meshes"].clone();
    let no_copy = none.push("accessors", json!({"componentType": 5126, "count": 0, "type": "VEC3"}));
    let extension = json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": no_copy}}});
    (0..2000).for_each(|_| none.node(json!({"mesh": 0, "extensions": extension})));
    for (name, file) in [("copies", copies), ("nodes", nodes), ("no copies", none)] {
        let file = file.glb();
        let before = LIVE.get();
        PEAK.set(before);
        let error = parse(&file, Path::new("test.glb")).expect_err("too many").to_string();
        let bytes = PEAK.get() - before;
        assert!(
            error.contains("nodes: with them, the scene has more than 4194304 objects"),
            "{name}: {error}"
        );
        assert!(bytes < 20_000_000, "{name}: {bytes} bytes");
    }
}

#[test]
fn a_node_without_instance_attributes_shows_its_mesh_once() {
    let mut file = File::new();
    let extensions = [json!({"attributes": {}}), json!({})];
    for extension in extensions.iter().cycle().take(4) {
        file.node(json!({"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": extension}}));
    }
    let scene = file.scene();
    assert_eq!((scene.objects.len(), scene.instances()), (4, [4, 1]), "objects, instances and their meshes");
}

/// Returns a file with `count` translated, rotated and stretched boxes: as copies of one node, or with a node
/// for each.
fn rows_of_boxes(count: usize, by_one_node: bool) -> File {
    let mut file = File::new();
    let places: Vec<[f32; 3]> =
        (0..count).map(|i| [(i % 100 * 3) as f32, 0.0, (i / 100 * 3) as f32]).collect();
    let turn = |i: usize| [0.0, (i as f32 * 0.1).sin(), 0.0, (i as f32 * 0.1).cos()];
    let size = |i: usize| [1.0, 1.0 + (i % 7) as f32 * 0.1, 1.0];
    if by_one_node {
        let rotations = file.floats(&(0..count).map(turn).collect::<Vec<_>>());
        let scales = file.floats(&(0..count).map(size).collect::<Vec<_>>());
        let attributes = json!({"TRANSLATION": file.floats(&places), "ROTATION": rotations, "SCALE": scales});
        file.node(json!({"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {"attributes": attributes}}}));
    } else {
        for (i, place) in places.iter().enumerate() {
            file.node(json!({"mesh": 0, "translation": place, "rotation": turn(i), "scale": size(i)}));
        }
    }
    file
}

#[test]
fn an_instance_takes_few_bytes() {
    for by_one_node in [true, false] {
        let bytes = |count: usize| {
            let file = rows_of_boxes(count, by_one_node).glb();
            let before = LIVE.get();
            PEAK.set(before);
            let scene = parse(&file, Path::new("test.glb")).expect("a valid file");
            let [loaded, loading] = [LIVE.get() - before, PEAK.get() - before];
            PEAK.set(LIVE.get());
            let world = World::new(with_walk(scene), (64, 36), Some(1)).expect("a world");
            let [kept, most] = [LIVE.get() - before, PEAK.get() - before];
            assert_eq!(world.scene.len(), count, "by one node: {by_one_node}: objects of the scene");
            [loaded, loading, kept, most].map(|bytes| bytes as f64)
        };
        let (few, many) = (bytes(10_000), bytes(30_000));
        let [loaded, loading, kept, most] = std::array::from_fn(|i| ((many[i] - few[i]) / 20_000.0).round());
        println!("by one node {by_one_node}: {loaded} {loading} {kept} {most}");
        // 48 bytes for name, flags and triangles, and 48 for the transform.
        assert!(loaded <= 96.0, "{loaded} bytes an instance in the loaded file");
        // The loaded file's 96 bytes, and in the scene 16 for triangles, 8 for the occluder mesh and 52 for
        // box, layers, ids and the log of changes.
        assert!(kept <= 173.0 && most <= 1.2 * kept, "{kept} bytes an instance, at most {most}");
        // A node takes about 800 bytes while it is read; it would take 1,400 if all nodes were JSON values at
        // once.
        let most = if by_one_node { 1.5 * kept } else { 5.0 * kept };
        assert!(loading <= most, "{loading} bytes an instance while loading");
    }
}
