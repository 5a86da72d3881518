//! Convex cells and portals of a plan, for cullers of cells and portals.
//!
//! This work is based on: Stefan Hertel and Kurt Mehlhorn, "Fast Triangulation of Simple Polygons", 1983: an
//! edge between two convex cells is removed where the joined cell has no reflex corner at the edge's ends. At
//! most four times as many cells are left as necessary.

use super::error::PlanError;
use super::plan::{BLOCKS, Plan, WALL};
use super::predicates::{Point, is_same_way, orient};
use super::triangulation::{NONE, next, previous};
use alloc::vec::Vec;
use visibility_core::cells::{CellGraph, CellGraphError, CellId};
use visibility_core::geometry::{ConvexPolygon, Plane};
use visibility_core::glam::DVec3;
use visibility_core::pvs::{Viewcell, Viewcells};

/// Cells and portals made by [`Plan::cells`].
#[derive(Clone, Debug)]
pub struct PlanCells {
    /// Cells, and portals between them: upright rectangles.
    pub graph: CellGraph,
    /// Volumes of the cells: viewcell `i` is the upright prism of cell `i`.
    pub viewcells: Viewcells,
    /// Cell of each triangle of the plan, by number of the triangle.
    of_triangle: Vec<CellId>,
    /// First corner of each cell in `corners`; then the end of the last.
    first_corner: Vec<u32>,
    corners: Vec<Point>,
}

impl PlanCells {
    /// Returns the cell that a triangle of the plan is part of. `None` for an unknown triangle.
    pub fn cell_of(&self, triangle: u32) -> Option<CellId> {
        self.of_triangle.get(triangle as usize).copied()
    }

    /// Returns the corners of a cell on the plan, counter-clockwise, in world units. Corners between
    /// collinear sides are listed too. Empty for an unknown cell.
    pub fn outline(&self, cell: CellId) -> &[[f64; 2]] {
        let ends = self.first_corner.get(cell.index()).zip(self.first_corner.get(cell.index() + 1));
        ends.map_or(&[], |(&from, &to)| &self.corners[from as usize..to as usize])
    }
}

/// Cells as rings of half-edges while they grow together.
struct Rings<'a> {
    plan: &'a Plan,
    /// Half-edge after each half-edge along the boundary of its cell.
    after: Vec<u32>,
    /// Half-edge before each half-edge along the boundary of its cell.
    before: Vec<u32>,
    /// Parent of each triangle in a union-find forest.
    parent: Vec<u32>,
}

impl Rings<'_> {
    fn cell(&mut self, h: u32) -> u32 {
        let mut t = h / 3;
        while self.parent[t as usize] != t {
            let up = self.parent[self.parent[t as usize] as usize];
            self.parent[t as usize] = up;
            t = up;
        }
        t
    }

    /// Removes an edge if the joined cell is convex.
    fn try_remove(&mut self, h: u32) {
        let edge = self.plan.edges[h as usize];
        let Some(twin) = edge.twin().filter(|twin| edge.twin & WALL == 0 && h < *twin) else { return };
        let (a, b) = (self.cell(h), self.cell(twin));
        if a == b || !self.is_convex_without(h, twin) || !self.is_convex_without(twin, h) {
            return;
        }
        for (h, twin) in [(h, twin), (twin, h)] {
            let (before, after) = (self.before[h as usize], self.after[twin as usize]);
            self.after[before as usize] = after;
            self.before[after as usize] = before;
        }
        self.parent[a.max(b) as usize] = a.min(b);
    }

    /// Returns whether the corner at the origin of `h` is convex once `h` is removed. Two collinear sides are
    /// convex, unless the second turns back along the first.
    fn is_convex_without(&self, h: u32, twin: u32) -> bool {
        let at = self.plan.start(h);
        let from = self.plan.start(self.before[h as usize]);
        let to = self.plan.start(next(self.after[twin as usize]));
        let turn = orient(from, at, to);
        turn > 0.0 || turn == 0.0 && !is_same_way(at, from, to)
    }
}

