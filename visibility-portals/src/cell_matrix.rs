//! The cell-to-cell visibility of a map: one bit for each pair of cells.

use alloc::vec::Vec;
use visibility_core::{
    cells::{CellGraph, CellId},
    pvs::{Pvs, PvsError, PvsTargets, ViewcellId},
};

/// The cell-to-cell visibility of a map: a row for each cell looked from, with a bit for each cell looked at.
///
/// Stored as bytes in the `.vismat` format: row by row, each of `ceil(cells / 8)` bytes, least significant
/// bit first.
///
/// ```
/// use visibility_core::cells::CellId;
/// use visibility_portals::CellMatrix;
/// let matrix = CellMatrix::from_bytes(2, &[0b01, 0b11]).unwrap();
/// assert!(matrix.sees(CellId(1), CellId(0)) && !matrix.sees(CellId(0), CellId(1)));
/// assert_eq!(matrix.mean_visible(), 1.5);
/// assert_eq!(matrix.to_bytes(), [0b01, 0b11]);
/// ```
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct CellMatrix {
    cells: usize,
    /// Words in a row.
    stride: usize,
    words: Vec<u64>,
}

impl CellMatrix {
    /// A matrix in which no cell sees any, not even itself.
    pub fn new(cells: usize) -> Self {
        let stride = cells.div_ceil(64);
        Self { cells, stride, words: alloc::vec![0; stride * cells] }
    }

    /// Reads the `.vismat` format. `None` if the length does not fit the number of cells, or if a bit beyond
    /// the last cell is set.
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

    /// Writes the `.vismat` format.
    pub fn to_bytes(&self) -> Vec<u8> {
        let row = self.cells.div_ceil(8);
        let rows = self.words.chunks_exact(self.stride.max(1));
        rows.flat_map(|words| (0..row).map(|i| (words[i / 8] >> (i % 8 * 8)) as u8)).collect()
    }

    /// The number of cells.
    pub fn cell_count(&self) -> usize {
        self.cells
    }

    /// Whether one cell sees another. False if either is unknown.
    pub fn sees(&self, from: CellId, to: CellId) -> bool {
        let known = from.index() < self.cells && to.index() < self.cells;
        known && self.words[from.index() * self.stride + to.index() / 64] >> (to.index() % 64) & 1 != 0
    }

    /// The cells that a cell sees, ascending. Empty for an unknown cell.
    pub fn seen_from(&self, from: CellId) -> impl Iterator<Item = CellId> + '_ {
        self.row(from.index())
            .iter()
            .enumerate()
            .flat_map(|(i, &word)| bits(word).map(move |bit| CellId(i as u32 * 64 + bit)))
    }

    /// The number of pairs of a cell and a cell that it sees.
    pub fn count(&self) -> u64 {
        self.words.iter().map(|word| u64::from(word.count_ones())).sum()
    }

    /// The mean number of cells that a cell sees. 0 without cells.
    pub fn mean_visible(&self) -> f64 {
        if self.cells == 0 { 0.0 } else { self.count() as f64 / self.cells as f64 }
    }

    /// Whether every cell is seen by all cells that it sees.
    pub fn is_symmetric(&self) -> bool {
        *self == self.both_ways()
    }

    /// The pairs of cells that see each other. A line can be walked both ways, so this is conservative if the
    /// matrix is.
    pub fn both_ways(&self) -> Self {
        let mut both = Self::new(self.cells);
        for a in 0..self.cells {
            for b in self.seen_from(CellId(a as u32)) {
                if self.sees(b, CellId(a as u32)) {
                    both.set(a, b.index());
                }
            }
        }
        both
    }

    /// The same as a compressed PVS, with the cells as viewcells and as targets. Rows of cells that share a
    /// portal in `graph` are stored by their differences.
    ///
    /// # Errors
    /// [`PvsError::TooLarge`].
    pub fn to_pvs(&self, graph: &CellGraph) -> Result<Pvs, PvsError> {
        let cells = (0..self.cells as u32).map(CellId);
        let rows: Vec<Vec<u32>> =
            cells.map(|cell| self.seen_from(cell).map(|seen| seen.0).collect()).collect();
        Pvs::new(PvsTargets::Cells, self.cells, &rows, |viewcell| neighbours(graph, viewcell))
    }

    /// The bits of the cells that a cell sees. Empty for an unknown cell.
    pub(crate) fn row(&self, from: usize) -> &[u64] {
        if from < self.cells { &self.words[from * self.stride..][..self.stride] } else { &[] }
    }

    pub(crate) fn set(&mut self, from: usize, to: usize) {
        self.words[from * self.stride + to / 64] |= 1 << (to % 64);
    }
}

/// The cells that share a portal with a cell, as viewcells. A cell is named once for each portal.
pub(crate) fn neighbours(graph: &CellGraph, viewcell: ViewcellId) -> impl Iterator<Item = ViewcellId> + '_ {
    let cell = CellId(viewcell.0);
    let portals = graph.portals_of(cell).iter().filter_map(|&id| graph.portal(id));
    portals.map(move |portal| portal.other(cell).into())
}

/// The places of the bits that are set, ascending.
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
        assert!(CellMatrix::from_bytes(3, &[7, 7]).is_none());
        assert!(CellMatrix::from_bytes(3, &[7, 8, 0]).is_none());
        assert!(CellMatrix::from_bytes(0, &[]).is_some_and(|m| m.is_symmetric() && m.mean_visible() == 0.0));
        assert!(CellMatrix::from_bytes(usize::MAX, &[]).is_none());
    }

    #[test]
    fn both_ways_keeps_mutual_pairs() {
        let bytes: Vec<u8> =
            (0..70 * 9).map(|i| if i % 9 == 8 { 0x21 } else { (i * 37 % 251) as u8 }).collect();
        let matrix = CellMatrix::from_bytes(70, &bytes).unwrap();
        assert_eq!(matrix.to_bytes(), bytes);
        let both = matrix.both_ways();
        assert!(both.is_symmetric() && !matrix.is_symmetric() && both.count() < matrix.count());
        let all = (0..70).flat_map(|a| (0..70).map(move |b| (CellId(a), CellId(b))));
        all.for_each(|(a, b)| assert_eq!(both.sees(a, b), matrix.sees(a, b) && matrix.sees(b, a)));
        assert_eq!(
            matrix.seen_from(CellId(69)).count(),
            matrix.row(69).iter().map(|w| w.count_ones() as usize).sum()
        );
        assert_eq!(matrix.seen_from(CellId(70)).count(), 0);
    }
}
