//! Cells that are the leaves of an octree: small where the scene has many vertices, large where the scene has
//! none.
//!
//! Klosowski and Silva, "The Prioritized-Layered Projection Algorithm for Visible Set Estimation", 2000,
//! section 4. Leaves are sorted by Morton code, so the leaf of a point is found by bisection. Each leaf looks
//! up its neighbours of its own size or larger, and adds itself to the lists of the larger neighbours.

use crate::content::Content;
use crate::grid::{DEPTH, Grid, STEPS, morton, voxel_of};
use crate::index_lists::IndexLists;
use crate::overlap::{shape_contains_cube, shape_meets_cube};
use crate::ray_coverage::{Cover, stopped_rays};
use crate::shape::{Shape, for_each_shape};
use crate::tessellation::{Face, Tessellation};
use alloc::vec::Vec;
use visibility_core::glam::DVec3;
use visibility_core::{Aabb, Scene};

/// Limits on the subdivision of a scene into octree leaves.
///
/// ```
/// use visibility_plp::Fineness;
/// let coarse = Fineness { vertices: 1000, ..Fineness::default() };
/// assert!(coarse.vertices > Fineness::default().vertices);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Fineness {
    /// Maximum number of triangle corners in a leaf; an octree node with more is split into eight. Exceeded
    /// where all corners lie in one voxel of 1/1024 of the scene's side, at the last halving, and beyond
    /// 2^28 leaves.
    pub vertices: usize,
    /// Maximum number of times that the scene's side is halved; values above 10 count as 10. With 0 the
    /// scene is a single cell.
    pub halvings: u32,
}

impl Default for Fineness {
    /// At most 64 triangle corners per leaf, and leaves of at least 1/256 of the scene's side. Twelve times
    /// as many corners make a frame of [`PlpCuller`](crate::PlpCuller) up to a quarter shorter, and lose up
    /// to 14 % of the visible objects at small budgets, most in buildings and in scenes of few triangles.
    fn default() -> Self {
        Self { vertices: 64, halvings: 8 }
    }
}

/// Tessellation into cubes, the leaves of an octree, within a cube slightly larger than the scene.
///
/// # Cost
/// Building takes O(n log n) in the number of triangles, about three microseconds each, and as much again per
/// reference (a pair of an object and a cell that the object meets). An object without triangles is in all
/// cells that its bounds meet. For such objects that overlap in space, such as thousands of nested boxes, the
/// number of references grows with the number of objects times the number of cells.
/// [`Content::reference_count`] returns the number of references; a coarser [`Fineness`] reduces it.
/// Coincident boxes do not add cells, however many there are.
///
/// Memory: about 60 bytes per cell, 1.2 per reference, and up to three per triangle.
///
/// ```
/// use visibility_core::{Aabb, Scene};
/// use visibility_plp::{Fineness, OctreeTessellation, Tessellation};
/// let mut scene = Scene::new();
/// let box_at = |x: f32| Aabb::from_arrays([x, 0.0, 0.0], [x + 0.5, 1.0, 1.0]);
/// scene.insert_batch((0..100).map(|i| box_at(i as f32)));
/// let cells = OctreeTessellation::from_scene(&scene, Fineness { vertices: 16, halvings: 7 });
/// assert!(cells.content().cell_count() > 50);
/// ```
#[derive(Clone, Debug)]
pub struct OctreeTessellation {
    /// Cube around the scene, in 1024 steps per side, on which the leaves lie.
    grid: Grid,
    /// Settings of the subdivision, kept for `rebuild`.
    fineness: Fineness,
    /// Morton code of the voxel (cube of one grid step) at each leaf's minimum corner, ascending.
    codes: Vec<u32>,
    /// Minimum corner of each leaf as x, y and z in grid steps from the grid's minimum corner, then the
    /// leaf's side in grid steps.
    leaf_positions: Vec<[u16; 4]>,
    /// Adjacency of the leaves: for each leaf its neighbours across faces, encoded by [`encode_neighbour`].
    neighbours: IndexLists,
    /// Numbers of the leaves with a face on the surface of the cube that the octree fills.
    boundary: Vec<u32>,
    /// Lists of the objects in each leaf.
    content: Content,
}

/// Node of the octree, needed while objects are assigned to leaves.
#[derive(Clone, Copy)]
enum Node {
    /// Index in the array of nodes of the first of eight consecutive children, in Morton order.
    Inner(u32),
    /// Number of a leaf, which is a cell of the tessellation.
    Leaf(u32),
}

