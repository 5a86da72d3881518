//! `ViewcellMatrix`: which viewcells see which, computed ahead.

use super::{Reach, SightCells};
use crate::bake::fill_rows;
use crate::bits::Bits;
use crate::cells::CellGraph;
use crate::pvs::{Pvs, PvsTargets, ViewcellId, Viewcells};
use crate::stamp::Stamp;
use crate::{Aabb, RegionCuller, Scene, VisibleSet};
use alloc::vec::Vec;
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
}

/// The openings between the viewcells, and the distance in metres by which viewcells and portals may be
/// misplaced.
#[derive(Clone, Debug)]
struct Portals {
    tolerance: f64,
    /// Indexed by viewcell: its neighbours, each with the corners of the box around the portal, widened by
    /// the tolerance.
    neighbours: Vec<Vec<(u32, [DVec3; 2])>>,
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
        Self { viewcells, rows: bits, portals: None, cells: Vec::new(), stamp: Stamp::new() }
    }

    /// Makes the matrix of the cells of a building, from the volumes of the cells in world space and the PVS
    /// that was computed of their graph. Outside the cells all is solid: no part of a mover is seen there,
    /// and no eye is there. Movers go from cell to cell through portals. Doors count as open. Portals and
    /// volumes may be misplaced by `tolerance` metres; NaN and less than 0 count as 0. A bake with a
    /// clearance leaves out lines of sight nearer than that to a portal's edge; then they are left out here
    /// too.
    ///
    /// `None` unless the targets of the PVS are cells, it names the graph as its [source](Pvs::source), and
    /// there are as many viewcells as cells.
    pub fn of_portals(graph: &CellGraph, viewcells: Viewcells, pvs: &Pvs, tolerance: f64) -> Option<Self> {
        let count = graph.cell_count();
        let counts = [viewcells.cells().len(), pvs.viewcell_count(), pvs.target_count()];
        let is_of_graph = pvs.targets() == PvsTargets::Cells && pvs.source() == Some(graph.version());
        if !is_of_graph || counts != [count; 3] {
            return None;
        }
        let (tolerance, mut words) = (tolerance.max(0.0), Vec::new());
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
            let low = vertices().fold(DVec3::INFINITY, DVec3::min) - tolerance;
            let high = vertices().fold(DVec3::NEG_INFINITY, DVec3::max) + tolerance;
            let [a, b] = portal.cells();
            neighbours[a.index()].push((b.0, [low, high]));
            neighbours[b.index()].push((a.0, [low, high]));
        }
        Some(Self {
            viewcells,
            rows,
            portals: Some(Portals { tolerance, neighbours }),
            cells: Vec::new(),
            stamp: Stamp::new(),
        })
    }

    /// Makes the matrix of a scene: for each viewcell, a conservative culler tests the boxes of all viewcells
    /// as objects. Uses all threads with the feature `rayon`. The occluders of the scene must not move
    /// afterwards.
    ///
    /// A viewcell that a wall cuts sees both sides of the wall, so fit viewcells to rooms where possible, or
    /// make them small.
    pub fn of_scene<C: RegionCuller + Default>(scene: &Scene, viewcells: Viewcells) -> Self {
        let mut scene = scene.clone();
        let origin = scene.origin();
        let cells = viewcells.cells();
        let ids = scene.insert_batch(cells.iter().map(|cell| Aabb::from_world(cell.min, cell.max, origin)));
        let mut rows = alloc::vec![Bits::new(cells.len()); cells.len()];
        fill_rows(&mut rows, |culler: &mut C, index, row| {
            let mut visible = VisibleSet::new();
            culler.cull(&scene, &cells[index], &mut visible);
            ids.iter().enumerate().for_each(|(other, &id)| row.set(other, visible.contains(&scene, id)));
        });
        Self { viewcells, rows, portals: None, cells: Vec::new(), stamp: Stamp::new() }
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
        self.viewcells.for_each_touching(body_low, body_high, |cell| cells.push(cell.0));
        let mut next = start;
        while let Some(&cell) = cells.get(next) {
            for (other, [portal_low, portal_high]) in &portals.neighbours[cell as usize] {
                let is_met = portal_low.cmple(high).all() && low.cmple(*portal_high).all();
                if is_met && !cells[start..].contains(other) {
                    cells.push(*other);
                }
            }
            next += 1;
        }
        next > start
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
