//! Input and output of a flow.

use crate::directed_portals::DirectedPortals;
use alloc::vec::Vec;

/// What flows read: the state of a bake between two rounds.
pub(crate) struct Known<'a> {
    pub(crate) portals: &'a DirectedPortals,
    /// By portal, one bit for each portal that lines through it may pass later, as far as is known. Rows of
    /// `stride` words.
    pub(crate) rows: &'a [u64],
    pub(crate) stride: usize,
    /// By cell, one bit for each cell that need not be shown to be seen from it. Rows of `cell_stride`
    /// words.
    pub(crate) seen: &'a [u64],
    pub(crate) cell_stride: usize,
    /// The clearance, if chains that lead to a cell not yet known to be seen are to be tested in Pluecker
    /// space.
    pub(crate) exact: Option<f64>,
}

/// Result of one flow.
#[derive(Default)]
pub struct Found {
    /// Portals that no line through the source reaches.
    pub(crate) hidden: Vec<u32>,
    /// Cells that are seen and were not known to be; true with those for which a line was found.
    pub(crate) cells: Vec<(u32, bool)>,
    /// Chains looked at.
    pub(crate) steps: u64,
    /// Chains that only a certificate excluded.
    pub(crate) rejected: u64,
    /// Whether the limit of steps was reached, so that all that is not proven hidden counts as seen.
    pub(crate) gave_up: bool,
}
