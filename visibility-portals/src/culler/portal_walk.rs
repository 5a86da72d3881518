//! The walk of a frame: depth first from the cells in which lines of sight begin, through portals, each of
//! which narrows what is seen.
//!
//! This work is based on Luebke and Georges, "Portals and Mirrors: Simple, Fast Evaluation of Potentially
//! Visible Sets", 1995, who keep the rectangle on the screen around each portal; here the exact convex
//! polygon can be kept as well. Cells need not be convex: a walk may come back to a cell, but not through a
//! portal that it has already passed in the same direction, since no straight line does.

use super::mirror::NONE;
use super::outline::Outline;
use super::portal_stats::PortalStats;
use super::portal_view::{Crossing, Lines, PortalView};
use super::scene_cells::SceneCells;
use super::screen_rectangle::{Rectangle, around, push_sides};
use super::window_plane::{Corner, Edge, U, WindowPlane, clip};
use alloc::vec::Vec;
use core::ops::Range;
use visibility_core::glam::DVec3;
use visibility_core::{
    cells::{CellId, PortalId},
    pvs::ViewcellId,
    stamp::Stamp,
};

/// The most planes of one window. Further ones are left out, which shows more, never less.
const MOST_SIDES: usize = 24;
/// The most paths to one cell. A cell with more is treated as seen through the whole view.
const MOST_PATHS: u32 = 48;

/// What each portal narrows the view to.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Hash, Default)]
pub enum Narrowing {
    /// The convex polygon of the part of the portal that is seen: a plane for each of its edges. The
    /// tightest.
    #[default]
    Polygon,
    /// The rectangle on the screen around that polygon, as Luebke and Georges do: four planes for a portal of
    /// any shape.
    Rectangle,
}

/// A path of portals from the eye to a cell, by its last step.
#[derive(Clone, Debug)]
pub(super) struct PortalPath {
    pub(super) cell: CellId,
    /// Index of the path that this one lengthens, `NONE` where the walk began.
    pub(super) parent: u32,
    /// The portal crossed last; meaningless without a parent.
    pub(super) portal: PortalId,
    /// Index of another path to the same cell, or `NONE`.
    next: u32,
    /// What bounds the view of this cell.
    pub(super) window: Window,
    /// Place in `PortalWalk::corners` of the part of the portal that is seen.
    pub(super) corners: Range<u32>,
}

/// What bounds the lines of sight that pass a chain of portals.
#[derive(Clone, Debug)]
pub(super) struct Window {
    /// Place in `PortalWalk::sides`. Empty if nothing bounds them.
    pub(super) sides: Range<u32>,
    /// Bounds on the screen, with [`Narrowing::Rectangle`].
    pub(super) rectangle: Rectangle,
    /// Whether it is the whole view, which earlier stages have tested against.
    whole: bool,
}

/// A mirror seen through a window.
#[derive(Clone, Debug)]
pub(super) struct SeenMirror {
    pub(super) mirror: u32,
    pub(super) cell: CellId,
    pub(super) window: Window,
}

/// Scratch memory of a walk, and its result.
#[derive(Clone, Debug, Default)]
pub(super) struct PortalWalk {
    /// The graph by whose cells and portals `heads`, `counts`, `wide` and `passed` are indexed.
    graph: Option<Stamp>,
    pub(super) paths: Vec<PortalPath>,
    pub(super) sides: Vec<WindowPlane>,
    /// Relative to the anchor.
    pub(super) corners: Vec<DVec3>,
    pub(super) mirrors: Vec<SeenMirror>,
    /// By cell: the index of the path found last, or `NONE`.
    heads: Vec<u32>,
    /// By cell: the number of paths to it.
    counts: Vec<u32>,
    /// By cell: whether it is, or will be, seen through the whole view.
    wide: Vec<bool>,
    /// By portal and direction (2 portal + forward): whether the chain at hand has passed it.
    passed: Vec<bool>,
    /// The chain at hand: a path, and how many portals of its cell have been looked at.
    stack: Vec<(u32, u32)>,
    /// Cells that are still to be entered through the whole view.
    waiting: Vec<CellId>,
    /// The portal that is being clipped, and memory for the result.
    polygon: Vec<Corner>,
    clipped: Vec<Corner>,
    /// One bit for each cell that the PVS lets the walk enter. Empty without a PVS: then all.
    allowed: Vec<u64>,
    /// The PVS that `allowed` was read from.
    allowed_pvs: Option<Stamp>,
    /// The cells whose rows `allowed` is the union of.
    allowed_for: Vec<ViewcellId>,
    /// Memory for one row of the PVS.
    row: Vec<u64>,
    /// The cells in which lines of sight begin.
    begun: Vec<ViewcellId>,
}

