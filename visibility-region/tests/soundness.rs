//! Nothing that a ray from the viewcell reaches is hidden.

mod common;

use common::random_world;
use visibility_region::ExtendedProjectionCuller;
use visibility_testing::Random;

/// Searches `worlds` random worlds. Returns how many objects were hidden.
fn search(seed: u64, worlds: usize, rays: usize) -> usize {
    let mut rng = Random(seed);
    let mut culler = ExtendedProjectionCuller::new();
    let mut hidden_objects = 0;
    for number in 0..worlds {
        let scale = rng.pick(&[1.0, 1.0, 1.0, 1e-3, 1e4]);
        let (world, cell) = random_world(&mut rng, scale);
        let hidden = world.hidden(&mut culler, &cell);
        hidden_objects += hidden.len();
        if let Err((id, eye, direction)) = world.search(&mut rng, &cell, &hidden, rays) {
            panic!("seed {seed}, world {number}: object {id} is seen from {eye} in direction {direction}");
        }
    }
    hidden_objects
}

#[test]
fn no_ray_from_the_cell_reaches_a_hidden_object() {
    let hidden = search(1, 50, 1000);
    assert!(hidden > 300, "{hidden}");
}

#[test]
#[ignore = "minutes"]
fn no_ray_from_the_cell_reaches_a_hidden_object_in_many_worlds() {
    for seed in 2..50 {
        search(seed, 150, 4000);
    }
}
