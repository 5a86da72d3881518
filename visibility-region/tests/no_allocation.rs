//! Contract 5 for virtual occluders, the part of this crate that culls frames. Cullers from viewcells work in
//! bakes, and allocate.

use crate::common::World;
use visibility_core::glam::DVec3;
use visibility_core::occlusion::Occlusion;
use visibility_core::pvs::Viewcell;
use visibility_core::{Aabb, OcclusionMap, Pose, View};
use visibility_region::ExtendedProjectionCuller;
use visibility_testing::allocations::ALLOCATIONS;

#[test]
fn a_warm_frame_of_virtual_occluders_allocates_nothing() {
    let mut world = World::new();
    world.add_box([5.0, -9.0, -9.0], [5.2, 9.0, 9.0]);
    let post = Aabb::from_arrays([20.0, 0.0, 0.0], [20.5, 0.5, 1.0]);
    world.add_target(post);
    let cell = Viewcell::from_box(DVec3::ZERO, DVec3::ONE);
    let mut map = ExtendedProjectionCuller::new().virtual_occluders(&world.scene, &cell);
    let mut frame = |angle: f64| {
        let pose = Pose::look_at(DVec3::splat(0.5), DVec3::new(9.0, angle, 0.5), DVec3::Z);
        let view = View::perspective(pose, 1.2, 1.0, 0.1, f64::INFINITY).unwrap();
        map.sync(&world.scene);
        map.begin(&view, DVec3::ZERO);
        map.test(&post)
    };
    frame(0.0);
    let before = ALLOCATIONS.get();
    for number in 0..20 {
        assert_eq!(
            frame(0.01 * f64::from(number)),
            Occlusion::Hidden,
            "frame {number}: the post is behind the wall"
        );
    }
    assert_eq!(ALLOCATIONS.get() - before, 0, "allocations in 20 warm frames");
}
