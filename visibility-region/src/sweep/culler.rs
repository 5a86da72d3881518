//! `ExtendedProjectionCuller`: the culler that sweeps all six directions of a viewcell.

use super::Sweep;
use super::cell_extent::CellExtent;
use super::direction::{CellBox, Direction};
use super::effort::{Effort, Work};
use super::nearest::{Nearest, Occluders};
use super::occludees::{self, Asked, Item};
use super::pieces::Pieces;
use super::planes::{self, Cone};
use super::ray_map::RayMap;
use super::surfaces::Surfaces;
use super::window::{Rim, Window};
use crate::extent::usable_bounds;
use crate::solids::occluding;
use alloc::{sync::Arc, vec::Vec};
use visibility_core::bits::Bits;
use visibility_core::scene::{Changes, SceneCursor};
use visibility_core::walk::Child;
use visibility_core::{Aabb, Accuracy, CullStats, RegionCuller, Scene, VisibleSet, pvs::Viewcell};

/// Removes the objects that the occluders of the scene together hide from every point of a viewcell.
/// Conservative.
///
/// Occluders are [candidates](crate#which-objects-occlude) with meshes, including concave, open and thin
/// ones. Meshes in scene coordinates, whose transform is the identity, occlude as one surface where they
/// touch, if they share edges exactly. An object counts as visible if it reaches into the viewcell's box, if
/// it begins close to a side of the box (nearer than a fortieth of the side's width) or extends far along it,
/// or if it reaches 16,384 times farther from the scene's origin than nine tenths of all objects. Planes of a
/// [`Viewcell`] are used only as far as they make it an oriented box, or nearly.
///
/// # Cost
/// 20 to 100 milliseconds for a viewcell in scenes of some thousand objects, up to half a second in a
/// furnished building of 200,000 triangles. Occluders are collected nearest first, until no object is left to
/// test: in a city, 44 times as many objects take 4 times as long. The first call for a scene, and the first
/// after a change of its occluders, sorts all edges, which takes some hundred bytes for each triangle, shared
/// by clones. Each clone has 2 to 6 MB of its own in such scenes: 11 bytes for each triangle, more for
/// triangles that may be seen from the viewcell and the ones before, and maps.
///
/// ```
/// use visibility_core::{glam::{Affine3A, DVec3}, pvs::Viewcell};
/// use visibility_core::{Aabb, Object, OccluderMesh, RegionCuller, Scene, VisibleSet};
/// use visibility_region::ExtendedProjectionCuller;
/// let wall = Aabb::from_arrays([5.0, -9.0, -9.0], [5.2, 9.0, 9.0]);
/// let mut scene = Scene::new();
/// let id = scene.insert(Object { occluder: true, ..Object::new(wall) });
/// let mesh = scene.add_mesh(OccluderMesh::cuboid(&wall)?);
/// scene.set_mesh(id, mesh, Affine3A::IDENTITY)?;
/// let post = scene.insert(Aabb::from_arrays([20.0, 0.0, 0.0], [20.5, 0.5, 1.0]));
/// let mut visible = VisibleSet::new();
/// let cell = Viewcell::from_box(DVec3::ZERO, DVec3::ONE);
/// ExtendedProjectionCuller::new().cull(&scene, &cell, &mut visible);
/// assert!(visible.contains(&scene, id) && !visible.contains(&scene, post));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct ExtendedProjectionCuller {
    /// Surfaces of the scene at `cursor`, shared by clones.
    surfaces: Arc<Surfaces>,
    cursor: SceneCursor,
    /// Surfaces used for the viewcell that was begun last: those of the whole scene, or of some of its
    /// objects.
    present: Arc<Surfaces>,
    /// Effort used for the viewcell that was begun last.
    effort: Effort,
    /// Unfinished sweep of a direction of the viewcell that was begun last. `None` between two directions.
    running: Option<Running>,
    /// Box around the viewcell that was begun last, and the [`usable_bounds`] of the scene. `None` if no
    /// object can be found hidden from the viewcell.
    cell_box: Option<(CellBox, Aabb)>,
    pieces: Pieces,
    sweep: Sweep,
    /// Items to be tested (objects and nodes of the hierarchy), assigned to each of the six directions.
    lists: [Vec<Item>; 6],
    /// Whether `lists` holds the items of all directions of the viewcell that are not swept yet. If false,
    /// all items are assigned to the directions again before each direction is swept.
    is_assigned: bool,
    /// Items of the present direction that are still to be tested. Nodes may have been replaced by their
    /// children.
    asked: Vec<Item>,
    /// Projections of the items in `asked` onto the present plane, in metres: least and greatest coordinate
    /// along x, then along y.
    projections: Vec<[[f64; 2]; 2]>,
    /// Scratch memory for coordinates of items.
    coordinates: Vec<f64>,
    stack: Vec<Option<usize>>,
    /// Indices of the objects found hidden from the viewcell that was begun last.
    hidden: Bits,
}

