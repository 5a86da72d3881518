//! What all eyes in a building share: its cells, portals, doors and mirrors, and which objects are in which
//! cells.

use super::doors::{Doors, Passage};
use super::mirror::{Mirror, MirrorId, NONE};
use super::outline::Outline;
use super::scene_cells_error::SceneCellsError;
use alloc::vec::Vec;
use smallvec::SmallVec;
use visibility_core::glam::DVec3;
use visibility_core::{
    Aabb, CellGraph, CellId, Changes, ConvexPolygon, ObjectId, PortalId, Pvs, PvsTargets, Scene, SceneCursor,
    Stamp, Viewcells,
};

/// The cells of a scene as [`PortalEye`](super::portal_eye::PortalEye)s see through them.
///
/// An object is in every cell that its box touches, and visible where it is seen in any of them.
/// [`sync`](Self::sync) takes in what moved, in time proportional to that; an object whose last change was
/// not taken in counts as visible, and so does one in no cell.
///
/// ```
/// use visibility_core::{Aabb, CellGraph, CellId, ConvexPolygon, PortalId, Scene, Viewcell, Viewcells, glam::DVec3};
/// use visibility_portals::SceneCells;
/// // Two rooms side by side along x, with a door at x = 4.
/// let door = ConvexPolygon::new([[4.0, 1.0, 0.0], [4.0, 2.0, 0.0], [4.0, 2.0, 2.0], [4.0, 1.0, 2.0]].map(DVec3::from))?;
/// let graph = CellGraph::new(2, [(door, [CellId(0), CellId(1)])])?;
/// let room = |x: f64| Viewcell::from_box(DVec3::new(x, 0.0, 0.0), DVec3::new(x + 4.0, 4.0, 3.0));
/// let mut cells = SceneCells::new(graph, Viewcells::new([room(0.0), room(4.0)]), 1e-6)?;
/// let mut scene = Scene::new();
/// let table = scene.insert(Aabb::from_arrays([5.0, 1.0, 0.0], [7.0, 2.0, 1.0]));
/// cells.sync(&scene);
/// assert_eq!(cells.cells_of(table), [CellId(1)]);
/// cells.set_open(PortalId(0), false)?;
/// assert!(!cells.is_open(PortalId(0)));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct SceneCells {
    pub(super) graph: CellGraph,
    pub(super) viewcells: Viewcells,
    pub(super) tolerance: f64,
    pub(super) outlines: Vec<Outline>,
    pub(super) doors: Doors,
    pub(super) pvs: Option<Pvs>,
    pub(super) mirrors: Vec<Mirror>,
    /// By cell.
    pub(super) first_mirror: Vec<u32>,
    /// By index of the object.
    objects: Vec<Entry>,
    /// How far the scene's changes are taken in; the start before the first scene.
    pub(super) cursor: SceneCursor,
    stamp: Stamp,
}

/// Which object was last known by an index, and the cells that it is in.
#[derive(Clone, Debug, Default)]
struct Entry {
    id: Option<ObjectId>,
    cells: SmallVec<[CellId; 4]>,
}

impl SceneCells {
    /// From the cells and portals of a building and where the cells are: viewcell `i` holds cell `i`, in the
    /// world's own coordinates. No object is known before [`sync`](Self::sync); all portals are open both
    /// ways.
    ///
    /// Objects that the graph [lists](CellGraph::set_objects) are taken to be in those cells alone, at the
    /// first `sync`, until they change: whoever knows that a wall only touches a room behind another wall can
    /// say so.
    ///
    /// `tolerance`, in the world's units, is how far portals and cells may be from where they should be: 1e-6
    /// will do for what was computed in `f64` in metres, the last decimal for what was read from text. An
    /// object this near a cell is in it, a line of sight this near a portal passes, and gaps of twice as much
    /// between cells are none.
    ///
    /// # Errors
    /// [`SceneCellsError::Viewcells`], [`SceneCellsError::Tolerance`].
    pub fn new(graph: CellGraph, viewcells: Viewcells, tolerance: f64) -> Result<Self, SceneCellsError> {
        let (cells, found) = (graph.cell_count(), viewcells.cells().len());
        if cells != found {
            return Err(SceneCellsError::Viewcells { cells, viewcells: found });
        }
        if !(tolerance >= 0.0 && tolerance.is_finite()) {
            return Err(SceneCellsError::Tolerance(tolerance));
        }
        let outlines = graph
            .portals()
            .iter()
            .map(|portal| Outline::new(portal.polygon().vertices(), portal.plane().normal, tolerance))
            .collect();
        Ok(Self {
            outlines,
            doors: Doors::new(graph.portals().len()),
            pvs: None,
            mirrors: Vec::new(),
            first_mirror: alloc::vec![NONE; cells],
            objects: Vec::new(),
            cursor: SceneCursor::START,
            stamp: Stamp::new(),
            graph,
            viewcells,
            tolerance,
        })
    }

