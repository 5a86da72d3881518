//! Cells from axis-aligned walls, by a kd-tree with splits along the larger walls.
//!
//! This work is based on: Seth Teller and Carlo Sequin, "Visibility Preprocessing for Interactive
//! Walkthroughs", 1991. Space is split along the plane with the greatest covered fraction, until no plane is
//! covered enough. A portal is an open part of the rectangle that two leaves share. All planes are
//! coordinates of walls, and nothing is computed from them, so every comparison is exact.

use super::subdivision::{GeometryError, Subdivision, checked, checked_extent};
use alloc::vec::Vec;
use visibility_core::glam::{DVec2, DVec3};
use visibility_core::{
    cells::{CellGraph, CellId},
    geometry::ConvexPolygon,
    pvs::{Viewcell, Viewcells},
};

/// Settings of [`from_walls`]. Lengths are in world units.
#[derive(Clone, Copy, PartialEq, Debug)]
#[must_use]
pub struct WallSettings {
    pub(crate) tolerance: f64,
    pub(crate) min_share: f64,
    pub(crate) min_area: Option<f64>,
    pub(crate) margin: f64,
    pub(crate) max_cells: usize,
}

impl Default for WallSettings {
    /// Returns settings for coordinates in metres: a tolerance of 0.1 mm, a margin of 1 m, a least share of
    /// 0.3, a least area of 1/32 of the largest wall face, at most 32,768 cells.
    fn default() -> Self {
        Self { tolerance: 1e-4, min_share: 0.3, min_area: None, margin: 1.0, max_cells: 1 << 15 }
    }
}

impl WallSettings {
    /// Sets the distance, in world units, up to which coordinates of walls along one axis become one. 0
    /// merges equal coordinates only.
    pub fn with_tolerance(self, tolerance: f64) -> Self {
        Self { tolerance, ..self }
    }

    /// Sets the minimum covered fraction, from 0 to 1, for a split: a region is split along a plane if wall
    /// faces in the plane cover at least this fraction of the area in which the plane cuts the region. A
    /// covered area of at least [the least area](Self::with_min_area) also suffices.
    pub fn with_min_share(self, min_share: f64) -> Self {
        Self { min_share, ..self }
    }

    /// Sets the covered area, in square world units, that suffices for a split even if the covered fraction
    /// is below [the least share](Self::with_min_share). `None`: 1/32 of the largest wall face.
    pub fn with_min_area(self, min_area: impl Into<Option<f64>>) -> Self {
        Self { min_area: min_area.into(), ..self }
    }

    /// Sets the distance, in world units, by which the outermost cells extend beyond the bounds of all walls.
    pub fn with_margin(self, margin: f64) -> Self {
        Self { margin, ..self }
    }

    /// Sets the maximum number of cells. Splitting stops at this number. Values above `CellGraph::LIMIT`
    /// count as `CellGraph::LIMIT`.
    pub fn with_max_cells(self, max_cells: usize) -> Self {
        Self { max_cells, ..self }
    }
}

/// An axis-aligned box in world space. A wall without thickness has equal minimum and maximum coordinates
/// along one axis.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Box3 {
    min: DVec3,
    max: DVec3,
}

impl Box3 {
    /// Returns the intersection of two boxes. A component of `min` exceeds that of `max` if the intersection
    /// is empty.
    fn common(&self, other: &Self) -> Self {
        Self { min: self.min.max(other.min), max: self.max.min(other.max) }
    }

    /// Returns the area of the box's section perpendicular to `axis` (0 to 2). 0 if the section is empty.
    fn section(&self, axis: usize) -> f64 {
        let size = (self.max - self.min).max(DVec3::ZERO);
        size[(axis + 1) % 3] * size[(axis + 2) % 3]
    }
}