impl Default for ExtendedProjectionCuller {
    fn default() -> Self {
        Self::new()
    }
}

impl ExtendedProjectionCuller {
    /// Creates a culler without surfaces. The first call collects them.
    pub fn new() -> Self {
        Self {
            surfaces: Arc::default(),
            cursor: SceneCursor::START,
            present: Arc::default(),
            effort: Effort::FULL,
            running: None,
            cell_box: None,
            pieces: Pieces::default(),
            sweep: Sweep::new(),
            lists: Default::default(),
            is_assigned: false,
            asked: Vec::new(),
            projections: Vec::new(),
            coordinates: Vec::new(),
            stack: Vec::new(),
            hidden: Bits::default(),
        }
    }

    /// Collects the surfaces of the scene again if occluders have changed. This takes O(n log n) time for n
    /// triangles, otherwise time in proportion to the changes. [`cull`](RegionCuller::cull) calls this.
    /// Called before a culler is cloned, it lets all clones share the surfaces.
    pub fn sync(&mut self, scene: &Scene) {
        let known = &self.surfaces.objects;
        let changed = match self.cursor.follow(scene) {
            Changes::Everything => true,
            Changes::Objects(ids) => {
                ids.iter().any(|&id| known.contains(id.index()) || Surfaces::has(scene, id))
            }
        };
        if changed {
            self.surfaces = Arc::new(Surfaces::new(scene));
        }
    }

    /// Sweeps all directions with maps for a convex cone of rays: a set bit of a map says that every ray from
    /// the cell through the bit's pixel is blocked in front of the plane, not only every ray to a tested
    /// object. Calls `each` for each plane, with its direction, its window and its map.
    pub(crate) fn sweep_open(
        &mut self,
        scene: &Scene,
        cell: &Viewcell,
        mut each: impl FnMut(&Direction, &Window, &RayMap),
    ) {
        self.sync(scene);
        let Some(bounds) = usable_bounds(scene, cell) else { return };
        let Some(cell_box) = cell_box(scene, cell, &bounds) else { return };
        let visible = VisibleSet::new();
        let occluding = occluding(scene, &visible);
        let surfaces = self.surfaces.clone();
        self.pieces.begin(&surfaces, &Effort::FULL, cell);
        let all = Occluders { scene, occluding: &occluding, surfaces: &surfaces, cell_box: &cell_box };
        let directions = core::array::from_fn(|index| cell_box.direction(index));
        let asked = Asked::Set(&visible);
        occludees::assign(scene, asked, &bounds, &directions, &mut self.lists, &mut self.stack);
        for (direction, list) in directions.iter().zip(&self.lists) {
            let Some(cone) = Cone::around(direction, list) else { continue };
            let cone = cone.opened();
            let rims = [0, 1].map(|lat| Rim::of(list, lat, direction, &mut self.coordinates));
            self.sweep.begin();
            let (mut nearest, mut left) = (Nearest::new(&all, direction, &cone, true), Effort::FULL);
            // A bit must hold for all rays of the cone, so all occluders in the cone are drawn.
            let (mut work, mut count) = (Work::UNLIMITED, 0);
            while let Some(range) = nearest.advance(&all, &mut self.pieces, direction, &cone, None, &mut work)
            {
                let occluders = nearest.occluders();
                for d in planes::distances(direction, &cone, occluders, &range, &mut left) {
                    let ends = [0, 1].map(|lat| cone.at(direction, d, lat));
                    let Some(window) = Window::fit(direction, d, ends, rims) else { break };
                    let place = |source| all.place(&self.pieces, direction, source);
                    self.sweep.move_to(direction, window, occluders, &left);
                    self.sweep.draw(direction, occluders, &cone, place, &mut work, &mut count);
                    each(direction, &window, &self.sweep.map);
                }
            }
        }
    }

