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
