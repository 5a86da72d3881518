//! The tree of all triangles of a scene, kept up to date, for any number of views.

use crate::tree::{BspError, BspTree};
use alloc::vec::Vec;
use visibility_core::{
    ObjectId, Scene,
    scene::{Changes, SceneCursor},
};

/// A [`BspTree`] of the triangles of a [`Scene`], in scene coordinates; each fragment's owner is the index of
/// its object.
///
/// Built once and shared by the cullers of all views. When the scene has changed, [`sync`](Self::sync) brings
/// it up to date in time proportional to what changed; an object whose change it has not taken in is never
/// hidden, and hides nothing.
///
/// ```
/// use visibility_bsp::SceneTree;
/// use visibility_core::{glam::Vec3, Aabb, Scene};
/// let mut scene = Scene::new();
/// let id = scene.insert(Aabb::from_arrays([0.0; 3], [1.0; 3]));
/// scene.set_triangles(id, [[Vec3::ZERO, Vec3::X, Vec3::ONE]])?;
/// let mut tree = SceneTree::new(&scene)?;
/// assert_eq!(tree.tree().fragment_count(), 1);
/// scene.remove(id)?;
/// tree.sync(&scene)?;
/// assert!(tree.tree().is_empty());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct SceneTree {
    tree: BspTree,
    /// By object index: the object, if all of its triangles are in the tree.
    represented: Vec<Option<ObjectId>>,
    /// The scene and its revision that the tree is up to date with.
    cursor: SceneCursor,
}

impl SceneTree {
    /// Builds the tree of all triangles of a scene, as they are now.
    ///
    /// An object without triangles, or with one that is not finite or has no area, counts as visible always:
    /// nothing is known of it.
    ///
    /// # Errors
    /// [`BspError::TooManyFragments`].
    pub fn new(scene: &Scene) -> Result<Self, BspError> {
        let mut represented = alloc::vec![None; scene.index_limit()];
        for id in scene.ids() {
            represented[id.index()] = Some(id).filter(|&id| is_fully_represented(scene, id));
        }
        let tree =
            BspTree::build(scene.ids().flat_map(|id| corners(scene, id).map(move |t| (index(id), t))))?;
        Ok(Self { tree, represented, cursor: SceneCursor::at(scene) })
    }

    /// Brings the tree up to date with the scene: triangles of changed objects are removed and inserted
    /// again. Another scene than before is taken in as by [`new`](Self::new).
    ///
    /// # Errors
    /// [`BspError::TooManyFragments`]; what could not be taken in is never hidden.
    pub fn sync(&mut self, scene: &Scene) -> Result<(), BspError> {
        match self.cursor.peek(scene) {
            Changes::Everything => *self = Self::new(scene)?,
            Changes::Objects(ids) => {
                self.represented.resize(scene.index_limit(), None);
                self.cursor = SceneCursor::at(scene);
                for &id in ids {
                    self.tree.remove(index(id));
                    self.represented[id.index()] = None;
                }
                for &id in ids {
                    // Listed more than once, it is in the tree already; removed, its index may be another's,
                    // which is listed too.
                    if self.represented[id.index()].is_some() || !scene.contains(id) || self.has(id) {
                        continue;
                    }
                    self.tree.insert(index(id), corners(scene, id))?;
                    self.represented[id.index()] = Some(id).filter(|&id| is_fully_represented(scene, id));
                }
            }
        }
        Ok(())
    }

    /// The object with this index, if all of its triangles are in the tree.
    pub(crate) fn object(&self, index: u32) -> Option<ObjectId> {
        self.represented.get(index as usize).copied().flatten()
    }

    fn has(&self, id: ObjectId) -> bool {
        let mut any = false;
        self.tree.for_each_fragment(index(id), |_| any = true);
        any
    }

    /// The tree, whose fragments' owners are object indices.
    pub fn tree(&self) -> &BspTree {
        &self.tree
    }
}

fn index(id: ObjectId) -> u32 {
    id.index() as u32
}

fn corners(scene: &Scene, id: ObjectId) -> impl Iterator<Item = [visibility_core::glam::DVec3; 3]> + '_ {
    let triangles = scene.triangles(id).unwrap_or_default();
    triangles.iter().map(|triangle| triangle.map(|corner| corner.as_dvec3()))
}

/// Whether an object has triangles, and the tree accepts all of them.
fn is_fully_represented(scene: &Scene, id: ObjectId) -> bool {
    let mut triangles = corners(scene, id).peekable();
    triangles.peek().is_some() && triangles.all(|triangle| BspTree::accepts(&triangle))
}

/// Which objects have changed since a shared tree was brought up to date, for one view and frame.
#[derive(Clone, Debug, Default)]
pub(crate) struct StaleObjects {
    /// By object index: `frame` for objects that have changed since the tree was brought up to date.
    changed: Vec<u32>,
    frame: u32,
    lost: bool,
}

impl StaleObjects {
    /// Compares the tree with the scene. To be called first in a frame.
    pub(crate) fn begin(&mut self, shared: &SceneTree, scene: &Scene) {
        self.frame = self.frame.wrapping_add(1);
        if self.frame == 0 || self.changed.len() != scene.index_limit() {
            self.changed.clear();
            self.changed.resize(scene.index_limit(), 0);
            self.frame = 1;
        }
        self.lost = false;
        match shared.cursor.peek(scene) {
            Changes::Everything => self.lost = true,
            Changes::Objects(ids) => {
                for id in ids {
                    self.changed[id.index()] = self.frame;
                }
            }
        }
    }

    /// Whether the object with this index has not changed since the tree was brought up to date.
    #[inline]
    pub(crate) fn is_current(&self, index: u32) -> bool {
        !self.lost && self.changed.get(index as usize).is_some_and(|&frame| frame != self.frame)
    }

    /// Whether all triangles of an object are in the tree, as they are in the scene.
    pub(crate) fn is_known(&self, shared: &SceneTree, id: ObjectId) -> bool {
        self.is_current(index(id)) && shared.represented.get(id.index()) == Some(&Some(id))
    }
}
