//! The triangles of a scene, welded: shared edges and convex polygons of coplanar triangles are found.

mod changes;
mod log;
#[cfg(test)]
mod tests;
mod welding;

use crate::half::Half;
use crate::line_side::{U, side, sign};
use crate::triangle_tree::TriangleTree;
use alloc::{boxed::Box, collections::BTreeMap, vec, vec::Vec};
use log::Log;
use visibility_core::geometry::DoubleDouble;
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::level_version::level_object;
use visibility_core::scene::{SceneCursor, Triangles};
use visibility_core::{Aabb, Object, ObjectId, Scene};
use welding::{Welding, edge_key, vertex_key};

/// The triangles of all objects of a scene, prepared for exact queries. Made once, then shared by cullers,
/// bakes and the checks of proofs.
///
/// Triangles occlude if their object is flagged as an [occluder](visibility_core::Object::occluder), is
/// [always drawn](Scene::is_always_drawn) and can be [culled](visibility_core::Object::is_unculled).
/// Triangles of other objects, and of objects on no [layer](visibility_core::Object::layers), are only
/// targets. Objects that an earlier culler has removed
/// still occlude, whatever their layers. Triangles without area do not occlude. An object with a coordinate
/// that is not finite counts as visible from everywhere and does not occlude. An object without triangles is
/// represented by its bounding box and does not occlude. Triangles of
/// [one-sided](visibility_core::Object::one_sided) objects occlude only for viewpoints in front of them, and
/// are seen only from there. An object that is [never culled](visibility_core::Object::is_unculled) counts as
/// visible from everywhere, since it may be elsewhere than its triangles and its bounds.
///
/// Vertices with equal coordinates are welded, also across objects. Takes about 150 bytes for each triangle.
/// Building takes O(n log n). [`sync`](Self::sync) takes in what has changed in the scene since, in time that
/// depends on the changed objects.
///
/// ```
/// use visibility_core::{glam::Vec3, Aabb, Object, Scene};
/// use visibility_exact::SceneTriangles;
/// let triangle = [Vec3::ZERO, Vec3::X, Vec3::Y];
/// let mut scene = Scene::new();
/// let object = Object { occluder: true, ..Object::new(Aabb::from_points(triangle)) };
/// let id = scene.insert(object);
/// scene.set_triangles(id, [triangle])?;
/// let triangles = SceneTriangles::new(&scene);
/// assert_eq!((triangles.len(), triangles.occluder_count()), (1, 1));
/// # Ok::<(), visibility_core::scene::SceneError>(())
/// ```
#[derive(Clone, Debug)]
pub struct SceneTriangles {
    cursor: SceneCursor,
    pub(crate) origin: DVec3,
    pub(crate) objects: Vec<TargetObject>,
    /// Positions of each triangle's corners in scene coordinates.
    corners: Vec<[Vec3; 3]>,
    /// Indices of the vertices at each triangle's corners.
    vertices: Vec<[u32; 3]>,
    /// Index of each triangle's object in `objects`.
    object_of: Vec<u32>,
    /// For each triangle, whether it occludes.
    occludes: Vec<bool>,
    /// Layer masks of the objects whose triangles occlude, each with the number of these objects, at least 1.
    pub(crate) layers: BTreeMap<u32, u32>,
    /// Half-space in front of each one-sided triangle, from which the triangle is seen and occludes. `None`
    /// for a two-sided triangle.
    fronts: Vec<Option<Half>>,
    /// Area of each triangle in square metres, rounded. Larger triangles are tried first. A triangle of area
    /// 0 is not proven hidden by itself.
    areas: Vec<f32>,
    /// Indices of each triangle's edges: edge k joins corners k and (k + 1) % 3.
    edges: Vec<[u32; 3]>,
    /// For each edge, the start of the range of its occluding triangles in `edge_triangles`. One more entry
    /// is the end of the last range.
    edge_starts: Vec<u32>,
    /// Indices of the occluding triangles at each edge, edge after edge.
    edge_triangles: Vec<u32>,
    /// Convex polygons, each joined from coplanar occluding triangles.
    pieces: Vec<Piece>,
    /// For each triangle, the index in `pieces` of the convex polygon that it is a part of. `u32::MAX` if the
    /// triangle does not occlude.
    piece_of: Vec<u32>,
    pub(crate) tree: TriangleTree,
    /// Greatest absolute coordinate of the scene so far, in metres.
    magnitude: f64,
    /// Numbers of vertices and edges by what they are equal to. `None` before the first change.
    welding: Option<Box<Welding>>,
    /// Changes of the objects, for those who keep what they found in earlier states.
    log: Log,
}

