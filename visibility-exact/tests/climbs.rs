//! Climbs towards boxes that are proven hidden from a viewcell and that a line of sight reaches, with
//! viewcells, meshes and lines of sight in exact arithmetic, at any power of two as the unit of coordinates.

use std::sync::Arc;
use visibility_core::{RegionCuller, VisibleSet};
use visibility_exact::{Effort, ExactCuller, ExactSettings, SceneTriangles};
use visibility_testing::{Random, SightWorld, climb, judged, told_enough};

#[test]
fn no_climb_ends_at_a_box_that_is_proven_hidden_and_a_line_reaches() {
    let mut random = Random(1);
    let settings = ExactSettings::new(Effort::Exact(0.0)).with_rays(4).with_aimed_rays(1);
    let (mut started, mut all) = (0, 0);
    for number in 0..200 {
        let world = SightWorld::seen_from_cell(&mut random);
        let end = climb(world, &mut random, 40, |world| {
            let Some((scene, target)) = world.scene() else { return false };
            let mut culler = ExactCuller::new(Arc::new(SceneTriangles::new(&scene)), settings);
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
    told_enough(started > 10 && all > 8 * started, format_args!("{started} worlds, {all} inputs"));
}
