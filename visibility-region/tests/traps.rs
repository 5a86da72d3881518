//! Small scenes, one for each mistake that is easily made with extended projections.

use crate::common::{World, cuboid};
use visibility_core::glam::{Affine3A, DVec3, Vec3};
use visibility_core::pvs::Viewcell;
use visibility_core::{Aabb, Accuracy, ObjectId, RegionCuller};
use visibility_region::ExtendedProjectionCuller;

fn cell() -> Viewcell {
    Viewcell::from_box(DVec3::splat(-0.5), DVec3::splat(0.5))
}

fn hides(world: &World, id: ObjectId) -> bool {
    world.hidden(&mut ExtendedProjectionCuller::new(), &cell()).contains(&id)
}

fn target(x: f32, y: f32, z: f32) -> Aabb {
    Aabb::from_arrays([x, y - 0.3, z - 0.3], [x + 0.6, y + 0.3, z + 0.3])
}

#[test]
fn an_object_is_not_hidden_by_its_own_front_nor_by_a_front_in_the_same_plane() {
    let mut world = World::new();
    let wall = world.add_box([5.0, -9.0, -9.0], [5.5, 9.0, 9.0]);
    let picture = world.add_target(Aabb::from_arrays([5.0, -1.0, -1.0], [5.0, 1.0, 1.0]));
    let thicker = world.add_target(Aabb::from_arrays([5.0, 2.0, -1.0], [5.2, 3.0, 1.0]));
    let behind = world.add_target(target(5.5, 0.0, 0.0));
    assert!(
        !hides(&world, wall) && !hides(&world, picture) && !hides(&world, thicker),
        "the wall, the picture in its plane and the thing that begins there"
    );
    assert!(hides(&world, behind), "what touches the back");
}

#[test]
fn rays_that_pass_beside_an_earlier_window_are_not_taken_for_blocked() {
    // At x = 40 the umbra of the near wall ends at y = 23, so the targets at the sides are visible.
    let mut world = World::new();
    world.add_box([4.0, -3.0, -3.0], [4.2, 3.0, 3.0]);
    world.add_box([20.0, -6.0, -6.0], [20.2, 6.0, 6.0]);
    let middle = world.add_target(target(40.0, 0.0, 0.0));
    let aside = [-38.0, -30.0, -24.0, 24.0, 30.0, 38.0].map(|y| world.add_target(target(40.0, y, 0.0)));
    assert!(hides(&world, middle), "what is behind both walls");
    assert!(aside.iter().all(|&id| !hides(&world, id)), "what is beside the far wall");
}

#[test]
fn walls_between_the_houses_of_a_row_do_not_divide_it() {
    // No house is wider than the viewcell: only the row as a whole hides anything.
    let row = |gap: f32| {
        let mut world = World::new();
        for i in -10..10 {
            let (y, top) = (0.9 * i as f32, if i % 2 == 0 { 8.0 } else { 9.0 });
            world.add_box([4.0, y, -9.0], [7.0, y + 0.9 - gap, top]);
        }
        let id = world.add_target(target(30.0, 0.0, 0.0));
        hides(&world, id)
    };
    assert!(row(0.0), "the row without gaps hides");
    assert!(!row(0.01), "through the gaps it is seen");
}

#[test]
fn what_stands_on_the_ground_behind_a_wall_is_hidden_though_the_wall_ends_there_too() {
    let mut world = World::new();
    world.add_box([-90.0, -90.0, -2.0], [90.0, 90.0, -1.0]);
    world.add_box([5.0, -20.0, -1.0], [5.2, 20.0, 9.0]);
    let id = world.add_target(Aabb::from_arrays([20.0, -1.0, -1.0], [21.0, 1.0, 1.0]));
    assert!(hides(&world, id), "the thing on the ground behind the wall");
}