/// An object of the scene whose visibility is to be decided.
#[derive(Clone, Debug)]
pub(crate) struct TargetObject {
    pub(crate) id: ObjectId,
    /// Least corner, in scene coordinates, of the box around the object's triangles, or of the object's
    /// bounds if it has no triangles.
    pub(crate) min: DVec3,
    /// Greatest corner of the box that `min` begins.
    pub(crate) max: DVec3,
    /// Layer mask of the object; 0 if no triangle of it occludes.
    layers: u32,
    /// Index of the object's first triangle. Triangles of an object follow each other.
    pub(crate) first: u32,
    /// Exclusive end of the range of the object's triangles that begins at `first`.
    pub(crate) end: u32,
    /// Exclusive end of the range of triangles that begins at `first` and that the object may fill: at least
    /// `end`.
    room_end: u32,
    /// Whether the object is never culled, has a coordinate that is not finite or beyond [`LIMIT`], or has
    /// been removed. Such an object counts as visible.
    pub(crate) is_open: bool,
    /// Whether the object has been removed from the scene.
    pub(crate) is_removed: bool,
}

/// What the preparation keeps of a triangle.
struct TriangleFacts {
    corners: [Vec3; 3],
    occludes: bool,
    front: Option<Half>,
    area: f32,
}

impl TriangleFacts {
    fn new(object: &Object, triangle: [Vec3; 3]) -> Self {
        // The sum turns -0 into 0, so that equal coordinates have equal bits.
        let corners = triangle.map(|p| p + Vec3::ZERO);
        let t64 = corners.map(Vec3::as_dvec3);
        let normal = (t64[1] - t64[0]).cross(t64[2] - t64[0]);
        // A one-sided triangle without area has no normal, and is treated as two-sided: it shows nothing
        // anyway.
        let front = || unit_normal(&t64).map(|n| Half { normal: n, offset: -n.dot(t64[0]) });
        Self {
            corners,
            occludes: object.occluder && object.layers != 0 && normal != DVec3::ZERO,
            front: if object.one_sided { front() } else { None },
            area: (normal.length() * 0.5) as f32,
        }
    }
}

/// Returns whether an object counts as visible from everywhere: it is never culled, and so may be elsewhere
/// than its triangles, or it has a coordinate that is not finite or beyond [`LIMIT`].
fn is_left_open(object: &Object, triangles: Triangles<'_>) -> bool {
    // False for NaN.
    let usable = |p: Vec3| p.abs().cmple(Vec3::splat(LIMIT as f32)).all();
    // Bounds that are not finite, or not proper, are never culled.
    let bounds = [object.bounds.min, object.bounds.max];
    object.is_unculled()
        || triangles.iter().flatten().any(|p| !usable(p))
        || (triangles.is_empty() && !bounds.into_iter().all(usable))
}

/// Returns the box around an object's triangles, or the object's bounds if it has none: those that hold its
/// occluder mesh too.
fn target_box(scene: &Scene, id: ObjectId, triangles: Triangles<'_>) -> [DVec3; 2] {
    if triangles.is_empty() {
        let bounds = scene.bounds(id).unwrap_or(Aabb::EMPTY);
        return [bounds.min, bounds.max].map(Vec3::as_dvec3);
    }
    let around = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let (min, max) = triangles.iter().flatten().fold(around, |(min, max), p| {
        let p = (p + Vec3::ZERO).as_dvec3();
        (min.min(p), max.max(p))
    });
    [min, max]
}

/// A convex polygon joined from coplanar triangles.
#[derive(Clone, Debug)]
pub(crate) struct Piece {
    /// Indices of the vertices at the polygon's corners, in order around it.
    pub(crate) ring: Box<[u32]>,
    /// Position of each vertex of `ring` in scene coordinates.
    pub(crate) positions: Box<[DVec3]>,
    /// Indices of the triangles that make up the polygon.
    pub(crate) triangles: Box<[u32]>,
    /// Number of the state of the triangles in which the polygon was made, or in which its index got free.
    made: u64,
}

impl Piece {
    /// Returns a polygon of no triangles, in place of one that is not used.
    fn empty(made: u64) -> Self {
        Self { ring: Box::default(), positions: Box::default(), triangles: Box::default(), made }
    }
}

/// Greatest number of corners of a [`Piece`], a convex polygon joined from triangles.
const PIECE: usize = 8;

/// Greatest absolute coordinate, in metres, of objects that are decided. It keeps products of three
/// differences finite.
pub(crate) const LIMIT: f64 = 1e30;