/// Makes a list hold `count` copies of a value.
fn refill<T: Clone>(list: &mut Vec<T>, count: usize, value: T) {
    list.clear();
    list.resize(count, value);
}

impl PortalWalk {
    /// Forgets the last walk. Takes time in proportion to what that walk touched; after one in another graph,
    /// to the size of the new graph.
    pub(super) fn begin(&mut self, cells: &SceneCells) {
        if self.graph != Some(cells.graph.stamp()) {
            self.graph = Some(cells.graph.stamp());
            let (count, portals) = (cells.graph.cell_count(), cells.graph.portals().len());
            refill(&mut self.heads, count, NONE);
            refill(&mut self.counts, count, 0);
            refill(&mut self.wide, count, false);
            refill(&mut self.passed, portals * 2, false);
        } else {
            for path in &self.paths {
                let cell = path.cell.index();
                (self.heads[cell], self.counts[cell], self.wide[cell]) = (NONE, 0, false);
            }
            // What a walk that was given up still had to do.
            for &(path, _) in &self.stack {
                let path = &self.paths[path as usize];
                if path.parent != NONE {
                    self.passed[path.portal.index() * 2..][..2].fill(false);
                }
            }
            for &cell in &self.waiting {
                self.wide[cell.index()] = false;
            }
        }
        self.paths.clear();
        self.sides.clear();
        self.corners.clear();
        self.mirrors.clear();
        self.stack.clear();
        self.waiting.clear();
        self.begun.clear();
    }

    /// Adds a cell in which lines of sight begin, anywhere in the view.
    pub(super) fn start_whole(&mut self, cell: CellId) {
        if !core::mem::replace(&mut self.wide[cell.index()], true) {
            self.waiting.push(cell);
            self.begun.push(cell.into());
        }
    }

    /// Adds a cell in which lines of sight begin, within the planes given.
    pub(super) fn start_within(
        &mut self,
        cells: &SceneCells,
        eye_view: &PortalView,
        cell: CellId,
        sides: impl Iterator<Item = WindowPlane>,
        rectangle: Rectangle,
    ) {
        let start = self.sides.len() as u32;
        self.sides.extend(sides);
        let window = Window { sides: start..self.sides.len() as u32, rectangle, whole: false };
        self.begun.push(cell.into());
        self.enter(cells, eye_view, cell, NONE, PortalId(NONE), window, 0..0);
    }

    /// Walks until no path can be lengthened. False if that took more than `steps` portals; then the result
    /// is not complete.
    pub(super) fn go(
        &mut self,
        cells: &SceneCells,
        eye_view: &PortalView,
        narrowing: Narrowing,
        steps: u64,
        stats: &mut PortalStats,
    ) -> bool {
        self.allow(cells);
        let view = self.sides.len() as u32;
        self.sides.extend_from_slice(&eye_view.sides);
        let whole = Window { sides: view..view + 4, rectangle: [-1.0, 1.0, -1.0, 1.0], whole: true };
        stats.starts += self.begun.len() as u32;
        let mut left = steps;
        loop {
            while let Some(&mut (path, ref mut slot)) = self.stack.last_mut() {
                let cell = self.paths[path as usize].cell;
                let Some(&portal) = cells.graph.portals_of(cell).get(*slot as usize) else {
                    self.leave(cells, path);
                    continue;
                };
                *slot += 1;
                if left == 0 {
                    return false;
                }
                left -= 1;
                stats.portals += 1;
                self.look_through(cells, eye_view, path, portal, narrowing, stats);
            }
            let Some(cell) = self.waiting.pop() else { return true };
            self.enter(cells, eye_view, cell, NONE, PortalId(NONE), whole.clone(), 0..0);
        }
    }

