//! One program for all tests of this folder: it compiles and runs in less time than one program for each
//! file.
#![allow(missing_docs)]

mod absent_occluders;
mod climbs;
mod common;
mod coplanar;
mod dynamic;
mod dynamic_changes;
mod game_maps;
mod grid_worlds;
mod groups;
mod guided_rays;
mod hostile_input;
mod large_meshes;
mod leaves;
mod one_sided;
mod planted_gaps;
mod quick_looks;
mod rims;
mod shares;
mod slots;
mod stopped_queries;
mod swapped_sources;

#[global_allocator]
static ALLOCATOR: visibility_testing::allocations::CountingAllocator =
    visibility_testing::allocations::CountingAllocator;
