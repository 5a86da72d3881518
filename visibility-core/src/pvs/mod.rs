//! Potentially visible sets (PVS): for each viewcell, a compressed list of the targets that may be seen from
//! anywhere in it. The bytes in memory are the bytes on disk.
//!
//! Two types tell a streaming engine what to load. [`Residency`] suits an engine that leaves to it what is in
//! memory: it loads and drops within limits, and takes sets made online, too. [`Prefetch`] suits an engine
//! that keeps its own books and wants times: it lists when the objects of a baked set come into view.
//!
//! # Format
//! All numbers are little-endian:
//! - The header of the [binary format](crate::binary_format): `VISI-PVS`, version 4, kind (0: cells, 1:
//!   objects). In place of a fingerprint, the header holds the number of viewcells and the number of targets
//!   (`u32` each).
//! - For each 16th viewcell from the first on, the offset of its row from the first row, in bytes (`u32`),
//!   and once more the end of the last row.
//! - The rows. A row begins with the number of bytes that follow. Next is its form, one byte: bit 0 is set if
//!   the row is stored as a difference from another row, bit 1 if its list is stored as bits. A difference
//!   next has a number: how many viewcells the viewcell of the other row is before this one. Its list has the
//!   targets that are in exactly one of the two rows. The other row may itself be a difference, in a chain of
//!   at most four. Then comes the list. As bits, target `t` is bit `t % 8` of byte `t / 8`. As runs, the list
//!   alternates the lengths of runs of absent and of present targets, absent first. Targets after the last
//!   run or bit are absent.
//! - After the last row nothing, or eight bytes: a hash of what the PVS was made from
//!   ([`source`](Pvs::source)).
//! - Numbers and lengths take [7 bits a byte](crate::binary_format::push_number).
//!
//! Neighbouring rooms have similar visible sets, so most rows are shorter as differences (Gotsman, Sudarsky
//! and Fayman, "Optimized Occlusion Culling Using Five-Dimensional Subdivision", 1999, store differences from
//! the parent for the same reason).

mod culler;
mod degrees;
mod error;
mod hidden_sets;
mod prefetch;
mod reached;
mod read;
mod residency;
mod runs;
mod viewcells;

pub use culler::{PvsCuller, ScenePvs};
pub use degrees::{SampledDegree, SampledDegrees};
pub use error::PvsError;
pub use hidden_sets::{HiddenSets, importance};
pub use prefetch::{Arrival, Prefetch};
pub use residency::{Residency, Transfer};
pub use viewcells::{Viewcell, ViewcellId, Viewcells};

use crate::binary_format::{Format, HEADER_LENGTH, Writer, push_number};
use crate::stamp::Stamp;
use alloc::vec::Vec;
use runs::{word, write_bits, write_runs};

/// Kind of the targets of a [`Pvs`].
#[derive(Clone, Copy, PartialEq, Eq, Debug, Hash)]
pub enum PvsTargets {
    /// Targets are cells of a [`CellGraph`](crate::cells::CellGraph), by their numbers.
    Cells,
    /// Targets are objects, numbered by the code that made the PVS. The numbers need not be object indices.
    Objects,
}

/// A potentially visible set: for each viewcell, the targets that may be seen from some point in the
/// viewcell. Immutable.
///
/// ```
/// use visibility_core::pvs::{Pvs, PvsTargets, ViewcellId};
/// // Three viewcells. The third sees what the second sees, and target 70.
/// let rows = [vec![0], vec![0, 1, 2, 3], vec![0, 1, 2, 3, 70]];
/// let before = |viewcell: ViewcellId| viewcell.0.checked_sub(1).map(ViewcellId);
/// let pvs = Pvs::new(PvsTargets::Objects, 100, &rows, before)?;
/// let stored: Vec<u8> = pvs.as_bytes().to_vec();
/// let loaded = Pvs::from_bytes(stored)?;
/// assert!(loaded.sees(ViewcellId(2), 70) && !loaded.sees(ViewcellId(1), 70));
/// # Ok::<(), visibility_core::pvs::PvsError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Pvs {
    bytes: Vec<u8>,
    stamp: Stamp,
}