#[test]
fn what_stands_on_the_ground_is_hidden_from_the_ground_up_and_hangs_from_a_ceiling_likewise() {
    for up in [1.0f32, -1.0] {
        let mut world = World::new();
        let upright = |x: [f32; 2], y: [f32; 2], z: [f32; 2]| {
            let z = z.map(|z| z * up);
            ([x[0], y[0], z[0].min(z[1])], [x[1], y[1], z[0].max(z[1])])
        };
        // Streets along x and y, between touching houses of different heights.
        for block in 0..64 {
            let (x, y) = (10.0 + 40.0 * (block / 8) as f32, 45.0 * (block % 8) as f32 - 180.0);
            for house in 0..6 {
                let (low, high) = (y + 6.0 * house as f32, y + 6.0 * (house + 1) as f32);
                let top = 8.0 + ((block * 7 + house * 5) % 11) as f32;
                let (min, max) = upright([x, x + 30.0], [low, high], [0.0, top]);
                world.add_box(min, max);
            }
        }
        let crates: Vec<ObjectId> = (0..200)
            .map(|i| {
                let (x, y) = (82.0 + 40.0 * (i % 6) as f32, 1.7 * i as f32 - 170.0);
                let (min, max) = upright([x, x + 1.0], [y, y + 1.0], [0.0, 1.0]);
                world.add_target(Aabb::from_arrays(min, max))
            })
            .collect();
        // A tower makes the pixels large, and an object under the ground makes rays go below the ground.
        let (min, max) = upright([70.0, 75.0], [0.0, 5.0], [0.0, 300.0]);
        world.add_target(Aabb::from_arrays(min, max));
        for i in 0..10 {
            let (min, max) =
                upright([70.0, 72.0], [4.0 * i as f32 - 20.0, 4.0 * i as f32 - 19.0], [-9.0, -8.0]);
            world.add_target(Aabb::from_arrays(min, max));
        }
        for low in [0.005, 0.0] {
            let high = 3.0;
            let z = if up > 0.0 { [low, high] } else { [-high, -low] };
            let cell = Viewcell::from_box(DVec3::new(-2.0, -2.0, z[0]), DVec3::new(2.0, 2.0, z[1]));
            let hidden = world.hidden(&mut ExtendedProjectionCuller::new(), &cell);
            let count = crates.iter().filter(|id| hidden.contains(id)).count();
            assert!(count > 180, "{count} of 200, upwards: {up}, from {low}");
        }
    }
}

#[test]
fn a_wall_gets_its_plane_however_many_small_occluders_there_are() {
    let mut world = World::new();
    world.add_box([5.0, -20.0, -20.0], [5.2, 20.0, 20.0]);
    for i in 0..400 {
        let (x, y) = (6.0 + 0.1 * i as f32, (i % 20) as f32 - 10.0);
        world.add_box([x, y, -9.0], [x + 0.05, y + 0.3, 9.0]);
    }
    let id = world.add_target(target(5.3, 0.0, 0.0));
    assert!(hides(&world, id), "what is just behind the wall");
}

#[test]
fn objects_between_two_directions_are_hidden_by_a_wall_around_the_corner() {
    let mut world = World::new();
    world.add_box([5.0, -9.0, -9.0], [5.2, 5.2, 9.0]);
    world.add_box([-9.0, 5.0, -9.0], [5.2, 5.2, 9.0]);
    let ids = [target(20.0, 15.0, 0.0), target(15.0, 22.0, 0.0)].map(|bounds| world.add_target(bounds));
    assert!(ids.iter().all(|&id| hides(&world, id)), "what is behind the corner");
}

