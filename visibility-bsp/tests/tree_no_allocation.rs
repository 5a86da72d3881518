//! Once warm, the cullers' frames and objects that move through a tree allocate no memory, as a counting
//! allocator shows.

use crate::shapes;

use visibility_bsp::{BspOrderCuller, BspTree, NaylorCuller, SceneTree};
use visibility_core::glam::DVec3;
use visibility_core::{Aabb, Culler, Object, Pose, Scene, View, VisibleSet, scene::Triangle};
use visibility_testing::Random;
use visibility_testing::allocations::ALLOCATIONS;

/// Returns a scene of 300 random occluder triangles, one per object.
fn scene(random: &mut Random) -> Scene {
    let mut scene = Scene::new();
    for _ in 0..300 {
        let center = random.fine_vector(20.0);
        let triangle: Triangle = [(); 3].map(|()| (center + random.fine_vector(3.0)).as_vec3());
        let bounds = Aabb::from_points(triangle);
        let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
        scene.set_triangles(id, [triangle]).unwrap();
    }
    scene
}

#[test]
fn warm_frames_allocate_nothing() {
    let mut random = Random(31);
    let scene = scene(&mut random);
    let tree = SceneTree::new(&scene).unwrap();
    let (mut order, mut naylor) = (BspOrderCuller::new(&tree), NaylorCuller::new(&tree));
    let views: Vec<View> = (0..20)
        .map(|_| {
            let pose = Pose::look_at(random.fine_vector(20.0), random.fine_vector(5.0), DVec3::Z);
            View::perspective(pose, 1.0, 1.5, 0.1, f64::INFINITY).unwrap()
        })
        .collect();
    let mut set = VisibleSet::new();
    let mut walk = || {
        let mut counts = Vec::with_capacity(2 * views.len());
        let before = ALLOCATIONS.get();
        for view in &views {
            for culler in [&mut order as &mut dyn Culler, &mut naylor] {
                set.fill(&scene, view);
                culler.cull(&scene, view, &mut set);
                counts.push(set.count(&scene));
            }
        }
        (ALLOCATIONS.get() - before, counts)
    };
    let (cold, first) = walk();
    let (warm, second) = walk();
    assert!(cold > 0, "allocations are counted");
    assert_eq!((warm, second), (0, first), "allocations in warm frames, and objects visible");
}

/// The memory of a walk is bounded by the depth of the tree, so the first frame allocates enough for all
/// later ones.
#[test]
fn views_from_elsewhere_allocate_nothing_either() {
    let mut random = Random(33);
    let scene = scene(&mut random);
    let tree = SceneTree::new(&scene).unwrap();
    let mut order = BspOrderCuller::new(&tree);
    let mut set = VisibleSet::new();
    let mut allocations = Vec::new();
    for frame in 0..400 {
        // The first view sees nothing.
        let eye = if frame == 0 { DVec3::X * 900.0 } else { random.fine_vector(25.0) };
        let target = if frame == 0 { DVec3::X * 950.0 } else { random.fine_vector(5.0) };
        let fov = 0.3 + f64::from(frame % 12) * 0.2;
        let view =
            View::perspective(Pose::look_at(eye, target, DVec3::Z), fov, 1.5, 0.1, f64::INFINITY).unwrap();
        set.fill(&scene, &view);
        let before = ALLOCATIONS.get();
        order.cull(&scene, &view, &mut set);
        allocations.push(ALLOCATIONS.get() - before);
    }
    assert!(allocations[0] > 0, "allocations are counted");
    assert_eq!(allocations[1..].iter().sum::<usize>(), 0, "{allocations:?}");
}

#[test]
fn moving_through_a_tree_allocates_nothing_in_the_long_run() {
    let mut random = Random(32);
    let polygons = shapes::polygons(&mut random, 60);
    let mut tree = BspTree::build((0..).zip(&polygons[..50])).unwrap();
    let mut step = |at: usize| {
        for (owner, polygon) in polygons.iter().enumerate().skip(50) {
            tree.remove(owner as u32);
            let by = DVec3::new((at % 7) as f64 * 0.3, 0.1 * (at % 5) as f64, 0.0);
            let moved: [DVec3; 3] = core::array::from_fn(|i| polygon[i] + by);
            tree.insert(owner as u32, [moved]).unwrap();
        }
    };
    (0..200).for_each(&mut step);
    let before = ALLOCATIONS.get();
    (0..200).for_each(&mut step);
    assert_eq!(ALLOCATIONS.get() - before, 0, "allocations in 200 steps");
}
