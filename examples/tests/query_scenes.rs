//! Tests of hardware queries on whole scenes under a moving camera, over a simulated card. An item buffer
//! that shares no code with the card judges.

use crate::shared_scenes::scene;
use visibility_core::occlusion::LateAnswers;
use visibility_examples::queries::{Mode, Totals, run, successive_views};
use visibility_examples::walkthrough::World;
use visibility_examples::{SceneSource, built_in};
use visibility_measure::ItemBuffer;

/// Returns the sums of eight frames of each walk, by no, one and two looks ahead, and by trusted answers that
/// arrive a frame late.
fn totals(source: SceneSource, step: f64) -> [Totals; 4] {
    let size = (160, 90);
    let walks = successive_views(&source, 8, step, size).unwrap();
    let world = World::with_views(source, walks.concat(), Vec::new(), size);
    let mut buffer = ItemBuffer::new(size.0, size.1).unwrap();
    let judged: Vec<_> = world
        .views
        .iter()
        .map(|view| buffer.draw(view, world.origin(), world.items()).unwrap().clone())
        .collect();
    let mode = |late, looks_ahead| Mode { late, looks_ahead, max_samples: 0, latency: 1 };
    let trusted = LateAnswers::Trusted { frames: 4 };
    let visible = LateAnswers::Visible;
    [mode(visible, 0), mode(visible, 1), mode(visible, 2), mode(trusted, 0)]
        .map(|mode| run(&world, &walks, &judged, mode))
}

/// Panics if a conservative mode misses an object, or if too many objects are left. Without a look ahead, the
/// first half of the frames does not suffice until each group with a visible box is down to this box.
fn check(name: &str, [none, one, two, trusted]: [Totals; 4]) {
    for (looks, totals) in [none, one, two].into_iter().enumerate() {
        assert_eq!((totals.missing, totals.wrong_pixels), (0, 0), "{name}: missing, {looks} looks ahead");
    }
    assert_eq!(none.drawn, none.in_frustum, "{name}: nothing is hidden by answers for other views");
    for (what, totals, most) in [("one look ahead", one, 0.3), ("two", two, 0.3), ("trusted", trusted, 0.5)] {
        let share = totals.drawn as f64 / totals.in_frustum as f64;
        assert!(totals.seen > 0 && share < most, "{name}, {what}: {share} of the objects in view are drawn");
        assert!(2 * totals.queries < totals.boxes, "{name}, {what}: boxes share queries: {totals:?}");
    }
}

#[test]
fn looks_ahead_cull_built_in_scenes_and_miss_nothing() {
    for recipe in ["town:2", "office:2,4"] {
        check(recipe, totals(built_in(recipe).unwrap(), 0.2));
    }
}

#[test]
#[cfg_attr(not(reference_scenes), ignore = "the reference scenes are not beside the checkout")]
fn looks_ahead_cull_stored_scenes_and_miss_nothing() {
    for name in ["oa_dm2", "denhaag"] {
        check(name, totals(scene(name), 0.1));
    }
}
