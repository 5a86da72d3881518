//! The walk of a frame: depth first through portals, from the cells in which lines of sight begin. Each
//! portal narrows the view to a window.
//!
//! This work is based on Luebke and Georges, "Portals and Mirrors: Simple, Fast Evaluation of Potentially
//! Visible Sets", 1995. They keep the screen-space rectangle around each portal; here the exact convex
//! polygon can be kept as well. Cells need not be convex: a walk may come back to a cell. A chain does not
//! pass a portal twice in the same direction, since no straight line does.

use super::NONE;
use super::outline::Outline;
use super::portal_stats::PortalStats;
use super::scene_cells::SceneCells;
use super::screen_rectangle::{ScreenRectangle, push_rectangle_planes, rectangle_around};
use super::view_planes::{Crossing, PortalView};
use super::window_plane::{Corner, EdgeSource, U, WindowPlane, clip_corners};
use alloc::vec::Vec;
use core::ops::Range;
use visibility_core::glam::DVec3;
use visibility_core::{
    cells::{CellId, PortalId},
    pvs::ViewcellId,
    stamp::Stamp,
};

/// Maximum number of planes of one window (the part of the view seen through a chain of portals). Further
/// planes are left out, which can only enlarge the window.
const MAX_WINDOW_PLANES: usize = 24;
/// Maximum number of paths to one cell. A cell with more paths is treated as seen through the whole view.
const MAX_PATHS_PER_CELL: u32 = 48;

/// Shape to which each portal narrows the view. Both shapes are conservative.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Hash, Default)]
pub enum Narrowing {
    /// The exact convex polygon of the visible part of the portal, with one plane for each of its edges. The
    /// tightest shape.
    #[default]
    Polygon,
    /// The screen-space bounding rectangle of that polygon, as in Luebke and Georges: four planes for a
    /// portal of any shape.
    Rectangle,
}

/// One path of portals from the eye to a cell: its last portal, and the link `parent` to the path without
/// that portal. A path without portals leads to a cell in which lines of sight begin.
#[derive(Clone, Debug)]
pub(super) struct PortalPath {
    pub(super) cell: CellId,
    /// Index in `PortalWalk::paths` of the path without its last portal, or `NONE` for a path that starts at
    /// the eye.
    pub(super) parent: u32,
    /// The last portal of this path, the one nearest to the cell that the path leads to. `NONE`, which is no
    /// portal, if `parent` is `NONE`.
    pub(super) portal: PortalId,
    /// Index in `PortalWalk::paths` of the path to the same cell that was found just before this path, or
    /// `NONE` if this path was found first.
    next: u32,
    /// The window of this path: planes and screen bounds of the part of the view that shows the path's cell.
    pub(super) window: Window,
    /// Range in `PortalWalk::corners` of the corners of the visible part of the last portal. Empty if
    /// `parent` is `NONE`.
    pub(super) corners: Range<u32>,
}

/// The planes and screen bounds that contain all lines of sight through a chain of portals. Planes are
/// relative to the anchor of the view.
#[derive(Clone, Debug)]
pub(super) struct Window {
    /// Range of the bounding planes in `PortalWalk::sides`. Empty if the window is not bounded by any plane.
    pub(super) sides: Range<u32>,
    /// Bounds of the window on the screen, in NDC. Each portal narrows them only with
    /// [`Narrowing::Rectangle`].
    pub(super) rectangle: ScreenRectangle,
    /// Whether the window is the whole view. If true, objects pass without a test, since earlier stages have
    /// already tested them against the whole view. If false, objects are tested against the planes of
    /// `sides`.
    full_view: bool,
}

/// A mirror seen through a window: the mirror's index, the cell on whose boundary it lies, and the window
/// narrowed to the mirror.
#[derive(Clone, Debug)]
pub(super) struct SeenMirror {
    pub(super) mirror: u32,
    pub(super) cell: CellId,
    pub(super) window: Window,
}

