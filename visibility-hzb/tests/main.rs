//! One program for the tests of all files here: it compiles and runs in less time than many.
#![allow(missing_docs)]

mod climbs;
mod clipping;
mod common;
mod enclosures;
mod eye_plane;
#[cfg(feature = "papers")]
mod hom;
#[cfg(feature = "papers")]
mod hom_no_allocation;
mod level;
mod magnitudes;
mod no_allocation;
mod own_mesh;
mod panels;
mod pyramid;
mod rays;
mod region;
mod sectors;
mod sheets;
mod swapped_sources;
mod views;

#[global_allocator]
static ALLOCATOR: visibility_testing::allocations::CountingAllocator =
    visibility_testing::allocations::CountingAllocator;
