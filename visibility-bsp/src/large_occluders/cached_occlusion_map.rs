//! The occlusion map made of a frame's groups, with a cache of answers per box.

use super::group::{Edge, Face, Group};
use crate::clip_projection::ClipProjection;
use crate::occluders::Occluders;
use alloc::vec::Vec;
use hashbrown::HashMap;
use visibility_core::glam::{Affine3A, DVec3};
use visibility_core::{
    Aabb, Accuracy, OccluderMesh, OcclusionMap, View,
    occlusion::{Occlusion, Occlusion64},
    scene::Boxes64,
    view::Eye,
};

/// A cached answer for a box, and the ball of eye positions for which it holds.
#[derive(Clone, Copy, Debug)]
struct Known {
    /// Centre of the ball: the eye of the frame that computed the answer, in metres relative to
    /// `Scene::origin`.
    eye: DVec3,
    /// Radius of the ball in metres. The answer holds while the eye stays inside.
    radius: f64,
    /// Bound in metres on the error of `eye`, already subtracted from `radius`.
    eye_error: f64,
    /// The answer that holds inside the ball.
    answer: Occlusion,
    /// Number of the last frame in which a test used this answer.
    frame: u64,
}

/// The answer cache and the groups of polygons, both of which `test_mut` updates.
#[derive(Clone, Debug, Default)]
struct Memory {
    /// Cached answers. The key is the bits of the box's minimum and maximum coordinates, so a box that has
    /// moved counts as another box.
    known: HashMap<[u32; 6], Known>,
    /// Number of answers that the present frame computed instead of taking from the cache.
    computed: u64,
    /// Groups of polygons that boxes are tested against.
    groups: Groups,
}

/// The polygons in use, with everything that depends on the eye of the frame.
#[derive(Clone, Debug, Default)]
struct Groups {
    /// Plane of each polygon, by the polygon's position in the list given to `GroupMap::group`.
    faces: Vec<Face>,
    /// Bounding edges of all groups; each group's edges are consecutive.
    edges: Vec<Edge>,
    /// Groups: all single polygons in the order of `faces`, then all pairs that share an edge.
    groups: Vec<Group>,
    /// Number of the frame for whose eye `edges` and `groups` are computed; 0 for none. They are computed
    /// only in frames in which some answer is not in the cache.
    computed_for_frame: u64,
}

/// Number of frames after which an answer that no test has asked for is dropped.
const FORGET: u64 = 64;

/// An occlusion map of single polygons and pairs of them, with a cache of answers.
#[derive(Clone, Debug)]
pub(super) struct GroupMap {
    /// Whether answers are cached between frames; if false, every test computes its answer.
    pub(super) coherent: bool,
    /// Projection of the present frame's view.
    projection: ClipProjection,
    /// Number of the present frame, counted from 1; 0 before the first.
    frame: u64,
    /// Cache and groups, which `test_mut` changes.
    memory: Memory,
    /// Scratch for finding shared edges: for each edge, its ends as returned by [`key`], the index of its
    /// polygon in `Groups::faces`, and the index of the edge in `Groups::edges`.
    shared: Vec<([u64; 6], usize, usize)>,
}

impl GroupMap {
    /// Creates a map without polygons that hides nothing, with the cache on.
    pub(super) fn new() -> Self {
        Self {
            coherent: true,
            projection: ClipProjection::BLIND,
            frame: 0,
            memory: Memory::default(),
            shared: Vec::new(),
        }
    }

    /// Returns the number of answers that the present frame computed instead of taking from the cache.
    pub(super) fn computed(&self) -> u64 {
        self.memory.computed
    }

    /// Removes all polygons and all cached answers.
    pub(super) fn forget(&mut self) {
        let memory = &mut self.memory;
        memory.known.clear();
        memory.groups.groups.clear();
        memory.groups.faces.clear();
        memory.groups.edges.clear();
    }