impl PartialEq for Pvs {
    /// Compares the stored bytes. Stamps are not compared.
    fn eq(&self, other: &Self) -> bool {
        self.bytes == other.bytes
    }
}

impl Eq for Pvs {}

const FORMAT: Format = Format { magic: *b"VISI-PVS", version: 4 };

/// Flag in the first byte of a stored row: the list has the targets in which the row differs from an earlier
/// row.
const DIFFERS: u8 = 1;
/// Flag in the first byte of a stored row: the list is one bit per target, not runs.
const BITS: u8 = 2;
/// Number of consecutive viewcells whose rows share one stored offset, that of the first of these rows.
const BLOCK: usize = 16;
/// Greatest number of rows that must be read to decode a row, besides the row itself.
const DEPTH: u8 = 4;

/// Checks the rows of a PVS: each must be strictly ascending, with targets below `target_count`.
///
/// # Errors
/// [`PvsError::Target`] for the first row that is not strictly ascending or has a target that is not below
/// `target_count`.
pub fn check_rows<R: AsRef<[u32]>>(rows: &[R], target_count: usize) -> Result<(), PvsError> {
    for (viewcell, row) in rows.iter().enumerate() {
        let row = row.as_ref();
        let descends = row.windows(2).find(|pair| pair[0] >= pair[1]).map(|pair| pair[1]);
        // The greatest target of an ascending row is the last.
        let unknown = row.last().copied().filter(|&last| last as usize >= target_count);
        if let Some(target) = descends.or(unknown) {
            return Err(PvsError::Target { viewcell: ViewcellId(viewcell as u32), target });
        }
    }
    Ok(())
}

impl Pvs {
    /// Compresses the rows of a PVS. Row `i` lists the targets visible from viewcell `i`, strictly ascending
    /// and below `target_count`.
    ///
    /// `neighbours` returns viewcells whose rows are probably similar to the row of a given viewcell, as
    /// bases for a differential row. Only viewcells with a lower number than the given one are used; others
    /// are ignored. Time is linear in the lengths of the rows and of the neighbours' rows.
    ///
    /// # Errors
    /// - [`PvsError::Target`] if a row is not strictly ascending, or has a target that is not below
    ///   `target_count`.
    /// - [`PvsError::Size`] if the number of viewcells or targets, or the size of the rows in bytes,
    ///   exceeds `u32`.
    pub fn new<R: AsRef<[u32]>, N: IntoIterator<Item = ViewcellId>>(
        targets: PvsTargets,
        target_count: usize,
        rows: &[R],
        neighbours: impl Fn(ViewcellId) -> N,
    ) -> Result<Self, PvsError> {
        if rows.len() >= u32::MAX as usize || target_count > u32::MAX as usize {
            return Err(PvsError::Size);
        }
        check_rows(rows, target_count)?;
        // Offset of each block of rows in `bytes`, and the end of the last row.
        let (mut starts, mut bytes) = (Vec::new(), Vec::new());
        // For each row, the number of other rows that must be read to decode it.
        let mut depths = alloc::vec![0u8; rows.len()];
        let (mut best, mut trial) = (Vec::new(), Vec::new());
        let offset = |bytes: &[u8]| u32::try_from(bytes.len()).map_err(|_| PvsError::Size);
        for (viewcell, row) in rows.iter().enumerate() {
            let row = row.as_ref();
            // First candidate: the row stored by itself, as runs or as bits, whichever is shorter.
            best.clear();
            best.push(0);
            write_runs(row.iter().copied(), &mut best);
            trial.clear();
            trial.push(BITS);
            if write_bits(row.iter().copied(), best.len(), &mut trial) {
                core::mem::swap(&mut trial, &mut best);
            }
            // Other candidates: the row as a difference from each neighbour's row. The shortest is kept.
            // Chains of differences are kept short, since decoding a row reads its whole chain.
            for base in neighbours(ViewcellId(viewcell as u32)) {
                if base.index() >= viewcell || depths[base.index()] >= DEPTH {
                    continue;
                }
                for form in [DIFFERS, DIFFERS | BITS] {
                    trial.clear();
                    trial.push(form);
                    push_number(viewcell as u32 - base.0, &mut trial);
                    let list = difference(row, rows[base.index()].as_ref());
                    let is_shorter = if form == DIFFERS {
                        write_runs(list, &mut trial);
                        trial.len() < best.len()
                    } else {
                        write_bits(list, best.len(), &mut trial)
                    };
                    if is_shorter {
                        core::mem::swap(&mut trial, &mut best);
                        depths[viewcell] = depths[base.index()] + 1;
                    }
                }
            }
            if viewcell.is_multiple_of(BLOCK) {
                starts.push(offset(&bytes)?);
            }
            push_number(best.len() as u32, &mut bytes);
            bytes.extend_from_slice(&best);
        }
        starts.push(offset(&bytes)?);
        let counts = rows.len() as u64 | (target_count as u64) << 32;
        let mut writer = Writer::new(FORMAT, targets as u32, counts);
        writer.u32s(starts);
        writer.bytes(&bytes);
        Ok(Self { bytes: writer.finish(), stamp: Stamp::new() })
    }

