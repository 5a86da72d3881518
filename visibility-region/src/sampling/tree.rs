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

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::Object;
    use visibility_core::glam::DVec3;
    use visibility_testing::Random;

    /// Returns the parameter at which a ray meets a triangle, and whether it comes from the front.
    fn met(ray: &Ray, corners: &[Vec3; 3]) -> Option<(f64, bool)> {
        let p = corners.map(|p| p.as_dvec3() - ray.origin);
        let sides: [f64; 3] = core::array::from_fn(|i| ray.along.dot(p[(i + 1) % 3].cross(p[(i + 2) % 3])));
        let normal = (p[1] - p[0]).cross(p[2] - p[0]);
        let at = normal.dot(p[0]) / normal.dot(ray.along);
        let is_met = sides.iter().all(|&side| side > 0.0) || sides.iter().all(|&side| side < 0.0);
        (is_met && at > 0.0).then_some((at, sides[0] < 0.0))
    }

    /// What rays see among random triangles, of objects that block or not and have backs or not, is compared
    /// with what a loop over all triangles finds.
    #[test]
    fn rays_see_what_a_loop_over_all_triangles_finds() {
        let mut random = Random(21);
        let mut counts = [0; 3];
        for count in [1, 4, 5, 8, 30, 100] {
            let mut scene = Scene::new();
            let mut objects: Vec<(ObjectOf, Vec<[Vec3; 3]>)> = Vec::new();
            for _ in 0..count {
                let middle = random.vec3(-9.0, 9.0);
                let size = if random.one_in(3) { 6.0 } else { 2.0 };
                let number = 1 + random.below(3);
                let triangles: Vec<[Vec3; 3]> =
                    (0..number).map(|_| [(); 3].map(|()| middle + random.vec3(-size, size))).collect();
                let of = ObjectOf { blocks: !random.one_in(3), one_sided: random.one_in(3) };
                let bounds = Aabb::from_points(triangles.iter().flatten().copied());
                let object = Object { occluder: of.blocks, one_sided: of.one_sided, ..Object::new(bounds) };
                let id = scene.insert(object);
                assert_eq!(id.index(), objects.len(), "objects have the indices of their insertion");
                scene.set_triangles(id, triangles.as_slice()).unwrap();
                objects.push((of, triangles));
            }
            let mut tree = TriangleTree::new();
            tree.sync(&scene);
            let mut cast = Cast::new();
            for round in 0..600 {
                let [origin, target] = [(); 2].map(|()| random.vec3(-12.0, 12.0).as_dvec3());
                let ray = Ray::through(origin, target).unwrap();
                let hits: Vec<(usize, f64)> = (0..)
                    .zip(&objects)
                    .flat_map(|(index, (of, triangles))| {
                        let met = triangles.iter().filter_map(|triangle| met(&ray, triangle));
                        met.filter(|&(_, is_front)| is_front || !of.one_sided).map(move |(at, _)| (index, at))
                    })
                    .collect();
                // An object is seen where no other object blocks the ray before.
                let first = |index: usize| {
                    hits.iter().filter(|hit| hit.0 == index).map(|hit| hit.1).fold(f64::INFINITY, f64::min)
                };
                let blocked = |index: usize| {
                    let others = hits.iter().filter(|hit| hit.0 != index && objects[hit.0].0.blocks);
                    others.map(|hit| hit.1).fold(f64::INFINITY, f64::min)
                };
                let is_seen = |index: usize| first(index) < blocked(index);
                tree.cast(&ray, &mut cast);
                let seen: Vec<usize> = (0..objects.len())
                    .filter(|&index| cast.seen.iter().any(|seen| seen.0 as usize == index))
                    .collect();
                let expected: Vec<usize> = (0..objects.len()).filter(|&index| is_seen(index)).collect();
                assert_eq!(seen, expected, "{count} objects, ray {round}: {ray:?}");
                for &(index, triangle, at) in &cast.seen {
                    let (of, _) = &objects[index as usize];
                    let exact = met(&ray, &tree.corners(triangle)).unwrap();
                    assert!(exact.1 || !of.one_sided, "{count} objects, ray {round}: the back of {index}");
                    assert!((exact.0 - at).abs() < 1e-6, "{count} objects, ray {round}: {at} is {exact:?}");
                    // Of an object that blocks, nothing is seen behind the place where it ends the ray.
                    let is_first = exact.0 < first(index as usize) + 1e-6;
                    assert!(is_first || !of.blocks, "{count} objects, ray {round}: {index} hides itself");
                    assert!(at < blocked(index as usize), "{count} objects, ray {round}: {index} is hidden");
                }
                let blockers = hits.iter().filter(|hit| objects[hit.0].0.blocks);
                let end = blockers.min_by(|a, b| a.1.total_cmp(&b.1));
                assert_eq!(cast.end.is_some(), end.is_some(), "{count} objects, ray {round}: {:?}", cast.end);
                if let (Some((_, at)), Some(&(_, exact))) = (cast.end, end) {
                    assert!((at - exact).abs() < 1e-6, "{count} objects, ray {round}: ends at {at}, {exact}");
                }
                counts[0] += seen.len();
                counts[1] += usize::from(cast.end.is_some());
                counts[2] += hits.len();
            }
        }
        assert!(counts[0] > 800 && counts[1] > 500 && counts[2] > counts[0] + 300, "{counts:?}");
    }

    #[derive(Clone, Copy)]
    struct ObjectOf {
        blocks: bool,
        one_sided: bool,
    }

    /// A flattened mesh has no certain front: a one-sided object that has one is seen, and blocks nothing.
    #[test]
    fn flattened_meshes_of_one_sided_objects_do_not_block() {
        let wall = Aabb::from_arrays([-1.0, -1.0, 4.0], [1.0, 1.0, 4.5]);
        for (scale, one_sided, blocks) in
            [(1.0, false, true), (1.0, true, true), (0.0, false, true), (0.0, true, false)]
        {
            let mut scene = Scene::new();
            let bounds = Aabb::from_arrays([-1.0, -1.0, 0.0], [1.0, 1.0, 4.5]);
            let id = scene.insert(Object { occluder: true, one_sided, ..Object::new(bounds) });
            let mesh = scene.add_mesh(OccluderMesh::cuboid(&wall).unwrap());
            scene.set_mesh(id, mesh, Affine3A::from_scale(Vec3::new(1.0, 1.0, scale))).unwrap();
            let mut tree = TriangleTree::new();
            tree.sync(&scene);
            let owner = &tree.objects[id.index()];
            assert_eq!(owner.blocks, blocks, "scaled by {scale}, one-sided: {one_sided}");
            assert_eq!(owner.one_sided, one_sided && blocks, "scaled by {scale}, one-sided: {one_sided}");
        }
    }

    /// A wall whose corners a transform moves far away: a ray that passes its rounded border within the
    /// slack may be blocked, although it misses the box around the rounded corners.
    #[test]
    fn rays_within_the_slack_of_a_wall_are_not_free() {
        let mut scene = Scene::new();
        let wall = Aabb::from_arrays([-1.0, -1.0, 4.0], [1.0, 1.0, 4.5]);
        let far = 1e4f32;
        let placed = Aabb::new(wall.min + Vec3::X * far, wall.max + Vec3::X * far);
        let id = scene.insert(Object { occluder: true, ..Object::new(placed) });
        let mesh = scene.add_mesh(OccluderMesh::cuboid(&wall).unwrap());
        scene.set_mesh(id, mesh, Affine3A::from_translation(Vec3::X * far)).unwrap();
        let target = Aabb::from_arrays([far - 9.0, -9.0, 9.0], [far + 9.0, 9.0, 10.0]);
        let behind = scene.insert(Object::new(target));
        let mut tree = TriangleTree::new();
        tree.sync(&scene);
        let slack = f64::from(tree.objects[id.index()].slack);
        assert!(slack >= f64::from(far) * ROUNDED, "{slack}: the rounding of a corner");
        let mut cast = Cast::new();
        let mut is_seen = |beyond: f64| {
            let from = DVec3::new(f64::from(far), 1.0 + beyond, 0.0);
            tree.cast(&Ray::through(from, from + DVec3::Z).unwrap(), &mut cast);
            cast.seen.iter().any(|seen| seen.0 as usize == behind.index())
        };
        for part in [-0.9, -0.1, 0.1, 0.5, 0.9] {
            assert!(!is_seen(part * slack), "{part} of the slack beside the wall");
        }
        assert!(is_seen(300.0 * slack), "a ray far beside the wall");
        // Each node holds its triangles with their slack.
        for node in &tree.nodes {
            let own = &tree.order[node.start as usize..][..node.count as usize];
            for p in own.iter().flat_map(|&t| tree.corners(t).map(|p| (p, tree.owners[t as usize]))) {
                let slack = Vec3::splat(tree.objects[p.1 as usize].slack);
                let holds =
                    node.bounds.contains_point(p.0 - slack) && node.bounds.contains_point(p.0 + slack);
                assert!(holds, "{:?} with {slack} in {:?}", p.0, node.bounds);
            }
        }
    }
}
