//! Loading a stored PVS, and asking it.

use super::runs::Runs;
use super::{FORMAT, Pvs, PvsError, PvsTargets, ViewcellId};
use crate::envelope::{HEADER, Reader};
use crate::stamp::Stamp;
use alloc::vec::Vec;

impl Pvs {
    /// Takes the bytes of a stored PVS. They are read through once, to make sure that they are whole and make
    /// sense. Nothing is built from them.
    ///
    /// # Errors
    /// [`PvsError::Envelope`], [`PvsError::Row`].
    pub fn from_bytes(bytes: impl Into<Vec<u8>>) -> Result<Self, PvsError> {
        let bytes = bytes.into();
        let mut reader = Reader::new(&bytes, FORMAT)?;
        if reader.kind() > PvsTargets::Objects as u32 {
            return Err(reader.wrong("the targets are neither cells nor objects").into());
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
        let (base, runs) = parts(row).ok_or("it begins with neither 0 nor 1 and a viewcell")?;
        if let Some(base) = base {
            let other = self.row(base).ok_or("it differs from an unknown viewcell")?;
            if other.first() != Some(&0) {
                return Err("it differs from a row that is itself a difference");
            }
        }
        for run in Runs::new(runs) {
            if run?.1 as usize > self.target_count() {
                return Err("it names an unknown target");
            }
        }
        Ok(())
    }

    /// The bytes of the row of a viewcell. `None` for an unknown one, or if they are outside the rows.
    fn row(&self, viewcell: ViewcellId) -> Option<&[u8]> {
        if viewcell.index() >= self.viewcell_count() {
            return None;
        }
        let rows = HEADER + (self.viewcell_count() + 1) * 4;
        let [start, end] = [0, 1].map(|i| self.word(HEADER + (viewcell.index() + i) * 4) as usize);
        self.bytes.get(rows..)?.get(start..end)
    }

    /// The runs of a row, and the runs of the row that it differs from.
    fn runs(&self, viewcell: ViewcellId) -> [Runs<'_>; 2] {
        let of = |viewcell| self.row(viewcell).and_then(parts).unwrap_or((None, &[]));
        let (base, runs) = of(viewcell);
        [Runs::new(runs), Runs::new(base.map_or(&[][..], |base| of(base).1))]
    }

    /// Writes one bit for each target, set if the viewcell sees it, to `words`, whose memory is reused. For
    /// an unknown viewcell, sets no bit and returns false. Takes time in proportion to the bytes of the row
    /// and to the words.
    pub fn write_bits(&self, viewcell: ViewcellId, words: &mut Vec<u64>) -> bool {
        words.clear();
        words.resize(self.target_count().div_ceil(64), 0);
        for (start, end) in self.runs(viewcell).into_iter().flatten().flatten() {
            flip(words, start as usize, end as usize);
        }
        viewcell.index() < self.viewcell_count()
    }

    /// Writes one bit for each target, set if any of the viewcells sees it, to `words`. An unknown viewcell
    /// sees all; no viewcells see none. The memory of `words` and of `row` is reused; what `row` holds then
    /// is of no use. Takes time in proportion to the bytes of the rows and, for each viewcell, to the words.
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

    /// Whether a viewcell sees a target. False if either is unknown. Takes time in proportion to the bytes of
    /// the row; for many questions about one viewcell see [`write_bits`](Self::write_bits).
    pub fn sees(&self, viewcell: ViewcellId, target: u32) -> bool {
        let runs = self.runs(viewcell).into_iter().flatten().flatten();
        runs.filter(|&(start, end)| start <= target && target < end).count() % 2 == 1
    }
}

/// The viewcell that a row differs from, if any, and its runs. `None` if the row is neither.
fn parts(row: &[u8]) -> Option<(Option<ViewcellId>, &[u8])> {
    match *row {
        [0, ref runs @ ..] => Some((None, runs)),
        [1, a, b, c, d, ref runs @ ..] => Some((Some(ViewcellId(u32::from_le_bytes([a, b, c, d]))), runs)),
        _ => None,
    }
}

/// Inverts the bits from `start` up to `end`, exclusive.
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
