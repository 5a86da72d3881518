//! Numbers that are handed out once, so that what belongs to one scene or structure is not taken for what
//! belongs to another.

use core::sync::atomic::{AtomicUsize, Ordering::Relaxed};

/// Ranges and serials are counted apart: structures may take a serial in every frame, and would use up the
/// ranges.
static LAST_RANGE: AtomicUsize = AtomicUsize::new(0);
static LAST_SERIAL: AtomicUsize = AtomicUsize::new(0);

/// Bits of a number within its range.
const RANGE_BITS: u32 = 40;

/// Where a scene begins to count its layouts and its revisions. Distinct for the first 16 million calls: 2^40
/// numbers belong to each.
pub(crate) fn next_range() -> u64 {
    (next(&LAST_RANGE) as u64) << RANGE_BITS
}

/// Whether two numbers are of the same range.
pub(crate) fn is_same_range(a: u64, b: u64) -> bool {
    a >> RANGE_BITS == b >> RANGE_BITS
}

/// A number that was not returned before, never 0. Repeats after as many calls as `usize` has values.
pub(crate) fn next_serial() -> u64 {
    next(&LAST_SERIAL) as u64
}

/// 1, 2, 3 ...
#[cfg(target_has_atomic = "ptr")]
fn next(last: &AtomicUsize) -> usize {
    last.fetch_add(1, Relaxed).wrapping_add(1)
}

/// The same on processors without compare-and-swap. These have one core, and an interrupt between load and
/// store would have to make a scene to do any harm.
#[cfg(not(target_has_atomic = "ptr"))]
fn next(last: &AtomicUsize) -> usize {
    let next = last.load(Relaxed).wrapping_add(1);
    last.store(next, Relaxed);
    next
}
