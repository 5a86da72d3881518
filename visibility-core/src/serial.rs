//! Numbers that are handed out once, so that what belongs to one scene or structure is not taken for what belongs to another.

use core::sync::atomic::{AtomicUsize, Ordering::Relaxed};

static LAST: AtomicUsize = AtomicUsize::new(0);

/// Where a scene begins to count its layouts and its revisions. Distinct for the first 16 million calls: 2^40 numbers belong
/// to each.
pub(crate) fn next_range() -> u64 {
    next_serial() << 40
}

/// A number that was not returned before, never 0. Repeats after as many calls as `usize` has values.
pub(crate) fn next_serial() -> u64 {
    next() as u64
}

/// 1, 2, 3 ...
#[cfg(target_has_atomic = "ptr")]
fn next() -> usize {
    LAST.fetch_add(1, Relaxed).wrapping_add(1)
}

/// The same on processors without compare-and-swap. These have one core, and an interrupt between load and store would have to
/// make a scene to do any harm.
#[cfg(not(target_has_atomic = "ptr"))]
fn next() -> usize {
    let next = LAST.load(Relaxed).wrapping_add(1);
    LAST.store(next, Relaxed);
    next
}
