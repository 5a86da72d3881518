//! Cells from walls along the axes, by a kd-tree with splits along the larger walls.
//!
//! This work is based on: Seth Teller and Carlo Sequin, "Visibility Preprocessing for Interactive
//! Walkthroughs", 1991. Space is split along the plane of which opaque faces cover most, until no wall worth
//! it is left. Portals are what is not opaque of the rectangles between two leaves. All planes are
//! coordinates of walls, and nothing is computed from them, so every comparison is exact.

use super::subdivision::{GeometryError, Subdivision, checked};
use alloc::vec::Vec;
use visibility_core::glam::{DVec2, DVec3};
use visibility_core::{
    cells::{CellGraph, CellId},
    geometry::ConvexPolygon,
    pvs::Viewcell,
};

/// Settings of [`from_walls`], in world units.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct WallSettings {
    /// Coordinates that differ by no more than this become one.
    pub tolerance: f64,
    /// The least share of the section of a region, from 0 to 1, that faces must cover for the region to be
    /// split there; or see `least_area`.
    pub least_share: f64,
    /// The area that faces must cover, if it is less than that share. `None`: a thirty-second of the largest
    /// face.
    pub least_area: Option<f64>,
    /// The distance by which the outermost cells reach beyond the walls.
    pub margin: f64,
    /// The most cells. Splitting stops there.
    pub most_cells: usize,
}

impl Default for WallSettings {
    /// Settings for metres: a tolerance of 0.1 mm, a margin of 1 m, a share of 0.3, 32,768 cells.
    fn default() -> Self {
        Self { tolerance: 1e-4, least_share: 0.3, least_area: None, margin: 1.0, most_cells: 1 << 15 }
    }
}

/// A box. Walls of no thickness have the same least and greatest coordinate along one axis.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Box3 {
    min: DVec3,
    max: DVec3,
}

impl Box3 {
    /// The common part of two boxes; empty if its corners are in the wrong order.
    fn common(&self, other: &Self) -> Self {
        Self { min: self.min.max(other.min), max: self.max.min(other.max) }
    }

    /// The area of the section across an axis; zero for an empty box.
    fn section(&self, axis: usize) -> f64 {
        let size = (self.max - self.min).max(DVec3::ZERO);
        size[(axis + 1) % 3] * size[(axis + 2) % 3]
    }
}

/// A node of the tree: a leaf with its cell (`None` if it is solid), or a split.
#[derive(Clone, Copy, Debug)]
enum Node {
    Leaf(Option<CellId>),
    Split { axis: usize, at: f64, low: usize },
}

/// A rectangle in the plane of a split, between a node on the lower side and one on the upper.
struct Shared {
    low: usize,
    high: usize,
    axis: usize,
    rectangle: Box3,
}

