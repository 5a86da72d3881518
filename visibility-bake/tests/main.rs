//! One program for all tests of this folder: it compiles and runs in less time than one program for each
//! file.
#![allow(missing_docs)]

mod degrees;
mod edits;
mod fits;
mod forged_bytes;
mod forged_counts;
mod free_space;
mod level_files;
mod movers;
mod sandwiches;
mod versions;

#[global_allocator]
static ALLOCATOR: visibility_testing::allocations::CountingAllocator =
    visibility_testing::allocations::CountingAllocator;
