//! Tests of the occlusion driver with a plain occlusion map on every scene: no visible object is hidden,
//! whatever hierarchy the driver walks.

use crate::shared_scenes::scene;
use visibility_core::{
    FrustumCuller, OcclusionCuller, Pipeline,
    walk::{BoxHierarchy, SceneHierarchy},
};
use visibility_examples::walkthrough::{Trial, World, judge, run};
use visibility_examples::{SceneSource, built_in};
use visibility_testing::{Octree, PlainMap};

/// Width and height of the occlusion map in pixels. It is coarse so that the plain map stays fast; the item
/// buffer is much finer.
const MAP: (usize, usize) = (96, 54);
/// Width and height in pixels of the item buffer that judges the driver.
const JUDGE: (u32, u32) = (640, 360);

/// Culls all frames of a world with the occlusion driver over a hierarchy.
fn trial<H: BoxHierarchy + Send + Sync + 'static>(
    name: &str,
    world: &World,
    price: u32,
    hierarchy: H,
) -> Trial {
    let culler = OcclusionCuller::over(PlainMap::new(MAP.0, MAP.1), hierarchy).with_price(price);
    let pipeline = Pipeline::new().with(FrustumCuller::new()).with(culler);
    run(name.to_owned(), pipeline, world)
}

/// Culls a scene in nine frames with several prices over two hierarchies. Fails if a visible object is
/// hidden.
fn check(source: SceneSource) {
    // There are only few frames, since each trial fills its map anew in each frame.
    let world = World::new(source, JUDGE, Some(9)).unwrap();
    let made = world.scene.ids().filter(|&id| world.scene.has_mesh(id)).count();
    let octree = || Octree::new(&world.scene, 7);
    let trials = [
        run("frustum".to_owned(), Pipeline::new().with(FrustumCuller::new()), &world),
        trial("price 24", &world, 24, SceneHierarchy),
        trial("price 24, octree", &world, 24, octree()),
        trial("price 2", &world, 2, SceneHierarchy),
        trial("price 2, octree", &world, 2, octree()),
    ];
    let judgement = judge(&world, &trials, || ()).unwrap();
    print!("{}: {made} occluders; exact {:.1}", world.source.name, judgement.mean_exact());
    for (trial, verdict) in trials.iter().zip(&judgement.verdicts) {
        print!(", {} {:.1}", trial.name, trial.mean_visible());
        assert_eq!(verdict.false_hidden, 0, "{}, {}", world.source.name, trial.name);
    }
    println!();
    let frustum = trials[0].mean_visible();
    assert!(
        trials[1..].iter().all(|trial| trial.mean_visible() <= frustum),
        "occlusion reports at most {frustum} objects, as the frustum does"
    );
}

#[test]
fn nothing_visible_is_hidden_in_built_in_scenes() {
    for name in ["plpcity", "london", "town", "forest", "office"] {
        check(built_in(name).unwrap());
    }
}

#[test]
#[cfg_attr(not(reference_scenes), ignore = "the reference scenes are not beside the checkout")]
fn nothing_visible_is_hidden_in_reference_scenes() {
    for name in ["clinic", "denhaag", "alpine1", "oa_dm2", "cars5", "clinic and its pipes"] {
        check(scene(name));
    }
}
