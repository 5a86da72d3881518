//! Incremental Delaunay triangulation of points in a cube (Bowyer, "Computing Dirichlet tessellations", 1981;
//! Watson, "Computing the n-dimensional Delaunay tessellation", 1981).
//!
//! The cavity of a new point consists of all tetrahedra whose circumspheres contain the point. They are
//! replaced by tetrahedra between the point and the cavity's boundary faces. The first tetrahedron of the
//! cavity is found by walking from the last tetrahedron made.

use super::predicates::{Point, is_in_sphere, volume};
use alloc::vec::Vec;

/// Neighbour number for a face on the surface of the cube that all cells fill, where there is no neighbour.
pub(crate) const NONE: u32 = u32::MAX;

/// Tetrahedra of positive volume that fill a cube and share whole faces, with vertices on an integer grid.
#[derive(Clone, Debug, Default)]
pub(crate) struct Mesh {
    /// Vertices, in integer grid coordinates. The first eight are the corners of the cube that the
    /// tetrahedra fill.
    pub(crate) points: Vec<Point>,
    /// Corners of each cell, as indices into `points`.
    pub(crate) cells: Vec<[u32; 4]>,
    /// Numbers of the neighbours of each cell. Neighbour i shares all corners except corner i. [`NONE`] if
    /// the face opposite of corner i lies on the surface of the cube that all cells fill.
    pub(crate) neighbours: Vec<[u32; 4]>,
    /// Unused indices of `cells` and `neighbours`. Inserting a point may leave fewer cells than before.
    free: Vec<u32>,
}

/// Face between the cavity (the tetrahedra that a new point replaces) and a kept tetrahedron or the surface
/// of the cube. `cell` is the tetrahedron inside the cavity, and `face` the index, 0 to 3, of its corner
/// opposite of the face.
#[derive(Clone, Copy)]
struct CavityFace {
    cell: u32,
    face: usize,
}

/// Maximum number of positions that are tried for a point before the point is skipped.
const TRIES: u32 = 16;

impl Mesh {
    /// Makes the cube from 0 to `side` on each axis, in integer grid coordinates, split into six tetrahedra
    /// around a diagonal.
    pub(crate) fn cube(side: i32) -> Self {
        let corner = |i: u32| [0, 1, 2].map(|axis| if i >> axis & 1 != 0 { side } else { 0 });
        let mut mesh = Self { points: (0..8).map(corner).collect(), ..Self::default() };
        for [first, second] in [[1, 2], [1, 4], [2, 1], [2, 4], [4, 1], [4, 2]] {
            let mut cell = [0, first, first | second, 7];
            if volume(mesh.corners(&cell)) < 0 {
                cell.swap(0, 1);
            }
            mesh.cells.push(cell);
        }
        mesh.neighbours = alloc::vec![[NONE; 4]; 6];
        for a in 0..6 {
            for b in 0..6 {
                let [mine, theirs] = [a, b].map(|i| mesh.cells[i]);
                let unshared: Vec<usize> = (0..4).filter(|&i| !theirs.contains(&mine[i])).collect();
                if let [face] = unshared[..] {
                    mesh.neighbours[a][face] = b as u32;
                }
            }
        }
        mesh
    }

    /// Returns the integer grid coordinates of a cell's corners, given as indices into `points`.
    fn corners(&self, cell: &[u32; 4]) -> [Point; 4] {
        cell.map(|vertex| self.points[vertex as usize])
    }

    /// Inserts `count` points strictly inside the cube. `position(number, attempt)` returns the position to
    /// try for point `number`, for attempts 0, 1 and so on. The next attempt follows if a tetrahedron would
    /// be flat. A point is skipped after [`TRIES`] failed attempts.
    pub(crate) fn insert_all(&mut self, count: usize, position: impl Fn(usize, u32) -> Point) {
        let mut last = 0;
        for number in 0..count {
            let inserted = (0..TRIES).find_map(|attempt| self.insert(position(number, attempt), last));
            last = inserted.unwrap_or(last);
        }
        self.close_gaps();
    }

    /// Moves the last cells into the unused indices, so that `free` is empty and all cells are in use.
    fn close_gaps(&mut self) {
        let mut free = core::mem::take(&mut self.free);
        free.sort_unstable();
        // Gaps are closed from the largest index down, so that the cell moved into a gap is never itself
        // unused.
        for gap in free.into_iter().rev() {
            self.cells.swap_remove(gap as usize);
            self.neighbours.swap_remove(gap as usize);
            let moved = self.cells.len() as u32;
            if gap == moved {
                continue;
            }
            for neighbour in self.neighbours[gap as usize] {
                if neighbour != NONE {
                    let back = &mut self.neighbours[neighbour as usize];
                    back.iter_mut().filter(|back| **back == moved).for_each(|back| *back = gap);
                }
            }
        }
    }

