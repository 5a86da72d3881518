//! Boxes in a scene whose origin moves, and an oracle for certainly visible ones, which works in `f64` world
//! coordinates (the scene's bounds plus its origin) with rays and slabs only.

use glam::DVec3;
use visibility_core::occlusion::Preparation;
use visibility_core::{Aabb, Object, ObjectId, Pose, Scene, View};
use visibility_testing::Random;

/// Tolerance of the oracle in metres, greater than the spacing of `f64` at the farthest origin: it widens
/// obstacles by this much, and its points are at least this far inside the picture.
const DOUBT: f64 = 1e-3;

/// Number of walls, which are the objects with the least indices.
const WALLS: usize = 12;

/// Returns the axis and the end (0: minimum, 1: maximum) of the only side of an object's box that has
/// triangles. `None` if all six sides have.
fn only_side(index: usize) -> Option<[usize; 2]> {
    (index >= WALLS && index.is_multiple_of(3)).then_some([index / 3 % 3, index / 9 % 2])
}

/// Returns the triangles of the object with an index, anticlockwise from outside: all sides of its box, or
/// only one.
pub(crate) fn triangles_of(index: usize, bounds: &Aabb) -> Vec<[glam::Vec3; 3]> {
    let corners = bounds.corners();
    let all = visibility_core::OccluderMesh::CUBOID.iter().map(|t| t.map(|i| corners[i as usize]));
    let is_drawn = |t: &[glam::Vec3; 3]| {
        only_side(index)
            .is_none_or(|[axis, end]| t.iter().all(|p| p[axis] == [bounds.min, bounds.max][end][axis]))
    };
    all.filter(is_drawn).collect()
}

/// Makes a scene of 12 walls and 60 small boxes around the origin, each with an occluder mesh. A third of the
/// small boxes have triangles on only one side, drawn from outside.
pub(crate) fn scene(rng: &mut Random) -> Scene {
    let mut scene = Scene::new();
    for number in 0..WALLS + 60 {
        let middle = rng.vector(if number < WALLS { 6.0 } else { 12.0 });
        let half = match number {
            ..6 => DVec3::new(0.2, 4.0, 4.0),
            6..WALLS => DVec3::new(4.0, 0.2, 4.0),
            _ => rng.vector(0.4).abs() + 0.05,
        };
        let bounds = Aabb::new((middle - half).as_vec3(), (middle + half).as_vec3());
        let id = scene.insert(Object { occluder: true, one_sided: true, cost: 12, ..Object::new(bounds) });
        scene.set_triangles(id, triangles_of(id.index(), &bounds)).unwrap();
    }
    scene.prepare_occluders(&Preparation::default());
    scene
}

/// Moves the origin in one of several ways.
pub(crate) fn move_origin(scene: &mut Scene, rng: &mut Random) {
    let old = scene.origin();
    let step = rng.vector(8.0);
    match rng.below(6) {
        // Coordinates stay, so the world moves.
        0 => scene.set_origin(old + step).unwrap(),
        // The origin moves and returns.
        1 => {
            scene.set_origin(old + step).unwrap();
            scene.set_origin(old).unwrap();
        }
        // The origin moves to where coordinates lose bits, and returns.
        2 => {
            let far = rng.pick(&[1e-7, 1e6, 1e9]);
            scene.set_origin(if old.length() > 1e4 { step } else { step + rng.vector(far) }).unwrap();
        }
        // The origin moves in a clone, which has the same ids.
        3 => {
            *scene = scene.clone();
            scene.set_origin(old + step).unwrap();
        }
        // The world stays in place up to rounding, so coordinates change.
        4 => {
            scene.set_origin(old + step).unwrap();
            set_all(scene, |bounds| {
                let [min, max] =
                    [bounds.min, bounds.max].map(|p| (p.as_dvec3() + (old - (old + step))).as_vec3());
                Aabb::new(min, max)
            });
        }
        // All coordinates are set again unchanged, so the world moves.
        _ => {
            scene.set_origin(old + step).unwrap();
            let same: Vec<_> = scene.ids().map(|id| (id, scene.bounds(id).unwrap())).collect();
            scene.set_bounds_batch(&same).unwrap();
        }
    }
}

/// Changes the scene in one of several ways, most of which move the origin.
pub(crate) fn disturb(scene: &mut Scene, rng: &mut Random) {
    if rng.one_in(4) {
        // Two objects exchange their bounds.
        let ids: Vec<ObjectId> = scene.ids().collect();
        let (a, b) = (rng.pick(&ids), rng.pick(&ids));
        let (of_a, of_b) = (scene.bounds(a).unwrap(), scene.bounds(b).unwrap());
        for (id, bounds) in [(a, of_b), (b, of_a)] {
            scene.set_bounds(id, bounds).unwrap();
            scene.set_triangles(id, triangles_of(id.index(), &bounds)).unwrap();
        }
        scene.prepare_occluders(&Preparation::default());
    } else {
        move_origin(scene, rng);
    }
}