/// Scratch memory of the walk through portals, and its result: the paths, their windows and the mirrors met.
#[derive(Clone, Debug, Default)]
pub(super) struct PortalWalk {
    /// Stamp (version number of content) of the graph whose cells and portals index `heads`, `counts`,
    /// `entered_full_view` and `passed`. `None` before the first walk.
    graph: Option<Stamp>,
    pub(super) paths: Vec<PortalPath>,
    pub(super) sides: Vec<WindowPlane>,
    /// Corners of the visible parts of the portals, relative to the anchor of the view.
    /// `PortalPath::corners` are ranges of this list.
    pub(super) corners: Vec<DVec3>,
    pub(super) mirrors: Vec<SeenMirror>,
    /// By cell index: index in `paths` of the path to the cell that was found last, or `NONE`.
    heads: Vec<u32>,
    /// By cell index: number of paths to the cell.
    counts: Vec<u32>,
    /// By cell index: true if the cell counts as seen through the whole view, because it was entered so or
    /// is in `waiting`; false if it is seen through windows or not at all.
    entered_full_view: Vec<bool>,
    /// By portal and direction, true while the current chain has passed the portal in that direction, else
    /// false: index `2 * portal + 1` for passing along the portal's normal, `2 * portal` for passing against
    /// it.
    passed: Vec<bool>,
    /// Stack of the current chain, the path nearest to the eye first. Each entry holds the index of a path
    /// in `paths`, and the number of portals of the path's cell that have been inspected.
    stack: Vec<(u32, u32)>,
    /// Cells that the walk still has to enter with the whole view as their window.
    waiting: Vec<CellId>,
    /// Corners of the portal that is being clipped, relative to the anchor of the view (the eye of a
    /// perspective view). The field `clipped` receives the result of each clip.
    polygon: Vec<Corner>,
    clipped: Vec<Corner>,
    /// Union of the PVS rows of the starting cells: bit i % 64 of word i / 64 is 1 if the walk may enter
    /// cell i, 0 if not. Empty without a PVS: then every cell may be entered.
    allowed: Vec<u64>,
    /// Stamp (version number of content) of the PVS that `allowed`, the set of cells that may be entered,
    /// was read from. `None` without a PVS.
    allowed_pvs: Option<Stamp>,
    /// The viewcells whose PVS rows are united in `allowed`.
    allowed_for: Vec<ViewcellId>,
    /// Scratch memory for one row of the PVS.
    row: Vec<u64>,
    /// The viewcells of the cells in which lines of sight of the current frame begin.
    begun: Vec<ViewcellId>,
}

/// Replaces the content of `list` by `count` copies of `value`.
fn refill<T: Clone>(list: &mut Vec<T>, count: usize, value: T) {
    list.clear();
    list.resize(count, value);
}

