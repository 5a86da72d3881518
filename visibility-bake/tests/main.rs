//! One program for the tests of all files here: it compiles and runs in less time than many.
#![allow(missing_docs)]

mod edits;
mod forged_bytes;
mod forged_counts;
mod free_space;
mod level_files;
mod sandwiches;
mod versions;

#[global_allocator]
static ALLOCATOR: visibility_testing::allocations::CountingAllocator =
    visibility_testing::allocations::CountingAllocator;
