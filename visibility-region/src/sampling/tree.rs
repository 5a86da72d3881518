//! The triangles of a scene in a binary tree of bounding boxes, split at the median, for rays (Kay and
//! Kajiya, "Ray Tracing Complex Scenes", 1986).

use super::ray::Ray;
use crate::blocker::Placement;
use alloc::vec::Vec;
use visibility_core::geometry::keeps_orientation;
use visibility_core::glam::{Affine3A, Vec3};
use visibility_core::level_version::level_object;
use visibility_core::scene::SceneCursor;
use visibility_core::{Aabb, OccluderMesh, Scene};

/// Greatest number of triangles in a leaf.
const LEAF: usize = 4;

/// Upper bound on the relative error of a coordinate that was rounded to `f32`: 2^-23, twice the exact bound.
const ROUNDED: f64 = f32::EPSILON as f64;

/// Index of a triangle in the tree.
pub(super) type TriangleIndex = u32;

#[derive(Clone, Copy, Debug)]
struct Node {
    bounds: Aabb,
    /// For a leaf, the start of its triangles in `TriangleTree::order`. For an inner node, the index of its
    /// second child; the first child is the next node.
    start: u32,
    /// Number of triangles of a leaf; 0 for an inner node.
    count: u32,
}

/// Properties of an object that ray casts need, and the range of its triangles.
#[derive(Clone, Copy, Debug, Default)]
struct Owner {
    /// Index of the object's first triangle.
    start: u32,
    /// End of the object's triangles, exclusive. Equal to `start` for an object without triangles.
    end: u32,
    /// Bound on the error of each coordinate of the object's triangles, in metres.
    slack: f32,
    /// Whether the object blocks rays.
    blocks: bool,
    /// Whether rays from behind pass the object's triangles, without seeing them or being blocked.
    one_sided: bool,
}

/// The triangles of all objects of one scene, with their hierarchy.
#[derive(Clone, Debug)]
pub(super) struct TriangleTree {
    cursor: SceneCursor,
    corners: Vec<[Vec3; 3]>,
    /// Object index of each triangle.
    owners: Vec<u32>,
    /// Properties of each object, by object index.
    objects: Vec<Owner>,
    /// Triangles in the order of the leaves.
    order: Vec<TriangleIndex>,
    nodes: Vec<Node>,
}

/// Result of a ray: the triangles that it certainly meets before a place where it may be blocked.
#[derive(Clone, Debug)]
pub(super) struct Cast {
    /// The triangles that the ray certainly sees, each as object index, triangle and ray parameter.
    pub(super) seen: Vec<(u32, TriangleIndex, f64)>,
    /// The triangle that ends the ray, and its parameter. `None` if nothing blocks the ray, or if it is
    /// uncertain which triangle blocks it first.
    pub(super) end: Option<(TriangleIndex, f64)>,
    hits: Vec<Hit>,
    stack: Vec<(u32, f64)>,
}

#[derive(Clone, Copy, Debug)]
struct Hit {
    object: u32,
    triangle: TriangleIndex,
    /// Lower bound of the ray's parameter at which the ray meets the triangle.
    least: f64,
    /// Upper bound of the ray's parameter there. Infinite if the ray may miss the triangle.
    most: f64,
    /// Whether the triangle's object blocks rays.
    blocks: bool,
}

impl Cast {
    pub(super) const fn new() -> Self {
        Self { seen: Vec::new(), end: None, hits: Vec::new(), stack: Vec::new() }
    }
}

impl TriangleTree {
    pub(super) const fn new() -> Self {
        Self {
            cursor: SceneCursor::START,
            corners: Vec::new(),
            owners: Vec::new(),
            objects: Vec::new(),
            order: Vec::new(),
            nodes: Vec::new(),
        }
    }

