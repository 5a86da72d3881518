//! Loading and querying a stored PVS.

use super::runs::Runs;
use super::{BITS, DIFFERS, FORMAT, Pvs, PvsError, PvsTargets, ViewcellId};
use crate::binary_format::{HEADER_LENGTH, Reader};
use crate::stamp::Stamp;
use alloc::vec::Vec;

impl Pvs {
    /// Loads the bytes of a stored PVS, which [`as_bytes`](Self::as_bytes) returned. All bytes are read once
    /// to check them. No index is built.
    ///
    /// # Errors
    /// [`PvsError::Format`] if the bytes are damaged, incomplete or of another format, [`PvsError::Row`] if
    /// a row is inconsistent.
    pub fn from_bytes(bytes: impl Into<Vec<u8>>) -> Result<Self, PvsError> {
        let bytes = bytes.into();
        let mut reader = Reader::new(&bytes, FORMAT)?;
        if reader.kind() > PvsTargets::Objects as u32 {
            return Err(reader.content_error("the targets are neither cells nor objects").into());
        }
        reader.bytes((reader.fingerprint() as u32 as usize).saturating_add(1).saturating_mul(4))?;
        let pvs = Self { bytes, stamp: Stamp::new() };
        for viewcell in (0..pvs.word(16)).map(ViewcellId) {
            pvs.check_row(viewcell).map_err(|problem| PvsError::Row { viewcell, problem })?;
        }
        Ok(pvs)
    }

    fn check_row(&self, viewcell: ViewcellId) -> Result<(), &'static str> {
        let row = self.row(viewcell).ok_or("it lies outside the rows")?;
        let (base, runs) = parts(row).ok_or("it has no known form")?;
        if let Some(base) = base {
            let other = self.row(base).ok_or("it differs from an unknown viewcell")?;
            if !matches!(parts(other), Some((None, _))) {
                return Err("it differs from a row that is itself a difference");
            }
        }
        for run in runs {
            if run?.1 as usize > self.target_count() {
                return Err("it names an unknown target");
            }
        }
        Ok(())
    }

    /// Returns the bytes of a viewcell's row. `None` for an unknown viewcell, or if the offsets lie outside
    /// the rows.
    fn row(&self, viewcell: ViewcellId) -> Option<&[u8]> {
        if viewcell.index() >= self.viewcell_count() {
            return None;
        }
        let rows = HEADER_LENGTH + (self.viewcell_count() + 1) * 4;
        let [start, end] = [0, 1].map(|i| self.word(HEADER_LENGTH + (viewcell.index() + i) * 4) as usize);
        self.bytes.get(rows..)?.get(start..end)
    }

    /// Returns the runs of a viewcell's row, and the runs of its base row. The viewcell sees exactly the
    /// targets that are in one of the two and not in both. The runs of the base row are empty for a plain
    /// row; both are empty for an unknown viewcell.
    fn runs(&self, viewcell: ViewcellId) -> [Runs<'_>; 2] {
        let none = || Runs::new(&[], false);
        let of = |viewcell| self.row(viewcell).and_then(parts).unwrap_or((None, none()));
        let (base, runs) = of(viewcell);
        [runs, base.map_or_else(none, |base| of(base).1)]
    }

    /// Replaces `words` by the PVS row of a viewcell: bit `t % 64` of word `t / 64` is set if the viewcell
    /// sees target `t`. Returns false, with all bits clear, for an unknown viewcell. Time is linear in the
    /// bytes of the row and in the number of words.
    pub fn write_bits(&self, viewcell: ViewcellId, words: &mut Vec<u64>) -> bool {
        words.clear();
        words.resize(self.target_count().div_ceil(64), 0);
        for (start, end) in self.runs(viewcell).into_iter().flatten().flatten() {
            flip(words, start as usize, end as usize);
        }
        viewcell.index() < self.viewcell_count()
    }

    /// Replaces `words` by the union of the rows of several viewcells, one bit per target as in
    /// [`write_bits`](Self::write_bits). An unknown viewcell sees all targets. Without viewcells no bit is
    /// set. `row` is scratch memory. Time is linear in the bytes of the rows and, for each viewcell, in the
    /// number of words.
    pub fn write_union(&self, viewcells: &[ViewcellId], words: &mut Vec<u64>, row: &mut Vec<u64>) {
        words.clear();
        words.resize(self.target_count().div_ceil(64), 0);
        for &viewcell in viewcells {
            if !self.write_bits(viewcell, row) {
                flip(row, 0, self.target_count());
            }
            for (word, more) in words.iter_mut().zip(row.iter()) {
                *word |= more;
            }
        }
    }

    /// Tests whether a viewcell sees a target. Returns false if viewcell or target is unknown. Time is linear
    /// in the bytes of the row. For many targets of one viewcell, [`write_bits`](Self::write_bits) is faster.
    pub fn sees(&self, viewcell: ViewcellId, target: u32) -> bool {
        let runs = self.runs(viewcell).into_iter().flatten().flatten();
        runs.filter(|&(start, end)| start <= target && target < end).count() % 2 == 1
    }
}

/// Splits the bytes of a row into its base viewcell and its runs. The viewcell is `None` for a plain row.
/// Returns `None` if the row has no form or an unknown one.
fn parts(row: &[u8]) -> Option<(Option<ViewcellId>, Runs<'_>)> {
    let (&form, rest) = row.split_first()?;
    let (base, list) = match form & DIFFERS {
        0 => (None, rest),
        _ => rest
            .split_first_chunk()
            .map(|(base, list)| (Some(ViewcellId(u32::from_le_bytes(*base))), list))?,
    };
    (form <= DIFFERS | BITS).then_some((base, Runs::new(list, form & BITS != 0)))
}

/// Inverts the bits `start..end` of a bitset.
fn flip(words: &mut [u64], start: usize, end: usize) {
    if start >= end {
        return;
    }
    let (first, last) = (start / 64, (end - 1) / 64);
    let (head, tail) = (u64::MAX << (start % 64), u64::MAX >> (63 - (end - 1) % 64));
    if first == last {
        words[first] ^= head & tail;
        return;
    }
    words[first] ^= head;
    words[first + 1..last].iter_mut().for_each(|word| *word ^= u64::MAX);
    words[last] ^= tail;
}