    /// Removes hidden objects as [`cull`](RegionCuller::cull) does, until `stop` returns true. `stop` is
    /// called before each projection plane, after the scene's changes are applied. Once it has returned true,
    /// it must return true in all later calls. Objects that are not found hidden by then stay in `visible`.
    pub fn cull_until(
        &mut self,
        scene: &Scene,
        cell: &Viewcell,
        visible: &mut VisibleSet,
        stop: &dyn Fn() -> bool,
    ) -> CullStats {
        let occluding = occluding(scene, visible);
        self.cull_behind(scene, cell, &occluding, visible, stop)
    }

    /// Removes hidden objects as [`cull_until`](Self::cull_until) does, by sweeps from parts of the
    /// viewcell's box. The box is divided into `parts` along each of its two longer axes. An object that is
    /// hidden from each part is hidden from the whole viewcell, and a sweep from a small part mostly finds
    /// more objects hidden than one from the whole. Each sweep tests only the objects that all sweeps before
    /// have found hidden, so 2 by 2 parts take two to three times as long as one sweep from the whole.
    /// Nothing is removed if `stop` returns true at the end, or if `parts` is 0.
    pub fn cull_in_parts(
        &mut self,
        scene: &Scene,
        cell: &Viewcell,
        parts: u32,
        visible: &mut VisibleSet,
        stop: &dyn Fn() -> bool,
    ) -> CullStats {
        let occluding = occluding(scene, visible);
        let mut stats = CullStats::default();
        let shortest = (cell.max - cell.min).min_position();
        let (a, b) = ((shortest + 1) % 3, (shortest + 2) % 3);
        // Candidates that all sweeps so far have found hidden.
        let mut asked = visible.clone();
        let each = u64::from(parts);
        for part in 0..each * each {
            let (mut min, mut max) = (cell.min, cell.max);
            for (axis, at) in [(a, part % each), (b, part / each)] {
                [min[axis], max[axis]] = part_of([cell.min[axis], cell.max[axis]], at, each);
            }
            let mut left = asked.clone();
            stats += self.cull_behind(scene, &Viewcell::from_box(min, max), &occluding, &mut left, stop);
            // Objects that are never culled stay in both sets, and are no reason to go on.
            let mut is_asked = false;
            stats += asked.retain(scene, |id, _| {
                let is_hidden = !left.contains(scene, id);
                is_asked |= is_hidden;
                is_hidden
            });
            if !is_asked || stop() {
                break;
            }
        }
        let is_whole = parts > 0 && !stop();
        // The call is needed even if nothing is removed, since it counts the candidates.
        stats += visible.retain(scene, |id, _| !(is_whole && asked.contains(scene, id)));
        stats
    }

    /// Removes hidden objects as [`cull_until`](Self::cull_until) does. The only occluders are the objects
    /// whose indices are in `occluding`.
    fn cull_behind(
        &mut self,
        scene: &Scene,
        cell: &Viewcell,
        occluding: &Bits,
        visible: &mut VisibleSet,
        stop: &dyn Fn() -> bool,
    ) -> CullStats {
        self.sync(scene);
        self.begin(scene, cell, self.surfaces.clone(), Effort::FULL);
        let ask = Ask { occluding, asked: Asked::Set(visible), stop };
        let mut stats = CullStats::default();
        if let Some((cell_box, bounds)) = self.cell_box {
            self.assign(scene, ask.asked, &cell_box, &bounds, &mut stats);
            self.is_assigned = true;
        }
        for index in 0..6 {
            self.sweep_direction(scene, &ask, index, &mut { Work::UNLIMITED }, &mut stats);
        }
        let hidden = &self.hidden;
        stats += visible.retain(scene, |id, _| !hidden.contains(id.index()));
        stats
    }

