//! Loading a stored set, and asking it.

use super::runs::Runs;
use super::{HEADER, MAGIC, Pvs, PvsError, VERSION, checksum};
use crate::{CellId, Stamp};
use alloc::vec::Vec;

impl Pvs {
    /// Takes the bytes of a stored set as they are. They are read through once, to be sure that they are whole and make sense;
    /// nothing is built from them.
    ///
    /// # Errors
    /// [`PvsError`], with the reason.
    pub fn from_bytes(bytes: impl Into<Vec<u8>>) -> Result<Self, PvsError> {
        let bytes = bytes.into();
        let found = bytes.len() as u64;
        if !bytes.starts_with(&MAGIC) {
            return Err(PvsError::Magic);
        }
        let length = |expected| PvsError::Length { found, expected };
        if bytes.len() < HEADER {
            return Err(length(HEADER as u64));
        }
        let pvs = Self { bytes, stamp: Stamp::new() };
        if pvs.word(8) != VERSION {
            return Err(PvsError::Version { found: pvs.word(8) });
        }
        let [announced, sum] =
            [24, 32].map(|place| u64::from(pvs.word(place)) | u64::from(pvs.word(place + 4)) << 32);
        if announced != found {
            return Err(length(announced));
        }
        let least = HEADER as u64 + (u64::from(pvs.word(16)) + 1) * 4;
        if found < least {
            return Err(length(least));
        }
        if checksum(&pvs.bytes) != sum {
            return Err(PvsError::Checksum);
        }
        if pvs.word(12) > 1 {
            return Err(PvsError::Header { problem: "the targets are neither cells nor objects" });
        }
        for viewcell in (0..pvs.word(16)).map(CellId) {
            pvs.check_row(viewcell).map_err(|problem| PvsError::Row { viewcell, problem })?;
        }
        Ok(pvs)
    }

    fn check_row(&self, viewcell: CellId) -> Result<(), &'static str> {
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

    /// The bytes of a row.
    fn row(&self, viewcell: CellId) -> Option<&[u8]> {
        if viewcell.index() >= self.viewcell_count() {
            return None;
        }
        let rows = HEADER + (self.viewcell_count() + 1) * 4;
        let [start, end] = [0, 1].map(|i| self.word(HEADER + (viewcell.index() + i) * 4) as usize);
        self.bytes.get(rows..)?.get(start..end)
    }

    /// The runs of a row, and those that it differs from.
    fn runs(&self, viewcell: CellId) -> [Runs<'_>; 2] {
        let of = |viewcell| self.row(viewcell).and_then(parts).unwrap_or((None, &[]));
        let (base, runs) = of(viewcell);
        [Runs::new(runs), Runs::new(base.map_or(&[][..], |base| of(base).1))]
    }

    /// Writes what a viewcell sees, a bit for each target, to `words`, whose memory is reused. False, and then no bit is set, for an
    /// unknown viewcell. Takes time in proportion to the row's bytes and the words; never fails.
    pub fn write_bits(&self, viewcell: CellId, words: &mut Vec<u64>) -> bool {
        words.clear();
        words.resize(self.target_count().div_ceil(64), 0);
        for (start, end) in self.runs(viewcell).into_iter().flatten().flatten() {
            flip(words, start as usize, end as usize);
        }
        viewcell.index() < self.viewcell_count()
    }

    /// Whether a viewcell sees a target. False for unknown ones. Takes time in proportion to the row's bytes; for many questions about
    /// one viewcell see [`write_bits`](Self::write_bits).
    pub fn sees(&self, viewcell: CellId, target: u32) -> bool {
        let runs = self.runs(viewcell).into_iter().flatten().flatten();
        runs.filter(|&(start, end)| start <= target && target < end).count() % 2 == 1
    }
}

/// The viewcell that a row differs from, if any, and its runs.
fn parts(row: &[u8]) -> Option<(Option<CellId>, &[u8])> {
    match *row {
        [0, ref runs @ ..] => Some((None, runs)),
        [1, a, b, c, d, ref runs @ ..] => Some((Some(CellId(u32::from_le_bytes([a, b, c, d]))), runs)),
        _ => None,
    }
}

/// Turns over the bits from `start` up to `end`.
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

pub(super) fn word(bytes: &[u8], place: usize) -> u32 {
    match bytes.get(place..).and_then(|rest| rest.first_chunk()) {
        Some(&word) => u32::from_le_bytes(word),
        None => 0,
    }
}
