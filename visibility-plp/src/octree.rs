//! Cells that are the leaves of an octree: small where the scene has many vertices, large where it has none.
//!
//! Klosowski and Silva, "The Prioritized-Layered Projection Algorithm for Visible Set Estimation", 2000,
//! section 4. Leaves are sorted by Morton code, so the leaf of a point is found by bisection. Each leaf looks
//! up its neighbours of its own size or larger, and adds itself to the lists of the larger ones.

use crate::content::Content;
use crate::cover::{Cover, stopped_rays};
use crate::grid::{DEPTH, Grid, STEPS, morton, place_of};
use crate::index_lists::IndexLists;
use crate::overlap::{shape_contains_cube, shape_meets_cube};
use crate::shape::{Shape, for_each_shape};
use crate::tessellation::{Face, Tessellation};
use alloc::vec::Vec;
use visibility_core::glam::DVec3;
use visibility_core::{Aabb, Scene};

/// Settings of the octree that a scene is cut by.
///
/// ```
/// use visibility_plp::Fineness;
/// let fine = Fineness { vertices: 128, ..Fineness::default() };
/// assert!(fine.vertices < Fineness::default().vertices);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Fineness {
    /// Maximum number of triangle corners in a leaf; a node with more is cut in eight. Unlimited where
    /// corners coincide (all in one of 1024 places along each side of the scene), at the last halving, and
    /// beyond 2^28 leaves.
    pub vertices: usize,
    /// Number of times that the scene's side may be halved; more than 10 counts as 10. 0 makes a single
    /// cell.
    pub halvings: u32,
}

impl Default for Fineness {
    /// 768 triangle corners, and sides of at least 1/256 of the scene's. [`PlpCuller`](crate::PlpCuller)
    /// finds no more visible objects with a sixth of that, and takes half as long again.
    /// [`ConservativePlpCuller`](crate::ConservativePlpCuller) gains from finer cells, since only cells
    /// wholly behind something are hidden.
    fn default() -> Self {
        Self { vertices: 768, halvings: 8 }
    }
}

/// A tessellation into cubes, the leaves of an octree, within a cube slightly larger than the scene.
///
/// # Cost
/// To build: O(n log n) in the number of triangles, some three microseconds each, and as much again for each
/// reference, that is, for each pair of an object and a cell that it meets. Objects without triangles that
/// overlap in space, such as thousands of boxes nested in each other, are in all cells inside of them: their
/// references grow with their number times the number of cells. [`Content::reference_count`] tells how many
/// there are, a coarser [`Fineness`] makes fewer. Coincident boxes make no more cells, however many there
/// are.
///
/// Memory: about 60 bytes a cell, 1.2 a reference, and up to three a triangle.
///
/// ```
/// use visibility_core::{Aabb, Scene};
/// use visibility_plp::{Fineness, OctreeTessellation, Tessellation};
/// let mut scene = Scene::new();
/// let box_at = |x: f32| Aabb::from_arrays([x, 0.0, 0.0], [x + 0.5, 1.0, 1.0]);
/// scene.insert_batch((0..100).map(|i| box_at(i as f32)));
/// let cells = OctreeTessellation::with_fineness(&scene, Fineness { vertices: 16, halvings: 7 });
/// assert!(cells.content().cell_count() > 50);
/// ```
#[derive(Clone, Debug)]
pub struct OctreeTessellation {
    pub(crate) grid: Grid,
    pub(crate) fineness: Fineness,
    /// Morton code of each leaf's least place, ascending.
    pub(crate) codes: Vec<u32>,
    /// Least place of each leaf, x, y and z, and its side in steps.
    pub(crate) blocks: Vec<[u16; 4]>,
    /// Neighbours of each leaf, in the encoding of [`link`].
    pub(crate) links: IndexLists,
    /// Leaves with a face on the surface of the cube.
    pub(crate) boundary: Vec<u32>,
    pub(crate) content: Content,
}

/// Node of the octree, needed while cells are filled.
#[derive(Clone, Copy)]
enum Node {
    /// Index of the first of eight consecutive children, in Morton order.
    Inner(u32),
    /// Number of the leaf.
    Leaf(u32),
}

/// An octree under construction.
struct Cutter {
    fineness: Fineness,
    nodes: Vec<Node>,
    /// Morton code of the least place, and level (0 for the whole cube) of each leaf.
    leaves: Vec<(u32, u32)>,
}

impl Cutter {
    /// Cuts the node whose least place has the Morton code `start`. `vertices`: sorted Morton codes of all
    /// vertices in it.
    fn cut(&mut self, node: usize, start: u32, level: u32, vertices: &[u32]) {
        let is_full = self.leaves.len() >= 1 << (LEAF_BITS - 1);
        // Vertices in one step of the grid would all go to the same child each time.
        let is_one_place = vertices.first() == vertices.last();
        let is_deep = level >= self.fineness.halvings.min(DEPTH);
        if vertices.len() <= self.fineness.vertices || is_one_place || is_deep || is_full {
            self.nodes[node] = Node::Leaf(self.leaves.len() as u32);
            self.leaves.push((start, level));
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
            self.cut(first + child as usize, begin, level + 1, mine);
            rest = others;
        }
    }
}

