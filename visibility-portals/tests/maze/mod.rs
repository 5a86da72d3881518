//! Random mazes for tests, and an oracle that follows rays through them.
//!
//! Rooms are boxes in a grid with walls of no thickness; doorways are convex polygons in these walls. The
//! grid may be rotated and moved in the world. The oracle works in grid space: it finds the wall through
//! which a ray leaves a room, and tests whether that point is in a doorway. It shares no code with the
//! culler.
#![allow(dead_code, missing_docs, unreachable_pub)]

use visibility_core::glam::{DMat3, DMat4, DQuat, DVec2, DVec3};
use visibility_core::{
    Aabb, ObjectId, Pose, Scene, View,
    cells::{CellGraph, CellId, PortalId},
    geometry::{ConvexPolygon, Plane, PolygonError},
    pvs::{Viewcell, Viewcells},
};
use visibility_portals::{MirrorId, Passage, SceneCells};
use visibility_testing::Random;
use visibility_testing::cameras::{DEPTHS, projection};

/// A convex polygon in a wall: its corners in grid space, in the two coordinates that follow the wall's axis
/// cyclically, counter-clockwise.
#[derive(Clone, Debug)]
pub struct Opening {
    pub corners: Vec<DVec2>,
    pub kind: Kind,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Kind {
    Door(PortalId),
    /// A mirror, and the side of the wall that it faces: `true` the room at greater coordinates, `false` the
    /// room at lesser coordinates.
    Mirror(MirrorId, bool),
}

impl Opening {
    fn contains(&self, p: DVec2) -> bool {
        let n = self.corners.len();
        (0..n).all(|i| (self.corners[(i + 1) % n] - self.corners[i]).perp_dot(p - self.corners[i]) >= 0.0)
    }
}

pub struct Maze {
    pub sizes: [usize; 3],
    /// Coordinates of the walls along each axis, in grid space, ascending.
    pub walls: [Vec<f64>; 3],
    pub turn: DQuat,
    pub shift: DVec3,
    /// Openings of each wall, at index 3 * room + axis, where `room` is the index of the room on the wall's
    /// side of lesser coordinates.
    openings: Vec<Vec<Opening>>,
    pub cells: SceneCells,
    pub scene: Scene,
    pub objects: Vec<(ObjectId, DVec3, DVec3)>,
    /// Points in doorways, in world space.
    pub targets: Vec<DVec3>,
    /// Points on mirrors, in world space.
    pub mirror_targets: Vec<DVec3>,
    /// By portal index: true if the portal is open and can be seen through now, false if not; along its
    /// normal (first entry) and against its normal (second entry).
    pub passes: Vec<[bool; 2]>,
}

#[derive(Clone, Copy)]
pub struct Style {
    pub turned: bool,
    pub slivers: bool,
    pub mirrors: bool,
    pub shift: f64,
    /// Maximum displacement of the culler's cells and portals from those of the oracle, in world units;
    /// given to the culler as its tolerance.
    pub tolerance: f64,
}

impl Maze {
    pub fn new(random: &mut Random, sizes: [usize; 3], style: Style) -> Self {
        let walls = sizes.map(|n| {
            let mut at = 0.0;
            let mut all = vec![at];
            for _ in 0..n {
                at += random.fine_range(2.0, 5.0);
                all.push(at);
            }
            all
        });
        let turn = if style.turned {
            DQuat::from_axis_angle(random.fine_vector(1.0).normalize(), random.fine_range(0.0, 6.0))
        } else {
            DQuat::IDENTITY
        };
        let shift = random.fine_vector(1.0) * style.shift;
        let rooms = sizes[0] * sizes[1] * sizes[2];
        let mut maze = Self {
            sizes,
            walls,
            turn,
            shift,
            openings: vec![Vec::new(); rooms * 3],
            cells: SceneCells::new(CellGraph::new(0, []).unwrap(), Viewcells::default(), 0.0).unwrap(),
            scene: Scene::new(),
            objects: Vec::new(),
            targets: Vec::new(),
            mirror_targets: Vec::new(),
            passes: Vec::new(),
        };
        let mut portals = Vec::new();
        let mut mirrors = Vec::new();
        for room in 0..rooms {
            for axis in 0..3 {
                let place = maze.place(room);
                let next = (place[axis] + 1 < sizes[axis]).then(|| room + maze.stride(axis));
                let kinds = if next.is_some() { random.below(6) } else { 0 };
                let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                let low = DVec2::new(maze.walls[u][place[u]], maze.walls[v][place[v]]);
                let high = DVec2::new(maze.walls[u][place[u] + 1], maze.walls[v][place[v] + 1]);
                // Up to two openings per wall, one in each half.
                for half in 0..kinds.min(2) {
                    let middle = (low.x + high.x) / 2.0;
                    let (low, high) = if half == 0 {
                        (low, DVec2::new(middle, high.y))
                    } else {
                        (DVec2::new(middle, low.y), high)
                    };
                    let corners = opening(random, low, high, style.slivers);
                    let polygon = maze.polygon(axis, place[axis] + 1, &corners);
                    let spread = |random: &mut Random| {
                        let weights: Vec<f64> = polygon.iter().map(|_| random.fine_unit()).collect();
                        let sum: f64 = weights.iter().sum();
                        polygon.iter().zip(weights).map(|(&p, w)| p * (w / sum)).sum::<DVec3>()
                    };
                    let mirror = style.mirrors && random.below(3) > 0;
                    if mirror {
                        let greater = random.below(2) == 1;
                        let mut vertices = polygon.clone();
                        if !greater {
                            vertices.reverse();
                        }
                        let cell = if greater { next.unwrap() } else { room };
                        maze.mirror_targets.push(spread(random));
                        mirrors.push((cell, vertices, room * 3 + axis, corners, greater));
                    } else if let Ok(portal) = astray(random, &polygon, style.tolerance) {
                        let id = PortalId(portals.len() as u32);
                        portals.push((portal, [CellId(room as u32), CellId(next.unwrap() as u32)]));
                        maze.passes.push([true; 2]);
                        maze.targets.extend([spread(random), rim(random, &polygon)]);
                        maze.openings[room * 3 + axis].push(Opening { corners, kind: Kind::Door(id) });
                    }
                }
            }
        }
        let viewcells = (0..rooms).map(|room| {
            let moved = random.fine_vector(1.0) * style.tolerance * 0.5;
            let Viewcell { min, max, planes } = maze.viewcell(room);
            let planes =
                planes.into_iter().map(|plane| Plane::new(plane.normal, plane.signed_distance(-moved)));
            Viewcell { min: min + moved, max: max + moved, planes: planes.collect() }
        });
        let viewcells: Vec<Viewcell> = viewcells.collect();
        let graph = CellGraph::new(rooms, portals).unwrap();
        maze.cells = SceneCells::new(graph, Viewcells::new(viewcells), style.tolerance).unwrap();
        for (cell, vertices, wall, corners, greater) in mirrors {
            if let Ok(polygon) = ConvexPolygon::new(vertices) {
                let id = maze.cells.add_mirror(CellId(cell as u32), &polygon).unwrap();
                maze.openings[wall].push(Opening { corners, kind: Kind::Mirror(id, greater) });
            }
        }
        for room in 0..rooms {
            for _ in 0..3 {
                let at = maze.to_world(maze.point_in(random, room));
                let size = DVec3::splat(random.fine_range(0.01, 0.6));
                let (min, max) = ((at - size).as_vec3(), (at + size).as_vec3());
                let id = maze.scene.insert(Aabb::new(min, max));
                maze.objects.push((id, min.as_dvec3(), max.as_dvec3()));
            }
        }
        maze.cells.sync(&maze.scene);
        maze
    }

