//! The document of a glTF file: split from its container, checked, and stripped of everything that does not
//! affect triangles.
//!
//! Textures, images and the like are removed before the `gltf` crate reads the document. So a file with
//! missing pictures, or pictures of an unknown kind, can still be read. Required extensions that are not
//! supported are accepted, since nearly all of them only change how surfaces look.

use super::camera::Camera;
use super::materials::TRANSMITTING;
use super::unread::Unread;
use crate::error::SourceError;
use crate::json::{self, list};
use glam::{DMat4, DQuat, DVec3};
use gltf::json::material::AlphaMode;
use gltf::json::validation::{Checked, Error, Validate};
use gltf::json::{Node, Path as JsonPath, Root};
use gltf::mesh::Semantic;
use serde_json::{Map, Value};
use std::collections::BTreeSet;
use std::path::Path;

/// Document of a glTF file.
pub(super) struct Document {
    /// Document without textures and other parts that do not affect triangles.
    pub gltf: gltf::Document,
    /// Transforms from each node's space to its parent's, by node index, in the f64 precision of the JSON
    /// text.
    pub transforms: Vec<LocalTransform>,
    /// Whether an animation by `KHR_animation_pointer` or an extension that is not known may move the node,
    /// by node index. Where to is unknown.
    pub is_pointed_at: Vec<bool>,
    /// Whether an animation by `KHR_animation_pointer` or a graph of `KHR_interactivity` may show the node
    /// though it is hidden at rest, by node index.
    pub is_shown: Vec<bool>,
    /// Whether an animation by `KHR_animation_pointer` or a graph of `KHR_interactivity` changes morph
    /// weights of the mesh, or an extension that is not known may change its shape, by mesh index. Their
    /// values are not read.
    pub is_mesh_pointed_at: Vec<bool>,
    /// Perspective cameras of the nodes.
    pub cameras: Vec<Camera>,
    /// Counts of the parts of the file that are not read.
    pub unread: Unread,
}

/// Transform from a node's space to that of its parent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum LocalTransform {
    /// Matrix as given in the file.
    Matrix(DMat4),
    /// Scale, then rotation, then translation.
    Parts { translation: DVec3, rotation: DQuat, scale: DVec3 },
}

impl LocalTransform {
    /// Reads the transform of a node. Members with invalid types are ignored here, since the `gltf` crate
    /// reports them as errors.
    fn of(node: &Value) -> Self {
        let numbers = |key: &str| {
            let list = node.get(key).and_then(Value::as_array);
            list.map(|list| list.iter().filter_map(Value::as_f64).collect::<Vec<_>>())
        };
        if let Some(matrix) = numbers("matrix").and_then(|matrix| <[f64; 16]>::try_from(matrix).ok()) {
            return Self::Matrix(DMat4::from_cols_array(&matrix));
        }
        let vector = |key, default| {
            let read = numbers(key).and_then(|vector| <[f64; 3]>::try_from(vector).ok());
            read.map_or(default, DVec3::from_array)
        };
        let rotation = numbers("rotation").and_then(|rotation| <[f64; 4]>::try_from(rotation).ok());
        Self::Parts {
            translation: vector("translation", DVec3::ZERO),
            rotation: unit(rotation.map_or(DQuat::IDENTITY, DQuat::from_array)),
            scale: vector("scale", DVec3::ONE),
        }
    }

    /// Returns scale, rotation and translation. A matrix is decomposed, and loses its shear; valid files do
    /// not animate nodes with a matrix.
    pub(super) fn parts(&self) -> (DVec3, DQuat, DVec3) {
        match *self {
            Self::Matrix(matrix) => matrix.to_scale_rotation_translation(),
            Self::Parts { translation, rotation, scale } => (scale, rotation, translation),
        }
    }

    /// Returns the matrix of the transform.
    pub(super) fn matrix(&self) -> DMat4 {
        match *self {
            Self::Matrix(matrix) => matrix,
            Self::Parts { translation, rotation, scale } => {
                DMat4::from_scale_rotation_translation(scale, rotation, translation)
            }
        }
    }
}

