//! The data that all views into a building share: its cells, portals, doors and mirrors, and the cells of
//! each object.

use super::NONE;
use super::doors::{Doors, Passage};
use super::hung_mirrors::{Mirror, MirrorId};
use super::outline::Outline;
use super::scene_cells_error::SceneCellsError;
use alloc::vec::Vec;
use smallvec::SmallVec;
use visibility_core::glam::DVec3;
use visibility_core::{
    Aabb, ObjectId, Scene,
    cells::{CellGraph, CellId, Portal, PortalId},
    geometry::ConvexPolygon,
    pvs::{Pvs, PvsTargets, Viewcell, Viewcells},
    scene::{Changes, SceneCursor},
    stamp::Stamp,
};

/// Cells, portals, doors, mirrors and PVS of a building, and the cells of each object. Shared by all
/// [`PortalEye`](super::portal_eye::PortalEye)s.
///
/// An object belongs to every cell that its bounds [touch](Viewcells::for_each_touching), and counts as
/// visible if it is seen in any of these cells. An object in no cell is always visible, and so is an object
/// that changed after the last [`sync`](Self::sync).
///
/// ```
/// use visibility_core::glam::DVec3;
/// use visibility_core::{
///     cells::{CellGraph, CellId, PortalId}, geometry::ConvexPolygon, pvs::{Viewcell, Viewcells},
///     Aabb, Scene,
/// };
/// use visibility_portals::SceneCells;
/// // Two rooms side by side along x, with a door at x = 4.
/// let corners = [[4.0, 1.0, 0.0], [4.0, 2.0, 0.0], [4.0, 2.0, 2.0], [4.0, 1.0, 2.0]];
/// let door = ConvexPolygon::new(corners.map(DVec3::from))?;
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
    /// Portals that were wound the wrong way in the graph passed to `new`, ascending. They are turned in
    /// `graph`.
    turned: Vec<PortalId>,
    pub(super) viewcells: Viewcells,
    pub(super) tolerance: f64,
    pub(super) outlines: Vec<Outline>,
    pub(super) doors: Doors,
    pub(super) pvs: Option<Pvs>,
    pub(super) mirrors: Vec<Mirror>,
    /// By cell index: index in `mirrors` of the mirror added last to the cell, or `NONE`.
    pub(super) first_mirror: Vec<u32>,
    /// The cells of each object, by object index.
    objects: Vec<Entry>,
    /// Revision of the scene up to which `objects` is current.
    pub(super) cursor: SceneCursor,
    stamp: Stamp,
}

/// The cells that one object belongs to, in ascending order. `id` is the object, or `None` if no object with
/// this index is known.
#[derive(Clone, Debug, Default)]
struct Entry {
    id: Option<ObjectId>,
    cells: SmallVec<[CellId; 4]>,
}