    /// Inserts a point and returns the number of one of the new cells around it. `None`, with nothing
    /// changed, if a new cell would be flat or the point lies outside of the cube. The search begins at the
    /// cell `start`, which should be near the point.
    fn insert(&mut self, point: Point, start: u32) -> Option<u32> {
        let is_beyond = |cell: u32, face: usize| {
            let mut solid = self.corners(&self.cells[cell as usize]);
            solid[face] = point;
            volume(solid) < 0
        };
        let first = find_cell(&self.neighbours, start, is_beyond)?;
        // Bowyer-Watson: the cavity is the cells whose circumscribed sphere contains the point. Its boundary
        // faces are joined with the point to new cells.
        let mut cavity = alloc::vec![first];
        let mut cavity_faces: Vec<CavityFace> = Vec::new();
        let mut next = 0;
        while next < cavity.len() {
            let cell = cavity[next];
            next += 1;
            for face in 0..4 {
                let neighbour = self.neighbours[cell as usize][face];
                if cavity.contains(&neighbour) {
                    continue;
                }
                if neighbour != NONE && is_in_sphere(self.corners(&self.cells[neighbour as usize]), point) {
                    cavity.push(neighbour);
                } else {
                    cavity_faces.push(CavityFace { cell, face });
                }
            }
        }
        // The neighbour across a face may have joined the cavity after the face was recorded.
        cavity_faces.retain(|outer| !cavity.contains(&self.neighbours[outer.cell as usize][outer.face]));
        let is_flat = |outer: &CavityFace| {
            let mut corners = self.corners(&self.cells[outer.cell as usize]);
            corners[outer.face] = point;
            volume(corners) <= 0
        };
        if cavity_faces.iter().any(is_flat) {
            return None;
        }
        // The new cells, each with its neighbour outside the cavity and its face towards this neighbour,
        // collected before any cell is overwritten.
        let vertex = self.points.len() as u32;
        self.points.push(point);
        let made: Vec<([u32; 4], u32, usize)> = cavity_faces
            .iter()
            .map(|outer| {
                let mut cell = self.cells[outer.cell as usize];
                cell[outer.face] = vertex;
                (cell, self.neighbours[outer.cell as usize][outer.face], outer.face)
            })
            .collect();
        // Edges between cavity faces for which only one of the two new cells is known so far: the edge's
        // vertices with the new point twice, the known cell, and its face at the edge.
        let mut open: Vec<([u32; 4], u32, usize)> = Vec::new();
        for (number, &(cell, outer, face)) in made.iter().enumerate() {
            // Indices of cells in the cavity are reused first.
            let place = match cavity.get(number).copied().or_else(|| self.free.pop()) {
                Some(place) => place,
                None => {
                    self.cells.push([0; 4]);
                    self.neighbours.push([NONE; 4]);
                    self.cells.len() as u32 - 1
                }
            };
            self.cells[place as usize] = cell;
            let mut around = [NONE; 4];
            around[face] = outer;
            if outer != NONE
                && let Some(back) = self.back(outer, &cell)
            {
                self.neighbours[outer as usize][back] = place;
            }
            self.neighbours[place as usize] = around;
            // Two new cells are neighbours if their cavity faces share an edge.
            for side in (0..4).filter(|&side| side != face) {
                let mut edge = cell;
                edge[side] = vertex;
                edge.sort_unstable();
                match open.iter().position(|other| other.0 == edge) {
                    Some(found) => {
                        let (_, other, other_side) = open.swap_remove(found);
                        self.neighbours[place as usize][side] = other;
                        self.neighbours[other as usize][other_side] = place;
                    }
                    None => open.push((edge, place, side)),
                }
            }
        }
        self.free.extend(cavity.get(made.len()..).unwrap_or(&[]));
        Some(cavity[0])
    }

    /// Returns the face that the kept cell `outer` shares with a new cell: the index, 0 to 3, of the corner
    /// of `outer` opposite of the face. `cell` holds the corners of the new cell. `None` if all corners are
    /// shared.
    fn back(&self, outer: u32, cell: &[u32; 4]) -> Option<usize> {
        self.cells[outer as usize].iter().position(|v| !cell.contains(v))
    }
}

