//! One program for all tests of this folder: it compiles and runs in less time than one program for each
//! file.
#![allow(missing_docs)]

mod climbs;
mod from_geometry;
mod geometry_sight;
mod hostile_maps;
mod maze;
mod no_allocation;
mod object_rows;
mod portal_frames;
mod portal_margins;
mod portal_mirrors;
mod portal_rays;
mod portal_regions;
mod portal_winding;
mod resumed_bakes;
mod room_row;
mod swapped_sources;
mod who_sees;

#[global_allocator]
static ALLOCATOR: visibility_testing::allocations::CountingAllocator =
    visibility_testing::allocations::CountingAllocator;
