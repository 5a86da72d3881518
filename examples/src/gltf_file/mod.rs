//! glTF and GLB files as scenes: every primitive of every node's mesh becomes an object in world space.
//!
//! Nodes are visited with an explicit stack and at most once each, so neither a cycle nor a deep hierarchy
//! can hang the program or overflow the call stack. Transforms are multiplied in `f64`. If the content is far
//! from the document's origin, the scene gets an origin near the content.
//!
//! Objects are in their rest pose. An object that moves (by an animation, a skin or morph targets) hides
//! nothing, and its bounds contain it throughout all animations.

mod buffers;
mod camera;
mod document;
mod instances;
mod materials;
mod meshopt;
mod motion;
mod nodes;
mod shape;
mod unread;

use crate::error::SourceError;
use crate::object_name::ObjectName;
use crate::reading::Reading;
use crate::source::{CAMERAS_OF_FILE, Hint, SceneSource, SourceObject};
use crate::{unit_and_axis_hints, walk};
use buffers::Buffers;
use document::Document;
use glam::{DAffine3, DMat4, DVec3, Vec3};
use gltf::mesh::{Mode, Semantic};
use instances::{Instances, instance_count};
use motion::{Box64, EMPTY, Motion, MovedBox, around, corners as box_corners, union};
use nodes::Nodes;
use serde_json::Value;
use shape::Shape;
use std::cell::RefCell;
use std::collections::HashMap;
use std::path::Path;
use std::rc::Rc;
use std::vec;
use visibility_core::{Aabb, scene::SharedTriangles};

/// Maximum number of objects of a scene. Objects count even without triangles.
pub(crate) const MOST_OBJECTS: usize = 1 << 22;
/// Maximum number of triangles in memory. Instances share the triangles of a mesh; nodes with skinned,
/// morphed or animated meshes have their own.
pub(crate) const MOST_TRIANGLES: usize = 1 << 25;
/// Maximum number of triangles of all objects, instances included. The item buffer must be able to number
/// each triangle. Nodes can instance one mesh any number of times, so neither the size of the file nor
/// [`MOST_TRIANGLES`] bounds this number.
const MOST_PLACED: usize = u32::MAX as usize - 1;

/// Reads a glTF or GLB document from its bytes, in metres and with y up. `path` is the document's path, which
/// error messages show. Other files of the document are searched below the path's folder.
///
/// A node may carry a [`Hint`] for its objects: the extra (custom property) `visibility` with the value
/// `occluder`, `detail`, `door`, `mover` or `never-cull`. All hints except `occluder` also apply to the
/// node's descendants.
///
/// Each perspective camera becomes a walk with one key. The near plane is derived from the bounds of the
/// scene, and is at most as far as the nearest near plane of the cameras.
///
/// # Errors
///
/// Returns [`SourceError::Content`] when the document or a needed buffer is invalid, when nodes do not form
/// trees, when triangles exist only in Draco compression, or when the scene exceeds a limit on objects,
/// triangles, or vertices and indices.
pub fn parse(bytes: &[u8], path: &Path) -> Result<SceneSource, SourceError> {
    parse_as(bytes, path, &Reading::default())
}

