//! `ViewcellMatrix`: which viewcells see which, computed ahead.

use super::{Reach, SightCells};
use crate::bake::fill_rows;
use crate::bits::Bits;
use crate::cells::{CellGraph, CellGraphError};
use crate::pvs::{Pvs, PvsTargets, ViewcellId, Viewcells};
use crate::stamp::Stamp;
use crate::{Aabb, ObjectId, RegionCuller, Scene, VisibleSet};
use alloc::vec::Vec;
use core::fmt;
use glam::DVec3;

/// Which viewcells see which: one bit for each ordered pair, computed ahead for a level that does not change.
/// Based on the cell-to-cell visibility of S. Teller and C. Sequin, "Visibility Preprocessing for Interactive
/// Walkthroughs", 1991.
///
/// A mover whose [reach](super::Reach) is not wholly in viewcells sees all others and is seen by all. Only in
/// a matrix made [of portals](Self::of_portals) the space outside all viewcells is solid instead.
#[derive(Clone, Debug)]
pub struct ViewcellMatrix {
    stamp: Stamp,
    viewcells: Viewcells,
    rows: Vec<Bits>,
    /// `None` if the space outside the viewcells need not be solid.
    portals: Option<Portals>,
    /// Scratch: the cells of the mover that is being looked up.
    cells: Vec<u32>,
    /// Scratch: the cells that were reached through portals. Empty between two calls.
    reached: Bits,
}

/// The openings between the viewcells.
#[derive(Clone, Debug)]
struct Portals {
    /// Distance in metres that viewcells may be misplaced by, beside their own misplacement.
    tolerance: f64,
    /// By viewcell, its neighbours, each with the corners of the box around the portal, widened by all that
    /// the portal may be misplaced by.
    neighbours: Vec<Vec<(u32, [DVec3; 2])>>,
}

/// Reason why [`ViewcellMatrix::of_portals`] fails.
#[derive(Clone, Copy, PartialEq, Debug)]
#[non_exhaustive]
pub enum OfPortalsError {
    /// The PVS is not one of the cells of the graph: its targets are not cells, it does not name the graph as
    /// its source, or its counts are others.
    Pvs,
    /// Viewcell `i` is not the volume of cell `i`, as [`CellGraph::validate_bodies`] says.
    Viewcells(CellGraphError),
}

impl fmt::Display for OfPortalsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Pvs => write!(f, "the set is not of these cells and portals"),
            Self::Viewcells(error) => write!(f, "the viewcells are not those of the cells: {error}"),
        }
    }
}

impl core::error::Error for OfPortalsError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            Self::Pvs => None,
            Self::Viewcells(error) => Some(error),
        }
    }
}

impl ViewcellMatrix {
    /// Makes the matrix from rows: row `i` lists, in any order, the viewcells of which some point may be seen
    /// from some point of viewcell `i`. Numbers without a viewcell are ignored. A viewcell without a row sees
    /// all viewcells.
    pub fn new<R: AsRef<[u32]>>(viewcells: Viewcells, rows: &[R]) -> Self {
        let count = viewcells.cells().len();
        let all = Bits::from(alloc::vec![u64::MAX; count.div_ceil(64)]);
        let mut bits = alloc::vec![all; count];
        for (bits, row) in bits.iter_mut().zip(rows) {
            bits.clear();
            row.as_ref().iter().for_each(|&cell| _ = bits.insert(cell as usize));
        }
        Self {
            viewcells,
            rows: bits,
            portals: None,
            cells: Vec::new(),
            reached: Bits::default(),
            stamp: Stamp::new(),
        }
    }

