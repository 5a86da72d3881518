//! The exact answer and the frustum culler on the reference scenes, which lie beside the checkout where they are present.

use std::path::{Path, PathBuf};
use visibility_examples::description::Description;
use visibility_examples::walkthrough::{World, cullers, judge, run};
use visibility_examples::{SceneSource, built_in, cars5, load};

fn folder() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/scenes");
    if folder.is_dir() {
        return Some(folder);
    }
    println!("skipped: the reference scenes are not at {}", folder.display());
    None
}

/// Walks each of a scene's reference walks at 640x360 and compares the means with the stored counts.
fn check(mut source: SceneSource, description: &Description) {
    source.walks = description.walks.clone();
    source.near = description.near.unwrap_or(source.near);
    let walks = source.walks.clone();
    for (walk, reference) in walks.into_iter().zip(&description.reference) {
        assert_eq!(walk.name, reference.walk);
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
        // The reference counts triangles in view, from keys that were not yet rounded to millimetres.
        assert!(trials[0].mean_visible() >= 0.99 * in_frustum, "{name}, {walk}: less than the frustum holds");
    }
    assert!(!description.reference.is_empty(), "{}: there is something to compare with", source.name);
}

#[test]
fn files_agree_with_their_reference_counts() {
    let Some(folder) = folder() else { return };
    for name in ["clinic", "denhaag", "alpine1", "oa_dm2"] {
        let description = Description::load(&folder.join(format!("{name}.json"))).unwrap();
        check(load(&folder.join(format!("{name}.vscn"))).unwrap(), &description);
    }
}

#[test]
fn five_cars_agree_with_their_reference_counts() {
    let Some(folder) = folder() else { return };
    let description = Description::load(&folder.join("car.json")).unwrap();
    check(cars5(&folder.join("car.vscn")).unwrap(), &description);
}

#[test]
fn recipes_agree_with_their_reference_counts() {
    let Some(folder) = folder() else { return };
    for (recipe, file) in [
        ("plpcity", "gen_plpcity"),
        ("london", "gen_london"),
        ("town", "gen_town16"),
        ("forest", "gen_forest"),
        ("office", "gen_office"),
    ] {
        let description = Description::load(&folder.join(format!("{file}.json"))).unwrap();
        check(built_in(recipe).unwrap(), &description);
    }
}
