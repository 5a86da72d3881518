//! What a flow from one portal is given, and what it gives back.

use crate::directed_portals::DirectedPortals;
use alloc::vec::Vec;

/// What floods read: the state of a bake between two rounds.
pub(crate) struct Known<'a> {
    pub(crate) portals: &'a DirectedPortals,
    /// For each portal, the portals that lines through it may go through later, as far as is known: rows of
    /// `stride` words.
    pub(crate) rows: &'a [u64],
    pub(crate) stride: usize,
    /// For each cell, the cells that need not be shown to be seen from it: rows of `cell_stride` words.
    pub(crate) seen: &'a [u64],
    pub(crate) cell_stride: usize,
    /// Whether chains that lead to a cell not yet known to be seen are tested in Pluecker space, for lines
    /// clear of edges by so much.
    pub(crate) exact: Option<f64>,
}

/// What one flood found.
#[derive(Default)]
pub struct Found {
    /// The portals, by their numbers among all, that turned out not to be reachable.
    pub(crate) hidden: Vec<u32>,
    /// The cells seen that were not known to be, and whether a line was found that proves it.
    pub(crate) cells: Vec<(u32, bool)>,
    /// Chains looked at.
    pub(crate) steps: u64,
    /// Chains on which the separating planes leave something, and a certificate says that no line goes
    /// through.
    pub(crate) rejected: u64,
    /// Whether the limit of steps was reached, and everything possible is called visible.
    pub(crate) gave_up: bool,
}
