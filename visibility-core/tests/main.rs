//! One program for the tests of all files here: it compiles and runs in less time than many.
#![allow(missing_docs)]

mod bake_stages;
mod clip_plane_test;
mod degrees;
mod explain_and_freeze;
mod frustum_contract;
mod hostile_input;
mod jobs;
mod many_views;
mod mesh_bounds;
mod mesh_removal;
mod moving;
mod no_allocation;
mod occlusion;
mod prefetch;
mod projection;
mod pvs_culler;
mod pvs_object_by_object;
mod residency;
mod results;
mod same_answers;
mod scene_model;
mod shared_triangles;
mod sight_start;
mod skinned_bounds;
mod swapped_sources;
mod transforms;
mod view_regions;
mod visible_set;
mod walk;
mod who_sees;

#[global_allocator]
static ALLOCATOR: visibility_testing::allocations::CountingAllocator =
    visibility_testing::allocations::CountingAllocator;
