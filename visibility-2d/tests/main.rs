//! All test files here form one program, which compiles and runs faster than many.
#![allow(missing_docs)]

mod climbs;
mod common;
mod discs;
mod exact_plan;
mod horizon_crowns;
mod horizon_margins;
mod horizon_notches;
mod horizon_rays;
mod horizon_state;
mod horizon_terrain;
mod horizon_walls;
mod plan_cells;
mod plan_limits;
mod plan_objects;
mod plan_rays;
mod plan_unseen;
#[cfg(feature = "papers")]
mod view_cdt_margins;
#[cfg(feature = "papers")]
mod view_cdt_rays;
mod viewshed;
mod virtual_occluders;

#[global_allocator]
static ALLOCATOR: visibility_testing::allocations::CountingAllocator =
    visibility_testing::allocations::CountingAllocator;