    pub fn rooms(&self) -> usize {
        self.sizes.iter().product()
    }

    fn stride(&self, axis: usize) -> usize {
        self.sizes[..axis].iter().product()
    }

    fn place(&self, room: usize) -> [usize; 3] {
        [0, 1, 2].map(|axis| room / self.stride(axis) % self.sizes[axis])
    }

    pub fn to_world(&self, p: DVec3) -> DVec3 {
        self.turn * p + self.shift
    }

    pub fn point_in(&self, random: &mut Random, room: usize) -> DVec3 {
        let place = self.place(room);
        DVec3::from_array([0, 1, 2].map(|axis| {
            let walls = &self.walls[axis];
            random.fine_range(walls[place[axis]], walls[place[axis] + 1])
        }))
    }

    fn polygon(&self, axis: usize, wall: usize, corners: &[DVec2]) -> Vec<DVec3> {
        let at = |c: &DVec2| {
            let mut p = [0.0; 3];
            (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]) = (self.walls[axis][wall], c.x, c.y);
            self.to_world(p.into())
        };
        corners.iter().map(at).collect()
    }

    fn viewcell(&self, room: usize) -> Viewcell {
        let place = self.place(room);
        let corner = |sides: [usize; 3]| {
            DVec3::from_array([0, 1, 2].map(|axis| self.walls[axis][place[axis] + sides[axis]]))
        };
        if self.turn == DQuat::IDENTITY {
            let (min, max) = (corner([0; 3]) + self.shift, corner([1; 3]) + self.shift);
            return Viewcell::from_box(min, max);
        }
        let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for i in 0..8 {
            let p = self.to_world(corner([i & 1, i >> 1 & 1, i >> 2]));
            (min, max) = (min.min(p), max.max(p));
        }
        let (low, high) = (self.to_world(corner([0; 3])), self.to_world(corner([1; 3])));
        let planes = (0..3).flat_map(|axis| {
            let normal = self.turn * DVec3::AXES[axis];
            [Plane::through(low, normal), Plane::through(high, -normal)]
        });
        Viewcell { min, max, planes: planes.collect() }
    }