    /// Makes the matrix of the cells of a building, from the volumes of the cells in world space, viewcell
    /// `i` for cell `i`, and the PVS that was computed of their graph. Outside the cells all is solid: no
    /// part of a mover is seen there, and no eye is there. Only the space around a
    /// [divided box](Viewcells::of_divided_box) is not: a mover that may get out of the box through a cell at
    /// its side sees and is seen by all. Movers go from cell to cell through portals. Doors count as open.
    /// Portals and volumes may be misplaced by `tolerance` metres, beside the
    /// [misplacement](Viewcells::misplacement) of the viewcells; NaN and less than 0 count as 0. Lines that a
    /// bake has left out as passing within its clearance of a portal's edge are left out here.
    ///
    /// # Errors
    /// [`OfPortalsError::Pvs`] unless the targets of the PVS are the cells and it names the graph as its
    /// [source](Pvs::source). [`OfPortalsError::Viewcells`] unless there is a viewcell for each cell, and
    /// each portal lies in a face of the viewcells of both its cells, up to what they may be misplaced by.
    pub fn of_portals(
        graph: &CellGraph,
        viewcells: Viewcells,
        pvs: &Pvs,
        tolerance: f64,
    ) -> Result<Self, OfPortalsError> {
        let count = graph.cell_count();
        let is_of_graph = pvs.targets() == PvsTargets::Cells && pvs.source() == Some(graph.version());
        if !is_of_graph || [pvs.viewcell_count(), pvs.target_count()] != [count; 2] {
            return Err(OfPortalsError::Pvs);
        }
        let tolerance = tolerance.max(0.0);
        let misplacement = tolerance + viewcells.misplacement();
        graph.validate_bodies(viewcells.cells(), misplacement).map_err(OfPortalsError::Viewcells)?;
        let mut words = Vec::new();
        let rows = (0..count as u32).map(|cell| {
            pvs.write_bits(ViewcellId(cell), &mut words);
            let mut row = Bits::from(words.clone());
            row.insert(cell as usize);
            row
        });
        let rows = rows.collect();
        let mut neighbours = alloc::vec![Vec::new(); count];
        for portal in graph.portals() {
            let vertices = || portal.polygon().vertices().iter().copied();
            let low = vertices().fold(DVec3::INFINITY, DVec3::min) - misplacement;
            let high = vertices().fold(DVec3::NEG_INFINITY, DVec3::max) + misplacement;
            let [a, b] = portal.cells();
            neighbours[a.index()].push((b.0, [low, high]));
            neighbours[b.index()].push((a.0, [low, high]));
        }
        Ok(Self {
            viewcells,
            rows,
            portals: Some(Portals { tolerance, neighbours }),
            cells: Vec::new(),
            reached: Bits::default(),
            stamp: Stamp::new(),
        })
    }

    /// Makes the matrix of a scene: for each viewcell, a conservative culler tests the boxes of all viewcells
    /// as objects. Uses all threads with the feature `rayon`. The occluders of the scene must not move
    /// afterwards. An occluder that is not on all layers hides nothing, since an observer whose view leaves
    /// out its layers sees through it. If no observer does, pass a copy of the scene with these occluders on
    /// all layers.
    ///
    /// A viewcell that a wall cuts sees both sides of the wall, so fit viewcells to rooms where possible, or
    /// make them small.
    pub fn of_scene<C: RegionCuller + Default>(scene: &Scene, viewcells: Viewcells) -> Self {
        let mut scene = scene.clone();
        let is_layered = |&id: &ObjectId| scene.object(id).is_ok_and(|object| object.layers != u32::MAX);
        let layered: Vec<ObjectId> = scene.ids().filter(is_layered).collect();
        layered.into_iter().for_each(|id| _ = scene.set_occluder(id, false));
        let origin = scene.origin();
        let cells = viewcells.cells();
        let ids = scene.insert_batch(cells.iter().map(|cell| Aabb::from_world(cell.min, cell.max, origin)));
        let mut rows = alloc::vec![Bits::new(cells.len()); cells.len()];
        fill_rows(&mut rows, |culler: &mut C, index, row| {
            let mut visible = VisibleSet::new();
            culler.cull(&scene, &cells[index], &mut visible);
            ids.iter().enumerate().for_each(|(other, &id)| row.set(other, visible.contains(&scene, id)));
        });
        Self {
            viewcells,
            rows,
            portals: None,
            cells: Vec::new(),
            reached: Bits::default(),
            stamp: Stamp::new(),
        }
    }
}

