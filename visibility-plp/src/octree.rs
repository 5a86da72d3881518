//! Cells that are the leaves of an octree: small where the scene has many vertices, large where it has none.
//!
//! Klosowski and Silva, "The Prioritized-Layered Projection Algorithm for Visible Set Estimation", 2000, section 4. Leaves lie in Morton's
//! order, so that the leaf of a point is found by bisection, and the neighbours of a leaf with it: each looks for those that are as
//! large as itself or larger, and enters itself in the lists of the larger ones.

use crate::content::Content;
use crate::cover::{Cover, stopped_rays};
use crate::grid::{DEPTH, Grid, STEPS, morton, place_of};
use crate::grouped::Grouped;
use crate::parts::{Part, for_each_part};
use crate::{Face, Tessellation};
use alloc::vec::Vec;
use visibility_core::glam::DVec3;
use visibility_core::{Aabb, Scene};

/// How finely a scene is cut into cells.
///
/// ```
/// use visibility_plp::Fineness;
/// let fine = Fineness { vertices: 128, ..Fineness::default() };
/// assert!(fine.vertices < Fineness::default().vertices);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Fineness {
    /// A leaf of the octree with more corners of triangles than this is cut in eight, unless all of them lie in one place (of
    /// 1024 along each side of the scene).
    pub vertices: usize,
    /// But none is cut more often than this, from the whole scene on: the least side is that of the scene halved so often. At most 10.
    pub halvings: u32,
}

impl Default for Fineness {
    /// 768 corners of triangles, and sides no less than 1/256 of the scene's. A sixth of that finds no more of what is visible, and takes half as
    /// long again; but conservative culling needs cells that lie wholly behind something, and gains from it.
    fn default() -> Self {
        Self { vertices: 768, halvings: 8 }
    }
}

/// A tessellation into cubes, the leaves of an octree.
///
/// # Cost
/// To build: O(n log n) in the number of triangles, some three microseconds each, and as much again for each reference, that
/// is, for each pair of an object and a cell that it meets. Objects without triangles that overlap in space, such as
/// thousands of boxes nested in each other, are in all cells inside of them: their references grow with their number times
/// the number of cells. [`Content::reference_count`] tells how many there are, a coarser [`Fineness`] makes fewer. Coincident
/// boxes make no more cells, however many there are.
///
/// Memory: about 60 bytes a cell, 1.2 a reference, and up to three a triangle.
///
/// ```
/// use visibility_core::{Aabb, Scene};
/// use visibility_plp::{Fineness, OctreeTessellation, Tessellation};
/// let mut scene = Scene::new();
/// scene.insert_batch((0..100).map(|i| Aabb::from_arrays([i as f32, 0.0, 0.0], [i as f32 + 0.5, 1.0, 1.0])));
/// let cells = OctreeTessellation::with_fineness(&scene, Fineness { vertices: 16, halvings: 7 });
/// assert!(cells.content().cell_count() > 50);
/// ```
#[derive(Clone, Debug)]
pub struct OctreeTessellation {
    pub(crate) grid: Grid,
    pub(crate) fineness: Fineness,
    /// The Morton number of each leaf's first place, ascending.
    pub(crate) codes: Vec<u32>,
    /// Its corner and its side.
    pub(crate) blocks: Vec<[u16; 4]>,
    /// By leaf, its neighbours, each with the side on which it lies: see [`linked`].
    pub(crate) links: Grouped,
    pub(crate) boundary: Vec<u32>,
    pub(crate) content: Content,
}

/// The inner nodes and leaves of the octree, while cells are filled.
#[derive(Clone, Copy)]
enum Node {
    /// The first of its eight children.
    Inner(u32),
    Leaf(u32),
}

/// Cuts the octree.
struct Cutter {
    fineness: Fineness,
    nodes: Vec<Node>,
    /// First place and level of each leaf.
    leaves: Vec<(u32, u32)>,
}