    /// Opens and closes all portals at random, and sets their passages at random.
    pub fn shuffle_doors(&mut self, random: &mut Random) {
        for i in 0..self.passes.len() {
            let id = PortalId(i as u32);
            let open = random.below(8) != 0;
            let (passage, sides) = match random.below(12) {
                0 => (Passage::Forward, [true, false]),
                1 => (Passage::Backward, [false, true]),
                _ => (Passage::BothWays, [true; 2]),
            };
            self.cells.set_open(id, open).unwrap();
            self.cells.set_passage(id, passage).unwrap();
            self.passes[i] = sides.map(|side| side && open);
        }
    }

    /// Returns the point nearest to `from` among five points drawn at random from `of` (all in one space).
    /// `None` if `of` is empty.
    pub fn near(random: &mut Random, from: DVec3, of: &[DVec3]) -> Option<DVec3> {
        let some = (0..5).filter_map(|_| of.get(random.below(of.len().max(1))).copied());
        some.min_by(|a, b| a.distance(from).total_cmp(&b.distance(from)))
    }

    /// Follows a ray in world space through doorways and mirrors. Calls `reached` with the index of each
    /// object whose box the ray meets, and with the mirrors that the ray has met before, in order.
    pub fn follow(&self, from: DVec3, along: DVec3, mut reached: impl FnMut(usize, &[MirrorId])) {
        let back = self.turn.inverse();
        let (mut from, mut along) = (back * (from - self.shift), back * along);
        let mut mirrors = Vec::new();
        let mut place = [0; 3];
        for axis in 0..3 {
            let walls = &self.walls[axis];
            let Some(i) =
                (0..self.sizes[axis]).find(|&i| walls[i] <= from[axis] && from[axis] <= walls[i + 1])
            else {
                return;
            };
            place[axis] = i;
        }
        for _ in 0..60 {
            let mut leave = (f64::INFINITY, 0);
            for axis in 0..3 {
                let wall = self.walls[axis][place[axis] + usize::from(along[axis] > 0.0)];
                let t = (wall - from[axis]) / along[axis];
                if along[axis] != 0.0 && t < leave.0 {
                    leave = (t.max(0.0), axis);
                }
            }
            let (t, axis) = leave;
            let (start, step) = (self.to_world(from), self.turn * along * t);
            for (i, (_, min, max)) in self.objects.iter().enumerate() {
                if meets(start, step, *min, *max) {
                    reached(i, &mirrors);
                }
            }
            let up = along[axis] > 0.0;
            if !up && place[axis] == 0 {
                return;
            }
            let mut lesser = place;
            lesser[axis] -= usize::from(!up);
            let room = (0..3).map(|a| lesser[a] * self.stride(a)).sum::<usize>();
            let at = from + along * t;
            let p = DVec2::new(at[(axis + 1) % 3], at[(axis + 2) % 3]);
            let Some(opening) = self.openings[room * 3 + axis].iter().find(|opening| opening.contains(p))
            else {
                return;
            };
            from = at;
            from[axis] = self.walls[axis][lesser[axis] + 1];
            match opening.kind {
                Kind::Door(id) => {
                    if !self.passes[id.index()][usize::from(!up)] {
                        return;
                    }
                    if up {
                        place[axis] += 1;
                    } else {
                        place[axis] -= 1;
                    }
                }
                Kind::Mirror(id, greater) => {
                    if greater == up {
                        return;
                    }
                    mirrors.push(id);
                    along[axis] = -along[axis];
                }
            }
        }
    }
}

