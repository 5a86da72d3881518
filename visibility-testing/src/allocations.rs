//! A global allocator that counts allocations separately for each thread, so that tests running in parallel
//! do not affect each other's counts.
#![allow(unsafe_code)] // An allocator needs unsafe code.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

/// The system's allocator, which counts each thread's allocations in [`ALLOCATIONS`], [`LIVE`] and [`PEAK`].
/// A test program installs it with `#[global_allocator]`.
pub struct CountingAllocator;

thread_local! {
    /// Number of allocations and reallocations by this thread so far. Frees do not count.
    pub static ALLOCATIONS: Cell<usize> = const { Cell::new(0) };
    /// Bytes that this thread has allocated minus bytes that it has freed. Negative if the thread frees
    /// memory of other threads.
    pub static LIVE: Cell<isize> = const { Cell::new(0) };
    /// Greatest value of [`LIVE`] since `PEAK` was last set.
    pub static PEAK: Cell<isize> = const { Cell::new(0) };
}

/// Adds a number of allocations and a change of live bytes to the thread's counts.
fn count(allocations: usize, bytes: isize) {
    ALLOCATIONS.set(ALLOCATIONS.get() + allocations);
    LIVE.set(LIVE.get() + bytes);
    PEAK.set(PEAK.get().max(LIVE.get()));
}

// SAFETY: every call is forwarded to the system's allocator. Counting neither allocates nor touches the
// memory.
unsafe impl GlobalAlloc for CountingAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(1, layout.size() as isize);
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        count(0, -(layout.size() as isize));
        unsafe { System.dealloc(memory, layout) }
    }

    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count(1, size as isize - layout.size() as isize);
        unsafe { System.realloc(memory, layout, size) }
    }
}
