//! Input and result of a flow.

use crate::cell_matrix::CellMatrix;
use crate::directed_portals::DirectedPortals;
use alloc::vec::Vec;
use visibility_core::bits::Bits;

/// Input of a flow (the search for all that is seen through one portal): the candidate matrix and the seen
/// cells, as the last round of the bake left them.
pub(crate) struct FlowInput<'a> {
    pub(crate) portals: &'a DirectedPortals,
    /// By directed portal: the directed portals that a line through it may later pass. Those that earlier
    /// rounds of the bake proved impossible to reach are left out.
    pub(crate) rows: &'a [Bits],
    /// Cells known to be seen: the bit of the ordered pair of cells (a, b) is 1 once b counts as seen from
    /// a. Flows search only for other cells.
    pub(crate) seen: &'a CellMatrix,
    /// Clearance in world units for the test in Pluecker space of chains that lead to a cell not yet known
    /// to be seen. `None` disables the test.
    pub(crate) exact: Option<f64>,
    /// Maximum number of portals that a chain is extended by, the source not counted. See
    /// [`BakerSettings::with_depth`](crate::BakerSettings::with_depth).
    pub(crate) depth: u32,
}

/// Result of the flow (search for all that is seen) through one directed portal, the source.
#[derive(Default, Debug)]
pub struct FlowResult {
    /// Indices in `DirectedPortals::all` of the candidates of the source that no line through the source
    /// reaches.
    pub(crate) hidden: Vec<u32>,
    /// Indices of the cells that are newly found to be seen from the source's cell, each with `true` if a
    /// line proves that the cell is seen, `false` if the cell could not be excluded.
    pub(crate) cells: Vec<(u32, bool)>,
    /// Number of portal chains inspected.
    pub(crate) steps: u64,
    /// Number of portal chains that only a certificate in Pluecker space excluded.
    pub(crate) rejected: u64,
    /// Whether the limit of steps (portal chains inspected) was reached, so that every candidate not proven
    /// hidden counts as seen. `false` if the search is complete.
    pub(crate) gave_up: bool,
}
