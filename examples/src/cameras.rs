//! Sources of a program's cameras: a file, the scene itself, or made-up walks; and a file to save them to.

use crate::made_up_walks::MadeUpWalks;
use crate::output_file::write;
use crate::{Reading, SceneSource, SourceError, SourceObject, description::Description, load_walks};
use clap::Args;
use serde_json::json;
use std::path::PathBuf;

/// Source of a program's cameras.
#[derive(Args, Clone, Debug, Default, PartialEq)]
pub struct Cameras {
    /// JSON description whose camera walks replace the scene's own. Without this option, a scene that has no
    /// cameras gets made-up walks: along floors where one can stand, indoors and outdoors, or else around the
    /// scene.
    #[arg(long, value_name = "FILE.json")]
    pub cameras: Option<PathBuf>,

    /// File to write the camera walks to, as JSON for --cameras. By default none.
    #[arg(long, value_name = "FILE.json")]
    pub save_cameras: Option<PathBuf>,
}

impl Cameras {
    /// Gives a scene its walks. The first available source counts: the JSON description, with its near plane
    /// and up axis, in the unit of the scene; the scene's own walks; walks made up for the objects that
    /// `visit` passes on, as for [`MadeUpWalks::new`]. Writes the walks to the file of `--save-cameras`, if
    /// given.
    ///
    /// # Errors
    ///
    /// Returns a message when a file cannot be read or written.
    pub fn give(
        &self,
        source: &mut SceneSource,
        reading: &Reading,
        visit: impl FnMut(&mut dyn FnMut(&SourceObject)),
    ) -> Result<(), String> {
        if let Some(cameras) = &self.cameras {
            self.read(source, reading, cameras).map_err(|error| error.to_string())?;
        } else if source.walks.is_empty() {
            let made = MadeUpWalks::new(source, visit);
            source.take_walks(made);
        }
        if let Some(path) = &self.save_cameras {
            write(path, &to_json(source, reading))?;
        }
        Ok(())
    }

    /// Gives walks to a scene whose objects are in memory.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`give`](Self::give).
    pub fn give_whole(&self, source: &mut SceneSource, reading: &Reading) -> Result<(), String> {
        let objects = std::mem::take(&mut source.objects);
        let given = self.give(source, reading, |each| objects.iter().for_each(each));
        source.objects = objects;
        given
    }

    /// Replaces walks, near plane and up axis of a scene by those of a JSON description.
    fn read(
        &self,
        source: &mut SceneSource,
        reading: &Reading,
        cameras: &std::path::Path,
    ) -> Result<(), SourceError> {
        let unit = reading.metres();
        source.drop_walks();
        source.walks = load_walks(cameras)?;
        source.walks.iter_mut().for_each(|walk| walk.map(|point| point * unit));
        let description = Description::load(cameras)?;
        source.near = description.near.map_or(source.near, |near| near * unit as f32);
        source.up = reading.up.or(description.up).unwrap_or(source.up);
        Ok(())
    }
}

/// Returns the walks, near plane and up axis of a scene as a JSON description, in the unit of the scene's
/// file.
fn to_json(source: &SceneSource, reading: &Reading) -> Vec<u8> {
    let unit = reading.metres();
    let point = |p: glam::DVec3| (p / unit).to_array();
    let walks: Vec<_> = source
        .walks
        .iter()
        .map(|walk| {
            let keys: Vec<_> = walk
                .keys
                .iter()
                .map(|key| json!({"eye": point(key.eye), "target": point(key.target)}))
                .collect();
            json!({"name": walk.name, "fov_y_deg": walk.fov_y_degrees, "up": walk.up.to_array(), "keys": keys})
        })
        .collect();
    let near = f64::from(source.near) / unit;
    json!({"name": source.name, "up_axis": source.up_axis(), "near": near, "cameras": walks})
        .to_string()
        .into_bytes()
}