    /// Returns the PVS with `source` as the hash of the data that the PVS was made from, replacing a former
    /// hash. The hash is stored with the PVS. For a PVS whose targets are cells it is the
    /// [`CellGraph::version`](crate::cells::CellGraph::version).
    #[must_use]
    pub fn with_source(self, source: u64) -> Self {
        let counts = u64::from(self.word(16)) | u64::from(self.word(20)) << 32;
        let mut writer = Writer::new(FORMAT, self.targets() as u32, counts);
        writer.bytes(self.bytes.get(HEADER_LENGTH..self.rows_end()).unwrap_or_default());
        writer.u64(source);
        Self { bytes: writer.finish(), stamp: Stamp::new() }
    }

    /// Returns the hash of what the PVS was made from. `None` if the PVS has [no such
    /// hash](Self::with_source): then it is unknown whether the PVS was made from the present state of a
    /// graph or scene.
    pub fn source(&self) -> Option<u64> {
        let bytes = self.bytes.get(self.rows_end()..)?;
        Some(u64::from_le_bytes(bytes.try_into().ok()?))
    }

    /// Returns the bytes of the PVS, to be stored unchanged and loaded by [`from_bytes`](Self::from_bytes).
    pub fn as_bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Returns the stamp that identifies the content. A clone has the same stamp. Loading the same bytes
    /// twice gives two different stamps.
    pub fn stamp(&self) -> Stamp {
        self.stamp
    }

    /// Returns whether the targets are cells or objects.
    pub fn targets(&self) -> PvsTargets {
        if self.word(12) == 0 { PvsTargets::Cells } else { PvsTargets::Objects }
    }

    /// Returns the number of viewcells, which is the number of rows.
    pub fn viewcell_count(&self) -> usize {
        self.word(16) as usize
    }

    /// Returns the number of targets, whether or not any viewcell sees them.
    pub fn target_count(&self) -> usize {
        self.word(20) as usize
    }

    fn word(&self, place: usize) -> u32 {
        word(&self.bytes, place)
    }
}

/// Yields, in ascending order, the numbers that are in exactly one of two strictly ascending lists.
fn difference<'a>(a: &'a [u32], b: &'a [u32]) -> impl Iterator<Item = u32> + 'a {
    let (mut i, mut j) = (0, 0);
    core::iter::from_fn(move || {
        loop {
            return match (a.get(i), b.get(j)) {
                (Some(x), Some(y)) if x == y => {
                    (i, j) = (i + 1, j + 1);
                    continue;
                }
                (Some(&x), y) if y.is_none_or(|&y| x < y) => {
                    i += 1;
                    Some(x)
                }
                (_, Some(&y)) => {
                    j += 1;
                    Some(y)
                }
                _ => None,
            };
        }
    })
}

#[cfg(test)]
mod tests;
