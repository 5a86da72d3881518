//! Tests of hierarchical occlusion maps on every scene: with a threshold of 1, no object that an item buffer
//! of 2560 x 1440 sees is hidden, at any depth estimate and resolution. Lower thresholds hide only more.

use crate::all_occluders::all_occluders;
use crate::shared_scenes::scene;
use visibility_core::{FrustumCuller, OcclusionMap, Pipeline, VisibleSet};
use visibility_examples::walkthrough::{Trial, World, judge};
use visibility_examples::{SceneSource, built_in};
use visibility_hzb::{DepthEstimate, Hom, Hzb};

/// Width and height in pixels of the item buffer that judges the maps.
const JUDGE: (u32, u32) = (2560, 1440);

/// Culls all frames of a world with a map, with all opaque triangles as occluders. The trial has no times.
fn trial(name: &str, world: &World, map: impl OcclusionMap + Send + Sync + 'static) -> Trial {
    let mut pipeline = Pipeline::new().with(FrustumCuller::new()).with(all_occluders(&world.scene, map));
    let mut visible = VisibleSet::new();
    let reported = world.views.iter().map(|view| {
        pipeline.cull(&world.scene, view, &mut visible);
        let mut ids: Vec<u32> = visible.iter(&world.scene).map(|id| id.index() as u32).collect();
        ids.sort_unstable();
        ids
    });
    let reported = reported.collect();
    Trial {
        name: name.to_owned(),
        accuracy: pipeline.accuracy(),
        reported,
        micros: Vec::new(),
        frame_micros: Vec::new(),
    }
}

/// Culls a scene in `frames` frames with maps of several sizes and depth estimates. Fails if a visible object
/// is hidden at a threshold of 1, or if a lower threshold shows an object that a higher one hides.
fn check(source: SceneSource, frames: usize) {
    let world = World::new(source, JUDGE, Some(frames)).unwrap();
    let hom = |size: [usize; 2], estimate| Hom::new(size[0], size[1]).unwrap().with_depth_estimate(estimate);
    let (small, large) = ([320, 180], [640, 360]);
    let conservative = [
        trial("320x180", &world, hom(small, DepthEstimate::NoBackground)),
        trial("640x360", &world, hom(large, DepthEstimate::NoBackground)),
        trial("320x180, buffer", &world, hom(small, DepthEstimate::Buffer)),
        trial("640x360, buffer", &world, hom(large, DepthEstimate::Buffer)),
        trial("320x180, plane", &world, hom(small, DepthEstimate::Plane)),
        trial("640x360, plane", &world, hom(large, DepthEstimate::Plane)),
    ];
    let judgement = judge(&world, &conservative, || ()).unwrap();
    print!("{}: exact {:.1}", world.source.name, judgement.mean_exact());
    for (trial, verdict) in conservative.iter().zip(&judgement.verdicts) {
        print!(", {} {:.1}", trial.name, trial.mean_visible());
        assert_eq!(verdict.false_hidden, 0, "{}, {}: {:?}", world.source.name, trial.name, verdict.hidden);
    }
    println!();

    // A z-buffer of equal size hides at least the objects that the maps hide, since the maps contain no more
    // information than the z-buffer.
    let z_buffer = trial("hzb", &world, Hzb::new(large[0], large[1]).unwrap());
    let mut before = &conservative[1].reported;
    for (frame, left) in before.iter().enumerate() {
        let lost = z_buffer.reported[frame].iter().find(|object| left.binary_search(object).is_err());
        assert_eq!(lost, None, "{}, frame {frame}", world.source.name);
    }
    let dialled: Vec<_> = [0.95, 0.8, 0.5]
        .into_iter()
        .map(|dial| {
            let map = hom(large, DepthEstimate::NoBackground).with_threshold(dial);
            trial("dialled", &world, map)
        })
        .collect();
    for trial in &dialled {
        for (frame, left) in trial.reported.iter().enumerate() {
            let new = left.iter().find(|object| before[frame].binary_search(object).is_err());
            assert_eq!(new, None, "{}, frame {frame}", world.source.name);
        }
        before = &trial.reported;
    }
}

#[test]
fn nothing_visible_is_hidden_in_built_in_scenes() {
    for name in ["plpcity", "london", "town", "forest", "office"] {
        check(built_in(name).unwrap(), 6);
    }
}

#[test]
#[cfg_attr(not(reference_scenes), ignore = "the reference scenes are not beside the checkout")]
fn nothing_visible_is_hidden_in_reference_scenes() {
    for name in ["clinic", "denhaag", "alpine1", "oa_dm2"] {
        check(scene(name), 6);
    }
    check(scene("cars5"), 4);
    check(scene("clinic and its pipes"), 2);
}
