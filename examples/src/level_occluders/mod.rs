//! The occluders of a world's level: making them, reading them from the file that the program `occluders`
//! writes, and pictures of them.

pub mod picture;

use crate::ordinary_file;
use crate::walkthrough::World;
use std::path::Path;
use visibility_core::{ObjectId, level_version};
use visibility_occluders::{LevelOccluders, LevelOccludersError, LevelSettings};

/// Makes the occluders of a world's level from all opaque objects that stand still. Doors do not stand still.
///
/// # Errors
///
/// Returns [`LevelOccludersError`] if there are too many triangles.
pub fn make(world: &World, settings: LevelSettings) -> Result<LevelOccluders, LevelOccludersError> {
    LevelOccluders::of_scene(&world.scene, |id| stands_still(world, id), settings)
}

/// Returns whether an object stands still: false for doors.
fn stands_still(world: &World, id: ObjectId) -> bool {
    !world.source.objects[id.index()].door
}

/// Reads the occluders of a world's level from a file.
///
/// # Errors
///
/// Returns a message with the path if the file cannot be read, is damaged, or was made from another version
/// of the level, with other triangles, hints or units, or of other objects.
pub fn read(path: &Path, world: &World) -> Result<LevelOccluders, String> {
    let named = |error: &dyn std::fmt::Display| format!("{}: {error}", path.display());
    let bytes = ordinary_file::read(path).map_err(|error| named(&error))?;
    let level = LevelOccluders::from_bytes(&bytes, Some(level_version(&world.scene)));
    let level = level.map_err(|error| named(&error))?;
    level.with_objects_of(&world.scene, |id| stands_still(world, id)).map_err(|error| named(&error))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::built_in;
    use crate::walkthrough::cullers::parse;

    #[test]
    fn a_file_is_read_for_its_own_level() {
        let world = |change: fn(&mut crate::SceneSource)| {
            let mut source = built_in("office:1,2").unwrap();
            change(&mut source);
            World::new(source, (64, 36), Some(1)).unwrap()
        };
        let same = world(|_| {});
        let level = make(&same, LevelSettings::default()).unwrap();
        let path = std::env::temp_dir().join(format!("level-{}.occ", std::process::id()));
        std::fs::write(&path, level.to_bytes()).unwrap();
        assert_eq!(read(&path, &same), Ok(level), "the level from its file");
        let list = format!("hzb-level:{}", path.display());
        assert_eq!(parse(&list, &same).unwrap().len(), 1, "one culler by the level's file");
        let other = world(|source| source.objects[0].opaque = !source.objects[0].opaque);
        let refused = parse(&list, &other).err().unwrap().to_string();
        assert!(refused.contains("make them again"), "{refused}");
        std::fs::remove_file(&path).unwrap();
        let missing = parse(&list, &same).err().unwrap().to_string();
        assert!(missing.contains(&path.display().to_string()), "{missing}");
    }
}
