//! Cells that are the tetrahedra of a Delaunay triangulation of the centres of an octree's leaves.
//!
//! Klosowski and Silva, "The Prioritized-Layered Projection Algorithm for Visible Set Estimation", 2000,
//! section 4. Leaf centres lie on a grid, so many of them are cospherical or coplanar. As in the paper each
//! centre is moved slightly, here by a hash of its position. All decisions use exact integer arithmetic.

mod predicates;
mod triangulate;

use crate::content::Content;
use crate::grid::{Grid, STEPS};
use crate::octree::{Fineness, Subdivision};
use crate::overlap::{Tetrahedron, shape_meets_tetrahedron};
use crate::ray_coverage::{Cover, stopped_rays};
use crate::shape::{Shape, for_each_shape};
use crate::tessellation::{Face, Tessellation};
use alloc::vec::Vec;
pub(crate) use predicates::Point;
use predicates::{FACES, is_beyond, sub_point};
pub(crate) use triangulate::NONE;
use triangulate::{Mesh, find_cell};
use visibility_core::glam::DVec3;
use visibility_core::{Aabb, Scene};

/// Number of steps of the fine grid, on which the tetrahedra's vertices lie, per step of the octree's grid
/// along each axis.
pub(crate) const FINE_PER_STEP: i32 = 128;

/// Number of steps of the fine grid along each side of the tessellation's cube: 2^17.
const FINE_STEPS: i32 = STEPS as i32 * FINE_PER_STEP;

/// Tessellation into tetrahedra, within a cube slightly larger than the scene. Prefer
/// [`OctreeTessellation`](crate::OctreeTessellation): it is built in half the time, and finds as many visible
/// objects or more at budgets up to 2 % of a scene.
///
/// # Cost
/// Building takes about ten microseconds per reference (a pair of an object and a cell that the object
/// meets). The number of references grows as described at [`OctreeTessellation`](crate::OctreeTessellation).
/// Memory: about 60 bytes per cell, 1.2 per reference, and up to three per triangle.
///
/// ```
/// use visibility_core::{glam::DVec3, Aabb, Scene};
/// use visibility_plp::{DelaunayTessellation, Tessellation};
/// let mut scene = Scene::new();
/// let box_at = |x: f32| Aabb::from_arrays([x, 0.0, 0.0], [x + 0.5, 1.0, 1.0]);
/// scene.insert_batch((0..100).map(|i| box_at(i as f32)));
/// let cells = DelaunayTessellation::new(&scene);
/// let cell = cells.locate(DVec3::new(50.25, 0.5, 0.5)).unwrap();
/// assert!(cells.content().primitives(cell).any(|object| object == 50));
/// ```
#[derive(Clone, Debug)]
pub struct DelaunayTessellation {
    /// Grid of the octree whose leaf centres became vertices. Coordinates on the fine grid (of
    /// [`FINE_PER_STEP`] times as many steps) are relative to this grid's minimum corner.
    grid: Grid,
    /// Settings of the octree whose leaf centres became vertices, kept for `rebuild`.
    fineness: Fineness,
    /// Vertices of the tetrahedra, in steps of the fine grid, 0 to [`FINE_STEPS`]. The first eight are the
    /// corners of the tessellation's cube.
    points: Vec<Point>,
    /// Corners of each cell, as indices into `points`.
    cells: Vec<[u32; 4]>,
    /// For each corner of each cell, the number of the neighbouring cell across the face opposite of the
    /// corner, or [`NONE`] if that face lies on the surface of the cube that the tessellation fills.
    neighbours: Vec<[u32; 4]>,
    /// Numbers of the cells with a face on the surface of the cube that the tessellation fills.
    boundary: Vec<u32>,
    /// Lists of the objects in each cell.
    content: Content,
}

/// Returns the Delaunay vertex of an octree leaf, in steps of the fine grid: the leaf's centre, moved along
/// each axis by up to an eighth of the leaf's side. `leaf` is the position of the leaf's minimum corner (x,
/// y, z) and its side, in steps of the octree's grid. Each `attempt` moves the centre differently; equal
/// arguments give equal points.
fn vertex_in(leaf: [u16; 4], attempt: u32) -> Point {
    let side = i32::from(leaf[3]);
    let mut hash = 0x9e37_79b9u32;
    for x in leaf.map(u32::from).into_iter().chain([attempt]) {
        hash = (hash ^ x).wrapping_mul(0x85eb_ca6b);
        hash ^= hash >> 13;
    }
    [0, 1, 2].map(|axis| {
        let bits = hash.rotate_left(11 * axis as u32) % 1024;
        let shift = (bits as i32 - 512) * (side * FINE_PER_STEP) / 4096;
        i32::from(leaf[axis]) * FINE_PER_STEP + side * FINE_PER_STEP / 2 + shift
    })
}

