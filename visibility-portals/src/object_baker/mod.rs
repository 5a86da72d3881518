//! The baker of cell-to-object visibility: which objects can be seen from each cell.
//!
//! This work is based on: Seth Teller and Carlo Sequin, "Visibility Preprocessing for Interactive
//! Walkthroughs", 1991, where an object of a cell is kept if it meets the bundle of lines through the portals
//! that lead to the cell. In space that bundle is bounded by the planes that
//! [separate](crate::separating_planes) the first portal from the last (Teller and Hanrahan, "Global
//! Visibility Algorithms for Illumination Computations", 1993). An object is hidden from a cell only if its
//! box lies outside one of those planes at the end of every chain of portals to every cell that the object is
//! in. Most objects are hidden already by the planes of the first and the last portal alone: see
//! [`object_chains`].
//!
//! Cell-to-cell visibility must be baked first. Chains pass only cells that are seen and only pairs of
//! portals that a line may pass, and end where no object that is not yet seen can lie inside the planes.

mod object_chains;

use crate::bake_settings::{BakeError, BakerSettings, METHODS, prepare};
use crate::cell_baker::Outcome;
use crate::cell_matrix::neighbours;
use crate::directed_portals::DirectedPortals;
use alloc::vec::Vec;
use object_chains::{Chains, Input, SeenObjects, Targets};
use visibility_core::bake::Baker;
use visibility_core::binary_format::{Fingerprint, FormatError, Reader, Writer};
use visibility_core::glam::DVec3;
use visibility_core::{
    ObjectId,
    cells::{CellGraph, CellId},
    pvs::{Pvs, PvsError, PvsTargets},
};

/// Result of a bake of cell-to-object visibility: the objects seen from each cell, and how complete the
/// search was. Conservative.
#[derive(Clone, PartialEq, Eq, Debug)]
#[non_exhaustive]
pub struct ObjectOutcome {
    /// By index of the cell looked from: the [indices](ObjectId::index) of the objects seen from the cell,
    /// ascending.
    pub rows: Vec<Vec<u32>>,
    /// Cells whose search reached the limit of steps or was not carried out, ascending. All objects not
    /// proven hidden from such a cell count as visible: after a search that was not carried out, all
    /// objects in all cells that the cell sees.
    pub fallbacks: Vec<CellId>,
    /// By index of the cell looked from: the number of portal chains inspected.
    pub steps: Vec<u64>,
    /// Whether the search from every cell was carried out. `false` if the bake was finished early.
    pub complete: bool,
}

impl ObjectOutcome {
    /// Returns the mean number of objects that a cell sees. 0 without cells.
    pub fn mean_visible(&self) -> f64 {
        let sum: usize = self.rows.iter().map(Vec::len).sum();
        if self.rows.is_empty() { 0.0 } else { sum as f64 / self.rows.len() as f64 }
    }

    /// Converts the rows to a compressed PVS whose viewcells are the cells and whose targets are object
    /// indices below `objects`. Rows of cells that share a portal in `graph` may be stored as differences
    /// from each other.
    ///
    /// # Errors
    /// [`PvsError::Target`] if an object index is not below `objects`; [`PvsError::Size`] if the PVS
    /// exceeds its storage limits.
    pub fn to_pvs(&self, graph: &CellGraph, objects: usize) -> Result<Pvs, PvsError> {
        Pvs::new(PvsTargets::Objects, objects, &self.rows, |viewcell| neighbours(graph, viewcell))
    }
}

