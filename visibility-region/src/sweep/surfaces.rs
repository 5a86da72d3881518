//! The opaque surfaces of a scene, and the segments along which their triangles meet.
//!
//! Occluders that touch hide more together than individually: no ray passes between two walls that share an
//! edge. A *side* is an edge of a triangle. Triangles meet along segments: two sides with equal ends, or the
//! common part of two sides on one axis-parallel line, as where a long wall meets two short ones. Positions
//! are compared bit by bit, so triangles are joined only where they meet exactly.

use crate::solids;
use alloc::vec::Vec;
use visibility_core::bits::Bits;
use visibility_core::glam::{Affine3A, Vec3};
use visibility_core::scene::Triangle;
use visibility_core::stamp::Stamp;
use visibility_core::union_find::root;
use visibility_core::{Aabb, ObjectId, Scene};

/// Triangles of occluders whose mesh coordinates are scene coordinates, and the segments along which they
/// meet. A segment connects triangles of any occluders of the scene, or only triangles of one object.
#[derive(Clone, Debug, Default)]
pub(crate) struct Surfaces {
    pub(crate) triangles: Vec<Surface>,
    pub(crate) segments: Vec<[Vec3; 2]>,
    /// For each segment, the triangles with a side on it. Each is given as twice the index of the triangle,
    /// plus 1 if the side, in the order of the triangle's corners, runs from the segment's first end to the
    /// second.
    sides: Groups,
    /// Indices of the objects whose triangles are in `triangles`.
    pub(crate) objects: Bits,
    parts: Vec<Part>,
    /// Cluster of each object, by object index. A cluster is a set of objects whose triangles meet along
    /// segments, directly or through others. An object that was listed [by itself](Self::list) is a cluster
    /// of its own. `u32::MAX` for objects that are not in `objects`.
    cluster_of: Vec<u32>,
    /// Changes whenever the surfaces do. `None` without surfaces.
    pub(crate) stamp: Option<Stamp>,
    /// Number of outdated triangles: their objects have since been listed again, in another cluster.
    unused: usize,
    /// Indices of the triangles of each cluster.
    cluster_triangles: Groups,
    /// Indices of the segments of each cluster.
    cluster_segments: Groups,
}

/// Numbers sorted into groups: group `g` is `members[starts[g]..starts[g + 1]]`.
#[derive(Clone, Debug)]
struct Groups {
    starts: Vec<u32>,
    members: Vec<u32>,
}

impl Default for Groups {
    fn default() -> Self {
        Self { starts: alloc::vec![0], members: Vec::new() }
    }
}

impl Groups {
    /// Adds a group.
    fn push(&mut self, members: impl Iterator<Item = u32>) {
        self.members.extend(members);
        self.starts.push(self.members.len() as u32);
    }

    fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// Sorts the numbers 0, 1, 2 and so on into groups. `group_of` yields the group of each number in turn.
    fn new(groups: usize, group_of: impl Iterator<Item = u32> + Clone) -> Self {
        let mut starts = alloc::vec![0u32; groups + 1];
        let mut count = 0;
        for group in group_of.clone() {
            starts[group as usize + 1] += 1;
            count += 1;
        }
        for group in 0..groups {
            starts[group + 1] += starts[group];
        }
        let mut next = starts.clone();
        let mut members = alloc::vec![0; count];
        for (number, group) in (0..).zip(group_of) {
            members[next[group as usize] as usize] = number;
            next[group as usize] += 1;
        }
        Self { starts, members }
    }

    fn get(&self, group: usize) -> &[u32] {
        &self.members[self.starts[group] as usize..self.starts[group + 1] as usize]
    }
}

/// How the back of a triangle affects rays.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Back {
    /// Rays pass through the back.
    Transparent,
    /// The back blocks rays as the front does.
    Opaque,
    /// The back blocks rays that come from outside of the convex solid to which the triangle belongs: such a
    /// ray has passed the front of another triangle of the solid.
    OfSolid,
}

/// A triangle of an occluder, in scene coordinates.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surface {
    pub(crate) corners: Triangle,
    /// Index of the triangle's [part](visibility_core::OccluderMesh::parts), counted over all objects.
    pub(crate) part: u32,
    pub(crate) back: Back,
}

/// A part of a mesh, or a mesh without parts.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Part {
    /// Index of the object that has the part.
    pub(crate) owner: u32,
    pub(crate) bounds: Aabb,
}