    /// Limits what is seen from a cell to its potentially visible set, of cells from cells. It must have been
    /// made with every portal open.
    ///
    /// # Errors
    /// [`SceneCellsError::Pvs`].
    pub fn with_pvs(mut self, pvs: Pvs) -> Result<Self, SceneCellsError> {
        let (cells, viewcells, targets) = (self.graph.cell_count(), pvs.viewcell_count(), pvs.target_count());
        if pvs.targets() != PvsTargets::Cells || viewcells != cells || targets != cells {
            return Err(SceneCellsError::Pvs { cells, viewcells, targets });
        }
        self.pvs = Some(pvs);
        self.stamp = Stamp::new();
        Ok(self)
    }

    /// Identifies cells, PVS, mirrors, the state of all doors, and the cells of each object: a new stamp
    /// after every call that may have changed any of these. Clones share it until either changes.
    pub fn stamp(&self) -> Stamp {
        self.stamp
    }

    /// Cells and portals.
    pub fn graph(&self) -> &CellGraph {
        &self.graph
    }

    /// Where the cells are.
    pub fn viewcells(&self) -> &Viewcells {
        &self.viewcells
    }

    fn changed(&mut self, known: bool, portal: PortalId) -> Result<(), SceneCellsError> {
        self.stamp = Stamp::new();
        if known { Ok(()) } else { Err(SceneCellsError::UnknownPortal(portal)) }
    }

    /// Opens or closes a portal, as a door does, for all frames from here on. Constant time, no allocation.
    ///
    /// # Errors
    /// [`SceneCellsError::UnknownPortal`].
    pub fn set_open(&mut self, portal: PortalId, open: bool) -> Result<(), SceneCellsError> {
        let known = self.doors.set_open(portal, open);
        self.changed(known, portal)
    }

    /// Whether a portal is open; false for an unknown one.
    pub fn is_open(&self, portal: PortalId) -> bool {
        self.doors.is_open(portal)
    }

    /// Says from which sides one can see through a portal while it is open. Constant time.
    ///
    /// # Errors
    /// [`SceneCellsError::UnknownPortal`].
    pub fn set_passage(&mut self, portal: PortalId, passage: Passage) -> Result<(), SceneCellsError> {
        let known = self.doors.set_passage(portal, passage);
        self.changed(known, portal)
    }

    /// Hangs a mirror on the boundary of a cell: a convex polygon whose normal, from whose tip its vertices
    /// run counter-clockwise, points into the cell. What it shows is returned by each frame as
    /// [`Reflection`](super::reflection::Reflection)s. The mirror itself, as something to be drawn, is an
    /// object like any other. It is uncovered until [`set_mirror`](Self::set_mirror) covers it.
    ///
    /// # Errors
    /// [`SceneCellsError::UnknownCell`], [`SceneCellsError::NoPlane`].
    pub fn add_mirror(&mut self, cell: CellId, polygon: &ConvexPolygon) -> Result<MirrorId, SceneCellsError> {
        let head = self.first_mirror.get_mut(cell.index()).ok_or(SceneCellsError::UnknownCell(cell))?;
        let plane = polygon.plane().ok_or(SceneCellsError::NoPlane)?;
        let id = self.mirrors.len() as u32;
        self.mirrors.push(Mirror {
            outline: Outline::new(polygon.vertices(), plane.normal, self.tolerance),
            vertices: polygon.vertices().to_vec(),
            next: core::mem::replace(head, id),
            uncovered: true,
        });
        self.stamp = Stamp::new();
        Ok(MirrorId(id))
    }

    /// Covers a mirror, so that it shows nothing, or uncovers it. Constant time.
    ///
    /// # Errors
    /// [`SceneCellsError::UnknownMirror`].
    pub fn set_mirror(&mut self, mirror: MirrorId, uncovered: bool) -> Result<(), SceneCellsError> {
        let found = self.mirrors.get_mut(mirror.0 as usize).ok_or(SceneCellsError::UnknownMirror(mirror))?;
        found.uncovered = uncovered;
        self.stamp = Stamp::new();
        Ok(())
    }

