//! Reference scenes for tests. They are large and not part of the repository. A test that needs them carries
//! `#[cfg_attr(not(reference_scenes), ignore = "...")]`; the build script sets this cfg if the scenes are
//! found.
#![allow(dead_code)] // No test uses all functions.

use std::path::{Path, PathBuf};
use visibility_examples::walkthrough::{Trial, World, cullers, judge, run};
use visibility_examples::{SceneSource, cars5, load};

/// Returns the path of a file among the reference scenes. Panics if the file is missing.
pub(crate) fn stored(name: &str) -> PathBuf {
    let path = Path::new(env!("REFERENCE_SCENES")).join(name);
    assert!(path.is_file(), "{} is missing", path.display());
    path
}

/// Loads a reference scene by the stem of its file. `cars5` is five cars in a row, and `clinic and its pipes`
/// a clinic with its thousands of pipes and lamps, most of them above the ceilings. Panics if a file is
/// missing or invalid.
pub(crate) fn scene(name: &str) -> SceneSource {
    match name {
        "cars5" => cars5(&stored("car.vscn")).unwrap(),
        "clinic and its pipes" => {
            let mut clinic = scene("clinic");
            clinic.objects.extend(scene("clinic_mep").objects);
            clinic
        }
        _ => load(&stored(&format!("{name}.vscn"))).unwrap(),
    }
}

/// Prints how many objects each trial reports beside the number that the world's item buffer sees, which is
/// returned as a mean over the frames. Panics if a trial hides an object that the item buffer sees.
pub(crate) fn assert_none_hidden(world: &World, trials: &[Trial]) -> f64 {
    let judgement = judge(world, trials, || ()).unwrap();
    print!("{}: exact {:.1}", world.source.name, judgement.mean_exact());
    for (trial, verdict) in trials.iter().zip(&judgement.verdicts) {
        print!(", {} {:.1}", trial.name, trial.mean_visible());
        assert_eq!(verdict.false_hidden, 0, "{}, {}: {:?}", world.source.name, trial.name, verdict.hidden);
    }
    println!();
    judgement.mean_exact()
}

/// Culls a scene in `frames` frames by cullers as on the command line of `walkthrough`, and panics if one of
/// them hides an object that an item buffer of 2560 x 1440 sees.
pub(crate) fn assert_none_hidden_by(entries: &str, source: SceneSource, frames: usize) {
    let world = World::new(source, (2560, 1440), Some(frames)).unwrap();
    let entries = cullers::parse(entries, &world).unwrap().into_iter();
    let trials: Vec<_> = entries.map(|(name, pipeline)| run(name, pipeline, &world)).collect();
    assert_none_hidden(&world, &trials);
}