/// Computes which objects each cell sees, as a [`Baker`] for a [`Bake`](visibility_core::bake::Bake).
///
/// The items of the bake are the cells; its steps are the portal chains inspected. The objects are those that
/// the graph [lists](CellGraph::set_objects) in its cells.
///
/// ```
/// use visibility_core::{bake::Bake, cells::CellId, glam::DVec3, Aabb, Scene};
/// use visibility_portals::{CellBaker, ObjectBaker, BakerSettings, prt};
/// // Three rooms in a row with two doors; two objects in the last, one of them beside the door's wall.
/// let mut graph = prt::read("PRT1\n3\n2\n\
///     4 0 1 (4 0 0) (4 1 0) (4 1 2) (4 0 2)\n\
///     4 1 2 (8 0 0) (8 1 0) (8 1 2) (8 0 2)\n")?.graph;
/// let boxes = [[9.0, 0.0, 0.0], [9.0, 8.0, 0.0]].map(DVec3::from);
/// let mut scene = Scene::new();
/// let ids = boxes.map(|min| scene.insert(Aabb::from_world(min, min + 0.5, DVec3::ZERO)));
/// graph.set_objects(ids.map(|id| (CellId(2), id)))?;
/// let cells = Bake::new(CellBaker::new(&graph, BakerSettings::default())?).run();
/// let bounds = |id: visibility_core::ObjectId| boxes.get(id.index()).map(|&min| [min, min + 0.5]);
/// let baker = ObjectBaker::new(&graph, &cells, bounds, BakerSettings::default())?;
/// // From the first room, lines through both doors reach the first object, and never the second.
/// assert_eq!(Bake::new(baker).run().rows, [vec![0], vec![0, 1], vec![0, 1]]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct ObjectBaker<'a> {
    cells: &'a Outcome,
    portals: DirectedPortals,
    targets: Targets,
    settings: BakerSettings,
    /// By cell index: the result of the search from the cell, that is the objects seen from there. `None`
    /// for a cell whose search was not carried out.
    done: Vec<Option<SeenObjects>>,
}

impl<'a> ObjectBaker<'a> {
    /// Prepares the portals, which must be [wound](CellGraph::turn_portals) towards their second cells.
    /// `cells` is the bake of the cells of `graph` with the same clearance. `bounds` returns the minimum and
    /// the maximum corner of an object's box in world space. An object without valid bounds (`None`, NaN, or
    /// a minimum above the maximum) counts as visible wherever one of its cells is seen.
    ///
    /// # Errors
    /// As for [`CellBaker::new`](crate::CellBaker::new); [`BakeError::Cells`] if `cells` is of another graph
    /// or another clearance.
    pub fn new(
        graph: &CellGraph,
        cells: &'a Outcome,
        bounds: impl Fn(ObjectId) -> Option<[DVec3; 2]>,
        settings: BakerSettings,
    ) -> Result<Self, BakeError> {
        let portals = prepare(graph, &settings)?;
        let count = graph.cell_count();
        if cells.matrix.cell_count() != count || !cells.pairs.are_of(&portals) {
            return Err(BakeError::Cells);
        }
        let targets = Targets::new(graph, bounds);
        Ok(Self { cells, portals, targets, settings, done: alloc::vec![None; count] })
    }
}

