//! One object of any size or distance does not change what is hidden of the other objects, nor the work by
//! much.

use crate::common::{PointShadows, World, cuboid};
use std::collections::BTreeSet;
use visibility_core::glam::{Affine3A, DVec3};
use visibility_core::pvs::Viewcell;
use visibility_core::{Aabb, CullStats, ObjectId, RegionCuller, VisibleSet};
use visibility_region::{ConvexBlockersCuller, ExtendedProjectionCuller, ShrunkCuller, VolumetricCuller};
use visibility_testing::Random;

type Add = fn(&mut World);
type Make = fn() -> Box<dyn RegionCuller>;

/// Makes blocks of houses, with posts between them.
fn town() -> World {
    let (mut world, mut rng) = (World::new(), Random(5));
    for i in 0..49 {
        let [x, y] = [i % 7, i / 7].map(|k| (k * 20 - 65) as f32);
        let high = rng.range(8.0, 20.0) as f32;
        world.add_box([x, y, 0.0], [x + 14.0, y + 14.0, high]);
        for _ in 0..5 {
            let at = [x + 15.0 + 4.0 * rng.unit() as f32, y + 18.0 * rng.unit() as f32, 3.0];
            world.add_target(Aabb::from_arrays(at, [at[0] + 0.4, at[1] + 0.4, 4.5]));
        }
    }
    world
}

fn add_box(world: &mut World, min: [f32; 3], max: [f32; 3]) {
    world.add(&cuboid(min, max), false, Affine3A::IDENTITY).unwrap();
}

fn cull(world: &World, culler: &mut dyn RegionCuller) -> (BTreeSet<ObjectId>, CullStats) {
    let cell = Viewcell::from_box(DVec3::new(-4.0, -2.0, 1.0), DVec3::new(-3.0, -1.0, 2.0));
    let mut visible = VisibleSet::new();
    let stats = culler.cull(&world.scene, &cell, &mut visible);
    visible.finish(&world.scene);
    let seen: BTreeSet<_> = visible.iter(&world.scene).collect();
    (world.scene.ids().filter(|id| !seen.contains(id)).collect(), stats)
}

#[test]
fn one_huge_or_far_object_changes_little() {
    let additions: [(&str, Add); 8] = [
        ("around all", |world| _ = world.add_target(Aabb::from_arrays([-1e30; 3], [1e30; 3]))),
        ("beyond all", |world| _ = world.add_target(Aabb::from_arrays([1e29, -1e30, -1e30], [1e30; 3]))),
        ("far", |world| _ = world.add_target(Aabb::from_arrays([1e5, 1e4, 0.0], [1.1e5, 2e4, 3e3]))),
        ("very far", |world| _ = world.add_target(Aabb::from_arrays([1e12; 3], [1.1e12; 3]))),
        ("endless", |world| _ = world.add_target(Aabb::from_arrays([9.0; 3], [f32::INFINITY; 3]))),
        ("a solid beyond all", |world| add_box(world, [1e29, -1e30, -1e30], [1e30; 3])),
        ("ground", |world| add_box(world, [-1e30, -1e30, -2.0], [1e30, 1e30, -1.0])),
        ("ground of 100 km", |world| add_box(world, [-1e5, -1e5, -2.0], [1e5, 1e5, -1.0])),
    ];
    let cullers: [(&str, Make); 4] = [
        ("sweep", || Box::new(ExtendedProjectionCuller::new())),
        ("convex", || Box::new(ConvexBlockersCuller::new())),
        ("volumetric", || Box::new(VolumetricCuller::new())),
        ("shrunk", || Box::new(ShrunkCuller::new(PointShadows, 2))),
    ];
    for (name, make) in cullers {
        let plain = town();
        let (hidden, plain_stats) = cull(&plain, make().as_mut());
        assert!(hidden.len() > 25, "{name}: {}", hidden.len());
        for (what, add) in &additions {
            let mut world = plain_copy(&plain);
            add(&mut world);
            let (now, stats) = cull(&world, make().as_mut());
            let kept = now.iter().filter(|id| hidden.contains(id)).count();
            assert!(kept * 20 >= hidden.len() * 19, "{name}, {what}: {kept} of {}", hidden.len());
            let work = |stats: &CullStats| stats.tests + stats.nodes + stats.occluders;
            assert!(work(&stats) <= 2 * work(&plain_stats), "{name}, {what}: {stats:?} from {plain_stats:?}");
        }
    }
}

/// Returns a world with a copy of the scene, whose objects have the same ids.
fn plain_copy(world: &World) -> World {
    World { scene: world.scene.clone(), ..World::new() }
}