impl PortalWalk {
    /// Discards the paths, windows and mirrors of the last walk, to start a walk in `cells`. Takes time
    /// proportional to the paths of that walk, or to the size of the new graph if the graph has changed.
    pub(super) fn begin(&mut self, cells: &SceneCells) {
        if self.graph != Some(cells.graph.stamp()) {
            self.graph = Some(cells.graph.stamp());
            let (count, portals) = (cells.graph.cell_count(), cells.graph.portals().len());
            refill(&mut self.heads, count, NONE);
            refill(&mut self.counts, count, 0);
            refill(&mut self.entered_full_view, count, false);
            refill(&mut self.passed, portals * 2, false);
        } else {
            for path in &self.paths {
                let cell = path.cell.index();
                (self.heads[cell], self.counts[cell], self.entered_full_view[cell]) = (NONE, 0, false);
            }
            // An aborted walk has left the portals of its chain, and its waiting cells, marked.
            for &(path, _) in &self.stack {
                let path = &self.paths[path as usize];
                if path.parent != NONE {
                    self.passed[path.portal.index() * 2..][..2].fill(false);
                }
            }
            for &cell in &self.waiting {
                self.entered_full_view[cell.index()] = false;
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

    /// Adds a cell in which lines of sight begin, seen through the whole view. A cell that was already added
    /// with the whole view is ignored.
    pub(super) fn start_in_full_view(&mut self, cell: CellId) {
        if !core::mem::replace(&mut self.entered_full_view[cell.index()], true) {
            self.waiting.push(cell);
            self.begun.push(cell.into());
        }
    }

    /// Adds a starting cell of the walk: a cell in which lines of sight begin. The cell is seen through a
    /// window that is bounded by the planes `sides`, relative to the anchor of `eye_view`, and by `rectangle`
    /// on the screen, in NDC.
    pub(super) fn start_in_window(
        &mut self,
        cells: &SceneCells,
        eye_view: &PortalView,
        cell: CellId,
        sides: impl Iterator<Item = WindowPlane>,
        rectangle: ScreenRectangle,
    ) {
        let window = self.window(sides, rectangle);
        self.begun.push(cell.into());
        self.push_path(cells, eye_view, cell, NONE, PortalId(NONE), window, 0..0);
    }

    /// Extends paths through portals until none can be extended. Returns `false` if more than `steps` portals
    /// would have to be inspected; the result is then incomplete and must not be used for culling. Counters
    /// of the walk are added to `stats`.
    pub(super) fn run(
        &mut self,
        cells: &SceneCells,
        eye_view: &PortalView,
        narrowing: Narrowing,
        steps: u64,
        stats: &mut PortalStats,
    ) -> bool {
        self.allow(cells);
        let full_view = self.full_view_window(eye_view);
        stats.starts += self.begun.len() as u32;
        let mut left = steps;
        loop {
            while let Some(&mut (path, ref mut slot)) = self.stack.last_mut() {
                let cell = self.paths[path as usize].cell;
                let Some(&portal) = cells.graph.portals_of(cell).get(*slot as usize) else {
                    self.pop_path(cells, path);
                    continue;
                };
                *slot += 1;
                if left == 0 {
                    return false;
                }
                left -= 1;
                stats.portals += 1;
                self.try_portal(cells, eye_view, path, portal, narrowing, stats);
            }
            let Some(cell) = self.waiting.pop() else { return true };
            self.push_path(cells, eye_view, cell, NONE, PortalId(NONE), full_view.clone(), 0..0);
        }
    }

    /// Updates `allowed`, the set of cells that the walk may enter, to the union of the PVS rows of the cells
    /// in which lines of sight begin. Does nothing if neither the PVS nor these cells have changed.
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
    fn push_path(
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
        self.try_mirrors(cells, eye_view, cell, &window);
        self.paths.push(PortalPath { cell, parent, portal, next, window, corners });
        self.stack.push((path, 0));
    }

    fn pop_path(&mut self, cells: &SceneCells, path: u32) {
        self.stack.pop();
        let PortalPath { cell, parent, portal, .. } = self.paths[path as usize];
        if parent != NONE {
            let forward = cells.graph.portals()[portal.index()].cells()[1] == cell;
            self.passed[portal.index() * 2 + usize::from(forward)] = false;
        }
    }

    fn try_portal(
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
        // A line does not return through the portal that it has just crossed. For an eye in the portal's
        // plane, the test of sides below cannot tell this.
        let back = from.portal == id;
        if !cells.doors.passes(id, forward)
            || back
            || self.passed[direction]
            || self.entered_full_view[next.index()]
            || !self.is_allowed(next)
        {
            return;
        }
        // An undecided side, of an eye near the portal's plane, counts as crossing, without a direction.
        let (outline, vertices) = (&cells.outlines[id.index()], portal.polygon().vertices());
        let sign = match (crossing(eye_view, outline, vertices), forward) {
            (Crossing::Along, true) => Some(1.0),
            (Crossing::Against, false) => Some(-1.0),
            (Crossing::Undecided, _) => None,
            _ => return,
        };
        let window = from.window.clone();
        let Some((window, corners)) = self.narrow(eye_view, outline, vertices, &window, sign, narrowing)
        else {
            return;
        };
        // Too many paths lead into this cell. It is walked once more with the full view, instead of with
        // further windows.
        if self.counts[next.index()] >= MAX_PATHS_PER_CELL {
            self.entered_full_view[next.index()] = true;
            self.waiting.push(next);
            stats.widened += 1;
            return;
        }
        stats.crossed += 1;
        self.passed[direction] = true;
        self.push_path(cells, eye_view, next, path, id, window, corners);
    }

    /// Appends to `mirrors` the mirrors of `cell` whose front may be seen through `window`, each with the
    /// window narrowed to it. Leaves out mirrors that [`SceneCells::set_mirror`] has covered, so that they do
    /// not reflect.
    fn try_mirrors(&mut self, cells: &SceneCells, eye_view: &PortalView, cell: CellId, window: &Window) {
        let mut mirror = cells.first_mirror[cell.index()];
        while let Some(candidate) = cells.mirrors.get(mirror as usize) {
            let (outline, vertices) = (&candidate.outline, &candidate.vertices);
            // The normal points into the cell, so a line of sight that hits the mirror runs against the
            // normal.
            let crossing = crossing(eye_view, outline, vertices);
            if candidate.uncovered && crossing != Crossing::Along {
                let sign = (crossing == Crossing::Against).then_some(-1.0);
                let seen = self.narrow(eye_view, outline, vertices, window, sign, Narrowing::Polygon);
                self.mirrors.extend(seen.map(|(window, _)| SeenMirror { mirror, cell, window }));
            }
            mirror = candidate.next;
        }
    }

    /// Replaces `mirrors` by the mirrors of all cells whose front may be seen in the whole view, apart from
    /// covered mirrors (see [`SceneCells::set_mirror`]). For frames in which the visible cells are unknown.
    pub(super) fn try_all_mirrors(&mut self, cells: &SceneCells, eye_view: &PortalView) {
        self.mirrors.clear();
        let full_view = self.full_view_window(eye_view);
        for cell in (0..cells.graph.cell_count() as u32).map(CellId) {
            self.try_mirrors(cells, eye_view, cell, &full_view);
        }
    }

    /// Appends `sides`, the planes of a window, to the field `sides`. Returns the window with these planes
    /// and the screen bounds `rectangle`.
    fn window(&mut self, sides: impl IntoIterator<Item = WindowPlane>, rectangle: ScreenRectangle) -> Window {
        let start = self.sides.len() as u32;
        self.sides.extend(sides);
        Window { sides: start..self.sides.len() as u32, rectangle, full_view: false }
    }

    fn full_view_window(&mut self, eye_view: &PortalView) -> Window {
        Window { full_view: true, ..self.window(eye_view.sides, [-1.0, 1.0, -1.0, 1.0]) }
    }

    /// Returns `window` narrowed to the lines of sight through a polygon, and the range in `corners` of the
    /// polygon's visible part, which is appended there. `None` if no line of sight in the window meets the
    /// polygon.
    ///
    /// `vertices` are in world space, counter-clockwise around the normal of `outline`. `sign` is 1 if lines
    /// of sight cross the polygon along that normal, -1 if against it, `None` if the direction is undecided.
    /// In the last case the polygon's edges do not narrow the window; where possible, planes close to the
    /// polygon's plane bound the window instead.
    fn narrow(
        &mut self,
        eye_view: &PortalView,
        outline: &Outline,
        vertices: &[DVec3],
        window: &Window,
        sign: Option<f64>,
        narrowing: Narrowing,
    ) -> Option<(Window, Range<u32>)> {
        // Corners relative to the anchor, where differences and therefore rounding errors are small.
        self.polygon.clear();
        let mut reach = 0.0f64;
        for (i, &vertex) in (0..).zip(vertices) {
            let at = vertex - eye_view.anchor;
            reach = reach.max(at.length());
            self.polygon.push(Corner { at, edge: EdgeSource::Own(i) });
        }
        let given = outline.error + eye_view.error + 4.0 * U * reach;
        let mut error = given;
        // The polygon is clipped to the planes of the window and to the planes where lines of sight end.
        // `error` grows by the rounding of each cut.
        let sides = window.sides.clone().map(|i| (&self.sides[i as usize], EdgeSource::Window(i)));
        let ends = eye_view.ends.iter().map(|side| (side, EdgeSource::End));
        let is_left = sides.chain(ends).all(|(side, edge)| {
            let is_left = clip_corners(&self.polygon, side, edge, &mut error, &mut self.clipped);
            core::mem::swap(&mut self.polygon, &mut self.clipped);
            is_left
        });
        if !is_left {
            return None;
        }
        let first_corner = self.corners.len() as u32;
        self.corners.extend(self.polygon.iter().map(|corner| corner.at));
        let corners = first_corner..self.corners.len() as u32;
        // The visible corners are kept for `PortalEye::windows`. A portal whose direction is undecided does
        // not narrow the window by its own edges.
        let Some(sign) = sign else {
            return Some((self.edge_on(eye_view, outline.normal, window, error), corners));
        };
        let start = self.sides.len();
        let mut rectangle = window.rectangle;
        match narrowing {
            Narrowing::Polygon => {
                // Each edge of the clipped polygon keeps the plane it comes from: a plane of the window is
                // used again, exactly. Only edges of the portal itself make a new plane through the eye.
                let mut last = EdgeSource::End;
                for i in 0..self.polygon.len() {
                    let edge = self.polygon[i].edge;
                    if edge == last || self.sides.len() - start == MAX_WINDOW_PLANES {
                        continue;
                    }
                    last = edge;
                    let side = match edge {
                        EdgeSource::End => None,
                        EdgeSource::Window(place) => Some(self.sides[place as usize]),
                        EdgeSource::Own(i) => {
                            let (a, b) = (vertices[i as usize], vertices[(i as usize + 1) % vertices.len()]);
                            eye_view.through_edge(a - eye_view.anchor, b - eye_view.anchor, sign, given)
                        }
                    };
                    self.sides.extend(side);
                }
            }
            Narrowing::Rectangle => {
                rectangle = rectangle_around(eye_view, &self.polygon, error, window.rectangle);
                push_rectangle_planes(eye_view, rectangle, &mut self.sides);
            }
        }
        let sides = start as u32..self.sides.len() as u32;
        Some((Window { sides, rectangle, full_view: false }, corners))
    }

    /// Returns the window behind a portal whose plane passes, up to rounding, through the eye: `window`,
    /// further bounded to lines of sight close to that plane. Returns a copy of `window` where no such bound
    /// is known. `normal` is the portal's. `error` bounds the distance between the corners in `self.polygon`,
    /// the computed visible part of the portal, and the exact visible part, in world units.
    ///
    /// Without this bound, an eye in the plane of a wall would see through all doors of the wall, and back
    /// through all other doors.
    fn edge_on(&mut self, eye_view: &PortalView, normal: DVec3, window: &Window, error: f64) -> Window {
        let corners = self.polygon.iter().map(|corner| corner.at);
        let Some(planes) = eye_view.edge_on(corners, normal, error) else { return window.clone() };
        let start = self.sides.len() as u32;
        for place in window.sides.clone().take(MAX_WINDOW_PLANES) {
            self.sides.push(self.sides[place as usize]);
        }
        self.sides.extend(planes);
        Window { sides: start..self.sides.len() as u32, rectangle: window.rectangle, full_view: false }
    }

    /// Returns the paths to `cell`, last found first. Empty for a cell that was not reached or is unknown.
    pub(super) fn paths_to(&self, cell: CellId) -> impl Iterator<Item = &PortalPath> {
        let mut at = self.heads.get(cell.index()).copied().unwrap_or(NONE);
        core::iter::from_fn(move || {
            let path = self.paths.get(at as usize)?;
            at = path.next;
            Some(path)
        })
    }

    /// Tests whether a box in `cell` may be seen along one of the paths to the cell. The box, from `min` to
    /// `max`, is anchor-relative and known up to `error` world units. `tests` is increased by the number of
    /// windows tested. `false` is certain; undecided boxes and NaN give `true`, unless no path leads to the
    /// cell.
    pub(super) fn shows(&self, cell: CellId, min: DVec3, max: DVec3, error: f64, tests: &mut u64) -> bool {
        self.paths_to(cell).any(|path| {
            *tests += 1;
            let sides = &self.sides[path.window.sides.start as usize..path.window.sides.end as usize];
            path.window.full_view || !sides.iter().any(|side| side.excludes(min, max, error))
        })
    }
}

fn crossing(eye_view: &PortalView, outline: &Outline, vertices: &[DVec3]) -> Crossing {
    let relative = vertices.iter().map(|&vertex| vertex - eye_view.anchor);
    // Each eye of a ball must be on the same side. An error of the eye moves the polygon as a whole, so it
    // does not tilt the polygon.
    let error = outline.error + eye_view.error + eye_view.ball;
    eye_view.crossing(relative, outline.normal, outline.width, outline.flaw, error)
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::cells::CellGraph;
    use visibility_core::geometry::{ConvexPolygon, Plane};
    use visibility_core::pvs::{Viewcell, Viewcells};
    use visibility_core::{Pose, View};

    /// Returns a view along x from the origin, 90 degrees wide and high, whose eye is off by `error`.
    fn eye_view(error: f64) -> PortalView {
        let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
        let view = View::perspective(pose, core::f64::consts::FRAC_PI_2, 1.0, 0.1, f64::INFINITY);
        PortalView { error, ..PortalView::new(&view.unwrap()).unwrap() }
    }

    /// Returns a walk with one window, which is bounded by one plane without errors through the anchor.
    fn walk_behind(normal: DVec3) -> (PortalWalk, Window) {
        let mut walk = PortalWalk::default();
        let side = WindowPlane { plane: Plane::new(normal, 0.0), slope: 0.0, slack: 0.0 };
        let window = walk.window([side], [-1.0, 1.0, -1.0, 1.0]);
        (walk, window)
    }

    /// Returns a square across x whose sides have a length of 1, counter-clockwise around x.
    fn square(middle: DVec3) -> [DVec3; 4] {
        [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]].map(|[y, z]| middle + DVec3::new(0.0, y, z))
    }

    fn outline(error: f64, flaw: f64) -> Outline {
        Outline { normal: DVec3::X, error, flaw, width: 1.0 }
    }

    /// A portal outside of a window by less than its error and that of the eye is in it. Half of an error
    /// would not do.
    #[test]
    fn portals_are_in_a_window_up_to_the_errors_of_portal_and_eye() {
        for (error, of_eye, at, is_in) in [
            (0.1, 0.0, -0.09, true),
            (0.0, 0.1, -0.09, true),
            (0.1, 0.1, -0.19, true),
            (0.1, 0.1, -0.21, false),
        ] {
            let (mut walk, window) = walk_behind(DVec3::Y);
            let vertices = square(DVec3::new(1.0, at - 0.5, 0.0));
            let (eye, outline) = (eye_view(of_eye), outline(error, error));
            let found = walk.narrow(&eye, &outline, &vertices, &window, Some(1.0), Narrowing::Polygon);
            assert_eq!(found.is_some(), is_in, "a portal up to y = {at}, off by {error}, eye by {of_eye}");
        }
    }

    /// Rectangles hold the exact vertices, and planes close to a portal all lines that meet it, within large
    /// errors.
    #[test]
    fn windows_hold_what_is_seen_through_portals_within_their_errors() {
        let (mut walk, window) = walk_behind(DVec3::X);
        let vertices = square(DVec3::X);
        let mut narrow = |sign, narrowing| {
            let (eye, outline) = (eye_view(0.0), outline(0.1, 0.1));
            let (found, corners) = walk.narrow(&eye, &outline, &vertices, &window, sign, narrowing).unwrap();
            assert_eq!(corners.len(), 4, "corners that are seen");
            (walk.sides[found.sides.start as usize..found.sides.end as usize].to_vec(), found.rectangle)
        };
        let (_, rectangle) = narrow(Some(1.0), Narrowing::Rectangle);
        // A vertex 0.1 nearer to the eye or farther aside, at 0.5 of the screen.
        assert!(rectangle.iter().all(|end| (0.6..0.7).contains(&end.abs())), "{rectangle:?}");
        let (sides, _) = narrow(None, Narrowing::Polygon);
        assert_eq!(sides.len(), 1, "the plane of the window: the portal is not seen edge on");
        let vertices = vertices.map(|p| DVec3::new(p.y + 1.5, p.x - 1.0, p.z));
        let edge_on = Outline { normal: -DVec3::Y, ..outline(0.1, 0.1) };
        let found = walk.narrow(&eye_view(0.0), &edge_on, &vertices, &window, None, Narrowing::Polygon);
        let sides = found.unwrap().0.sides;
        let slopes = walk.sides[sides.start as usize..sides.end as usize].iter().map(|side| side.slope);
        // Lines rise by 0.1 on the metre to the portal.
        assert_eq!(slopes.clone().count(), 3, "planes of a window behind a portal seen edge on");
        assert!(slopes.skip(1).all(|slope| (0.1..0.101).contains(&slope)), "slopes of the last two");
    }

    #[test]
    fn windows_have_a_greatest_number_of_planes() {
        let (mut walk, window) = walk_behind(DVec3::X);
        let corner = |i: u32| DVec3::new(1.0, 0.0, 0.0) + 0.5 * DVec3::Y.rotate_x(f64::from(i) * 0.1);
        let vertices: Vec<_> = (0..60).map(corner).collect();
        let (eye, outline) = (eye_view(0.0), outline(0.0, 0.0));
        let found = walk.narrow(&eye, &outline, &vertices, &window, Some(1.0), Narrowing::Polygon);
        assert_eq!(found.unwrap().0.sides.len(), MAX_WINDOW_PLANES, "planes of a portal with 60 vertices");
    }

    /// The direction is undecided where an exact eye may be on either side of the exact polygon. Half of an
    /// error would not do.
    #[test]
    fn eyes_near_the_plane_of_a_portal_cross_it_in_no_direction() {
        for (error, flaw, of_eye, ball, least) in [
            (0.1, 0.0, 0.0, 0.0, 0.1),
            (0.0, 0.0, 0.1, 0.0, 0.1),
            (0.0, 0.0, 0.0, 0.1, 0.1),
            // Vertices that are off tilt a polygon whose farthest vertex is half a metre times the root of
            // two from the foot of the eye.
            (0.1, 0.1, 0.0, 0.0, 0.1 + 0.2 * 0.5f64.sqrt()),
        ] {
            let eye = PortalView { ball, ..eye_view(of_eye) };
            for (x, expected) in [
                (least * 0.99, Crossing::Undecided),
                (least * 1.1, Crossing::Along),
                (-least * 1.1, Crossing::Against),
            ] {
                let found = crossing(&eye, &outline(error, flaw), &square(DVec3::X * x));
                assert_eq!(
                    found, expected,
                    "{x} from a portal off by {error}, {flaw}, eye by {of_eye}, {ball}"
                );
            }
        }
    }

    #[test]
    fn covered_mirrors_and_backs_of_mirrors_are_not_seen() {
        let viewcells = Viewcells::new([Viewcell::from_box(DVec3::splat(-9.0), DVec3::splat(9.0))]);
        let mut cells = SceneCells::new(CellGraph::new(1, []).unwrap(), viewcells, 0.0).unwrap();
        let mut glass = square(DVec3::X);
        let back = cells.add_mirror(CellId(0), &ConvexPolygon::new(glass).unwrap()).unwrap();
        glass.reverse();
        let front = cells.add_mirror(CellId(0), &ConvexPolygon::new(glass).unwrap()).unwrap();
        for (is_uncovered, count) in [(true, 1), (false, 0)] {
            for mirror in [back, front] {
                cells.set_mirror(mirror, is_uncovered).unwrap();
            }
            let mut walk = PortalWalk::default();
            walk.try_all_mirrors(&cells, &eye_view(0.0));
            assert_eq!(walk.mirrors.len(), count, "mirrors seen, uncovered: {is_uncovered}");
        }
    }

    /// A box that is outside of a window by less than its error is seen.
    #[test]
    fn boxes_are_seen_up_to_their_error() {
        let (mut walk, window) = walk_behind(DVec3::Y);
        (walk.heads, walk.counts) = (alloc::vec![0], alloc::vec![1]);
        let (cell, parent, portal, next, corners) = (CellId(0), NONE, PortalId(NONE), NONE, 0..0);
        walk.paths.push(PortalPath { cell, parent, portal, next, window, corners });
        for (y, is_seen) in [(-0.09, true), (-0.11, false)] {
            let at = DVec3::new(0.0, y, 0.0);
            assert_eq!(walk.shows(cell, at, at, 0.1, &mut 0), is_seen, "a box at {y}, off by 0.1");
        }
    }
}