impl Baker for ObjectBaker<'_> {
    type Scratch = Chains;
    type Found = SeenObjects;
    type Outcome = ObjectOutcome;

    const ROUND: usize = 16;
    const KIND: u32 = 1;

    fn item_count(&self) -> usize {
        self.done.len()
    }

    fn work(&self, cell: u32, chains: &mut Chains, _: &dyn Fn() -> bool) -> Option<SeenObjects> {
        let Outcome { matrix, pairs, .. } = self.cells;
        let input = Input { portals: &self.portals, matrix, pairs, targets: &self.targets };
        Some(chains.seen_from(CellId(cell), input, self.settings.steps_per_cell))
    }

    fn take_in(&mut self, cell: u32, found: SeenObjects) -> u64 {
        let steps = found.steps;
        self.done[cell as usize] = Some(found);
        steps
    }

    /// Builds the rows of the outcome. For a cell whose search was not carried out, all objects in all cells
    /// that it sees count as visible.
    fn finish(self, waiting: &[u32]) -> ObjectOutcome {
        let cells = self.done.len();
        let (mut rows, mut steps, mut fallbacks) = (Vec::with_capacity(cells), Vec::new(), Vec::new());
        for (cell, seen) in (0..).map(CellId).zip(self.done) {
            let seen = seen.unwrap_or_else(|| {
                let row = self.targets.in_cells(self.cells.matrix.seen_from(cell));
                SeenObjects { row, steps: 0, gave_up: true }
            });
            steps.push(seen.steps);
            rows.push(seen.row);
            fallbacks.extend(seen.gave_up.then_some(cell));
        }
        ObjectOutcome { rows, fallbacks, steps, complete: waiting.is_empty() }
    }

    fn fingerprint(&self) -> u64 {
        let Outcome { matrix, pairs, .. } = self.cells;
        let numbers = self.portals.numbers().chain(self.settings.numbers()).chain(matrix.words());
        let numbers = numbers.chain([pairs.fingerprint()]);
        let numbers = numbers.chain(self.targets.numbers());
        numbers.fold(Fingerprint::new().with(METHODS), Fingerprint::with_u64).value()
    }

    fn save(&self, state: &mut Writer) {
        for seen in &self.done {
            state.u32(match seen {
                None => 0,
                Some(SeenObjects { gave_up: false, .. }) => 1,
                Some(SeenObjects { gave_up: true, .. }) => 2,
            });
            if let Some(seen) = seen {
                state.u64(seen.steps);
                state.u32(seen.row.len() as u32);
                state.u32s(seen.row.iter().copied());
            }
        }
    }

    fn load(&mut self, state: &mut Reader<'_>) -> Result<(), FormatError> {
        let cells = (0..self.done.len() as u32).map(CellId);
        let known = self.targets.in_cells(cells.clone());
        for (cell, seen) in cells.zip(&mut self.done) {
            *seen = match state.u32()? {
                0 => None,
                how @ (1 | 2) => {
                    let (steps, count) = (state.u64()?, state.u32()? as usize);
                    let row = state.u32s(count)?;
                    if row.windows(2).any(|pair| pair[0] >= pair[1]) {
                        return Err(state.content_error("the objects that a cell sees are out of order"));
                    }
                    if row.iter().any(|object| known.binary_search(object).is_err()) {
                        return Err(state.content_error("a cell sees an unknown object"));
                    }
                    let own = self.targets.in_cells([cell].into_iter());
                    if own.iter().any(|object| row.binary_search(object).is_err()) {
                        return Err(state.content_error("a cell does not see an object that is in it"));
                    }
                    Some(SeenObjects { row, steps, gave_up: how == 2 })
                }
                _ => return Err(state.content_error("a cell is neither done nor waiting")),
            };
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::CellBaker;
    use visibility_core::bake::Bake;

    #[test]
    fn the_fingerprint_is_of_the_methods() {
        let map = "PRT1\n2\n1\n4 0 1 (0 0 0) (0 1 0) (0 1 1) (0 0 1)\n";
        let graph = crate::prt::read(map).unwrap().graph;
        let settings = BakerSettings::default();
        let cells = Bake::new(CellBaker::new(&graph, settings).unwrap()).run();
        let baker = ObjectBaker::new(&graph, &cells, |_| None, settings).unwrap();
        let numbers = baker.portals.numbers().chain(settings.numbers()).chain(cells.matrix.words());
        let numbers = numbers.chain([cells.pairs.fingerprint()]).chain(baker.targets.numbers());
        let numbers: Vec<u64> = numbers.collect();
        let of = |hash: Fingerprint| numbers.iter().fold(hash, |hash, &n| hash.with_u64(n)).value();
        assert_eq!(baker.fingerprint(), of(Fingerprint::new().with(METHODS)), "of these methods");
        assert_ne!(baker.fingerprint(), of(Fingerprint::new().with(METHODS + 1)), "of other methods");
    }

    #[test]
    fn bakes_of_cells_of_another_graph_are_refused() {
        let map = "PRT1\n2\n1\n4 0 1 (0 0 0) (0 1 0) (0 1 1) (0 0 1)\n";
        let graph = crate::prt::read(map).unwrap().graph;
        let settings = BakerSettings::default();
        let cells = Bake::new(CellBaker::new(&graph, settings).unwrap()).run();
        let made = |cells: &Outcome, settings: BakerSettings| {
            ObjectBaker::new(&graph, cells, |_| None, settings).map(|baker| baker.done.len())
        };
        assert_eq!(made(&cells, settings), Ok(2), "cells of this graph");
        assert_eq!(made(&cells, settings.with_clearance(1e-3)), Err(BakeError::Cells), "another clearance");
        let other = Outcome { matrix: crate::CellMatrix::new(1), ..cells };
        assert_eq!(made(&other, settings), Err(BakeError::Cells), "a matrix of another number of cells");
    }
}
