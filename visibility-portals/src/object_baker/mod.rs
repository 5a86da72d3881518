//! The baker of cell-to-object visibility: which objects can be seen from each cell.
//!
//! This work is based on: Seth Teller and Carlo Sequin, "Visibility Preprocessing for Interactive
//! Walkthroughs", 1991, where objects of a cell are kept if they meet the bundle of lines through the portals
//! that lead there. In space that bundle is bounded by the planes that [separate](crate::separating_planes)
//! the first portal from the last (Teller and Hanrahan, "Global Visibility Algorithms for Illumination
//! Computations", 1993). An object is hidden from a cell only if, at the end of every chain of portals to
//! every cell that it is in, its box lies beyond one of those planes.
//!
//! Cell-to-cell visibility must be baked before: chains pass only through cells that are seen, and end where
//! no object that is not yet seen can lie between the planes.

mod object_chains;

use crate::bake_settings::{BakeError, Settings, prepare};
use crate::cell_matrix::CellMatrix;
use crate::cell_matrix::neighbours;
use crate::directed_portals::DirectedPortals;
use alloc::vec::Vec;
use object_chains::{Chains, Targets};
use visibility_core::bake::Baker;
use visibility_core::envelope::{EnvelopeError, Fingerprint, Reader, Writer};
use visibility_core::glam::DVec3;
use visibility_core::{
    ObjectId,
    cells::{CellGraph, CellId},
    pvs::{Pvs, PvsError, PvsTargets},
};

/// Result of a bake of cell-to-object visibility.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct ObjectOutcome {
    /// By cell: the [indices](ObjectId::index) of the objects seen from it, ascending.
    pub rows: Vec<Vec<u32>>,
    /// Cells that reached the limit of steps or were not looked from, ascending. They see all objects in all
    /// cells that they see.
    pub fallbacks: Vec<CellId>,
    /// By cell: the number of chains of portals that were looked at.
    pub steps: Vec<u64>,
    /// Whether all cells were looked from.
    pub complete: bool,
}

impl ObjectOutcome {
    /// The mean number of objects that a cell sees. 0 without cells.
    pub fn mean_visible(&self) -> f64 {
        let sum: usize = self.rows.iter().map(Vec::len).sum();
        if self.rows.is_empty() { 0.0 } else { sum as f64 / self.rows.len() as f64 }
    }

    /// The same as a compressed PVS, with the cells as viewcells and the indices of objects as targets. Rows
    /// of cells that share a portal in `graph` are stored by their differences.
    ///
    /// # Errors
    /// [`PvsError::Target`] if an index is not below `objects`; [`PvsError::TooLarge`].
    pub fn to_pvs(&self, graph: &CellGraph, objects: usize) -> Result<Pvs, PvsError> {
        Pvs::new(PvsTargets::Objects, objects, &self.rows, |viewcell| neighbours(graph, viewcell))
    }
}

/// Computes which objects each cell sees, for a [`Bake`](visibility_core::bake::Bake).
///
/// Its items are the cells; its steps are the chains of portals looked at. The objects are those that the
/// graph [lists](CellGraph::set_objects) in its cells.
///
/// ```
/// use visibility_core::{bake::Bake, cells::CellId, glam::DVec3, Aabb, Scene};
/// use visibility_portals::{CellBaker, ObjectBaker, Settings, prt};
/// // Three rooms in a row with two doors; two objects in the last, one of them beside the door's wall.
/// let mut graph = prt::read("PRT1\n3\n2\n\
///     4 0 1 (4 0 0) (4 1 0) (4 1 2) (4 0 2)\n\
///     4 1 2 (8 0 0) (8 1 0) (8 1 2) (8 0 2)\n")?.graph;
/// let boxes = [[9.0, 0.0, 0.0], [9.0, 8.0, 0.0]].map(DVec3::from);
/// let mut scene = Scene::new();
/// let ids = boxes.map(|min| scene.insert(Aabb::from_world(min, min + 0.5, DVec3::ZERO)));
/// graph.set_objects(ids.map(|id| (CellId(2), id)))?;
/// let matrix = Bake::new(CellBaker::new(&graph, Settings::default())?).run().matrix;
/// let bounds = |id: visibility_core::ObjectId| boxes.get(id.index()).map(|&min| [min, min + 0.5]);
/// let baker = ObjectBaker::new(&graph, &matrix, bounds, Settings::default())?;
/// // From the first room, lines through both doors reach the first object, and never the second.
/// assert_eq!(Bake::new(baker).run().rows, [vec![0], vec![0, 1], vec![0, 1]]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct ObjectBaker<'a> {
    matrix: &'a CellMatrix,
    portals: DirectedPortals,
    targets: Targets,
    settings: Settings,
    /// By cell; `None` for a cell that was not looked from.
    done: Vec<Option<SeenObjects>>,
}