    /// Begins a viewcell, and drops the results of the last one. An occluder whose triangles are in
    /// `surfaces` is drawn from them, and must not have changed since they were collected.
    pub(crate) fn begin(&mut self, scene: &Scene, cell: &Viewcell, surfaces: Arc<Surfaces>, effort: Effort) {
        self.hidden.reset(scene.index_limit());
        self.pieces.begin(&surfaces, &effort, cell);
        (self.present, self.effort) = (surfaces, effort);
        let bounds = usable_bounds(scene, cell);
        self.cell_box = bounds.and_then(|bounds| Some((cell_box(scene, cell, &bounds)?, bounds)));
        self.running = None;
        self.is_assigned = false;
    }

    /// Assigns the objects to be tested to the six directions. Returns the number of objects that were looked
    /// at one by one, or of nodes of the hierarchy.
    fn assign(
        &mut self,
        scene: &Scene,
        asked: Asked<'_>,
        cell_box: &CellBox,
        bounds: &Aabb,
        stats: &mut CullStats,
    ) -> usize {
        let boxes = core::array::from_fn(|index| cell_box.direction(index));
        let (lists, stack) = (&mut self.lists, &mut self.stack);
        let nodes = occludees::assign(scene, asked, bounds, &boxes, lists, stack);
        stats.nodes += nodes;
        match asked {
            Asked::All | Asked::Set(_) => nodes as usize,
            Asked::Objects(ids) | Asked::Beside(ids, _) => ids.len(),
        }
    }

    /// Ends the viewcell that was begun last, and releases its surfaces.
    pub(crate) fn end(&mut self) {
        self.present = Arc::default();
        self.running = None;
    }

    /// Returns the indices of the objects found hidden since [`begin`](Self::begin).
    pub(crate) fn hidden(&self) -> &Bits {
        &self.hidden
    }

    /// Drops the unfinished sweep of a direction. Objects that it has found hidden stay so. Returns whether
    /// there was one.
    pub(crate) fn restart(&mut self) -> bool {
        self.running.take().is_some()
    }

    /// Sweeps one direction, numbered as by [`CellBox::direction`], until it is done or `work` is used up,
    /// and adds the objects that it finds hidden to [`hidden`](Self::hidden). Continues the sweep that the
    /// last call left unfinished, if any: `ask` and `index` must then be the same. Returns whether the sweep
    /// is done.
    ///
    /// The objects of `ask.occluding` and the origin of the scene must not have changed since
    /// [`begin`](Self::begin). Other objects may have changed, but those that did since the sweep of the
    /// direction was begun may be wrongly among the hidden objects. If `ask.asked` is [by
    /// node](Asked::is_by_node), the layout of the scene's hierarchy must not have changed either since the
    /// sweep of the direction was begun.
    pub(crate) fn sweep_direction(
        &mut self,
        scene: &Scene,
        ask: &Ask<'_>,
        index: usize,
        work: &mut Work,
        stats: &mut CullStats,
    ) -> bool {
        let Some((cell_box, bounds)) = self.cell_box else { return true };
        let surfaces = self.present.clone();
        let all = Occluders { scene, occluding: ask.occluding, surfaces: &surfaces, cell_box: &cell_box };
        let direction = cell_box.direction(index);
        let job = Job { scene, ask, direction: &direction, all };
        let mut list = core::mem::take(&mut self.asked);
        let mut running = match self.running.take() {
            Some(running) => running,
            None => {
                if !self.is_assigned {
                    work.use_up(self.assign(scene, ask.asked, &cell_box, &bounds, stats), ITEM);
                }
                core::mem::swap(&mut list, &mut self.lists[index]);
                let new = Running::new(&job, &list, self.effort, &mut self.coordinates);
                let Some(running) = new else {
                    self.asked = list;
                    return true;
                };
                // The occluders of objects that are tested one by one are listed one by one too.
                if !ask.asked.is_by_node() {
                    work.use_up(ask.occluding.count() as usize, ITEM);
                }
                self.sweep.begin();
                running
            }
        };
        let is_done = self.go_on(&job, &mut running, &mut list, work, stats);
        self.asked = list;
        self.running = (!is_done).then_some(running);
        is_done
    }