/// Octree of a scene's vertices, without object lists.
pub(crate) struct Subdivision {
    /// Grid around all shapes of the scene.
    pub(crate) grid: Grid,
    /// Settings that limit the subdivision.
    fineness: Fineness,
    /// All nodes; the root is the first.
    nodes: Vec<Node>,
    /// Morton code of the voxel (cube of one grid step) at each leaf's minimum corner, ascending.
    codes: Vec<u32>,
    /// Minimum corner of each leaf as x, y and z in grid steps from the grid's minimum corner, then the
    /// leaf's side in grid steps.
    pub(crate) leaf_positions: Vec<[u16; 4]>,
}

impl Subdivision {
    /// Builds the grid around all shapes of a scene, and the octree of the scene's vertices on that grid.
    pub(crate) fn new(scene: &Scene, fineness: Fineness) -> Self {
        let mut bounds = Aabb::EMPTY;
        for id in scene.ids() {
            for_each_shape(scene, id, &mut |shape| {
                for &p in shape.corners().as_slice() {
                    bounds = bounds.union(&Aabb::new(p.as_vec3(), p.as_vec3()));
                }
            });
        }
        let grid = Grid::around(&bounds);
        let mut vertices = Vec::new();
        for id in scene.ids() {
            let number = |p: &DVec3| morton(grid.voxel(*p));
            for_each_shape(scene, id, &mut |shape| {
                vertices.extend(shape.corners().as_slice().iter().map(number))
            });
        }
        vertices.sort_unstable();
        let (nodes, codes, leaf_positions) = (alloc::vec![Node::Leaf(0)], Vec::new(), Vec::new());
        let mut octree = Self { grid, fineness, nodes, codes, leaf_positions };
        octree.split(0, 0, 0, &vertices);
        octree
    }

    /// Splits the node with index `node` recursively and appends its leaves in Morton order. `start` is
    /// the Morton code of the voxel (cube of one grid step) at the node's minimum corner, and `level` the
    /// number of halvings so far. `vertices` holds the sorted Morton codes of all vertices in the node.
    fn split(&mut self, node: usize, start: u32, level: u32, vertices: &[u32]) {
        let is_full = self.codes.len() >= 1 << (LEAF_BITS - 1);
        // Vertices in one voxel would all go to the same child at each split.
        let is_one_voxel = vertices.first() == vertices.last();
        let is_deep = level >= self.fineness.halvings.min(DEPTH);
        if vertices.len() <= self.fineness.vertices || is_one_voxel || is_deep || is_full {
            self.nodes[node] = Node::Leaf(self.codes.len() as u32);
            self.codes.push(start);
            self.leaf_positions.push(leaf_position(start, STEPS >> level));
            return;
        }
        let first = self.nodes.len();
        self.nodes[node] = Node::Inner(first as u32);
        self.nodes.extend([Node::Leaf(0); 8]);
        let size = 1 << (3 * (DEPTH - level - 1));
        let mut rest = vertices;
        for child in 0..8 {
            let begin = start + child * size;
            let (mine, others) = rest.split_at(rest.partition_point(|&code| code - begin < size));
            self.split(first + child as usize, begin, level + 1, mine);
            rest = others;
        }
    }
}

impl OctreeTessellation {
    /// Partitions a scene into cubic cells at the default fineness. Objects whose bounds are not finite
    /// become [strays](Content::strays), which count as visible.
    pub fn new(scene: &Scene) -> Self {
        Self::from_scene(scene, Fineness::default())
    }

    /// Partitions a scene into cubic cells, the leaves of an octree with the given limits. Objects whose
    /// bounds are not finite become [strays](Content::strays), which count as visible.
    pub fn from_scene(scene: &Scene, fineness: Fineness) -> Self {
        let Subdivision { grid, nodes, codes, leaf_positions, .. } = Subdivision::new(scene, fineness);
        let (neighbours, boundary) = find_neighbours(&codes, &leaf_positions);
        let content = assign_objects(scene, &grid, &nodes, leaf_positions.len());
        Self { grid, fineness, codes, leaf_positions, neighbours, boundary, content }
    }

    /// Partitions a scene anew at the same fineness, replacing all cells. Afterwards only objects whose
    /// bounds are not finite are strays (in no cell).
    pub fn rebuild(&mut self, scene: &Scene) {
        *self = Self::from_scene(scene, self.fineness);
    }