impl Plan {
    /// Divides the plan into convex cells, with a portal wherever sight may pass from one to the next:
    /// between cells, and at clear and one-way walls. Cells and portals reach from the height `low` to `high`
    /// in world units, along z. Walls that are opaque now have no portal, so make doors clear first. Nothing
    /// outside the rectangle around the plan is in a cell.
    ///
    /// A portal that is so narrow beside its height, or so low beside its width, that it has no area (some
    /// 1e-14) is made larger than its wall's gap, so that nothing seen is hidden.
    ///
    /// ```
    /// use visibility_2d::cdt::{Opacity, Plan, Wall};
    /// // Two rooms with a door between.
    /// let corners = [[0.0, 0.0], [4.0, 0.0], [8.0, 0.0], [8.0, 3.0], [4.0, 3.0], [0.0, 3.0]];
    /// let mut walls: Vec<_> = (0..6).map(|i| Wall::new(corners[i], corners[(i + 1) % 6])).collect();
    /// walls.push(Wall::new([4.0, 0.0], [4.0, 1.0]));
    /// walls.push(Wall::new([4.0, 1.0], [4.0, 2.0]).with_opacity(Opacity::Clear));
    /// walls.push(Wall::new([4.0, 2.0], [4.0, 3.0]));
    /// let cells = Plan::new(&walls)?.cells(0.0, 2.5)?;
    /// assert_eq!(cells.viewcells.locate([1.0, 1.0, 1.0].into()).is_some(), true);
    /// # Ok::<(), visibility_2d::cdt::PlanError>(())
    /// ```
    ///
    /// # Errors
    /// [`PlanError::Heights`] unless `low` is below `high` and both are finite, or if areas of portals are
    /// too large for `f64`. [`PlanError::TooMany`] for more cells or portals than [`CellGraph::LIMIT`].
    pub fn cells(&self, low: f64, high: f64) -> Result<PlanCells, PlanError> {
        if !(low < high && low.is_finite() && high.is_finite()) {
            return Err(PlanError::Heights);
        }
        let edges = self.edges.len() as u32;
        let mut rings = Rings {
            plan: self,
            after: (0..edges).map(next).collect(),
            before: (0..edges).map(previous).collect(),
            parent: (0..edges / 3).collect(),
        };
        (0..edges).for_each(|h| rings.try_remove(h));
        // A half-edge on the boundary of each cell, by the cell's root: one that was not removed.
        let mut first_edge = alloc::vec![NONE; edges as usize / 3];
        for h in 0..edges {
            if rings.after[rings.before[h as usize] as usize] == h {
                first_edge[rings.cell(h) as usize] = h;
            }
        }

        let mut numbers = alloc::vec![NONE; edges as usize / 3];
        let mut of_triangle = Vec::with_capacity(numbers.len());
        let (mut first_corner, mut corners, mut cells) = (alloc::vec![0], Vec::new(), Vec::new());
        let mut portals = Vec::new();
        for t in 0..edges / 3 {
            let root = rings.cell(3 * t);
            // The root is the least triangle of its cell, so it comes first.
            if root == t {
                numbers[t as usize] = cells.len() as u32;
                let first = first_edge[t as usize];
                let from = corners.len();
                let mut h = first;
                loop {
                    corners.push(self.start(h));
                    h = rings.after[h as usize];
                    if h == first {
                        break;
                    }
                }
                first_corner.push(corners.len() as u32);
                cells.push(prism(&corners[from..], low, high));
            }
            of_triangle.push(CellId(numbers[root as usize]));
        }
        for h in 0..edges {
            let edge = self.edges[h as usize];
            let Some(twin) = edge.twin().filter(|twin| h < *twin) else { continue };
            let (from, to) = (of_triangle[h as usize / 3], of_triangle[twin as usize / 3]);
            let blocks = edge.twin & self.edges[twin as usize].twin & BLOCKS != 0;
            if from == to || blocks {
                continue;
            }
            // The second cell is to the right of the half-edge, and sees these corners counter-clockwise.
            let portal = portal(self.ends(h), [low, high]).ok_or(PlanError::Heights)?;
            portals.push((portal, [from, to]));
        }
        let count = cells.len().max(portals.len());
        let graph = CellGraph::new(cells.len(), portals).map_err(|error| match error {
            CellGraphError::TooMany { count, .. } => PlanError::TooMany { count },
            _ => PlanError::TooMany { count },
        })?;
        Ok(PlanCells { graph, viewcells: Viewcells::new(cells), of_triangle, first_corner, corners })
    }
}

/// Returns the upright rectangle over a segment between two heights, enlarged by roundings until it is a
/// valid polygon. `None` if no enlargement is one.
fn portal(segment: [Point; 2], heights: [f64; 2]) -> Option<ConvexPolygon> {
    let [mut a, mut b] = segment.map(|[x, y]| DVec3::new(x, y, 0.0));
    let [mut low, mut high] = heights;
    // Three times as large each time: from the least width to 1e-14 of the greatest height takes less.
    for _ in 0..2048 {
        let quad = [a.with_z(low), b.with_z(low), b.with_z(high), a.with_z(high)];
        if let Ok(polygon) = ConvexPolygon::new(quad) {
            return Some(polygon);
        }
        // Multiples of the difference keep the direction, which is that of the last bits.
        let (along, height) = (b - a, high - low);
        if along.abs().max_element() < height {
            (a, b) = (a - along, b + along);
        } else {
            (low, high) = (low - height, high + height);
        }
    }
    None
}

/// Returns the upright prism over a convex outline.
fn prism(outline: &[Point], low: f64, high: f64) -> Viewcell {
    let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let mut planes = Vec::new();
    for (i, &[x, y]) in outline.iter().enumerate() {
        let [u, v] = outline[(i + 1) % outline.len()];
        min = min.min(DVec3::new(x, y, low));
        max = max.max(DVec3::new(x, y, high));
        // The box has the sides that are parallel to an axis.
        if x != u && y != v {
            planes.push(Plane::through(DVec3::new(x, y, low), DVec3::new(y - v, u - x, 0.0)));
        }
    }
    Viewcell { min, max, planes }
}