/// Reads a glTF or GLB document like [`parse`], with another unit or up axis.
///
/// # Errors
///
/// Returns the errors of [`parse`].
pub fn parse_as(bytes: &[u8], path: &Path, reading: &Reading) -> Result<SceneSource, SourceError> {
    let (mut document, chunk) = document::read(bytes, path)?;
    let nodes = Nodes::new(&mut document, DMat4::from_scale(DVec3::splat(reading.metres())), path)?;
    let buffers = Buffers::load(&document.gltf, chunk, path);
    let motion = Motion::new(&document.gltf, &document.transforms, &nodes, &buffers)?;
    let mut collector = Collector {
        document: &document,
        nodes: &nodes,
        buffers: &buffers,
        motion: &motion,
        path,
        origin: DVec3::ZERO,
        objects: Vec::new(),
        moved: Vec::new(),
        bounds_of_movers: Vec::new(),
        without_triangles: 0,
        kept: 0,
        placed: 0,
        users: users_of_meshes(&document, &nodes),
        meshes: HashMap::new(),
        names: HashMap::new(),
        hints: vec![Vec::new(); nodes.parents.len()],
        unknown_hints: Vec::new(),
    };
    let shown = placed(&document, &nodes)
        .filter_map(|node| node.mesh().zip(Some(instance_count(&node, &document.gltf))));
    // Primitives of a mesh without copies are read, though they become no objects.
    let objects = shown.map(|(mesh, copies)| mesh.primitives().len().saturating_mul(copies.max(1)));
    let objects = objects.fold(0, usize::saturating_add);
    // Checked before anything is done for each object: the size of the file does not bound their number.
    if objects > MOST_OBJECTS {
        return Err(SourceError::content(path, "nodes", format!("with them, {}", too_many())));
    }
    collector.origin = buffers.uncharged(|| collector.origin_near_content())?;
    collector.objects.reserve_exact(objects);
    for node in placed(&document, &nodes) {
        collector.add(&node)?;
    }
    collector.bound_movers();
    let (origin, objects, unknown_hints) = (collector.origin, collector.objects, collector.unknown_hints);
    document.unread.without_triangles = collector.without_triangles;
    let mut is_placed = vec![false; nodes.parents.len()];
    nodes.placed.iter().for_each(|&node| is_placed[node] = true);
    let cameras = document.cameras.iter().filter(|camera| is_placed[camera.node]);
    let walks: Vec<_> = cameras.filter_map(|camera| camera.walk(&nodes.worlds[camera.node])).collect();
    document.unread.cameras -= walks.len();

    let movers = objects.iter().filter(|object| object.motion.is_some()).count();
    let mut notes: Vec<String> = document.unread.line().into_iter().collect();
    if movers > 0 {
        let is_anywhere = |object: &&SourceObject| object.motion.is_some() && object.never_cull;
        let anywhere = objects.iter().filter(is_anywhere).count();
        let anywhere = match anywhere {
            0 => String::new(),
            _ => format!("; {anywhere} of them count as visible from everywhere"),
        };
        notes.push(format!(
            "{movers} of {} objects may move, by animations, skins, morph targets or extensions: they hide nothing, and \
             their bounds are those over all clips{anywhere}",
            objects.len()
        ));
    }
    // One of the unknown hints is enough to find the others.
    notes.extend(unknown_hints.first().map(|first| match unknown_hints.len() {
        1 => first.clone(),
        count => format!("{first}; {} more like it", count - 1),
    }));
    if origin != DVec3::ZERO {
        notes.push(format!("far from the origin of the file: coordinates are relative to {origin}"));
    }
    let (name, up) = (crate::source::stem(path), reading.up.unwrap_or(Vec3::Y));
    let mut scene = SceneSource { origin, notes, objects, ..SceneSource::new(name, up, 0.0) };
    let hints = unit_and_axis_hints::hints(&scene, reading);
    scene.notes.extend(hints);
    let bounds = scene.bounds();
    scene.near = walk::made_up_near(bounds);
    if !walks.is_empty() {
        scene.notes.push(format!("{CAMERAS_OF_FILE}: {}", walks.len()));
    }
    scene.walks = walks;
    if let Some(near) = document.cameras.iter().filter_map(|camera| camera.near).reduce(f64::min) {
        scene.near = scene.near.min((near * reading.metres()) as f32);
    }
    Ok(scene)
}

/// Returns the nodes of the scene that the program reads, in the order of the file.
fn placed<'a>(document: &'a Document, nodes: &Nodes) -> impl Iterator<Item = gltf::Node<'a>> {
    nodes.placed.iter().filter_map(|&index| document.gltf.nodes().nth(index))
}

/// Returns the end of the message for too many objects or triangles.
fn too_many() -> String {
    format!("the scene has more than {MOST_OBJECTS} objects, or {MOST_PLACED} triangles of all instances")
}