/// Returns a cell of a triangulation that contains a point, by walking from the cell `start` towards the
/// point. `is_beyond` tests exactly whether the point lies strictly beyond a face of a cell, given the cell
/// and the index, 0 to 3, of the corner opposite of the face. `None` for a point outside of all cells.
pub(crate) fn find_cell(
    neighbours: &[[u32; 4]],
    start: u32,
    is_beyond: impl Fn(u32, usize) -> bool,
) -> Option<u32> {
    let mut cell = start;
    // A walk through a Delaunay triangulation never returns to a cell. The limit ends walks through other
    // triangulations.
    for step in 0..neighbours.len() + 4 {
        let mut faces = (0..4).map(|i| (i + step) % 4);
        let Some(face) = faces.find(|&face| is_beyond(cell, face)) else { return Some(cell) };
        cell = neighbours[cell as usize][face];
        if cell == NONE {
            break;
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_testing::Random;

    /// Asserts that neighbours share their faces mutually, that all volumes are positive and sum to the
    /// cube's, and that no neighbour's opposite vertex lies in a cell's circumsphere. With `all_spheres`,
    /// tests every vertex against every circumsphere.
    fn check(mesh: &Mesh, side: i64, all_spheres: bool) {
        let mut sum = 0;
        for (number, (cell, neighbours)) in mesh.cells.iter().zip(&mesh.neighbours).enumerate() {
            let own = volume(mesh.corners(cell));
            assert!(own > 0, "cell {number}: six times its volume is {own}");
            sum += own;
            for (face, &neighbour) in neighbours.iter().enumerate() {
                if neighbour == NONE {
                    continue;
                }
                let other = mesh.cells[neighbour as usize];
                let back =
                    mesh.neighbours[neighbour as usize].iter().position(|&n| n as usize == number).unwrap();
                assert!(
                    (0..4).filter(|&i| i != face).all(|i| other.contains(&cell[i])),
                    "cell {number}: a neighbour shares the corners of face {face}"
                );
                assert!(
                    !cell.contains(&other[back]),
                    "cell {number}: the neighbour's opposite vertex is a corner"
                );
                assert!(
                    !is_in_sphere(mesh.corners(cell), mesh.points[other[back] as usize]),
                    "cell {number}: the neighbour's opposite vertex is in its sphere"
                );
            }
            if all_spheres {
                assert!(
                    mesh.points.iter().all(|&p| !is_in_sphere(mesh.corners(cell), p)),
                    "cell {number}: a vertex is in its sphere"
                );
            }
        }
        assert_eq!(sum, 6 * side * side * side, "six times the volume of all cells");
    }

    #[test]
    fn random_points_make_a_delaunay_triangulation() {
        let mut random = Random(1);
        let mut random = |below: i32| random.between(1, below - 1);
        let side = 1 << 17;
        let points: Vec<Point> = (0..300).map(|_| [random(side), random(side), random(side)]).collect();
        let mut mesh = Mesh::cube(side);
        check(&mesh, side.into(), true);
        mesh.insert_all(points.len(), |i, _| points[i]);
        assert_eq!(mesh.points.len(), 308, "points with the eight corners of the cube");
        check(&mesh, side.into(), true);
    }

    /// After every insertion, `close_gaps` leaves no unused cell index and keeps neighbour numbers
    /// consistent.
    #[test]
    fn gaps_are_closed() {
        let mut random = Random(7);
        let mut random = || random.between(1, 65535);
        let (mut mesh, mut gaps) = (Mesh::cube(1 << 16), 0);
        for number in 0..400 {
            let last = mesh.cells.len() as u32 - 1;
            assert!(
                mesh.insert([random(), random(), random()], last.min(number)).is_some(),
                "point {number} is inserted"
            );
            gaps += mesh.free.len();
            mesh.close_gaps();
            assert!(mesh.free.is_empty(), "point {number}: a gap is left");
            check(&mesh, 1 << 16, false);
        }
        assert!(gaps > 1, "{gaps}");
    }

    /// A point in a face between two cells is inserted. A point on the surface of the cube, with which a cell
    /// would be flat, is not, nor is a point outside or one that is a vertex.
    #[test]
    fn points_in_faces_are_inserted_unless_a_cell_would_be_flat() {
        for (point, expected) in [
            ([4, 4, 2], true),
            ([4, 4, 4], true),
            ([4, 3, 2], true),
            ([4, 0, 2], false),
            ([4, 0, 0], false),
            ([8, 8, 8], false),
            ([4, 9, 2], false),
            ([-1, 4, 4], false),
        ] {
            for start in 0..6 {
                let mut mesh = Mesh::cube(8);
                assert_eq!(mesh.insert(point, start).is_some(), expected, "{point:?}, from cell {start}");
                mesh.close_gaps();
                check(&mesh, 8, true);
            }
        }
    }

    #[test]
    fn points_of_a_grid_are_moved_until_none_is_flat() {
        let points: Vec<Point> =
            (0..343).map(|i: i32| [i % 7, i / 7 % 7, i / 49].map(|x| (x + 1) * 1024)).collect();
        let nudge = |i: usize, attempt: u32| {
            let shift =
                |axis: u32| ((i as u32 * 31 + attempt * 17 + axis * 7) % 13) as i32 * attempt.min(1) as i32;
            [0, 1, 2].map(|axis| points[i][axis] + shift(axis as u32))
        };
        let mut mesh = Mesh::cube(8192);
        mesh.insert_all(points.len(), nudge);
        assert_eq!(mesh.points.len(), 351, "points with the eight corners of the cube");
        check(&mesh, 8192, true);
    }
}