impl OctreeTessellation {
    /// Cuts a scene at the default fineness.
    pub fn new(scene: &Scene) -> Self {
        Self::with_fineness(scene, Fineness::default())
    }

    /// Cuts a scene. Objects whose bounds are not finite become [strays](Content::strays).
    pub fn with_fineness(scene: &Scene, fineness: Fineness) -> Self {
        let (grid, Cutter { nodes, leaves, .. }) = cut(scene, fineness);
        let codes: Vec<u32> = leaves.iter().map(|leaf| leaf.0).collect();
        let blocks = blocks_of(&leaves);
        let (links, boundary) = join(&codes, &blocks);
        let content = fill(scene, &grid, &nodes, blocks.len());
        Self { grid, fineness, codes, blocks, links, boundary, content }
    }

    /// Cuts a scene anew, at the same fineness.
    pub fn rebuild(&mut self, scene: &Scene) {
        *self = Self::with_fineness(scene, self.fineness);
    }

    /// Takes in the scene's changes: changed objects become [strays](Content::strays), which count as
    /// visible. False if the cells should be [rebuilt](Self::rebuild): more than an eighth of the objects are
    /// strays, or the changes are unknown, as for another scene (then nothing has changed, and cullers of
    /// that scene keep everything).
    ///
    /// Cost: proportional to the changes and the strays.
    pub fn sync(&mut self, scene: &Scene) -> bool {
        self.content.sync(scene)
    }

    /// The fineness that it was cut with.
    pub fn fineness(&self) -> Fineness {
        self.fineness
    }

    /// Heap memory in bytes.
    pub fn memory(&self) -> usize {
        size_of_val(&self.codes[..])
            + size_of_val(&self.blocks[..])
            + self.links.memory()
            + size_of_val(&self.boundary[..])
            + self.content.memory()
    }

    /// The least corner of a cell and the length of its edges, both in steps of the grid.
    #[inline]
    fn place(&self, cell: u32) -> ([u32; 3], u32) {
        let [x, y, z, side] = self.blocks[cell as usize].map(u32::from);
        ([x, y, z], side)
    }

    /// Side of a cell in metres.
    #[inline]
    fn side(&self, cell: u32) -> f64 {
        f64::from(self.blocks[cell as usize][3]) * self.grid.step
    }
}

/// Cuts the cube around all shapes of a scene.
fn cut(scene: &Scene, fineness: Fineness) -> (Grid, Cutter) {
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
        let number = |p: &DVec3| morton(grid.place(*p));
        for_each_shape(scene, id, &mut |shape| {
            vertices.extend(shape.corners().as_slice().iter().map(number))
        });
    }
    vertices.sort_unstable();
    let mut cutter = Cutter { fineness, nodes: alloc::vec![Node::Leaf(0)], leaves: Vec::new() };
    cutter.cut(0, 0, 0, &vertices);
    (grid, cutter)
}

/// Least place and side of each leaf, see `OctreeTessellation::blocks`.
fn blocks_of(leaves: &[(u32, u32)]) -> Vec<[u16; 4]> {
    let block = |&(code, level): &(u32, u32)| {
        let [x, y, z] = place_of(code).map(|x| x as u16);
        [x, y, z, (STEPS >> level) as u16]
    };
    leaves.iter().map(block).collect()
}

/// Grid and blocks of the octree of a scene, without contents.
pub(crate) fn leaves_of(scene: &Scene, fineness: Fineness) -> (Grid, Vec<[u16; 4]>) {
    let (grid, cutter) = cut(scene, fineness);
    (grid, blocks_of(&cutter.leaves))
}

/// Bits of a link that hold the leaf's number. The octree has at most half as many leaves, or seven more.
const LEAF_BITS: u32 = 29;

/// Encodes a neighbour: its number, the axis (0, 1, 2) along which it lies, and whether towards greater
/// coordinates.
fn link(leaf: u32, axis: usize, upwards: bool) -> u32 {
    leaf | (axis as u32 * 2 + u32::from(upwards)) << LEAF_BITS
}

/// Decodes a [`link`].
#[inline]
pub(crate) fn linked(link: u32) -> (u32, usize, bool) {
    let side = link >> LEAF_BITS;
    (link & ((1 << LEAF_BITS) - 1), (side / 2) as usize, side & 1 != 0)
}