    /// Makes all objects that changed since the last call or build [strays](Content::strays), which count as
    /// visible. Returns false if the tessellation should be [rebuilt](Self::rebuild): more than an eighth of
    /// the objects are strays, or the changes are unknown, as for another scene. In the latter case nothing
    /// is modified, and cullers of that scene keep all objects.
    ///
    /// Cost: proportional to the changes and the strays.
    pub fn sync(&mut self, scene: &Scene) -> bool {
        self.content.sync(scene)
    }

    /// Returns the heap memory of the tessellation in bytes, without spare capacity.
    pub fn memory(&self) -> usize {
        size_of_val(&self.codes[..])
            + size_of_val(&self.leaf_positions[..])
            + self.neighbours.memory()
            + size_of_val(&self.boundary[..])
            + self.content.memory()
    }

    /// Returns the minimum corner of a cell in grid steps from the grid's minimum corner, and the cell's side
    /// in grid steps.
    #[inline]
    fn voxel_and_side(&self, cell: u32) -> ([u32; 3], u32) {
        let [x, y, z, side] = self.leaf_positions[cell as usize].map(u32::from);
        ([x, y, z], side)
    }

    /// Returns the side of a cell in metres.
    #[inline]
    fn side(&self, cell: u32) -> f64 {
        f64::from(self.leaf_positions[cell as usize][3]) * self.grid.step
    }
}

/// Returns the minimum corner of a leaf as x, y and z in grid steps from the grid's minimum corner, then the
/// leaf's side in grid steps. `code` is the Morton code of the voxel (cube of one grid step) at that corner.
fn leaf_position(code: u32, side: u32) -> [u16; 4] {
    let [x, y, z] = voxel_of(code);
    [x, y, z, side].map(|x| x as u16)
}

/// Number of low bits of an encoded neighbour that hold the leaf's number. The octree has at most 2^28 + 7
/// leaves: splitting ends at 2^28, and the last split adds seven.
const LEAF_BITS: u32 = 29;

/// Encodes a neighbour in 32 bits: the number of the neighbouring leaf, the axis (0, 1, 2) along which it
/// lies, and whether it lies towards greater coordinates (`upwards` true) or lesser ones (false).
fn encode_neighbour(leaf: u32, axis: usize, upwards: bool) -> u32 {
    leaf | (axis as u32 * 2 + u32::from(upwards)) << LEAF_BITS
}

/// Decodes a neighbour encoded by [`encode_neighbour`]. Returns the number of the neighbouring leaf, the axis
/// (0, 1, 2) along which it lies, and true if it lies towards greater coordinates, false towards lesser ones.
#[inline]
fn decode_neighbour(encoded: u32) -> (u32, usize, bool) {
    let side = encoded >> LEAF_BITS;
    (encoded & ((1 << LEAF_BITS) - 1), (side / 2) as usize, side & 1 != 0)
}

/// Returns the adjacency of all leaves, encoded by [`encode_neighbour`], and the numbers of the leaves with a
/// face on the surface of the cube that the octree fills.
fn find_neighbours(codes: &[u32], leaf_positions: &[[u16; 4]]) -> (IndexLists, Vec<u32>) {
    let mut pairs = Vec::new();
    let mut boundary = Vec::new();
    for (leaf, position) in (0..).zip(leaf_positions) {
        let [x, y, z, side] = position.map(u32::from);
        let mut outside = false;
        for axis in 0..3 {
            for step in [side, side.wrapping_neg()] {
                let mut voxel = [x, y, z];
                voxel[axis] = voxel[axis].wrapping_add(step);
                if voxel[axis] >= STEPS {
                    outside = true;
                    continue;
                }
                let other = codes.partition_point(|&code| code <= morton(voxel)) - 1;
                let other_side = u32::from(leaf_positions[other][3]);
                let near = encode_neighbour(other as u32, axis, step == side);
                if other_side >= side {
                    pairs.push((leaf, near));
                }
                if other_side > side {
                    pairs.push((other as u32, encode_neighbour(leaf, axis, step != side)));
                }
            }
        }
        if outside {
            boundary.push(leaf);
        }
    }
    (IndexLists::new(leaf_positions.len(), pairs.iter().copied()), boundary)
}