/// Divides space along opaque boxes, each given by its least and its greatest corner in world space. A
/// rectangle is a box of no thickness. What boxes fill is no cell. Takes time in proportion to cells times
/// walls at worst.
///
/// # Cost
/// Each cut looks at all walls of the part that it cuts. Walls that are spread out take `n log n` steps;
/// walls of which most abut, or tile one plane, take a number that grows with the square of theirs.
///
/// # Errors
/// [`GeometryError`], with the index of the wall or the name of the setting.
///
/// ```
/// use visibility_core::glam::DVec3;
/// use visibility_portals::from_geometry::{from_walls, WallSettings};
/// // Two rooms of 4 by 4 by 3, the wall between them with a door of 1 by 2.
/// let wall = |min: [f64; 3], max: [f64; 3]| [DVec3::from(min), DVec3::from(max)];
/// let walls = [
///     wall([0.0, 0.0, 0.0], [8.0, 4.0, 0.0]), wall([0.0, 0.0, 3.0], [8.0, 4.0, 3.0]),
///     wall([0.0, 0.0, 0.0], [8.0, 0.0, 3.0]), wall([0.0, 4.0, 0.0], [8.0, 4.0, 3.0]),
///     wall([0.0, 0.0, 0.0], [0.0, 4.0, 3.0]), wall([8.0, 0.0, 0.0], [8.0, 4.0, 3.0]),
///     wall([4.0, 0.0, 0.0], [4.0, 1.0, 3.0]), wall([4.0, 2.0, 0.0], [4.0, 4.0, 3.0]),
///     wall([4.0, 1.0, 2.0], [4.0, 2.0, 3.0]),
/// ];
/// let rooms = from_walls(&walls, &WallSettings { margin: 0.0, ..WallSettings::default() })?;
/// assert_eq!((rooms.graph.cell_count(), rooms.graph.portals().len()), (2, 1));
/// assert_eq!(rooms.graph.portals()[0].polygon().area(), 2.0);
/// # Ok::<(), visibility_portals::from_geometry::GeometryError>(())
/// ```
///
/// # Errors
/// [`GeometryError`], with the wall.
pub fn from_walls(walls: &[[DVec3; 2]], settings: &WallSettings) -> Result<Subdivision, GeometryError> {
    let walls = prepared(walls, checked("the tolerance", settings.tolerance)?)?;
    let margin = DVec3::splat(checked("the margin", settings.margin)?);
    let faces = walls.iter().flat_map(|wall| [0, 1, 2].map(|axis| wall.section(axis)));
    let least_area = match settings.least_area {
        Some(area) => checked("the least area", area)?,
        None => faces.fold(0.0, f64::max) / 32.0,
    };
    let least_share = checked("the least share", settings.least_share)?;
    let all = walls.iter().fold(Box3 { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY }, |all, wall| Box3 {
        min: all.min.min(wall.min),
        max: all.max.max(wall.max),
    });
    if walls.is_empty() {
        return Ok(Subdivision::default());
    }
    let root = Box3 { min: all.min - margin, max: all.max + margin };
    let mut tree = Tree { walls: &walls, nodes: Vec::new(), cells: Vec::new() };
    let most = settings.most_cells.clamp(1, CellGraph::LIMIT);
    tree.build(root, least_share, least_area, most);
    let graph = CellGraph::new(tree.cells.len(), tree.portals(&root))?;
    let reaches_out = |cell: &Box3| cell.min.cmpeq(root.min).any() || cell.max.cmpeq(root.max).any();
    let outside = (0..).zip(&tree.cells).filter(|(_, cell)| reaches_out(cell)).map(|(i, _)| CellId(i));
    let outside = outside.collect();
    let viewcells = tree.cells.iter().map(|cell| Viewcell::from_box(cell.min, cell.max)).collect();
    Ok(Subdivision { graph, viewcells, outside })
}

/// The walls of a floor plan, for [`from_walls`]: an upright rectangle over each segment, from `z = floor` to
/// `z = ceiling`, and the floor and the ceiling over all of them. Segments are along x or y. Openings are
/// where there is no segment.
///
/// # Errors
/// [`GeometryError::NotAWall`] for a segment along neither axis, [`GeometryError::NonFinite`].
pub fn floor_plan(
    segments: &[[DVec2; 2]],
    floor: f64,
    ceiling: f64,
) -> Result<Vec<[DVec3; 2]>, GeometryError> {
    let mut walls = Vec::with_capacity(segments.len() + 2);
    let (mut min, mut max) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for (index, &[a, b]) in segments.iter().enumerate() {
        if !(a.is_finite() && b.is_finite()) {
            return Err(GeometryError::NonFinite { index });
        }
        if a.x != b.x && a.y != b.y {
            return Err(GeometryError::NotAWall { index });
        }
        let (low, high) = (a.min(b), a.max(b));
        (min, max) = (min.min(low), max.max(high));
        walls.push([low.extend(floor), high.extend(ceiling)]);
    }
    if !segments.is_empty() {
        walls.extend([floor, ceiling].map(|z| [min.extend(z), max.extend(z)]));
    }
    Ok(walls)
}

/// The walls, checked, with coordinates that differ by at most the tolerance made one.
fn prepared(walls: &[[DVec3; 2]], tolerance: f64) -> Result<Vec<Box3>, GeometryError> {
    let mut all = Vec::with_capacity(walls.len());
    for (index, &[min, max]) in walls.iter().enumerate() {
        if !(min.is_finite() && max.is_finite()) {
            return Err(GeometryError::NonFinite { index });
        }
        if !min.cmple(max).all() {
            return Err(GeometryError::NotAWall { index });
        }
        all.push(Box3 { min, max });
    }
    for axis in 0..3 {
        let mut values: Vec<f64> = all.iter().flat_map(|wall| [wall.min[axis], wall.max[axis]]).collect();
        values.sort_unstable_by(f64::total_cmp);
        // The first of each run that is no longer than the tolerance stands for all of it.
        let mut starts: Vec<f64> = Vec::new();
        for value in values {
            if starts.last().is_none_or(|&start| value - start > tolerance) {
                starts.push(value);
            }
        }
        let snapped = |value: f64| {
            let after = starts.partition_point(|&start| start <= value);
            after.checked_sub(1).map_or(value, |i| starts[i])
        };
        for wall in &mut all {
            (wall.min[axis], wall.max[axis]) = (snapped(wall.min[axis]), snapped(wall.max[axis]));
        }
    }
    // What has no area covers nothing.
    all.retain(|wall| (0..3).any(|axis| wall.section(axis) > 0.0));
    Ok(all)
}

