//! The cell-to-cell visibility of a map: one bit for each ordered pair of cells.

use alloc::vec::Vec;
use visibility_core::{
    cells::{CellGraph, CellId},
    pvs::{Pvs, PvsError, PvsTargets, ViewcellId},
};

/// The cell-to-cell visibility of a map: a square bit matrix with a row for each cell looked from and a bit
/// for each cell looked at.
///
/// In the `.vismat` format the rows follow each other, each of `ceil(cells / 8)` bytes; within a byte the
/// least significant bit is the cell of lowest index.
///
/// ```
/// use visibility_core::cells::CellId;
/// use visibility_portals::CellMatrix;
/// let matrix = CellMatrix::from_bytes(2, &[0b01, 0b11]).unwrap();
/// assert!(matrix.sees(CellId(1), CellId(0)) && !matrix.sees(CellId(0), CellId(1)));
/// assert_eq!(matrix.mean_visible(), 1.5);
/// assert_eq!(matrix.to_bytes(), [0b01, 0b11]);
/// ```
#[derive(Clone, Debug)]
pub struct CellMatrix {
    cells: usize,
    /// Number of 64-bit words in a row of `words`: `ceil(cells / 64)`.
    stride: usize,
    pub(crate) words: Vec<u64>,
    /// [Version](CellGraph::version) of the graph that the matrix was baked from. `None` if nobody knows it.
    source: Option<u64>,
}

impl PartialEq for CellMatrix {
    /// Compares the bits. What the matrices were baked from is not compared.
    fn eq(&self, other: &Self) -> bool {
        (self.cells, &self.words) == (other.cells, &other.words)
    }
}

impl Eq for CellMatrix {}

impl CellMatrix {
    /// Returns a matrix for `cells` cells with all bits clear: no cell sees any cell, not even itself.
    pub fn new(cells: usize) -> Self {
        let stride = cells.div_ceil(64);
        Self { cells, stride, words: alloc::vec![0; stride * cells], source: None }
    }

    /// Returns the matrix with the version of the graph that it is baked from.
    pub(crate) fn with_source(self, source: u64) -> Self {
        Self { source: Some(source), ..self }
    }

    /// Reads a matrix for `cells` cells in the `.vismat` format: row by row, each of `ceil(cells / 8)` bytes,
    /// least significant bit first. `None` if the length is not `ceil(cells / 8) * cells` bytes, or if a bit
    /// beyond the last cell of a row is set.
    pub fn from_bytes(cells: usize, bytes: &[u8]) -> Option<Self> {
        let row = cells.div_ceil(8);
        if bytes.len() != row.checked_mul(cells)? {
            return None;
        }
        let mut matrix = Self::new(cells);
        for (a, row) in bytes.chunks_exact(row.max(1)).enumerate() {
            for (i, &byte) in row.iter().enumerate() {
                matrix.words[a * matrix.stride + i / 8] |= u64::from(byte) << (i % 8 * 8);
            }
            if !cells.is_multiple_of(64) && matrix.words[(a + 1) * matrix.stride - 1] >> (cells % 64) != 0 {
                return None;
            }
        }
        Some(matrix)
    }

    /// Returns the matrix in the `.vismat` format: row by row, each of `ceil(cells / 8)` bytes, least
    /// significant bit first. Empty without cells.
    pub fn to_bytes(&self) -> Vec<u8> {
        let row = self.cells.div_ceil(8);
        let rows = self.words.chunks_exact(self.stride.max(1));
        rows.flat_map(|words| (0..row).map(|i| (words[i / 8] >> (i % 8 * 8)) as u8)).collect()
    }

    /// Returns the number of cells, which is the number of rows and of columns.
    pub fn cell_count(&self) -> usize {
        self.cells
    }

    /// Tests whether cell `from` sees cell `to`. `false` if `from` or `to` is not a cell of the matrix.
    pub fn sees(&self, from: CellId, to: CellId) -> bool {
        let known = from.index() < self.cells && to.index() < self.cells;
        known && self.words[from.index() * self.stride + to.index() / 64] >> (to.index() % 64) & 1 != 0
    }

