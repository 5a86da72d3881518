//! Tests of the horizon on every scene: no object that an item buffer of 2560 x 1440 sees is hidden, with any
//! number of columns.
#![allow(missing_docs)]

mod shared_scenes;

use shared_scenes::{assert_none_hidden, scene};
use visibility_examples::walkthrough::{World, cullers, run};
use visibility_examples::{SceneSource, built_in};

/// Width and height in pixels of the item buffer that judges the horizon.
const JUDGE: (u32, u32) = (2560, 1440);

/// Culls a scene in `frames` frames, and fails if a visible object is hidden.
fn check(source: SceneSource, frames: usize) {
    let world = World::new(source, JUDGE, Some(frames)).unwrap();
    let entries = "frustum,horizon:32,horizon,horizon:4096,horizon-map,horizon-map:1024,horizon+hzb,hzb";
    let trials: Vec<_> = cullers::parse(entries, &world)
        .unwrap()
        .into_iter()
        .map(|(name, pipeline)| run(name, pipeline, &world))
        .collect();
    assert_none_hidden(&world, &trials);
}

#[test]
fn nothing_visible_is_hidden_in_built_in_scenes() {
    for name in ["plpcity", "london", "town", "forest", "office"] {
        check(built_in(name).unwrap(), 9);
    }
}

#[test]
#[cfg_attr(not(reference_scenes), ignore = "the reference scenes are not beside the checkout")]
fn nothing_visible_is_hidden_in_reference_scenes() {
    for name in ["denhaag", "alpine1", "oa_dm2"] {
        check(scene(name), 9);
    }
    for name in ["clinic and its pipes", "cars5"] {
        check(scene(name), 6);
    }
}
