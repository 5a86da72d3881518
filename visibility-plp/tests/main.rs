//! One program for the tests of all files here: it compiles and runs in less time than many.
#![allow(missing_docs)]

mod common;
mod cullers;
mod no_allocation;
mod swapped_sources;
mod tessellations;

#[global_allocator]
static ALLOCATOR: visibility_testing::allocations::CountingAllocator =
    visibility_testing::allocations::CountingAllocator;
