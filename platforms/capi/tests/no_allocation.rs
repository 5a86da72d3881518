//! Test that a warm frame allocates nothing in the C library: batches, views, culling and results use memory
//! that handles keep.

mod common;

use common::{make, ok};
use std::ptr::null_mut;
use visibility::*;
use visibility_testing::allocations::{ALLOCATIONS, CountingAllocator};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

#[test]
fn warm_frames_allocate_nothing() {
    const COUNT: usize = 5000;
    let (scene, view, pipeline) = (make(vis_scene_create), make(vis_view_create), make(vis_pipeline_create));
    let (mut visible, mut lods, list) = (null_mut(), null_mut(), make(vis_draw_list_create));
    let mut groups = [vis_draw_group { key: 0, first: 0, count: 0 }; 27];
    let cube = |i: usize, step: f32| {
        let corner = [(i / 70) as f32 * 2.0 + step, (i % 70) as f32 * 2.0 - 70.0, 0.0];
        vis_box { min: corner, max: corner.map(|x| x + 1.0) }
    };
    let descs: Vec<_> = (0..COUNT).map(|i| vis_object_default(cube(i, 0.0))).collect();
    let mut ids = vec![0; COUNT];
    let (mut moved, mut transforms) = (vec![cube(0, 0.0); COUNT], vec![[0.0_f32; 16]; COUNT / 2]);
    let (mut draw, mut bits, mut count) = (vec![0_u64; COUNT], vec![0_u32; COUNT.div_ceil(32)], 0);
    // SAFETY: handles are live, and arrays as long as said.
    unsafe {
        ok(vis_visible_create(true, &raw mut visible));
        ok(vis_pipeline_add_frustum(pipeline));
        ok(vis_pipeline_add_z_buffer(pipeline, 0, 0));
        ok(vis_scene_insert_batch(scene, descs.as_ptr(), COUNT, ids.as_mut_ptr()));
        ok(vis_lods_create(1080.0, 0.1, 0.05, &raw mut lods));
        ok(vis_scene_set_lod_sizes(scene, ids.as_ptr(), COUNT, [50.0, 20.0].as_ptr(), 2));
        let keys: Vec<u32> = (0..COUNT as u32).map(|index| index % 9 * 3).collect();
        let (placed, boxed) = ids.split_at(COUNT / 2);
        for &id in placed {
            ok(vis_scene_set_local_bounds(scene, id, &cube(0, 0.0)));
        }
        let mut seen = 0;
        for frame in 0..40 {
            let before = ALLOCATIONS.get();
            let step = (frame % 4) as f32 * 0.1;
            for (i, bounds) in moved.iter_mut().enumerate() {
                *bounds = cube(i, step);
            }
            for (i, transform) in transforms.iter_mut().enumerate() {
                let corner = cube(i, step).min;
                *transform = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
                transform[12..15].copy_from_slice(&corner);
            }
            let (matrices, boxes) = (transforms.as_ptr().cast(), moved[COUNT / 2..].as_ptr());
            ok(vis_scene_set_transforms_batch(scene, placed.as_ptr(), matrices, placed.len()));
            ok(vis_scene_set_bounds_batch(scene, boxed.as_ptr(), boxes, boxed.len()));
            ok(vis_scene_maintain(scene, 100, null_mut()));
            let eye = [f64::from(step) - 10.0, 0.0, 1.7];
            let pose = vis_pose { eye, target: [eye[0] + 1.0, 0.0, 1.7], up: [0.0, 0.0, 1.0] };
            ok(vis_view_set_perspective(view, &raw const pose, 1.0, 1.5, 0.1, 500.0));
            ok(vis_pipeline_cull(pipeline, scene, view, visible, null_mut()));
            ok(vis_visible_sort_by_index(visible, scene));
            ok(vis_visible_ids(visible, scene, draw.as_mut_ptr(), COUNT, &raw mut count));
            seen += count;
            ok(vis_visible_write_bits(visible, scene, bits.as_mut_ptr(), bits.len(), &raw mut count));
            ok(vis_visible_newly_visible(visible, draw.as_mut_ptr(), COUNT, &raw mut count));
            ok(vis_scene_set_draw_keys(scene, ids.as_ptr(), keys.as_ptr(), COUNT));
            ok(vis_lods_select(lods, scene, view, visible, 0.02));
            ok(vis_draw_list_group_levels(list, scene, lods));
            ok(vis_draw_list_groups(list, groups.as_mut_ptr(), groups.len(), &raw mut count));
            ok(vis_draw_list_group_fading(list, scene, lods));
            ok(vis_draw_list_instances(list, bits.as_mut_ptr(), bits.len(), &raw mut count));
            if frame >= 20 {
                assert_eq!(ALLOCATIONS.get(), before, "frame {frame}");
            }
        }
        assert!(seen > 40 * COUNT / 4, "{seen}");
    }
}