/// Collector of a scene's objects, with the running totals that the limits bound.
struct Collector<'a> {
    document: &'a Document,
    nodes: &'a Nodes,
    buffers: &'a Buffers<'a>,
    motion: &'a Motion,
    path: &'a Path,
    /// Scene origin in world space; coordinates of objects are relative to it.
    origin: DVec3,
    objects: Vec<SourceObject>,
    /// Boxes that nodes move. Together they contain the moving objects.
    moved: Vec<MovedBox>,
    /// Bounds of the moving objects in all their poses, in world space, each with the index of its object.
    /// Empty until [`Self::bound_movers`].
    bounds_of_movers: Vec<(usize, Box64)>,
    /// Number of primitives without triangles: points, lines, or no positions.
    without_triangles: usize,
    /// Number of triangles in memory.
    kept: usize,
    /// Number of triangles of all objects, instances included.
    placed: usize,
    /// For each mesh, by its index, the nodes that show it.
    users: Vec<Users>,
    /// Primitives of meshes that several objects share, by mesh index.
    meshes: HashMap<usize, Rc<[Primitive]>>,
    /// Names so far without their numbers. The key is the text before the number and the text after it.
    names: HashMap<[String; 2], ObjectName>,
    /// For each node, by its index, the hints inherited from all nodes above it, each once.
    hints: Vec<Vec<Hint>>,
    /// Notes on extras `visibility` that are no hints.
    unknown_hints: Vec<String>,
}

/// Nodes of the scene that show a mesh.
#[derive(Clone, Default)]
struct Users {
    /// Indices of these nodes, in the order of the file.
    nodes: Vec<usize>,
    /// Total number of copies of the mesh at these nodes.
    count: usize,
}

/// Returns for each mesh, by its index, the nodes that show it.
fn users_of_meshes(document: &Document, nodes: &Nodes) -> Vec<Users> {
    let mut users = vec![Users::default(); document.gltf.meshes().len()];
    for node in placed(document, nodes) {
        if let Some(mesh) = node.mesh() {
            let users = &mut users[mesh.index()];
            users.nodes.push(node.index());
            users.count = users.count.saturating_add(instance_count(&node, &document.gltf));
        }
    }
    users
}

/// Triangles of a primitive, before a node places them.
struct Primitive {
    shape: Shape,
    /// Triangles for the next objects that share this primitive's triangles, in the order of the objects.
    /// Empty if no objects share them.
    shared: RefCell<vec::IntoIter<SharedTriangles>>,
    /// Vertex indices of all triangle corners.
    order: Vec<u32>,
    corners: Corners,
    see_through: bool,
    one_sided: bool,
}