#[test]
fn a_face_whose_plane_cuts_the_cell_does_not_occlude() {
    // Seen from below, the front of the quadrilateral occludes. The upper corners of the cell look through
    // its back.
    let quad = |tilt: f32| {
        let p = |x: f32, y: f32| Vec3::new(x, y, tilt * (x - 4.0));
        [[p(2.0, 9.0), p(30.0, 9.0), p(30.0, -9.0)], [p(2.0, 9.0), p(30.0, -9.0), p(2.0, -9.0)]]
    };
    for tilt in [0.02, 0.05, 0.1] {
        let mut world = World::new();
        world.add(&quad(tilt), false, Affine3A::IDENTITY);
        let id = world.add_target(Aabb::from_arrays([20.0, -0.3, 1.0], [20.1, 0.3, 1.4]));
        assert!(!hides(&world, id), "{tilt}");
    }
}

#[test]
fn a_floor_that_ends_under_the_cell_is_seen_past_its_near_end() {
    let floor = |begin: f32| {
        let mut world = World::new();
        world.add_box([begin, -20.0, -0.62], [30.0, 20.0, -0.6]);
        let id = world.add_target(Aabb::from_arrays([5.0, -0.3, -1.3], [5.3, 0.3, -1.0]));
        hides(&world, id)
    };
    // Rays from the lower back of the cell pass the floor's near end, which is 5 cm behind the front of the
    // cell.
    assert!(!floor(0.45), "the floor hides what is below its near end");
}

#[test]
fn glass_doors_and_movers_never_occlude() {
    let mut world = World::new();
    let door = world.add_box([5.0, -9.0, -9.0], [5.2, 9.0, 9.0]);
    let id = world.add_target(target(20.0, 0.0, 0.0));
    let mut culler = ExtendedProjectionCuller::new();
    assert!(world.hidden(&mut culler, &cell()).contains(&id), "the shut door hides");
    world.scene.set_occluder(door, false).unwrap();
    assert!(!world.hidden(&mut culler, &cell()).contains(&id), "open");
    world.scene.set_occluder(door, true).unwrap();
    assert!(world.hidden(&mut culler, &cell()).contains(&id), "shut");
    world.scene.set_bounds(door, Aabb::from_arrays([5.0, 9.0, -9.0], [5.2, 27.0, 9.0])).unwrap();
    assert!(!world.hidden(&mut culler, &cell()).contains(&id), "slid aside");
}

#[test]
fn another_scene_under_a_live_culler_is_taken_in() {
    let mut culler = ExtendedProjectionCuller::new();
    let mut with = World::new();
    let (_, id) = (with.add_box([5.0, -9.0, -9.0], [5.2, 9.0, 9.0]), with.add_target(target(20.0, 0.0, 0.0)));
    assert!(with.hidden(&mut culler, &cell()).contains(&id), "the wall of the first scene hides");
    let mut without = World::new();
    without.add_box([5.0, 5.0, -9.0], [5.2, 9.0, 9.0]);
    let other = without.add_target(target(20.0, 0.0, 0.0));
    assert!(!without.hidden(&mut culler, &cell()).contains(&other), "the wall of the second scene is aside");
    let mut copy = with.scene.clone();
    copy.remove(with.bounds[0].0).unwrap();
    let original = core::mem::replace(&mut with.scene, copy);
    assert!(!with.hidden(&mut culler, &cell()).contains(&id), "a changed copy");
    with.scene = original;
    assert!(with.hidden(&mut culler, &cell()).contains(&id), "the original scene is back");
}

#[test]
fn no_input_panics_and_improper_input_hides_nothing() {
    let mut world = World::new();
    world.add_box([5.0, -9.0, -9.0], [5.2, 9.0, 9.0]);
    world.add(&cuboid([1e30; 3], [2e30; 3]), true, Affine3A::IDENTITY);
    world.add_target(target(20.0, 0.0, 0.0));
    world.add_target(Aabb::EMPTY);
    world.add_target(Aabb::new(Vec3::NAN, Vec3::ONE));
    world.add_target(Aabb::from_arrays([-f32::MAX; 3], [f32::MAX; 3]));
    let mut culler = ExtendedProjectionCuller::new();
    assert_eq!(culler.accuracy(), Accuracy::Conservative, "extended projections are conservative");
    for at in [0.0, 1.0, f64::MIN_POSITIVE, 1e30, 1e300, f64::INFINITY, f64::NAN] {
        for size in [0.0, 1.0, 1e-300, 1e300, f64::NEG_INFINITY, f64::NAN] {
            let cell = Viewcell::from_box(DVec3::splat(at), DVec3::splat(at + size));
            let hidden = world.hidden(&mut culler, &cell);
            assert!(
                at.is_finite() && size.is_finite() || hidden.is_empty(),
                "at {at} with size {size}: {} hidden",
                hidden.len()
            );
        }
    }
    assert!(World::new().hidden(&mut culler, &cell()).is_empty(), "an empty scene has nothing to hide");
}