/// A node of the kd-tree. A leaf holds its cell, `None` if a wall fills it. A split holds the axis (0 to 2)
/// perpendicular to its plane, the world-space coordinate of that plane on the axis, and `low`, the index of
/// the child at lesser coordinates; the child at greater coordinates has the index `low + 1`.
#[derive(Clone, Copy, Debug)]
enum Node {
    Leaf(Option<CellId>),
    Split { axis: usize, at: f64, low: usize },
}

/// A world-space rectangle in the plane of a split that still has to be divided among leaves. `axis` is the
/// axis perpendicular to the rectangle. `low` and `high` are the indices of the kd-tree nodes that touch the
/// rectangle at lesser and at greater coordinates of `axis`.
struct Shared {
    low: usize,
    high: usize,
    axis: usize,
    rectangle: Box3,
}

/// Divides space along opaque axis-aligned boxes, each given by its minimum and maximum corner in world
/// space. A rectangle is a box without thickness. Regions filled by a box become no cell. Without walls the
/// result is empty.
///
/// # Cost
/// Each split inspects all walls of the region that it splits. Walls that are spread out take `n log n`
/// steps. Walls of which most abut, or tile one plane, take a number of steps that grows with the square of
/// the number of walls. Portals take time proportional to cells times walls at worst.
///
/// # Errors
/// [`GeometryError::Coordinate`] or [`GeometryError::NotAxial`] with the index of the wall,
/// [`GeometryError::Setting`] with the name of the setting, or of the greatest coordinate if it is above
/// 1e76, or [`GeometryError::Graph`].
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
/// let rooms = from_walls(&walls, &WallSettings::default().with_margin(0.0))?;
/// assert_eq!((rooms.graph.cell_count(), rooms.graph.portals().len()), (2, 1));
/// assert_eq!(rooms.graph.portals()[0].polygon().area(), 2.0);
/// # Ok::<(), visibility_portals::from_geometry::GeometryError>(())
/// ```
pub fn from_walls(walls: &[[DVec3; 2]], settings: &WallSettings) -> Result<Subdivision, GeometryError> {
    let tolerance = checked("the tolerance", settings.tolerance)?;
    let walls = prepared(walls, tolerance)?;
    let margin = DVec3::splat(checked("the margin", settings.margin)?);
    let faces = walls.iter().flat_map(|wall| [0, 1, 2].map(|axis| wall.section(axis)));
    let min_area = match settings.min_area {
        Some(area) => checked("the least area", area)?,
        None => faces.fold(0.0, f64::max) / 32.0,
    };
    let min_share = checked("the least share", settings.min_share)?;
    let all = walls.iter().fold(Box3 { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY }, |all, wall| Box3 {
        min: all.min.min(wall.min),
        max: all.max.max(wall.max),
    });
    if walls.is_empty() {
        return Ok(Subdivision::default());
    }
    let root = Box3 { min: all.min - margin, max: all.max + margin };
    checked_extent(root.min.abs().max(root.max.abs()).max_element())?;
    let mut tree = Tree { walls: &walls, nodes: Vec::new(), cells: Vec::new() };
    let most = settings.max_cells.clamp(1, CellGraph::LIMIT);
    tree.build(root, min_share, min_area, most);
    let graph = CellGraph::new(tree.cells.len(), tree.portals(&root))?;
    let reaches_out = |cell: &Box3| cell.min.cmpeq(root.min).any() || cell.max.cmpeq(root.max).any();
    let outside = (0..).zip(&tree.cells).filter(|(_, cell)| reaches_out(cell)).map(|(i, _)| CellId(i));
    let outside = outside.collect();
    let cells = tree.cells.iter().map(|cell| Viewcell::from_box(cell.min, cell.max));
    let viewcells = Viewcells::of_divided_box(cells, root.min, root.max, tolerance);
    Ok(Subdivision { graph, viewcells, outside })
}

