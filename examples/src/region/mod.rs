//! Visibility from viewcells: every method on the same cells of a scene, timed and judged. Used by the
//! program `region`.
//!
//! [`cells`] makes viewcells, [`methods`] names the methods, [`judge`] samples what can be seen, [`trial`]
//! runs a method, [`output`] prints the results, [`picture`], [`planes`] and [`plot`] draw them.
//! [`online_plot`] draws the walks of the program `online`.

pub mod cells;
pub mod judge;
pub mod methods;
pub mod online_plot;
pub mod output;
pub mod picture;
pub mod planes;
pub mod plot;
mod timing;
pub mod trial;

use crate::walkthrough::World;
use crate::{SceneSource, ordinary_file};
use std::fmt::Display;
use std::path::Path;
use visibility_bake::{BakedSet, level_version};
use visibility_core::Scene;
use visibility_core::pvs::ScenePvs;

/// Makes the world of a source for visibility from viewcells. Here doors do not occlude, while they do in
/// walks.
pub fn world(source: SceneSource) -> World {
    let mut world = World::with_views(source, Vec::new(), Vec::new(), (1, 1));
    open_doors(&world.source, &mut world.scene);
    world
}

/// Marks the doors of a source as not occluding in its scene.
pub(crate) fn open_doors(source: &SceneSource, scene: &mut Scene) {
    for (index, _) in source.objects.iter().enumerate().filter(|(_, object)| object.door) {
        if let Some(id) = scene.id_at(index) {
            scene.set_occluder(id, false).expect("an object of the scene");
        }
    }
}

/// Reads the file of a [`BakedSet`] that the program `bake` or `region` has written for the scene of a world.
/// The file still fits if doors have been closed since.
///
/// # Errors
///
/// Returns a message with the path if the file cannot be read, or was made for a scene with other triangles,
/// occluders or hints.
pub fn read_sets(path: &Path, world: &World) -> Result<ScenePvs, String> {
    let named = |error: &dyn Display| format!("{}: {error}", path.display());
    let bytes = ordinary_file::read(path).map_err(|error| named(&error))?;
    let set = BakedSet::from_bytes(&bytes).map_err(|error| named(&error))?;
    let version = if world.source.objects.iter().any(|object| object.door) {
        let mut as_baked = world.scene.clone();
        open_doors(&world.source, &mut as_baked);
        level_version(&as_baked)
    } else {
        level_version(&world.scene)
    };
    set.for_level(&world.scene, Some(version)).map_err(|error| named(&error))
}
