//! Climbs towards boxes that a culler hides from a viewcell and a line of sight reaches, with viewcells,
//! meshes and lines of sight in exact arithmetic, at any power of two as the unit of coordinates.

use visibility_core::{RegionCuller, VisibleSet};
use visibility_region::{ConvexBlockersCuller, ExtendedProjectionCuller};
use visibility_testing::{Random, SightWorld, climb, judged, told_enough};

/// Climbs from `count` random worlds and asserts that no hidden target is seen.
fn run(seed: u64, count: usize, culler: &mut dyn RegionCuller) {
    let mut random = Random(seed);
    let (mut started, mut all) = (0, 0);
    for number in 0..count {
        let world = SightWorld::seen_from_cell(&mut random);
        let end = climb(world, &mut random, 12, |world| {
            let Some((scene, target)) = world.scene() else { return false };
            let mut visible = VisibleSet::new();
            culler.cull(&scene, &world.cell(), &mut visible);
            !visible.contains(&scene, target)
        });
        let Some(end) = end else { continue };
        assert!(end.least > 0.0, "world {number}: hidden and seen: {:?}", end.input);
        started += 1;
        all += end.judged;
    }
    judged(all);
    told_enough(started > 0, format_args!("none of {count} worlds has a hidden target"));
}

#[test]
fn no_climb_ends_at_a_box_that_the_sweep_hides_and_a_line_reaches() {
    run(1, 60, &mut ExtendedProjectionCuller::new());
}

#[test]
fn no_climb_ends_at_a_box_that_solids_hide_and_a_line_reaches() {
    run(2, 200, &mut ConvexBlockersCuller::new());
}
