//! Tests of valid glTF files: each test builds a file, and compares the loaded scene with known values.

mod accessors;
mod placement;
mod poses;

use crate::gltf_files::glb;
use glam::{DVec3, Vec3};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use visibility_examples::gltf_file::parse;
use visibility_examples::walkthrough::{World, cullers, run};
use visibility_examples::{CameraKey, SceneSource, SourceError, Walk};

/// Builder of a glTF file, which appends the data of accessors to one buffer.
#[derive(Clone)]
struct File {
    root: Value,
    bytes: Vec<u8>,
}

const FLOAT: u32 = 5126;

impl File {
    /// Creates a file with a node for each of its future meshes.
    fn new() -> Self {
        let root = json!({
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}], "nodes": [], "meshes": [],
            "accessors": [], "bufferViews": [], "buffers": [{"byteLength": 0}]
        });
        Self { root, bytes: Vec::new() }
    }

    /// Appends an item to a list of the document, and returns its index.
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

    /// Appends a mesh of triangles, whose corners are consecutive `points`, and returns its index.
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

    /// Appends an animation with one channel.
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

/// Corners of the triangle that most tests use.
const CORNERS: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0]];

/// Returns a file with one triangle, placed by one node.
fn triangle() -> File {
    let mut file = File::new();
    let mesh = file.mesh(&CORNERS);
    file.node(json!({"mesh": mesh, "name": "it"}));
    file
}

/// Returns the six corners of the two triangles of a rectangle that faces z.
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