    /// Brings `allowed` up to date with PVS and starting cells.
    fn allow(&mut self, cells: &SceneCells) {
        let Some(pvs) = &cells.pvs else {
            self.allowed.clear();
            self.allowed_pvs = None;
            return;
        };
        if self.allowed_pvs == Some(pvs.stamp()) && self.allowed_for == self.begun {
            return;
        }
        self.allowed_pvs = Some(pvs.stamp());
        self.allowed_for.clear();
        self.allowed_for.extend_from_slice(&self.begun);
        pvs.write_union(&self.begun, &mut self.allowed, &mut self.row);
    }

    fn is_allowed(&self, cell: CellId) -> bool {
        self.allowed.get(cell.index() / 64).is_none_or(|word| word >> (cell.index() % 64) & 1 != 0)
    }

    #[expect(clippy::too_many_arguments)]
    fn enter(
        &mut self,
        cells: &SceneCells,
        eye_view: &PortalView,
        cell: CellId,
        parent: u32,
        portal: PortalId,
        window: Window,
        corners: Range<u32>,
    ) {
        let path = self.paths.len() as u32;
        let next = core::mem::replace(&mut self.heads[cell.index()], path);
        self.counts[cell.index()] += 1;
        let mut mirror = cells.first_mirror[cell.index()];
        while mirror != NONE {
            self.look_at_mirror(cells, eye_view, mirror, cell, &window);
            mirror = cells.mirrors[mirror as usize].next;
        }
        self.paths.push(PortalPath { cell, parent, portal, next, window, corners });
        self.stack.push((path, 0));
    }

    fn leave(&mut self, cells: &SceneCells, path: u32) {
        self.stack.pop();
        let PortalPath { cell, parent, portal, .. } = self.paths[path as usize];
        if parent != NONE {
            let forward = cells.graph.portals()[portal.index()].cells()[1] == cell;
            self.passed[portal.index() * 2 + usize::from(forward)] = false;
        }
    }

    fn look_through(
        &mut self,
        cells: &SceneCells,
        eye_view: &PortalView,
        path: u32,
        id: PortalId,
        narrowing: Narrowing,
        stats: &mut PortalStats,
    ) {
        let from = &self.paths[path as usize];
        let portal = &cells.graph.portals()[id.index()];
        let forward = portal.cells()[0] == from.cell;
        let next = portal.cells()[usize::from(forward)];
        let direction = id.index() * 2 + usize::from(forward);
        // Straight back is never ahead, though an eye in the portal's plane cannot tell by its side.
        let back = from.parent != NONE && from.portal == id;
        if !cells.doors.passes(id, forward)
            || back
            || self.passed[direction]
            || self.wide[next.index()]
            || !self.is_allowed(next)
        {
            return;
        }
        let (outline, vertices) = (&cells.outlines[id.index()], portal.polygon().vertices());
        let (wanted, other, sign) = match forward {
            true => (Crossing::Along, Crossing::Against, 1.0),
            false => (Crossing::Against, Crossing::Along, -1.0),
        };
        let crossing = crossing(eye_view, outline, vertices);
        if crossing == other {
            return;
        }
        let window = from.window.clone();
        let sign = (crossing == wanted).then_some(sign);
        let Some((window, corners)) = self.narrow(eye_view, outline, vertices, &window, sign, narrowing)
        else {
            return;
        };
        if self.counts[next.index()] >= MOST_PATHS {
            self.wide[next.index()] = true;
            self.waiting.push(next);
            stats.widened += 1;
            return;
        }
        stats.crossed += 1;
        self.passed[direction] = true;
        self.enter(cells, eye_view, next, path, id, window, corners);
    }