    /// Replaces the polygons by those with the given indices in `occluders`, makes pairs of those that share
    /// an edge, and drops all cached answers.
    pub(super) fn group(&mut self, occluders: &Occluders, polygons: &[u32]) {
        self.forget();
        self.shared.clear();
        let Groups { faces, edges, groups, computed_for_frame } = &mut self.memory.groups;
        *computed_for_frame = 0;
        for (number, &polygon) in polygons.iter().enumerate() {
            let occluder_polygon = occluders.occluder_polygon(polygon);
            let v = occluder_polygon.vertices;
            let first = edges.len();
            for i in 0..v.len() {
                let ends = [v[i], v[(i + 1) % v.len()]];
                self.shared.push((key(ends), number, first + i));
                edges.push(Edge::new(ends, number, occluder_polygon.placing_error));
            }
            faces.push(Face::new(&occluder_polygon));
            groups.push(Group { edges: first..edges.len(), polygons: [number; 2], usable: true });
        }
        // Edges shared by exactly two polygons, whichever way each polygon runs along them.
        self.shared.sort_unstable();
        for i in 1..self.shared.len() {
            let (one, two) = (self.shared[i - 1], self.shared[i]);
            let among_three =
                [i.wrapping_sub(2), i + 1].iter().any(|&k| self.shared.get(k).is_some_and(|s| s.0 == one.0));
            if one.0 != two.0 || one.1 == two.1 || among_three {
                continue;
            }
            let first = edges.len();
            for (polygon, left_out) in [(one.1, one.2), (two.1, two.2)] {
                for edge in groups[polygon].edges.clone() {
                    if edge != left_out {
                        edges.push(edges[edge]);
                    }
                }
            }
            groups.push(Group { edges: first..edges.len(), polygons: [one.1, two.1], usable: false });
        }
    }

    /// Tests a box (`min` to `max` in metres relative to `Scene::origin`) against all groups of polygons.
    /// Computes the groups for the present eye first, if no earlier test of the frame has. Returns the
    /// answer, `Hidden` or `Partial`, and the radius in metres within which the eye may move before the
    /// answer can change.
    fn compute(&mut self, min: DVec3, max: DVec3) -> (Occlusion, f64) {
        let memory = &mut self.memory;
        memory.computed += 1;
        if memory.groups.computed_for_frame != self.frame {
            memory.groups.computed_for_frame = self.frame;
            memory.groups.update_eye(&self.projection);
        }
        memory.groups.compute(&self.projection.eye, self.coherent, min, max)
    }
}

impl Groups {
    /// Determines the side of each polygon that the eye is on. Returns true if, since the last call, the eye
    /// has changed sides of any polygon, or its side has become certain or uncertain: cached answers are then
    /// invalid. False if they stay valid.
    fn turn(&mut self, projection: &ClipProjection) -> bool {
        let clear = projection.clearance();
        let mut turned = false;
        for face in &mut self.faces {
            let known = (face.usable, face.from_front);
            face.update_eye(&projection.eye, projection.eye_error, clear);
            turned |= known != (face.usable, face.from_front);
        }
        turned
    }

    /// Computes the planes through the eye and all edges, and determines whether each group may hide boxes in
    /// this frame (`Group::usable`).
    fn update_eye(&mut self, projection: &ClipProjection) {
        let (eye, error) = (projection.eye, projection.eye_error);
        for edge in &mut self.edges {
            edge.update_eye(&eye, error, self.faces[edge.face].from_front);
        }
        for number in 0..self.groups.len() {
            let group = &self.groups[number];
            let joined = self.is_joined(group);
            // For a parallel view, no distance from the eye bounds the part cut by the near plane. A polygon
            // that is not wholly beyond the near plane is therefore not used. Both ends of each edge are
            // tested: with two polygons of equal orientation, no remaining edge begins at one of the ends of
            // the shared edge.
            let uneven = group.polygons.map(|polygon| self.faces[polygon].near_unevenness(projection));
            let surely_beyond = |edge: &Edge| {
                edge.ends.iter().all(|&end| {
                    let (value, error) = projection.beyond_near(end, edge.placing_error);
                    value > error + 2.0 * uneven[0].max(uneven[1])
                })
            };
            let cut = matches!(eye, Eye::Direction(_))
                && !self.edges[group.edges.clone()].iter().all(surely_beyond);
            self.groups[number].usable = joined && !cut;
        }
    }

