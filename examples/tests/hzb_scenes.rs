//! Tests of the hierarchical z-buffer on every scene: no object that an item buffer of 2560 x 1440 sees is
//! hidden, at any resolution of the z-buffer.
#![allow(missing_docs)]

mod shared_scenes;

use shared_scenes::scene;
use visibility_core::{
    FrustumCuller, OcclusionCuller, Pipeline,
    occlusion::{Preparation, Selection},
};
use visibility_examples::walkthrough::{Trial, World, judge, run};
use visibility_examples::{SceneSource, built_in};
use visibility_hzb::Hzb;

/// Width and height in pixels of the item buffer that judges the z-buffer.
const JUDGE: (u32, u32) = (2560, 1440);

/// Culls all frames of a world with a z-buffer of the given size, with all opaque triangles as occluders.
fn trial(name: &str, world: &World, size: [usize; 2], selection: Selection) -> Trial {
    let map = Hzb::new(size[0], size[1]).unwrap();
    // The budget admits every opaque triangle: more occluders give more chances of an error.
    let culler = OcclusionCuller::new(map).with_selection(selection).with_budget(10_000_000);
    run(name.to_owned(), Pipeline::new().with(FrustumCuller::new()).with(culler), world)
}

/// Culls a scene in `frames` frames with z-buffers of several sizes, and fails if a visible object is hidden.
fn check(source: SceneSource, frames: usize) {
    let mut world = World::new(source, JUDGE, Some(frames)).unwrap();
    let preparation = Preparation { two_sided: true, ..Preparation::default() };
    world.scene.prepare_occluders(&preparation);
    let trials = [
        run("frustum".to_owned(), Pipeline::new().with(FrustumCuller::new()), &world),
        trial("320x180", &world, [320, 180], Selection::SolidAngle),
        trial("640x360", &world, [640, 360], Selection::SolidAngle),
        trial("640x360 interleaved", &world, [640, 360], Selection::Interleaved),
        trial("1920x1080", &world, [1920, 1080], Selection::SolidAngle),
    ];
    let judgement = judge(&world, &trials, || ()).unwrap();
    print!("{}: exact {:.1}", world.source.name, judgement.mean_exact());
    for (trial, verdict) in trials.iter().zip(&judgement.verdicts) {
        print!(", {} {:.1}", trial.name, trial.mean_visible());
        assert_eq!(verdict.false_hidden, 0, "{}, {}: {:?}", world.source.name, trial.name, verdict.hidden);
    }
    println!();
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
