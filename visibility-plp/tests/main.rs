//! All test files here form one program, which compiles and runs faster than many.
#![allow(missing_docs)]

mod common;
#[cfg(feature = "papers")]
mod cullers;
#[cfg(feature = "papers")]
mod no_allocation;
#[cfg(feature = "papers")]
mod swapped_sources;
mod tessellations;

#[global_allocator]
static ALLOCATOR: visibility_testing::allocations::CountingAllocator =
    visibility_testing::allocations::CountingAllocator;
mod time;
