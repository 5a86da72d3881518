//! The visibility of cells from cells: floods from all portals, in rounds.
//!
//! Within a round floods know nothing of one another, so they can run on any number of threads; what they found is taken in, in order,
//! at the round's end. The portals with the fewest candidates come first: what they prove hidden thins the candidates of the others, at
//! once also the other way round, since a line can be walked both ways.

mod saved;

use crate::CellMatrix;
use crate::flood::{Found, Known, Scratch, flood};
use crate::matrix::bits;
use crate::portals::Portals;
use alloc::vec::Vec;
use core::fmt;
use visibility_core::{CellGraph, CellId};

/// How a bake works.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Settings {
    /// No pair of cells is called hidden between which a line passes that stays clear of all portal edges by this distance, in
    /// the map's units. It must be well above the rounding of coordinates: at least 2^-33 of the greatest.
    pub clearance: f64,
    /// The most chains of portals to look at for one cell. When it is reached, the cell sees all that is still possible.
    pub steps_per_cell: u64,
    /// Whether chains of portals through which separating planes leave a way are tested in Pluecker space too, where that decides whether
    /// a cell is seen: never more cells, for somewhat more time.
    ///
    /// What is certain is each rejection: of the edges of a few portals of the chain, a certificate shows that no line passes all of them
    /// clear by the clearance. What is kept need not be visible: half-spaces that have a point in common may still miss the quadric that
    /// lines form ([`stabbing`](crate::stabbing) says more), and what they have in common by less than `f64` can tell is kept, too.
    pub exact: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self { clearance: 1e-6, steps_per_cell: u64::MAX, exact: false }
    }
}

/// Why a bake cannot begin.
#[derive(Clone, Copy, PartialEq, Debug)]
#[non_exhaustive]
pub enum BakeError {
    /// The clearance is not a positive number, or too small for coordinates of this size.
    Clearance {
        /// The clearance asked for.
        clearance: f64,
        /// The least that the coordinates allow.
        least: f64,
    },
    /// More portals or cells than the tables of pairs have room for.
    TooLarge {
        /// How many cells.
        cells: usize,
        /// How many portals.
        portals: usize,
    },
    /// Bytes that are not of a saved bake of this map.
    Saved {
        /// What is wrong with them.
        problem: &'static str,
    },
    /// A matrix of another number of cells than the graph has.
    Cells {
        /// Cells of the graph.
        graph: usize,
        /// Cells of the matrix.
        matrix: usize,
    },
}

impl fmt::Display for BakeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Clearance { clearance, least } => {
                write!(
                    f,
                    "a clearance of {clearance} is less than {least}, the least for coordinates of this size"
                )
            }
            Self::TooLarge { cells, portals } => {
                write!(f, "{cells} cells and {portals} portals are more than {MOST} of either")
            }
            Self::Saved { problem } => write!(f, "the saved bake: {problem}"),
            Self::Cells { graph, matrix } => {
                write!(f, "a matrix of {matrix} cells, where the graph has {graph}")
            }
        }
    }
}

impl core::error::Error for BakeError {}

/// The most cells or portals in a bake: its tables then take up to 2 GiB.
const MOST: usize = 1 << 16;

/// Portals in a round. More of them keep more threads busy, and know less of one another.
const ROUND: usize = 48;

/// How far a bake is.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Progress {
    /// Portals whose flood is done, each direction counted.
    pub done: usize,
    /// All of them.
    pub portals: usize,
    /// Chains of portals looked at so far.
    pub steps: u64,
}

/// A cell for which the limit of steps was reached.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Fallback {
    /// The cell.
    pub cell: CellId,
    /// How many of its portals count all that is possible as seen.
    pub portals: u32,
}

