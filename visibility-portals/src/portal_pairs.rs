//! Which portals a line may pass one after the other: what a bake of cells learns of pairs of portals, and a
//! bake of objects begins from.

use crate::directed_portals::DirectedPortals;
use alloc::vec::Vec;
use visibility_core::binary_format::Fingerprint;

/// For each portal of a graph in each of its two directions: the directed portals that a line through it may
/// pass later. Found by [`CellBaker`](crate::CellBaker), and used by [`ObjectBaker`](crate::ObjectBaker) for
/// the same graph and clearance. Takes four bits for each ordered pair of portals.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct PortalPairs {
    /// Rows of `stride` words, one bit per directed portal: bit b of the row of directed portal a is 1 while
    /// a line through a may later pass directed portal b, and 0 once such a line is excluded.
    rows: Vec<u64>,
    stride: usize,
    /// Fingerprint of the directed portals that the bits stand for.
    portals: u64,
}

impl PortalPairs {
    /// Takes the candidate matrix of the directed portals `portals`, in rows of `stride` words.
    pub(crate) fn new(portals: &DirectedPortals, rows: Vec<u64>, stride: usize) -> Self {
        Self { rows, stride, portals: fingerprint(portals) }
    }

    /// Tests whether the pairs are of these portals: of the same graph, shrunk by the same clearance.
    pub(crate) fn are_of(&self, portals: &DirectedPortals) -> bool {
        self.rows.len() == portals.all.len() * self.stride && self.portals == fingerprint(portals)
    }

    /// Returns the row of directed portal `portal`: bit i % 64 of word i / 64 is set if a line through it may
    /// later pass directed portal i.
    pub(crate) fn row(&self, portal: u32) -> &[u64] {
        &self.rows[portal as usize * self.stride..][..self.stride]
    }

    /// Returns a number that tells apart the portals and the bits, for the bake's fingerprint.
    pub(crate) fn fingerprint(&self) -> u64 {
        self.rows
            .iter()
            .fold(Fingerprint::new(), |sum, &word| sum.with_u64(word))
            .with_u64(self.portals)
            .value()
    }
}

fn fingerprint(portals: &DirectedPortals) -> u64 {
    portals.numbers().fold(Fingerprint::new(), Fingerprint::with_u64).value()
}