    fn look_at_mirror(
        &mut self,
        cells: &SceneCells,
        eye_view: &PortalView,
        mirror: u32,
        cell: CellId,
        window: &Window,
    ) {
        let found = &cells.mirrors[mirror as usize];
        // The normal points into the cell, so what hits the mirror runs against it.
        let crossing = crossing(eye_view, &found.outline, &found.vertices);
        if !found.uncovered || crossing == Crossing::Along {
            return;
        }
        let sign = (crossing == Crossing::Against).then_some(-1.0);
        if let Some((window, _)) =
            self.narrow(eye_view, &found.outline, &found.vertices, window, sign, Narrowing::Polygon)
        {
            self.mirrors.push(SeenMirror { mirror, cell, window });
        }
    }

    /// All mirrors, seen through the whole view: where it is not known which cell they are seen from.
    pub(super) fn look_at_all_mirrors(&mut self, cells: &SceneCells, eye_view: &PortalView) {
        self.mirrors.clear();
        let start = self.sides.len() as u32;
        self.sides.extend_from_slice(&eye_view.sides);
        let whole = Window { sides: start..start + 4, rectangle: [-1.0, 1.0, -1.0, 1.0], whole: true };
        for cell in (0..cells.graph.cell_count() as u32).map(CellId) {
            let mut mirror = cells.first_mirror[cell.index()];
            while mirror != NONE {
                self.look_at_mirror(cells, eye_view, mirror, cell, &whole);
                mirror = cells.mirrors[mirror as usize].next;
            }
        }
    }

    /// What is left of a window behind a polygon, crossed with the sign of its normal; the same window where
    /// that cannot be told (`None`). Nothing if no line of sight in the window meets the polygon.
    fn narrow(
        &mut self,
        eye_view: &PortalView,
        outline: &Outline,
        vertices: &[DVec3],
        window: &Window,
        sign: Option<f64>,
        narrowing: Narrowing,
    ) -> Option<(Window, Range<u32>)> {
        self.polygon.clear();
        let mut reach = 0.0f64;
        for (i, &vertex) in (0..).zip(vertices) {
            let at = vertex - eye_view.anchor;
            reach = reach.max(at.length());
            self.polygon.push(Corner { at, edge: Edge::Own(i) });
        }
        let given = outline.error + eye_view.error + 4.0 * U * reach;
        let mut error = given;
        for place in window.sides.clone() {
            let (side, edge) = (&self.sides[place as usize], Edge::Window(place));
            if !clip(&self.polygon, side, edge, &mut error, &mut self.clipped) {
                return None;
            }
            core::mem::swap(&mut self.polygon, &mut self.clipped);
        }
        for side in &eye_view.ends {
            if !clip(&self.polygon, side, Edge::End, &mut error, &mut self.clipped) {
                return None;
            }
            core::mem::swap(&mut self.polygon, &mut self.clipped);
        }
        let first_corner = self.corners.len() as u32;
        self.corners.extend(self.polygon.iter().map(|corner| corner.at));
        let corners = first_corner..self.corners.len() as u32;
        let Some(sign) = sign else {
            return Some((self.edge_on(eye_view, outline, vertices, window, error), corners));
        };
        let start = self.sides.len();
        let mut rectangle = window.rectangle;
        match narrowing {
            Narrowing::Polygon => {
                let mut last = Edge::End;
                for i in 0..self.polygon.len() {
                    let edge = self.polygon[i].edge;
                    if edge == last || self.sides.len() - start == MOST_SIDES {
                        continue;
                    }
                    last = edge;
                    let side = match edge {
                        Edge::End => None,
                        Edge::Window(place) => Some(self.sides[place as usize]),
                        Edge::Own(i) => {
                            let (a, b) = (vertices[i as usize], vertices[(i as usize + 1) % vertices.len()]);
                            eye_view.through_edge(a - eye_view.anchor, b - eye_view.anchor, sign, given)
                        }
                    };
                    self.sides.extend(side);
                }
            }
            Narrowing::Rectangle => {
                rectangle = around(eye_view, &self.polygon, error, window.rectangle);
                push_sides(eye_view, rectangle, &mut self.sides);
            }
        }
        let sides = start as u32..self.sides.len() as u32;
        Some((Window { sides, rectangle, whole: false }, corners))
    }

