//! One program for the tests of all files here: it compiles and runs in less time than many.
#![allow(missing_docs)]

use visibility_testing::allocations::CountingAllocator;

mod file;
mod lines;
mod walls;

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;