    /// Continues the sweep of a direction until it is done or `work` is used up. Marks the objects of hidden
    /// items of `list`. Returns whether the sweep is done.
    fn go_on(
        &mut self,
        job: &Job<'_>,
        running: &mut Running,
        list: &mut Vec<Item>,
        work: &mut Work,
        stats: &mut CullStats,
    ) -> bool {
        let Job { all, direction, .. } = job;
        let Running { cone, rims, nearest, left, planes, window } = running;
        while !work.is_used_up() {
            // The occluders in front of the present plane are drawn, then the items behind it are tested.
            if let Some(present) = window {
                let place = |source| all.place(&self.pieces, direction, source);
                let (occluders, count) = (nearest.occluders(), &mut stats.occluders);
                if !self.sweep.draw(direction, occluders, cone, place, work, count) {
                    break;
                }
                self.test(job, present, list, stats);
                work.use_up(list.len(), ITEM);
                *window = None;
            }
            let Some(d) = planes.pop() else {
                // Occluders come in portions, nearest first. Each portion serves the planes up to where the
                // next portion begins.
                if list.is_empty() {
                    return true;
                }
                let asked = Some(list.as_slice());
                let range = nearest.advance(all, &mut self.pieces, direction, cone, asked, work);
                let Some(range) = range else { return nearest.is_done() };
                *planes = planes::distances(direction, cone, nearest.occluders(), &range, left);
                planes.reverse();
                work.use_up(nearest.occluders().len(), CHOICE);
                continue;
            };
            if (job.ask.stop)() {
                return true;
            }
            job.drop_reached(d, list, stats);
            self.projections.clear();
            // The window of the map is as small as possible: it holds the projections of all items still to
            // be tested.
            self.projections.extend(list.iter().map(|item| direction.occludee(d, &item.bounds)));
            let unite = |a: [[f64; 2]; 2], b: [[f64; 2]; 2]| {
                [0, 1].map(|lat| [a[lat][0].min(b[lat][0]), a[lat][1].max(b[lat][1])])
            };
            let ends = self.projections.iter().copied().reduce(unite);
            *window = ends.and_then(|ends| Window::fit(direction, d, ends, *rims));
            let Some(window) = *window else { return true };
            self.sweep.move_to(direction, window, nearest.occluders(), left);
            work.use_up(1, PLANE);
        }
        false
    }

    /// Removes from `list` the items that are found hidden behind the present plane, and marks their objects.
    /// A node that may be partly hidden is replaced by its children.
    fn test(&mut self, job: &Job<'_>, window: &Window, list: &mut Vec<Item>, stats: &mut CullStats) {
        let (mut at, mut kept) = (0, 0);
        while let Some(&item) = list.get(at) {
            let projection = self.projections.get(at).copied();
            let projection = projection.unwrap_or_else(|| job.direction.occludee(window.d, &item.bounds));
            at += 1;
            stats.tests += 1;
            if let Some(rect) = window.pixels(projection, &item.scene_bounds) {
                if self.sweep.map.all_set(rect) {
                    occludees::mark(job.scene, item.child, &mut self.hidden);
                    continue;
                }
                if let Child::Node(node) = item.child
                    && self.sweep.map.may_hold(rect, window.min_pixels(job.direction, item.bounds.lo.z))
                {
                    job.open_node(node, &item, list, stats);
                    continue;
                }
            }
            list[kept] = item;
            kept += 1;
        }
        list.truncate(kept);
    }
}

/// Cost of the reprojection of the map to a plane, in nanoseconds of [`Work`].
const PLANE: u64 = 60_000;
/// Cost of the test of an item on a plane, and of an object when a sweep begins, in nanoseconds of [`Work`].
const ITEM: u64 = 60;
/// Cost of each occluder when planes are chosen, in nanoseconds of [`Work`].
const CHOICE: u64 = 400;

/// Request to [`sweep_direction`](ExtendedProjectionCuller::sweep_direction) for the present viewcell.
pub(crate) struct Ask<'a> {
    /// Indices of the objects that may occlude.
    pub(crate) occluding: &'a Bits,
    /// Objects to be tested. Other objects are not found hidden.
    pub(crate) asked: Asked<'a>,
    /// Called before each plane. The sweep ends once it returns true.
    pub(crate) stop: &'a dyn Fn() -> bool,
}

/// The inputs of one direction's sweep, which do not change from plane to plane.
struct Job<'a> {
    scene: &'a Scene,
    ask: &'a Ask<'a>,
    direction: &'a Direction,
    all: Occluders<'a>,
}