/// What a bake found.
#[derive(Clone, PartialEq, Debug)]
pub struct Outcome {
    /// Which cells see which; symmetric.
    pub matrix: CellMatrix,
    /// Cells that see more than they would without a limit of steps, ascending.
    pub fallbacks: Vec<Fallback>,
    /// Chains of portals looked at, by cell: what the cell cost.
    pub steps: Vec<u64>,
    /// Chains that were tested in Pluecker space and rejected, each with a certificate.
    pub rejected: u64,
    /// Whether the bake went to its end; otherwise cells see all that was still possible.
    pub complete: bool,
}

/// A bake of cell-to-cell visibility: begun with [`new`](Self::new), moved on by [`advance`](Self::advance) as long as one likes, ended by
/// [`finish`](Self::finish).
///
/// ```
/// use visibility_core::CellId;
/// use visibility_portals::{CellBake, Settings, prt};
/// // Three rooms in a row; the last door lies where nobody in the first room can see through both.
/// let map = "PRT1\n3\n2\n\
///     4 0 1 (4 0 0) (4 1 0) (4 1 2) (4 0 2)\n\
///     4 1 2 (4 8 0) (3 8 0) (3 8 2) (4 8 2)\n";
/// let graph = prt::read(map)?.graph;
/// let mut bake = CellBake::new(&graph, Settings::default())?;
/// while bake.advance().is_some_and(|progress| progress.done < progress.portals) {}
/// let outcome = bake.finish();
/// assert!(outcome.complete && outcome.matrix.is_symmetric());
/// assert!(!outcome.matrix.sees(CellId(0), CellId(2)));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct CellBake {
    portals: Portals,
    cells: usize,
    settings: Settings,
    /// See [`Known`].
    rows: Vec<u64>,
    stride: usize,
    seen: Vec<u64>,
    cell_stride: usize,
    /// How many candidates each portal has left.
    counts: Vec<u32>,
    /// Portals whose flood is still to come.
    waiting: Vec<u32>,
    steps: Vec<u64>,
    fallbacks: Vec<u32>,
    total: u64,
    rejected: u64,
}

/// The portals made ready, if they can be baked.
pub(crate) fn prepare(graph: &CellGraph, settings: &Settings) -> Result<Portals, BakeError> {
    let (cells, count) = (graph.cell_count(), graph.portals().len());
    if cells > MOST || count > MOST {
        return Err(BakeError::TooLarge { cells, portals: count });
    }
    let portals = Portals::new(graph, settings.clearance);
    let least = portals.margins.noise * 65_536.0;
    if !(settings.clearance > 0.0 && settings.clearance >= least && settings.clearance.is_finite()) {
        return Err(BakeError::Clearance { clearance: settings.clearance, least });
    }
    Ok(portals)
}

impl CellBake {
    /// Prepares the portals and finds, for each, the others that can follow it by their planes alone.
    ///
    /// # Errors
    /// [`BakeError`].
    pub fn new(graph: &CellGraph, settings: Settings) -> Result<Self, BakeError> {
        let cells = graph.cell_count();
        let portals = prepare(graph, &settings)?;
        let directed = portals.all.len();
        let (stride, cell_stride) = (directed.div_ceil(64), cells.div_ceil(64));
        let mut bake = Self {
            rows: alloc::vec![0; directed * stride],
            stride,
            seen: alloc::vec![0; cells * cell_stride],
            cell_stride,
            counts: alloc::vec![0; directed],
            waiting: (0..directed as u32).collect(),
            steps: alloc::vec![0; cells],
            fallbacks: alloc::vec![0; cells],
            total: 0,
            rejected: 0,
            portals,
            cells,
            settings,
        };
        bake.begin();
        Ok(bake)
    }