/// Returns the smallest node that certainly contains a scene-relative shape: the node's index, the position
/// of the node's minimum corner, and the node's side. Position and side are in grid steps.
fn enclosing(nodes: &[Node], grid: &Grid, shape: &Shape) -> (u32, [u32; 3], u32) {
    let corners = shape.corners();
    let corners = corners.as_slice();
    let (least, most) = corners.iter().fold((corners[0], corners[0]), |(a, b), &p| (a.min(p), b.max(p)));
    // The shape is enlarged by a thousandth of a step on each side, far more than rounding and the tolerance
    // of the overlap tests.
    let hair = DVec3::splat(grid.step * 1e-3);
    let [low, high] = [grid.voxel(least - hair), grid.voxel(most + hair)];
    let (mut node, mut voxel, mut side) = (0, [0; 3], STEPS);
    while let Node::Inner(first) = nodes[node as usize] {
        let half = side / 2;
        let middle = voxel.map(|x| x + half);
        let upper = |of: [u32; 3], axis: usize| of[axis] >= middle[axis];
        if (0..3).any(|axis| upper(low, axis) != upper(high, axis)) {
            break;
        }
        let mut child = 0;
        for (axis, x) in voxel.iter_mut().enumerate() {
            if upper(low, axis) {
                child |= 1 << axis;
                *x += half;
            }
        }
        (node, side) = (first + child, half);
    }
    (node, voxel, side)
}

/// Assigns every object to all leaves that its shapes meet. Also samples which share of the rays through each
/// leaf its objects stop. `leaves` is the number of leaves.
fn assign_objects(scene: &Scene, grid: &Grid, nodes: &[Node], leaves: usize) -> Content {
    let mut pairs = Vec::new();
    let mut cover = alloc::vec![Cover::default(); leaves];
    // For each leaf, the index of the object that was added last.
    let mut last = alloc::vec![u32::MAX; leaves];
    let mut stack = Vec::new();
    for id in scene.ids() {
        let object = id.index() as u32;
        for_each_shape(scene, id, &mut |shape| {
            stack.push(enclosing(nodes, grid, shape));
            while let Some((node, voxel, side)) = stack.pop() {
                let half = f64::from(side) * 0.5 * grid.step;
                let center = grid.corner(voxel) + DVec3::splat(half);
                if !shape_meets_cube(shape, center, half) {
                    continue;
                }
                match nodes[node as usize] {
                    Node::Leaf(leaf) => {
                        if last[leaf as usize] != object {
                            last[leaf as usize] = object;
                            pairs.push((leaf, object));
                        }
                        let cover = &mut cover[leaf as usize];
                        // A leaf entirely inside a solid is never entered, so its share does not matter.
                        if !cover.is_full() && !shape_contains_cube(shape, center, half) {
                            let half = DVec3::splat(half);
                            shape.for_each_triangle(|triangle| {
                                cover.add(stopped_rays(triangle, center, half, |_| true));
                            });
                        }
                    }
                    Node::Inner(first) => {
                        let side = side / 2;
                        for child in 0..8 {
                            let step = |axis: usize| voxel[axis] + (child >> axis & 1) * side;
                            stack.push((first + child, [step(0), step(1), step(2)], side));
                        }
                    }
                }
            }
        });
    }
    Content::new(scene, &pairs, cover.iter().map(|cover| cover.shares([1.0; 3])).collect())
}

impl Tessellation for OctreeTessellation {
    #[inline]
    fn content(&self) -> &Content {
        &self.content
    }

    fn bounds(&self) -> Aabb {
        self.grid.bounds([0; 3], STEPS)
    }

    fn locate(&self, point: DVec3) -> Option<u32> {
        let code = self.grid.contains(point).then(|| morton(self.grid.voxel(point)))?;
        Some(self.codes.partition_point(|&first| first <= code) as u32 - 1)
    }

    #[inline]
    fn cell_bounds(&self, cell: u32) -> Aabb {
        let (voxel, side) = self.voxel_and_side(cell);
        self.grid.bounds(voxel, side)
    }

    #[inline]
    fn center(&self, cell: u32) -> DVec3 {
        let (voxel, side) = self.voxel_and_side(cell);
        self.grid.corner(voxel) + DVec3::splat(f64::from(side) * 0.5 * self.grid.step)
    }

