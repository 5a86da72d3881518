//! One program for the tests of all files here: it compiles and runs in less time than many.
#![allow(missing_docs)]

mod backface;
mod backface_culler;
mod casters;
mod climbs;
mod clusters;
mod contribution;
mod draw_list;
mod lod;
mod motion;
mod no_allocation;
mod queries;
mod shadow_occlusion;
mod swapped_sources;

#[global_allocator]
static ALLOCATOR: visibility_testing::allocations::CountingAllocator =
    visibility_testing::allocations::CountingAllocator;