/// Returns the unit quaternion of a rotation. A quaternion of length zero, or one that is not finite, counts
/// as no rotation.
pub(super) fn unit(rotation: DQuat) -> DQuat {
    let length = rotation.length();
    if length > 0.0 && length.is_finite() { rotation / length } else { DQuat::IDENTITY }
}

/// Reads a document from the bytes of a glTF or GLB file. Returns it with the binary chunk of a GLB, which is
/// `None` if there is none. `path` appears in error messages only.
///
/// # Errors
///
/// Returns [`SourceError::Content`] for a container that is truncated or has bytes beyond its length, for
/// text that is not JSON, for a version other than 2, and for errors that the `gltf` crate finds.
pub(super) fn read<'a>(bytes: &'a [u8], path: &Path) -> Result<(Document, Option<&'a [u8]>), SourceError> {
    let wrong = |place: &str, problem: String| SourceError::content(path, place, problem);
    let (text, chunk) = if bytes.starts_with(b"glTF") {
        split(bytes).map_err(|(at, problem)| wrong(&format!("byte {at}"), problem))?
    } else {
        (bytes, None)
    };
    let unreadable = |error: serde_json::Error| wrong("document", error.to_string());
    let (read, beyond) = (Ok(Vec::new()), None);
    let (transforms, with_camera, is_pointed_at) = (Vec::new(), Vec::new(), Vec::new());
    let mut nodes = NodeReader { read, transforms, is_pointed_at, with_camera, beyond };
    let mut root = json::parse_items(text, "nodes", &mut |node| nodes.take(node)).map_err(unreadable)?;
    let version = root.pointer("/asset/version").and_then(Value::as_str).unwrap_or_default();
    if !version.starts_with("2.") {
        let problem = format!("its version is `{version}`: glTF of version 2 is read, and no other");
        return Err(wrong("asset.version", problem));
    }
    check_indices(&root, "", false).and(nodes.beyond.map_or(Ok(()), Err)).map_err(|(key, index)| {
        wrong(&key, format!("{index} is beyond all indices, of which there are at most 2^32"))
    })?;
    let cameras = Camera::all(&root, &nodes.with_camera);
    let mut is_mesh_pointed_at: Vec<bool> =
        list(&root, "meshes").iter().map(|mesh| is_reshaped(mesh, &root)).collect();
    let is_figure = FIGURES.iter().any(|name| root.pointer(&format!("/extensions/{name}")).is_some());
    let mut unread = Unread::new(&root, nodes.with_camera.len());
    let graphs = pointers_within(root.pointer("/extensions/KHR_interactivity"));
    let pointers = strip(&mut root);
    unread.pointers = pointers.len();

    // By way of text, and so by code that is compiled in the crate `gltf-json`: much of it, and it takes
    // long.
    let mut root = Root::from_str(&root.to_string()).map_err(unreadable)?;
    root.nodes = nodes.read.map_err(unreadable)?;
    let mut is_pointed_at = nodes.is_pointed_at;
    let mut is_shown = vec![false; root.nodes.len()];
    is_pointed_at.iter_mut().for_each(|is_pointed_at| *is_pointed_at |= is_figure);
    is_mesh_pointed_at.resize(root.meshes.len(), false);
    // Each target once: with a variable for its index, a pointer names all items.
    let targets: BTreeSet<String> = pointers.iter().chain(&graphs).map(|pointer| target(pointer)).collect();
    let items: BTreeSet<&str> = targets.iter().map(|target| item(target)).collect();
    for pointer in items {
        point_at(pointer, &mut root, &mut is_pointed_at, &mut is_mesh_pointed_at);
    }
    for pointer in &targets {
        let node = pointer.strip_prefix("/nodes/");
        let node = node.and_then(|node| node.strip_suffix("/extensions/KHR_node_visibility/visible"));
        node.into_iter().for_each(|node| named(node, &mut is_shown).fill(true));
    }
    // Checked here, because the validation of the `gltf` crate looks up position accessors without a bounds
    // check.
    for (mesh_index, mesh) in root.meshes.iter().enumerate() {
        for (index, primitive) in mesh.primitives.iter().enumerate() {
            let accessor = primitive.attributes.get(&Checked::Valid(Semantic::Positions));
            if accessor.is_some_and(|accessor| accessor.value() >= root.accessors.len()) {
                let place = format!("mesh {mesh_index}, primitive {index}");
                return Err(wrong(&place, "its positions are no accessor".into()));
            }
        }
    }
    let mut first = None;
    let mut report = |place: &dyn Fn() -> JsonPath, error: Error| {
        // A missing buffer view is allowed here: an accessor without one is all zeros.
        if first.is_none() && error != Error::Missing {
            first = Some((place().to_string(), error.to_string()));
        }
    };
    root.validate(&root, JsonPath::new, &mut report);
    // The validation of the `gltf` crate leaves out the targets of channels, and panics when it looks up
    // their nodes and paths.
    for (index, animation) in root.animations.iter().enumerate() {
        for (channel_index, channel) in animation.channels.iter().enumerate() {
            let channels = || JsonPath::new().field("animations").index(index).field("channels");
            channel.target.validate(&root, || channels().index(channel_index).field("target"), &mut report);
        }
    }
    if let Some((place, problem)) = first {
        return Err(wrong(&place, problem));
    }
    let gltf = gltf::Document::from_json_without_validation(root);
    let transforms = nodes.transforms;
    Ok((Document { gltf, transforms, is_pointed_at, is_shown, is_mesh_pointed_at, cameras, unread }, chunk))
}