struct Tree<'a> {
    walls: &'a [Box3],
    nodes: Vec<Node>,
    cells: Vec<Box3>,
}

impl Tree<'_> {
    fn build(&mut self, root: Box3, least_share: f64, least_area: f64, most: usize) {
        self.nodes.push(Node::Leaf(None));
        let mut waiting = alloc::vec![(0, root, (0..self.walls.len() as u32).collect::<Vec<u32>>())];
        let mut faces = Vec::new();
        while let Some((node, region, walls)) = waiting.pop() {
            if walls.iter().any(|&i| fills(&self.walls[i as usize], &region)) {
                continue;
            }
            let may_split = self.cells.len() + waiting.len() + 1 < most;
            let best = self.best_split(&region, &walls, &mut faces).filter(|&(_, _, share, area)| {
                may_split && (share >= least_share || area >= least_area && area > 0.0)
            });
            let Some((axis, at, ..)) = best else {
                self.nodes[node] = Node::Leaf(Some(CellId(self.cells.len() as u32)));
                self.cells.push(region);
                continue;
            };
            let low = self.nodes.len();
            self.nodes[node] = Node::Split { axis, at, low };
            let (mut below, mut above) = (region, region);
            (below.max[axis], above.min[axis]) = (at, at);
            for (child, region) in [(low, below), (low + 1, above)] {
                self.nodes.push(Node::Leaf(None));
                let meets = |&i: &u32| {
                    let common = self.walls[i as usize].common(&region);
                    common.min.cmple(common.max).all()
                };
                waiting.push((child, region, walls.iter().copied().filter(meets).collect()));
            }
        }
    }

    /// The plane of which faces cover most of a region: axis, coordinate, share of the region's section, and
    /// area. Of equal planes the most central.
    fn best_split(
        &self,
        region: &Box3,
        walls: &[u32],
        faces: &mut Vec<(usize, f64, f64)>,
    ) -> Option<(usize, f64, f64, f64)> {
        faces.clear();
        for &wall in walls {
            let wall = &self.walls[wall as usize];
            let common = wall.common(region);
            for axis in 0..3 {
                let area = common.section(axis);
                let inside = |at: f64| region.min[axis] < at && at < region.max[axis] && area > 0.0;
                if inside(wall.min[axis]) {
                    faces.push((axis, wall.min[axis], area));
                }
                if wall.max[axis] != wall.min[axis] && inside(wall.max[axis]) {
                    faces.push((axis, wall.max[axis], area));
                }
            }
        }
        faces.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        let mut best: Option<(usize, f64, f64, f64)> = None;
        let mut best_score = (0.0, 0.0);
        for group in faces.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            let (axis, at, _) = group[0];
            let area: f64 = group.iter().map(|face| face.2).sum();
            let share = (area / region.section(axis)).min(1.0);
            let (below, above) = (at - region.min[axis], region.max[axis] - at);
            let score = (share, below.min(above) / (below + above));
            if score.0 > best_score.0 || score.0 == best_score.0 && score.1 > best_score.1 {
                (best, best_score) = (Some((axis, at, share, area)), score);
            }
        }
        best
    }

    /// The open parts of the rectangles between pairs of cells, the cell at lower coordinates first.
    fn portals(&self, root: &Box3) -> Vec<(ConvexPolygon, [CellId; 2])> {
        let mut shared = Vec::new();
        let mut regions = alloc::vec![(0, *root)];
        let mut portals = Vec::new();
        while let Some((node, region)) = regions.pop() {
            let Node::Split { axis, at, low } = self.nodes[node] else { continue };
            let (mut below, mut above, mut rectangle) = (region, region, region);
            (below.max[axis], above.min[axis]) = (at, at);
            (rectangle.min[axis], rectangle.max[axis]) = (at, at);
            regions.extend([(low + 1, above), (low, below)]);
            shared.push(Shared { low, high: low + 1, axis, rectangle });
            while let Some(pair) = shared.pop() {
                self.descend(pair, &mut shared, &mut portals);
            }
        }
        portals
    }

    fn descend(
        &self,
        pair: Shared,
        shared: &mut Vec<Shared>,
        portals: &mut Vec<(ConvexPolygon, [CellId; 2])>,
    ) {
        let Shared { low, high, axis, rectangle } = pair;
        match (self.nodes[low], self.nodes[high]) {
            (Node::Leaf(Some(a)), Node::Leaf(Some(b))) => {
                for open in self.open(axis, &rectangle) {
                    portals.extend(upright(axis, &open).map(|polygon| (polygon, [a, b])));
                }
            }
            (Node::Leaf(None), _) | (_, Node::Leaf(None)) => {}
            (Node::Split { axis: split, at, low: child }, _) if split != axis => {
                for (low, rectangle) in halves(&rectangle, split, at, child) {
                    shared.push(Shared { low, high, axis, rectangle });
                }
            }
            // Of children one behind the other, that beside the plane.
            (Node::Split { low: child, .. }, _) => {
                shared.push(Shared { low: child + 1, high, axis, rectangle })
            }
            (_, Node::Split { axis: split, at, low: child }) if split != axis => {
                for (high, rectangle) in halves(&rectangle, split, at, child) {
                    shared.push(Shared { low, high, axis, rectangle });
                }
            }
            (_, Node::Split { low: child, .. }) => shared.push(Shared { low, high: child, axis, rectangle }),
        }
    }

    /// The rectangles that are left of one when walls are taken away.
    fn open(&self, axis: usize, rectangle: &Box3) -> Vec<Box3> {
        let (mut open, mut next) = (alloc::vec![*rectangle], Vec::new());
        for wall in self.walls {
            let common = wall.common(rectangle);
            if common.min.cmple(common.max).all() && common.section(axis) > 0.0 {
                open.iter().for_each(|piece| without(axis, piece, wall, &mut next));
                core::mem::swap(&mut open, &mut next);
                next.clear();
            }
        }
        open
    }
}

