//! What can be seen through one portal: depth first through chains of portals, with the possible targets flooded again at every depth.
//!
//! From a portal, the source, lines go on through the next portal of the cell behind it, and so on. Two polygons bound them: the part of
//! the source that they can come from, and the part of the last portal that they can go through. The planes that [separate]
//! (crate::separators) these bound everything farther on. At each depth a flood through cells finds the portals that can still be reached
//! without leaving those planes; where none of them leads to a cell that is not already known to be seen, the chain ends.
//!
//! All sets are of the source's own candidates, numbered in the order of the cells that they lead from: short bit masks, in which the
//! portals of a cell stand side by side.

mod candidates;
mod frame;
mod witness;

pub(crate) use candidates::Scratch;

use crate::matrix::bits;
use crate::portals::Portals;
use alloc::vec::Vec;

/// What floods read: the state of a bake between two rounds.
pub(crate) struct Known<'a> {
    pub(crate) portals: &'a Portals,
    /// For each portal, the portals that lines through it may go through later, as far as is known: rows of `stride` words.
    pub(crate) rows: &'a [u64],
    pub(crate) stride: usize,
    /// For each cell, the cells that need not be shown to be seen from it: rows of `cell_stride` words.
    pub(crate) seen: &'a [u64],
    pub(crate) cell_stride: usize,
    /// Whether chains that lead to a cell not yet known to be seen are tested in Pluecker space, for lines clear of edges by so much.
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
    /// Chains on which the separating planes leave something, and a certificate says that no line goes through.
    pub(crate) rejected: u64,
    /// Whether the limit of steps was reached, and everything possible is called visible.
    pub(crate) gave_up: bool,
}

/// Floods from a portal.
pub(crate) fn flood(known: &Known, source: u32, limit: u64, scratch: &mut Scratch) -> Found {
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

/// Everything that was possible counts as seen.
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
