//! One program for all tests of this folder: it compiles and runs in less time than one program for each
//! file.
#![allow(missing_docs)]

#[cfg(feature = "papers")]
mod climbs;
#[cfg(feature = "papers")]
mod coherence;
mod common;
#[cfg(feature = "papers")]
mod dents;
#[cfg(feature = "papers")]
mod enclosures;
mod exact;
#[cfg(feature = "papers")]
mod occluded_rays;
mod order;
#[cfg(feature = "papers")]
mod rims;
#[cfg(feature = "papers")]
mod sections;
mod shapes;
#[cfg(feature = "papers")]
mod swaps;
mod tree;
mod tree_no_allocation;

#[global_allocator]
static ALLOCATOR: visibility_testing::allocations::CountingAllocator =
    visibility_testing::allocations::CountingAllocator;
