//! Counter of elementary steps of an algorithm. Tests of cost assert how the steps grow with the input.

use std::cell::Cell;

std::thread_local! {
    /// Number of steps counted on this thread since it began.
    static STEPS: Cell<u64> = const { Cell::new(0) };
}

/// Adds one to the thread's counter. Libraries call it under `cfg(test)` alone.
#[inline]
pub fn step() {
    STEPS.set(STEPS.get() + 1);
}

/// Runs `run` and returns the number of steps that it counted on this thread.
pub fn steps_of(run: impl FnOnce()) -> u64 {
    let before = STEPS.get();
    run();
    STEPS.get() - before
}
