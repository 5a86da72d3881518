//! Objects that a segment sees through slots between screens do not count as hidden, with a clearance of 0.

use std::sync::Arc;
use visibility_core::{Accuracy, OccluderMesh, RegionCuller, VisibleSet};
use visibility_exact::{Effort, ExactCuller, ExactSettings, SceneTriangles};
use visibility_testing::{SlotScene, judged, told_enough};

/// Returns three numbers: targets that a segment sees, targets behind closed screens, and hidden ones among
/// the latter.
fn search(numbers: std::ops::Range<usize>) -> [usize; 3] {
    let (mut seen, mut closed, mut hidden) = (0, 0, 0);
    for number in numbers {
        let mut world = SlotScene::numbered(2, number);
        let corners = world.scene.bounds(world.target).unwrap().corners();
        let sides = OccluderMesh::CUBOID.map(|t| t.map(|i| corners[i as usize]));
        world.scene.set_triangles(world.target, sides.to_vec()).unwrap();
        let triangles = Arc::new(SceneTriangles::new(&world.scene));
        assert!(triangles.occluder_count() > 0, "{number}");
        // Few rays, so that proofs have to decide.
        let settings = ExactSettings::new(Effort::Exact(0.0)).with_rays(20).with_aimed_rays(2);
        let mut culler = ExactCuller::new(triangles, settings);
        assert_eq!(culler.accuracy(), Accuracy::Conservative, "without clearance the culler is conservative");
        let mut visible = VisibleSet::new();
        culler.cull(&world.scene, &world.cell, &mut visible);
        let is_hidden = !visible.contains(&world.scene, world.target);
        assert!(!(world.is_seen && is_hidden), "the target of scene {number} is seen and hidden");
        let is_closed = world.slots[0] < 0.0;
        seen += usize::from(world.is_seen);
        closed += usize::from(is_closed);
        hidden += usize::from(is_closed && is_hidden);
    }
    [seen, closed, hidden]
}

#[test]
fn targets_that_are_seen_through_slots_are_not_proven_hidden() {
    let [seen, closed, hidden] = search(0..200);
    judged(200);
    told_enough(
        seen > 120 && hidden > closed / 2,
        format_args!("{seen} seen, {hidden} of {closed} closed ones hidden"),
    );
}