    /// Takes in what has changed in the scene since the last call, in time proportional to that (and to the
    /// logarithm of the number of cells); the first call, and one after more changes than the scene
    /// remembers, looks at every object. Allocates only where an object comes to be in more cells than ever,
    /// or is new.
    pub fn sync(&mut self, scene: &Scene) {
        if self.cursor.is_current(scene) {
            return;
        }
        let first = self.cursor == SceneCursor::START;
        match self.cursor.follow(scene) {
            Changes::Objects(ids) => {
                for &id in ids {
                    self.place(scene, id);
                }
            }
            Changes::Everything => {
                self.objects.iter_mut().for_each(|entry| entry.id = None);
                if first {
                    self.take_listed(scene);
                }
                for id in scene.ids() {
                    if self.objects.get(id.index()).is_none_or(|entry| entry.id.is_none()) {
                        self.place(scene, id);
                    }
                }
            }
        }
        self.stamp = Stamp::new();
    }

    /// The objects that the graph lists.
    fn take_listed(&mut self, scene: &Scene) {
        self.objects.resize_with(scene.index_limit(), Entry::default);
        for cell in (0..self.graph.cell_count() as u32).map(CellId) {
            for &id in self.graph.objects_in(cell) {
                if scene.contains(id) {
                    let entry = &mut self.objects[id.index()];
                    entry.id = Some(id);
                    entry.cells.push(cell);
                }
            }
        }
    }

    fn place(&mut self, scene: &Scene, id: ObjectId) {
        if self.objects.len() <= id.index() {
            self.objects.resize_with(scene.index_limit().max(id.index() + 1), Entry::default);
        }
        let entry = &mut self.objects[id.index()];
        let Ok(bounds) = scene.bounds(id) else {
            // Removed; its index may already be that of another.
            if entry.id == Some(id) {
                entry.id = None;
            }
            return;
        };
        entry.id = Some(id);
        entry.cells.clear();
        let (min, max) = in_world(&bounds, scene.origin(), self.tolerance);
        self.viewcells.for_each_touching(min, max, |viewcell| entry.cells.push(CellId(viewcell.0)));
        entry.cells.sort_unstable();
    }

    /// The cells that an object is in, as of the last [`sync`](Self::sync), ascending; none for an unknown
    /// object.
    pub fn cells_of(&self, id: ObjectId) -> &[CellId] {
        match self.objects.get(id.index()) {
            Some(entry) if entry.id == Some(id) => &entry.cells,
            _ => &[],
        }
    }

    /// Whether a cell may see another with every portal open, from anywhere to anywhere in it: by the
    /// potentially visible sets, if there are any, otherwise by whether portals join them at all.
    pub fn can_see(&self, from: CellId, to: CellId) -> bool {
        match &self.pvs {
            Some(pvs) => pvs.sees(from.into(), to.0),
            None => self.joined(from, to, |_, _| true),
        }
    }

    /// Whether a cell may see another through the portals that are open now. Stricter than
    /// [`can_see`](Self::can_see), and still never wrong where it says no: some chain of open portals must
    /// join them, all through cells that the first can see. Looks at each portal once at most; allocates.
    pub fn can_see_now(&self, from: CellId, to: CellId) -> bool {
        self.can_see(from, to) && self.joined(from, to, |portal, forward| self.doors.passes(portal, forward))
    }

    fn joined(&self, from: CellId, to: CellId, passes: impl Fn(PortalId, bool) -> bool) -> bool {
        let cells = self.graph.cell_count();
        if from.index() >= cells || to.index() >= cells {
            return false;
        }
        let mut reached = alloc::vec![false; cells];
        let mut waiting = alloc::vec![from];
        reached[from.index()] = true;
        while let Some(cell) = waiting.pop() {
            for &id in self.graph.portals_of(cell) {
                let [first, second] = self.graph.portals()[id.index()].cells();
                let forward = first == cell;
                let next = if forward { second } else { first };
                let seen = || self.pvs.as_ref().is_none_or(|pvs| pvs.sees(from.into(), next.0));
                if !reached[next.index()] && passes(id, forward) && seen() {
                    reached[next.index()] = true;
                    waiting.push(next);
                }
            }
        }
        reached[to.index()]
    }
}

/// A box in the world, larger by `tolerance` and by what adding the origin may have rounded.
pub(super) fn in_world(bounds: &Aabb, origin: DVec3, tolerance: f64) -> (DVec3, DVec3) {
    let (min, max) = (bounds.min.as_dvec3() + origin, bounds.max.as_dvec3() + origin);
    let grown = DVec3::splat(tolerance) + (min.abs().max(max.abs())) * f64::EPSILON;
    (min - grown, max + grown)
}