/// Links of all leaves, and the leaves with a face on the surface of the cube.
fn join(codes: &[u32], blocks: &[[u16; 4]]) -> (IndexLists, Vec<u32>) {
    let mut pairs = Vec::new();
    let mut boundary = Vec::new();
    for (leaf, block) in (0..).zip(blocks) {
        let [x, y, z, side] = block.map(u32::from);
        let mut outside = false;
        for axis in 0..3 {
            for step in [side, side.wrapping_neg()] {
                let mut place = [x, y, z];
                place[axis] = place[axis].wrapping_add(step);
                if place[axis] >= STEPS {
                    outside = true;
                    continue;
                }
                let other = codes.partition_point(|&code| code <= morton(place)) - 1;
                let other_side = u32::from(blocks[other][3]);
                let near = link(other as u32, axis, step == side);
                if other_side >= side {
                    pairs.push((leaf, near));
                }
                if other_side > side {
                    pairs.push((other as u32, link(leaf, axis, step != side)));
                }
            }
        }
        if outside {
            boundary.push(leaf);
        }
    }
    (IndexLists::new(blocks.len(), &pairs), boundary)
}

/// Smallest node that surely contains a shape, with its least place and side in steps.
fn enclosing(nodes: &[Node], grid: &Grid, shape: &Shape) -> (u32, [u32; 3], u32) {
    let corners = shape.corners();
    let corners = corners.as_slice();
    let (least, most) = corners.iter().fold((corners[0], corners[0]), |(a, b), &p| (a.min(p), b.max(p)));
    // A thousandth of a step on each side is far more than rounding and than the tolerance of the overlap
    // tests.
    let hair = DVec3::splat(grid.step * 1e-3);
    let [low, high] = [grid.place(least - hair), grid.place(most + hair)];
    let (mut node, mut place, mut side) = (0, [0; 3], STEPS);
    while let Node::Inner(first) = nodes[node as usize] {
        let half = side / 2;
        let middle = place.map(|x| x + half);
        let upper = |of: [u32; 3], axis: usize| of[axis] >= middle[axis];
        if (0..3).any(|axis| upper(low, axis) != upper(high, axis)) {
            break;
        }
        let mut child = 0;
        for (axis, x) in place.iter_mut().enumerate() {
            if upper(low, axis) {
                child |= 1 << axis;
                *x += half;
            }
        }
        (node, side) = (first + child, half);
    }
    (node, place, side)
}

/// Places every object in all leaves that it meets.
fn fill(scene: &Scene, grid: &Grid, nodes: &[Node], leaves: usize) -> Content {
    let mut pairs = Vec::new();
    let mut cover = alloc::vec![Cover::default(); leaves];
    // By leaf, the object that was placed last.
    let mut last = alloc::vec![u32::MAX; leaves];
    let mut stack = Vec::new();
    for id in scene.ids() {
        let object = id.index() as u32;
        for_each_shape(scene, id, &mut |shape| {
            stack.push(enclosing(nodes, grid, shape));
            while let Some((node, place, side)) = stack.pop() {
                let half = f64::from(side) * 0.5 * grid.step;
                let center = grid.corner(place) + DVec3::splat(half);
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
                            let step = |axis: usize| place[axis] + (child >> axis & 1) * side;
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
        let code = self.grid.contains(point).then(|| morton(self.grid.place(point)))?;
        Some(self.codes.partition_point(|&first| first <= code) as u32 - 1)
    }

    #[inline]
    fn cell_bounds(&self, cell: u32) -> Aabb {
        let (place, side) = self.place(cell);
        self.grid.bounds(place, side)
    }

    #[inline]
    fn center(&self, cell: u32) -> DVec3 {
        let (place, side) = self.place(cell);
        self.grid.corner(place) + DVec3::splat(f64::from(side) * 0.5 * self.grid.step)
    }

    #[inline]
    fn projected_area(&self, cell: u32, direction: DVec3) -> f64 {
        let side = self.side(cell);
        let d = direction.abs();
        side * side * (d.x + d.y + d.z)
    }

    #[inline]
    fn for_each_face(&self, cell: u32, wanted: &dyn Fn(u32) -> bool, each: &mut dyn FnMut(&Face)) {
        let mine = self.blocks[cell as usize];
        let (place, side) = self.place(cell);
        // A point of the three lower faces' planes, and one of the three upper faces'.
        let corners = [self.grid.corner(place), self.grid.corner(place.map(|x| x + side))];
        for &link in self.links.get(cell as usize) {
            let (neighbour, axis, upwards) = linked(link);
            if !wanted(neighbour) {
                continue;
            }
            let other = self.blocks[neighbour as usize];
            let mut normal = DVec3::ZERO;
            normal[axis] = if upwards { 1.0 } else { -1.0 };
            let side = f64::from(mine[3].min(other[3])) * self.grid.step;
            let point = corners[usize::from(upwards)];
            each(&Face { neighbour, point, normal, area: side * side });
        }
    }

    fn contains(&self, cell: u32, point: DVec3) -> bool {
        // Far more than rounding, and too little to change an estimate.
        let half = self.side(cell) * (0.5 + 1e-9);
        (point - self.center(cell)).abs().max_element() <= half
    }

    fn boundary(&self) -> &[u32] {
        &self.boundary
    }
}