/// A side of a triangle, on the line that is identified by `key`.
struct LineSide {
    /// For a side along an axis: the axis (0 to 2), and the bits of the other two coordinates. For any other
    /// side: 3, and the numbers of its two end points, the lower first.
    key: [u32; 3],
    /// For a side along an axis: the coordinates of its ends along this axis, ascending, in metres. Both 0
    /// for other sides.
    ends: [f32; 2],
    /// Twice the index of the triangle, plus 1 if the side runs in the direction of its line, as in
    /// [`Surfaces::sides`].
    side: u32,
    /// Corner of the triangle, from 0 to 2, at which the side begins.
    corner: u32,
}

/// Greatest mean number of triangles for each occluder with which a level counts as modelled wall by wall.
const WALL: usize = 32;

/// Greatest mean number of segments for each side of a triangle on one line. The sides on a line are cut into
/// segments at one another's ends. A line that would have more segments is not cut: its sides join only where
/// they have equal ends. This bounds memory where many long sides and many short ones are on one line.
const MAX_SEGMENTS: usize = 16;

impl Surfaces {
    /// Collects the surfaces of a scene. Takes O(n log n) time for n triangles.
    pub(crate) fn new(scene: &Scene) -> Self {
        let mut all = Self::default();
        scene.ids().for_each(|id| _ = all.add(scene, id));
        all.find_segments(0);
        all.find_clusters(scene.index_limit());
        all.stamp = Some(Stamp::new());
        all
    }

    /// Collects the surfaces of a scene if its occluders have few triangles on average, as in levels that are
    /// modelled wall by wall. Otherwise collects none, since joining objects would then cost more than it
    /// gains: each object is to be [listed](Self::list) by itself.
    pub(crate) fn of_walls(scene: &Scene) -> Self {
        let meshes = || scene.ids().filter_map(|id| scene.occluder(id));
        let triangles: usize = meshes().map(|(mesh, _)| mesh.triangles().len()).sum();
        if triangles <= WALL * meshes().count() { Self::new(scene) } else { Self::default() }
    }

    /// Returns whether a cluster consists of several objects.
    pub(crate) fn joins_objects(&self, cluster: usize) -> bool {
        let triangles = self.triangles_of(cluster);
        let owner = |&triangle: &u32| self.part(&self.triangles[triangle as usize]).owner;
        // The triangles of an object are consecutive.
        triangles.first().map(owner) != triangles.last().map(owner)
    }

    /// Lists the present surfaces of the object with an index, without joining them with other objects. Takes
    /// O(n log n) time for n triangles. If the object was listed before, its former surfaces stay, unused.
    /// Returns the number of triangles.
    pub(crate) fn list(&mut self, scene: &Scene, index: usize) -> usize {
        self.stamp = Some(Stamp::new());
        self.cluster_of.resize(self.cluster_of.len().max(index + 1), u32::MAX);
        if let Some(cluster) = self.cluster_of(index) {
            let owner = |triangle: u32| self.part(&self.triangles[triangle as usize]).owner as usize;
            self.unused += self.triangles_of(cluster).iter().filter(|&&t| owner(t) == index).count();
        }
        self.cluster_of[index] = u32::MAX;
        self.objects.grow(index + 1);
        self.objects.remove(index);
        let (triangles, segments) = (self.triangles.len(), self.segments.len());
        if scene.id_at(index).is_some_and(|id| self.add(scene, id)) {
            self.cluster_of[index] = self.cluster_count() as u32;
            self.find_segments(triangles);
            self.cluster_triangles.push(triangles as u32..self.triangles.len() as u32);
            self.cluster_segments.push(segments as u32..self.segments.len() as u32);
        }
        self.triangles.len() - triangles
    }

    /// Returns whether most triangles are outdated, because their objects have been listed again.
    pub(crate) fn is_mostly_unused(&self) -> bool {
        2 * self.unused > self.triangles.len()
    }

    /// Adds the triangles of an object. Returns false, and adds none, if the object should not be
    /// [among](Self::has) the surfaces.
    fn add(&mut self, scene: &Scene, id: ObjectId) -> bool {
        let Some((mesh, _)) = scene.occluder(id).filter(|_| Self::has(scene, id)) else { return false };
        self.objects.grow(id.index() + 1);
        self.objects.insert(id.index());
        for part in solids::pieces(mesh) {
            let back = match () {
                () if part.is_convex() => Back::OfSolid,
                // The back of a closed mesh cannot be seen from outside.
                () if part.is_two_sided() && !part.is_closed() => Back::Opaque,
                () => Back::Transparent,
            };
            self.triangles.extend(part.triangles().iter().map(|t| Surface {
                // The sum turns -0 into 0, so that equal coordinates have equal bits.
                corners: t.map(|i| part.positions()[i as usize] + 0.0),
                part: self.parts.len() as u32,
                back,
            }));
            self.parts.push(Part { owner: id.index() as u32, bounds: *part.bounds() });
        }
        true
    }