    /// Builds the tree again if the scene has changed. An object is represented by its triangles; without
    /// any, by those of its occluder mesh; without a mesh, by those of its box, which never blocks. Triangles
    /// that are not finite are left out.
    pub(super) fn sync(&mut self, scene: &Scene) {
        if self.cursor.is_current(scene) {
            return;
        }
        self.cursor = SceneCursor::at(scene);
        self.corners.clear();
        self.owners.clear();
        self.objects.clear();
        self.objects.resize(scene.index_limit(), Owner::default());
        for id in scene.ids() {
            let (Some((object, _)), Ok(triangles)) = (level_object(scene, id), scene.triangles(id)) else {
                continue;
            };
            let start = self.corners.len() as u32;
            // Only what bakes count as occluders blocks rays. Every object can be seen.
            let mut owner =
                Owner { blocks: object.occluder, one_sided: object.one_sided, ..Owner::default() };
            if !triangles.is_empty() {
                self.corners.extend(triangles.iter().filter(|t| t.iter().all(|p| p.is_finite())));
            } else if let Some((mesh, ref transform)) = scene.occluder(id) {
                let placement = Placement::new(mesh, transform);
                let placed = |i: u32| placement.place(mesh.positions()[i as usize].as_dvec3());
                let mut largest = 0.0f64;
                let mut place = |i: u32| {
                    largest = largest.max(placed(i).abs().max_element());
                    placed(i).as_vec3()
                };
                let keeps = keeps_orientation(transform);
                let turned = |[a, b, c]: [u32; 3]| if keeps == Some(false) { [a, c, b] } else { [a, b, c] };
                let triangles = mesh.triangles().iter().map(|&t| turned(t).map(&mut place));
                self.corners.extend(triangles.filter(|t| t.iter().all(|p| p.is_finite())));
                // Of a flattened mesh, no side is certainly the front.
                if keeps.is_none() && object.one_sided {
                    (owner.blocks, owner.one_sided) = (false, false);
                }
                // Corners that were transformed and rounded to `f32` may be off by `slack` metres. A ray that
                // passes within this distance does not certainly meet the triangle.
                if *transform != Affine3A::IDENTITY {
                    owner.slack = (placement.doubt + largest * ROUNDED) as f32;
                }
            } else if object.bounds.is_finite() {
                let corners = object.bounds.corners();
                (owner.blocks, owner.one_sided) = (false, false);
                self.corners.extend(OccluderMesh::CUBOID.map(|t| t.map(|i| corners[i as usize])));
            }
            (owner.start, owner.end) = (start, self.corners.len() as u32);
            self.owners.resize(self.corners.len(), id.index() as u32);
            self.objects[id.index()] = owner;
        }
        self.order.clear();
        self.order.extend(0..self.corners.len() as u32);
        self.nodes.clear();
        if !self.order.is_empty() {
            let mut order = core::mem::take(&mut self.order);
            self.build(&mut order, 0);
            self.order = order;
        }
    }

    /// Builds the nodes above a range of triangles. `start` is the position of the range's first triangle in
    /// `order`.
    fn build(&mut self, range: &mut [TriangleIndex], start: usize) {
        let mut bounds = Aabb::EMPTY;
        let mut centers = Aabb::EMPTY;
        for &triangle in range.iter() {
            let slack = Vec3::splat(self.objects[self.owners[triangle as usize] as usize].slack);
            let corners = Aabb::from_points(self.corners[triangle as usize]);
            bounds = bounds.union(&Aabb::new(corners.min - 2.0 * slack, corners.max + 2.0 * slack));
            let center = corners.center();
            centers = centers.union(&Aabb::new(center, center));
        }
        let node = self.nodes.len();
        let count = if range.len() <= LEAF { range.len() as u32 } else { 0 };
        self.nodes.push(Node { bounds, start: start as u32, count });
        if count > 0 {
            return;
        }
        let size = centers.half_extent();
        let axis = (0..3).max_by(|&a, &b| size[a].total_cmp(&size[b])).unwrap_or(0);
        let middle = range.len() / 2;
        let key = |triangle: u32| {
            let [a, b, c] = self.corners[triangle as usize].map(|p| p[axis] / 3.0);
            a + b + c
        };
        range.select_nth_unstable_by(middle, |&a, &b| key(a).total_cmp(&key(b)).then(a.cmp(&b)));
        let (low, high) = range.split_at_mut(middle);
        self.build(low, start);
        self.nodes[node].start = self.nodes.len() as u32;
        self.build(high, start + middle);
    }