#[test]
fn the_answer_does_not_depend_on_the_scale() {
    for exponent in [-40, -20, 0, 20, 40] {
        let scale = 2f32.powi(exponent);
        let mut world = World::new();
        let s = |p: [f32; 3]| p.map(|x| x * scale);
        world.add_box(s([5.0, -9.0, -9.0]), s([5.2, 9.0, 9.0]));
        let id = world.add_target(Aabb::from_arrays(s([20.0, -0.3, -0.3]), s([21.0, 0.3, 0.3])));
        let size = DVec3::splat(0.5 * f64::from(scale));
        let hidden = world.hidden(&mut ExtendedProjectionCuller::new(), &Viewcell::from_box(-size, size));
        assert!(hidden.contains(&id) && hidden.len() == 1, "{exponent}");
    }
}

/// Transforms of an occluder: the identity, with which surfaces are joined, and another.
fn transforms() -> [Affine3A; 2] {
    [Affine3A::IDENTITY, Affine3A::from_translation(Vec3::new(0.0, 0.0, 0.125))]
}

/// Returns the two triangles of an upright quadrilateral over a segment of the xy plane. Its front is on the
/// left of the segment.
fn upright([a, b]: [[f32; 2]; 2], half_height: f32) -> [visibility_core::scene::Triangle; 2] {
    let at = |[x, y]: [f32; 2], z: f32| Vec3::new(x, y, z * half_height);
    [[at(b, -1.0), at(a, -1.0), at(a, 1.0)], [at(b, -1.0), at(a, 1.0), at(b, 1.0)]]
}

#[test]
fn a_wall_that_turns_its_back_on_part_of_the_cell_does_not_close_a_ridge() {
    // The wall from the ridge backwards faces the middle of the cell, and shows its back to the middle of the
    // cell's front. Seen from there, the ridge covers points that the back of the cell sees past the far end.
    let ridge = [[5.0, 0.0], [5.0, 10.0 / 3.0], [20.0, 10.0]];
    for transform in transforms() {
        let mut world = World::new();
        let walls = [upright([ridge[0], ridge[1]], 20.0), upright([ridge[1], ridge[2]], 20.0)];
        world.add(walls.as_flattened(), false, transform);
        let seen = world.add_target(Aabb::from_arrays([21.0, 11.0, -0.2], [21.5, 11.7, 0.2]));
        let hidden = world.add_target(Aabb::from_arrays([21.0, 2.0, -0.2], [21.5, 3.0, 0.2]));
        let cell = Viewcell::from_box(DVec3::new(-10.0, -0.03, -0.1), DVec3::new(0.0, 0.03, 0.1));
        let all = world.hidden(&mut ExtendedProjectionCuller::new(), &cell);
        assert!(!all.contains(&seen) && all.contains(&hidden), "{transform}");
    }
}