/// Reader that takes the nodes of a document one by one.
struct NodeReader {
    /// Nodes as read by the `gltf` crate, without their cameras, or the first error.
    read: serde_json::Result<Vec<Node>>,
    transforms: Vec<LocalTransform>,
    /// Whether an extension of the node may move it, or draw another shape in its place.
    is_pointed_at: Vec<bool>,
    /// Nodes with a camera, with their indices.
    with_camera: Vec<(usize, Value)>,
    /// First index of a node's JSON that exceeds 32 bits, with its key. `None` if there is none.
    beyond: Option<(String, u64)>,
}

impl NodeReader {
    fn take(&mut self, mut node: Value) {
        let Ok(read) = &mut self.read else { return };
        if self.beyond.is_none() {
            self.beyond = check_indices(&node, "nodes", true).err();
        }
        if node.get("camera").is_some() {
            self.with_camera.push((self.transforms.len(), node.clone()));
        }
        self.transforms.push(LocalTransform::of(&node));
        self.is_pointed_at.push(is_replaced(&node));
        if let Some(members) = node.as_object_mut() {
            members.remove("camera");
        }
        match serde_json::from_value(node) {
            Ok(node) => read.push(node),
            Err(error) => self.read = Err(error),
        }
    }
}

/// Extensions of nodes that neither move them nor draw other shapes in their place, or that are read.
const OF_NODES: [&str; 24] = [
    "AGI_stk_metadata",
    "EXT_instance_features",
    "EXT_lights_ies",
    "EXT_mesh_gpu_instancing",
    "EXT_structural_metadata",
    "GRIFFEL_bim_data",
    "KHR_audio",
    "KHR_audio_emitter",
    "KHR_lights_punctual",
    "KHR_node_hoverability",
    "KHR_node_selectability",
    "KHR_node_visibility",
    "KHR_physics_rigid_bodies",
    "KHR_xmp",
    "KHR_xmp_json_ld",
    "MSFT_audio_emitter",
    "OMI_audio_emitter",
    "OMI_collider",
    "OMI_link",
    "OMI_physics_body",
    "OMI_physics_joint",
    "OMI_physics_shape",
    "OMI_seat",
    "OMI_spawn_point",
];

