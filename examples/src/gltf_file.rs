//! glTF and GLB files as scenes: every primitive of every node's mesh becomes an object in world space.
//!
//! Nodes are visited with an explicit stack and at most once each, so neither a cycle nor a deep hierarchy
//! can hang the program or overflow the call stack. Animation, skins and morph targets are ignored: objects
//! are in their rest pose.

use crate::error::SourceError;
use crate::gltf_buffers::Buffers;
use crate::source::{Hint, SceneSource, SourceObject};
use crate::walk;
use glam::{DMat4, DQuat, DVec3, Vec3};
use gltf::material::AlphaMode;
use gltf::mesh::{Mode, Semantic};
use gltf::scene::Transform;
use serde_json::Value;
use std::path::Path;

/// Maximum number of triangles of a scene. Nodes can instance one mesh any number of times, so the size of
/// the file does not bound the number of triangles.
const MOST_TRIANGLES: usize = 1 << 25;
/// Maximum number of vertices and indices read in total. A thousand nodes may each read the same million
/// vertices, so the size of the file does not bound the work.
const MOST_READ: usize = 1 << 27;

/// Reads a glTF or GLB document from its bytes. `path` is the document's path: further files are searched
/// below its folder, and error messages show it.
///
/// A node may carry a [`Hint`] for its objects: the extra (custom property) `visibility` with the value
/// `occluder`, `detail`, `door`, `mover` or `never-cull`.
///
/// The up axis is y. The near plane and the walks are derived from the bounds of the scene.
///
/// # Errors
///
/// Returns [`SourceError::Content`] when the document or one of its buffers is invalid, when nodes do not
/// form trees, or when the scene exceeds the bounds on triangles or on vertices and indices read.
pub fn parse(bytes: &[u8], path: &Path) -> Result<SceneSource, SourceError> {
    let (document, chunk) = document(bytes, path)?;
    let mut collector = Collector {
        buffers: Buffers::load(&document, chunk, path)?,
        path,
        objects: Vec::new(),
        triangles: 0,
        read: 0,
    };
    for (node, transform) in placed_nodes(&document, path)? {
        collector.add(&node, &transform)?;
    }
    let mut scene = SceneSource {
        name: crate::source::stem(path),
        up: Vec3::Y,
        near: 0.0,
        objects: collector.objects,
        walks: Vec::new(),
        cells: None,
    };
    let bounds = scene.bounds();
    scene.near = walk::made_up_near(bounds);
    scene.walks = walk::made_up(bounds, scene.up);
    Ok(scene)
}

/// Parses and validates a document. Returns the document and the binary chunk of a GLB, `None` if there is
/// none. Returns an error for a truncated header and for any violation that the `gltf` crate finds.
fn document(bytes: &[u8], path: &Path) -> Result<(gltf::Document, Option<Vec<u8>>), SourceError> {
    /// Size of the GLB header, in bytes.
    const GLB_HEADER: usize = 12;
    let wrong = |place: &str, problem: String| SourceError::content(path, place, problem);
    if bytes.starts_with(b"glTF") {
        // The `gltf` crate subtracts the header's size from the claimed length without a check.
        let length = bytes
            .get(8..GLB_HEADER)
            .map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]))
            .ok_or_else(|| wrong("byte 8", "the GLB header is cut short".into()))?;
        if (length as usize) < GLB_HEADER || length as usize > bytes.len() {
            let problem = format!("the header claims {length} bytes, the file has {}", bytes.len());
            return Err(wrong("byte 8", problem));
        }
    }
    let unreadable = |error: gltf::Error| wrong("document", describe(&error));
    let gltf = gltf::Gltf::from_slice_without_validation(bytes).map_err(unreadable)?;
    // The validation of the `gltf` crate looks up the accessors of positions without a bounds check.
    let root = gltf.document.as_json();
    for (mesh_index, mesh) in root.meshes.iter().enumerate() {
        for (index, primitive) in mesh.primitives.iter().enumerate() {
            let position = gltf::json::validation::Checked::Valid(Semantic::Positions);
            let accessor = primitive.attributes.get(&position);
            if accessor.is_some_and(|accessor| accessor.value() >= root.accessors.len()) {
                let place = format!("mesh {mesh_index}, primitive {index}");
                return Err(wrong(&place, "its positions are no accessor".into()));
            }
        }
    }
    let document = gltf::Document::from_json(gltf.document.into_json()).map_err(unreadable)?;
    Ok((document, gltf.blob))
}

