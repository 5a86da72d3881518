//! Climbs towards boxes that a horizon hides and a line of sight reaches, with cameras, solids and lines of
//! sight in exact arithmetic: any exact matrix, any power of two as the unit of coordinates, moved origins.

use visibility_2d::horizon::{Horizon, UpAxis};
use visibility_core::OcclusionMap;
use visibility_core::glam::Affine3A;
use visibility_core::occlusion::Occlusion;
use visibility_testing::{Random, SightWorld, climb, judged, told_enough};

#[test]
fn no_climb_ends_at_a_box_that_a_horizon_hides_and_a_line_reaches() {
    let mut random = Random(1);
    let (mut started, mut all) = (0, 0);
    for number in 0..3000 {
        let world = SightWorld::seen_by_camera(&mut random);
        let up = if random.one_in(4) { UpAxis::Y } else { UpAxis::Z };
        let mut horizon = Horizon::new(up).with_columns(random.pick(&[1, 7, 64, 360]));
        let end = climb(world, &mut random, 60, |world| {
            let (Some(view), Some(mesh)) = (world.view(), world.mesh()) else { return false };
            horizon.begin(&view, world.origin());
            horizon.add(&mesh, &Affine3A::IDENTITY);
            horizon.flush();
            horizon.test(&world.target()) == Occlusion::Hidden
        });
        let Some(end) = end else { continue };
        assert!(end.least > 0.0, "world {number}, {up:?} up: hidden and seen: {:?}", end.input);
        started += 1;
        all += end.judged;
    }
    judged(all);
    told_enough(started > 100 && all > 8 * started, format_args!("{started} worlds, {all} inputs"));
}
