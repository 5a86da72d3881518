//! One program for the tests of all files here: it compiles and runs in less time than many.
#![allow(missing_docs)]

mod coherence;
mod common;
mod enclosures;
mod exact;
mod occluded_rays;
mod order;
mod rims;
mod sections;
mod shapes;
mod swaps;
mod tree;
mod tree_no_allocation;

#[global_allocator]
static ALLOCATOR: visibility_testing::allocations::CountingAllocator =
    visibility_testing::allocations::CountingAllocator;