/// State of the sweep of one direction, except its map and the items that are still to be tested.
#[derive(Clone, Debug)]
struct Running {
    cone: Cone,
    rims: [Option<Rim>; 2],
    nearest: Nearest,
    /// Effort of the sweep, with [`Effort::behind`] reduced by the number of planes behind occluders that
    /// were chosen already.
    left: Effort,
    /// Distances in metres of the planes that are still to be swept, farthest first. They were chosen for the
    /// last portion of occluders that [`Nearest::advance`] has collected.
    planes: Vec<f64>,
    /// The present plane. `None` once its occluders are drawn and the items behind it are tested.
    window: Option<Window>,
}

impl Running {
    /// Begins the sweep of a direction that tests `items`. `None` if there are no items. `scratch` is scratch
    /// memory.
    fn new(job: &Job<'_>, items: &[Item], left: Effort, scratch: &mut Vec<f64>) -> Option<Self> {
        let direction = job.direction;
        let cone = Cone::around(direction, items)?;
        let rims = [0, 1].map(|lat| Rim::of(items, lat, direction, scratch));
        let by_node = job.ask.asked.is_by_node();
        let left = if matches!(job.ask.asked, Asked::Beside(..)) { left.beside() } else { left };
        let nearest = Nearest::new(&job.all, direction, &cone, by_node);
        Some(Self { cone, rims, nearest, left, planes: Vec::new(), window: None })
    }
}

impl Job<'_> {
    /// Removes from `list` the objects that are not strictly behind the plane at distance `d`; they count as
    /// visible. The map of the plane contains occluders up to that distance, so such an object could be found
    /// hidden by its own triangles, or by those of an object that begins at the same depth. Nodes are
    /// replaced by their children, which may be farther away.
    fn drop_reached(&self, d: f64, list: &mut Vec<Item>, stats: &mut CullStats) {
        let reach = d + self.direction.guard();
        let mut at = 0;
        while let Some(&item) = list.get(at) {
            if item.bounds.lo.z > reach {
                at += 1;
                continue;
            }
            list.swap_remove(at);
            if let Child::Node(node) = item.child {
                self.open_node(node, &item, list, stats);
            }
        }
    }

    /// Adds the children of a node to `list`, each cut to `item`, the node's item. Rays to the children are
    /// then also rays to the item, so the bits of the map are valid for the children too. A child that
    /// reaches out of the item holds objects that have changed since the direction was begun; the others lie
    /// within.
    fn open_node(&self, node: usize, item: &Item, list: &mut Vec<Item>, stats: &mut CullStats) {
        stats.nodes += 1;
        occludees::for_each_child(self.scene, &self.ask.asked, self.direction, node, |child| {
            list.extend(child.within(item));
        });
    }
}

/// Returns the ends of a part of a range that is divided into `parts`. Neighbouring parts share their ends
/// exactly, and the last part ends where the range does.
fn part_of([low, high]: [f64; 2], part: u64, parts: u64) -> [f64; 2] {
    let end = |at: u64| low + (high - low) * (at as f64 / parts as f64);
    [end(part), if part + 1 < parts { end(part + 1) } else { high }]
}

/// Encloses a viewcell in a box along the axes for which the box is small. `None` for a viewcell that is
/// empty or not finite.
fn cell_box(scene: &Scene, cell: &Viewcell, bounds: &Aabb) -> Option<CellBox> {
    let extent = CellExtent::new(cell, scene.origin())?;
    CellBox::new(&extent, bounds, extent.axes())
}

impl RegionCuller for ExtendedProjectionCuller {
    fn accuracy(&self) -> Accuracy {
        Accuracy::Conservative
    }