/// Whether a wall fills a region.
fn fills(wall: &Box3, region: &Box3) -> bool {
    wall.min.cmple(region.min).all() && region.max.cmple(wall.max).all()
}

/// The parts of a rectangle below and above a coordinate, each with the child that it belongs to.
fn halves(rectangle: &Box3, axis: usize, at: f64, child: usize) -> impl Iterator<Item = (usize, Box3)> {
    let (mut below, mut above) = (*rectangle, *rectangle);
    (below.max[axis], above.min[axis]) = (below.max[axis].min(at), above.min[axis].max(at));
    [(child, below), (child + 1, above)].into_iter().filter(move |(_, part)| part.min[axis] < part.max[axis])
}

/// Appends what a wall leaves of a rectangle: up to four.
fn without(axis: usize, piece: &Box3, wall: &Box3, out: &mut Vec<Box3>) {
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let apart = |i: usize| wall.max[i] <= piece.min[i] || piece.max[i] <= wall.min[i];
    if apart(u) || apart(v) {
        out.push(*piece);
        return;
    }
    let mut rest = *piece;
    for i in [u, v] {
        if rest.min[i] < wall.min[i] {
            let mut part = rest;
            part.max[i] = wall.min[i];
            rest.min[i] = wall.min[i];
            out.push(part);
        }
        if wall.max[i] < rest.max[i] {
            let mut part = rest;
            part.min[i] = wall.max[i];
            rest.max[i] = wall.max[i];
            out.push(part);
        }
    }
}

/// A rectangle across an axis as a polygon whose normal points along the axis. `None` if it is too thin for a
/// polygon.
fn upright(axis: usize, rectangle: &Box3) -> Option<ConvexPolygon> {
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let corner = |a: DVec3, b: DVec3| {
        let mut p = rectangle.min;
        (p[u], p[v]) = (a[u], b[v]);
        p
    };
    let (min, max) = (rectangle.min, rectangle.max);
    ConvexPolygon::new([corner(min, min), corner(max, min), corner(max, max), corner(min, max)]).ok()
}