impl Cutter {
    /// Cuts a node that begins at a place and holds these vertices, given by their sorted numbers.
    fn cut(&mut self, node: usize, start: u32, level: u32, vertices: &[u32]) {
        let is_full = self.leaves.len() >= 1 << (LEAF_BITS - 1);
        // Vertices in one step of the grid would all go to the same child, time and again.
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
    /// Cuts a scene, at the default fineness.
    pub fn new(scene: &Scene) -> Self {
        Self::with_fineness(scene, Fineness::default())
    }

    /// Cuts a scene.
    pub fn with_fineness(scene: &Scene, fineness: Fineness) -> Self {
        let (grid, Cutter { nodes, leaves, .. }) = cut(scene, fineness);
        let codes: Vec<u32> = leaves.iter().map(|leaf| leaf.0).collect();
        let blocks = blocks_of(&leaves);
        let (links, boundary) = join(&codes, &blocks);
        let content = fill(scene, &grid, &nodes, blocks.len());
        Self { grid, fineness, codes, blocks, links, boundary, content }
    }

    /// Cuts the scene anew, at the same fineness.
    pub fn rebuild(&mut self, scene: &Scene) {
        *self = Self::with_fineness(scene, self.fineness);
    }

    /// Takes in what has changed in the scene: changed objects become [strays](Content::strays), which count as visible. False when so much
    /// has changed that it is better [built anew](Self::rebuild).
    pub fn sync(&mut self, scene: &Scene) -> bool {
        self.content.sync(scene)
    }

    /// How finely it is cut.
    pub fn fineness(&self) -> Fineness {
        self.fineness
    }

    /// Bytes held.
    pub fn memory(&self) -> usize {
        size_of_val(&self.codes[..])
            + size_of_val(&self.blocks[..])
            + self.links.memory()
            + size_of_val(&self.boundary[..])
            + self.content.memory()
    }

    #[inline]
    fn place(&self, cell: u32) -> ([u32; 3], u32) {
        let [x, y, z, side] = self.blocks[cell as usize].map(u32::from);
        ([x, y, z], side)
    }

    #[inline]
    fn side(&self, cell: u32) -> f64 {
        f64::from(self.blocks[cell as usize][3]) * self.grid.step
    }
}

/// Cuts the cube around a scene.
fn cut(scene: &Scene, fineness: Fineness) -> (Grid, Cutter) {
    let mut bounds = Aabb::EMPTY;
    for id in scene.ids() {
        for_each_part(scene, id, &mut |part| {
            for &p in part.corners().as_slice() {
                bounds = bounds.union(&Aabb::new(p.as_vec3(), p.as_vec3()));
            }
        });
    }
    let grid = Grid::around(&bounds);
    let mut vertices = Vec::new();
    for id in scene.ids() {
        let number = |p: &DVec3| morton(grid.place(*p));
        for_each_part(scene, id, &mut |part| vertices.extend(part.corners().as_slice().iter().map(number)));
    }
    vertices.sort_unstable();
    let mut cutter = Cutter { fineness, nodes: alloc::vec![Node::Leaf(0)], leaves: Vec::new() };
    cutter.cut(0, 0, 0, &vertices);
    (grid, cutter)
}

/// Corner and side of each leaf.
fn blocks_of(leaves: &[(u32, u32)]) -> Vec<[u16; 4]> {
    let block = |&(code, level): &(u32, u32)| {
        let [x, y, z] = place_of(code).map(|x| x as u16);
        [x, y, z, (STEPS >> level) as u16]
    };
    leaves.iter().map(block).collect()
}

/// The leaves of the octree alone, by corner and side.
pub(crate) fn leaves_of(scene: &Scene, fineness: Fineness) -> (Grid, Vec<[u16; 4]>) {
    let (grid, cutter) = cut(scene, fineness);
    (grid, blocks_of(&cutter.leaves))
}

/// Bits of a link that name the leaf. The octree is not cut into more.
const LEAF_BITS: u32 = 29;

/// A leaf, and on which side it lies: along which axis, and whether upwards.
fn link(leaf: u32, axis: usize, upwards: bool) -> u32 {
    leaf | (axis as u32 * 2 + u32::from(upwards)) << LEAF_BITS
}

/// The leaf that a link names, the axis along which it lies, and whether upwards.
#[inline]
pub(crate) fn linked(link: u32) -> (u32, usize, bool) {
    let side = link >> LEAF_BITS;
    (link & ((1 << LEAF_BITS) - 1), (side / 2) as usize, side & 1 != 0)
}

/// The neighbours of all leaves, and those leaves on the surface of the cube.
fn join(codes: &[u32], blocks: &[[u16; 4]]) -> (Grouped, Vec<u32>) {
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
    (Grouped::new(blocks.len(), &pairs), boundary)
}

/// The smallest node that surely holds a part, with its place and side: looking for what it meets may begin there.
fn enclosing(nodes: &[Node], grid: &Grid, part: &Part) -> (u32, [u32; 3], u32) {
    let corners = part.corners();
    let corners = corners.as_slice();
    let (least, most) = corners.iter().fold((corners[0], corners[0]), |(a, b), &p| (a.min(p), b.max(p)));
    // A thousandth of a step on each side is far more than rounding, and than what tests give away.
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

/// Places every object in the leaves that it meets.
fn fill(scene: &Scene, grid: &Grid, nodes: &[Node], leaves: usize) -> Content {
    let mut pairs = Vec::new();
    let mut cover = alloc::vec![Cover::default(); leaves];
    // The object that was last placed in each leaf.
    let mut last = alloc::vec![u32::MAX; leaves];
    let mut stack = Vec::new();
    for id in scene.ids() {
        let object = id.index() as u32;
        for_each_part(scene, id, &mut |part| {
            stack.push(enclosing(nodes, grid, part));
            while let Some((node, place, side)) = stack.pop() {
                let half = f64::from(side) * 0.5 * grid.step;
                let center = grid.corner(place) + DVec3::splat(half);
                if !part.meets_box(center, half) {
                    continue;
                }
                match nodes[node as usize] {
                    Node::Leaf(leaf) => {
                        if last[leaf as usize] != object {
                            last[leaf as usize] = object;
                            pairs.push((leaf, object));
                        }
                        let cover = &mut cover[leaf as usize];
                        if !cover.is_full() && !part.has_inside(center, half) {
                            let half = DVec3::splat(half);
                            part.for_each_triangle(|triangle| {
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
        // The corners that the lower and the upper three sides have in common.
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
        // Far more than rounding, far less than what matters to an order.
        let half = self.side(cell) * (0.5 + 1e-9);
        (point - self.center(cell)).abs().max_element() <= half
    }

    fn boundary(&self) -> &[u32] {
        &self.boundary
    }
}