impl SightCells for ViewcellMatrix {
    fn cell_count(&self) -> usize {
        self.rows.len()
    }

    fn stamp(&self) -> Stamp {
        self.stamp
    }

    fn cells_of(&mut self, reach: &Reach, cells: &mut Vec<u32>) -> bool {
        let start = cells.len();
        let [low, high] = reach.bounds();
        let Some(portals) = &self.portals else {
            return self.viewcells.cover(low, high, cells);
        };
        let [body_low, body_high] = Reach { margin: portals.tolerance, ..*reach }.bounds();
        let reached = &mut self.reached;
        reached.grow(self.rows.len());
        self.viewcells.for_each_touching(body_low, body_high, |cell| {
            reached.insert(cell.index());
            cells.push(cell.0);
        });
        let mut next = start;
        while let Some(&cell) = cells.get(next) {
            for (other, [portal_low, portal_high]) in &portals.neighbours[cell as usize] {
                let is_met = portal_low.cmple(high).all() && low.cmple(*portal_high).all();
                if is_met && self.reached.insert(*other as usize) {
                    cells.push(*other);
                }
            }
            next += 1;
        }
        cells[start..].iter().for_each(|&cell| _ = self.reached.remove(cell as usize));
        let leaves = |&cell: &u32| self.viewcells.is_left_through(ViewcellId(cell), low, high);
        next > start && !cells[start..].iter().any(leaves)
    }