    /// Candidates by planes and reachability; cells see themselves and their neighbours.
    fn begin(&mut self) {
        let portals = &self.portals;
        let fill = |stamps: &mut Vec<u32>, (source, row): (usize, &mut [u64])| {
            stamps.resize(self.cells, u32::MAX);
            candidates(portals, source as u32, stamps, row);
        };
        #[cfg(feature = "rayon")]
        {
            use rayon::prelude::*;
            let rows = self.rows.par_chunks_exact_mut(self.stride.max(1)).enumerate();
            rows.with_max_len(16).for_each_init(Vec::new, fill);
        }
        #[cfg(not(feature = "rayon"))]
        {
            let mut stamps = Vec::new();
            let rows = self.rows.chunks_exact_mut(self.stride.max(1)).enumerate();
            rows.for_each(|row| fill(&mut stamps, row));
        }
        // What cannot be reached one way is not seen the other way either.
        for a in 0..self.portals.all.len() as u32 {
            for i in 0..self.stride {
                for bit in bits(self.rows[a as usize * self.stride + i]) {
                    let b = i as u32 * 64 + bit;
                    let (back, forth) =
                        (self.portals.all[b as usize].reverse, self.portals.all[a as usize].reverse);
                    if self.rows[back as usize * self.stride + forth as usize / 64] >> (forth % 64) & 1 == 0 {
                        self.rows[a as usize * self.stride + i] &= !(1 << bit);
                    }
                }
            }
        }
        for (row, count) in self.rows.chunks_exact(self.stride.max(1)).zip(&mut self.counts) {
            *count = row.iter().map(|word| word.count_ones()).sum();
        }
        for portal in &self.portals.all {
            let (a, b) = (portal.from as usize, portal.to as usize);
            for (a, b) in [(a, a), (a, b), (b, b)] {
                self.seen[a * self.cell_stride + b / 64] |= 1 << (b % 64);
            }
        }
        // Cells without portals, too.
        for a in 0..self.cells {
            self.seen[a * self.cell_stride + a / 64] |= 1 << (a % 64);
        }
    }

    /// How far the bake is.
    pub fn progress(&self) -> Progress {
        let portals = self.portals.all.len();
        Progress { done: portals - self.waiting.len(), portals, steps: self.total }
    }

    /// Floods from the next few portals; with the feature `rayon`, on all threads of the current pool. `None` when all are done.
    pub fn advance(&mut self) -> Option<Progress> {
        if self.waiting.is_empty() {
            return None;
        }
        let round = self.next_round();
        let known = Known {
            portals: &self.portals,
            rows: &self.rows,
            stride: self.stride,
            seen: &self.seen,
            cell_stride: self.cell_stride,
            exact: self.settings.exact.then_some(self.settings.clearance),
        };
        let one = |scratch: &mut Scratch, source: u32| {
            let spent = self.steps[self.portals.all[source as usize].from as usize];
            flood(&known, source, self.settings.steps_per_cell.saturating_sub(spent), scratch)
        };
        let found = each(&round, one);
        for (&source, found) in round.iter().zip(found) {
            self.take_in(source, found);
        }
        Some(self.progress())
    }

    /// Takes those with the fewest candidates out of the portals that wait.
    fn next_round(&mut self) -> Vec<u32> {
        let size = ROUND.min(self.waiting.len());
        let key = |&portal: &u32| (self.counts[portal as usize], portal);
        if size < self.waiting.len() {
            self.waiting.select_nth_unstable_by_key(size - 1, key);
        }
        let mut round: Vec<u32> = self.waiting.drain(..size).collect();
        round.sort_unstable_by_key(key);
        round
    }

    fn take_in(&mut self, source: u32, found: Found) {
        let (from, back) = {
            let portal = &self.portals.all[source as usize];
            (portal.from as usize, portal.reverse)
        };
        // What was saved, and then forged, may be any number.
        let add = |sum: &mut u64, more: u64| *sum = sum.saturating_add(more);
        add(&mut self.steps[from], found.steps);
        add(&mut self.total, found.steps);
        add(&mut self.rejected, found.rejected);
        self.fallbacks[from] = self.fallbacks[from].saturating_add(u32::from(found.gave_up));
        for portal in found.hidden {
            let other = self.portals.all[portal as usize].reverse;
            self.clear(source, portal);
            self.clear(other, back);
        }
        for (cell, proven) in found.cells {
            let cell = cell as usize;
            self.seen[from * self.cell_stride + cell / 64] |= 1 << (cell % 64);
            if proven {
                self.seen[cell * self.cell_stride + from / 64] |= 1 << (from % 64);
            }
        }
    }