/// Sets the bounds of all objects, with matching triangles and occluder meshes.
fn set_all(scene: &mut Scene, mut to: impl FnMut(Aabb) -> Aabb) {
    let ids: Vec<ObjectId> = scene.ids().collect();
    for id in ids {
        let bounds = to(scene.bounds(id).unwrap());
        scene.set_bounds(id, bounds).unwrap();
        scene.set_triangles(id, triangles_of(id.index(), &bounds)).unwrap();
    }
    scene.prepare_occluders(&Preparation::default());
}

/// Camera in `f64` world coordinates.
pub(crate) struct Camera {
    pub(crate) eye: DVec3,
    pub(crate) view: View,
    forward: DVec3,
    right: DVec3,
    up: DVec3,
}

/// Tangents of half the horizontal and half the vertical field of view.
const TANGENTS: [f64; 2] = [0.9, 0.6];

impl Camera {
    pub(crate) fn new(eye: DVec3, forward: DVec3) -> Self {
        let forward = forward.normalize();
        let right = forward.cross(DVec3::Z).normalize();
        let pose = Pose::look_at(eye, eye + forward, DVec3::Z);
        let view = View::perspective(pose, 2.0 * TANGENTS[1].atan(), TANGENTS[0] / TANGENTS[1], 0.05, 500.0)
            .unwrap();
        Self { eye, view, forward, right, up: right.cross(forward) }
    }

    /// Makes a camera among the present objects of a scene, with the eye within `reach` metres of the scene's
    /// origin along each axis.
    pub(crate) fn random(scene: &Scene, reach: f64, rng: &mut Random) -> Self {
        let eye = scene.origin() + rng.vector(reach);
        Self::new(eye, scene.origin() + rng.vector(6.0) - eye)
    }

    pub(crate) fn shows(&self, point: DVec3) -> bool {
        let to = point - self.eye;
        let depth = to.dot(self.forward);
        let aside = [to.dot(self.right), to.dot(self.up)];
        depth > 0.2 && (0..2).all(|i| aside[i].abs() < depth * TANGENTS[i] * (1.0 - DOUBT) - DOUBT)
    }
}

/// Returns the minimum and maximum corner of each object in world space, in the order of object indices.
pub(crate) fn world_boxes(scene: &Scene) -> Vec<(ObjectId, [DVec3; 2])> {
    let corners = |id| {
        let bounds = scene.bounds(id).unwrap();
        (id, [bounds.min, bounds.max].map(|p| p.as_dvec3() + scene.origin()))
    };
    scene.ids().map(corners).collect()
}

/// Returns whether a segment misses a box enlarged by [`DOUBT`].
fn misses(from: DVec3, to: DVec3, [min, max]: [DVec3; 2]) -> bool {
    let (mut enter, mut leave) = (0.0f64, 1.0f64);
    for axis in 0..3 {
        let step = to[axis] - from[axis];
        let (low, high) = (min[axis] - DOUBT - from[axis], max[axis] + DOUBT - from[axis]);
        if step == 0.0 {
            if low > 0.0 || high < 0.0 {
                return true;
            }
            continue;
        }
        let (a, b) = (low / step, high / step);
        (enter, leave) = (enter.max(a.min(b)), leave.min(a.max(b)));
    }
    enter > leave
}

/// Returns a random point on a drawn side of an object's box, away from the edges. `None` if the randomly
/// chosen side does not face the eye.
fn facing_point(index: usize, [min, max]: [DVec3; 2], eye: DVec3, rng: &mut Random) -> Option<DVec3> {
    let only = only_side(index);
    let axis = only.map_or_else(|| rng.below(3), |[axis, _]| axis);
    let mut point = min + (max - min) * (rng.vector(0.45) + 0.5);
    let is_drawn = |end: usize| only.is_none_or(|[_, only]| only == end);
    point[axis] = if eye[axis] < min[axis] - DOUBT && is_drawn(0) {
        min[axis]
    } else if eye[axis] > max[axis] + DOUBT && is_drawn(1) {
        max[axis]
    } else {
        return None;
    };
    Some(point)
}

/// Returns the objects with a point that is certainly visible from an eye: the segment to it misses all other
/// boxes. `shows` tells which points are inside the picture.
pub(crate) fn surely_seen(
    boxes: &[(ObjectId, [DVec3; 2])],
    eye: DVec3,
    shows: impl Fn(DVec3) -> bool,
    rng: &mut Random,
) -> Vec<ObjectId> {
    let mut seen = Vec::new();
    for (number, &(id, corners)) in boxes.iter().enumerate() {
        let is_seen = (0..6).any(|_| {
            facing_point(id.index(), corners, eye, rng).is_some_and(|point| {
                let others = boxes.iter().enumerate().filter(|&(other, _)| other != number);
                shows(point) && others.map(|(_, (_, corners))| *corners).all(|at| misses(eye, point, at))
            })
        });
        if is_seen {
            seen.push(id);
        }
    }
    seen
}

impl Camera {
    /// Returns the objects that are certainly visible in the picture.
    pub(crate) fn surely_seen(&self, scene: &Scene, rng: &mut Random) -> Vec<ObjectId> {
        surely_seen(&world_boxes(scene), self.eye, |point| self.shows(point), rng)
    }
}
