//! The baker of cell-to-cell visibility: one [portal flow](crate::portal_flow) from every directed portal.
//!
//! In each round the directed portals with the fewest candidates are processed first. A portal pair that is
//! proven hidden is removed from the candidates in both directions at once, since every line can be walked
//! both ways.

use crate::bake_settings::{BakeError, BakerSettings, ChainTest, METHODS, prepare};
use crate::cell_matrix::CellMatrix;
use crate::directed_portals::DirectedPortals;
use crate::portal_chain::CellFlood;
use crate::portal_flow::{FlowInput, FlowResult, FlowScratch, portal_flow};
use crate::portal_pairs::PortalPairs;
use alloc::vec::Vec;
use visibility_core::bake::{Baker, fill_rows};
use visibility_core::binary_format::{Fingerprint, FormatError, Reader, Writer};
use visibility_core::bits::Bits;
use visibility_core::cells::{CellGraph, CellId};

/// A cell whose row of the matrix contains too many cells, because the bake reached
/// [`BakerSettings::with_steps_per_cell`](crate::BakerSettings::with_steps_per_cell) there.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[non_exhaustive]
pub struct Fallback {
    /// The viewcell: the cell from which the search stopped early.
    pub cell: CellId,
    /// Number of the cell's portals whose search stopped at the limit. All cells behind these portals that
    /// are not yet proven hidden count as visible.
    pub portals: u32,
}

/// Result of a bake of cell-to-cell visibility: the matrix of visible pairs, and how complete the search was.
#[derive(Clone, PartialEq, Debug)]
#[non_exhaustive]
pub struct Outcome {
    /// Cell-to-cell visibility. Conservative and symmetric; each cell sees itself.
    pub matrix: CellMatrix,
    /// Portals that a line may pass one after the other, for [`ObjectBaker`](crate::ObjectBaker).
    pub pairs: PortalPairs,
    /// Cells whose search reached [`BakerSettings::with_steps_per_cell`], the limit of inspected portal
    /// chains, in ascending order. Empty if no cell did.
    pub fallbacks: Vec<Fallback>,
    /// Number of portal chains (sequences of portals that a line might pass) inspected, by index of the cell
    /// looked from.
    pub steps: Vec<u64>,
    /// Number of portal chains that only the test in Pluecker space excluded. 0 unless
    /// [`BakerSettings::with_chain_test`] is [`ChainTest::Pluecker`].
    pub rejected: u64,
    /// Whether the search from every portal was carried out. `false` if the bake was finished early: cells
    /// behind unsearched portals then count as visible unless already proven hidden.
    pub complete: bool,
}

/// Computes which cells see which, as a [`Baker`] for a [`Bake`](visibility_core::bake::Bake).
///
/// The items of the bake are the directed portals, two for each portal of the graph; its steps are the portal
/// chains inspected. Memory is four bits for each ordered pair of portals, and one bit for each ordered pair
/// of cells.
///
/// ```
/// use visibility_core::{bake::Bake, cells::CellId};
/// use visibility_portals::{CellBaker, BakerSettings, prt};
/// // Three rooms in a row; the last door lies where nobody in the first room can see through both.
/// let map = "PRT1\n3\n2\n\
///     4 0 1 (4 0 0) (4 1 0) (4 1 2) (4 0 2)\n\
///     4 1 2 (4 8 0) (3 8 0) (3 8 2) (4 8 2)\n";
/// let graph = prt::read(map)?.graph;
/// let mut bake = Bake::new(CellBaker::new(&graph, BakerSettings::default())?);
/// while bake.advance().is_some_and(|progress| progress.done < progress.total) {}
/// let outcome = bake.finish();
/// assert!(outcome.complete && outcome.matrix.is_symmetric());
/// assert!(!outcome.matrix.sees(CellId(0), CellId(2)));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct CellBaker {
    portals: DirectedPortals,
    settings: BakerSettings,
    /// By directed portal: its candidates, the directed portals that a line through it may later pass.
    /// Searches remove those that they prove impossible to reach. See [`FlowInput::rows`].
    rows: Vec<Bits>,
    /// Cells known to be seen: the bit of the ordered pair of cells (a, b) is 1 once b counts as seen from
    /// a, with or without proof, and 0 before. See [`FlowInput::seen`].
    seen: CellMatrix,
    /// By directed portal: the number of its candidates, the directed portals that a line through this
    /// portal may later pass. Equals the number of set bits in the portal's row of `rows`.
    counts: Vec<u32>,
    steps: Vec<u64>,
    /// By cell index: number of portals leading from the cell whose search reached the limit of steps
    /// (portal chains inspected).
    fallbacks: Vec<u32>,
    rejected: u64,
}