    /// Returns the number of triangles.
    pub(super) fn len(&self) -> usize {
        self.corners.len()
    }

    /// Returns the corners of a triangle, relative to the scene's origin.
    pub(super) fn corners(&self, triangle: TriangleIndex) -> [Vec3; 3] {
        self.corners[triangle as usize]
    }

    /// Returns the range of an object's triangles. `object` is the object's index.
    pub(super) fn triangles_of(&self, object: usize) -> core::ops::Range<u32> {
        self.objects.get(object).map_or(0..0, |owner| owner.start..owner.end)
    }

    /// Casts a ray and stores its result in `cast`.
    ///
    /// A triangle is seen if the ray certainly meets it before any place where another object may block the
    /// ray. If the triangle's own object blocks the ray earlier, the object is seen all the same, at that
    /// place.
    pub(super) fn cast(&self, ray: &Ray, cast: &mut Cast) {
        let Cast { seen, end, hits, stack } = cast;
        seen.clear();
        hits.clear();
        stack.clear();
        *end = None;
        // The ray certainly ends at this parameter or earlier.
        let mut limit = f64::INFINITY;
        if let Some(root) = self.nodes.first()
            && let Some(enter) = ray.enter(root.bounds.min, root.bounds.max)
        {
            stack.push((0, enter));
        }
        // The nearer child is visited first, so that `limit` soon excludes the farther nodes.
        while let Some((node, enter)) = stack.pop() {
            if enter > limit {
                continue;
            }
            let Node { start, count, .. } = self.nodes[node as usize];
            if count == 0 {
                let children = [node + 1, start].map(|child| {
                    let bounds = &self.nodes[child as usize].bounds;
                    (child, ray.enter(bounds.min, bounds.max))
                });
                let a_is_nearer = children[0].1 <= children[1].1;
                let [a, b] = children;
                for (child, enter) in if a_is_nearer { [b, a] } else { [a, b] } {
                    if let Some(enter) = enter.filter(|&enter| enter <= limit) {
                        stack.push((child, enter));
                    }
                }
                continue;
            }
            for &triangle in &self.order[start as usize..(start + count) as usize] {
                let object = self.owners[triangle as usize];
                let Owner { slack, blocks, one_sided, .. } = self.objects[object as usize];
                let met = ray.meet(&self.corners[triangle as usize], slack.into(), one_sided);
                let Some(met) = met else { continue };
                if met.least > limit {
                    continue;
                }
                // All hits before the limit are kept, since the order of two hits may be uncertain.
                if blocks && met.is_certain() {
                    limit = limit.min(met.most);
                }
                hits.push(Hit { object, triangle, least: met.least, most: met.most, blocks });
            }
        }
        // A hit of the first blocking object is compared with the next blocking object, any other hit with
        // the first.
        let blockers = || hits.iter().filter(|hit| hit.blocks);
        let by_least = |a: &&Hit, b: &&Hit| a.least.total_cmp(&b.least);
        let first = blockers().min_by(by_least).copied();
        let second = first.and_then(|first| {
            blockers().filter(|hit| hit.object != first.object).min_by(by_least).map(|hit| hit.least)
        });
        let first_object = first.map(|hit| hit.object);
        // Blockers beyond the limit are not all listed, so no triangle there is known to be seen, such as the
        // back of the object that ends the ray.
        for hit in hits.iter().filter(|hit| hit.most < f64::INFINITY && hit.most <= limit) {
            let free = if Some(hit.object) == first_object { second } else { first.map(|hit| hit.least) };
            if hit.most < free.unwrap_or(f64::INFINITY) {
                seen.push((hit.object, hit.triangle, 0.5 * (hit.least.max(0.0) + hit.most.max(0.0))));
            }
        }
        let ends = seen.iter().filter(|(object, ..)| Some(*object) == first_object);
        *end = ends.min_by(|a, b| a.2.total_cmp(&b.2)).map(|&(_, triangle, at)| (triangle, at));
    }
}
