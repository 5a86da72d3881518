//! Built-in scene, filled as an engine would fill it, with the views along its walks.

use crate::recipes::built_in;
use crate::source::SceneSource;
use crate::walk::frames;
use glam::Mat4;
use std::error::Error;
use visibility_core::occlusion::Preparation;
use visibility_core::{Aabb, Object, Pose, Scene, View};

/// Built-in scene with its walks.
#[derive(Debug)]
pub struct World {
    /// Scene of the objects. The object with index `i` is the `i`-th of the recipe, and each object has its
    /// triangles.
    pub scene: Scene,
    source: SceneSource,
}

impl World {
    /// Makes the scene that a recipe such as `london:12,12` names.
    ///
    /// # Errors
    /// An error for an unknown recipe or invalid sizes.
    pub fn built_in(recipe: &str) -> Result<Self, Box<dyn Error>> {
        let source = built_in(recipe)?;
        let mut scene = Scene::new();
        let ids = scene.insert_batch(source.objects.iter().map(|object| Object {
            cost: object.triangles.len() as u32,
            occluder: object.opaque,
            ..Object::new(Aabb::from_points(object.triangles.iter().flatten()))
        }));
        for (id, object) in ids.into_iter().zip(&source.objects) {
            scene.set_triangles(id, object.triangles.clone())?;
        }
        scene.prepare_occluders(&Preparation::default());
        Ok(Self { scene, source })
    }

    /// Returns `count` views along the scene's walks. `aspect` is the picture's width divided by its height.
    ///
    /// # Errors
    /// An error unless `aspect` is a positive number.
    pub fn views(&self, count: usize, aspect: f64) -> Result<Vec<View>, Box<dyn Error>> {
        let mut views = Vec::new();
        for frame in frames(&self.source.walks, count) {
            let walk = &self.source.walks[frame.walk];
            let pose = Pose::look_at(frame.camera.eye, frame.camera.target, walk.up.as_dvec3());
            let fov_y = f64::from(walk.fov_y_degrees).to_radians();
            views.push(View::perspective(pose, fov_y, aspect, f64::from(self.source.near), f64::INFINITY)?);
        }
        Ok(views)
    }

    /// Returns whether the scene has rooms, whose ceilings would hide everything from above.
    pub(crate) fn has_ceilings(&self) -> bool {
        self.source.cells.is_some()
    }

    /// Returns the matrix from scene coordinates to clip space, for the card.
    pub fn clip_from_scene(&self, view: &View) -> Mat4 {
        view.clip_from(self.scene.origin()).as_mat4()
    }
}