    /// Returns whether an object should be among the surfaces: whether it is an occluder with a mesh in scene
    /// coordinates.
    pub(crate) fn has(scene: &Scene, id: ObjectId) -> bool {
        scene.occluder(id).is_some_and(|(_, transform)| transform == Affine3A::IDENTITY)
    }

    /// Returns the cluster that an object belongs to. `None` for an object that is not in
    /// [`objects`](Self::objects).
    pub(crate) fn cluster_of(&self, object: usize) -> Option<usize> {
        self.cluster_of.get(object).filter(|&&cluster| cluster != u32::MAX).map(|&cluster| cluster as usize)
    }

    /// Returns the number of clusters.
    pub(crate) fn cluster_count(&self) -> usize {
        self.cluster_triangles.len()
    }

    /// Returns the indices of a cluster's triangles, ascending.
    pub(crate) fn triangles_of(&self, cluster: usize) -> &[u32] {
        self.cluster_triangles.get(cluster)
    }

    /// Returns the indices of a cluster's segments, ascending.
    pub(crate) fn segments_of(&self, cluster: usize) -> &[u32] {
        self.cluster_segments.get(cluster)
    }

    fn find_clusters(&mut self, index_limit: usize) {
        let owner = |triangle: u32| self.part(&self.triangles[triangle as usize]).owner;
        let mut parent: Vec<u32> = (0..index_limit as u32).collect();
        for segment in 0..self.segments.len() {
            let sides = self.sides(segment);
            for pair in sides.windows(2) {
                let [a, b] = [pair[0], pair[1]].map(|side| root(&mut parent, owner(side / 2)));
                // A cluster is represented by its first object.
                parent[a.max(b) as usize] = a.min(b);
            }
        }
        let mut cluster_of = alloc::vec![u32::MAX; index_limit];
        let mut count = 0;
        for object in (0..index_limit).filter(|&object| self.objects.contains(object)) {
            let root = root(&mut parent, object as u32) as usize;
            if root == object {
                cluster_of[object] = count;
                count += 1;
            } else {
                cluster_of[object] = cluster_of[root];
            }
        }
        let cluster = |triangle: u32| cluster_of[owner(triangle) as usize];
        let triangles = Groups::new(count as usize, (0..self.triangles.len() as u32).map(cluster));
        let of_segment = |segment: usize| cluster(self.sides(segment)[0] / 2);
        let segments = Groups::new(count as usize, (0..self.segments.len()).map(of_segment));
        (self.cluster_of, self.cluster_triangles, self.cluster_segments) = (cluster_of, triangles, segments);
    }

    /// Returns the part that a triangle belongs to.
    pub(crate) fn part(&self, surface: &Surface) -> &Part {
        &self.parts[surface.part as usize]
    }

    /// Returns the triangles with a side on a segment. Each is given as twice the index of the triangle, plus
    /// 1 if the side, in the order of the triangle's corners, runs from the segment's first end to the
    /// second.
    pub(crate) fn sides(&self, segment: usize) -> &[u32] {
        self.sides.get(segment)
    }

    /// Finds the segments along which triangles meet, for the triangles from index `first` on.
    fn find_segments(&mut self, first: usize) {
        let mut sides = self.line_sides(first);
        sides.sort_unstable_by(|a, b| a.key.cmp(&b.key).then(a.side.cmp(&b.side)));
        // Sides on one line along an axis may overlap in part, as at T-junctions. The line is cut at all
        // their ends, so that each segment is on the same sides over its whole length.
        let mut cuts: Vec<f32> = Vec::new();
        for line in sides.chunk_by(|a, b| a.key == b.key) {
            if line[0].key[0] == 3 {
                self.push_segment(self.points(&line[0]), line.iter().map(|side| side.side));
                continue;
            }
            cuts.clear();
            cuts.extend(line.iter().flat_map(|side| side.ends));
            cuts.sort_unstable_by(f32::total_cmp);
            cuts.dedup();
            let at = |x: f32| cuts.partition_point(|&cut| cut < x);
            let count: usize = line.iter().map(|side| at(side.ends[1]) - at(side.ends[0])).sum();
            let mut pieces: Vec<([u32; 2], u32)> = Vec::new();
            for side in line {
                let [low, high] = side.ends.map(|x| at(x) as u32);
                // With too many cuts for the number of sides, each side stays one segment. Then fewer
                // triangles join, which costs only occlusion.
                if count > MAX_SEGMENTS * line.len() {
                    pieces.push(([low, high], side.side));
                } else {
                    pieces.extend((low..high).map(|i| ([i, i + 1], side.side)));
                }
            }
            pieces.sort_unstable();
            let axis = line[0].key[0] as usize;
            let first = self.points(&line[0])[0];
            for group in pieces.chunk_by(|a, b| a.0 == b.0) {
                let ends = group[0].0.map(|cut| {
                    let mut point = first;
                    point[axis] = cuts[cut as usize];
                    point
                });
                self.push_segment(ends, group.iter().map(|piece| piece.1));
            }
        }
    }