impl CellBaker {
    /// Prepares the portals and computes, for each directed portal, its candidates: the directed portals that
    /// a line can pass later, judged by the positions of the two portals' planes and by reachability through
    /// cells. Takes time proportional to the number of portal pairs at worst.
    ///
    /// Neither the winding of portals is checked, nor that they are in the boundaries of their cells. A cell
    /// behind a portal that is wound the wrong way is missing from the result. Where the bodies of the cells
    /// are known, call [`CellGraph::turn_portals`] before, and [`CellGraph::validate_bodies`] once.
    ///
    /// # Errors
    /// [`BakeError::TooMany`] for more than 65,536 cells or portals. [`BakeError::Clearance`] for a
    /// clearance that is not positive, not finite, or too small for the coordinates.
    pub fn new(graph: &CellGraph, settings: BakerSettings) -> Result<Self, BakeError> {
        let cells = graph.cell_count();
        let portals = prepare(graph, &settings)?;
        let directed = portals.all.len();
        let mut baker = Self {
            rows: alloc::vec![Bits::new(directed); directed],
            seen: CellMatrix::new(cells).with_source(graph.version()),
            counts: alloc::vec![0; directed],
            steps: alloc::vec![0; cells],
            fallbacks: alloc::vec![0; cells],
            rejected: 0,
            portals,
            settings,
        };
        baker.begin();
        Ok(baker)
    }

    /// Computes `rows`, the candidates of each directed portal, by tests of portal planes and by reachability
    /// through cells. Sets in `seen` each cell itself and its neighbours.
    fn begin(&mut self) {
        let portals = &self.portals;
        fill_rows(&mut self.rows, |flood, source, row| {
            candidates(portals, source as u32, flood, row);
        });
        // A pair stays a candidate only if it is reachable in both directions, since a line can be walked
        // both ways.
        for a in 0..self.portals.all.len() {
            let forth = self.portals.all[a].reverse as usize;
            let mut next = self.rows[a].next(0);
            while let Some(b) = next {
                if !self.rows[self.portals.all[b].reverse as usize].contains(forth) {
                    self.rows[a].remove(b);
                }
                next = self.rows[a].next(b + 1);
            }
        }
        self.count();
        for portal in &self.portals.all {
            self.seen.set(portal.from as usize, portal.to as usize);
        }
        // Each cell sees itself, also a cell without portals.
        (0..self.seen.cell_count()).for_each(|cell| self.seen.set(cell, cell));
    }

    /// Recomputes `counts`, the number of candidates in each row of `rows`.
    fn count(&mut self) {
        self.rows.iter().zip(&mut self.counts).for_each(|(row, count)| *count = row.count());
    }

    /// Clears in `rows` the bit of the ordered pair `(a, b)`, since no line passes directed portal `a` and
    /// later directed portal `b`.
    fn clear(&mut self, a: u32, b: u32) {
        self.counts[a as usize] -= u32::from(self.rows[a as usize].remove(b as usize));
    }
}

impl Baker for CellBaker {
    type Scratch = FlowScratch;
    type Found = FlowResult;
    type Outcome = Outcome;

    fn item_count(&self) -> usize {
        self.portals.all.len()
    }

    fn rank(&self, portal: u32) -> u64 {
        self.counts[portal as usize].into()
    }

    fn work(&self, source: u32, scratch: &mut FlowScratch, _: &dyn Fn() -> bool) -> Option<FlowResult> {
        let input = FlowInput {
            portals: &self.portals,
            rows: &self.rows,
            seen: &self.seen,
            exact: (self.settings.chain_test == ChainTest::Pluecker)
                .then_some(self.portals.margins.clearance),
            depth: self.settings.depth,
        };
        let spent = self.steps[self.portals.all[source as usize].from as usize];
        Some(portal_flow(&input, source, self.settings.steps_per_cell.saturating_sub(spent), scratch))
    }