    fn seen_from(&mut self, reach: &Reach, seen: &mut Bits) -> bool {
        let mut cells = core::mem::take(&mut self.cells);
        cells.clear();
        let is_known = self.cells_of(reach, &mut cells);
        cells.iter().for_each(|&cell| seen.unite(&self.rows[cell as usize]));
        self.cells = cells;
        is_known
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cells::CellId;
    use crate::geometry::ConvexPolygon;
    use crate::pvs::Viewcell;

    fn room(x: f64) -> Viewcell {
        Viewcell::from_box(DVec3::new(x, 0.0, 0.0), DVec3::new(x + 4.0, 4.0, 4.0))
    }

    /// Rooms in a row of 4 m each, with doors of 2 m between neighbours. The doors are `off` metres beyond
    /// the walls.
    fn row(count: u32, off: f64) -> CellGraph {
        let door = |x: f64| {
            let corners = [[1.0, 1.0], [3.0, 1.0], [3.0, 3.0], [1.0, 3.0]];
            ConvexPolygon::new(corners.map(|[y, z]| DVec3::new(x, y, z))).unwrap()
        };
        let doors = (1..count).map(|i| (door(4.0 * f64::from(i) + off), [CellId(i - 1), CellId(i)]));
        CellGraph::new(count as usize, doors).unwrap()
    }

    fn rooms(count: u32) -> Viewcells {
        Viewcells::new((0..count).map(|i| room(4.0 * f64::from(i))))
    }

    fn set(targets: PvsTargets, source: u64, viewcells: u32, count: usize) -> Pvs {
        let rows: Vec<Vec<u32>> =
            (0..viewcells).map(|cell| alloc::vec![cell.min(count as u32 - 1)]).collect();
        Pvs::new(targets, count, &rows, |_| []).unwrap().with_source(source)
    }

    #[test]
    fn sets_of_something_else_are_refused() {
        let graph = row(3, 0.0);
        let of = |pvs: Pvs| ViewcellMatrix::of_portals(&graph, rooms(3), &pvs, 1e-6).map(|_| ());
        assert_eq!(of(set(PvsTargets::Cells, graph.version(), 3, 3)), Ok(()), "the set of the graph");
        for (what, pvs) in [
            ("of objects", set(PvsTargets::Objects, graph.version(), 3, 3)),
            ("of another graph", set(PvsTargets::Cells, graph.version() ^ 1, 3, 3)),
            ("of fewer viewcells", set(PvsTargets::Cells, graph.version(), 2, 3)),
            ("of more cells", set(PvsTargets::Cells, graph.version(), 3, 4)),
        ] {
            assert_eq!(of(pvs), Err(OfPortalsError::Pvs), "a set {what}");
        }
    }

    /// Doors and volumes may be off by the tolerance: what a mover is near to counts as reached.
    #[test]
    fn movers_reach_what_is_within_the_tolerance() {
        let matrix = |off: f64, tolerance: f64| {
            let graph = row(3, off);
            let pvs = set(PvsTargets::Cells, graph.version(), 3, 3);
            ViewcellMatrix::of_portals(&graph, rooms(3), &pvs, tolerance)
        };
        assert!(matrix(0.45, 0.5).is_ok() && matrix(0.55, 0.5).is_err(), "doors beside their walls");
        assert!(matrix(0.0, f64::NAN).is_ok() && matrix(1e-9, f64::NAN).is_err(), "a tolerance of NaN");
        let mut own = matrix(0.0, 0.5).unwrap();
        let mut cells = |min: [f64; 3], max: [f64; 3], margin: f64| {
            let mut found = alloc::vec![7];
            let reach = Reach { margin, ..Reach::new(min.into(), max.into()) };
            let is_known = own.cells_of(&reach, &mut found);
            assert_eq!(found.remove(0), 7, "cells are appended");
            found.sort_unstable();
            (is_known, found)
        };
        assert_eq!(cells([1.0; 3], [2.0; 3], 0.0), (true, [0].to_vec()), "in the first room");
        assert_eq!(cells([1.0; 3], [3.45, 2.0, 2.0], 0.0), (true, [0].to_vec()), "0.55 m before the wall");
        // The volume of the next room may be half a metre nearer than it is said to be.
        assert_eq!(cells([1.0; 3], [3.55, 0.2, 2.0], 0.0).1, [0, 1], "0.45 m before the wall");
        // Doors are met with half a metre around them; what is beside them is not.
        assert_eq!(cells([1.0; 3], [2.0; 3], 1.45), (true, [0].to_vec()), "0.55 m before a door");
        assert_eq!(cells([1.0; 3], [2.0; 3], 1.55), (true, [0, 1].to_vec()), "0.45 m before a door");
        let mut beside = |low: f64| cells([1.0, low, 1.5], [2.0, low + 0.1, 2.0], 2.2).1;
        assert_eq!(beside(3.4), [0, 1], "beside a door, but with the margin before it");
        assert_eq!(cells([3.0, 3.6, 1.5], [3.2, 3.7, 2.0], 0.5).1, [0, 1], "0.4 m above a door");
        assert_eq!(cells([3.0, 3.9, 1.5], [3.2, 3.95, 2.0], 0.25).1, [0], "0.65 m above a door");
        assert_eq!(cells([3.0, 0.1, 1.5], [3.2, 0.15, 2.0], 0.2).1, [0], "0.65 m below a door");
        assert_eq!(cells([5.0, 1.5, 1.5], [6.0, 2.0, 2.0], 6.0).1, [0, 1, 2], "through two doors");
        assert_eq!(cells([6.0, 1.5, 1.5], [7.0, 2.0, 2.0], 0.2).1, [1], "between two doors");
        assert_eq!(cells([9.0; 3], [9.5; 3], 0.0), (false, [].to_vec()), "in no room");
    }

    /// Whoever may get out of a divided box through a cell at its side may be anywhere.
    #[test]
    fn movers_that_leave_the_divided_box_are_unknown() {
        let graph = row(2, 0.0);
        let pvs = set(PvsTargets::Cells, graph.version(), 2, 2);
        let cells =
            Viewcells::of_divided_box([room(0.0), room(4.0)], DVec3::ZERO, DVec3::new(8.0, 4.0, 4.0), 0.0);
        let mut matrix = ViewcellMatrix::of_portals(&graph, cells, &pvs, 0.0).unwrap();
        let mut is_known = |margin: f64| {
            let reach = Reach { margin, ..Reach::new(DVec3::splat(1.5), DVec3::splat(2.5)) };
            matrix.cells_of(&reach, &mut Vec::new())
        };
        assert!(is_known(1.0) && !is_known(2.0), "a metre within the box, and beyond its side");
    }
}