impl DelaunayTessellation {
    /// Default settings of the octree whose leaf centres become vertices. Each leaf yields about seven
    /// tetrahedra.
    pub const FINENESS: Fineness = Fineness { vertices: 2048, halvings: 8 };

    /// Partitions a scene into tetrahedra at the default [fineness](Self::FINENESS). Objects whose bounds are
    /// not finite become [strays](Content::strays), which count as visible.
    pub fn new(scene: &Scene) -> Self {
        Self::from_scene(scene, Self::FINENESS)
    }

    /// Partitions a scene into tetrahedra, with one vertex in each leaf of the octree of the given fineness.
    /// Objects whose bounds are not finite become [strays](Content::strays), which count as visible.
    pub fn from_scene(scene: &Scene, fineness: Fineness) -> Self {
        let Subdivision { grid, leaf_positions, .. } = Subdivision::new(scene, fineness);
        let mut mesh = Mesh::cube(FINE_STEPS);
        mesh.insert_all(leaf_positions.len(), |leaf, attempt| vertex_in(leaf_positions[leaf], attempt));
        let Mesh { points, cells, neighbours, .. } = mesh;
        let outside = |(cell, around): (u32, &[u32; 4])| around.contains(&NONE).then_some(cell);
        let boundary = (0..).zip(&neighbours).filter_map(outside).collect();
        let content = Content::new(scene, &[], alloc::vec![[0; 4]; cells.len()]);
        let mut made = Self { grid, fineness, points, cells, neighbours, boundary, content };
        made.content = made.assign_objects(scene);
        made
    }

    /// Partitions a scene anew at the same fineness, replacing all cells. Afterwards only objects whose
    /// bounds are not finite are strays (in no cell).
    pub fn rebuild(&mut self, scene: &Scene) {
        *self = Self::from_scene(scene, self.fineness);
    }

    /// Makes all objects that changed since the last call or build [strays](Content::strays), which count as
    /// visible. Returns false if the tessellation should be [rebuilt](Self::rebuild): more than an eighth of
    /// the objects are strays, or the changes are unknown, as for another scene (then nothing is modified).
    /// Cost: proportional to the changes and the strays.
    pub fn sync(&mut self, scene: &Scene) -> bool {
        self.content.sync(scene)
    }

    /// Returns the heap memory of the tessellation in bytes, without spare capacity.
    pub fn memory(&self) -> usize {
        size_of_val(&self.points[..])
            + size_of_val(&self.cells[..])
            + size_of_val(&self.neighbours[..])
            + size_of_val(&self.boundary[..])
            + self.content.memory()
    }

    /// Returns the four corners of a cell in steps of the fine grid ([`FINE_PER_STEP`] per grid step),
    /// relative to the grid's minimum corner.
    fn fine_corners(&self, cell: u32) -> [DVec3; 4] {
        self.cells[cell as usize].map(|vertex| DVec3::from_array(self.points[vertex as usize].map(f64::from)))
    }

    /// Converts a point from metres, relative to the scene's origin, to steps of the fine grid
    /// ([`FINE_PER_STEP`] per grid step), relative to the grid's minimum corner.
    fn to_fine(&self, point: DVec3) -> DVec3 {
        (point - self.grid.min) / self.grid.step * f64::from(FINE_PER_STEP)
    }

    /// Returns the corners of a cell in metres, relative to the scene's origin.
    fn corners(&self, cell: u32) -> [DVec3; 4] {
        self.fine_corners(cell).map(|p| self.grid.min + p * (self.grid.step / f64::from(FINE_PER_STEP)))
    }

    /// Returns a cell that contains a point, by walking from the cell `start` towards the point. `point` is
    /// in steps of the fine grid, relative to the grid's minimum corner. It is rounded by less than 2^-32 of
    /// a step along each axis, far less than the tolerances of all who use the cell; the walk is exact.
    /// `None` for a point outside of the tessellation's cube.
    fn find_cell(&self, point: DVec3, start: u32) -> Option<u32> {
        let point = sub_point(point.to_array());
        let corners = |cell: u32| self.cells[cell as usize].map(|vertex| self.points[vertex as usize]);
        find_cell(&self.neighbours, start, |cell, face| is_beyond(corners(cell), face, point))
    }