impl SceneTriangles {
    /// Collects the triangles of all objects of a scene in its present state.
    pub fn new(scene: &Scene) -> Self {
        let mut all = Self {
            cursor: SceneCursor::at(scene),
            origin: scene.origin(),
            objects: Vec::with_capacity(scene.len()),
            corners: Vec::new(),
            vertices: Vec::new(),
            object_of: Vec::new(),
            occludes: Vec::new(),
            layers: BTreeMap::new(),
            fronts: Vec::new(),
            areas: Vec::new(),
            edges: Vec::new(),
            edge_starts: Vec::new(),
            edge_triangles: Vec::new(),
            pieces: Vec::new(),
            piece_of: Vec::new(),
            tree: TriangleTree::default(),
            magnitude: 0.0,
            welding: None,
            log: Log::default(),
        };
        for id in scene.ids() {
            all.add(scene, id);
        }
        all.weld();
        all.share_edges();
        all.piece_of = vec![u32::MAX; all.corners.len()];
        let occluders: Vec<u32> =
            (0..all.corners.len() as u32).filter(|&i| all.occludes[i as usize]).collect();
        all.merge(occluders.clone());
        let is_one_sided = |i: u32| all.fronts[i as usize].is_some();
        all.tree = TriangleTree::new(&all.corners, occluders, is_one_sided);
        all
    }

    fn add(&mut self, scene: &Scene, id: ObjectId) {
        let (Some((object, _)), Ok(triangles)) = (level_object(scene, id), scene.triangles(id)) else {
            return;
        };
        let is_open = is_left_open(&object, triangles);
        let first = self.corners.len() as u32;
        let [min, max] = target_box(scene, id, triangles);
        for triangle in triangles.iter().filter(|_| !is_open) {
            let facts = TriangleFacts::new(&object, triangle);
            self.magnitude = greatest(self.magnitude, &facts.corners);
            self.corners.push(facts.corners);
            self.object_of.push(self.objects.len() as u32);
            self.occludes.push(facts.occludes);
            self.fronts.push(facts.front);
            self.areas.push(facts.area);
        }
        let end = self.corners.len() as u32;
        let occludes = self.occludes[first as usize..].contains(&true);
        let layers = if occludes { object.layers } else { 0 };
        if occludes {
            *self.layers.entry(layers).or_default() += 1;
        }
        let (room_end, is_removed) = (end, false);
        self.objects.push(TargetObject { id, min, max, layers, first, end, room_end, is_open, is_removed });
    }

    /// Gives equal numbers to vertices with equal coordinates.
    fn weld(&mut self) {
        let bits = |i: u32| vertex_key(self.corners[i as usize / 3][i as usize % 3]);
        let mut order: Vec<([u32; 3], u32)> =
            (0..3 * self.corners.len() as u32).map(|i| (bits(i), i)).collect();
        order.sort_unstable();
        let mut numbers = vec![[0; 3]; self.corners.len()];
        let mut count = 0;
        for (k, &(key, i)) in order.iter().enumerate() {
            count += u32::from(k > 0 && order[k - 1].0 != key);
            numbers[i as usize / 3][i as usize % 3] = count;
        }
        self.vertices = numbers;
    }

    /// Gives equal numbers to edges between the same vertices, and lists the occluding triangles at each
    /// edge.
    fn share_edges(&mut self) {
        // Edge k of triangle t has the index i = 3 t + k. The corner after k is (k + 1) % 3.
        let key = |i: u32| edge_key(self.vertices[i as usize / 3], i as usize % 3);
        let mut order: Vec<([u32; 2], u32)> =
            (0..3 * self.vertices.len() as u32).map(|i| (key(i), i)).collect();
        order.sort_unstable();
        let mut edges = vec![[0; 3]; self.vertices.len()];
        let (mut starts, mut triangles) = (Vec::new(), Vec::new());
        for (k, &(key, i)) in order.iter().enumerate() {
            if k == 0 || order[k - 1].0 != key {
                starts.push(triangles.len() as u32);
            }
            edges[i as usize / 3][i as usize % 3] = starts.len() as u32 - 1;
            if self.occludes[i as usize / 3] {
                triangles.push(i / 3);
            }
        }
        starts.push(triangles.len() as u32);
        (self.edges, self.edge_starts, self.edge_triangles) = (edges, starts, triangles);
    }

    /// Joins coplanar neighbours into convex polygons, starting with the largest triangles of `order`. All of
    /// `order` occlude.
    fn merge(&mut self, mut order: Vec<u32>) {
        order.sort_unstable_by(|&a, &b| self.area(b).total_cmp(&self.area(a)).then(a.cmp(&b)));
        for i in order {
            if self.piece_of[i as usize] == u32::MAX {
                let piece = self.grow_piece(i);
                let number = self.free_piece();
                for &t in &piece.triangles {
                    self.piece_of[t as usize] = number;
                }
                self.pieces[number as usize] = piece;
            }
        }
    }