/// Returns the world-space walls, as minimum and maximum corners, of a floor plan, for [`from_walls`]: an
/// upright rectangle over each segment, from `z = floor` to `z = ceiling`, and one floor and one ceiling over
/// the bounds of all segments. Each segment must be parallel to x or y. Openings are gaps between segments.
/// Without segments the result is empty.
///
/// # Errors
/// [`GeometryError::NotAxial`] for a segment parallel to neither axis, [`GeometryError::Coordinate`] for a
/// segment with a NaN or infinite coordinate, both with the index of the segment.
pub fn floor_plan(
    segments: &[[DVec2; 2]],
    floor: f64,
    ceiling: f64,
) -> Result<Vec<[DVec3; 2]>, GeometryError> {
    let mut walls = Vec::with_capacity(segments.len() + 2);
    let (mut min, mut max) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for (index, &[a, b]) in segments.iter().enumerate() {
        if !(a.is_finite() && b.is_finite()) {
            return Err(GeometryError::Coordinate { index });
        }
        if a.x != b.x && a.y != b.y {
            return Err(GeometryError::NotAxial { index });
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

/// Checks the walls and snaps coordinates that differ by at most `tolerance` to one value. Walls without area
/// are left out.
///
/// # Errors
/// [`GeometryError::Coordinate`] or [`GeometryError::NotAxial`] with the index of the wall.
fn prepared(walls: &[[DVec3; 2]], tolerance: f64) -> Result<Vec<Box3>, GeometryError> {
    let mut all = Vec::with_capacity(walls.len());
    for (index, &[min, max]) in walls.iter().enumerate() {
        if !(min.is_finite() && max.is_finite()) {
            return Err(GeometryError::Coordinate { index });
        }
        if !min.cmple(max).all() {
            return Err(GeometryError::NotAxial { index });
        }
        all.push(Box3 { min, max });
    }
    for axis in 0..3 {
        let mut values: Vec<f64> = all.iter().flat_map(|wall| [wall.min[axis], wall.max[axis]]).collect();
        values.sort_unstable_by(f64::total_cmp);
        // The least coordinate of each run stands for the whole run; a run is no longer than the tolerance.
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
    // A box without area in all three sections covers nothing.
    all.retain(|wall| (0..3).any(|axis| wall.section(axis) > 0.0));
    Ok(all)
}

struct Tree<'a> {
    walls: &'a [Box3],
    nodes: Vec<Node>,
    cells: Vec<Box3>,
}

impl Tree<'_> {
    fn build(&mut self, root: Box3, min_share: f64, min_area: f64, most: usize) {
        self.nodes.push(Node::Leaf(None));
        let mut waiting = alloc::vec![(0, root, (0..self.walls.len() as u32).collect::<Vec<u32>>())];
        let mut faces = Vec::new();
        while let Some((node, region, walls)) = waiting.pop() {
            if walls.iter().any(|&i| fills(&self.walls[i as usize], &region)) {
                continue;
            }
            let may_split = self.cells.len() + waiting.len() + 1 < most;
            let best = self.best_split(&region, &walls, &mut faces).filter(|&(_, _, share, area)| {
                may_split && (share >= min_share || area >= min_area && area > 0.0)
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

    /// Returns the split plane of which wall faces cover the greatest fraction within a region. The four
    /// values are the axis perpendicular to the plane (0 to 2), the coordinate of the plane on that axis, the
    /// covered fraction (0 to 1), and the covered area in square world units. Among equal fractions the most
    /// central plane wins. `walls` are the indices of the region's walls; `faces` is scratch memory. `None`
    /// if no face lies strictly inside the region.
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

    /// Returns the open parts of the rectangles that pairs of neighbouring cells share, each with the two
    /// cells. The polygon's normal points from the first cell, at lower coordinates, into the second. `root`
    /// is the whole divided box.
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
                self.divide_shared(pair, &mut shared, &mut portals);
            }
        }
        portals
    }

    fn divide_shared(
        &self,
        pair: Shared,
        shared: &mut Vec<Shared>,
        portals: &mut Vec<(ConvexPolygon, [CellId; 2])>,
    ) {
        let Shared { low, high, axis, rectangle } = pair;
        match (self.nodes[low], self.nodes[high]) {
            (Node::Leaf(Some(a)), Node::Leaf(Some(b))) => {
                for open in self.open_parts(axis, &rectangle) {
                    portals.extend(rectangle_polygon(axis, &open).map(|polygon| (polygon, [a, b])));
                }
            }
            (Node::Leaf(None), _) | (_, Node::Leaf(None)) => {}
            (Node::Split { axis: split, at, low: child }, _) if split != axis => {
                for (low, rectangle) in halves(&rectangle, split, at, child) {
                    shared.push(Shared { low, high, axis, rectangle });
                }
            }
            // Both children lie along the split axis: the one that touches the rectangle's plane.
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

    /// Returns the parts of `rectangle` that no wall covers, as boxes without extent along `axis`, which is
    /// perpendicular to the rectangle. The whole rectangle if no wall overlaps it; empty if walls cover all
    /// of it.
    fn open_parts(&self, axis: usize, rectangle: &Box3) -> Vec<Box3> {
        let (mut open, mut next) = (alloc::vec![*rectangle], Vec::new());
        for wall in self.walls {
            let common = wall.common(rectangle);
            if common.min.cmple(common.max).all() && common.section(axis) > 0.0 {
                open.iter().for_each(|piece| subtract_wall(axis, piece, wall, &mut next));
                core::mem::swap(&mut open, &mut next);
                next.clear();
            }
        }
        open
    }
}

/// Tests whether the box `wall` contains the box `region`; touching boundaries count as contained. `false` if
/// part of `region` is outside `wall`.
fn fills(wall: &Box3, region: &Box3) -> bool {
    wall.min.cmple(region.min).all() && region.max.cmple(wall.max).all()
}

/// Returns the parts of `rectangle` below and above coordinate `at` of `axis`, each with the index of its
/// kd-tree node: `child` below, `child + 1` above. A part without extent is left out.
fn halves(rectangle: &Box3, axis: usize, at: f64, child: usize) -> impl Iterator<Item = (usize, Box3)> {
    let (mut below, mut above) = (*rectangle, *rectangle);
    (below.max[axis], above.min[axis]) = (below.max[axis].min(at), above.min[axis].max(at));
    [(child, below), (child + 1, above)].into_iter().filter(move |(_, part)| part.min[axis] < part.max[axis])
}

/// Appends to `out` the parts of the rectangle `piece`, perpendicular to `axis`, that the box `wall` does not
/// cover: up to four rectangles, or the whole `piece` if the two do not overlap.
fn subtract_wall(axis: usize, piece: &Box3, wall: &Box3, out: &mut Vec<Box3>) {
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

/// Least width of a portal as a share of its length: above the least area of a [`ConvexPolygon`].
const THINNEST: f64 = 2e-14;
/// Least width of a portal in world units: squares of its area do not underflow.
const SMALLEST: f64 = 1e-70;

/// Returns a rectangle perpendicular to `axis` as a polygon whose normal points along the axis. One that is
/// too thin or too small for a polygon is widened.
fn rectangle_polygon(axis: usize, rectangle: &Box3) -> Option<ConvexPolygon> {
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let mut rectangle = *rectangle;
    let size = rectangle.max - rectangle.min;
    for side in [u, v] {
        if size[side] < size.max_element() * THINNEST || size[side] < SMALLEST {
            let more = (size.max_element() * THINNEST).max(SMALLEST);
            rectangle.min[side] -= more;
            rectangle.max[side] += more;
        }
    }
    let corner = |a: DVec3, b: DVec3| {
        let mut p = rectangle.min;
        (p[u], p[v]) = (a[u], b[v]);
        p
    };
    let (min, max) = (rectangle.min, rectangle.max);
    ConvexPolygon::new([corner(min, min), corner(max, min), corner(max, max), corner(min, max)]).ok()
}
