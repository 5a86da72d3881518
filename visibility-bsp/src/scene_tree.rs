//! The BSP tree of all triangles of a scene, updated incrementally and shared by any number of views.

use crate::tree::{BspError, BspTree};
use alloc::vec::Vec;
use visibility_core::{
    ObjectId, Scene,
    scene::{Changes, SceneCursor},
};

/// A [`BspTree`] of all triangles of a [`Scene`], in metres relative to `Scene::origin`. The owner of each
/// fragment is its object's index.
///
/// The tree is built once and shared by the cullers of all views. After changes of the scene,
/// [`sync`](Self::sync) updates the tree in time proportional to the changed objects. Until then, a changed
/// object counts as visible and hides nothing.
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
    /// BSP tree of the scene's triangles. The owner of a fragment is its object's index.
    tree: BspTree,
    /// By object index: the object, if every triangle of it is in the tree. `None` for objects without
    /// triangles or with a degenerate one.
    represented: Vec<Option<ObjectId>>,
    /// The scene, and the revision of the scene, that the tree represents.
    cursor: SceneCursor,
}

impl SceneTree {
    /// Builds the tree of all present triangles of a scene. Takes some microseconds per triangle.
    ///
    /// An object without triangles, or with a triangle that is not finite or has no area, always counts as
    /// visible.
    ///
    /// # Errors
    /// [`BspError::TooManyFragments`] if building makes more than 4,096 cuts plus 256 for each triangle.
    pub fn new(scene: &Scene) -> Result<Self, BspError> {
        let mut represented = alloc::vec![None; scene.index_limit()];
        for id in scene.ids() {
            represented[id.index()] = Some(id).filter(|&id| is_fully_represented(scene, id));
        }
        let tree =
            BspTree::build(scene.ids().flat_map(|id| corners(scene, id).map(move |t| (index(id), t))))?;
        Ok(Self { tree, represented, cursor: SceneCursor::at(scene) })
    }

    /// Updates the tree to the scene's present revision by removing and inserting the triangles of changed
    /// objects. For another scene than before, the tree is built anew as by [`new`](Self::new).
    ///
    /// # Errors
    /// [`BspError::TooManyFragments`], if the triangles of an object, or of the scene in a rebuild, are cut
    /// more than 4,096 times plus 256 times for each. Objects that could not be inserted count as visible. If
    /// a rebuild for another scene fails, the tree stays as it was.
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
                    // An id listed twice is in the tree already. The index of a removed object may belong to
                    // another object, which is listed too.
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

    /// Returns the object with this index, if all of its triangles are in the tree; otherwise `None`.
    pub(crate) fn object(&self, index: u32) -> Option<ObjectId> {
        self.represented.get(index as usize).copied().flatten()
    }

    /// Tests whether the tree has any fragment of an object. Visits all fragments of the object. False for an
    /// object without fragments.
    fn has(&self, id: ObjectId) -> bool {
        let mut any = false;
        self.tree.for_each_fragment(index(id), |_| any = true);
        any
    }

    /// Returns the BSP tree of the scene's triangles, in metres relative to `Scene::origin`. The owner of a
    /// fragment is its object's index.
    pub fn tree(&self) -> &BspTree {
        &self.tree
    }
}

/// Returns an object's index, which is its owner number in the tree.
fn index(id: ObjectId) -> u32 {
    id.index() as u32
}

/// Returns the triangles of an object in metres relative to `Scene::origin`; none for an object that has no
/// triangles or is not in the scene.
fn corners(scene: &Scene, id: ObjectId) -> impl Iterator<Item = [visibility_core::glam::DVec3; 3]> + '_ {
    let triangles = scene.triangles(id).unwrap_or_default();
    triangles.iter().map(|triangle| triangle.map(|corner| corner.as_dvec3()))
}

/// Tests whether an object has at least one triangle, and the tree accepts all of its triangles. If false,
/// the object always counts as visible.
fn is_fully_represented(scene: &Scene, id: ObjectId) -> bool {
    let mut triangles = corners(scene, id).peekable();
    triangles.peek().is_some() && triangles.all(|triangle| BspTree::accepts(&triangle))
}

/// Objects that have changed since a shared tree was last synchronized, determined once per view and frame.
#[derive(Clone, Debug, Default)]
pub(crate) struct StaleObjects {
    /// By object index: the number of the last frame that found the object changed since the tree was
    /// synchronized, 0 if none did.
    changed: Vec<u32>,
    /// Number of the present frame, from 1 on; 0 before the first.
    frame: u32,
    /// True if the tree belongs to another scene, or more has changed than the scene lists. No object is
    /// then current. False if `changed` is complete.
    lost: bool,
}

impl StaleObjects {
    /// Compares the tree `shared` with the scene and marks the objects that have changed since the tree was
    /// synchronized. Must be called before the queries of a frame.
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

    /// Tests whether the object with this index is unchanged since the tree was synchronized. False for an
    /// index beyond those of the scene.
    #[inline]
    pub(crate) fn is_current(&self, index: u32) -> bool {
        !self.lost && self.changed.get(index as usize).is_some_and(|&frame| frame != self.frame)
    }

    /// Tests whether the tree contains all present triangles of an object: the object has some, none of them
    /// is degenerate, and none has changed since the tree was synchronized. False for any other object, which
    /// counts as visible.
    pub(crate) fn is_known(&self, shared: &SceneTree, id: ObjectId) -> bool {
        self.is_current(index(id)) && shared.represented.get(id.index()) == Some(&Some(id))
    }
}
