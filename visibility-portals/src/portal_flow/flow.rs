//! The flow from one portal: the search for all cells that lines through this portal reach.

use super::flow_input::{FlowInput, FlowResult};
use super::flow_scratch::FlowScratch;
use alloc::vec::Vec;

/// Computes the portals and cells that can be seen through the directed portal `source`. After `limit` steps
/// every candidate (a directed portal that a line through `source` may later pass) not proven hidden counts
/// as seen, and `FlowResult::gave_up` is set.
pub(crate) fn portal_flow(
    input: &FlowInput,
    source: u32,
    limit: u64,
    scratch: &mut FlowScratch,
) -> FlowResult {
    let mut result = FlowResult::default();
    scratch.begin(input, source);
    if scratch.goals.next(0).is_none() {
        return result;
    }
    if input.depth == 0 {
        result.cells = cells_of_goals(scratch);
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
        if !scratch.reached.contains(i) {
            result.hidden.push(candidate);
        }
    }
    result
}

/// Adds the cells of all remaining goals to `result`, as seen without proof, and sets `gave_up`.
fn give_up(scratch: &FlowScratch, mut result: FlowResult) -> FlowResult {
    result.cells.extend(cells_of_goals(scratch));
    result.gave_up = true;
    result
}

/// Returns the cells of all remaining goals (candidates that lead to cells not yet known to be seen), each
/// once and ascending, with `false`: no line proves that they are seen.
fn cells_of_goals(scratch: &FlowScratch) -> Vec<(u32, bool)> {
    let mut cells: Vec<u32> = scratch.goals.iter().map(|goal| scratch.to[goal]).collect();
    cells.sort_unstable();
    cells.dedup();
    cells.into_iter().map(|cell| (cell, false)).collect()
}
