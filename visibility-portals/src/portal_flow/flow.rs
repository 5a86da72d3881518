//! The flow from one portal.

use super::known::{Found, Known};
use super::scratch::Scratch;
use crate::cell_matrix::bits;
use alloc::vec::Vec;

/// Computes the portals and cells that can be seen through the directed portal `source`. After `limit` steps
/// every candidate not proven hidden counts as seen, and `Found::gave_up` is set.
pub(crate) fn portal_flow(known: &Known, source: u32, limit: u64, scratch: &mut Scratch) -> Found {
    let mut found = Found::default();
    scratch.begin(known, source);
    if scratch.count == 0 || scratch.goals.iter().all(|&word| word == 0) {
        return found;
    }
    scratch.enter_source(known, source);
    while let Some(child) = scratch.next_child() {
        found.steps += 1;
        if found.steps > limit {
            return give_up(scratch, found);
        }
        scratch.visit(known, source, child, &mut found);
    }
    for (i, &candidate) in scratch.candidates.iter().enumerate() {
        if scratch.reached[i / 64] >> (i % 64) & 1 == 0 {
            found.hidden.push(candidate);
        }
    }
    found
}

/// Adds the cells of all remaining goals to `found`, as seen without proof, and sets `gave_up`.
fn give_up(scratch: &mut Scratch, mut found: Found) -> Found {
    let mut cells: Vec<u32> = Vec::new();
    for (i, &word) in scratch.goals.iter().enumerate() {
        cells.extend(bits(word).map(|bit| scratch.to[i * 64 + bit as usize]));
    }
    cells.sort_unstable();
    cells.dedup();
    found.cells.extend(cells.into_iter().map(|cell| (cell, false)));
    found.gave_up = true;
    found
}