/// Returns a random point inside a polygon (in the polygon's own space), very near to one of its edges.
fn rim(random: &mut Random, polygon: &[DVec3]) -> DVec3 {
    let middle = polygon.iter().sum::<DVec3>() / polygon.len() as f64;
    let i = random.below(polygon.len());
    let at = polygon[i].lerp(polygon[(i + 1) % polygon.len()], random.fine_unit());
    at.lerp(middle, 1e-4)
}

/// Returns `polygon` shrunk and displaced, so that each point moves by less than `tolerance`, in the
/// polygon's own space and unit.
fn astray(random: &mut Random, polygon: &[DVec3], tolerance: f64) -> Result<ConvexPolygon, PolygonError> {
    let middle = polygon.iter().sum::<DVec3>() / polygon.len() as f64;
    let size = polygon.iter().fold(0.0, |size: f64, p| size.max(p.distance(middle)));
    let moved = random.fine_vector(1.0) * tolerance * 0.28;
    let smaller = 1.0 - (0.5 * tolerance / size).min(0.5);
    ConvexPolygon::new(polygon.iter().map(|&p| middle + (p - middle) * smaller + moved))
}

/// Returns a random convex polygon in the two coordinates of a wall, in the rectangle from `low` to `high`,
/// counter-clockwise: from nearly the whole rectangle, with `slivers`, down to 1e-5 of its size.
fn opening(random: &mut Random, low: DVec2, high: DVec2, slivers: bool) -> Vec<DVec2> {
    let within = |p: DVec2| low + (high - low) * p;
    let a = DVec2::new(random.fine_range(0.02, 0.5), random.fine_range(0.0, 0.4));
    let mut size = DVec2::new(random.fine_range(0.2, 0.9), random.fine_range(0.2, 0.9)) * (DVec2::ONE - a);
    if slivers {
        match random.below(4) {
            0 => size.x *= 1e-5,
            1 => size *= 1e-4,
            2 => size.y *= 1e-3,
            _ => {}
        }
    }
    match random.below(3) {
        0 => {
            let b = a + size;
            vec![within(a), within(DVec2::new(b.x, a.y)), within(b), within(DVec2::new(a.x, b.y))]
        }
        1 => {
            vec![within(a), within(a + size * DVec2::new(1.0, 0.3)), within(a + size * DVec2::new(0.4, 1.0))]
        }
        _ => (0..7)
            .map(|i| {
                let (sin, cos) = (f64::from(i) / 7.0 * std::f64::consts::TAU).sin_cos();
                within(a + size * (DVec2::new(cos, sin) * 0.5 + 0.5))
            })
            .collect(),
    }
}

/// Tests whether the segment from `from` to `from + step` meets the box from `min` to `max` (all in one
/// space), by the slab method. True if they touch.
fn meets(from: DVec3, step: DVec3, min: DVec3, max: DVec3) -> bool {
    let (mut enter, mut leave) = (0.0f64, 1.0f64);
    for axis in 0..3 {
        if step[axis] == 0.0 {
            if from[axis] < min[axis] || from[axis] > max[axis] {
                return false;
            }
            continue;
        }
        let (a, b) = ((min[axis] - from[axis]) / step[axis], (max[axis] - from[axis]) / step[axis]);
        enter = enter.max(a.min(b));
        leave = leave.min(a.max(b));
    }
    enter <= leave
}

