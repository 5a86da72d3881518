//! Contract 5 for hierarchical occlusion maps: no allocation per frame once warm, in the driver with each
//! selection of occluders.

mod common;

use common::{occluder, view};
use visibility_core::{Aabb, Culler, Object, Scene, VisibleSet, occlusion::Selection};
use visibility_hzb::{DepthEstimate, Hom, HomCuller};
use visibility_testing::Random;
use visibility_testing::allocations::{ALLOCATIONS, CountingAllocator};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

#[test]
fn a_warm_frame_allocates_nothing_and_gives_the_same_answer() {
    let mut random = Random(5);
    let mut scene = Scene::new();
    for _ in 0..200 {
        let o = occluder(&mut random);
        let corners = o.mesh.bounds().corners().map(|p| o.transform.transform_point3(p));
        let bounds = Aabb::from_points(corners);
        let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
        let mesh = scene.add_mesh(o.mesh);
        scene.set_mesh(id, mesh, o.transform).unwrap();
    }
    scene.insert_batch((0..2000).map(|_| {
        let middle = random.vec3(-9.0, 9.0);
        Aabb::new(middle - 0.3, middle + 0.3)
    }));
    scene.rebuild();
    let views: Vec<_> = (0..8).map(|_| view(&mut random)).collect();
    for estimate in [DepthEstimate::Plane, DepthEstimate::Buffer, DepthEstimate::NoBackground] {
        for selection in
            [Selection::SolidAngle, Selection::LastVisible, Selection::Nearest, Selection::Interleaved]
        {
            let map = Hom::new(320, 180).unwrap().with_depth_estimate(estimate).with_threshold(0.9);
            let mut culler = HomCuller::new(map).with_selection(selection);
            let mut set = VisibleSet::new();
            let mut frame = |number: usize| {
                if number == 0 {
                    culler.reset();
                }
                set.fill(&scene, &views[number]);
                culler.cull(&scene, &views[number], &mut set);
                set.count(&scene)
            };
            let first: [usize; 8] = std::array::from_fn(&mut frame);
            let before = ALLOCATIONS.get();
            let second: [usize; 8] = std::array::from_fn(&mut frame);
            assert_eq!(ALLOCATIONS.get(), before, "{estimate:?}, {selection:?}");
            assert_eq!(first, second, "{estimate:?}, {selection:?}");
            assert!(first.iter().any(|&left| left < 2000), "something is hidden: {first:?}");
        }
    }
}