#[test]
fn what_hangs_on_a_slanted_wall_is_seen_wherever_planes_cut_the_wall() {
    for transform in transforms() {
        let mut world = World::new();
        world.add(&upright([[5.0, -4.0], [60.0, 30.0]], 40.0), false, transform);
        world.add(&upright([[70.0, -40.0], [70.0, 40.0]], 40.0), false, transform);
        let pictures: Vec<_> = (0..600)
            .map(|i| {
                let part = i as f32 / 600.0;
                let at = Vec3::new(5.0 + 55.0 * part - 0.03, -4.0 + 34.0 * part, 0.1);
                world.add_target(Aabb::new(at, at + 0.002))
            })
            .collect();
        for y in [-35.0, 35.0] {
            world.add_target(target(80.0, y, 0.0));
        }
        let hidden = world.hidden(&mut ExtendedProjectionCuller::new(), &cell());
        let lost = pictures.iter().filter(|id| hidden.contains(id)).count();
        assert_eq!(lost, 0, "{transform}");
    }
}

#[test]
fn a_slanted_floor_hides_nothing_that_is_seen_past_its_near_end() {
    // The floor ends beside the cell, nearer than the depth at which occluders are cut off. Since it is
    // slanted, its bounds do not reveal this.
    let at = |x: f32, y: f32| Vec3::new(x, y, -1.0 - 0.5 * y);
    let [a, b, c, d] = [at(0.45, -20.0), at(30.0, -20.0), at(30.0, 20.0), at(0.45, 20.0)];
    for transform in transforms() {
        let mut world = World::new();
        world.add(&[[a, b, c], [a, c, d]], false, transform);
        let seen = world.add_target(Aabb::from_arrays([8.0, -0.3, -6.3], [8.3, 0.3, -5.7]));
        assert!(!hides(&world, seen), "{transform}");
    }
}

#[test]
fn each_edge_of_a_plate_has_its_penumbra() {
    for (transform, two_sided) in transforms().into_iter().flat_map(|t| [(t, false), (t, true)]) {
        let mut world = World::new();
        world.add(&upright([[5.0, -3.0], [5.0, 3.0]], 3.0), two_sided, transform);
        // Targets behind the plate as seen from the middle of the cell. As seen from its sides, the shadow
        // ends at 9.8 and 14.7.
        let mut beside = |along: f32| {
            [[along, 0.0], [-along, 0.0], [0.0, along], [0.0, -along]].map(|[y, z]| {
                let at = Vec3::new(20.0, y, z);
                world.add_target(Aabb::new(at - 0.2, at + 0.2))
            })
        };
        let (inside, seen) = (beside(9.0), beside(12.0));
        let hidden = world.hidden(&mut ExtendedProjectionCuller::new(), &cell());
        assert!(inside.iter().all(|id| hidden.contains(id)), "{transform}");
        assert!(!seen.iter().any(|id| hidden.contains(id)), "{transform}");
    }
}

#[test]
fn the_shadow_of_a_solid_narrows_from_its_back_on() {
    // The cell is wider than the solid. At the object, the shadow of the solid is 1.7 wide from the front of
    // the cell on, and nearly 2 from its back on.
    let cell = Viewcell::from_box(DVec3::new(-1.0, -2.2, -2.2), DVec3::new(0.5, 2.2, 2.2));
    for transform in transforms() {
        let mut world = World::new();
        world.add(&cuboid([4.0, -2.0, -2.0], [8.0, 2.0, 2.0]), false, transform);
        let bounds = |half: f32| Aabb::from_arrays([9.0, -half, -1.0], [9.1, half, 1.0]);
        let [narrow, wide] = [1.8, 2.0].map(|half| world.add_target(bounds(half)));
        let hidden = world.hidden(&mut ExtendedProjectionCuller::new(), &cell);
        assert!(hidden.contains(&narrow) && !hidden.contains(&wide), "{transform}");
    }
}

#[test]
fn a_solid_around_the_cell_is_seen_through_from_inside() {
    for transform in transforms() {
        let mut world = World::new();
        world.add(&cuboid([-9.0; 3], [9.0; 3]), false, transform);
        let id = world.add_target(target(20.0, 0.0, 0.0));
        assert!(!hides(&world, id), "{transform}");
    }
}