    fn take_in(&mut self, source: u32, found: FlowResult) -> u64 {
        let (from, back) = {
            let portal = &self.portals.all[source as usize];
            (portal.from as usize, portal.reverse)
        };
        // A restored state may have been forged and hold any number, so the sum saturates.
        let add = |sum: &mut u64, more: u64| *sum = sum.saturating_add(more);
        add(&mut self.steps[from], found.steps);
        add(&mut self.rejected, found.rejected);
        self.fallbacks[from] = self.fallbacks[from].saturating_add(u32::from(found.gave_up));
        for portal in found.hidden {
            let other = self.portals.all[portal as usize].reverse;
            self.clear(source, portal);
            self.clear(other, back);
        }
        for (cell, proven) in found.cells {
            let cell = cell as usize;
            self.seen.set(from, cell);
            if proven {
                self.seen.set(cell, from);
            }
        }
        found.steps
    }

    /// Builds the outcome: the cell-to-cell matrix and the counters. For the directed portals in `waiting`,
    /// whose flow was not computed, all their candidates (portals that a line through them may later pass)
    /// count as visible.
    fn finish(mut self, waiting: &[u32]) -> Outcome {
        for &source in waiting {
            let from = self.portals.all[source as usize].from as usize;
            for portal in self.rows[source as usize].iter() {
                self.seen.set(from, self.portals.all[portal].to as usize);
            }
        }
        let fallbacks = self.fallbacks.iter().enumerate().filter(|(_, portals)| **portals > 0);
        let fallbacks =
            fallbacks.map(|(cell, &portals)| Fallback { cell: CellId(cell as u32), portals }).collect();
        Outcome {
            matrix: self.seen.both_ways(),
            pairs: PortalPairs::new(&self.portals, self.rows),
            fallbacks,
            steps: self.steps,
            rejected: self.rejected,
            complete: waiting.is_empty(),
        }
    }

    fn fingerprint(&self) -> u64 {
        let numbers = self.portals.numbers().chain(self.settings.numbers());
        numbers.fold(Fingerprint::new().with(METHODS), Fingerprint::with_u64).value()
    }

    fn save(&self, state: &mut Writer) {
        state.u64(self.rejected);
        state.u32s(self.fallbacks.iter().copied());
        state.u64s(self.steps.iter().copied());
        state.u64s(self.rows.iter().flat_map(Bits::words).copied());
        state.u64s(self.seen.words());
    }

    fn load(&mut self, state: &mut Reader<'_>) -> Result<(), FormatError> {
        self.rejected = state.u64()?;
        self.fallbacks = state.u32s(self.fallbacks.len())?;
        self.steps = state.u64s(self.steps.len())?;
        // Saved rows can only clear bits: a candidate that the plane tests exclude stays excluded, and a
        // forged state cannot set the bit of a portal that does not exist.
        for row in &mut self.rows {
            row.intersect(&state.u64s(row.words().len())?.into());
        }
        for row in &mut self.seen.rows {
            row.unite(&state.u64s(row.words().len())?.into());
        }
        self.count();
        Ok(())
    }
}

/// Sets in `row` the bits of the directed portals that a line through directed portal `source` can pass
/// later, judged by the portals' planes and by the cells that can be reached. `flood` is scratch memory.
fn candidates(portals: &DirectedPortals, source: u32, flood: &mut CellFlood, row: &mut Bits) {
    let portal = &portals.all[source as usize];
    flood.begin(portals.first.len(), portal.to);
    while let Some(cell) = flood.next_cell() {
        for next in portals.from(cell) {
            let other = &portals.all[next as usize];
            if next != portal.reverse && portals.can_follow(portal, other) {
                row.insert(next as usize);
                flood.reach(other.to);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fingerprint_is_of_the_methods() {
        let map = "PRT1\n2\n1\n4 0 1 (0 0 0) (0 1 0) (0 1 1) (0 0 1)\n";
        let graph = crate::prt::read(map).unwrap().graph;
        let baker = CellBaker::new(&graph, BakerSettings::default()).unwrap();
        let numbers = baker.portals.numbers().chain(baker.settings.numbers());
        let numbers: Vec<u64> = numbers.collect();
        let of = |hash: Fingerprint| numbers.iter().fold(hash, |hash, &n| hash.with_u64(n)).value();
        assert_eq!(baker.fingerprint(), of(Fingerprint::new().with(METHODS)), "of these methods");
        assert_ne!(baker.fingerprint(), of(Fingerprint::new().with(METHODS + 1)), "of other methods");
    }
}
