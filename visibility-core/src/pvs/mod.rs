//! Potentially visible sets: for each viewcell, what can be seen from anywhere in it, compressed; the same
//! bytes in memory and on disk.
//!
//! # Format
//! All numbers are little-endian:
//! - the header of an [envelope](crate::envelope): `VISI-PVS`, version 1, kind (0: cells, 1: objects), and in
//!   place of a fingerprint the number of viewcells and that of targets (`u32` each);
//! - for each viewcell, where its row begins among the rows (`u32`), and once more for the end of the last;
//! - the rows. A row is a byte 0 and runs; or a byte 1, another viewcell (`u32`) whose row begins with 0, and
//!   the runs of the difference from that row. Runs are lengths: of targets that are not in the row, of
//!   targets that are, and so on in turn. A length takes 7 bits a byte, least significant first, with the top
//!   bit set on all bytes but the last. What follows the last run is not in the row.
//!
//! Rooms side by side see much the same, so most rows are shorter as differences (Gotsman, Sudarsky and
//! Fayman, "Optimized Occlusion Culling Using Five-Dimensional Subdivision", 1999, store differences from the
//! parent for the same reason).

mod culler;
mod error;
mod reached;
mod read;
mod runs;
mod viewcells;

pub use culler::{PvsCuller, ScenePvs};
pub use error::PvsError;
pub use viewcells::{Viewcell, ViewcellId, Viewcells};

use crate::envelope::{Format, Writer};
use crate::stamp::Stamp;
use alloc::vec::Vec;
use runs::{word, write_runs};

/// What the targets of a [`Pvs`] are.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Hash)]
pub enum PvsTargets {
    /// Cells of a [`CellGraph`](crate::cells::CellGraph), by their numbers.
    Cells,
    /// Objects, numbered by whoever made the PVS.
    Objects,
}

/// For each viewcell, the targets that can be seen from anywhere in it. Never changes.
///
/// ```
/// use visibility_core::pvs::{Pvs, PvsTargets, ViewcellId};
/// // Three viewcells; the third sees what the second sees, and target 70 too.
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
    /// Whether the stored bytes are the same. Stamps are not compared.
    fn eq(&self, other: &Self) -> bool {
        self.bytes == other.bytes
    }
}

impl Eq for Pvs {}

const FORMAT: Format = Format { magic: *b"VISI-PVS", version: 1 };

impl Pvs {
    /// Compresses rows of targets: row `i` holds what viewcell `i` sees, ascending and without repetition.
    ///
    /// `neighbours` names viewcells that probably see much the same. Those with greater numbers than the
    /// viewcell itself, and unknown ones, are passed over. Takes time in proportion to the rows and to those
    /// of the neighbours.
    ///
    /// # Errors
    /// [`PvsError::Target`] if a row is not ascending, or holds a target that is not below `target_count`;
    /// [`PvsError::TooLarge`].
    pub fn new<R: AsRef<[u32]>, N: IntoIterator<Item = ViewcellId>>(
        targets: PvsTargets,
        target_count: usize,
        rows: &[R],
        neighbours: impl Fn(ViewcellId) -> N,
    ) -> Result<Self, PvsError> {
        if rows.len() >= u32::MAX as usize || target_count > u32::MAX as usize {
            return Err(PvsError::TooLarge);
        }
        for (viewcell, row) in rows.iter().enumerate() {
            let row = row.as_ref();
            let descends = row.windows(2).find(|pair| pair[0] >= pair[1]).map(|pair| pair[1]);
            let unknown = row.iter().copied().find(|&target| target as usize >= target_count);
            if let Some(target) = descends.or(unknown) {
                return Err(PvsError::Target { viewcell: ViewcellId(viewcell as u32), target });
            }
        }
        // Where rows begin, and the end of the last.
        let (mut starts, mut bytes) = (alloc::vec![0], Vec::new());
        let (mut plain, mut best, mut trial) = (alloc::vec![false; rows.len()], Vec::new(), Vec::new());
        for (viewcell, row) in rows.iter().enumerate() {
            let row = row.as_ref();
            // Only rows of runs are differed from, so that reading a row never takes more than two.
            best.clear();
            best.push(0);
            write_runs(row.iter().copied(), &mut best);
            plain[viewcell] = true;
            for base in neighbours(ViewcellId(viewcell as u32)) {
                if base.index() < viewcell && plain[base.index()] {
                    trial.clear();
                    trial.push(1);
                    trial.extend_from_slice(&base.0.to_le_bytes());
                    write_runs(difference(row, rows[base.index()].as_ref()), &mut trial);
                    if trial.len() < best.len() {
                        core::mem::swap(&mut trial, &mut best);
                        plain[viewcell] = false;
                    }
                }
            }
            bytes.extend_from_slice(&best);
            starts.push(u32::try_from(bytes.len()).map_err(|_| PvsError::TooLarge)?);
        }
        let counts = rows.len() as u64 | (target_count as u64) << 32;
        let mut writer = Writer::new(FORMAT, targets as u32, counts);
        writer.u32s(starts);
        writer.bytes(&bytes);
        Ok(Self { bytes: writer.finish(), stamp: Stamp::new() })
    }

    /// The bytes, to be stored as they are.
    pub fn as_bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Identifies the content. A clone has the same stamp; the same bytes loaded twice have two.
    pub fn stamp(&self) -> Stamp {
        self.stamp
    }

    /// What the targets are.
    pub fn targets(&self) -> PvsTargets {
        if self.word(12) == 0 { PvsTargets::Cells } else { PvsTargets::Objects }
    }

    /// The number of viewcells.
    pub fn viewcell_count(&self) -> usize {
        self.word(16) as usize
    }

    /// The number of targets.
    pub fn target_count(&self) -> usize {
        self.word(20) as usize
    }

    fn word(&self, place: usize) -> u32 {
        word(&self.bytes, place)
    }
}

/// The numbers that are in exactly one of two ascending rows.
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
