//! Random mazes for portal culling: rooms in a row, a storey or a block, joined by holes in walls without
//! thickness.

use super::strategies::{cuboid, soup};
use glam::{DVec3, Vec3};
use visibility_core::{
    cells::{CellGraph, CellId},
    pvs::{Viewcell, Viewcells},
};
use visibility_examples::SourceObject;
use visibility_examples::source::SourceCells;
use visibility_testing::Random;

/// Rooms with walls, holes and furniture. Coordinates are relative to the world's origin once the maze is
/// stretched.
pub(crate) struct Maze {
    /// Walls first, then furniture. The first `walls` objects must not be spoiled: a missing wall would be a
    /// hole without a portal.
    pub(crate) objects: Vec<SourceObject>,
    pub(crate) walls: usize,
    /// Minimum and maximum corner of each room, in the coordinates of the objects.
    pub(crate) rooms: Vec<[Vec3; 2]>,
    pub(crate) holes: Vec<([Vec3; 4], [usize; 2])>,
}

impl Maze {
    pub(crate) fn random(rng: &mut Random) -> Self {
        let counts = [1 + rng.below(4), 1 + rng.below(3), 1 + rng.below(2)];
        let lines = counts.map(|count| {
            let mut at = -2.0;
            let mut lines = vec![at];
            for _ in 0..count {
                at += rng.pick(&[0.01, 1.0, 1.0, 2.0, 3.0]);
                lines.push(at);
            }
            lines
        });
        let corner = |at: [usize; 3]| DVec3::from_array(std::array::from_fn(|axis| lines[axis][at[axis]]));
        let number = |at: [usize; 3]| (at[2] * counts[1] + at[1]) * counts[0] + at[0];
        let mut maze = Self { objects: Vec::new(), walls: 0, rooms: Vec::new(), holes: Vec::new() };
        for z in 0..counts[2] {
            for y in 0..counts[1] {
                for x in 0..counts[0] {
                    maze.rooms.push([corner([x, y, z]), corner([x + 1, y + 1, z + 1])].map(|p| p.as_vec3()));
                }
            }
        }
        for axis in 0..3 {
            let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
            for on in 0..=counts[axis] {
                for i in 0..counts[u] {
                    for j in 0..counts[v] {
                        let mut at = [0; 3];
                        (at[axis], at[u], at[v]) = (on, i, j);
                        let low = corner(at);
                        (at[u], at[v]) = (i + 1, j + 1);
                        let high = corner(at);
                        let beyond = |step: usize| {
                            let mut at = [0; 3];
                            (at[axis], at[u], at[v]) = (on - step, i, j);
                            number(at)
                        };
                        let inside = on > 0 && on < counts[axis];
                        let joined = inside.then(|| [beyond(1), beyond(0)]);
                        maze.face(rng, axis, [low, high], joined);
                    }
                }
            }
        }
        maze.walls = maze.objects.len();
        for _ in 0..5 + rng.below(20) {
            let [low, high] = maze.rooms[rng.below(maze.rooms.len())].map(|p| p.as_dvec3());
            let middle = low + (high - low) * (rng.vector(0.5) + 0.5);
            // Furniture is centred in a room; some pieces reach into walls.
            let triangles = match rng.below(4) {
                0 => soup(rng)
                    .into_iter()
                    .map(|t| t.map(|p| (middle + p.as_dvec3() * 0.05).as_vec3()))
                    .collect(),
                1 => cuboid(middle, rng.vector(0.5).abs()),
                _ => cuboid(middle, rng.vector(0.1).abs()),
            };
            maze.objects.push(SourceObject::new("furniture", triangles));
        }
        maze
    }

    /// Adds the rectangle between two rooms, or between a room and the outside: a wall, a wall with a hole,
    /// or only a hole. `axis` is the rectangle's normal, `low` and `high` are its corners, and `joined` the
    /// two rooms, `None` at the outside, where no hole is made.
    fn face(&mut self, rng: &mut Random, axis: usize, [low, high]: [DVec3; 2], joined: Option<[usize; 2]>) {
        let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
        // The corners are counter-clockwise as seen from larger coordinates along the axis.
        let corners = |low: DVec3, high: DVec3| {
            [[low, low], [high, low], [high, high], [low, high]].map(|[of_u, of_v]| {
                let mut p = low;
                (p[u], p[v]) = (of_u[u], of_v[v]);
                p.as_vec3()
            })
        };
        let mut wall = Vec::new();
        match joined.filter(|_| !rng.one_in(4)) {
            None => wall.push(corners(low, high)),
            Some(rooms) => {
                let mut hole = [low, high];
                if !rng.one_in(4) {
                    for side in [u, v] {
                        let size = high[side] - low[side];
                        let width = size * rng.pick(&[0.001, 0.1, 0.3, 0.6, 1.0]);
                        // Some holes are flush with a corner of the room.
                        let from = rng.pick(&[0.0, rng.clone().unit(), 0.5, 1.0]) * (size - width);
                        hole[0][side] = low[side] + from;
                        hole[1][side] =
                            if from + width < size { low[side] + from + width } else { high[side] };
                    }
                }
                let mut strip = |axis: usize, from: f64, to: f64, [mut low, mut high]: [DVec3; 2]| {
                    (low[axis], high[axis]) = (from, to);
                    if from < to {
                        wall.push(corners(low, high));
                    }
                };
                strip(u, low[u], hole[0][u], [low, high]);
                strip(u, hole[1][u], high[u], [low, high]);
                strip(v, low[v], hole[0][v], hole);
                strip(v, hole[1][v], high[v], hole);
                self.holes.push((corners(hole[0], hole[1]), rooms));
            }
        }
        let triangles: Vec<_> = wall.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        if !triangles.is_empty() {
            self.objects.push(SourceObject::new("wall", triangles));
        }
    }

    /// Returns the rooms and holes as cells and portals in a world with the given origin. `None` if a hole is
    /// too small for the precision of coordinates at this distance.
    pub(crate) fn cells(&self, origin: DVec3) -> Option<SourceCells> {
        let place = |p: Vec3| p.as_dvec3() + origin;
        let holes = self
            .holes
            .iter()
            .map(|(corners, rooms)| (corners.map(place), rooms.map(|room| CellId(room as u32))));
        let rooms = self.rooms.iter().map(|&[low, high]| Viewcell::from_box(place(low), place(high)));
        Some(SourceCells {
            graph: CellGraph::from_vertices(self.rooms.len(), holes).ok()?,
            viewcells: Viewcells::new(rooms),
            names: vec![String::new(); self.rooms.len()],
            depth: 0.0,
            with_doorways: None,
        })
    }
}