    /// Assigns every object to all cells that it meets. For each shape, a cell that contains a corner of the
    /// shape is found first, then neighbours are added while the shape meets them. Also samples the rays that
    /// each cell's triangles stop.
    fn assign_objects(&self, scene: &Scene) -> Content {
        let solids: Vec<Tetrahedron> =
            (0..self.cells.len() as u32).map(|cell| Tetrahedron::new(self.fine_corners(cell))).collect();
        let mut pairs = Vec::new();
        let mut cover = alloc::vec![Cover::default(); self.cells.len()];
        let (mut last, mut visited) =
            (alloc::vec![u32::MAX; self.cells.len()], alloc::vec![0u32; self.cells.len()]);
        let (mut stack, mut number, mut start) = (Vec::new(), 0u32, 0);
        for id in scene.ids() {
            let object = id.index() as u32;
            let (before, mut leaves_cube) = (pairs.len(), false);
            for_each_shape(scene, id, &mut |shape| {
                number += 1;
                let shape = shape.map(|p| self.to_fine(p));
                // The cell of one corner, searched from that of the shape before, which is usually near.
                let Some(first) = self.find_cell(shape.corner(), start) else {
                    leaves_cube = true;
                    return;
                };
                start = first;
                stack.push(first);
                visited[first as usize] = number;
                // Cells that meet a shape are connected through their faces, since the shape is.
                while let Some(cell) = stack.pop() {
                    let solid = &solids[cell as usize];
                    if !shape_meets_tetrahedron(&shape, solid) {
                        continue;
                    }
                    if last[cell as usize] != object {
                        last[cell as usize] = object;
                        pairs.push((cell, object));
                    }
                    if let Shape::Triangle(triangle) = &shape {
                        let inside = |p: DVec3| solid.contains(p);
                        cover[cell as usize].add(stopped_rays(
                            triangle,
                            solid.center(),
                            solid.half(),
                            inside,
                        ));
                    }
                    for &neighbour in &self.neighbours[cell as usize] {
                        if neighbour != NONE && visited[neighbour as usize] != number {
                            visited[neighbour as usize] = number;
                            stack.push(neighbour);
                        }
                    }
                }
            });
            // An object of which a shape is in no cell becomes a stray, in no cell at all.
            if leaves_cube {
                pairs.truncate(before);
            }
        }
        let shares = cover.iter().zip(&solids).map(|(cover, solid)| cover.shares(solid.filled())).collect();
        Content::new(scene, &pairs, shares)
    }
}

impl Tessellation for DelaunayTessellation {
    fn content(&self) -> &Content {
        &self.content
    }

    fn bounds(&self) -> Aabb {
        self.grid.bounds([0; 3], STEPS)
    }

    fn locate(&self, point: DVec3) -> Option<u32> {
        if !self.grid.contains(point) {
            return None;
        }
        self.find_cell(self.to_fine(point), 0)
    }

    fn cell_bounds(&self, cell: u32) -> Aabb {
        let [a, b, c, d] = self.corners(cell);
        Aabb::from_world(a.min(b).min(c.min(d)), a.max(b).max(c.max(d)), DVec3::ZERO)
    }

    fn center(&self, cell: u32) -> DVec3 {
        let [a, b, c, d] = self.corners(cell);
        (a + b + c + d) * 0.25
    }

    fn projected_area(&self, cell: u32, direction: DVec3) -> f64 {
        let [a, b, c, d] = self.corners(cell);
        // The near faces have the same silhouette as the far faces, and a cross product is twice a triangle's
        // area.
        let seen = |p: DVec3, q: DVec3, r: DVec3| (q - p).cross(r - p).dot(direction).abs();
        (seen(a, b, c) + seen(a, b, d) + seen(a, c, d) + seen(b, c, d)) * 0.25
    }

    fn for_each_face(&self, cell: u32, wanted: &dyn Fn(u32) -> bool, each: &mut dyn FnMut(&Face)) {
        // In steps of the fine grid, so that the normal is exact up to the rounding of its length.
        let corners = self.fine_corners(cell);
        let step = self.grid.step / f64::from(FINE_PER_STEP);
        for (face, &neighbour) in self.neighbours[cell as usize].iter().enumerate() {
            if neighbour == NONE || !wanted(neighbour) {
                continue;
            }
            let [a, b, c] = FACES[face].map(|i| corners[i]);
            let outwards = (c - a).cross(b - a);
            let length = outwards.length();
            let point = self.grid.min + a * step;
            each(&Face { neighbour, point, normal: outwards / length, area: length * 0.5 * step * step });
        }
    }

