//! Which objects a cell sees: those in the cells that it sees that some line through a sequence of portals can reach.
//!
//! This work is based on: Seth Teller and Carlo Sequin, "Visibility Preprocessing for Interactive Walkthroughs", 1991, where objects of a
//! cell are kept if they meet the bundle of lines through the portals that lead there; in space that bundle is bounded by the planes that
//! [separate](crate::separators) the first portal from the last (Teller and Hanrahan, "Global Visibility Algorithms for Illumination
//! Computations", 1993). An object is hidden from a cell only if, on every way into every cell that it is in, its box lies beyond one of
//! those planes.
//!
//! The cells that see each other must be known: only portals between cells that are seen are gone through, and where no unseen object can
//! lie between the planes, a chain of portals ends.

mod chains;

use crate::bake::BakeError;
use crate::portals::Portals;
use crate::{CellMatrix, Progress, Settings};
use alloc::vec::Vec;
use chains::{Chains, Targets};
use visibility_core::glam::DVec3;
use visibility_core::{CellGraph, CellId, ObjectId, Pvs, PvsError, PvsTargets};

/// Cells done between two reports.
const ROUND: usize = 16;

/// Which objects are seen from each cell.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct ObjectOutcome {
    /// For each cell, the [indices](ObjectId::index) of the objects seen from it, ascending.
    pub rows: Vec<Vec<u32>>,
    /// Cells that see all objects in all cells that they see, since the limit of steps was reached or the bake was stopped; ascending.
    pub fallbacks: Vec<CellId>,
    /// Chains of portals looked at, by cell.
    pub steps: Vec<u64>,
    /// Whether the bake went to its end.
    pub complete: bool,
}

impl ObjectOutcome {
    /// How many objects a cell sees in the mean. 0 without cells.
    pub fn mean_visible(&self) -> f64 {
        let sum: usize = self.rows.iter().map(Vec::len).sum();
        if self.rows.is_empty() { 0.0 } else { sum as f64 / self.rows.len() as f64 }
    }

    /// The sets, compressed, with objects by their indices as targets; cells that share a portal are stored by how they differ.
    ///
    /// # Errors
    /// [`PvsError::Target`] if there is an object with an index that is not below `objects`, [`PvsError::TooLarge`].
    pub fn to_pvs(&self, graph: &CellGraph, objects: usize) -> Result<Pvs, PvsError> {
        Pvs::new(PvsTargets::Objects, objects, &self.rows, |cell| crate::matrix::neighbours(graph, cell))
    }
}

/// A bake of cell-to-object visibility: begun with [`new`](Self::new), moved on by [`advance`](Self::advance), ended by
/// [`finish`](Self::finish). The objects are those that the graph says are in its cells.
///
/// ```
/// use visibility_core::{Aabb, CellId, Scene, glam::DVec3};
/// use visibility_portals::{CellBake, ObjectBake, Settings, prt};
/// // Two rooms with a door between them in the plane x = 4; two objects in the second, one of them beside the door's wall.
/// let mut graph = prt::read("PRT1\n3\n2\n\
///     4 0 1 (4 0 0) (4 1 0) (4 1 2) (4 0 2)\n\
///     4 1 2 (8 0 0) (8 1 0) (8 1 2) (8 0 2)\n")?.graph;
/// let boxes = [[9.0, 0.0, 0.0], [9.0, 8.0, 0.0]].map(DVec3::from);
/// let mut scene = Scene::new();
/// let ids = boxes.map(|min| scene.insert(Aabb::from_world(min, min + 0.5, DVec3::ZERO)));
/// graph.set_objects(ids.map(|id| (CellId(2), id)))?;
/// let mut bake = CellBake::new(&graph, Settings::default())?;
/// while bake.advance().is_some() {}
/// let matrix = bake.finish().matrix;
/// let bounds = |id: visibility_core::ObjectId| boxes.get(id.index()).map(|&min| [min, min + 0.5]);
/// let mut bake = ObjectBake::new(&graph, &matrix, bounds, Settings::default())?;
/// while bake.advance().is_some() {}
/// // From the first room, lines through both doors reach the first object, and never the second.
/// assert_eq!(bake.finish().rows, [vec![0], vec![0, 1], vec![0, 1]]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct ObjectBake<'a> {
    graph: &'a CellGraph,
    matrix: &'a CellMatrix,
    portals: Portals,
    targets: Targets,
    settings: Settings,
    done: Vec<(Vec<u32>, u64, bool)>,
    total: u64,
}

impl<'a> ObjectBake<'a> {
    /// Prepares the portals. `bounds` gives the least and the greatest corner of an object's box, in the units of the portals; an object
    /// without, or with one that is no box, is seen wherever one of its cells is.
    ///
    /// # Errors
    /// [`BakeError`], as for [`CellBake`](crate::CellBake); [`BakeError::Cells`] if the matrix is of another number of cells.
    pub fn new(
        graph: &'a CellGraph,
        matrix: &'a CellMatrix,
        bounds: impl Fn(ObjectId) -> Option<[DVec3; 2]>,
        settings: Settings,
    ) -> Result<Self, BakeError> {
        let portals = crate::bake::prepare(graph, &settings)?;
        if matrix.cell_count() != graph.cell_count() {
            return Err(BakeError::Cells { graph: graph.cell_count(), matrix: matrix.cell_count() });
        }
        let targets = Targets::new(graph, bounds);
        Ok(Self { graph, matrix, portals, targets, settings, done: Vec::new(), total: 0 })
    }

    /// Finds what the next few cells see; with the feature `rayon`, on all threads of the current pool. `None` when all are done.
    /// Progress counts cells.
    pub fn advance(&mut self) -> Option<Progress> {
        let (start, cells) = (self.done.len(), self.graph.cell_count());
        if start >= cells {
            return None;
        }
        let round = start as u32..cells.min(start + ROUND) as u32;
        let one = |chains: &mut Chains, cell| {
            chains.seen_from(
                CellId(cell),
                &self.portals,
                self.matrix,
                &self.targets,
                self.settings.steps_per_cell,
            )
        };
        #[cfg(feature = "rayon")]
        let found: Vec<_> = {
            use rayon::prelude::*;
            round.into_par_iter().map_init(Chains::default, one).collect()
        };
        #[cfg(not(feature = "rayon"))]
        let found: Vec<_> = {
            let mut chains = Chains::default();
            round.map(|cell| one(&mut chains, cell)).collect()
        };
        self.total += found.iter().map(|(_, steps, _)| steps).sum::<u64>();
        self.done.extend(found);
        Some(self.progress())
    }

    /// How far the bake is, in cells.
    pub fn progress(&self) -> Progress {
        Progress { done: self.done.len(), portals: self.graph.cell_count(), steps: self.total }
    }

    /// Ends the bake. Cells not yet looked at see all objects in the cells that they see.
    pub fn finish(self) -> ObjectOutcome {
        let cells = self.graph.cell_count();
        let complete = self.done.len() == cells;
        let (mut rows, mut steps, mut fallbacks) = (Vec::with_capacity(cells), Vec::new(), Vec::new());
        for cell in (0..cells as u32).map(CellId) {
            let (row, count, gave_up) = self.done.get(cell.index()).cloned().unwrap_or((Vec::new(), 0, true));
            rows.push(if gave_up { self.targets.in_cells(self.matrix.seen_from(cell)) } else { row });
            steps.push(count);
            if gave_up {
                fallbacks.push(cell);
            }
        }
        ObjectOutcome { rows, fallbacks, steps, complete }
    }
}
