//! The cell-to-cell visibility of a map: one bit for each ordered pair of cells.

use alloc::{vec, vec::Vec};
use visibility_core::bits::Bits;
use visibility_core::cells::{CellGraph, CellId};
use visibility_core::pvs::{Pvs, PvsError, PvsTargets, ViewcellId};

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
    /// For each cell, the cells that can be seen from it.
    pub(crate) rows: Vec<Bits>,
    /// [Version](CellGraph::version) of the graph from which the matrix was baked. `None` if it is unknown.
    source: Option<u64>,
}

impl PartialEq for CellMatrix {
    /// Compares only the bits, not the graphs from which the matrices were baked.
    fn eq(&self, other: &Self) -> bool {
        self.rows == other.rows
    }
}

impl Eq for CellMatrix {}

impl CellMatrix {
    /// Returns a matrix for `cells` cells with all bits clear: no cell sees any cell, not even itself.
    pub fn new(cells: usize) -> Self {
        Self { rows: vec![Bits::new(cells); cells], source: None }
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
        for (seen, bytes) in matrix.rows.iter_mut().zip(bytes.chunks_exact(row.max(1))) {
            let words = bytes.chunks(8).map(|part| {
                let mut word = [0; 8];
                word[..part.len()].copy_from_slice(part);
                u64::from_le_bytes(word)
            });
            seen.unite_words(words);
            if seen.next(cells).is_some() {
                return None;
            }
        }
        Some(matrix)
    }

    /// Returns the matrix in the `.vismat` format: row by row, each of `ceil(cells / 8)` bytes, least
    /// significant bit first. Empty without cells.
    pub fn to_bytes(&self) -> Vec<u8> {
        let count = self.cell_count().div_ceil(8);
        let bytes = |row: &Bits| row.words().iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<u8>>();
        self.rows.iter().flat_map(|row| bytes(row).into_iter().take(count)).collect()
    }

    /// Returns the number of cells, which is the number of rows and of columns.
    pub fn cell_count(&self) -> usize {
        self.rows.len()
    }

    /// Tests whether cell `from` sees cell `to`. `false` if `from` or `to` is not a cell of the matrix.
    pub fn sees(&self, from: CellId, to: CellId) -> bool {
        self.rows.get(from.index()).is_some_and(|row| row.contains(to.index()))
    }

    /// Returns the cells that cell `from` sees, in ascending order. Empty if the matrix has no such cell.
    pub fn seen_from(&self, from: CellId) -> impl Iterator<Item = CellId> + '_ {
        self.rows.get(from.index()).into_iter().flat_map(Bits::iter).map(|cell| CellId(cell as u32))
    }

    /// Returns the number of ordered pairs (a, b) of cells for which a sees b, pairs (a, a) included. Time is
    /// proportional to the square of the number of cells.
    pub fn count(&self) -> u64 {
        self.rows.iter().map(|row| u64::from(row.count())).sum()
    }

    /// Returns the mean number of cells that a cell sees, itself included. 0 without cells.
    pub fn mean_visible(&self) -> f64 {
        if self.rows.is_empty() { 0.0 } else { self.count() as f64 / self.rows.len() as f64 }
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
        let mut both = Self { source: self.source, ..Self::new(self.cell_count()) };
        for a in 0..self.cell_count() {
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
    /// [`PvsError::Size`] if the PVS exceeds its storage limits.
    pub fn to_pvs(&self, graph: &CellGraph) -> Result<Pvs, PvsError> {
        let rows: Vec<Vec<u32>> =
            self.rows.iter().map(|row| row.iter().map(|seen| seen as u32).collect()).collect();
        let pvs = Pvs::new(PvsTargets::Cells, rows.len(), &rows, |viewcell| neighbours(graph, viewcell))?;
        Ok(match self.source {
            Some(source) if source == graph.version() => pvs.with_source(source),
            _ => pvs,
        })
    }

    /// Returns all bits, row by row in words.
    pub(crate) fn words(&self) -> impl Iterator<Item = u64> + '_ {
        self.rows.iter().flat_map(Bits::words).copied()
    }

    pub(crate) fn set(&mut self, from: usize, to: usize) {
        self.rows[from].insert(to);
    }
}

/// Returns the neighbours of a viewcell, where viewcell i is the volume of cell i: the viewcells of all cells
/// that share a portal with that cell, once for each shared portal. Empty for an unknown viewcell.
pub(crate) fn neighbours(graph: &CellGraph, viewcell: ViewcellId) -> impl Iterator<Item = ViewcellId> + '_ {
    let cell = CellId(viewcell.0);
    let portals = graph.portals_of(cell).iter().filter_map(|&id| graph.portal(id));
    portals.map(move |portal| portal.other(cell).into())
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
            matrix.rows[69].count() as usize,
            "cells listed, and bits of the row"
        );
        assert_eq!(matrix.seen_from(CellId(70)).count(), 0, "an unknown cell sees none");
    }
}
