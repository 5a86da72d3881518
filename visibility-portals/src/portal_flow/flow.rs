//! The flow from one portal, its input and its result.

use super::flow_scratch::FlowScratch;
use crate::cell_matrix::{CellMatrix, bits};
use crate::directed_portals::DirectedPortals;
use alloc::vec::Vec;

/// Input of a flow: the state of a bake between two rounds.
pub(crate) struct FlowInput<'a> {
    pub(crate) portals: &'a DirectedPortals,
    /// Candidate matrix with rows of `stride` words: bit b of the row of directed portal a is set while a
    /// line through a may later pass directed portal b.
    pub(crate) rows: &'a [u64],
    pub(crate) stride: usize,
    /// Visible cells: cell a sees cell b once b counts as seen from a. Flows search only for other cells.
    pub(crate) seen: &'a CellMatrix,
    /// The clearance for the test in Pluecker space of chains that lead to a cell not yet known to be seen.
    /// `None` disables the test.
    pub(crate) exact: Option<f64>,
}

/// Result of the flow from one source portal.
#[derive(Default)]
pub struct FlowResult {
    /// Candidate portals (by directed portal index) that no line through the source reaches.
    pub(crate) hidden: Vec<u32>,
    /// Cells that are newly found to be seen, each with `true` if a line proves that the cell is seen,
    /// `false` if the cell could not be excluded.
    pub(crate) cells: Vec<(u32, bool)>,
    /// Number of portal chains inspected.
    pub(crate) steps: u64,
    /// Number of portal chains that only a certificate in Pluecker space excluded.
    pub(crate) rejected: u64,
    /// Whether the limit of steps was reached, so that every candidate not proven hidden counts as seen.
    pub(crate) gave_up: bool,
}

/// Computes the portals and cells that can be seen through the directed portal `source`. After `limit` steps
/// every candidate not proven hidden counts as seen, and `FlowResult::gave_up` is set.
pub(crate) fn portal_flow(
    input: &FlowInput,
    source: u32,
    limit: u64,
    scratch: &mut FlowScratch,
) -> FlowResult {
    let mut result = FlowResult::default();
    scratch.begin(input, source);
    if scratch.count == 0 || scratch.goals.iter().all(|&word| word == 0) {
        return result;
    }
    scratch.enter_source(input, source);
    while let Some(child) = scratch.chain.next_child() {
        result.steps += 1;
        if result.steps > limit {
            return give_up(scratch, result);
        }
        scratch.visit(input, source, child as usize, &mut result);
    }
    for (i, &candidate) in scratch.candidates.iter().enumerate() {
        if scratch.reached[i / 64] >> (i % 64) & 1 == 0 {
            result.hidden.push(candidate);
        }
    }
    result
}

/// Adds the cells of all remaining goals to `result`, as seen without proof, and sets `gave_up`.
fn give_up(scratch: &mut FlowScratch, mut result: FlowResult) -> FlowResult {
    let mut cells: Vec<u32> = Vec::new();
    for (i, &word) in scratch.goals.iter().enumerate() {
        cells.extend(bits(word).map(|bit| scratch.to[i * 64 + bit as usize]));
    }
    cells.sort_unstable();
    cells.dedup();
    result.cells.extend(cells.into_iter().map(|cell| (cell, false)));
    result.gave_up = true;
    result
}
