//! Loading and querying a stored PVS.

use super::runs::Runs;
use super::{BITS, BLOCK, DEPTH, DIFFERS, FORMAT, Pvs, PvsError, PvsTargets, ViewcellId};
use crate::binary_format::{FormatError, HEADER_LENGTH, Reader, take_number};
use crate::stamp::Stamp;
use alloc::vec::Vec;

/// Length in bytes of the hash that [`Pvs::source`] returns, stored after the last row of a PVS that has one.
const SOURCE_BYTES: usize = 8;

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
        let count = reader.fingerprint() as u32 as usize;
        reader.bytes((count.div_ceil(BLOCK) + 1).saturating_mul(4))?;
        let pvs = Self { bytes, stamp: Stamp::new() };
        let mut depths: Vec<u8> = Vec::new();
        for viewcell in (0..pvs.word(16)).map(ViewcellId) {
            let depth = pvs.check_row(viewcell, &depths);
            depths.push(depth.map_err(|problem| PvsError::Row { viewcell, problem })?);
        }
        let rest = pvs.bytes.len().saturating_sub(pvs.rows_end());
        if rest != 0 && rest != SOURCE_BYTES {
            let (offset, problem) = (pvs.rows_end(), "neither the end nor a source follows the last row");
            return Err(FormatError::Content { offset, problem }.into());
        }
        Ok(pvs)
    }

    /// Returns the offset of the first byte after the last row.
    pub(super) fn rows_end(&self) -> usize {
        let blocks = self.viewcell_count().div_ceil(BLOCK);
        let rows = HEADER_LENGTH + (blocks + 1) * 4;
        rows.saturating_add(self.word(HEADER_LENGTH + blocks * 4) as usize)
    }

    /// Checks a row. All rows before it must have been checked already. Returns the number of other rows that
    /// must be read to decode the row; `depths` holds this number for each row before it. `Err` describes the
    /// fault of the row.
    fn check_row(&self, viewcell: ViewcellId, depths: &[u8]) -> Result<u8, &'static str> {
        let row = self.row(viewcell).ok_or("it lies outside the rows")?;
        // Bits are numbered by `u32`.
        if row.len() >= 1 << 29 {
            return Err("it is too long");
        }
        let Row { base, runs } = Row::new(viewcell, row).ok_or("it has no known form")?;
        let depth = match base {
            None => 0,
            Some(base) => depths.get(base.index()).copied().unwrap_or(DEPTH) + 1,
        };
        if depth > DEPTH {
            return Err("it takes too many other rows");
        }
        for run in runs {
            if run?.1 as usize > self.target_count() {
                return Err("it names an unknown target");
            }
        }
        Ok(depth)
    }

    /// Returns the bytes of a viewcell's row, without the byte count in front of them. `None` for an unknown
    /// viewcell, or if the row reaches beyond its block of rows.
    fn row(&self, viewcell: ViewcellId) -> Option<&[u8]> {
        if viewcell.index() >= self.viewcell_count() {
            return None;
        }
        let block = viewcell.index() / BLOCK;
        let rows = HEADER_LENGTH + (self.viewcell_count().div_ceil(BLOCK) + 1) * 4;
        let [start, end] = [0, 1].map(|i| self.word(HEADER_LENGTH + (block + i) * 4) as usize);
        let mut rest = self.bytes.get(rows..)?.get(start..end)?;
        for _ in 0..viewcell.index() % BLOCK {
            let length = take_number(&mut rest)?;
            rest = rest.get(length as usize..)?;
        }
        let length = take_number(&mut rest)?;
        rest.get(..length as usize)
    }

    /// Returns the runs, as half-open ranges of targets, of a viewcell's row and of the rows that it is
    /// stored as a difference from. The viewcell sees exactly the targets that are in an odd number of runs.
    /// Empty for an unknown viewcell.
    fn runs(&self, viewcell: ViewcellId) -> impl Iterator<Item = (u32, u32)> {
        let row = |viewcell| Row::new(viewcell, self.row(viewcell)?);
        let rows = core::iter::successors(row(viewcell), move |last| row(last.base?));
        rows.flat_map(|row| row.runs.flatten())
    }

    /// Replaces `words` by the PVS row of a viewcell: bit `t % 64` of word `t / 64` is set if the viewcell
    /// sees target `t`. Returns false, with all bits clear, for an unknown viewcell. Time is linear in the
    /// bytes of the row and in the number of words.
    ///
    /// `words` gets one bit per target. Forged bytes of a PVS may state a huge [number of
    /// targets](Self::target_count): compare that number with the expected one before calling this function.
    pub fn write_bits(&self, viewcell: ViewcellId, words: &mut Vec<u64>) -> bool {
        self.write_first_bits(viewcell, self.target_count(), words)
    }

    /// Replaces `words` by the first `count` bits of the PVS row of a viewcell, as
    /// [`write_bits`](Self::write_bits) does.
    pub(super) fn write_first_bits(&self, viewcell: ViewcellId, count: usize, words: &mut Vec<u64>) -> bool {
        words.clear();
        words.resize(count.div_ceil(64), 0);
        for (start, end) in self.runs(viewcell) {
            flip(words, start as usize, count.min(end as usize));
        }
        viewcell.index() < self.viewcell_count()
    }

    /// Replaces `words` by the union of the rows of several viewcells, one bit per target as in
    /// [`write_bits`](Self::write_bits). An unknown viewcell sees all targets. No bit is set if `viewcells`
    /// is empty. `row` is scratch memory. Time is linear in the bytes of the rows and, for each viewcell, in
    /// the number of words.
    pub fn write_union(&self, viewcells: &[ViewcellId], words: &mut Vec<u64>, row: &mut Vec<u64>) {
        self.write_first_union(viewcells, self.target_count(), words, row);
    }

    /// Replaces `words` by the first `count` bits of the union of rows, as
    /// [`write_union`](Self::write_union) does.
    pub(super) fn write_first_union(
        &self,
        viewcells: &[ViewcellId],
        count: usize,
        words: &mut Vec<u64>,
        row: &mut Vec<u64>,
    ) {
        words.clear();
        words.resize(count.div_ceil(64), 0);
        for &viewcell in viewcells {
            if !self.write_first_bits(viewcell, count, row) {
                flip(row, 0, count);
            }
            for (word, more) in words.iter_mut().zip(row.iter()) {
                *word |= more;
            }
        }
    }

    /// Tests whether a viewcell sees a target. Returns false if viewcell or target is unknown. Time is linear
    /// in the bytes of the row. For many targets of one viewcell, [`write_bits`](Self::write_bits) is faster.
    pub fn sees(&self, viewcell: ViewcellId, target: u32) -> bool {
        let runs = self.runs(viewcell);
        runs.filter(|&(start, end)| start <= target && target < end).count() % 2 == 1
    }
}

/// A stored row: its flags, its base row and its list, not decoded.
struct Row<'a> {
    /// Viewcell with a lower number from whose row this row is stored as a difference. `None` for a row
    /// stored by itself.
    base: Option<ViewcellId>,
    runs: Runs<'a>,
}

impl<'a> Row<'a> {
    /// Splits the bytes of a viewcell's row. `None` if the first byte, the row's form, is missing or unknown,
    /// or if the row is a difference from a row that does not come before it.
    fn new(viewcell: ViewcellId, bytes: &'a [u8]) -> Option<Self> {
        let (&form, mut list) = bytes.split_first()?;
        let base = match form & DIFFERS {
            0 => None,
            _ => {
                let back = take_number(&mut list).filter(|&back| back > 0)?;
                Some(ViewcellId(viewcell.0.checked_sub(back)?))
            }
        };
        (form <= DIFFERS | BITS).then_some(Self { base, runs: Runs::new(list, form & BITS != 0) })
    }
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