/// Extensions of meshes and primitives that leave their triangles as they are without the extensions, or that
/// are read.
const OF_MESHES: [&str; 13] = [
    "CESIUM_primitive_outline",
    "EXT_feature_metadata",
    "EXT_mesh_features",
    "EXT_mesh_manifold",
    "EXT_primitive_voxels",
    "EXT_structural_metadata",
    "FB_ngon_encoding",
    "GRIFFEL_bim_data",
    "KHR_draco_mesh_compression",
    "KHR_gaussian_splatting",
    "KHR_materials_variants",
    "KHR_xmp",
    "KHR_xmp_json_ld",
];

/// Extensions of a document whose nodes others move: the bones of figures, by the springs and constraints of
/// the file and by motions of a program, or a stream that changes the scene.
const FIGURES: [&str; 4] = ["MPEG_scene_dynamic", "VRM", "VRMC_springBone", "VRMC_vrm"];

/// Returns whether a part of a document has an extension that is not among those `known`.
fn has_other_extension(part: &Value, known: &[&str]) -> bool {
    let extensions = part.get("extensions").and_then(Value::as_object);
    extensions.is_some_and(|extensions| extensions.keys().any(|name| !known.contains(&name.as_str())))
}

/// Returns whether an extension may change the triangles of a mesh: one of the mesh, of a primitive, or of an
/// accessor of its vertices or indices, such as `MPEG_accessor_timed`, whose data are a stream.
fn is_reshaped(mesh: &Value, root: &Value) -> bool {
    let of_accessor = |index: &Value| {
        let accessor =
            index.as_u64().and_then(|index| list(root, "accessors").get(usize::try_from(index).ok()?));
        accessor.is_some_and(|accessor| has_other_extension(accessor, &[]))
    };
    let of_primitive = |primitive: &Value| {
        let parts = primitive.get("attributes").into_iter().chain(list(primitive, "targets"));
        let parts = parts.filter_map(Value::as_object);
        has_other_extension(primitive, &OF_MESHES)
            || parts.flat_map(Map::values).chain(primitive.get("indices")).any(of_accessor)
    };
    has_other_extension(mesh, &OF_MESHES) || list(mesh, "primitives").iter().any(of_primitive)
}

/// Returns whether an extension of a node may move it, as a body of a simulation that is not static, or draw
/// other shapes in its place, as coarser levels of detail, which need not lie within its bounds. So may each
/// extension that is not known.
fn is_replaced(node: &Value) -> bool {
    let Some(extensions) = node.get("extensions") else { return false };
    let is_static = |body: &Value| {
        let kind = body.pointer("/motion/type").or_else(|| body.get("type"));
        kind.and_then(Value::as_str) == Some("static") || (kind.is_none() && body.get("motion").is_none())
    };
    extensions.pointer("/KHR_physics_rigid_bodies/motion").is_some()
        || extensions.get("OMI_physics_body").is_some_and(|body| !is_static(body))
        || has_other_extension(node, &OF_NODES)
}

/// JSON text of a GLB, and its binary chunk if it has one.
type Chunks<'a> = (&'a [u8], Option<&'a [u8]>);

/// Splits a GLB into its JSON text and its binary chunk, `None` if there is none. Further chunks are ignored.
/// Returns a byte offset and a message as the error when the version is not 2, the chunks do not fill the
/// length in the header, or this length is not the file's.
fn split(bytes: &[u8]) -> Result<Chunks<'_>, (usize, String)> {
    /// Sizes in bytes of the header of a GLB, and of the header of each chunk.
    const HEADERS: [usize; 2] = [12, 8];
    let number = |at: usize| {
        let four = bytes.get(at..at + 4).and_then(|four| four.try_into().ok()).map(u32::from_le_bytes);
        four.ok_or_else(|| (at, "the file is cut short within a header".to_owned()))
    };
    let (version, length) = (number(4)?, number(8)? as usize);
    if version != 2 {
        return Err((4, format!("its version is {version}: GLB of version 2 is read, and no other")));
    }
    if length != bytes.len() {
        return Err((8, format!("the header claims {length} bytes, the file has {}", bytes.len())));
    }
    let (mut at, mut text, mut binary) = (HEADERS[0], None, None);
    while at < length {
        let (size, kind) = (number(at)? as usize, number(at + 4)?);
        let start = at + HEADERS[1];
        let Some(chunk) = bytes.get(start..start + size) else {
            return Err((at, format!("the chunk claims {size} bytes, {} are left", length - start)));
        };
        match (&kind.to_le_bytes(), text) {
            (b"JSON", None) => text = Some(chunk),
            (_, None) => return Err((at, "the first chunk is not the text".into())),
            (b"BIN\0", _) if binary.is_none() => binary = Some(chunk),
            _ => {}
        }
        at = start + size;
    }
    text.map(|text| (text, binary)).ok_or_else(|| (8, "the header's length leaves no chunk".into()))
}

