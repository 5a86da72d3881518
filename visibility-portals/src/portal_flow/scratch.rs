//! Scratch memory of flows, and the candidates of a source.

use super::known::Known;
use crate::cell_matrix::bits;
use crate::lp::MOST;
use crate::stabbing::pluecker::Pluecker;
use alloc::vec::Vec;
use core::ops::Range;
use visibility_core::geometry::Plane;
use visibility_core::glam::DVec3;

/// Scratch memory, which serves one flow after another.
#[derive(Default)]
pub struct Scratch {
    /// The portals that may be seen through the source, ascending. Their places in this list number them.
    pub(crate) candidates: Vec<u32>,
    pub(crate) count: usize,
    /// Words in a set of candidates.
    pub(crate) words: usize,
    /// By candidate: center and radius of a ball that holds it.
    pub(crate) balls: Vec<(DVec3, f64)>,
    /// By candidate: the cell that it leads to.
    pub(crate) to: Vec<u32>,
    /// By candidate: whether the plane of the source may cut it.
    pub(crate) cut: Vec<bool>,
    /// By cell: the range of the candidates that lead from it.
    pub(crate) of_cell: Vec<(u32, u32)>,
    /// By candidate: where its row begins in `rows`, or `NO_ROW`.
    row_of: Vec<u32>,
    /// Rows of [`Known::rows`], with the bits of candidates alone. Made when first asked for.
    pub(crate) rows: Vec<u64>,
    /// For each word of a full row that has candidates: its index, the bits of candidates, and how many
    /// candidates come before.
    mask: Vec<(u32, u64, u32)>,
    /// The candidates that lead to cells not yet known to be seen.
    pub(crate) goals: Vec<u64>,
    /// The candidates that are seen, or may be.
    pub(crate) reached: Vec<u64>,
    pub(crate) points: Vec<DVec3>,
    pub(crate) planes: Vec<Plane>,
    /// Sets of candidates, one for each link of the chain.
    pub(crate) sets: Vec<u64>,
    pub(crate) frames: Vec<Frame>,
    /// By cell: the number of the flood that came to it last.
    pub(crate) stamps: Vec<u32>,
    pub(crate) stamp: u32,
    pub(crate) queue: Vec<u32>,
    pub(crate) pluecker: Pluecker,
    /// What was excluded last in this flow, at most 32.
    pub(crate) refuted: Vec<Refuted>,
    /// Index of the one to be replaced next.
    pub(crate) oldest: usize,
}

/// A link of the chain of portals that is being looked at.
#[derive(Clone, Debug)]
pub(crate) struct Frame {
    /// The portal.
    pub(crate) portal: u32,
    /// The cell behind it.
    pub(crate) cell: u32,
    /// The part of the source that lines can come from, a range of `points`.
    pub(crate) source: Range<usize>,
    /// The part of this portal that they can pass, a range of `points`.
    pub(crate) pass: Range<usize>,
    /// The planes that bound what comes after, a range of `planes`.
    pub(crate) planes: Range<usize>,
    /// Where the set of candidates that can be reached from here begins in `sets`.
    pub(crate) set: usize,
    /// The next candidate to look at.
    pub(crate) next: u32,
    /// Length of `points` before this link.
    pub(crate) points: usize,
}

/// Portals that no line passes all of, by a certificate.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Refuted {
    pub(crate) portals: [u32; MOST],
    pub(crate) count: usize,
}

const NO_ROW: u32 = u32::MAX;

impl Scratch {
    /// Takes in the candidates of a source and forgets the last flow.
    pub(crate) fn begin(&mut self, known: &Known, source: u32) {
        let all = &known.portals.all;
        let row = &known.rows[source as usize * known.stride..][..known.stride];
        self.candidates.clear();
        self.mask.clear();
        for (i, &word) in row.iter().enumerate().filter(|(_, word)| **word != 0) {
            self.mask.push((i as u32, word, self.candidates.len() as u32));
            self.candidates.extend(bits(word).map(|bit| i as u32 * 64 + bit));
        }
        self.count = self.candidates.len();
        self.words = self.count.div_ceil(64);
        self.of_cell.clear();
        self.of_cell.resize(known.portals.first.len(), (0, 0));
        self.stamps.resize(known.portals.first.len(), 0);
        self.balls.clear();
        self.to.clear();
        self.cut.clear();
        let plane = all[source as usize].plane;
        for (i, &candidate) in self.candidates.iter().enumerate() {
            let portal = &all[candidate as usize];
            self.balls.push((portal.center, portal.radius));
            self.to.push(portal.to);
            self.cut.push(plane.signed_distance(portal.center) < portal.radius + known.portals.margins.keep);
            let range = &mut self.of_cell[portal.from as usize];
            if range.1 == 0 {
                range.0 = i as u32;
            }
            range.1 = i as u32 + 1;
        }
        self.row_of.clear();
        self.row_of.resize(self.count, NO_ROW);
        self.rows.clear();
        for set in [&mut self.goals, &mut self.reached] {
            set.clear();
            set.resize(self.words, 0);
        }
        let from = all[source as usize].from as usize;
        let seen = &known.seen[from * known.cell_stride..][..known.cell_stride];
        for (i, &to) in self.to.iter().enumerate() {
            if seen[to as usize / 64] >> (to % 64) & 1 == 0 {
                self.goals[i / 64] |= 1 << (i % 64);
            }
        }
        self.points.clear();
        self.planes.clear();
        self.sets.clear();
        self.frames.clear();
        // Of this flood alone: which came before depends on the threads.
        self.refuted.clear();
        self.oldest = 0;
    }

    /// Where the row of a candidate begins in `rows`.
    pub(crate) fn row(&mut self, known: &Known, candidate: usize) -> usize {
        if self.row_of[candidate] == NO_ROW {
            self.row_of[candidate] = self.rows.len() as u32;
            let row = &known.rows[self.candidates[candidate] as usize * known.stride..][..known.stride];
            compress(row, &self.mask, self.words, &mut self.rows);
        }
        self.row_of[candidate] as usize
    }

    /// The row that begins there.
    pub(crate) fn row_words(&self, start: usize) -> &[u64] {
        &self.rows[start..start + self.words]
    }
}

/// Appends those bits of a full row that are candidates, moved together, to `out`.
pub(crate) fn compress(row: &[u64], mask: &[(u32, u64, u32)], words: usize, out: &mut Vec<u64>) {
    let start = out.len();
    out.resize(start + words, 0);
    let out = &mut out[start..];
    for &(i, mask, before) in mask {
        let common = row[i as usize] & mask;
        if common == mask {
            // The usual case among neighbours: all of them, so that nothing must be moved together.
            let count = mask.count_ones();
            let ones = u64::MAX >> (64 - count);
            let (word, shift) = (before as usize / 64, before % 64);
            out[word] |= ones << shift;
            if shift + count > 64 {
                out[word + 1] |= ones >> (64 - shift);
            }
            continue;
        }
        for bit in bits(common) {
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
        let mut state = 1u64;
        let mut random = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            state ^ state >> 29
        };
        // Whole words, too: those are moved at once.
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
                assert_eq!(out[place / 64] >> (place % 64) & 1, row[i / 64] >> (i % 64) & 1);
            }
        }
    }
}