    #[inline]
    fn projected_area(&self, cell: u32, direction: DVec3) -> f64 {
        let side = self.side(cell);
        let d = direction.abs();
        side * side * (d.x + d.y + d.z)
    }

    #[inline]
    fn for_each_face(&self, cell: u32, wanted: &dyn Fn(u32) -> bool, each: &mut dyn FnMut(&Face)) {
        let mine = self.leaf_positions[cell as usize];
        let (voxel, side) = self.voxel_and_side(cell);
        // The point where the planes of the three lower faces meet, and the point where those of the three
        // upper faces meet.
        let corners = [self.grid.corner(voxel), self.grid.corner(voxel.map(|x| x + side))];
        for &encoded in self.neighbours.get(cell as usize) {
            let (neighbour, axis, upwards) = decode_neighbour(encoded);
            if !wanted(neighbour) {
                continue;
            }
            let other = self.leaf_positions[neighbour as usize];
            let mut normal = DVec3::ZERO;
            normal[axis] = if upwards { 1.0 } else { -1.0 };
            let side = f64::from(mine[3].min(other[3])) * self.grid.step;
            let point = corners[usize::from(upwards)];
            each(&Face { neighbour, point, normal, area: side * side });
        }
    }

    fn contains(&self, cell: u32, point: DVec3) -> bool {
        // 1e-9 is far more than rounding, and too little to affect a solidity estimate.
        let half = self.side(cell) * (0.5 + 1e-9);
        (point - self.center(cell)).abs().max_element() <= half
    }