impl Collector<'_> {
    /// Returns the scene's origin: the median of the middles of all meshes, rounded to whole metres, if it is
    /// more than 4 km from the origin of world space, and more than four times as far as the meshes' median
    /// distance from it. Otherwise the origin of world space. A `f32` at 4 km is exact to a quarter of a
    /// millimetre.
    fn origin_near_content(&self) -> Result<DVec3, SourceError> {
        const NEAR: f64 = 4096.0;
        let mut known: HashMap<usize, Box64> = HashMap::new();
        let mut boxes = Vec::new();
        for node in placed(self.document, self.nodes) {
            let Some(mesh) = node.mesh() else { continue };
            let mut bounds = EMPTY;
            for accessor in mesh.primitives().filter_map(|primitive| primitive.get(&Semantic::Positions)) {
                let of_accessor = match known.get(&accessor.index()) {
                    Some(&bounds) => bounds,
                    // Unreadable positions become an error later, when the mesh is placed.
                    None => match self.buffers.positions(&accessor) {
                        Ok(positions) => around(positions.into_iter().map(Vec3::as_dvec3)),
                        Err(_) => EMPTY,
                    },
                };
                known.insert(accessor.index(), of_accessor);
                bounds = union(bounds, of_accessor);
            }
            let copies = Instances::read(&node, &self.document.gltf, self.buffers, self.path)?;
            let joint = node.skin().and_then(|skin| skin.joints().next());
            let world = self.nodes.worlds[joint.map_or(node.index(), |joint| joint.index())];
            // About a thousand copies are enough to estimate where all copies are.
            for copy in (0..copies.count).step_by(copies.count / 1000 + 1) {
                let world = world * copies.matrix(copy);
                boxes.push(around(box_corners(bounds).map(|corner| world.transform_point3(corner))));
            }
        }
        boxes.retain(|(low, high)| low.is_finite() && high.is_finite());
        // Halved before they are added, because the sum of two coordinates may overflow.
        let middle = |(low, high): &Box64| *low * 0.5 + *high * 0.5;
        let median = |mut values: Vec<f64>| {
            values.sort_unstable_by(f64::total_cmp);
            values.get(values.len() / 2).copied().unwrap_or(0.0)
        };
        let along = |axis: usize| median(boxes.iter().map(|bounds| middle(bounds)[axis]).collect());
        let centre = DVec3::new(along(0), along(1), along(2));
        let reach = |bounds: &Box64| {
            (middle(bounds) - centre).abs().max_element() + (bounds.1 - bounds.0).max_element() * 0.5
        };
        let size = median(boxes.iter().map(reach).collect());
        let distance = centre.abs().max_element();
        Ok(if distance > NEAR && distance > 4.0 * size { centre.round() + DVec3::ZERO } else { DVec3::ZERO })
    }

    /// Appends one object for each pair of a primitive of the node's mesh and a copy of the mesh. A node
    /// without a mesh adds no object. Returns the first error of a primitive.
    fn add(&mut self, node: &gltf::Node<'_>) -> Result<(), SourceError> {
        let hint = self.hint(node)?;
        let Some(mesh) = node.mesh() else {
            return Ok(());
        };
        let several = mesh.primitives().len() > 1;
        let primitives = self.primitives(node, &mesh)?;
        let copies = Instances::read(node, &self.document.gltf, self.buffers, self.path)?;
        let names: Vec<ObjectName> = (0..primitives.len())
            .map(|index| self.name(node, &mesh, if several { format!("/{index}") } else { String::new() }))
            .collect();
        let is_copied = node.extension_value("EXT_mesh_gpu_instancing").is_some();
        let triangles = primitives.iter().map(|primitive| primitive.corners.len()).sum();
        self.check_placed(copies.count, triangles, node)?;
        for copy in 0..copies.count {
            let instance = &copies.matrix(copy);
            for (primitive, name) in primitives.iter().zip(&names) {
                let name = if is_copied { name.with_number(copy as u32) } else { name.clone() };
                let triangles = self.place(node, primitive, instance)?;
                let Primitive { see_through, one_sided, .. } = *primitive;
                let mut object = SourceObject {
                    opaque: !see_through,
                    see_through,
                    one_sided,
                    ..SourceObject::new(name, triangles)
                };
                // The hints of nodes above are applied last: a mesh below a `mover` hides nothing, whatever
                // its own hint.
                hint.iter().chain(&self.hints[node.index()]).for_each(|&hint| object.take(hint));
                self.move_object(node, primitive, instance, &mut object);
                if one_sided && is_flat(&(self.nodes.worlds[node.index()] * *instance)) {
                    // Which side of a flattened surface is its front depends on a renderer's rounding: it may
                    // be seen from either, and hides nothing.
                    object = SourceObject {
                        opaque: false,
                        see_through: true,
                        one_sided: false,
                        flattened: true,
                        ..object
                    };
                }
                self.objects.push(object);
            }
        }
        Ok(())
    }

    /// Returns the name of an object of a node, ending in `end`: the name of the node, or else of the mesh,
    /// with brackets for a number. The number is that of the copy, or of the node.
    fn name(&mut self, node: &gltf::Node<'_>, mesh: &gltf::Mesh<'_>, end: String) -> ObjectName {
        let is_copied = node.extension_value("EXT_mesh_gpu_instancing").is_some();
        let own = node.name().or(mesh.name()).map(str::to_owned);
        let texts = match (&own, is_copied) {
            (Some(own), true) => [format!("{own}["), format!("]{end}")],
            (None, true) => [format!("node {}[", node.index()), format!("]{end}")],
            (Some(own), false) => [format!("{own}{end}"), String::new()],
            (None, false) => ["node ".into(), end],
        };
        let name = self.names.entry(texts).or_insert_with_key(|texts| texts.clone().into());
        if own.is_none() && !is_copied { name.with_number(node.index() as u32) } else { name.clone() }
    }

    /// Notes what moves the next object, which a node and an instance matrix place. An object that moves
    /// hides nothing, whatever its hint.
    fn move_object(
        &mut self,
        node: &gltf::Node<'_>,
        primitive: &Primitive,
        instance: &DMat4,
        object: &mut SourceObject,
    ) {
        let is_pointed_at = &self.nodes.is_pointed_at;
        let is_mesh_pointed_at = &self.document.is_mesh_pointed_at;
        let is_pointed_at_here =
            is_pointed_at[node.index()] || node.mesh().is_some_and(|mesh| is_mesh_pointed_at[mesh.index()]);
        let is_moved = primitive.shape.is_soft() || self.motion.moves(node.index()) || is_pointed_at_here;
        if !is_moved || primitive.corners.len() == 0 {
            return;
        }
        // The positions of an object that an animation pointer moves are unknown, since such animations are
        // not read. So the object is never culled.
        object.never_cull |= is_pointed_at_here;
        object.opaque = false;
        object.motion = Some(Box::default());
        let mover = self.bounds_of_movers.len();
        for (node, to_node, bounds) in primitive.shape.boxes(node.index(), instance, &primitive.order) {
            object.never_cull |= is_pointed_at[node];
            self.moved.push(MovedBox { mover, node, to_node, bounds });
        }
        self.bounds_of_movers.push((self.objects.len(), EMPTY));
    }

    /// Sets the bounds of all moving objects to contain them throughout all animations. An object with
    /// unknown bounds is never culled.
    fn bound_movers(&mut self) {
        self.moved.sort_by_key(|moved| self.nodes.subtrees[moved.node].start);
        let bounds = &mut self.bounds_of_movers;
        let known = self.motion.enclose(&self.document.transforms, self.nodes, &self.moved, bounds);
        for &(object, (low, high)) in &*bounds {
            let object = &mut self.objects[object];
            let bounds = Aabb::from_world(low, high, self.origin);
            object.never_cull |= !known || !low.is_finite() || !high.is_finite() || !bounds.is_finite();
            object.motion = Some(Box::new((bounds.min, bounds.max)));
        }
    }

    /// Returns the hint in the extras of a node (`"visibility"`), and passes it on to the node's descendants.
    /// [`Hint::Occluder`] is not passed on: glass below an occluder stays glass. An unknown word or other
    /// value, mistyped or of another tool, counts as [`Hint::Detail`], since what is meant may not hide
    /// anything, and is noted. Returns an error for an occluder without a mesh.
    fn hint(&mut self, node: &gltf::Node<'_>) -> Result<Option<Hint>, SourceError> {
        let path = self.path;
        let wrong = |problem| SourceError::content(path, format!("node {}", node.index()), problem);
        let extras = node.extras().as_ref().map(|extras| serde_json::from_str::<Value>(extras.get()));
        let extras = extras.transpose().map_err(|error| wrong(format!("its extras: {error}")))?;
        let word = extras.as_ref().and_then(|extras| extras.get("visibility"));
        let word = word.map(|word| word.as_str().map_or_else(|| word.to_string(), str::to_owned));
        let hint = match word.map(|word| word.parse()).transpose() {
            Ok(hint) => hint,
            Err(error) => {
                self.unknown_hints.push(format!(
                    "node {}: its extra `visibility` makes it hide nothing: {error}",
                    node.index()
                ));
                Some(Hint::Detail)
            }
        };
        if hint == Some(Hint::Occluder) && node.mesh().is_none() {
            return Err(wrong("its extra `visibility`: `occluder` is for a mesh, and it has none".into()));
        }
        let parent = self.nodes.parents[node.index()];
        let mut below = parent.map_or(Vec::new(), |parent| self.hints[parent].clone());
        below.extend(hint.filter(|hint| *hint != Hint::Occluder && !below.contains(hint)));
        self.hints[node.index()] = below;
        Ok(hint)
    }

    /// Returns the primitives of a node's mesh. A mesh that several nodes show is read once, unless it has
    /// morph targets or the node has a skin.
    fn primitives(
        &mut self,
        node: &gltf::Node<'_>,
        mesh: &gltf::Mesh<'_>,
    ) -> Result<Rc<[Primitive]>, SourceError> {
        let is_soft = node.skin().is_some()
            || mesh.primitives().any(|primitive| primitive.morph_targets().next().is_some());
        let is_shared = !is_soft && self.users[mesh.index()].count > 1;
        if is_shared && let Some(known) = self.meshes.get(&mesh.index()) {
            return Ok(known.clone());
        }
        let mut read = Vec::with_capacity(mesh.primitives().len());
        let mut transforms = Vec::new();
        for primitive in mesh.primitives() {
            let place = format!("mesh {}, primitive {}", mesh.index(), primitive.index());
            let mut primitive = self.primitive(node, &primitive, &place)?;
            if is_shared {
                self.keep(primitive.corners.len(), node)?;
                self.check_placed(self.users[mesh.index()].count, primitive.corners.len(), node)?;
                if transforms.is_empty() {
                    transforms = self.transforms(mesh)?;
                }
                let Primitive { shape, order, corners, .. } = &primitive;
                let corner = |i: usize| shape.positions[order[i] as usize];
                let triangles = (0..corners.len()).map(|t| corners.of(t).map(corner));
                let triangles = SharedTriangles::from(triangles.collect::<Vec<_>>());
                primitive.shared = RefCell::new(triangles.placed_each(&transforms).into_iter());
            }
            read.push(primitive);
        }
        let read: Rc<[Primitive]> = read.into();
        if is_shared {
            self.meshes.insert(mesh.index(), read.clone());
        }
        Ok(read)
    }

    /// Returns the transforms of all objects that share the triangles of a mesh, in the order of the objects.
    fn transforms(&self, mesh: &gltf::Mesh<'_>) -> Result<Vec<DAffine3>, SourceError> {
        let users = &self.users[mesh.index()];
        let mut transforms = Vec::with_capacity(users.count);
        for node in users.nodes.iter().filter_map(|&node| self.document.gltf.nodes().nth(node)) {
            if node.skin().is_some() {
                continue;
            }
            let copies = Instances::read(&node, &self.document.gltf, self.buffers, self.path)?;
            transforms.extend((0..copies.count).map(|copy| {
                let world = self.nodes.worlds[node.index()] * copies.matrix(copy);
                DAffine3::from_translation(-self.origin) * DAffine3::from_mat4(world)
            }));
        }
        Ok(transforms)
    }

    /// Returns an error if `copies` times `triangles` more triangles would exceed [`MOST_PLACED`].
    fn check_placed(
        &self,
        copies: usize,
        triangles: usize,
        node: &gltf::Node<'_>,
    ) -> Result<(), SourceError> {
        let placed = copies.saturating_mul(triangles).saturating_add(self.placed);
        if placed <= MOST_PLACED { Ok(()) } else { Err(self.wrong(node, format!("with it, {}", too_many()))) }
    }

    /// Adds to the number of triangles in memory. Returns an error if the total exceeds [`MOST_TRIANGLES`].
    fn keep(&mut self, triangles: usize, node: &gltf::Node<'_>) -> Result<(), SourceError> {
        self.kept += triangles;
        let problem = || {
            format!("with it, the scene has more than {MOST_TRIANGLES} triangles, shared ones counted once")
        };
        if self.kept > MOST_TRIANGLES { Err(self.wrong(node, problem())) } else { Ok(()) }
    }

    fn wrong(&self, node: &gltf::Node<'_>, problem: String) -> SourceError {
        SourceError::content(self.path, format!("node {}", node.index()), problem)
    }

    /// Reads the triangles of one primitive; points and lines have none. `place` names the primitive in error
    /// messages. Returns an error for invalid accessors or indices, and when a limit is exceeded.
    fn primitive(
        &mut self,
        node: &gltf::Node<'_>,
        primitive: &gltf::Primitive<'_>,
        place: &str,
    ) -> Result<Primitive, SourceError> {
        let path = self.path;
        let wrong = |problem: String| SourceError::content(path, place, problem);
        // A primitive without positions is valid, and adds no triangles.
        let Some(accessor) = primitive.get(&Semantic::Positions) else {
            self.without_triangles += 1;
            return Ok(Primitive {
                shape: Shape::default(),
                shared: RefCell::default(),
                order: Vec::new(),
                corners: corners(Mode::Points, 0),
                see_through: false,
                one_sided: false,
            });
        };
        let is_draco = primitive.extension_value("KHR_draco_mesh_compression").is_some();
        if is_draco && accessor.view().is_none() && accessor.sparse().is_none() {
            return Err(wrong(
                "it is compressed by Draco, which is not read: `npx @gltf-transform/cli copy IN OUT` writes \
                 a file without"
                    .into(),
            ));
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
        let has_surface =
            matches!(primitive.mode(), Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan);
        self.without_triangles += usize::from(!has_surface);
        let shape = Shape::read(node, primitive, positions, self.motion, self.buffers, (self.path, place))?;
        let (see_through, one_sided) = materials::surface(primitive, &self.document.gltf);
        Ok(Primitive { shape, shared: RefCell::default(), order, corners, see_through, one_sided })
    }

    /// Returns the triangles of a primitive, relative to the scene's origin. `instance` maps mesh space to
    /// the node's space. Returns an error when the scene would have too many triangles.
    fn place(
        &mut self,
        node: &gltf::Node<'_>,
        primitive: &Primitive,
        instance: &DMat4,
    ) -> Result<SharedTriangles, SourceError> {
        let Primitive { shape, order, corners, shared, .. } = primitive;
        self.check_placed(1, corners.len(), node)?;
        self.placed += corners.len();
        if let Some(shared) = shared.borrow_mut().next() {
            return Ok(shared);
        }
        self.keep(corners.len(), node)?;
        let placed = shape.placed(node.index(), instance, self.nodes);
        let placed: Vec<Vec3> = placed.into_iter().map(|p| (p - self.origin).as_vec3()).collect();
        // A mirroring transform flips the winding of triangles. Swapping two vertices restores it.
        let mirrored = (shape.world(node.index(), self.nodes) * *instance).determinant() < 0.0;
        let triangle = |t: usize| {
            let [a, b, c] = corners.of(t).map(|i| placed[order[i] as usize]);
            if mirrored { [a, c, b] } else { [a, b, c] }
        };
        Ok((0..corners.len()).map(triangle).collect::<Vec<_>>().into())
    }
}

/// Returns whether a matrix makes shapes flat, up to the rounding of a renderer in `f32`: their volume is a
/// hundred-thousandth of the volume that the lengths of the axes allow, or less. Such a transform may mirror
/// or not. True for an axis that is not finite.
fn is_flat(matrix: &DMat4) -> bool {
    let [x, y, z] = [matrix.x_axis, matrix.y_axis, matrix.z_axis].map(|axis| axis.truncate());
    let volume = x.normalize_or_zero().dot(y.normalize_or_zero().cross(z.normalize_or_zero()));
    volume.abs() <= 1e-5
}

/// Vertex order of a primitive: which vertices the corners of each triangle are.
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
