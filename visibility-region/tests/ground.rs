//! Viewcells that stand exactly on the ground on which most objects stand. Objects that are visible past the
//! lower edges of occluders must not be hidden.

use crate::common::World;
use visibility_core::glam::{Affine3A, DVec3};
use visibility_core::pvs::Viewcell;
use visibility_core::{Aabb, Object, OccluderMesh};
use visibility_region::ExtendedProjectionCuller;
use visibility_testing::{Random, judged, told_enough};

/// Returns a box with axis `up` as its upward axis, or as its downward axis if `flip`. `low` and `high` are
/// its extent along x, y and upwards.
fn turned(low: [f32; 3], high: [f32; 3], up: usize, flip: bool) -> ([f32; 3], [f32; 3]) {
    let (mut min, mut max) = ([0.0; 3], [0.0; 3]);
    for i in 0..3 {
        let axis = (up + 1 + i) % 3;
        let flip = flip && i == 2;
        (min[axis], max[axis]) = if flip { (-high[i], -low[i]) } else { (low[i], high[i]) };
    }
    (min, max)
}

#[test]
fn no_ray_from_a_cell_on_the_ground_reaches_a_hidden_object() {
    let mut rng = Random(11);
    let (mut hidden_objects, mut standing) = (0, 0);
    for number in 0..120 {
        let mut world = World::new();
        let (up, flip) = (number % 3, number / 3 % 2 == 1);
        // The height of the ground has no short binary fraction in most rounds.
        let ground = rng.pick(&[0.0f32, 0.1, -3.3]);
        let gaps =
            rng.pick(&[[0.0f32; 6], [0.0, 0.0, 0.0, 1e-4, 0.02, -1.0], [0.0, 0.0, 0.0, 0.0, -0.05, 0.4]]);
        for _ in 0..rng.pick(&[3, 12, 30]) {
            let (x, y) = (rng.range(3.0, 25.0) as f32, rng.range(-25.0, 15.0) as f32);
            let (depth, width) = (rng.range(0.1, 5.0) as f32, rng.range(4.0, 20.0) as f32);
            let base = ground + rng.pick(&gaps);
            let top = ground + rng.range(2.0, 12.0) as f32;
            let (min, max) = turned([x, y, base], [x + depth, y + width, top], up, flip);
            world.add_box(min, max);
        }
        for _ in 0..60 {
            let (x, y) = (rng.range(4.0, 50.0) as f32, rng.range(-40.0, 40.0) as f32);
            let base = ground + rng.pick(&[0.0f32, 0.0, 0.0, 0.0, -1.0, -0.1, -0.01, 0.5]);
            let height = rng.pick(&[0.0f32, 0.5, 1.5]);
            let (min, max) = turned([x, y, base], [x + 0.8, y + 0.8, base + height], up, flip);
            world.add_target(Aabb::from_arrays(min, max));
        }
        // Most cells stand on the ground, some a little below or above it.
        let floor = ground + rng.pick(&[0.0f32, 0.0, 0.0, -0.01, 0.001, -1e-6]);
        let (min, max) = turned([-1.5, -1.5, floor], [1.5, 1.5, ground + 2.0], up, flip);
        let cell =
            Viewcell::from_box(DVec3::from_array(min.map(f64::from)), DVec3::from_array(max.map(f64::from)));
        let hidden = world.hidden(&mut ExtendedProjectionCuller::new(), &cell);
        hidden_objects += hidden.len();
        standing += if floor == ground { hidden.len() } else { 0 };
        let found = world.search(&mut rng, &cell, &hidden, 3000);
        assert!(found.is_ok(), "world {number}: {found:?}");
    }
    judged(hidden_objects as u64);
    told_enough(standing > 1000, format_args!("{standing} of {hidden_objects}"));
}

#[test]
fn what_stands_behind_a_wall_is_seen_through_a_crack_under_the_wall_however_thin() {
    let cell = Viewcell::from_box(DVec3::new(-1.0, -1.0, 0.0), DVec3::new(1.0, 1.0, 2.0));
    for (base, is_hidden) in [(-1.0, true), (0.0, true), (1e-6, false), (1e-3, false), (0.03, false)] {
        let mut world = World::new();
        world.add_box([5.0, -30.0, base], [5.5, 30.0, 20.0]);
        let posts: Vec<_> = [-4.0f32, 0.0, 4.0]
            .map(|y| world.add_target(Aabb::from_arrays([20.0, y, 0.0], [20.5, y + 0.5, 1.0])))
            .into();
        let hidden = world.hidden(&mut ExtendedProjectionCuller::new(), &cell);
        assert!(posts.iter().all(|id| hidden.contains(id) == is_hidden), "{base}");
    }
}

/// A wall that goes deep into the ground covers nothing above it, though another part of the wall stands out
/// of the ground. A flat object on the ground is visible over the sunken part and beside the standing part.
#[test]
fn what_lies_on_the_ground_is_seen_over_a_wall_that_ends_there() {
    for number in 0..12 {
        let (up, flip, slanted) = (number % 3, number / 3 % 2 == 1, number >= 6);
        let bounds = |min, max| {
            let (min, max) = turned(min, max, up, flip);
            Aabb::from_arrays(min, max)
        };
        let point = |[x, z]: [f32; 2]| bounds([x, 6.0, z], [x, 6.0, z]).min;
        let quad = |[low, high]: [[f32; 2]; 2]| {
            let [a, b, c, d] = [low, [high[0], low[1]], high, [low[0], high[1]]].map(point);
            vec![[a, b, c], [a, c, d]]
        };
        let sunken = match slanted {
            true => vec![[[-10.0, -5.0], [10.0, -5.0], [-2.0, 0.0]].map(point)],
            false => quad([[-10.0, -5.0], [10.0, 0.0]]),
        };
        let parts = [sunken, quad([[5.0, 0.0], [10.0, 5.0]])].concat();
        let mesh = OccluderMesh::from_triangles(&parts).unwrap().with_two_sided(true);
        let mut world = World::new();
        let wall = bounds([-10.0, 6.0, -5.0], [10.0, 6.0, 5.0]);
        let wall = world.scene.insert(Object { occluder: true, ..Object::new(wall) });
        let mesh = world.scene.add_mesh(mesh);
        world.scene.set_mesh(wall, mesh, Affine3A::IDENTITY).unwrap();
        let rug = world.scene.insert(bounds([-3.0, 6.002, 0.0], [-1.0, 6.01, 0.01]));
        // Objects that begin at the same height make it the rim of the sweep.
        world.scene.insert(bounds([-10.0, 40.0, 0.0], [50.0, 50.0, 100.0]));
        let cell = bounds([0.0; 3], [1.0, 1.0, 0.5]);
        let cell = Viewcell::from_box(cell.min.as_dvec3(), cell.max.as_dvec3());
        let hidden = world.hidden(&mut ExtendedProjectionCuller::new(), &cell);
        assert!(!hidden.contains(&rug), "axis {up} up, turned over {flip}, slanted {slanted}");
    }
}