    fn push_segment(&mut self, ends: [Vec3; 2], sides: impl Iterator<Item = u32>) {
        self.segments.push(ends);
        self.sides.push(sides);
    }

    /// Returns the two ends of a triangle's side, in the direction of its line: the same order for all sides
    /// with one `key`, however their triangles turn. On a line along an axis, the end with the lesser
    /// coordinate comes first.
    fn points(&self, side: &LineSide) -> [Vec3; 2] {
        let corners = self.triangles[side.side as usize / 2].corners;
        let (a, b) = (corners[side.corner as usize], corners[(side.corner as usize + 1) % 3]);
        if side.side % 2 == 1 { [a, b] } else { [b, a] }
    }

    /// Returns the sides of the triangles from index `first` on, each with its line.
    fn line_sides(&self, first: usize) -> Vec<LineSide> {
        let bits = |p: Vec3| p.to_array().map(f32::to_bits);
        let triangles = &self.triangles[first..];
        // Equal corners get equal numbers.
        let mut points: Vec<[u32; 3]> = Vec::with_capacity(3 * triangles.len());
        points.extend(triangles.iter().flat_map(|t| t.corners).map(bits));
        points.sort_unstable();
        points.dedup();
        let number = |p: Vec3| points.partition_point(|q| *q < bits(p)) as u32;
        let mut sides = Vec::with_capacity(3 * triangles.len());
        for (index, surface) in (first as u32..).zip(triangles) {
            for corner in 0..3 {
                let (a, b) = (surface.corners[corner], surface.corners[(corner + 1) % 3]);
                let same = [a.x == b.x, a.y == b.y, a.z == b.z];
                // The key of a side along an axis is the axis and the other two coordinates, so that all
                // sides on the line have the same key. The key of any other side is its two end points.
                if same.iter().filter(|&&same| same).count() == 2 {
                    let axis = same.iter().position(|same| !same).unwrap_or(0);
                    let forward = a[axis] < b[axis];
                    let (low, high) = if forward { (a, b) } else { (b, a) };
                    sides.push(LineSide {
                        key: [axis as u32, low[(axis + 1) % 3].to_bits(), low[(axis + 2) % 3].to_bits()],
                        ends: [low[axis], high[axis]],
                        side: 2 * index + u32::from(forward),
                        corner: corner as u32,
                    });
                } else {
                    let (p, q) = (number(a), number(b));
                    let forward = p < q;
                    sides.push(LineSide {
                        key: [3, p.min(q), p.max(q)],
                        ends: [0.0; 2],
                        side: 2 * index + u32::from(forward),
                        corner: corner as u32,
                    });
                }
            }
        }
        sides
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::{Object, OccluderMesh};
    use visibility_testing::Random;

    /// Returns a scene of occluders in scene coordinates.
    fn scene_of(meshes: impl IntoIterator<Item = OccluderMesh>) -> Scene {
        let mut scene = Scene::new();
        for mesh in meshes {
            let id = scene.insert(Object { occluder: true, ..Object::new(*mesh.bounds()) });
            let mesh = scene.add_mesh(mesh);
            scene.set_mesh(id, mesh, Affine3A::IDENTITY).unwrap();
        }
        scene
    }

    /// Segments of random triangles on a small grid are listed with all sides that run along them and no
    /// others, and cover each side. Clusters are the objects that segments connect.
    #[test]
    fn segments_hold_the_sides_along_them_and_clusters_what_they_connect() {
        let mut random = Random(1);
        let (mut shared, mut apart) = (0, 0);
        for round in 0..300 {
            let mut meshes = Vec::new();
            while meshes.len() < 6 {
                let mut corner = || Vec3::from_array([0; 3].map(|_| random.below(3) as f32));
                let triangles = [0; 2].map(|_| [corner(), corner(), corner()]);
                meshes.extend(OccluderMesh::from_triangles(&triangles));
            }
            let surfaces = Surfaces::new(&scene_of(meshes));
            let owner = |t: u32| surfaces.part(&surfaces.triangles[t as usize]).owner as usize;
            let all_sides = || {
                (0u32..).zip(&surfaces.triangles).flat_map(|(t, surface)| {
                    (0..3).map(move |k| (t, surface.corners[k], surface.corners[(k + 1) % 3]))
                })
            };
            let mut covered = alloc::vec![0.0; surfaces.triangles.len()];
            let mut label: Vec<usize> = (0..6).collect();
            for (at, &[p, q]) in surfaces.segments.iter().enumerate() {
                let is_axial = [q.x != p.x, q.y != p.y, q.z != p.z].iter().filter(|&&x| x).count() == 1;
                let mut expected: Vec<u32> = all_sides()
                    .filter(|&(_, a, b)| {
                        let on = |x: Vec3| {
                            let share = (x - a).dot(b - a);
                            (x - a).cross(b - a) == Vec3::ZERO
                                && (0.0..=(b - a).length_squared()).contains(&share)
                        };
                        if is_axial { on(p) && on(q) } else { (a, b) == (p, q) || (a, b) == (q, p) }
                    })
                    .map(|(t, a, b)| 2 * t + u32::from((b - a).dot(q - p) > 0.0))
                    .collect();
                let mut listed = surfaces.sides(at).to_vec();
                expected.sort_unstable();
                listed.sort_unstable();
                assert_eq!(listed, expected, "round {round}: sides on the segment {p} to {q}");
                shared += usize::from(listed.len() > 1);
                for side in &listed {
                    covered[*side as usize / 2] += f64::from(p.distance(q));
                    let [a, b] = [*side, listed[0]].map(|side| label[owner(side / 2)]);
                    label.iter_mut().filter(|label| **label == a.max(b)).for_each(|label| *label = a.min(b));
                }
            }
            for (surface, covered) in surfaces.triangles.iter().zip(covered) {
                let [a, b, c] = surface.corners;
                let around = f64::from(a.distance(b) + b.distance(c) + c.distance(a));
                assert!(
                    (around - covered).abs() < 1e-5,
                    "round {round}: {covered} of {around} have segments"
                );
            }
            for a in 0..6 {
                let cluster = surfaces.cluster_of(a).unwrap();
                let is_own = |b: usize| surfaces.cluster_of(b) == Some(cluster);
                assert!((0..6).all(|b| is_own(b) == (label[a] == label[b])), "round {round}: {label:?}");
                let own: Vec<u32> =
                    (0..surfaces.triangles.len() as u32).filter(|&t| is_own(owner(t))).collect();
                assert_eq!(surfaces.triangles_of(cluster), own, "round {round}: triangles of {cluster}");
                let own: Vec<u32> = (0..surfaces.segments.len() as u32)
                    .filter(|&at| is_own(owner(surfaces.sides(at as usize)[0] / 2)))
                    .collect();
                assert_eq!(surfaces.segments_of(cluster), own, "round {round}: segments of {cluster}");
                let is_joined = (0..6).any(|b| b != a && is_own(b));
                assert_eq!(surfaces.joins_objects(cluster), is_joined, "round {round}: objects of {cluster}");
                apart += usize::from(!is_joined);
            }
        }
        assert!(shared > 300 && apart > 100, "{shared} shared segments, {apart} objects alone");
    }

    /// Long and short sides along one line: segments are as many as sixteen for each side, or the line is not
    /// cut.
    #[test]
    fn a_line_with_too_many_segments_is_not_cut() {
        for (long, expected) in [(1, 31), (31, 31), (32, 32)] {
            let apex = |i: usize| Vec3::new(7.0, 1.0 + i as f32, 3.0 + (i * i) as f32);
            let ends = (0..31).map(|i| [i as f32, i as f32 + 1.0]).chain((0..long).map(|_| [0.0, 31.0]));
            let triangles: Vec<Triangle> =
                ends.enumerate().map(|(i, [a, b])| [Vec3::X * a, Vec3::X * b, apex(i)]).collect();
            let surfaces = Surfaces::new(&scene_of(OccluderMesh::from_triangles(&triangles)));
            let on_line = |ends: &&[Vec3; 2]| ends.iter().all(|p| p.y == 0.0 && p.z == 0.0);
            assert_eq!(surfaces.segments.iter().filter(on_line).count(), expected, "{long} long sides");
        }
    }

    #[test]
    fn objects_are_joined_if_they_have_few_triangles_each() {
        for (triangles, clusters) in [(WALL, 2), (WALL + 1, 0)] {
            let fan = |at: f32, triangles: usize| {
                let corner = |i: usize| Vec3::new(at, i as f32, (i * i) as f32);
                let fan: Vec<Triangle> =
                    (1..=triangles).map(|i| [corner(0), corner(i), corner(i + 1)]).collect();
                OccluderMesh::from_triangles(&fan).unwrap()
            };
            let scene = scene_of([fan(0.0, triangles), fan(1.0, WALL)]);
            assert_eq!(Surfaces::of_walls(&scene).cluster_count(), clusters, "{triangles} triangles");
        }
    }

    /// The back of an open two-sided mesh occludes, that of a solid does from outside, and no other.
    #[test]
    fn backs_occlude_where_they_are_seen() {
        let cube = || OccluderMesh::cuboid(&Aabb::from_arrays([0.0; 3], [1.0; 3])).unwrap();
        let triangles: Vec<Triangle> = {
            let cube = cube();
            cube.triangles().iter().map(|t| t.map(|i| cube.positions()[i as usize])).collect()
        };
        let open = || OccluderMesh::from_triangles(&triangles[1..]).unwrap();
        // The inner side of a cube is its front: it is closed, and no solid.
        let turned: Vec<Triangle> = triangles.iter().map(|&[a, b, c]| [a, c, b]).collect();
        let turned = || OccluderMesh::from_triangles(&turned).unwrap();
        for (what, mesh, back) in [
            ("a solid", cube(), Back::OfSolid),
            ("a two-sided solid", cube().with_two_sided(true), Back::OfSolid),
            ("open", open(), Back::Transparent),
            ("open and two-sided", open().with_two_sided(true), Back::Opaque),
            ("closed", turned(), Back::Transparent),
            ("closed and two-sided", turned().with_two_sided(true), Back::Transparent),
        ] {
            let surfaces = Surfaces::new(&scene_of([mesh]));
            assert!(surfaces.triangles.iter().all(|surface| surface.back == back), "{what}");
        }
    }

    #[test]
    fn an_object_that_is_listed_again_leaves_its_former_surfaces_unused() {
        let mut scene = Scene::new();
        let ids = [0.0, 1.0].map(|x| {
            let bounds = Aabb::from_arrays([x, 0.0, 0.0], [x + 1.0, 1.0, 1.0]);
            let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
            let mesh = scene.add_mesh(OccluderMesh::cuboid(&bounds).unwrap());
            scene.set_mesh(id, mesh, Affine3A::IDENTITY).unwrap();
            id
        });
        let mut surfaces = Surfaces::default();
        for (round, clusters) in [[0, 1], [2, 3], [4, 5]].into_iter().enumerate() {
            let before = surfaces.stamp;
            assert_eq!(ids.map(|id| surfaces.list(&scene, id.index())), [12; 2], "triangles of the cubes");
            assert_ne!(surfaces.stamp, before, "what is kept for the former surfaces is dropped");
            let found = ids.map(|id| surfaces.cluster_of(id.index()).expect("a cluster"));
            assert_eq!(found, clusters, "the cubes share an edge, but are listed apart");
            for cluster in clusters {
                let of = |side: &u32| surfaces.part(&surfaces.triangles[*side as usize / 2]).owner as usize;
                let segments = surfaces.segments_of(cluster);
                assert_eq!(segments.len(), 18, "segments of a cube, with its diagonals");
                let mut owners =
                    segments.iter().flat_map(|&segment| surfaces.sides(segment as usize)).map(of);
                assert!(owners.all(|owner| owner == ids[cluster % 2].index()), "sides of one cube alone");
            }
            assert_eq!(surfaces.is_mostly_unused(), round == 2, "after {round} changes of both cubes");
        }
        scene.remove(ids[0]).unwrap();
        assert_eq!(surfaces.list(&scene, ids[0].index()), 0, "an object that is gone");
        assert_eq!(ids.map(|id| surfaces.cluster_of(id.index()).is_some()), [false, true], "the other stays");
    }
}
