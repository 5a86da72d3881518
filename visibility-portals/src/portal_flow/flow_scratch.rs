//! Scratch memory of flows, and the candidates of a source.

use super::flow_input::FlowInput;
use crate::pluecker::{MAX_ROWS, Pluecker};
use crate::portal_chain::{CellFlood, PortalChain};
use alloc::vec::Vec;
use core::ops::Range;
use smallvec::SmallVec;
use visibility_core::bits::Bits;
use visibility_core::glam::DVec3;
use visibility_core::scene::lanes;

/// Scratch memory of the search through one directed portal, the source; reused by one search after another.
/// A candidate is a directed portal that may be seen through the source. A candidate's index is its position
/// in `candidates`; bitsets over the candidates have one bit for each, in this order.
#[derive(Default, Debug)]
pub struct FlowScratch {
    /// Indices in `DirectedPortals::all` of the portals that may be seen through the source, ascending.
    pub(crate) candidates: Vec<u32>,
    pub(crate) count: usize,
    /// Number of 64-bit words in a bitset over the candidates: their count divided by 64, rounded up.
    pub(crate) words: usize,
    /// By candidate index: centre and radius of a ball that contains the portal, in world space.
    pub(crate) balls: Vec<(DVec3, f64)>,
    /// By candidate index: index of the cell that the portal leads to.
    pub(crate) to: Vec<u32>,
    /// By candidate index: true if the plane of the source may cut the portal, so that the portal must be
    /// clipped to that plane; false if the portal lies entirely in front of that plane.
    pub(crate) cut: Vec<bool>,
    /// By cell index: the range of the indices of candidates that lead from the cell. 0..0 if there are
    /// none.
    pub(crate) of_cell: Vec<Range<u32>>,
    /// By candidate index: offset of the candidate's row in `rows`, or `NO_ROW` if the row has not been made
    /// yet.
    row_of: Vec<u32>,
    /// Rows of `words` words, one for each candidate a whose row has been used; `row_of` holds their
    /// offsets. In the row of a, bit i is 1 if a line through a may later pass candidate i. A copy of
    /// [`FlowInput::rows`] reduced to the bits of the candidates.
    pub(crate) rows: Vec<u64>,
    /// The words of the source's row in [`FlowInput::rows`] that are not 0: the index of the word, its bits
    /// (the candidates), and the number of candidates in earlier words.
    mask: Vec<(u32, u64, u32)>,
    /// Bitset over the candidates: bit i is 1 while candidate i leads to a cell not yet known to be seen.
    pub(crate) goals: Bits,
    /// Bitset over the candidates: bit i is 1 once candidate i is seen or could not be excluded.
    pub(crate) reached: Bits,
    /// The current chain of portals. Bit numbers of its bitsets and of its frames' children are candidate
    /// indices.
    pub(crate) chain: PortalChain,
    pub(crate) flood: CellFlood,
    pub(crate) pluecker: Pluecker,
    /// Sets of portals, as indices in `DirectedPortals::all`, such that no line passes all portals of a set.
    /// One set for each of the last certificates (proofs in Pluecker space) of this flow, at most 32.
    pub(crate) refuted: Vec<SmallVec<[u32; MAX_ROWS]>>,
    /// Index in `refuted` (sets of portals that no line passes) of the oldest set, which the next
    /// certificate replaces.
    pub(crate) oldest: usize,
}

/// Number that stands for no row.
const NO_ROW: u32 = u32::MAX;

