//! Tests of the hierarchical z-buffer on every scene: no object that an item buffer of 2560 x 1440 sees is
//! hidden, at any resolution of the z-buffer.

use crate::all_occluders::all_occluders;
use crate::shared_scenes::{assert_none_hidden, scene};
use visibility_core::{FrustumCuller, Pipeline, VisibleSet, occlusion::Preparation};
use visibility_examples::walkthrough::{Trial, World, run};
use visibility_examples::{SceneSource, built_in};
use visibility_hzb::{Hzb, HzbCuller};

/// Width and height in pixels of the item buffer that judges the z-buffer.
const JUDGE: (u32, u32) = (2560, 1440);

/// Culls all frames of a world with a z-buffer of the given size, with all opaque triangles as occluders.
fn trial(name: &str, world: &World, size: [usize; 2]) -> Trial {
    let culler = all_occluders(&world.scene, Hzb::new(size[0], size[1]).unwrap());
    run(name.to_owned(), Pipeline::new().with(FrustumCuller::new()).with(culler), world)
}

/// Culls all frames of a world with a z-buffer of the given size and with the occluders that the culler
/// chooses at the given price.
fn chosen(name: &str, world: &World, size: [usize; 2], price: u32) -> Trial {
    let culler = HzbCuller::new(Hzb::new(size[0], size[1]).unwrap()).with_price(price);
    run(name.to_owned(), Pipeline::new().with(FrustumCuller::new()).with(culler), world)
}

/// Culls a scene in `frames` frames with z-buffers of several sizes, and fails if a visible object is hidden.
fn check(source: SceneSource, frames: usize) {
    let mut world = World::new(source, JUDGE, Some(frames)).unwrap();
    let preparation = Preparation::default().with_two_sided(true);
    world.scene.prepare_occluders(&preparation);
    let trials = [
        run("frustum".to_owned(), Pipeline::new().with(FrustumCuller::new()), &world),
        trial("320x180", &world, [320, 180]),
        trial("640x360", &world, [640, 360]),
        chosen("640x360 chosen", &world, [640, 360], 24),
        chosen("640x360 chosen, high price", &world, [640, 360], u32::MAX),
        trial("1920x1080", &world, [1920, 1080]),
    ];
    assert_none_hidden(&world, &trials);
}

/// A culler that skips frames in which culling does not pay must notice a changed view: along a walk it
/// reports little more than a culler that is reset in each frame.
#[test]
fn a_walk_hides_nearly_what_its_frames_hide_alone() {
    let world = World::new(built_in("plpcity").unwrap(), (640, 360), Some(240)).unwrap();
    let hzb = HzbCuller::new(Hzb::new(512, 288).unwrap());
    let mut pipeline = Pipeline::new().with(FrustumCuller::new()).with(hzb);
    let mut set = VisibleSet::new();
    let mut reported = |remembers: bool| -> usize {
        let frames = world.views.iter().map(|view| {
            if !remembers {
                pipeline.reset();
            }
            pipeline.cull(&world.scene, view, &mut set);
            set.count(&world.scene)
        });
        frames.sum()
    };
    let (alone, along) = (reported(false), reported(true));
    assert!(100 * along <= 105 * alone, "{along} objects in all frames of the walk, alone {alone}");
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
