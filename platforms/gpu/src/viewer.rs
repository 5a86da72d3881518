//! Scene with everything needed to draw it, shared by the program, the window and the tests.

use crate::{Gpu, Meshes, Painter, Target, World};
use std::error::Error;
use visibility_core::{ObjectId, Scene, View, VisibleSet};

/// A built-in scene on a device, with a target to draw into.
#[derive(Debug)]
pub struct Viewer {
    /// Device of the graphics card.
    pub gpu: Gpu,
    /// Scene with its walks.
    pub world: World,
    /// Meshes of the scene on the card.
    pub meshes: Meshes,
    /// Painter that draws into the target.
    pub painter: Painter,
    /// Target with the picture.
    pub target: Target,
    all: Vec<ObjectId>,
}

impl Viewer {
    /// Creates the scene that a recipe names, and a target of `width` by `height` pixels.
    ///
    /// # Errors
    /// An error for an unknown recipe or invalid sizes.
    pub fn new(gpu: Gpu, recipe: &str, [width, height]: [u32; 2]) -> Result<Self, Box<dyn Error>> {
        let world = World::built_in(recipe)?;
        let meshes = Meshes::new(&gpu, &world.scene);
        let painter = Painter::new(&gpu, &meshes);
        let target = Target::new(&gpu, width, height);
        let all = world.scene.ids().collect();
        Ok(Self { gpu, world, meshes, painter, target, all })
    }

    /// Returns `count` views along the scene's walks, with the aspect ratio of the target.
    ///
    /// # Errors
    /// None is expected: the recipes' walks are valid.
    pub fn views(&self, count: usize) -> Result<Vec<View>, Box<dyn Error>> {
        let [width, height] = self.target.size.map(f64::from);
        self.world.views(count, width / height)
    }

    /// Sets the camera for everything drawn after this call.
    pub fn look(&self, view: &View) {
        self.painter.look(&self.gpu, &self.target, self.world.clip_from_scene(view));
    }

    /// Sets the camera, and draws objects.
    pub fn draw(&mut self, view: &View, objects: &[ObjectId]) {
        self.look(view);
        self.painter.draw(&self.gpu, &self.target, &self.meshes, objects);
    }

    /// Sets the camera, and draws all objects of the scene, in view or not.
    pub fn draw_all(&mut self, view: &View) {
        self.look(view);
        self.painter.draw(&self.gpu, &self.target, &self.meshes, &self.all);
    }

    /// Returns the number of objects among `shown`, given by index, that are not in a visible set.
    pub fn missing(scene: &Scene, shown: &[usize], visible: &VisibleSet) -> usize {
        let reported = |&index: &usize| scene.id_at(index).is_some_and(|id| visible.contains(scene, id));
        shown.iter().filter(|index| !reported(index)).count()
    }
}