    /// Returns the index of an unused element of `pieces`.
    fn free_piece(&mut self) -> u32 {
        self.welding.as_mut().and_then(|welding| welding.free_pieces.pop()).unwrap_or_else(|| {
            self.pieces.push(Piece::empty(self.log.serial));
            self.pieces.len() as u32 - 1
        })
    }

    fn grow_piece(&self, first: u32) -> Piece {
        let plane = self.corners(first);
        let normal = unit_normal(&plane).unwrap_or(DVec3::ZERO);
        // The same flatness that the check of proofs demands.
        let flatness = self.position_error(0.0);
        let of =
            |i: u32, k: usize| (self.vertices[i as usize][k], self.edges[i as usize][k], self.corners(i)[k]);
        let mut ring: Vec<(u32, u32, DVec3)> = (0..3).map(|k| of(first, k)).collect();
        let mut triangles = vec![first];
        let mut at = 0;
        while at < ring.len() && ring.len() < PIECE {
            let n = ring.len();
            let ((a, edge, _), (b, ..)) = (ring[at], ring[(at + 1) % n]);
            at += 1;
            let [t, u] = *self.triangles_at(edge) else { continue };
            let other = if triangles.contains(&t) { u } else { t };
            let is_alike = self.fronts[first as usize].is_some() == self.fronts[other as usize].is_some();
            if triangles.contains(&other) || self.piece_of[other as usize] != u32::MAX || !is_alike {
                continue;
            }
            let numbers = self.vertices[other as usize];
            let Some(m) = (0..3).find(|&m| numbers[m] == b && numbers[(m + 1) % 3] == a) else { continue };
            let (c, _, pc) = of(other, (m + 2) % 3);
            let flat = normal.dot(pc - plane[0]).abs() <= flatness;
            // The new corner must be beyond the edge that it joins, and on the inner side of all others. A
            // test that all corners turn the same way would accept rings that wind around more than once.
            let inside = |x: DVec3, y: DVec3, p: DVec3| normal.cross(y - x).normalize_or_zero().dot(p - x);
            let is_convex = || {
                let old = |k: usize| inside(ring[k].2, ring[(k + 1) % n].2, pc);
                // The check of proofs asks each corner against each side, so older corners against new sides.
                let new = [(ring[at - 1].2, pc), (pc, ring[at % n].2)];
                (0..n).all(|k| if k + 1 == at { old(k) < 0.0 } else { old(k) >= -flatness })
                    && new.iter().all(|&(x, y)| ring.iter().all(|of| inside(x, y, of.2) >= -flatness))
            };
            if !flat || ring.iter().any(|corner| corner.0 == c) || !is_convex() {
                continue;
            }
            // The neighbour's corners are b, a, c: edge m + 1 joins a and c, edge m + 2 joins c and b.
            ring[at - 1].1 = self.edges[other as usize][(m + 1) % 3];
            ring.insert(at, (c, self.edges[other as usize][(m + 2) % 3], pc));
            triangles.push(other);
            at = 0;
        }
        Piece {
            positions: ring.iter().map(|corner| corner.2).collect(),
            ring: ring.into_iter().map(|corner| corner.0).collect(),
            triangles: triangles.into(),
            made: self.log.serial,
        }
    }

    /// Returns the origin in world coordinates that the triangles, and lines of sight to them, are relative
    /// to.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// Returns whether `scene` is the one whose triangles were collected, and has not changed since. False
    /// for another scene, including a clone.
    pub fn is_current(&self, scene: &Scene) -> bool {
        self.cursor.is_current(scene)
    }

    /// Returns the number of triangles, occluding or not. Triangles of objects with a coordinate that is not
    /// finite are not included.
    pub fn len(&self) -> usize {
        self.objects.iter().map(|object| (object.end - object.first) as usize).sum()
    }

    /// Returns an exclusive upper bound on the indices of triangles.
    pub(crate) fn index_limit(&self) -> usize {
        self.corners.len()
    }

    /// Returns whether there are no triangles.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the number of triangles that occlude.
    pub fn occluder_count(&self) -> usize {
        self.occludes.iter().filter(|&&occludes| occludes).count()
    }

    /// Returns the corners of triangle `i` in scene coordinates.
    #[inline]
    pub(crate) fn corners(&self, i: u32) -> [DVec3; 3] {
        self.corners[i as usize].map(Vec3::as_dvec3)
    }