/// The objects seen from one cell.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct SeenObjects {
    /// Indices of objects, ascending. Empty if `gave_up`.
    row: Vec<u32>,
    steps: u64,
    /// Whether the limit of steps was reached.
    gave_up: bool,
}

impl<'a> ObjectBaker<'a> {
    /// Makes the portals ready. `bounds` gives the least and the greatest corner of the box of an object in
    /// world space. An object for which it gives `None`, or corners that are NaN or in the wrong order, is
    /// seen wherever one of its cells is.
    ///
    /// # Errors
    /// As [`CellBaker::new`](crate::CellBaker::new); [`BakeError::Cells`] if the matrix has another number of
    /// cells.
    pub fn new(
        graph: &CellGraph,
        matrix: &'a CellMatrix,
        bounds: impl Fn(ObjectId) -> Option<[DVec3; 2]>,
        settings: Settings,
    ) -> Result<Self, BakeError> {
        let portals = prepare(graph, &settings)?;
        let cells = graph.cell_count();
        if matrix.cell_count() != cells {
            return Err(BakeError::Cells { graph: cells, matrix: matrix.cell_count() });
        }
        let targets = Targets::new(graph, bounds);
        Ok(Self { matrix, portals, targets, settings, done: alloc::vec![None; cells] })
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

    fn work(&self, cell: u32, chains: &mut Chains) -> SeenObjects {
        let limit = self.settings.steps_per_cell;
        let (row, steps, gave_up) =
            chains.seen_from(CellId(cell), &self.portals, self.matrix, &self.targets, limit);
        SeenObjects { row, steps, gave_up }
    }

    fn take_in(&mut self, cell: u32, found: SeenObjects) -> u64 {
        let steps = found.steps;
        self.done[cell as usize] = Some(found);
        steps
    }

    /// Cells that were not looked from see all objects in the cells that they see.
    fn finish(self, waiting: &[u32]) -> ObjectOutcome {
        let cells = self.done.len();
        let (mut rows, mut steps, mut fallbacks) = (Vec::with_capacity(cells), Vec::new(), Vec::new());
        for (cell, seen) in (0..).map(CellId).zip(self.done) {
            let seen = seen.unwrap_or(SeenObjects { row: Vec::new(), steps: 0, gave_up: true });
            steps.push(seen.steps);
            if seen.gave_up {
                fallbacks.push(cell);
                rows.push(self.targets.in_cells(self.matrix.seen_from(cell)));
            } else {
                rows.push(seen.row);
            }
        }
        ObjectOutcome { rows, fallbacks, steps, complete: waiting.is_empty() }
    }

    fn fingerprint(&self) -> u64 {
        let matrix = (0..self.done.len()).flat_map(|cell| self.matrix.row(cell)).copied();
        let numbers = self.portals.numbers().chain(self.settings.numbers()).chain(matrix);
        numbers.chain(self.targets.numbers()).fold(Fingerprint::new(), Fingerprint::with_u64).value()
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

    fn load(&mut self, state: &mut Reader<'_>) -> Result<(), EnvelopeError> {
        for seen in &mut self.done {
            *seen = match state.u32()? {
                0 => None,
                how @ (1 | 2) => {
                    let (steps, count) = (state.u64()?, state.u32()? as usize);
                    let row = state.u32s(count)?;
                    if row.windows(2).any(|pair| pair[0] >= pair[1]) {
                        return Err(state.wrong("the objects that a cell sees are out of order"));
                    }
                    Some(SeenObjects { row, steps, gave_up: how == 2 })
                }
                _ => return Err(state.wrong("a cell is neither done nor waiting")),
            };
        }
        Ok(())
    }
}
