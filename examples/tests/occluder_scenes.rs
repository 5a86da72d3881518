//! Tests of the large-occluder cullers on every scene: no object that an item buffer of 2560 x 1440 sees is
//! hidden, and enough of the other objects are.

use crate::shared_scenes::{assert_none_hidden, scene};
use std::sync::Arc;
use visibility_bsp::{
    LargeOccludersCuller, Occluders, OcclusionTree, OcclusionTreeCuller, ShadowFrusta, ShadowFrustaCuller,
};
use visibility_core::{Culler, FrustumCuller, OcclusionCuller, Pipeline};
use visibility_examples::walkthrough::{Trial, World, run};
use visibility_examples::{SceneSource, built_in};

/// Width and height in pixels of the item buffer that judges the cullers.
const JUDGE: (u32, u32) = (2560, 1440);

/// Culls all frames of a world with the frustum culler followed by `culler`.
fn trial(name: &str, world: &World, culler: impl Culler + Send + Sync + 'static) -> Trial {
    run(name.to_owned(), Pipeline::new().with(FrustumCuller::new()).with(culler), world)
}

/// Runs all large-occluder cullers in `frames` frames and fails on a false hidden object. Returns the
/// fraction of the occluded objects in the frustum that the occlusion tree with 64 polygons culls.
fn check(source: SceneSource, frames: usize) -> f64 {
    let world = World::new(source, JUDGE, Some(frames)).unwrap();
    let occluders = Arc::new(Occluders::new(&world.scene));
    let frusta = ShadowFrusta::new(&world.scene, Occluders::clone(&occluders), 64, 32);
    let trials = [
        run("frustum".to_owned(), Pipeline::new().with(FrustumCuller::new()), &world),
        trial("tree", &world, OcclusionTreeCuller::new(occluders.clone())),
        // More polygons give more chances of an error.
        trial("tree of 1000", &world, OcclusionTreeCuller::new(occluders.clone()).with_polygons(1000)),
        trial("tree of meshes", &world, OcclusionCuller::new(OcclusionTree::new().with_polygons(300))),
        trial("frusta", &world, ShadowFrustaCuller::new(frusta.into())),
        trial("large", &world, LargeOccludersCuller::new(occluders).with_polygons(128)),
    ];
    let exact = assert_none_hidden(&world, &trials);
    let frustum = trials[0].mean_visible();
    (frustum - trials[1].mean_visible()) / (frustum - exact)
}

#[test]
fn nothing_visible_is_hidden_in_built_in_scenes() {
    for (name, least) in [("plpcity", 0.8), ("london", 0.8), ("town", 0.7), ("forest", 0.0), ("office", 0.85)]
    {
        let share = check(built_in(name).unwrap(), 3);
        println!("{name}: {share:.3} of what can be culled");
        assert!(share >= least, "{name}: {share}");
    }
}

/// Runs [`check`] on reference scenes, given by name, with `frames` frames each.
fn check_stored(names: &[&str], frames: usize) {
    for name in names {
        println!("{name}: {:.3} of what can be culled", check(scene(name), frames));
    }
}

#[test]
#[cfg_attr(not(reference_scenes), ignore = "the reference scenes are not beside the checkout")]
fn nothing_visible_is_hidden_in_reference_scenes() {
    check_stored(&["clinic", "denhaag", "alpine1", "oa_dm2", "cars5"], 3);
}

#[test]
#[ignore = "many frames of all scenes: minutes, in the release profile"]
fn nothing_visible_is_hidden_along_the_walks() {
    for name in ["plpcity", "london", "town", "office", "office:7,24", "forest"] {
        println!("{name}: {:.3} of what can be culled", check(built_in(name).unwrap(), 36));
    }
    check_stored(&["clinic", "clinic and its pipes", "denhaag", "alpine1", "oa_dm2", "cars5"], 36);
}
