//! Viewcells that are oriented boxes by their planes.

use crate::common::{World, cuboid, random_world};
use visibility_core::geometry::Plane;
use visibility_core::glam::{Affine3A, DQuat, DVec3, Vec3};
use visibility_core::pvs::Viewcell;
use visibility_core::{Aabb, RegionCuller};
use visibility_region::ExtendedProjectionCuller;
use visibility_testing::Random;

/// Makes an oriented box as a viewcell, from its rotation, middle and half sizes. Also returns the map from
/// fractions of the box to points in it.
fn oriented(turn: DQuat, middle: DVec3, half: DVec3) -> (Viewcell, impl Fn(DVec3) -> DVec3) {
    let axes = DVec3::AXES.map(|axis| turn * axis);
    let reach = (0..3).map(|i| axes[i].abs() * half[i]).sum::<DVec3>();
    let mut cell = Viewcell::from_box(middle - reach, middle + reach);
    cell.planes = (0..3)
        .flat_map(|i| [axes[i], -axes[i]].map(|normal| Plane::through(middle - normal * half[i], normal)))
        .collect();
    // Points are slightly inside the planes, which are rounded.
    (cell, move |part| middle + turn * (half * (part * 2.0 - 1.0)) * (1.0 - 1e-12))
}

#[test]
fn no_ray_from_an_oriented_cell_reaches_a_hidden_object() {
    let mut rng = Random(21);
    let mut culler = ExtendedProjectionCuller::new();
    let mut hidden_objects = 0;
    for number in 0..15 {
        let (world, _) = random_world(&mut rng, 1.0);
        let turn = DQuat::from_axis_angle(rng.direction(), rng.range(0.2, 1.4));
        let half = DVec3::from_array([2.0, 0.2, 0.3].map(|most| most * rng.unit()));
        let (cell, eye) = oriented(turn, rng.vector(0.5), half);
        let hidden = world.hidden(&mut culler, &cell);
        if let Err(found) = world.search_from(&mut rng, &eye, &hidden, 600) {
            panic!("world {number}: {found:?}");
        }
        hidden_objects += hidden.len();
    }
    assert!(hidden_objects > 200, "{hidden_objects}");
}

/// A street between rows of houses that is not along an axis. From a long narrow viewcell along the street,
/// about as many objects are hidden as if the street were along an axis.
#[test]
fn a_street_askew_is_as_tight_as_one_along_an_axis() {
    let hidden_of = |angle: f64, oriented_cell: bool| {
        let turn = DQuat::from_rotation_z(angle);
        let transform = Affine3A::from_rotation_z(angle as f32);
        let mut world = World::new();
        for i in 0..12 {
            let x = i as f32 * 10.0 - 60.0;
            for y in [5.0, -12.0, 20.0, -27.0] {
                world.add(&cuboid([x, y, 0.0], [x + 9.0, y + 7.0, 12.0]), false, transform);
                for side in [-1.5, 8.5] {
                    let at = transform.transform_point3(Vec3::new(x + 4.5, y + side, 0.5));
                    world.add_target(Aabb::new(at - 0.2, at + 0.2));
                }
            }
        }
        let (cell, _) = oriented(turn, DVec3::Z * 1.5, DVec3::new(10.0, 1.0, 0.5));
        let upright = Viewcell::from_box(cell.min, cell.max);
        let cell = if oriented_cell { cell } else { upright };
        world.hidden(&mut ExtendedProjectionCuller::new(), &cell).len()
    };
    let along = hidden_of(0.0, false);
    let [askew, around] = [true, false].map(|oriented_cell| hidden_of(0.6, oriented_cell));
    assert!(askew * 10 > along * 8 && around * 2 < askew, "{along} along an axis, {askew} of {around} askew");
}

#[test]
fn the_planes_of_an_empty_viewcell_leave_nothing_to_panic_about() {
    let mut world = World::new();
    world.add_box([9.0, -9.0, -9.0], [9.2, 9.0, 9.0]);
    let (mut empty, _) = oriented(DQuat::from_rotation_z(0.8), DVec3::ZERO, DVec3::new(4.0, 0.3, 0.3));
    empty.planes.extend([
        Plane::new(DVec3::X, -1e9),
        Plane::new(DVec3::NAN, f64::NAN),
        Plane::new(DVec3::ZERO, 1.0),
    ]);
    ExtendedProjectionCuller::new().cull(&world.scene, &empty, &mut visibility_core::VisibleSet::new());
}
