//! The pairs of portals that a line may pass one after the other. A bake of cells finds them, and a bake of
//! objects starts from them.

use crate::directed_portals::DirectedPortals;
use alloc::vec::Vec;
use visibility_core::binary_format::Fingerprint;
use visibility_core::bits::Bits;

/// For each portal of a graph in each of its two directions: the directed portals that a line through it may
/// pass later. Found by [`CellBaker`](crate::CellBaker), and used by [`ObjectBaker`](crate::ObjectBaker) for
/// the same graph and clearance. Takes four bits for each ordered pair of portals.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct PortalPairs {
    /// By directed portal: the directed portals that a line through it may later pass.
    rows: Vec<Bits>,
    /// Fingerprint of the directed portals that the bits stand for.
    portals: u64,
}

impl PortalPairs {
    /// Makes the pairs of the directed portals `portals`. `rows` holds, by directed portal, the directed
    /// portals that a line through it may later pass.
    pub(crate) fn new(portals: &DirectedPortals, rows: Vec<Bits>) -> Self {
        Self { rows, portals: fingerprint(portals) }
    }

    /// Tests whether the pairs were made for the directed portals `portals`: for the same graph, shrunk by
    /// the same clearance.
    pub(crate) fn are_of(&self, portals: &DirectedPortals) -> bool {
        self.rows.len() == portals.all.len() && self.portals == fingerprint(portals)
    }

    /// Returns the directed portals that a line through directed portal `portal` may later pass.
    pub(crate) fn row(&self, portal: u32) -> &Bits {
        &self.rows[portal as usize]
    }

    /// Returns a hash of the portals and the bits, for the bake's fingerprint.
    pub(crate) fn fingerprint(&self) -> u64 {
        let words = self.rows.iter().flat_map(Bits::words).copied();
        words.chain([self.portals]).fold(Fingerprint::new(), Fingerprint::with_u64).value()
    }
}

fn fingerprint(portals: &DirectedPortals) -> u64 {
    portals.numbers().fold(Fingerprint::new(), Fingerprint::with_u64).value()
}