    /// Returns the area of triangle `i` in square metres.
    pub(crate) fn area(&self, i: u32) -> f32 {
        self.areas[i as usize]
    }

    /// Returns the half-space from which a one-sided triangle is seen. `None` if the triangle is two-sided.
    pub(crate) fn front(&self, i: u32) -> Option<&Half> {
        self.fronts[i as usize].as_ref()
    }

    /// Returns whether a triangle is two-sided, or the viewpoint `from` is certainly in front of it.
    pub(crate) fn shows(&self, i: u32, from: DVec3) -> bool {
        let [a, b, c] = self.corners(i);
        self.front(i).is_none() || sign(side(from, a, b, c, 0.0)) < 0
    }

    pub(crate) fn vertices(&self, i: u32) -> [u32; 3] {
        self.vertices[i as usize]
    }

    pub(crate) fn edges(&self, i: u32) -> [u32; 3] {
        self.edges[i as usize]
    }

    pub(crate) fn edge_count(&self) -> usize {
        let first = self.edge_starts.len().saturating_sub(1);
        self.welding.as_ref().map_or(first, |welding| welding.edge_limit())
    }

    pub(crate) fn occludes(&self, i: u32) -> bool {
        self.occludes[i as usize]
    }

    pub(crate) fn object_of(&self, i: u32) -> usize {
        self.object_of[i as usize] as usize
    }

    /// Returns the occluding triangles that have an edge.
    pub(crate) fn triangles_at(&self, edge: u32) -> &[u32] {
        if let Some(list) = self.welding.as_ref().and_then(|welding| welding.triangles_at(edge)) {
            return list;
        }
        let edge = edge as usize;
        &self.edge_triangles[self.edge_starts[edge] as usize..self.edge_starts[edge + 1] as usize]
    }

    pub(crate) fn piece_of(&self, i: u32) -> u32 {
        self.piece_of[i as usize]
    }

    pub(crate) fn piece(&self, number: u32) -> &Piece {
        &self.pieces[number as usize]
    }

    /// Returns the triangles of a convex polygon. `None` for an unknown index.
    pub(crate) fn piece_triangles(&self, number: u32) -> Option<&[u32]> {
        self.pieces.get(number as usize).map(|piece| &*piece.triangles)
    }

    /// Adds a polygon of triangles without checking that it is convex and occludes. Returns its index.
    #[cfg(test)]
    pub(crate) fn push_piece(&mut self, triangles: &[u32]) -> u32 {
        let piece = Piece { triangles: triangles.into(), ..Piece::empty(0) };
        self.pieces.push(piece);
        self.pieces.len() as u32 - 1
    }

    /// Returns a bound in metres on the absolute error of each coordinate of a computed point, such as a
    /// midpoint of midpoints. No coordinate may exceed `magnitude`, beyond those of the triangles. 60 steps
    /// of one rounding each and a cut of four roundings are less than `128 U` of the greatest coordinate,
    /// with `U` the unit round-off.
    pub(crate) fn position_error(&self, magnitude: f64) -> f64 {
        128.0 * U * self.magnitude.max(magnitude)
    }
}

/// Returns the greater of `magnitude` and the greatest absolute coordinate of a triangle.
fn greatest(magnitude: f64, corners: &[Vec3; 3]) -> f64 {
    corners.iter().fold(magnitude, |most, p| most.max(p.abs().max_element().into()))
}

/// Returns the unit normal of a triangle, correct except for the last bits however thin the triangle is.
/// `None` for a triangle without area.
///
/// The cross product of two sides of a thin triangle cancels. With U the unit round-off, sides of length L
/// and a height of h, its direction in `f64` is wrong by some U L / h, and points of the triangle are off its
/// plane by U L^2 / h. Products of 106 bits leave no such error unless h is below 2^-50 L, which coordinates
/// of 24 bits only have near the origin.
pub(crate) fn unit_normal(t: &[DVec3; 3]) -> Option<DVec3> {
    // Scaled by a power of 2, so that no product underflows or overflows.
    let size = t.iter().map(|v| v.abs().max_element()).fold(0.0, f64::max);
    let scale = f64::from_bits((2046 - (size.to_bits() >> 52 & 0x7ff).clamp(1, 2045)) << 52);
    let side =
        |k: usize| [0, 1, 2].map(|axis| DoubleDouble::difference(t[k][axis] * scale, t[0][axis] * scale));
    let (u, w) = (side(1), side(2));
    let part = |i: usize, j: usize| u[i].times(w[j]).plus(u[j].times(w[i]).negated()).hi;
    DVec3::new(part(1, 2), part(2, 0), part(0, 1)).try_normalize()
}