    /// Tests whether the eye sees the two polygons of a group on opposite sides of their shared edge. True
    /// for a single polygon.
    fn is_joined(&self, group: &Group) -> bool {
        let [a, b] = group.polygons;
        if a == b {
            return true;
        }
        // The polygons must run along the shared edge in opposite directions, each seen from the side that
        // the eye is on.
        let [one, two] = [a, b].map(|polygon| &self.groups[polygon]);
        for i in one.edges.clone() {
            for j in two.edges.clone() {
                let (p, q) = (self.edges[i].ends, self.edges[j].ends);
                let (same, opposite) = (p == q, p[0] == q[1] && p[1] == q[0]);
                if same || opposite {
                    let turned = self.faces[a].from_front != self.faces[b].from_front;
                    return opposite != turned;
                }
            }
        }
        false
    }

    /// Tests a box (`min` to `max` in metres relative to `Scene::origin`) against all groups of polygons.
    /// Returns `Hidden` or `Partial` (also if undecided), and the radius in metres within which the eye may
    /// move before the answer can change. The radius is infinite if no group limits it, and has no meaning
    /// for parallel views or if `coherent` is false.
    fn compute(&self, eye: &Eye, coherent: bool, min: DVec3, max: DVec3) -> (Occlusion, f64) {
        let point = match eye {
            Eye::Point(eye) if coherent => Some(*eye),
            _ => None,
        };
        let mut radius = f64::INFINITY;
        for group in &self.groups {
            let [a, b] = group.polygons.map(|polygon| &self.faces[polygon]);
            // These conditions depend on the eye only through the side of each polygon that it is on; a
            // change of side clears the cache.
            if !(a.usable && b.usable && group.usable)
                || a.back.side(min, max) != -1
                || b.back.side(min, max) != -1
            {
                continue;
            }
            let edges = &self.edges[group.edges.clone()];
            let failing = edges.iter().find(|edge| !edge.holds(eye, min, max));
            match (failing, point) {
                (Some(edge), Some(point)) if radius > 0.0 => {
                    radius = radius.min(edge.clearance(point, min, max)[1])
                }
                (Some(_), _) => {}
                (None, None) => return (Occlusion::Hidden, 0.0),
                (None, Some(point)) => {
                    let mut holds = f64::INFINITY;
                    for edge in edges {
                        holds = holds.min(edge.clearance(point, min, max)[0]);
                    }
                    return (Occlusion::Hidden, holds);
                }
            }
        }
        (Occlusion::Partial, radius)
    }
}

/// Returns the ends of an edge as the bits of their coordinates, the lesser end first, so that both
/// directions of an edge have the same key. Positive and negative zero give the same bits.
fn key(ends: [DVec3; 2]) -> [u64; 6] {
    let [a, b] = ends.map(|p| (p + 0.0).to_array().map(f64::to_bits));
    let (a, b) = if a <= b { (a, b) } else { (b, a) };
    [a[0], a[1], a[2], b[0], b[1], b[2]]
}

impl OcclusionMap for GroupMap {
    fn name(&self) -> &str {
        "large-occluders"
    }

    fn accuracy(&self) -> Accuracy {
        Accuracy::Conservative
    }

    fn begin(&mut self, view: &View, origin: DVec3) {
        self.frame += 1;
        self.projection = ClipProjection::new(view, origin);
        let memory = &mut self.memory;
        memory.computed = 0;
        if memory.groups.turn(&self.projection) {
            memory.known.clear();
        }
        if self.frame.is_multiple_of(FORGET) {
            let frame = self.frame;
            memory.known.retain(|_, known| frame - known.frame < FORGET);
        }
    }

