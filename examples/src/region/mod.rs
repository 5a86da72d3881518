//! Visibility from viewcells: every method on the same cells of a scene, timed and judged. Used by the
//! program `region`.
//!
//! [`cells`] makes viewcells, [`methods`] names the methods, [`judge`] samples what can be seen, [`trial`]
//! runs a method, [`output`] prints the results, [`picture`], [`planes`] and [`plot`] draw them.

pub mod cells;
pub mod judge;
pub mod methods;
pub mod output;
pub mod picture;
pub mod planes;
pub mod plot;
pub mod trial;

use crate::SceneSource;
use crate::walkthrough::World;
use glam::DVec3;

/// Makes the world of a source for visibility from viewcells. Doors do not occlude, unlike in walks.
pub fn world(source: SceneSource) -> World {
    let doors: Vec<usize> = (0..source.objects.len()).filter(|&i| source.objects[i].door).collect();
    let mut world = World::with_views(source, DVec3::ZERO, Vec::new(), Vec::new(), (1, 1));
    for door in doors {
        if let Some(id) = world.scene.id_at(door) {
            world.scene.set_occluder(id, false).expect("an object of the scene");
        }
    }
    world
}