/// Formats an error of the `gltf` crate. Of a failed validation only the first item is shown, since the crate
/// prints all items on one line.
fn describe(error: &gltf::Error) -> String {
    match error {
        gltf::Error::Validation(items) => match items.first() {
            Some((path, error)) => format!("{path}: {error}"),
            None => "it is not valid".to_owned(),
        },
        other => other.to_string(),
    }
}

/// Returns the nodes of the default scene with their world transforms, parents before children. Without a
/// default scene the nodes are those of the first scene, and without scenes all nodes below the nodes that
/// have no parent. Returns an error when a node is reached twice.
fn placed_nodes<'a>(
    document: &'a gltf::Document,
    path: &Path,
) -> Result<Vec<(gltf::Node<'a>, DMat4)>, SourceError> {
    let scene = document.default_scene().or_else(|| document.scenes().next());
    let roots: Vec<gltf::Node<'a>> = match scene {
        Some(scene) => scene.nodes().collect(),
        None => {
            let mut is_child = vec![false; document.nodes().len()];
            for child in document.nodes().flat_map(|node| node.children()) {
                is_child[child.index()] = true;
            }
            document.nodes().filter(|node| !is_child[node.index()]).collect()
        }
    };
    let mut reached = vec![false; document.nodes().len()];
    let mut placed = Vec::new();
    let mut waiting: Vec<_> = roots.into_iter().rev().map(|node| (node, DMat4::IDENTITY)).collect();
    while let Some((node, parent)) = waiting.pop() {
        if std::mem::replace(&mut reached[node.index()], true) {
            return Err(SourceError::content(
                path,
                format!("node {}", node.index()),
                "it is reached twice: nodes must form trees",
            ));
        }
        let world = parent * local_transform(&node);
        // The stack is last in, first out: children are pushed in reverse, so that they are visited in the
        // order of the file.
        let first = waiting.len();
        waiting.extend(node.children().map(|child| (child, world)));
        waiting[first..].reverse();
        placed.push((node, world));
    }
    Ok(placed)
}

/// Returns the matrix that maps a node's space to that of its parent.
fn local_transform(node: &gltf::Node<'_>) -> DMat4 {
    match node.transform() {
        Transform::Matrix { matrix } => {
            DMat4::from_cols_array_2d(&matrix.map(|column| column.map(f64::from)))
        }
        Transform::Decomposed { translation, rotation, scale } => {
            let rotation = DQuat::from_array(rotation.map(f64::from));
            // A quaternion of length zero counts as no rotation.
            let rotation =
                if rotation.length_squared() > 0.0 { rotation.normalize() } else { DQuat::IDENTITY };
            DMat4::from_scale_rotation_translation(
                DVec3::from_array(scale.map(f64::from)),
                rotation,
                DVec3::from_array(translation.map(f64::from)),
            )
        }
    }
}

/// Collector of a scene's objects, with the totals that are bounded.
struct Collector<'a> {
    buffers: Buffers<'a>,
    path: &'a Path,
    objects: Vec<SourceObject>,
    triangles: usize,
    /// Number of vertices and indices read so far, at most [`MOST_READ`].
    read: usize,
}