/// Checks that all indices and 32-bit constants in a value are below 2^32, because the `gltf` crate would
/// drop higher bits. `key` is the key of the value; `is_index` tells whether all numbers inside are indices.
/// Returns the key and the number of the first violation as the error.
fn check_indices(value: &Value, key: &str, is_index: bool) -> Result<(), (String, u64)> {
    /// Keys whose values are indices or constants, or lists or objects of these.
    const KEYS: [&str; 23] = [
        "attributes",
        "buffer",
        "bufferView",
        "camera",
        "children",
        "componentType",
        "indices",
        "input",
        "inverseBindMatrices",
        "joints",
        "material",
        "mesh",
        "mode",
        "node",
        "nodes",
        "output",
        "sampler",
        "scene",
        "skeleton",
        "skin",
        "source",
        "target",
        "targets",
    ];
    match value {
        Value::Number(number) if is_index => match number.as_u64() {
            Some(index) if index > u64::from(u32::MAX) => Err((key.to_owned(), index)),
            _ => Ok(()),
        },
        Value::Array(items) => items.iter().try_for_each(|item| check_indices(item, key, is_index)),
        Value::Object(members) => members.iter().try_for_each(|(name, member)| {
            // The names inside attributes and morph targets are chosen by the file, and all their values are
            // indices.
            let named = matches!(key, "attributes" | "targets");
            match name.as_str() {
                "extras" | "extensions" => Ok(()),
                _ => check_indices(
                    member,
                    if named { key } else { name },
                    named || KEYS.contains(&name.as_str()),
                ),
            }
        }),
        _ => Ok(()),
    }
}

/// Returns the mutable list under a key of an object. Empty if there is no list.
fn list_mut<'a>(value: &'a mut Value, key: &str) -> &'a mut [Value] {
    value.get_mut(key).and_then(Value::as_array_mut).map_or(&mut [], Vec::as_mut_slice)
}

/// Returns the mutable objects in the list under a key of an object.
fn objects<'a>(
    value: &'a mut Value,
    key: &str,
) -> impl Iterator<Item = &'a mut Map<String, Value>> + use<'a> {
    list_mut(value, key).iter_mut().filter_map(Value::as_object_mut)
}

/// Removes everything from a document that does not affect triangles, and gives each scene a list of nodes.
/// Returns the targets of animations by `KHR_animation_pointer`, and removes their channels.
fn strip(root: &mut Value) -> Vec<String> {
    if let Some(members) = root.as_object_mut() {
        for key in ["images", "textures", "samplers", "cameras", "extensionsRequired", "extensions"] {
            members.remove(key);
        }
    }
    // A scene without nodes is valid; the `gltf` crate requires the list.
    for scene in objects(root, "scenes") {
        scene.entry("nodes").or_insert_with(|| Value::Array(Vec::new()));
    }
    objects(root, "materials").for_each(strip_textures);
    for mesh in list_mut(root, "meshes") {
        for primitive in list_mut(mesh, "primitives") {
            if let Some(attributes) = primitive.get_mut("attributes").and_then(Value::as_object_mut) {
                let places = |name: &str| {
                    name == "POSITION" || name.starts_with("JOINTS_") || name.starts_with("WEIGHTS_")
                };
                attributes.retain(|name, _| places(name));
            }
            objects(primitive, "targets").for_each(|target| target.retain(|name, _| name == "POSITION"));
        }
    }
    for accessor in objects(root, "accessors") {
        accessor.remove("min");
        accessor.remove("max");
    }
    let mut pointers = Vec::new();
    for animation in list_mut(root, "animations") {
        let Some(channels) = animation.get_mut("channels").and_then(Value::as_array_mut) else { continue };
        channels.retain(|channel| {
            let Some(target) = channel.get("target") else { return true };
            let pointer = target.pointer("/extensions/KHR_animation_pointer/pointer");
            pointers.extend(pointer.and_then(Value::as_str).map(str::to_owned));
            pointer.is_none() && target.get("node").is_some()
        });
    }
    pointers
}