    fn cull(&mut self, scene: &Scene, cell: &Viewcell, visible: &mut VisibleSet) -> CullStats {
        self.cull_until(scene, cell, visible, &|| false)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::glam::{Affine3A, DVec3};
    use visibility_core::{Object, OccluderMesh};

    #[test]
    fn a_sweep_beside_lists_one_direction_and_is_charged_for_its_objects() {
        let mut scene = Scene::new();
        let ids: Vec<_> = (0..500)
            .map(|i| scene.insert(Aabb::from_arrays([9.0, i as f32, 2.0], [15.0, i as f32 + 0.5, 5.0])))
            .collect();
        let (mut culler, mut work) = (ExtendedProjectionCuller::new(), Work::UNLIMITED);
        let cell = Viewcell::from_box(DVec3::splat(-0.5), DVec3::splat(0.5));
        culler.begin(&scene, &cell, Arc::default(), Effort::QUICK);
        let up =
            (0..6).find(|&index| culler.cell_box.unwrap().0.direction(index).rows[2] == DVec3::Z).unwrap();
        let ask = Ask { occluding: &Bits::EMPTY, asked: Asked::Beside(&ids, up), stop: &|| true };
        culler.sweep_direction(&scene, &ask, up, &mut work, &mut CullStats::default());
        assert!(culler.asked.len() > 50, "{} objects are asked upwards", culler.asked.len());
        assert!(culler.lists.iter().all(Vec::is_empty), "objects are listed for no other direction");
        assert!(work.done() >= 500 * ITEM, "{} ns for a list of 500 objects", work.done());
    }

    /// Returns a scene of cuboids that occlude.
    fn walls(bounds: &[Aabb]) -> Scene {
        let mut scene = Scene::new();
        for bounds in bounds {
            let id = scene.insert(Object { occluder: true, ..Object::new(*bounds) });
            let mesh = scene.add_mesh(OccluderMesh::cuboid(bounds).unwrap());
            scene.set_mesh(id, mesh, Affine3A::IDENTITY).unwrap();
        }
        scene
    }

    #[test]
    fn parts_of_a_range_share_their_ends_and_fill_it() {
        for [low, high] in [[0.0, 1.0], [-0.1, 0.3], [-1e-9, 1e9], [0.7, 0.9], [-3e5, -1e-3]] {
            for parts in [1, 2, 3, 7, 10, 1000] {
                let ends = (0..parts).map(|part| part_of([low, high], part, parts)).collect::<Vec<_>>();
                assert!(ends[0][0] == low && ends[ends.len() - 1][1] == high, "{low} to {high} in {parts}");
                assert!(ends.windows(2).all(|two| two[0][1] == two[1][0]), "{low} to {high} in {parts}");
            }
        }
    }

    /// Occluders that come and go change the surfaces. Other objects do not.
    #[test]
    fn surfaces_follow_occluders() {
        let mut scene = walls(&[Aabb::from_arrays([5.0; 3], [6.0; 3])]);
        let wall = scene.ids().next().unwrap();
        let mut culler = ExtendedProjectionCuller::new();
        let mut triangles = |scene: &Scene| {
            let before = culler.surfaces.stamp;
            culler.sync(scene);
            (culler.surfaces.triangles.len(), before != culler.surfaces.stamp)
        };
        assert_eq!(triangles(&scene), (12, true), "a wall");
        let other = Object { occluder: true, ..Object::new(Aabb::from_arrays([8.0; 3], [9.0; 3])) };
        let other = scene.insert(other);
        assert_eq!(triangles(&scene), (12, false), "an object without a mesh has come");
        let mesh = scene.add_mesh(OccluderMesh::cuboid(&Aabb::from_arrays([8.0; 3], [9.0; 3])).unwrap());
        scene.set_mesh(other, mesh, Affine3A::IDENTITY).unwrap();
        assert_eq!(triangles(&scene), (24, true), "an occluder has come");
        scene.remove(wall).unwrap();
        assert_eq!(triangles(&scene), (12, true), "an occluder has gone");
    }

    /// Posts far to the left and to the right behind a wall are hidden together, and from parts. A sweep that
    /// is stopped before its end removes nothing from a viewcell in parts, nor does one from no parts.
    #[test]
    fn parts_hide_what_all_of_them_hide_once_they_are_swept() {
        let post = |y: f32| Aabb::from_arrays([20.0, y, 0.0], [20.5, y + 0.5, 1.0]);
        let mut scene = walls(&[Aabb::from_arrays([5.0, -40.0, -9.0], [5.2, 40.0, 9.0])]);
        let wall = scene.ids().next().unwrap();
        let posts = [-15.0, 0.0, 15.0].map(|y| scene.insert(post(y)));
        let beside = scene.insert(Aabb::from_arrays([0.0, 20.0, 0.0], [1.0, 21.0, 1.0]));
        let cell = Viewcell::from_box(DVec3::ZERO, DVec3::ONE);
        let mut culler = ExtendedProjectionCuller::new();
        let mut seen = |parts: Option<u32>, calls: usize| {
            let (mut visible, made) = (VisibleSet::new(), core::cell::Cell::new(0));
            let stop = || {
                made.set(made.get() + 1);
                made.get() > calls
            };
            match parts {
                None => culler.cull_until(&scene, &cell, &mut visible, &stop),
                Some(parts) => culler.cull_in_parts(&scene, &cell, parts, &mut visible, &stop),
            };
            (
                [wall, beside].map(|id| visible.contains(&scene, id)),
                posts.map(|id| visible.contains(&scene, id)),
                made.get(),
            )
        };
        for parts in [None, Some(1), Some(2)] {
            let (walls, posts, calls) = seen(parts, usize::MAX);
            assert_eq!((walls, posts), ([true; 2], [false; 3]), "in parts: {parts:?}");
            for stopped in (0..calls).filter(|_| parts.is_some()) {
                let (walls, posts, _) = seen(parts, stopped);
                assert_eq!((walls, posts), ([true; 2], [true; 3]), "{parts:?} stopped after {stopped}");
            }
        }
        assert_eq!(seen(Some(0), usize::MAX).1, [true; 3], "from no parts");
    }

    /// Objects that begin at a plane, up to the guard, are not tested on it.
    #[test]
    fn objects_at_a_plane_are_dropped() {
        let scene = walls(&[Aabb::from_arrays([5.0; 3], [6.0; 3])]);
        let viewcell = Viewcell::from_box(DVec3::splat(-0.5), DVec3::splat(0.5));
        let bounds = usable_bounds(&scene, &viewcell).unwrap();
        let (cell_box, surfaces) = (cell_box(&scene, &viewcell, &bounds).unwrap(), Surfaces::default());
        let all =
            Occluders { scene: &scene, occluding: &Bits::EMPTY, surfaces: &surfaces, cell_box: &cell_box };
        let direction = cell_box.direction(0);
        let ask = Ask { occluding: &Bits::EMPTY, asked: Asked::All, stop: &|| false };
        let job = Job { scene: &scene, ask: &ask, direction: &direction, all };
        let scene_bounds = Aabb::from_arrays([5.0; 3], [6.0; 3]);
        let child = Child::Object(scene.ids().next().unwrap());
        let reach = 4.0 + direction.guard();
        let mut bounds = direction.local_box(&scene_bounds);
        for (at, is_kept) in [(4.0, false), (reach, false), (reach.next_up(), true)] {
            bounds.lo.z = at;
            let mut list = alloc::vec![Item { child, bounds, scene_bounds }];
            job.drop_reached(4.0, &mut list, &mut CullStats::default());
            assert_eq!(!list.is_empty(), is_kept, "an object at {at}, a plane at 4 with a guard to {reach}");
        }
    }

    #[test]
    fn what_lies_far_behind_walls_is_not_touched() {
        let mut scene = Scene::new();
        let mut add = |min: [f32; 3], max: [f32; 3]| {
            let bounds = Aabb::from_arrays(min, max);
            let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
            let mesh = scene.add_mesh(OccluderMesh::cuboid(&bounds).unwrap());
            scene.set_mesh(id, mesh, Affine3A::IDENTITY).unwrap();
        };
        add([5.0, -20.0, -20.0], [5.1, 20.0, 20.0]);
        for i in 0..60_000 {
            let [x, y] = [i / 200, i % 200].map(|i| i as f32);
            add([10.0 + x, 0.1 * y - 10.0, -0.5], [10.5 + x, 0.1 * y - 9.95, 0.5]);
        }
        let (mut culler, mut visible) = (ExtendedProjectionCuller::new(), VisibleSet::new());
        let cell = Viewcell::from_box(DVec3::splat(-0.5), DVec3::splat(0.5));
        culler.cull(&scene, &cell, &mut visible);
        assert_eq!(visible.count(&scene), 1, "objects visible: the wall");
        let touched = culler.pieces.len();
        assert!((1..20_000).contains(&touched), "{touched}");
    }
}
