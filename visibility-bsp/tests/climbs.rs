//! Climbs towards boxes that a culler hides and a line of sight reaches, with cameras, meshes and lines of
//! sight in exact arithmetic: any exact matrix, any power of two as the unit of coordinates, moved origins.

use crate::rims::cullers;
use visibility_bsp::OcclusionTree;
use visibility_core::glam::Affine3A;
use visibility_core::occlusion::{Occlusion, Preparation};
use visibility_core::{OcclusionMap, VisibleSet};
use visibility_testing::{Random, SightWorld, climb, judged, told_enough};

/// Climbs from `count` random worlds and asserts that no hidden target is seen.
fn run(seed: u64, count: usize, mut is_hidden: impl FnMut(&SightWorld) -> bool) {
    let mut random = Random(seed);
    let (mut started, mut all) = (0, 0);
    for number in 0..count {
        let world = SightWorld::seen_by_camera(&mut random);
        let Some(end) = climb(world, &mut random, 60, &mut is_hidden) else { continue };
        assert!(end.least > 0.0, "world {number}: hidden and seen: {:?}", end.input);
        started += 1;
        all += end.judged;
    }
    judged(all);
    told_enough(
        started > count / 16 && all > 8 * started as u64,
        format_args!("{started} worlds of {count}, {all} inputs"),
    );
}

#[test]
fn no_climb_ends_at_a_box_that_the_tree_hides_and_a_line_reaches() {
    let mut tree = OcclusionTree::new();
    run(1, 1000, |world| {
        let (Some(view), Some(mesh)) = (world.view(), world.mesh()) else { return false };
        tree.begin(&view, world.origin());
        tree.add(&mesh, &Affine3A::IDENTITY);
        tree.flush();
        tree.test(&world.target()) == Occlusion::Hidden
    });
}

#[test]
fn nor_that_the_cullers_hide() {
    run(2, 150, |world| {
        let (Some((mut scene, target)), Some(view)) = (world.scene(), world.view()) else { return false };
        let preparation = Preparation::default().with_sliver(0.0);
        scene.prepare_occluders(&preparation.with_two_sided(world.is_two_sided()));
        cullers(&scene).iter_mut().any(|culler| {
            let mut visible = VisibleSet::new();
            visible.fill(&scene, &view);
            culler.cull(&scene, &view, &mut visible);
            !visible.contains(&scene, target)
        })
    });
}
