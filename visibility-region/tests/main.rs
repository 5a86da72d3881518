//! One program for all tests of this folder: it compiles and runs in less time than one program for each
//! file.
#![allow(missing_docs)]

#[cfg(feature = "papers")]
mod blockers;
#[cfg(feature = "papers")]
mod candidates;
mod climbs;
mod common;
mod ground;
#[cfg(feature = "papers")]
mod huge_bounds;
mod online;
mod oriented;
mod sampling;
mod slots;
mod soundness;
mod swapped_sources;
mod traps;
mod who_sees;

#[global_allocator]
static ALLOCATOR: visibility_testing::allocations::CountingAllocator =
    visibility_testing::allocations::CountingAllocator;
