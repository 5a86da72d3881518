//! Tests of the exact answer and the frustum culler on the reference scenes. They run if the scenes are found
//! beside the checkout.

use crate::shared_scenes::{scene, stored};
use visibility_examples::description::Description;
use visibility_examples::walkthrough::{World, cullers, judge, run};
use visibility_examples::{SceneSource, built_in};

/// Loads the description of a reference scene by the stem of its file.
fn description(name: &str) -> Description {
    Description::load(&stored(&format!("{name}.json"))).unwrap()
}

/// Runs each reference walk of a scene at 640x360, and compares the mean numbers of visible objects and of
/// objects in the frustum with the stored counts.
fn check(mut source: SceneSource, description: &Description) {
    source.walks = description.walks.clone();
    source.near = description.near.unwrap_or(source.near);
    // The stored counts were made with opaque glass.
    source.objects.iter_mut().for_each(|object| object.see_through = false);
    let walks = source.walks.clone();
    for (walk, reference) in walks.into_iter().zip(&description.reference) {
        assert_eq!(walk.name, reference.walk, "the walk of the reference");
        source.walks = vec![walk];
        let world = World::new(source.clone(), (640, 360), None).unwrap();
        let (name, pipeline) = cullers::parse("frustum", &world).unwrap().remove(0);
        let trials = [run(name, pipeline, &world)];
        let judgement = judge(&world, &trials, || ()).unwrap();

        let frames = reference.objects_visible.len() as f64;
        let expected = reference.objects_visible.iter().sum::<u64>() as f64 / frames;
        let in_frustum = reference.objects_in_frustum.iter().sum::<u64>() as f64 / frames;
        let (name, walk) = (&source.name, &reference.walk);
        println!(
            "{name}, {walk}: visible {:.2}, reference {expected:.2}; reported {:.2}, in frustum {in_frustum:.2}",
            judgement.mean_exact(),
            trials[0].mean_visible(),
        );
        assert_eq!(world.views.len() as f64, frames, "{name}, {walk}: every key is a frame");
        assert!((judgement.mean_exact() / expected - 1.0).abs() <= 0.02, "{name}, {walk}");
        assert_eq!(judgement.verdicts[0].false_hidden, 0, "{name}, {walk}");
        // The stored counts are of triangles in the frustum, with keys not yet rounded to millimetres.
        assert!(trials[0].mean_visible() >= 0.99 * in_frustum, "{name}, {walk}: less than the frustum holds");
    }
    assert!(!description.reference.is_empty(), "{}: there is something to compare with", source.name);
}

#[test]
#[cfg_attr(not(reference_scenes), ignore = "the reference scenes are not beside the checkout")]
fn files_agree_with_their_reference_counts() {
    for name in ["clinic", "denhaag", "alpine1", "oa_dm2"] {
        check(scene(name), &description(name));
    }
}

#[test]
#[cfg_attr(not(reference_scenes), ignore = "the reference scenes are not beside the checkout")]
fn five_cars_agree_with_their_reference_counts() {
    check(scene("cars5"), &description("car"));
}

#[test]
#[cfg_attr(not(reference_scenes), ignore = "the reference scenes are not beside the checkout")]
fn recipes_agree_with_their_reference_counts() {
    for (recipe, file) in [
        ("plpcity", "gen_plpcity"),
        ("london", "gen_london"),
        ("town", "gen_town16"),
        ("forest", "gen_forest"),
        ("office", "gen_office"),
    ] {
        check(built_in(recipe).unwrap(), &description(file));
    }
}