impl FlowScratch {
    /// Collects the candidates of directed portal `source` (the portals that may be seen through it), and
    /// discards the data of the last flow.
    pub(crate) fn begin(&mut self, input: &FlowInput, source: u32) {
        let all = &input.portals.all;
        let row = input.rows[source as usize].words();
        self.candidates.clear();
        self.mask.clear();
        for (i, &word) in row.iter().enumerate().filter(|(_, word)| **word != 0) {
            self.mask.push((i as u32, word, self.candidates.len() as u32));
            self.candidates.extend(lanes(word).map(|bit| (i * 64 + bit) as u32));
        }
        self.count = self.candidates.len();
        self.words = self.count.div_ceil(64);
        self.of_cell.clear();
        self.of_cell.resize(input.portals.first.len(), 0..0);
        self.balls.clear();
        self.to.clear();
        self.cut.clear();
        // Candidates of one cell are neighbours, as directed portals are ordered by cell: `of_cell` is their
        // range.
        let plane = all[source as usize].plane;
        for (i, &candidate) in self.candidates.iter().enumerate() {
            let portal = &all[candidate as usize];
            self.balls.push((portal.center, portal.radius));
            self.to.push(portal.to);
            self.cut.push(plane.signed_distance(portal.center) < portal.radius + input.portals.margins.keep);
            let range = &mut self.of_cell[portal.from as usize];
            if range.end == 0 {
                range.start = i as u32;
            }
            range.end = i as u32 + 1;
        }
        self.row_of.clear();
        self.row_of.resize(self.count, NO_ROW);
        self.rows.clear();
        self.goals.reset(self.count);
        self.reached.reset(self.count);
        // Goals lead to a cell that is not known to be seen from the source's cell.
        let seen = &input.seen.rows[all[source as usize].from as usize];
        for (i, &to) in self.to.iter().enumerate() {
            self.goals.set(i, !seen.contains(to as usize));
        }
        self.chain.clear();
        // Certificates are not kept between flows: which flows a thread ran before depends on scheduling.
        self.refuted.clear();
        self.oldest = 0;
    }

    /// Returns the offset in `self.rows` of the row of a candidate portal (the bitset of candidates that a
    /// line through it may later pass), and makes the row on first use.
    pub(crate) fn row(&mut self, input: &FlowInput, candidate: usize) -> usize {
        if self.row_of[candidate] == NO_ROW {
            self.row_of[candidate] = self.rows.len() as u32;
            let row = input.rows[self.candidates[candidate] as usize].words();
            compress(row, &self.mask, self.words, &mut self.rows);
        }
        self.row_of[candidate] as usize
    }

    /// Returns the row at offset `start` in `self.rows`: a bitset with bit i set if a line through the row's
    /// portal may later pass candidate i.
    pub(crate) fn row_words(&self, start: usize) -> &[u64] {
        &self.rows[start..start + self.words]
    }
}

/// Appends to `out` the bits of `row` that `mask` selects, compacted into `words` words. Each entry of `mask`
/// holds the index of a word, the selected bits, and the number of selected bits in earlier words.
pub(crate) fn compress(row: &[u64], mask: &[(u32, u64, u32)], words: usize, out: &mut Vec<u64>) {
    let start = out.len();
    out.resize(start + words, 0);
    let out = &mut out[start..];
    for &(i, mask, before) in mask {
        let common = row[i as usize] & mask;
        if common == mask {
            // The usual case among neighbours: all selected bits are set, and no bit must be moved singly.
            let count = mask.count_ones();
            let ones = u64::MAX >> (64 - count);
            let (word, shift) = (before as usize / 64, before % 64);
            out[word] |= ones << shift;
            if shift + count > 64 {
                out[word + 1] |= ones >> (64 - shift);
            }
            continue;
        }
        for bit in lanes(common) {
            let place = before + (mask & ((1 << bit) - 1)).count_ones();
            out[place as usize / 64] |= 1 << (place % 64);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn compressed_rows_hold_the_same_bits() {
        let mut random = visibility_testing::Random(1);
        let mut random = || random.bits();
        // Some words have all bits set, to test the path that moves whole words.
        let word = |random: &mut dyn FnMut() -> u64| if random() & 3 == 0 { u64::MAX } else { random() };
        for _ in 0..200 {
            let full: Vec<u64> = (0..7).map(|_| word(&mut random) & word(&mut random)).collect();
            let row: Vec<u64> = (0..7).map(|_| word(&mut random)).collect();
            let numbers: Vec<usize> = (0..448).filter(|i| full[i / 64] >> (i % 64) & 1 != 0).collect();
            let mut mask = Vec::new();
            let mut before = 0;
            for (i, &word) in full.iter().enumerate().filter(|(_, word)| **word != 0) {
                mask.push((i as u32, word, before));
                before += word.count_ones();
            }
            let mut out = Vec::new();
            compress(&row, &mask, numbers.len().div_ceil(64), &mut out);
            for (place, &i) in numbers.iter().enumerate() {
                assert_eq!(
                    out[place / 64] >> (place % 64) & 1,
                    row[i / 64] >> (i % 64) & 1,
                    "target {i} is bit {place} of the compressed row"
                );
            }
        }
    }
}