    /// The window behind a portal that the eye is in the plane of, as far as can be told: the same, and close
    /// to that plane.
    ///
    /// Let all vertices be at heights of at most `h` over the plane through the eye, errors included, and
    /// what is left of the portal at least `r` away. A line of sight that meets it there is at most `h / r`
    /// of its length off the plane, however far it goes on. Without this, an eye in the plane of a wall would
    /// see through all doors of the wall, and back through all others.
    fn edge_on(
        &mut self,
        eye_view: &PortalView,
        outline: &Outline,
        vertices: &[DVec3],
        window: &Window,
        error: f64,
    ) -> Window {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for corner in &self.polygon {
            (low, high) = (low.min(corner.at), high.max(corner.at));
        }
        let nearest = low.max(-high).max(DVec3::ZERO).length() - 2.0 * error;
        let own = outline.error + eye_view.error;
        let height = vertices.iter().fold(0.0, |height: f64, &vertex| {
            let at = vertex - eye_view.anchor;
            height.max(outline.normal.dot(at).abs() + own + 32.0 * U * at.length())
        });
        let slope = 2.0 * height / nearest;
        let eye = matches!(eye_view.lines, Lines::FromAnchor);
        if !eye || nearest <= 0.0 || slope.is_nan() || slope > 0.25 {
            return window.clone();
        }
        let start = self.sides.len() as u32;
        for place in window.sides.clone().take(MOST_SIDES) {
            self.sides.push(self.sides[place as usize]);
        }
        for normal in [outline.normal, -outline.normal] {
            let plane = visibility_core::geometry::Plane::new(normal, 0.0);
            self.sides.push(WindowPlane { plane, slope, slack: 2.0 * own + f64::MIN_POSITIVE });
        }
        Window { sides: start..self.sides.len() as u32, rectangle: window.rectangle, whole: false }
    }

    /// The paths to a cell, last found first. None for an unknown cell.
    pub(super) fn paths_to(&self, cell: CellId) -> impl Iterator<Item = &PortalPath> {
        let mut at = self.heads.get(cell.index()).copied().unwrap_or(NONE);
        core::iter::from_fn(move || {
            let path = self.paths.get(at as usize)?;
            at = path.next;
            Some(path)
        })
    }

    /// Whether a box in a cell may be seen along one of the paths to it. The box is relative to the anchor
    /// and known up to `error`; each window that is tested is counted.
    pub(super) fn shows(&self, cell: CellId, min: DVec3, max: DVec3, error: f64, tests: &mut u64) -> bool {
        self.paths_to(cell).any(|path| {
            *tests += 1;
            let sides = &self.sides[path.window.sides.start as usize..path.window.sides.end as usize];
            path.window.whole || !sides.iter().any(|side| side.excludes(min, max, error))
        })
    }
}

fn crossing(eye_view: &PortalView, outline: &Outline, vertices: &[DVec3]) -> Crossing {
    let relative = vertices.iter().map(|&vertex| vertex - eye_view.anchor);
    eye_view.crossing(relative, outline.normal, outline.width, outline.error + eye_view.error)
}
