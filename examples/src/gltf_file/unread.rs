//! Counts of the parts of a glTF file that the program does not read, so that nobody mistakes the scene for
//! the whole file.

use crate::json::list;
use serde_json::Value;
use std::collections::BTreeSet;

/// Prefixes of the names of extensions that are read, or that do not affect triangles.
const KNOWN: [&str; 15] = [
    "ADOBE_materials_",
    "EXT_lights_",
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "EXT_texture_",
    "KHR_animation_pointer",
    "KHR_draco_mesh_compression",
    "KHR_lights_",
    "KHR_materials_",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_node_visibility",
    "KHR_texture_",
    "KHR_xmp",
    "MSFT_texture_",
];

/// Counts of the parts of a file that the program does not read, for a note to the user.
#[derive(Default)]
pub(super) struct Unread {
    /// Number of primitives without triangles: points, lines, or no positions.
    pub without_triangles: usize,
    /// Number of animation channels by `KHR_animation_pointer`, whose values are unknown.
    pub pointers: usize,
    /// Number of nodes hidden by `KHR_node_visibility`, descendants included.
    pub hidden_nodes: usize,
    /// Number of nodes whose camera does not become a walk.
    pub cameras: usize,
    lights: usize,
    /// Number of scenes besides the one that is read.
    scenes: usize,
    /// Names of unsupported extensions that may affect triangles.
    extensions: BTreeSet<String>,
}

impl Unread {
    /// Counts the scenes and unsupported extensions of a document. `cameras` is its number of nodes with a
    /// camera.
    pub(super) fn new(root: &Value, cameras: usize) -> Self {
        let names = ["extensionsUsed", "extensionsRequired"].map(|key| list(root, key));
        let names = names.into_iter().flatten().filter_map(Value::as_str);
        let lights = root.pointer("/extensions/KHR_lights_punctual/lights").and_then(Value::as_array);
        Self {
            cameras,
            lights: lights.map_or(0, Vec::len),
            scenes: list(root, "scenes").len().saturating_sub(1),
            extensions: names
                .filter(|name| !KNOWN.iter().any(|known| name.starts_with(known)))
                .map(str::to_owned)
                .collect(),
            ..Self::default()
        }
    }

    /// Returns a line of text that lists the unread parts, `None` if there are none.
    pub(super) fn line(&self) -> Option<String> {
        let counts = [
            (self.without_triangles, "primitive without triangles", "primitives without triangles"),
            (self.hidden_nodes, "hidden node", "hidden nodes"),
            (self.pointers, "channel of an animation by pointer", "channels of animations by pointer"),
            (self.cameras, "camera", "cameras"),
            (self.lights, "light", "lights"),
            (self.scenes, "other scene", "other scenes"),
        ];
        let counts = counts.iter().filter(|(count, ..)| *count > 0);
        let counts =
            counts.map(|(count, one, many)| format!("{count} {}", if *count == 1 { one } else { many }));
        let extensions = self.extensions.iter().map(|name| format!("the extension {name}"));
        let all: Vec<String> = counts.chain(extensions).collect();
        (!all.is_empty()).then(|| format!("not read: {}", all.join(", ")))
    }
}