impl SceneCells {
    /// Makes the cells of a building from a cell graph and from the volumes of the cells in world space:
    /// viewcell `i` is the volume of cell `i`. All portals start open in both directions. No object is known
    /// before the first [`sync`](Self::sync).
    ///
    /// Objects that the graph [lists](CellGraph::set_objects) belong to the listed cells alone, until they
    /// change or a later `sync` inspects every object. The first `sync` reads these lists; they must be
    /// correct for the scene as it is then.
    ///
    /// `tolerance` is the distance, in world units, by which portals and volumes may be misplaced: 1e-6 for
    /// coordinates in metres that were computed in `f64`, the last decimal for coordinates read from text. An
    /// object within the tolerance of a cell belongs to the cell. A line of sight within the tolerance of a
    /// portal passes the portal. Gaps between cells of up to twice the tolerance are ignored. The
    /// [misplacement](Viewcells::misplacement) of the viewcells is added to the tolerance.
    ///
    /// A portal that is wound the wrong way is [turned](CellGraph::turn_portals), so that its normal points
    /// from its first cell into its second. It is not checked that portals lie in the faces of the volumes,
    /// since walls may be thick ([`CellGraph::validate_bodies`] does), nor that the boundaries of the volumes
    /// are opaque elsewhere.
    ///
    /// # Errors
    /// - [`SceneCellsError::Viewcells`] if the number of cells of the graph differs from the number of
    ///   `viewcells`.
    /// - [`SceneCellsError::Tolerance`] if `tolerance` is negative, infinite or NaN.
    /// - [`SceneCellsError::Graph`] if the volumes do not decide which way a portal is wound: both reach
    ///   across its plane, or both lie on the same side of it.
    pub fn new(graph: CellGraph, viewcells: Viewcells, tolerance: f64) -> Result<Self, SceneCellsError> {
        let (cells, found) = (graph.cell_count(), viewcells.cells().len());
        if cells != found {
            return Err(SceneCellsError::Viewcells { cells, viewcells: found });
        }
        if !(tolerance >= 0.0 && tolerance.is_finite()) {
            return Err(SceneCellsError::Tolerance(tolerance));
        }
        let mut graph = graph;
        let turned = graph.turn_portals(viewcells.cells(), tolerance).map_err(SceneCellsError::Graph)?;
        let misplacement = viewcells.misplacement();
        let outline = |portal: &Portal| {
            Outline::new(portal.polygon().vertices(), portal.plane().normal, tolerance, misplacement)
        };
        let outlines = graph.portals().iter().map(outline).collect();
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
            turned,
            viewcells,
            tolerance,
        })
    }

    /// Returns a tolerance for [`new`](Self::new) that covers the rounding of coordinates in `f64`: 2^-30 of
    /// the longest side of the box around all cells, about a tenth of a micrometre in a building, plus 2^-49
    /// of the greatest coordinate. Merged vertices are covered by the [misplacement](Viewcells::misplacement)
    /// of the viewcells. 0 without cells.
    pub fn usual_tolerance(viewcells: &Viewcells) -> f64 {
        let around = |(min, max): (DVec3, DVec3), cell: &Viewcell| (min.min(cell.min), max.max(cell.max));
        let (min, max) = viewcells.cells().iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), around);
        if viewcells.cells().is_empty() {
            return 0.0;
        }
        let farthest = min.abs().max(max.abs()).max_element();
        // The factors are powers of two, so scaling cells by a power of two does not change answers.
        (max - min).max_element() / f64::from(1 << 30) + 8.0 * f64::EPSILON * farthest
    }

    /// Limits the cells seen from a cell to its row of `pvs`, whose viewcells and targets must be the cells
    /// of the graph. The PVS must have been computed from this graph, with all portals open: a door that is
    /// opened later adds no cell to the PVS.
    ///
    /// The [source](Pvs::source) of the PVS is compared with the [version](CellGraph::version) of the graph.
    /// A PVS without a source may be of another graph, so cullers of these cells are then approximate.
    ///
    /// # Errors
    /// [`SceneCellsError::Winding`] if portals were turned when the cells were made and the source does not
    /// say that the PVS is of the turned graph: a PVS of the original graph would hide visible cells. Call
    /// [`CellGraph::turn_portals`] before the bake. [`SceneCellsError::Pvs`] if the targets of `pvs` are not
    /// cells, or if its numbers of viewcells or targets differ from the number of cells;
    /// [`SceneCellsError::OtherGraph`] if its source is another graph.
    pub fn with_pvs(mut self, pvs: Pvs) -> Result<Self, SceneCellsError> {
        let (cells, viewcells, targets) = (self.graph.cell_count(), pvs.viewcell_count(), pvs.target_count());
        if pvs.targets() != PvsTargets::Cells || viewcells != cells || targets != cells {
            return Err(SceneCellsError::Pvs { cells, viewcells, targets });
        }
        let is_of_graph = pvs.source().map(|source| source == self.graph.version());
        match (is_of_graph, self.turned.first()) {
            (Some(true), _) | (None, None) => {}
            (_, Some(&first)) => {
                return Err(SceneCellsError::Winding { first, count: self.turned.len() });
            }
            (Some(false), None) => return Err(SceneCellsError::OtherGraph),
        }
        self.pvs = Some(pvs);
        self.stamp = Stamp::new();
        Ok(self)
    }

    /// Returns true if there is no PVS, or one with a source. A PVS without a source may be of another graph:
    /// see [`with_pvs`](Self::with_pvs).
    pub(crate) fn is_pvs_checked(&self) -> bool {
        self.pvs.as_ref().is_none_or(|pvs| pvs.source().is_some())
    }

    /// Returns the stamp that identifies the present content: cells, PVS, mirrors, the state of all doors,
    /// and the cells of each object. Every call that may change any of these takes a new stamp. A clone has
    /// the same stamp until the clone or the original changes.
    pub fn stamp(&self) -> Stamp {
        self.stamp
    }

    /// Returns the graph of cells and portals, in world space, with all portals wound rightly.
    pub fn graph(&self) -> &CellGraph {
        &self.graph
    }

    /// Returns the portals that were wound the wrong way in the graph as it was given to [`new`](Self::new),
    /// ascending. They are turned in [`graph`](Self::graph).
    pub fn turned_portals(&self) -> &[PortalId] {
        &self.turned
    }

    /// Returns the volumes of the cells in world space; viewcell `i` is the volume of cell `i`.
    pub fn viewcells(&self) -> &Viewcells {
        &self.viewcells
    }

    /// Takes a new stamp (version number of the content). Returns [`SceneCellsError::UnknownPortal`] if
    /// `known` is `false`: `portal` is not in the graph.
    fn changed(&mut self, known: bool, portal: PortalId) -> Result<(), SceneCellsError> {
        self.stamp = Stamp::new();
        if known { Ok(()) } else { Err(SceneCellsError::UnknownPortal(portal)) }
    }

    /// Opens (`open` true) or closes (false) a portal, like a door: nothing is seen through a closed one.
    /// Constant time, no allocation.
    ///
    /// # Errors
    /// [`SceneCellsError::UnknownPortal`] if the graph has no such portal.
    pub fn set_open(&mut self, portal: PortalId, open: bool) -> Result<(), SceneCellsError> {
        let known = self.doors.set_open(portal, open);
        self.changed(known, portal)
    }

    /// Tests whether a portal is open, whatever its passage (the directions in which it can be seen through).
    /// `false` for an unknown portal.
    pub fn is_open(&self, portal: PortalId) -> bool {
        self.doors.is_open(portal)
    }

    /// Sets the directions in which a portal can be seen through while it is open. A closed portal stays
    /// closed. Constant time, no allocation.
    ///
    /// # Errors
    /// [`SceneCellsError::UnknownPortal`] if the graph has no such portal.
    pub fn set_passage(&mut self, portal: PortalId, passage: Passage) -> Result<(), SceneCellsError> {
        let known = self.doors.set_passage(portal, passage);
        self.changed(known, portal)
    }

    /// Adds a mirror on the boundary of a cell and returns its id. The vertices of `polygon` are in world
    /// space and run counter-clockwise as seen from within the cell, so that the normal points into the cell.
    /// Each frame that sees the mirror returns a [`Reflection`](super::mirror_reflections::Reflection). If
    /// the glass itself is to be drawn, add it to the scene as an object.
    ///
    /// # Errors
    /// [`SceneCellsError::UnknownCell`] if the graph has no such cell, [`SceneCellsError::NoPlane`] if
    /// `polygon` has no area.
    pub fn add_mirror(&mut self, cell: CellId, polygon: &ConvexPolygon) -> Result<MirrorId, SceneCellsError> {
        let head = self.first_mirror.get_mut(cell.index()).ok_or(SceneCellsError::UnknownCell(cell))?;
        let plane = polygon.plane().ok_or(SceneCellsError::NoPlane)?;
        let id = self.mirrors.len() as u32;
        self.mirrors.push(Mirror {
            outline: Outline::new(polygon.vertices(), plane.normal, self.tolerance, 0.0),
            vertices: polygon.vertices().to_vec(),
            next: core::mem::replace(head, id),
            uncovered: true,
        });
        self.stamp = Stamp::new();
        Ok(MirrorId(id))
    }

    /// Sets whether a mirror reflects: if `uncovered` is true, it does; if false, it yields no reflections. A
    /// new mirror reflects. Constant time, no allocation.
    ///
    /// # Errors
    /// [`SceneCellsError::UnknownMirror`] if no such mirror was added.
    pub fn set_mirror(&mut self, mirror: MirrorId, uncovered: bool) -> Result<(), SceneCellsError> {
        let found = self.mirrors.get_mut(mirror.0 as usize).ok_or(SceneCellsError::UnknownMirror(mirror))?;
        found.uncovered = uncovered;
        self.stamp = Stamp::new();
        Ok(())
    }

    /// Tests whether the cells of each object are those of `scene` as it is now, so that
    /// [`sync`](Self::sync) has nothing to do. Constant time. Views on several threads that share cells
    /// behind a lock then lock the cells for writing only where they must.
    pub(crate) fn is_synced(&self, scene: &Scene) -> bool {
        self.cursor.is_current(scene)
    }

    /// Updates the cells of each object by the changes of the scene since the last call, in time proportional
    /// to the number of changes times the logarithm of the number of cells. The first call, a call with
    /// another scene, and a call after more changes than the scene lists inspect every object. Allocates only
    /// for new objects, and for objects in more cells than ever before.
    pub fn sync(&mut self, scene: &Scene) {
        if self.is_synced(scene) {
            return;
        }
        let first = self.cursor == SceneCursor::START;
        match self.cursor.follow(scene) {
            Changes::Objects(ids) => {
                for &id in ids {
                    self.assign_cells(scene, id);
                }
            }
            Changes::Everything => {
                self.objects.iter_mut().for_each(|entry| entry.id = None);
                if first {
                    self.assign_listed_cells(scene);
                }
                for id in scene.ids() {
                    if self.objects.get(id.index()).is_none_or(|entry| entry.id.is_none()) {
                        self.assign_cells(scene, id);
                    }
                }
            }
        }
        self.stamp = Stamp::new();
    }

    /// Puts the objects that the graph lists (`CellGraph::set_objects`) into the listed cells. Listed objects
    /// that are not in the scene are skipped.
    fn assign_listed_cells(&mut self, scene: &Scene) {
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

    fn assign_cells(&mut self, scene: &Scene, id: ObjectId) {
        if self.objects.len() <= id.index() {
            self.objects.resize_with(scene.index_limit().max(id.index() + 1), Entry::default);
        }
        let entry = &mut self.objects[id.index()];
        let Ok(bounds) = scene.bounds(id) else {
            // The object was removed. Another object may have its index already; the entry of that object is
            // kept.
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

    /// Returns the cells that an object belongs to, ascending, as of the last [`sync`](Self::sync). Empty for
    /// an object in no cell and for an unknown object.
    pub fn cells_of(&self, id: ObjectId) -> &[CellId] {
        match self.objects.get(id.index()) {
            Some(entry) if entry.id == Some(id) => &entry.cells,
            _ => &[],
        }
    }

    /// Tests whether cell `from` may see cell `to` with all portals open: by the PVS if there is one,
    /// otherwise by whether any chain of portals joins the two cells. `true` where undecided; `false` if
    /// `from` or `to` is not a cell of the graph. Without a PVS, inspects each portal at most once and
    /// allocates.
    pub fn can_see(&self, from: CellId, to: CellId) -> bool {
        match &self.pvs {
            Some(pvs) => pvs.sees(from.into(), to.0),
            None => self.joined(from, to, |_, _| true),
        }
    }

    /// Tests whether cell `from` may see cell `to` through the portals that are open now: a chain of open
    /// portals must join the two cells, through cells that `from` can see. Conservative; never `true` where
    /// [`can_see`](Self::can_see) is `false`, and so `false` if `from` or `to` is not a cell of the graph.
    /// Inspects each portal at most once; allocates.
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

/// Converts a scene-relative box to world space. `origin` is the scene's origin. Returns the minimum and the
/// maximum corner, enlarged on all sides by `tolerance` (world units) and by the rounding of adding the
/// origin.
pub(super) fn in_world(bounds: &Aabb, origin: DVec3, tolerance: f64) -> (DVec3, DVec3) {
    let (min, max) = (bounds.min.as_dvec3() + origin, bounds.max.as_dvec3() + origin);
    let grown = DVec3::splat(tolerance) + (min.abs().max(max.abs())) * f64::EPSILON;
    (min - grown, max + grown)
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::pvs::Viewcell;

    /// Boxes hold the exact box and its tolerance. Each sum rounds by half of its last place, half to even,
    /// and so does each difference.
    #[test]
    fn boxes_in_the_world_hold_the_exact_box() {
        let far = 9_007_199_254_740_992.0;
        for (x, ends, tolerance, [low, high]) in [
            (-far, [-1.0, far], 0.0, [-far - 2.0, 0.0]),
            (far, [-far, 1.0], 0.0, [0.0, far + 2.0]),
            (0.0, [-1.0, 1.0], 0.25, [-1.25, 1.25]),
        ] {
            let bounds = Aabb::from_arrays([ends[0] as f32; 3], [ends[1] as f32; 3]);
            let (min, max) = in_world(&bounds, DVec3::splat(x), tolerance);
            assert!(min.cmple(DVec3::splat(low)).all(), "{min} of a box from {low}");
            assert!(max.cmpge(DVec3::splat(high)).all(), "{max} of a box up to {high}");
            let near = DVec3::splat(x.abs() * 1e-15 + 1e-12);
            let is_close = min.cmpge(low - near).all() && max.cmple(high + near).all();
            assert!(is_close, "{min} to {max} is close to {low} and {high}");
        }
    }

    /// Two rooms that reach 1.5 across the plane of the door between them.
    fn rooms(tolerance: f64) -> Result<SceneCells, SceneCellsError> {
        let door = [[4.0, 1.0, -1.0], [4.0, 3.0, -1.0], [4.0, 3.0, 1.0], [4.0, 1.0, 1.0]];
        let door = ConvexPolygon::new(door.map(DVec3::from)).unwrap();
        let graph = CellGraph::new(2, [(door, [CellId(0), CellId(1)])]).unwrap();
        let room = |x: f64| Viewcell::from_box(DVec3::new(x - 1.5, 0.0, -2.0), DVec3::new(x + 5.5, 4.0, 2.0));
        SceneCells::new(graph, Viewcells::new([room(0.0), room(4.0)]), tolerance)
    }

    /// The tolerance is that of volumes, portals, mirrors and objects. Half of it would not do.
    #[test]
    fn all_of_the_cells_have_their_tolerance() {
        for tolerance in [-1.0, f64::INFINITY, f64::NEG_INFINITY] {
            let is_refused = matches!(rooms(tolerance), Err(SceneCellsError::Tolerance(t)) if t == tolerance);
            assert!(is_refused, "a tolerance of {tolerance}");
        }
        assert!(matches!(rooms(f64::NAN), Err(SceneCellsError::Tolerance(_))), "a tolerance of NaN");
        // The corners of the door, 2.8 apart, may be off by the tolerance, so that its plane tilts by 2.8
        // tolerances. Points of a room, up to 11.5 from the door, may then be off by 34.5 tolerances: 2.07,
        // which is more than the 1.5 by which both rooms reach across the plane, and half of it is less.
        assert!(rooms(0.06).is_ok(), "rooms that reach across by less than the tolerance allows");
        let is_refused = matches!(rooms(0.03), Err(SceneCellsError::Graph(_)));
        assert!(is_refused, "rooms that reach across by more than the tolerance allows");
        let mut cells = rooms(0.1).unwrap();
        let mirror = cells.graph.portals()[0].polygon().clone();
        cells.add_mirror(CellId(0), &mirror).unwrap();
        assert!(cells.outlines[0].error >= 0.1, "error of the door");
        assert!(cells.mirrors[0].outline.error >= 0.1, "error of the mirror");
        assert_eq!(cells.tolerance, 0.1, "tolerance of starting cells");
        let mut scene = Scene::new();
        let add = |scene: &mut Scene, x| scene.insert(Aabb::from_arrays([x, 1.0, 0.0], [9.9, 2.0, 1.0]));
        let [near, far] = [9.58, 9.62].map(|x| add(&mut scene, x));
        cells.sync(&scene);
        assert_eq!(cells.cells_of(near), [CellId(1)], "cells of an object within the tolerance");
        assert_eq!(cells.cells_of(far), [], "cells of an object beyond it");
        let added = add(&mut scene, 1.0);
        cells.sync(&scene);
        assert_eq!(cells.cells_of(added), [CellId(0), CellId(1)], "cells of an object that was added later");
    }
}