    fn clear(&mut self, a: u32, b: u32) {
        let word = &mut self.rows[a as usize * self.stride + b as usize / 64];
        let bit = 1 << (b % 64);
        self.counts[a as usize] -= u32::from(*word & bit != 0);
        *word &= !bit;
    }

    /// Ends the bake. If it has not come to its end, what is still possible counts as visible.
    pub fn finish(mut self) -> Outcome {
        let complete = self.waiting.is_empty();
        for &source in &self.waiting {
            let from = self.portals.all[source as usize].from as usize;
            let row = &self.rows[source as usize * self.stride..][..self.stride];
            for (i, &word) in row.iter().enumerate() {
                for bit in bits(word) {
                    let to = self.portals.all[i * 64 + bit as usize].to as usize;
                    self.seen[from * self.cell_stride + to / 64] |= 1 << (to % 64);
                }
            }
        }
        let mut matrix = CellMatrix::new(self.cells);
        let sees = |a: usize, b: usize| self.seen[a * self.cell_stride + b / 64] >> (b % 64) & 1 != 0;
        for a in 0..self.cells {
            for b in 0..self.cells {
                if sees(a, b) && sees(b, a) {
                    matrix.set(a, b);
                }
            }
        }
        let fallbacks = self.fallbacks.iter().enumerate().filter(|(_, portals)| **portals > 0);
        let fallbacks =
            fallbacks.map(|(cell, &portals)| Fallback { cell: CellId(cell as u32), portals }).collect();
        Outcome { matrix, fallbacks, steps: self.steps, rejected: self.rejected, complete }
    }
}

/// Marks the portals that can follow one by their planes and through cells that can be reached. `stamps` has a place for each cell, and in it
/// no number of this portal yet.
fn candidates(portals: &Portals, source: u32, stamps: &mut [u32], row: &mut [u64]) {
    let portal = &portals.all[source as usize];
    let mut queue = alloc::vec![portal.to];
    stamps[portal.to as usize] = source;
    while let Some(cell) = queue.pop() {
        for next in portals.from(cell) {
            let other = &portals.all[next as usize];
            if next == portal.reverse || !portals.can_follow(portal, other) {
                continue;
            }
            row[next as usize / 64] |= 1 << (next % 64);
            if stamps[other.to as usize] != source {
                stamps[other.to as usize] = source;
                queue.push(other.to);
            }
        }
    }
}

/// What each portal of a round comes to, in their order.
#[cfg(not(feature = "rayon"))]
fn each(round: &[u32], one: impl Fn(&mut Scratch, u32) -> Found) -> Vec<Found> {
    let mut scratch = Scratch::default();
    round.iter().map(|&source| one(&mut scratch, source)).collect()
}

/// What each portal of a round comes to, in their order. Each thread takes the next one when it is done with one; those with the most
/// candidates come first, so that no thread is left with a long one at the end.
#[cfg(feature = "rayon")]
fn each(round: &[u32], one: impl Fn(&mut Scratch, u32) -> Found + Sync) -> Vec<Found> {
    use core::sync::atomic::{AtomicUsize, Ordering};
    use rayon::prelude::*;
    let taken = AtomicUsize::new(0);
    let work = |_| {
        let (mut scratch, mut found) = (Scratch::default(), Vec::new());
        while let Some(place) = round.len().checked_sub(1 + taken.fetch_add(1, Ordering::Relaxed)) {
            found.push((place, one(&mut scratch, round[place])));
        }
        found
    };
    let threads = 0..rayon::current_num_threads();
    let mut found: Vec<(usize, Found)> =
        threads.into_par_iter().with_max_len(1).flat_map_iter(work).collect();
    found.sort_unstable_by_key(|&(place, _)| place);
    found.into_iter().map(|(_, found)| found).collect()
}