    fn add(&mut self, _: &OccluderMesh, _: &Affine3A) {}

    fn flush(&mut self) {}

    /// Tests a box without the cache. `Partial` if the groups are not computed for the present eye yet.
    fn test(&self, bounds: &Aabb) -> Occlusion {
        if !bounds.is_finite() {
            return Occlusion::Visible;
        }
        let groups = &self.memory.groups;
        if groups.computed_for_frame != self.frame || !self.projection.is_beyond_near(bounds) {
            return Occlusion::Partial;
        }
        groups.compute(&self.projection.eye, false, bounds.min.as_dvec3(), bounds.max.as_dvec3()).0
    }

    fn test_64_mut(&mut self, boxes: &Boxes64, candidates: u64) -> Occlusion64 {
        Occlusion64::of_each(candidates, |lane| self.test_mut(&boxes.get(lane)))
    }

    fn test_mut(&mut self, bounds: &Aabb) -> Occlusion {
        if !bounds.is_finite() {
            return Occlusion::Visible;
        }
        if !self.projection.is_beyond_near(bounds) {
            return Occlusion::Partial;
        }
        let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let Eye::Point(eye) = self.projection.eye else { return self.compute(min, max).0 };
        if !self.coherent {
            return self.compute(min, max).0;
        }
        let [x0, y0, z0] = bounds.min.to_array().map(f32::to_bits);
        let [x1, y1, z1] = bounds.max.to_array().map(f32::to_bits);
        let bits = [x0, y0, z0, x1, y1, z1];
        let eye_error = self.projection.eye_error;
        if let Some(known) = self.memory.known.get_mut(&bits)
            && let radius = known.radius - (eye_error - known.eye_error).max(0.0)
            && radius >= 0.0
            && known.eye.distance_squared(eye) <= radius * radius
        {
            known.frame = self.frame;
            return known.answer;
        }
        let (answer, radius) = self.compute(min, max);
        // The radius is reduced by a margin: distances to planes are off by far less than a millionth of the
        // box's distance.
        let size = eye.abs().max(min.abs()).max(max.abs()).max_element();
        let doubt = 1e-9 * size + 4.0 * eye_error;
        let radius = (radius * (1.0 - 1e-6) - doubt).max(0.0);
        self.memory.known.insert(bits, Known { eye, radius, eye_error, answer, frame: self.frame });
        answer
    }