    fn contains(&self, cell: u32, point: DVec3) -> bool {
        Tetrahedron::new(self.fine_corners(cell)).contains(self.to_fine(point))
    }

    fn boundary(&self) -> &[u32] {
        &self.boundary
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cell_frustum::CellFrustum;
    use crate::test_exact::{Random, cross, dot, minus};
    use visibility_core::{Object, Pose, View};

    /// Adds an object of some triangles, in metres.
    fn add(scene: &mut Scene, triangles: &[[DVec3; 3]]) {
        let triangles: Vec<_> = triangles.iter().map(|corners| corners.map(|p| p.as_vec3())).collect();
        let bounds = Aabb::from_points(triangles.iter().flatten().copied());
        let id = scene.insert(Object::new(bounds));
        scene.set_triangles(id, triangles).unwrap();
    }

    /// Cells around a block of 10 by 10 by 3 leaves that are as small as leaves can be, of a metre, in the
    /// middle of a scene of a kilometre.
    fn smallest_cells() -> DelaunayTessellation {
        let mut random = Random(51);
        let mut scene = Scene::new();
        for end in [-1.0, 1.0] {
            add(&mut scene, &[[0.0, 1.0, 2.0].map(|x| DVec3::splat(end * (512.0 / 1.02 - x)))]);
        }
        for leaf in 0..300 {
            let at = DVec3::from_array([leaf % 10, leaf / 10 % 10, leaf / 100].map(f64::from));
            add(&mut scene, &[[(); 3].map(|()| at + DVec3::splat(0.5) + random.fine_vector(0.4))]);
        }
        let cells = DelaunayTessellation::from_scene(&scene, Fineness { vertices: 2, halvings: 10 });
        assert!((cells.grid.step - 1.0).abs() < 1e-3, "{:?}", cells.grid);
        cells
    }

    /// Calls `each` for faces of the smallest cells with the centre of the cell, a point 0.001 to 0.01 steps
    /// of the fine grid beyond the face, and the face's outward normal. In metres.
    fn for_points_beyond_faces(cells: &DelaunayTessellation, mut each: impl FnMut(DVec3, DVec3, DVec3)) {
        let mut random = Random(52);
        let mut count = 0;
        for cell in 0..cells.cells.len() as u32 {
            let corners = cells.corners(cell);
            if Tetrahedron::new(corners).half().max_element() > 1.5 {
                continue;
            }
            cells.for_each_face(cell, &|_| true, &mut |face| {
                for height in [1e-3, 4e-3, 1e-2] {
                    let on = [1, 2, 3].map(|i| {
                        let weight = random.fine_range(0.1, 1.0);
                        let is_of_face = |p: &&DVec3| (**p - face.point).dot(face.normal).abs() < 1e-9;
                        let of_face = corners.iter().filter(is_of_face).nth(i - 1);
                        (of_face.copied().unwrap_or(face.point) * weight, weight)
                    });
                    let middle = on.iter().map(|p| p.0).sum::<DVec3>() / on.iter().map(|p| p.1).sum::<f64>();
                    let step = cells.grid.step / f64::from(FINE_PER_STEP);
                    each(cells.center(cell), middle + face.normal * (height * step), face.normal);
                    count += 1;
                }
            });
        }
        assert!(count > 20_000, "{count}");
    }

    /// Triangles that begin just beyond a face of a cell and lead away from the cell are in some cell, though
    /// the search for the cell of their corner begins in the cell that they do not meet.
    #[test]
    fn triangles_just_beyond_a_face_are_in_a_cell() {
        let cells = smallest_cells();
        let (mut random, mut scene) = (Random(53), Scene::new());
        for_points_beyond_faces(&cells, |center, corner, outwards| {
            add(&mut scene, &[[(); 3].map(|()| center)]);
            add(
                &mut scene,
                &[[0.0, 0.2, 0.2].map(|size| {
                    let away = random.fine_vector(size);
                    corner + away * away.dot(outwards).signum()
                })],
            );
        });
        let content = cells.assign_objects(&scene);
        assert_eq!(content.strays(), [], "triangles in no cell, of {}", scene.len());
    }

    /// Bounds of cells are those of their corners, normals of faces point away from the opposite corner by
    /// exact arithmetic, also where a scene is far from its origin, and unwanted neighbours are left out.
    #[test]
    fn faces_and_bounds_are_those_of_the_corners() {
        for far in [0.0, 1e7] {
            let (mut random, mut scene) = (Random(54), Scene::new());
            for _ in 0..200 {
                let at = DVec3::splat(far) + random.fine_vector(60.0);
                add(&mut scene, &[[at; 3], [at + DVec3::ONE; 3]]);
            }
            let cells = DelaunayTessellation::from_scene(&scene, Fineness { vertices: 2, halvings: 10 });
            for cell in 0..cells.cells.len() as u32 {
                let (corners, bounds) = (cells.corners(cell), cells.cell_bounds(cell));
                for axis in 0..3 {
                    let (least, most) =
                        corners.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), p| {
                            (if p[axis] < a { p[axis] } else { a }, if p[axis] > b { p[axis] } else { b })
                        });
                    let (min, max) = (f64::from(bounds.min[axis]), f64::from(bounds.max[axis]));
                    assert!(min <= least && max >= most, "{bounds:?} holds {corners:?}");
                    let spacing =
                        f64::from(bounds.max[axis].abs().max(bounds.min[axis].abs())) * 2f64.powi(-22);
                    assert!(least - min <= spacing && max - most <= spacing, "{bounds:?} of {corners:?}");
                }
                let fine =
                    cells.cells[cell as usize].map(|vertex| cells.points[vertex as usize].map(i64::from));
                cells.for_each_face(cell, &|_| true, &mut |face| {
                    let near =
                        cells.neighbours[cell as usize].iter().position(|&near| near == face.neighbour);
                    let (apart, mut others) = (near.unwrap(), fine.to_vec());
                    let apex = others.remove(apart);
                    let [a, b, c] = [0, 1, 2].map(|i| others[i]);
                    let exact = cross(minus(b, a), minus(c, a));
                    let outwards = if dot(exact, minus(apex, a)) < 0 { 1.0 } else { -1.0 };
                    let exact = DVec3::from_array(exact.map(|x| x as f64)).normalize() * outwards;
                    assert!((face.normal - exact).length() < 1e-15, "{} {exact}", face.normal);
                    let is_corner = corners.iter().enumerate().any(|(i, p)| i != apart && *p == face.point);
                    assert!(is_corner, "{} is a corner of the face", face.point);
                });
                let mut last = 0;
                cells.for_each_face(cell, &|neighbour| neighbour == NONE, &mut |_| last += 1);
                assert_eq!(last, 0, "faces without a neighbour, which nobody is told of");
                let first = cells.neighbours[cell as usize].iter().copied().find(|&near| near != NONE);
                cells.for_each_face(cell, &|near| Some(near) == first, &mut |_| last += 1);
                assert_eq!(last, 1, "the one face that is wanted");
            }
        }
    }

    /// View rays may leave the eye's cell through every face that the eye is beyond by rounding.
    #[test]
    fn eyes_may_leave_their_cell_through_the_faces_they_are_beyond() {
        let cells = smallest_cells();
        let mut beyond = 0;
        for_points_beyond_faces(&cells, |_, eye, _| {
            let view = View::perspective(Pose::look_at(eye, DVec3::ZERO, DVec3::Z), 1.0, 1.0, 0.1, 100.0);
            let frustum = CellFrustum::new(&view.unwrap(), DVec3::ZERO, &cells.bounds());
            let cell = cells.locate(eye).unwrap();
            cells.for_each_face(cell, &|_| true, &mut |face| {
                assert!(
                    (eye - face.point).dot(face.normal) <= 0.0
                        || frustum.may_exit_through(face.point, face.normal),
                    "the eye at {eye} is in cell {cell}, beyond a face"
                );
                beyond += 1;
            });
        });
        assert!(beyond > 50_000, "{beyond}");
    }

    /// An object with one of its triangles outside of the tessellation's cube is in no cell.
    #[test]
    fn objects_that_leave_the_cube_are_strays() {
        let cells = smallest_cells();
        let mut scene = Scene::new();
        let triangle = |x: f64| [DVec3::X * x, DVec3::X * x + DVec3::Y, DVec3::X * x + DVec3::Z];
        add(&mut scene, &[triangle(0.0), triangle(9.0)]);
        add(&mut scene, &[triangle(0.0), triangle(900.0), triangle(9.0)]);
        let content = cells.assign_objects(&scene);
        assert_eq!(content.strays(), [scene.id_at(1).unwrap()], "the object that leaves the cube");
    }
}