impl Collector<'_> {
    /// Appends one object for each primitive of the node's mesh; `transform` maps mesh space to world space.
    /// A node without a mesh adds no object. Returns the first error of a primitive.
    fn add(&mut self, node: &gltf::Node<'_>, transform: &DMat4) -> Result<(), SourceError> {
        let Some(mesh) = node.mesh() else {
            return Ok(());
        };
        let name =
            node.name().or(mesh.name()).map_or_else(|| format!("node {}", node.index()), str::to_owned);
        let hint = self.hint(node)?;
        let several = mesh.primitives().len() > 1;
        for primitive in mesh.primitives() {
            let place = format!("mesh {}, primitive {}", mesh.index(), primitive.index());
            let triangles = self.primitive(&primitive, transform, &place)?;
            self.triangles += triangles.len();
            let name = if several { format!("{name}/{}", primitive.index()) } else { name.clone() };
            let opaque = primitive.material().alpha_mode() == AlphaMode::Opaque;
            let mut object = SourceObject { opaque, ..SourceObject::new(name, triangles) };
            if let Some(hint) = hint {
                object.take(hint);
            }
            self.objects.push(object);
        }
        Ok(())
    }

    /// Returns the hint in the extras of a node: `"visibility"` with the name of the hint. Returns an error
    /// if there is no hint of that name.
    fn hint(&self, node: &gltf::Node<'_>) -> Result<Option<Hint>, SourceError> {
        let Some(extras) = node.extras() else { return Ok(None) };
        let wrong =
            |problem: String| SourceError::content(self.path, format!("node {}", node.index()), problem);
        let extras: Value =
            serde_json::from_str(extras.get()).map_err(|error| wrong(format!("its extras: {error}")))?;
        let name = extras.get("visibility").and_then(Value::as_str);
        name.map(|name| name.parse().map_err(|error| wrong(format!("its extra `visibility`: {error}"))))
            .transpose()
    }

    /// Reads the world-space triangles of one primitive, which are none for points and lines. `place` names
    /// the primitive in error messages. Returns an error for invalid accessors or indices, and when the scene
    /// would exceed a bound.
    fn primitive(
        &mut self,
        primitive: &gltf::Primitive<'_>,
        transform: &DMat4,
        place: &str,
    ) -> Result<Vec<[Vec3; 3]>, SourceError> {
        let path = self.path;
        let wrong = |problem: String| SourceError::content(path, place, problem);
        let accessor =
            primitive.get(&Semantic::Positions).ok_or_else(|| wrong("it has no positions".into()))?;
        let index_count = primitive.indices().map_or(0, |indices| indices.count());
        self.read = self.read.saturating_add(accessor.count()).saturating_add(index_count);
        if self.read > MOST_READ {
            return Err(wrong(format!(
                "with it, more than {MOST_READ} vertices and indices would have to be read"
            )));
        }
        let positions = self.buffers.positions(&accessor)?;
        let order = match primitive.indices() {
            Some(accessor) => self.buffers.indices(&accessor)?,
            None => (0..positions.len()).map(|i| i as u32).collect(),
        };
        if let Some(index) = order.iter().find(|&&i| i as usize >= positions.len()) {
            let count = positions.len();
            return Err(wrong(format!("index {index} is beyond its {count} vertices")));
        }
        let corners = corners(primitive.mode(), order.len());
        if corners.len() > MOST_TRIANGLES - self.triangles.min(MOST_TRIANGLES) {
            return Err(wrong(format!("with it, the scene has more than {MOST_TRIANGLES} triangles")));
        }
        let world = |p: &Vec3| transform.transform_point3(p.as_dvec3()).as_vec3();
        let placed: Vec<Vec3> = positions.iter().map(world).collect();
        // A mirroring transform turns triangles inside out; swapping two vertices restores the front that the
        // file has.
        let mirrored = transform.determinant() < 0.0;
        let triangle = |t: usize| {
            let [a, b, c] = corners.of(t).map(|i| placed[order[i] as usize]);
            if mirrored { [a, c, b] } else { [a, b, c] }
        };
        Ok((0..corners.len()).map(triangle).collect())
    }
}

/// Vertex order of a primitive: how its `triangles` triangles index its vertices.
struct Corners {
    mode: Mode,
    triangles: usize,
}

/// Returns the vertex order of a primitive with `vertices` vertices. Vertices left over at the end are
/// ignored.
fn corners(mode: Mode, vertices: usize) -> Corners {
    let triangles = match mode {
        Mode::Triangles => vertices / 3,
        Mode::TriangleStrip | Mode::TriangleFan => vertices.saturating_sub(2),
        // Points and lines have no surface, so they neither occlude nor are occluded.
        Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip => 0,
    };
    Corners { mode, triangles }
}

impl Corners {
    /// Returns the number of triangles of the primitive.
    fn len(&self) -> usize {
        self.triangles
    }

    /// Returns the positions, in the primitive's vertex or index list, of the three corners of a triangle.
    /// `triangle` must be below [`len`](Self::len).
    fn of(&self, triangle: usize) -> [usize; 3] {
        let t = triangle;
        match self.mode {
            // Every second triangle of a strip has the opposite winding.
            Mode::TriangleStrip => [t, t + 1 + t % 2, t + 2 - t % 2],
            Mode::TriangleFan => [t + 1, t + 2, 0],
            _ => [3 * t, 3 * t + 1, 3 * t + 2],
        }
    }
}