    /// Returns the cells that cell `from` sees, in ascending order. Empty if the matrix has no such cell.
    pub fn seen_from(&self, from: CellId) -> impl Iterator<Item = CellId> + '_ {
        self.row(from.index())
            .iter()
            .enumerate()
            .flat_map(|(i, &word)| bits(word).map(move |bit| CellId(i as u32 * 64 + bit)))
    }

    /// Returns the number of ordered pairs (a, b) of cells for which a sees b, pairs (a, a) included. Time is
    /// proportional to the square of the number of cells.
    pub fn count(&self) -> u64 {
        self.words.iter().map(|word| u64::from(word.count_ones())).sum()
    }

    /// Returns the mean number of cells that a cell sees, itself included. 0 without cells.
    pub fn mean_visible(&self) -> f64 {
        if self.cells == 0 { 0.0 } else { self.count() as f64 / self.cells as f64 }
    }

    /// Tests whether the matrix equals its transpose: whenever cell a sees cell b, cell b sees cell a. Builds
    /// [`both_ways`](Self::both_ways) to compare. `false` if some pair of cells is seen in one direction
    /// only.
    pub fn is_symmetric(&self) -> bool {
        *self == self.both_ways()
    }

    /// Returns the matrix of mutual pairs: cell a sees cell b in the result if each sees the other in `self`.
    /// A line can be walked both ways, so the result is conservative if `self` is.
    #[must_use]
    pub fn both_ways(&self) -> Self {
        let mut both = Self { source: self.source, ..Self::new(self.cells) };
        for a in 0..self.cells {
            for b in self.seen_from(CellId(a as u32)) {
                if self.sees(b, CellId(a as u32)) {
                    both.set(a, b.index());
                }
            }
        }
        both
    }

    /// Converts the matrix to a compressed PVS whose viewcells and whose targets are the cells. Rows of cells
    /// that share a portal in `graph` may be stored as differences from each other.
    ///
    /// The PVS has the version of the graph as its [source](Pvs::source) if the matrix was baked from it. A
    /// matrix of [bytes](Self::from_bytes) does not tell what it was baked from, and its PVS has no source.
    ///
    /// # Errors
    /// [`PvsError::TooLarge`] if the PVS exceeds its storage limits.
    pub fn to_pvs(&self, graph: &CellGraph) -> Result<Pvs, PvsError> {
        let cells = (0..self.cells as u32).map(CellId);
        let rows: Vec<Vec<u32>> =
            cells.map(|cell| self.seen_from(cell).map(|seen| seen.0).collect()).collect();
        let pvs = Pvs::new(PvsTargets::Cells, self.cells, &rows, |viewcell| neighbours(graph, viewcell))?;
        Ok(match self.source {
            Some(source) if source == graph.version() => pvs.with_source(source),
            _ => pvs,
        })
    }

    /// Returns the row of cell `from`: bit i % 64 of word i / 64 is set if `from` sees cell i. Empty if the
    /// matrix has no cell `from`.
    pub(crate) fn row(&self, from: usize) -> &[u64] {
        if from < self.cells { &self.words[from * self.stride..][..self.stride] } else { &[] }
    }

    pub(crate) fn set(&mut self, from: usize, to: usize) {
        self.words[from * self.stride + to / 64] |= 1 << (to % 64);
    }
}

/// Returns the neighbours of a viewcell, where viewcell i is the volume of cell i: the viewcells of all cells
/// that share a portal with that cell, once for each shared portal. Empty for an unknown viewcell.
pub(crate) fn neighbours(graph: &CellGraph, viewcell: ViewcellId) -> impl Iterator<Item = ViewcellId> + '_ {
    let cell = CellId(viewcell.0);
    let portals = graph.portals_of(cell).iter().filter_map(|&id| graph.portal(id));
    portals.map(move |portal| portal.other(cell).into())
}

/// Returns the indices (0 to 63) of the set bits of `word`, in ascending order.
pub(crate) fn bits(mut word: u64) -> impl Iterator<Item = u32> {
    core::iter::from_fn(move || {
        let bit = (word != 0).then(|| word.trailing_zeros());
        word &= word.wrapping_sub(1);
        bit
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_of_the_wrong_length_or_with_stray_bits_are_refused() {
        assert!(CellMatrix::from_bytes(3, &[7, 7]).is_none(), "two bytes for three rows");
        assert!(CellMatrix::from_bytes(3, &[7, 8, 0]).is_none(), "a bit of a fourth cell");
        assert!(
            CellMatrix::from_bytes(0, &[]).is_some_and(|m| m.is_symmetric() && m.mean_visible() == 0.0),
            "no cells are a matrix, on whose mean nothing is visible"
        );
        assert!(CellMatrix::from_bytes(usize::MAX, &[]).is_none(), "a count of cells whose bytes overflow");
    }

    #[test]
    fn both_ways_keeps_mutual_pairs() {
        let bytes: Vec<u8> =
            (0..70 * 9).map(|i| if i % 9 == 8 { 0x21 } else { (i * 37 % 251) as u8 }).collect();
        let matrix = CellMatrix::from_bytes(70, &bytes).unwrap();
        assert_eq!(matrix.to_bytes(), bytes, "the matrix as bytes again");
        let both = matrix.both_ways();
        assert!(
            both.is_symmetric() && !matrix.is_symmetric() && both.count() < matrix.count(),
            "a symmetric matrix with fewer pairs"
        );
        let all = (0..70).flat_map(|a| (0..70).map(move |b| (CellId(a), CellId(b))));
        all.for_each(|(a, b)| {
            assert_eq!(
                both.sees(a, b),
                matrix.sees(a, b) && matrix.sees(b, a),
                "whether {a:?} and {b:?} see each other"
            )
        });
        assert_eq!(
            matrix.seen_from(CellId(69)).count(),
            matrix.row(69).iter().map(|w| w.count_ones() as usize).sum(),
            "cells listed, and bits of the row"
        );
        assert_eq!(matrix.seen_from(CellId(70)).count(), 0, "an unknown cell sees none");
    }
}