    fn reset(&mut self) {
        self.memory.known.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shadow::OccluderPolygon;
    use std::format;
    use visibility_core::glam::Vec3;
    use visibility_core::{Object, Pose, Scene, occlusion::Preparation, view::Window};
    use visibility_testing::Random;

    type Corners = [Vec3; 3];

    /// Returns the polygons of triangles that are seen from both sides, each an object of its own.
    fn polygons_of(triangles: &[Corners], two_sided: bool) -> Occluders {
        let mut scene = Scene::new();
        for &triangle in triangles {
            let bounds = Aabb::from_points(triangle);
            let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
            scene.set_triangles(id, [triangle]).unwrap();
        }
        scene.prepare_occluders(&Preparation::default().with_sliver(0.0).with_two_sided(two_sided));
        Occluders::new(&scene)
    }

    fn map_of(occluders: &Occluders, coherent: bool) -> GroupMap {
        let mut map = GroupMap { coherent, ..GroupMap::new() };
        let all: Vec<u32> = (0..occluders.len() as u32).collect();
        map.group(occluders, &all);
        map
    }

    fn look(eye: DVec3, target: DVec3) -> View {
        View::perspective(Pose::look_at(eye, target, DVec3::new(0.1, 0.2, 1.0)), 1.0, 1.0, 0.01, 99.0)
            .unwrap()
    }

    /// Tests whether the segment from `eye` to `p` clearly passes all triangles.
    fn passes(triangles: &[Corners], eye: DVec3, p: DVec3) -> bool {
        triangles.iter().all(|triangle| {
            let [a, b, c] = triangle.map(|v| v.as_dvec3());
            let normal = (b - a).cross(c - a);
            let (from, to) = (normal.dot(eye - a), normal.dot(p - a));
            if from * to > 0.0 {
                return true;
            }
            let at = eye + (p - eye) * (from / (from - to));
            [(a, b), (b, c), (c, a)].iter().any(|(p, q)| {
                (*q - *p).cross(at - *p).dot(normal) < -1e-6 * normal.length() * (*q - *p).length()
            })
        })
    }

    /// Triangles that share an edge, two or three, folded over each other or not as the eye sees them. What
    /// is hidden is hidden from all sight to its corners, and answers that are kept are those of a map that
    /// keeps none.
    #[test]
    fn what_single_polygons_and_pairs_hide_is_out_of_sight() {
        let mut random = Random(71);
        let (mut hidden, mut kept, mut by_pairs) = (0, 0, 0);
        for scene in 0..150 {
            let mut turns = Random(scene as u64);
            let mut point = |size: f64| random.fine_vector(size).as_vec3();
            let (p, q) = (point(1.0) + Vec3::Z * 3.0, point(1.0) - Vec3::Z * 3.0);
            let mut triangles: Vec<Corners> = [4.0, -4.0, 4.0]
                .map(|y| {
                    let apex = point(2.5) + Vec3::Y * y;
                    if apex.x > 0.0 { [p, q, apex] } else { [q, p, apex] }
                })
                .to_vec();
            // One of another edge, of which one end is the same.
            triangles.push([p, point(3.0) + Vec3::Y * 5.0, point(3.0) + Vec3::Y * 8.0]);
            // The shared edge is anywhere among the edges of each.
            triangles.iter_mut().for_each(|triangle| triangle.rotate_left(turns.below(3)));
            triangles.truncate(2 + scene % 3);
            if scene % 5 == 0 {
                triangles.swap_remove(1);
            }
            let occluders = polygons_of(&triangles, scene % 2 == 0);
            assert_eq!(occluders.len(), triangles.len(), "polygons");
            let [mut map, mut plain] = [true, false].map(|coherent| map_of(&occluders, coherent));
            // Each polygon alone.
            let mut single = map_of(&occluders, false);
            single.memory.groups.groups.truncate(triangles.len());
            let mut eye = random.fine_vector(3.0) + DVec3::X * 7.0;
            let boxes: Vec<Aabb> = (0..25)
                .map(|_| {
                    let min = random.fine_vector(3.0).as_vec3() - Vec3::X * 3.0;
                    Aabb::new(min, min + random.fine_vector(0.7).abs().as_vec3())
                })
                .collect();
            for frame in 0..12 {
                eye += random.fine_vector([0.05, 0.4][frame % 2]);
                let view = look(eye, DVec3::ZERO);
                for map in [&mut map, &mut plain, &mut single] {
                    map.begin(&view, DVec3::ZERO);
                }
                for bounds in &boxes {
                    // Groups of the eye of the last frame decide nothing.
                    let is_computed = plain.memory.groups.computed_for_frame == plain.frame;
                    assert!(is_computed || plain.test(bounds) == Occlusion::Partial, "before a test");
                    let [answer, expected, alone] =
                        [&mut map, &mut plain, &mut single].map(|map| map.test_mut(bounds));
                    assert_eq!(answer, expected, "scene {scene}, frame {frame}: {bounds:?} from {eye}");
                    assert_eq!(plain.test(bounds), expected, "scene {scene}, frame {frame}: without memory");
                    if answer == Occlusion::Hidden {
                        hidden += 1;
                        by_pairs += usize::from(alone != answer);
                        for corner in bounds.corners().map(|corner| corner.as_dvec3()) {
                            let is_seen = passes(&triangles, eye, corner);
                            assert!(
                                !is_seen,
                                "scene {scene}, frame {frame}: {corner} from {eye} by {triangles:?}"
                            );
                        }
                    }
                }
                kept += boxes.len() - map.computed() as usize;
            }
        }
        assert!(
            hidden > 5_000 && by_pairs > 200 && kept > 5_000,
            "{hidden} hidden, {by_pairs} by pairs, {kept} kept"
        );
    }

    /// How far the eye may move before an answer is computed again: by the clearance, less the error of the
    /// eye then and now.
    #[test]
    fn answers_last_while_the_eye_is_surely_within_their_clearance() {
        let triangle = [Vec3::new(4.0, -9.0, -5.0), Vec3::new(4.0, 9.0, -5.0), Vec3::new(4.0, 0.0, 9.0)];
        let occluders = polygons_of(&[triangle], true);
        let mut random = Random(72);
        let mut used = [0, 0];
        for round in 0..4000 {
            // Coordinates are up to 1,000 km, at which distances count as known to a millimetre.
            let case = round % 4;
            let shift = [Vec3::ZERO, Vec3::X * 1e6, Vec3::Y * -1e6, Vec3::X * -1e6][case];
            let size: f64 = [9.0, 1e6, 1e6, 1e6][case];
            let mut map = if case == 0 {
                map_of(&occluders, true)
            } else {
                map_of(&polygons_of(&[triangle.map(|v| v + shift)], true), true)
            };
            let first = shift.as_dvec3() + random.fine_vector(1.0);
            // In the last case the box is near the origin, and a million metres behind the triangle.
            let y = if case == 3 { 0.0 } else { [0.0, 30.0][round / 4 % 2] };
            let at = if case == 3 { Vec3::ZERO } else { shift };
            let bounds = Aabb::new(Vec3::new(8.0, y, 0.0) + at, Vec3::new(9.0, y + 0.5, 0.5) + at);
            let mut error = || [0.0, 1e-9, 1e-3, 4e-3, 8e-3][random.below(5)];
            let [then, now] = [error(), error()];
            let begin = |map: &mut GroupMap, eye: DVec3, error: f64| {
                map.begin(&look(eye, eye + DVec3::X), DVec3::ZERO);
                map.projection.eye_error = error;
                map.memory.groups.turn(&map.projection);
            };
            begin(&mut map, first, then);
            let (answer, clearance) = map.compute(bounds.min.as_dvec3(), bounds.max.as_dvec3());
            assert_eq!(answer == Occlusion::Hidden, y == 0.0, "round {round}: what is hidden");
            assert_eq!(map.test_mut(&bounds), answer, "round {round}: the same, to be kept");
            let limit = (clearance * (1.0 - 1e-6) - 1e-9 * size.max(f64::from(y) + 0.5) - 4.0 * then)
                .max(0.0)
                - (now - then).max(0.0);
            let share = random.pick(&[0.0, 0.5, 0.9, 0.999, 1.001, 1.1]);
            // A little more than the limit, by less than the error of distances between coordinates.
            let beyond = if round % 5 == 0 { 0.4e-9 * size } else { 0.0 };
            let distance = if beyond > 0.0 { limit.max(0.0) + beyond } else { share * limit.max(0.0) };
            let second = first + random.direction() * distance;
            let is_moved = (second - first).length();
            if second.x - shift.as_dvec3().x > 3.5 {
                // Near the polygon and behind it, its side is another.
                continue;
            }
            begin(&mut map, second, now);
            let again = map.test_mut(&bounds);
            let is_used = map.computed() == 0;
            assert!(!is_used || again == answer, "round {round}: what is hidden after {distance} m");
            assert!(
                !is_used || is_moved + now <= clearance,
                "round {round}: {is_moved} m, {now} off, of {clearance} m"
            );
            if (is_moved - limit).abs() > 1e-7 * limit.abs() + 1e-9 {
                assert_eq!(is_used, is_moved < limit, "round {round}: {is_moved} m of {limit} m");
                used[usize::from(is_used)] += 1;
            }
        }
        assert!(used.iter().all(|&count| count > 500), "answers computed anew and kept: {used:?}");
    }

    #[test]
    fn an_answer_that_no_test_asks_for_is_dropped_after_64_frames() {
        let triangle = [Vec3::new(4.0, -9.0, -5.0), Vec3::new(4.0, 9.0, -5.0), Vec3::new(4.0, 0.0, 9.0)];
        let mut map = map_of(&polygons_of(&[triangle], true), true);
        let bounds = Aabb::from_arrays([8.0, 0.0, 0.0], [9.0, 0.5, 0.5]);
        for asked in [0, 1, 63, 64] {
            map.reset();
            map.frame = 64;
            // The frames from 65 on, up to the one that drops, number 128.
            for frame in 65..=128u64 {
                map.begin(&look(DVec3::ZERO, DVec3::X), DVec3::ZERO);
                assert_eq!(map.frame, frame, "number of the frame");
                if asked == frame - 64 || (asked == 0 && frame == 65) {
                    map.test_mut(&bounds);
                    assert_eq!(map.computed(), 1, "computed in frame {frame}");
                    if asked == 0 {
                        // As if it had been asked for a frame earlier, 64 frames before.
                        map.memory.known.values_mut().for_each(|known| known.frame = 64);
                    }
                }
            }
            assert_eq!(
                map.memory.known.len(),
                usize::from(asked > 0),
                "kept, asked for in frame {asked} of 64"
            );
        }
    }

    /// The errors of the eye and of the placed mesh, and the clearance of the near plane, reach the planes.
    #[test]
    fn planes_have_the_errors_of_the_eye_and_of_placing() {
        // A mesh far from its own origin, which a transform moves back.
        let far = Vec3::new(1e6, 0.0, 0.0);
        let corners = [[4.0, -8.0, -8.0], [4.0, 8.0, -8.0], [4.0, 0.0, 9.0]].map(Vec3::from_array);
        let mesh = OccluderMesh::from_triangles(&[corners.map(|v| v + far)]).unwrap().with_two_sided(true);
        let mut scene = Scene::new();
        let id =
            scene.insert(Object { occluder: true, ..Object::new(Aabb::from_arrays([-9.0; 3], [9.0; 3])) });
        let mesh = scene.add_mesh(mesh);
        scene.set_mesh(id, mesh, Affine3A::from_translation(-far)).unwrap();
        let placed = Occluders::new(&scene);
        let placing_error = placed.occluder_polygon(0).placing_error;
        assert!(placing_error > 1e-10, "error of placing: {placing_error}");
        let map = map_of(&placed, true);
        assert!(map.memory.groups.edges.iter().all(|edge| edge.placing_error == placing_error), "edges");
        // A parallel view whose near plane is before the polygon by less or more than these errors.
        let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
        // The polygon is as uneven as four errors, which counts twice.
        for share in [0.1, 0.9, 4.0, 7.8, 8.3, 8.8, 9.2, 12.0] {
            let near = 4.0 - share * placing_error;
            let view = View::orthographic(pose, Window::centered(9.0, 9.0), near, 99.0).unwrap();
            let mut map = map_of(&placed, true);
            map.begin(&view, DVec3::ZERO);
            let uneven = map.memory.groups.faces[0].near_unevenness(&map.projection);
            let (value, error) = map.projection.beyond_near(DVec3::new(4.0, 0.0, 0.0), placing_error);
            let is_beyond = value > error + 2.0 * uneven;
            map.compute(DVec3::splat(5.0), DVec3::splat(6.0));
            assert_eq!(map.memory.groups.groups[0].usable, is_beyond, "{share} errors beyond the near plane");
            assert!(is_beyond || share < 9.0, "{share} errors are enough: {value} {error} {uneven}");
            assert!(!is_beyond || share > 9.0, "{share} errors are not: {value} {error} {uneven}");
        }
        // An eye whose error is half of its distance from the polygon, or of that and the near plane.
        let occluders = polygons_of(&[corners], true);
        for (near, error, is) in [
            (0.1, 0.0, true),
            // The near plane is farther away by the error of the eye, and by a tenth.
            (0.1, 1.6, true),
            (0.1, 1.7, false),
            (2.9, 0.0, true),
            (3.0, 0.0, false),
        ] {
            let view = View::perspective_off_center(pose, Window::centered(0.5, 0.5), near, 99.0).unwrap();
            let mut map = map_of(&occluders, true);
            map.begin(&view, DVec3::ZERO);
            assert_eq!(map.projection.eye_error, 0.0, "an eye that is known");
            map.projection.eye_error = error;
            map.memory.groups.turn(&map.projection);
            assert_eq!(
                map.memory.groups.faces[0].usable, is,
                "a near plane at {near} m, eye off by {error} m"
            );
            map.compute(DVec3::splat(5.0), DVec3::splat(6.0));
            for edge in &map.memory.groups.edges {
                let mut expected = Edge::new(edge.ends, edge.face, edge.placing_error);
                expected.update_eye(&map.projection.eye, error, map.memory.groups.faces[0].from_front);
                assert_eq!(format!("{edge:?}"), format!("{expected:?}"), "an edge, eye off by {error} m");
            }
        }
    }

    /// A pair with one uneven polygon is not used where it lies before the near plane of a parallel view.
    #[test]
    fn a_pair_is_as_uneven_as_the_worse_of_its_polygons() {
        let [p, q] = [Vec3::new(4.0, 0.0, -5.0), Vec3::new(4.0, 0.0, 5.0)];
        let occluders =
            polygons_of(&[[p, q, Vec3::new(4.5, 5.0, 0.0)], [q, p, Vec3::new(4.5, -5.0, 0.0)]], true);
        let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
        let view = View::orthographic(pose, Window::centered(9.0, 9.0), 3.9, 99.0).unwrap();
        for uneven in [None, Some(0), Some(1)] {
            let mut map = map_of(&occluders, true);
            assert_eq!(map.memory.groups.groups.len(), 3, "two polygons and their pair");
            if let Some(which) = uneven {
                let polygon = occluders.occluder_polygon(which as u32);
                let [low, high] = polygon.extent_along_normal;
                let extent_along_normal = [low - 0.5, high + 0.5];
                map.memory.groups.faces[which] =
                    Face::new(&OccluderPolygon { extent_along_normal, ..polygon });
            }
            map.begin(&view, DVec3::ZERO);
            map.compute(DVec3::splat(5.0), DVec3::splat(6.0));
            let usable: Vec<bool> = map.memory.groups.groups.iter().map(|group| group.usable).collect();
            let expected = [uneven != Some(0), uneven != Some(1), uneven.is_none()];
            assert_eq!(usable, expected, "uneven: {uneven:?}");
        }
    }

    /// A box behind both of a pair is hidden by the pair alone, and only while both may be used.
    #[test]
    fn a_pair_hides_while_both_of_its_polygons_are_usable() {
        let [p, q] = [Vec3::new(4.0, 0.0, -5.0), Vec3::new(4.0, 0.0, 5.0)];
        let occluders =
            polygons_of(&[[p, q, Vec3::new(4.5, 5.0, 0.0)], [q, p, Vec3::new(4.5, -5.0, 0.0)]], true);
        let (min, max) = (DVec3::new(6.0, -0.5, -0.5), DVec3::new(7.0, 0.5, 0.5));
        for usable in [[true, true], [false, true], [true, false]] {
            let mut map = map_of(&occluders, true);
            map.begin(&look(DVec3::ZERO, DVec3::X), DVec3::ZERO);
            map.compute(min, max);
            let groups = &mut map.memory.groups;
            for (face, usable) in groups.faces.iter_mut().zip(usable) {
                assert!(face.usable, "a polygon before the eye");
                face.usable = usable;
            }
            let (answer, _) = groups.compute(&map.projection.eye, false, min, max);
            assert_eq!(answer == Occlusion::Hidden, usable == [true; 2], "usable: {usable:?}");
        }
    }
}