    fn boundary(&self) -> &[u32] {
        &self.boundary
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_exact::{Random, RandomExact};
    use visibility_core::Object;

    /// Appends the leaves (minimum corner and side, in grid steps) of a node with the given vertices.
    fn expected_leaves(
        [x, y, z, side]: [u32; 4],
        vertices: &[[u32; 3]],
        fineness: Fineness,
        leaves: &mut Vec<[u16; 4]>,
    ) {
        let is_in = |v: &&[u32; 3]| [x, y, z].iter().zip(*v).all(|(low, at)| (*low..low + side).contains(at));
        let own: Vec<_> = vertices.iter().filter(is_in).copied().collect();
        let can_part = own.iter().any(|v| *v != own[0]);
        if own.len() > fineness.vertices && can_part && side > STEPS >> fineness.halvings.min(10) {
            for child in 0..8 {
                let at =
                    [x, y, z].into_iter().enumerate().map(|(i, low)| low + (child >> i & 1) * (side / 2));
                let at: Vec<u32> = at.collect();
                expected_leaves([at[0], at[1], at[2], side / 2], &own, fineness, leaves);
            }
        } else {
            leaves.push([x, y, z, side].map(|x| x as u16));
        }
    }

    /// Leaves are those that counting the corners in each cube gives; faces are where two leaves touch, and
    /// as large as the smaller one's; each leaf is found at its minimum corner.
    #[test]
    fn leaves_and_faces_are_those_of_a_plain_count() {
        let mut random = Random(61);
        for round in 0..12 {
            let mut scene = Scene::new();
            let mut vertices = Vec::new();
            // Corners in the middle of voxels, many of them beside a face of a large node.
            let corner = |random: &mut Random| {
                [(); 3].map(|()| (64 * (random.whole(7) + 8) + random.whole(2)).clamp(0, 1023) as u32)
            };
            let extent = Aabb::from_arrays([-50.0; 3], [50.0; 3]);
            let grid = Grid::around(&extent);
            let point = |v: [u32; 3]| (grid.corner(v) + DVec3::splat(grid.step * 0.5)).as_vec3();
            let mut add = |corners: [[u32; 3]; 3]| {
                let t = corners.map(point);
                let id = scene.insert(Object::new(Aabb::from_points(t)));
                scene.set_triangles(id, [t]).unwrap();
                vertices.extend(corners);
            };
            (0..30).for_each(|_| add([(); 3].map(|()| corner(&mut random))));
            (0..3).for_each(|_| add([[200; 3]; 3]));
            let id = scene.insert(extent);
            let t = [-50.0, 50.0, 50.0].map(visibility_core::glam::Vec3::splat);
            scene.set_triangles(id, [t]).unwrap();
            vertices.extend(t.map(|p| grid.voxel(p.as_dvec3())));
            let fineness = Fineness { vertices: 1 + round % 4, halvings: [0, 2, 10, 12][round / 3] };
            let cells = OctreeTessellation::from_scene(&scene, fineness);
            assert_eq!(cells.grid, grid, "the grid is that around the extent");
            let mut leaves = Vec::new();
            expected_leaves([0, 0, 0, STEPS], &vertices, fineness, &mut leaves);
            assert_eq!(cells.leaf_positions, leaves, "round {round}: leaves");
            for (cell, leaf) in (0..).zip(&leaves) {
                let [mine, mut found, mut expected] = [leaf.map(u32::from).to_vec(), Vec::new(), Vec::new()];
                cells.for_each_face(cell, &|_| true, &mut |face| {
                    let side = (face.area.sqrt() / grid.step).round() as u32;
                    let axis = (0..3).find(|&axis| face.normal[axis] != 0.0).unwrap();
                    found.extend(
                        [(face.neighbour, axis as u32, u32::from(face.normal[axis] > 0.0), side)]
                            .map(|(a, b, c, d)| a << 16 | b << 14 | c << 13 | d),
                    );
                });
                let mut is_outer = false;
                for axis in 0..3 {
                    is_outer |= mine[axis] == 0 || mine[axis] + mine[3] == STEPS;
                    for (other, leaf) in (0..).zip(&leaves) {
                        let other_leaf = leaf.map(u32::from);
                        let meets = |of: usize| {
                            mine[of] < other_leaf[of] + other_leaf[3] && other_leaf[of] < mine[of] + mine[3]
                        };
                        if !meets((axis + 1) % 3) || !meets((axis + 2) % 3) {
                            continue;
                        }
                        let upwards = mine[axis] + mine[3] == other_leaf[axis];
                        if upwards || other_leaf[axis] + other_leaf[3] == mine[axis] {
                            let side = mine[3].min(other_leaf[3]);
                            expected
                                .push(other << 16 | (axis as u32) << 14 | u32::from(upwards) << 13 | side);
                        }
                    }
                }
                found.sort_unstable();
                expected.sort_unstable();
                assert_eq!(found, expected, "round {round}: faces of {leaf:?}");
                assert_eq!(cells.boundary().contains(&cell), is_outer, "round {round}: {leaf:?}");
                let corner = [mine[0], mine[1], mine[2]];
                let inside = grid.corner(corner) + DVec3::splat(grid.step * 0.5);
                assert_eq!(cells.locate(inside), Some(cell), "round {round}: the cell at {corner:?}");
            }
        }
    }

    /// Flat boxes on and next to many faces of voxels are in every cell that they touch.
    #[test]
    fn objects_are_in_the_cells_that_they_touch() {
        let mut scene = Scene::new();
        let extent = Aabb::from_arrays([-1.0; 3], [1.0; 3]);
        let grid = Grid::around(&extent);
        let mut boxes = alloc::vec![extent];
        for (axis, face) in (0..3).flat_map(|axis| (16..=1008).step_by(16).map(move |face| (axis, face))) {
            let at = grid.corner([face; 3])[axis] as f32;
            for x in [at.next_down(), at, at.next_up()] {
                let (mut min, mut max) = ([0.1f32; 3], [0.11f32; 3]);
                (min[axis], max[axis]) = (x, x);
                boxes.push(Aabb::from_arrays(min, max));
            }
        }
        let ids: Vec<_> = boxes.iter().map(|&bounds| scene.insert(Object::new(bounds))).collect();
        let tessellation = OctreeTessellation::from_scene(&scene, Fineness { vertices: 4, halvings: DEPTH });
        assert_eq!(tessellation.grid, grid, "the grid is that around the large box");
        let cells = tessellation.content().cell_count() as u32;
        let mut touched = 0;
        for cell in 0..cells {
            let (voxel, side) = tessellation.voxel_and_side(cell);
            let [low, high] = [voxel, voxel.map(|x| x + side)].map(|voxel| grid.corner(voxel));
            let held: Vec<u32> = tessellation.content().primitives(cell).collect();
            for (id, bounds) in ids.iter().zip(&boxes) {
                let [min, max] = [bounds.min, bounds.max].map(|p| p.as_dvec3());
                if min.cmple(high).all() && low.cmple(max).all() {
                    assert!(held.contains(&(id.index() as u32)), "{bounds:?} in {low} to {high}");
                    touched += 1;
                }
            }
        }
        assert!(cells > 500 && touched > 2000, "{cells} cells, {touched} touched");
    }
}
