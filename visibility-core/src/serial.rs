//! Process-wide unique numbers, which tell apart the states of different scenes and structures.

use core::sync::atomic::{AtomicUsize, Ordering::Relaxed};

/// Last range number handed out by [`next_range`]. Separate from the counter of serials, which may advance in
/// every frame and would use up the ranges.
static LAST_RANGE: AtomicUsize = AtomicUsize::new(0);
static LAST_SCENE: AtomicUsize = AtomicUsize::new(0);
static LAST_SERIAL: AtomicUsize = AtomicUsize::new(0);

/// Number of bits of a counter within its range: each range holds 2^40 values.
const RANGE_BITS: u32 = 40;

/// Returns the first of 2^40 consecutive numbers that belong to this call alone. A scene counts its layouts
/// up from one such number, its revisions from another. The first 16 million (2^24 - 1) calls of a process
/// return different numbers, later calls repeat them. Never returns 0, the number of
/// [`Stamp::NONE`](crate::stamp::Stamp::NONE).
pub(crate) fn next_range() -> u64 {
    nth_range(next(&LAST_RANGE) as u64)
}

/// Returns the first number of the range that the `n`th call of [`next_range`] returns.
fn nth_range(n: u64) -> u64 {
    const RANGES: u64 = (1 << (u64::BITS - RANGE_BITS)) - 1;
    (1 + n % RANGES) << RANGE_BITS
}

/// Returns whether two numbers lie in the same range of 2^40 numbers, as made by [`next_range`].
pub(crate) fn is_same_range(a: u64, b: u64) -> bool {
    a >> RANGE_BITS == b >> RANGE_BITS
}

/// Returns the generation with which a scene starts. Generations are successive multiples of 2^32 over the
/// golden ratio, which spread evenly over the 32-bit numbers: the generations of any two of `n` successive
/// scenes are at least 2^32 / (2.7 n) apart.
pub(crate) fn next_generation() -> u32 {
    (next(&LAST_SCENE) as u32).wrapping_mul(0x9e37_79b9)
}

/// Returns a number that no earlier call in this process returned; the first is 1. Wraps to 0 and then
/// repeats after as many calls as `usize` has values.
pub(crate) fn next_serial() -> u64 {
    next(&LAST_SERIAL) as u64
}

/// Increments the counter `last` atomically and returns its new value: 1, 2, 3 and so on, wrapping at the end
/// of `usize`.
#[cfg(target_has_atomic = "ptr")]
fn next(last: &AtomicUsize) -> usize {
    last.fetch_add(1, Relaxed).wrapping_add(1)
}

/// Increments the counter `last` without an atomic read-modify-write and returns its new value, for
/// processors without such an instruction. Such a processor has one core, so two calls return the same number
/// only if an interrupt handler calls this function between the load and the store.
#[cfg(not(target_has_atomic = "ptr"))]
fn next(last: &AtomicUsize) -> usize {
    let next = last.load(Relaxed).wrapping_add(1);
    last.store(next, Relaxed);
    next
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_range_begins_at_zero() {
        let last = (1 << (u64::BITS - RANGE_BITS)) - 1;
        for n in [0, 1, last - 1, last, last + 1, 2 * last, u64::MAX] {
            assert_ne!(nth_range(n), 0, "range {n}");
            assert!(!is_same_range(nth_range(n), nth_range(n.wrapping_add(1))), "ranges {n} and the next");
        }
    }
}