/// A random camera: the parameters of its rays, and the `View` under test with the same rays.
pub struct Camera {
    pub pose: Pose,
    /// Half width and half height of the picture: tangents of the half angles for perspective, world units
    /// if orthographic.
    half: DVec2,
    pub near: f64,
    pub far: f64,
    pub orthographic: bool,
    pub view: View,
}

impl Camera {
    pub fn new(random: &mut Random, eye: DVec3, orthographic: bool) -> Self {
        let toward = random.fine_vector(1.0);
        Self::toward(random, eye, toward, orthographic)
    }

    pub fn toward(random: &mut Random, eye: DVec3, direction: DVec3, orthographic: bool) -> Self {
        let pose = Pose::look_at(eye, eye + direction, random.fine_vector(1.0));
        let half = if orthographic {
            DVec2::new(random.fine_range(0.01, 0.6), random.fine_range(0.01, 0.6))
        } else {
            DVec2::new(random.fine_range(0.1, 1.6), random.fine_range(0.1, 1.2))
        };
        let near = if orthographic {
            random.fine_range(-0.3, 0.1)
        } else {
            10f64.powf(random.fine_range(-4.0, -0.7))
        };
        let depth = random.pick(&DEPTHS);
        let far = near + if random.below(3) == 0 { random.fine_range(3.0, 12.0) } else { 200.0 };
        let window = [-half.x, half.x, -half.y, half.y];
        let axes = DMat3::from_cols(pose.right, pose.up, pose.forward).transpose();
        let matrix = projection(depth, window, near, far, orthographic) * DMat4::from_mat3(axes);
        let view = View::from_clip_from_world(matrix, depth).unwrap().relative_to(eye).unwrap();
        let far = if depth.is_infinite() { f64::INFINITY } else { far };
        Self { pose, half, near, far, orthographic, view }
    }

    /// Returns the camera moved by a vector and then turned about its eye.
    pub fn moved(&self, by: DVec3, turn: DQuat) -> Self {
        let Pose { eye, right, up, forward } = self.pose;
        let pose = Pose { eye: eye + by, right: turn * right, up: turn * up, forward: turn * forward };
        let matrix = self.view.clip_from(eye) * DMat4::from_quat(turn.inverse());
        let view = View::from_clip_from_world(matrix, self.view.depth()).unwrap();
        Self { pose, view: view.relative_to(eye + by).unwrap(), ..*self }
    }

    /// Returns the ray through a point of the picture in NDC: the start on the near plane, and the direction
    /// whose component along `forward` is 1. In world space.
    pub fn ray(&self, x: f64, y: f64) -> (DVec3, DVec3) {
        let Pose { eye, right, up, forward } = self.pose;
        let across = right * (x * self.half.x) + up * (y * self.half.y);
        if self.orthographic {
            (eye + across + forward * self.near, forward)
        } else {
            let along = forward + across;
            (eye + along * self.near, along)
        }
    }

    /// Returns the position of a world-space point in the picture, in NDC (-1 to 1). `None` if the point is
    /// behind the eye or outside the picture.
    pub fn project(&self, p: DVec3) -> Option<(f64, f64)> {
        let q = p - self.pose.eye;
        let w = if self.orthographic { 1.0 } else { self.pose.forward.dot(q) };
        let (x, y) = (self.pose.right.dot(q) / w / self.half.x, self.pose.up.dot(q) / w / self.half.y);
        (w > 0.0 && x.abs() <= 1.0 && y.abs() <= 1.0).then_some((x, y))
    }

    /// Tests whether a world-space point is in front of the far plane, or on it. `false` if the point is
    /// beyond the far plane.
    pub fn is_before_far(&self, p: DVec3) -> bool {
        self.pose.forward.dot(p - self.pose.eye) <= self.far
    }
}