/// Returns the pointers to nodes, meshes and materials in the text of a value, such as a graph of
/// `KHR_interactivity`, whether they are read or set. Empty without a value.
fn pointers_within(value: Option<&Value>) -> Vec<String> {
    let (mut found, mut waiting): (_, Vec<&Value>) = (Vec::new(), value.into_iter().collect());
    while let Some(value) = waiting.pop() {
        match value {
            Value::String(text)
                if ["/nodes/", "/meshes/", "/materials/"].iter().any(|at| text.starts_with(at)) =>
            {
                found.push(text.clone());
            }
            Value::Array(items) => waiting.extend(items),
            Value::Object(members) => waiting.extend(members.values()),
            _ => {}
        }
    }
    found
}

/// Returns the items whose index is a part of a pointer: one, or none, or all if a graph computes the index,
/// which is then a name in braces.
fn named<'a, T>(part: &str, items: &'a mut [T]) -> &'a mut [T] {
    let count = items.len();
    let range = match part.parse() {
        Ok(index) if index < count => index..index + 1,
        _ if part.starts_with('{') => 0..count,
        _ => 0..0,
    };
    items.get_mut(range).unwrap_or_default()
}

/// Returns a JSON pointer with `{` in the place of each variable (`{name}`).
fn target(pointer: &str) -> String {
    let parts = pointer.split('/').map(|part| if part.starts_with('{') { "{" } else { part });
    parts.collect::<Vec<_>>().join("/")
}

/// Returns the beginning of a pointer that names a node or a mesh, whatever of it is animated; other pointers
/// whole.
fn item(pointer: &str) -> &str {
    let end = pointer.match_indices('/').nth(2).map_or(pointer.len(), |(end, _)| end);
    let is_item = pointer.starts_with("/nodes/") || pointer.starts_with("/meshes/");
    if is_item { &pointer[..end] } else { pointer }
}

/// Notes the target of an animation by `KHR_animation_pointer`, or of a graph. Sets the flag of an
/// animated node in `nodes`, and of a mesh with animated morph weights in `meshes`, by index. A material
/// with an animated transmission factor is changed to alpha mode `BLEND`, since it may become see-through.
fn point_at(pointer: &str, root: &mut Root, nodes: &mut [bool], meshes: &mut [bool]) {
    match pointer.split('/').collect::<Vec<_>>()[..] {
        ["", "nodes", node, ..] => named(node, nodes).fill(true),
        ["", "meshes", mesh, ..] => named(mesh, meshes).fill(true),
        ["", "materials", material, "extensions", extension, factor]
            if TRANSMITTING.iter().any(|&(name, key, _)| (name, key) == (extension, factor)) =>
        {
            for material in named(material, &mut root.materials) {
                material.alpha_mode = Checked::Valid(AlphaMode::Blend);
            }
        }
        _ => {}
    }
}

/// Removes all textures of a material and of its extensions.
fn strip_textures(material: &mut Map<String, Value>) {
    material.retain(|key, _| !key.ends_with("Texture"));
    for (key, member) in material.iter_mut() {
        match member {
            Value::Object(member) if key != "extras" => strip_textures(member),
            _ => {}
        }
    }
}
