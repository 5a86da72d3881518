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
            let best = self
                .best_split(&region, &walls, &mut faces)
                .filter(|&(_, _, share, area)| may_split && (share >= min_share || area >= min_area));
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

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec;
    use visibility_core::cells::Portal;
    use visibility_testing::Random;

    fn wall(min: [i32; 3], max: [i32; 3]) -> [DVec3; 2] {
        [min, max].map(|p| DVec3::from(p.map(f64::from)))
    }

    /// Returns boxes on the planes of a lattice of 7 planes along each axis, half of them without thickness.
    fn lattice_walls(random: &mut Random) -> Vec<[DVec3; 2]> {
        let count = 1 + random.below(12);
        let mut walls = Vec::new();
        for i in 0..count {
            let min = [0; 3].map(|_| random.between(0, 5));
            let mut max = min.map(|low| random.between(low + 1, 6));
            if i % 2 == 0 {
                let axis = random.below(3);
                max[axis] = min[axis];
            }
            walls.push(wall(min, max));
        }
        walls
    }

    fn holds(region: [DVec3; 2], p: DVec3) -> bool {
        region[0].cmple(p).all() && p.cmple(region[1]).all()
    }

    /// Returns the bounds of walls, `margin` wider on all sides.
    fn bounds_of(walls: &[[DVec3; 2]], margin: f64) -> [DVec3; 2] {
        let min = walls.iter().fold(DVec3::INFINITY, |min, wall| min.min(wall[0]));
        let max = walls.iter().fold(DVec3::NEG_INFINITY, |max, wall| max.max(wall[1]));
        [min - margin, max + margin]
    }

    /// The middles of all unit cubes between the planes of a lattice within a box of whole coordinates.
    fn cubes([min, max]: [DVec3; 2]) -> impl Iterator<Item = DVec3> {
        let range = |axis: usize| min[axis] as i32..max[axis] as i32;
        let (x, y, z) = (range(0), range(1), range(2));
        x.flat_map(move |x| {
            let z = z.clone();
            y.clone().flat_map(move |y| z.clone().map(move |z| [x, y, z]))
        })
        .map(|p| DVec3::from(p.map(f64::from)) + 0.5)
    }

    fn is_on(portal: &Portal, p: DVec3) -> bool {
        let vertices = portal.polygon().vertices();
        let min = vertices.iter().fold(DVec3::INFINITY, |min, &v| min.min(v));
        let max = vertices.iter().fold(DVec3::NEG_INFINITY, |max, &v| max.max(v));
        holds([min, max], p)
    }

    /// Each unit face between two cells of a lattice is covered by a wall, or is in one portal between these
    /// cells; each unit cube is in one cell, or in a wall.
    #[test]
    fn portals_are_what_walls_leave_open_of_the_faces_of_cells() {
        let (mut random, mut open, mut covered) = (Random(1), 0, 0);
        for case in 0..80 {
            let walls = lattice_walls(&mut random);
            let (share, margin) = (random.pick(&[0.0, 0.2, 0.5]), f64::from(random.between(0, 1)));
            let area = random.pick(&[0.0, 3.0, 9.0, 1e9]);
            let limit = random.pick(&[2, 5, 1000]);
            let settings = WallSettings::default().with_margin(margin).with_min_share(share);
            let settings = settings.with_min_area(area).with_max_cells(limit);
            let found = from_walls(&walls, &settings).unwrap();
            let root = bounds_of(&walls, margin);
            let cells: Vec<[DVec3; 2]> =
                found.viewcells.cells().iter().map(|cell| [cell.min, cell.max]).collect();
            assert!(cells.len() <= limit, "case {case}: {} cells of at most {limit}", cells.len());
            assert_eq!(cells.len(), found.graph.cell_count(), "case {case}: bodies of cells");
            let outer =
                |cell: &[DVec3; 2]| (0..3).any(|k| cell[0][k] == root[0][k] || cell[1][k] == root[1][k]);
            let outside: Vec<CellId> =
                (0..).zip(&cells).filter(|(_, cell)| outer(cell)).map(|(i, _)| CellId(i)).collect();
            assert_eq!(found.outside, outside, "case {case}: cells at the sides of the box");
            let owner = |p: DVec3| {
                let mut own = (0..).zip(&cells).filter(|(_, cell)| holds(**cell, p)).map(|(i, _)| CellId(i));
                let first = own.next();
                assert_eq!(own.next(), None, "case {case}: a second cell at {p}");
                let in_wall = walls.iter().any(|wall| holds(*wall, p));
                assert!(first.is_some() || in_wall, "case {case}: {p} is in no cell and no wall");
                first
            };
            for portal in found.graph.portals() {
                assert!(portal.polygon().area() >= 0.99, "case {case}: a portal without area: {portal:?}");
            }
            for p in cubes(root) {
                let here = owner(p);
                for axis in DVec3::AXES {
                    let (face, next) = (p + axis * 0.5, p + axis);
                    if !holds(root, next) {
                        continue;
                    }
                    let found = found.graph.portals().iter().filter(|portal| is_on(portal, face));
                    let found: Vec<_> = found.map(|portal| (portal.cells(), portal.plane().normal)).collect();
                    let is_covered = walls.iter().any(|wall| holds(*wall, face));
                    let expected = match (here, owner(next)) {
                        (Some(a), Some(b)) if a != b && !is_covered => vec![([a, b], axis)],
                        _ => vec![],
                    };
                    assert_eq!(found, expected, "case {case}: portals at {face}, walls {walls:?}");
                    open += expected.len();
                    covered += usize::from(is_covered);
                }
            }
            // No wall that covers enough is left within a cell, unless the limit of cells is reached.
            for (i, cell) in cells.iter().enumerate().filter(|_| limit == 1000) {
                let region = Box3 { min: cell[0], max: cell[1] };
                for (axis, at) in (0..3).flat_map(|axis| (-1..8).map(move |at| (axis, f64::from(at)))) {
                    let is_in = |wall: &&[DVec3; 2]| wall[0][axis] == at || wall[1][axis] == at;
                    let wall_area =
                        |wall: &[DVec3; 2]| Box3 { min: wall[0], max: wall[1] }.common(&region).section(axis);
                    let sum: f64 = walls.iter().filter(is_in).map(wall_area).sum();
                    let is_share = sum / region.section(axis) >= share;
                    let is_enough = sum > 0.0 && (is_share || sum >= area);
                    let is_inside = region.min[axis] < at && at < region.max[axis];
                    assert!(!(is_inside && is_enough), "case {case}: cell {i} has {sum} m2 on {axis} {at}");
                }
            }
        }
        assert!(open > 1000 && covered > 1000, "{open} open faces, {covered} covered ones");
    }

    /// Returns the boxes of the cells of a room of 4 m with a wall in its middle, one of 4 m2 of 16.
    fn cells_beside_a_quarter(thickness: i32, settings: WallSettings) -> usize {
        let walls =
            [wall([0, 0, 0], [4, 4, 0]), wall([0, 0, 4], [4, 4, 4]), wall([2, 0, 0], [2 + thickness, 1, 4])];
        from_walls(&walls, &settings.with_margin(0.0)).unwrap().graph.cell_count()
    }

    #[test]
    fn a_wall_divides_what_it_covers_enough_of() {
        let settings = WallSettings::default();
        let of = |share: f64, area: f64| settings.with_min_share(share).with_min_area(area);
        assert_eq!(cells_beside_a_quarter(0, of(0.25, 1e9)), 2, "a wall of the least share");
        assert_eq!(cells_beside_a_quarter(0, of(0.26, 1e9)), 1, "a wall of less than the least share");
        assert_eq!(cells_beside_a_quarter(0, of(2.0, 4.0)), 2, "a wall of the least area");
        assert_eq!(cells_beside_a_quarter(0, of(2.0, 4.5)), 1, "a wall of less than the least area");
        assert_eq!(cells_beside_a_quarter(0, of(0.0, 1e9)), 2, "ends of a wall, which cover nothing");
        assert_eq!(cells_beside_a_quarter(1, of(0.25, 1e9)), 3, "a thick wall, with a cell beside its end");
        // The default least area is 1/32 of the largest face, here 1/2 of the 16 m2 of the floor.
        let share = settings.with_min_share(2.0);
        assert_eq!(cells_beside_a_quarter(0, share), 2, "a wall of more than the default area");
        let walls = [wall([0, 0, 0], [16, 4, 0]), wall([0, 0, 4], [16, 4, 4]), wall([5, 0, 0], [5, 1, 1])];
        let count = from_walls(&walls, &share.with_margin(0.0)).unwrap().graph.cell_count();
        assert_eq!(count, 1, "a wall of 1 m2, with a floor of 64 m2");
    }

    #[test]
    fn the_most_central_of_the_walls_that_cover_most_divides_first() {
        let full = |x: i32| wall([x, 0, 0], [x, 4, 4]);
        let floor = [wall([0, 0, 0], [10, 4, 0]), wall([0, 0, 4], [10, 4, 4])];
        let ends = |more: &[[DVec3; 2]]| {
            let settings = WallSettings::default().with_margin(0.0).with_max_cells(2);
            let found = from_walls(&[&floor[..], more].concat(), &settings).unwrap();
            found.viewcells.cells().iter().map(|cell| cell.max.x).collect::<Vec<_>>()
        };
        let sorted = |mut ends: Vec<f64>| {
            ends.sort_unstable_by(f64::total_cmp);
            ends
        };
        for order in [[1, 5, 8], [8, 5, 1], [5, 8, 1]] {
            assert_eq!(sorted(ends(&order.map(full))), [5.0, 10.0], "walls at {order:?}");
        }
        // A central wall of 3/4 of the section, and a full one at the side.
        let partial = wall([5, 0, 0], [5, 3, 4]);
        assert_eq!(sorted(ends(&[partial, full(8)])), [8.0, 10.0], "the larger wall");
        // Two walls that overlap in a plane count as covering no more than all of it.
        let twice = [full(1), full(1), full(5)];
        assert_eq!(sorted(ends(&twice)), [5.0, 10.0], "a doubled wall, and a central one");
    }

    #[test]
    fn coordinates_within_the_tolerance_become_one() {
        let walls = |gap: f64| {
            let mut walls =
                vec![wall([0, 0, 0], [8, 4, 0]), wall([0, 0, 4], [8, 4, 4]), wall([4, 0, 0], [4, 2, 4])];
            walls.push([DVec3::new(4.0 + gap, 2.0, 0.0), DVec3::new(4.0 + gap, 4.0, 4.0)]);
            walls
        };
        let settings = WallSettings::default().with_margin(0.0).with_tolerance(0.25).with_min_share(0.1);
        let of = |gap: f64| from_walls(&walls(gap), &settings).unwrap();
        let merged = of(0.25);
        assert_eq!((merged.graph.cell_count(), merged.graph.portals().len()), (2, 0), "walls 0.25 m apart");
        assert_eq!(merged.viewcells.misplacement(), 0.25, "misplacement of cells");
        assert_eq!(of(0.5).graph.cell_count(), 3, "walls 0.5 m apart");
        // What has no area does not widen the box.
        let mut more = walls(0.0);
        more.push(wall([20, 0, 0], [30, 0, 0]));
        let found = from_walls(&more, &settings).unwrap();
        assert_eq!(found.viewcells.divided_box().map(|[_, max]| max.x), Some(8.0), "end of the box");
    }

    #[test]
    fn settings_and_coordinates_at_their_limits() {
        let settings = WallSettings::default().with_tolerance(0.0);
        let is_setting = |made: Result<Subdivision, GeometryError>, name: &str| match made {
            Err(GeometryError::Setting { what, .. }) => what == name,
            _ => false,
        };
        let far = [[DVec3::ZERO, DVec3::new(1e77, 1.0, 1.0)], [DVec3::new(-1e77, 0.0, 0.0), DVec3::ONE]];
        for wall in far {
            let made = from_walls(&[wall], &settings.with_margin(0.0));
            assert!(is_setting(made, "the greatest coordinate"), "a wall up to 1e77 m: {wall:?}");
        }
        let most = [DVec3::new(-1e76, 0.0, 0.0), DVec3::new(1.0, 1.0, 1e76)];
        assert!(from_walls(&[most], &settings.with_margin(0.0)).is_ok(), "a wall up to 1e76 m");
        let one = [wall([0, 0, 0], [1, 1, 1])];
        for bad in [-1.0, f64::INFINITY, f64::NAN] {
            assert!(is_setting(from_walls(&one, &settings.with_margin(bad)), "the margin"), "margin {bad}");
            let made = from_walls(&one, &settings.with_tolerance(bad));
            assert!(is_setting(made, "the tolerance"), "tolerance {bad}");
        }
        for bad in [DVec3::NEG_INFINITY, DVec3::new(0.0, f64::NAN, 0.0)] {
            for wall in [[bad, DVec3::ONE], [DVec3::ZERO, bad]] {
                let made = from_walls(&[one[0], wall], &settings);
                assert_eq!(made, Err(GeometryError::Coordinate { index: 1 }), "{wall:?}");
            }
        }
    }

    #[test]
    fn floor_plans_are_upright_walls_between_a_floor_and_a_ceiling() {
        let [a, b, c] = [[1.0, 2.0], [5.0, 2.0], [5.0, -3.0]].map(DVec2::from);
        let walls = floor_plan(&[[b, a], [b, c]], 0.5, 3.0).unwrap();
        let expected = [
            [[1.0, 2.0, 0.5], [5.0, 2.0, 3.0]],
            [[5.0, -3.0, 0.5], [5.0, 2.0, 3.0]],
            [[1.0, -3.0, 0.5], [5.0, 2.0, 0.5]],
            [[1.0, -3.0, 3.0], [5.0, 2.0, 3.0]],
        ];
        assert_eq!(walls, expected.map(|wall| wall.map(DVec3::from)), "walls, floor and ceiling");
        assert_eq!(floor_plan(&[], 0.5, 3.0), Ok(vec![]), "no segments");
        for bad in [[a, DVec2::NAN], [DVec2::new(5.0, f64::INFINITY), b]] {
            assert_eq!(
                floor_plan(&[[a, b], bad], 0.0, 1.0),
                Err(GeometryError::Coordinate { index: 1 }),
                "{bad:?}"
            );
        }
        assert_eq!(
            floor_plan(&[[a, c]], 0.0, 1.0),
            Err(GeometryError::NotAxial { index: 0 }),
            "a slanted wall"
        );
    }

    /// Rectangles that are thinner or smaller than a polygon may be become polygons that hold them.
    #[test]
    fn rectangles_too_thin_or_too_small_for_a_polygon_are_widened() {
        for (axis, size) in [
            [1e-15, 1.0],
            [1.0, 1e-13],
            [1e-72, 1e-71],
            [1e-60, 1e-71],
            [1e-300, 1e70],
            [1e70, 1e-300],
            [1e-300, 1e-300],
        ]
        .into_iter()
        .enumerate()
        .map(|(i, size)| (i % 3, size))
        {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let mut rectangle = Box3 { min: DVec3::ZERO, max: DVec3::ZERO };
            (rectangle.max[u], rectangle.max[v]) = (size[0], size[1]);
            let polygon = rectangle_polygon(axis, &rectangle).unwrap();
            let (min, max) = polygon
                .vertices()
                .iter()
                .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), &v| (min.min(v), max.max(v)));
            assert!(
                holds([min, max], rectangle.min) && holds([min, max], rectangle.max),
                "{size:?}: {polygon:?}"
            );
            assert_eq!(polygon.plane().map(|plane| plane.normal), Some(DVec3::AXES[axis]), "{size:?}");
            let wider = (max - min - rectangle.max).max_element();
            assert!(wider <= 5e-14 * size[0].max(size[1]) + 4e-70, "{size:?} is {wider} wider");
        }
        let sides = |size: f64| {
            let rectangle = Box3 { min: DVec3::ZERO, max: DVec3::new(size, 1.0, 0.0) };
            rectangle_polygon(2, &rectangle)
                .map(|polygon| polygon.vertices().iter().fold(0.0, |x, v| v.x.max(x)))
        };
        assert_eq!(sides(1e-13), Some(1e-13), "a rectangle that is wide enough stays as it is");
    }
}
