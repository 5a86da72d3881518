//! All test files here form one program, which compiles and runs faster than many.
#![allow(missing_docs)]

mod all_occluders;
mod backface_scenes;
mod bake_kills;
mod bake_program;
mod bsp_scenes;
mod budget_scenes;
mod cell_scenes;
mod cut_occluders;
mod engine;
mod exact_scenes;
mod extremes;
mod full_disk;
mod gltf_contents;
mod gltf_files;
mod gltf_instances;
mod gltf_meshopt;
mod hom_scenes;
mod hzb_scenes;
mod limit_programs;
mod made_up_walks;
mod moved_origin;
mod occluder_scenes;
mod occlusion_scenes;
mod pinned_answers;
mod plan_scenes;
mod plp_scenes;
mod program_arguments;
mod pvs_lines;
mod query_scenes;
mod recipes;
mod reference_scenes;
mod region_memory;
mod region_scenes;
mod scene_streams;
mod shared_scenes;
mod stored_scenes;
mod surfaces;
mod vscn_files;

#[global_allocator]
static ALLOCATOR: visibility_testing::allocations::CountingAllocator =
    visibility_testing::allocations::CountingAllocator;
