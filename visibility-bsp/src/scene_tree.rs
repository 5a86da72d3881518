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
/// [`sync`](Self::sync) updates the tree in time proportional to the changed objects, or builds the tree anew
/// once an object far outside of all others has gone. Until then, a changed object counts as visible and
/// hides nothing.
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
    /// Objects that changed before the last [`sync`](Self::sync), each once, ascending. Kept for its memory.
    changed: Vec<ObjectId>,
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
        Ok(Self { tree, represented, cursor: SceneCursor::at(scene), changed: Vec::new() })
    }

    /// Updates the tree to the scene's present revision by removing and inserting the triangles of changed
    /// objects. The tree is built anew as by [`new`](Self::new) for another scene than before, and after an
    /// object has gone that was some 16 times as far from `Scene::origin` as all that remain, since
    /// planes keep the margins that it needed.
    ///
    /// # Errors
    /// [`BspError::TooManyFragments`], if the triangles of an object, or of the scene in a rebuild, are cut
    /// more than 4,096 times plus 256 times for each. The error is of the first such object, in the order of
    /// indices. All others are in the tree; those that could not be inserted count as visible, also after
    /// later calls, until they change. If a rebuild for another scene fails, the tree stays as it was.
    pub fn sync(&mut self, scene: &Scene) -> Result<(), BspError> {
        match self.cursor.peek(scene) {
            Changes::Everything => *self = Self::new(scene)?,
            Changes::Objects(ids) => {
                self.represented.resize(scene.index_limit(), None);
                self.cursor = SceneCursor::at(scene);
                // The scene lists an object once for each of its changes.
                self.changed.clear();
                self.changed.extend_from_slice(ids);
                self.changed.sort_unstable();
                self.changed.dedup();
                for &id in &self.changed {
                    self.tree.remove(index(id));
                    self.represented[id.index()] = None;
                }
                if self.has_lost_extent(scene) {
                    if let Ok(new) = Self::new(scene) {
                        *self = new;
                        return Ok(());
                    }
                    // Objects are then inserted one by one, each of which may be left out.
                    self.tree = BspTree::new();
                    self.represented.fill(None);
                    self.changed.clear();
                    self.changed.extend(scene.ids());
                }
                let mut result = Ok(());
                // The index of a removed object may belong to another object, which is listed too.
                for &id in self.changed.iter().filter(|&&id| scene.contains(id)) {
                    let inserted = self.tree.insert(index(id), corners(scene, id));
                    if inserted.is_ok() && is_fully_represented(scene, id) {
                        self.represented[id.index()] = Some(id);
                    }
                    result = result.and(inserted.map(drop));
                }
                return result;
            }
        }
        Ok(())
    }

    /// Tests whether the margins of planes are for coordinates 16 times as great as any in the tree or of the
    /// changed objects that are to be inserted. False for a tree without polygons.
    fn has_lost_extent(&self, scene: &Scene) -> bool {
        let enough = self.tree.magnitude().max_element() / 16.0;
        let bounds = self.tree.bounds();
        if self.tree.is_empty() || f64::from(bounds.min.abs().max(bounds.max.abs()).max_element()) >= enough {
            return false;
        }
        let mut triangles = self.changed.iter().flat_map(|&id| corners(scene, id));
        !triangles.any(|t| t.iter().any(|v| v.abs().max_element() >= enough) && BspTree::accepts(&t))
    }

    /// Returns the object with this index, if all of its triangles are in the tree; otherwise `None`.
    pub(crate) fn object(&self, index: u32) -> Option<ObjectId> {
        self.represented.get(index as usize).copied().flatten()
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
    triangles.iter().map(|triangle| {
        #[cfg(test)]
        visibility_testing::step();
        triangle.map(|corner| corner.as_dvec3())
    })
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec;
    use visibility_core::{Aabb, glam::Vec3, scene::Triangle};
    use visibility_testing::steps_of;

    fn insert(scene: &mut Scene, triangles: Vec<Triangle>) -> ObjectId {
        let id = scene.insert(Aabb::from_points(triangles.as_flattened().iter().copied()));
        scene.set_triangles(id, triangles).unwrap();
        id
    }

    /// A triangle across the x axis.
    fn across(x: f32) -> Triangle {
        [Vec3::new(x, -1.0, -1.0), Vec3::new(x, 1.0, -1.0), Vec3::new(x, 0.0, 1.0)]
    }

    #[test]
    fn an_object_that_changed_often_is_taken_in_once() {
        let flat = [Vec3::ZERO; 3];
        let some: Vec<Triangle> = (0..200).map(|i| across(i as f32)).chain([flat]).collect();
        for triangles in [some, vec![flat; 201]] {
            let fragments = if triangles[0] == flat { 0 } else { 200 };
            let mut scene = Scene::new();
            let id = insert(&mut scene, triangles);
            let mut tree = SceneTree::new(&scene).unwrap();
            for i in 0..300 {
                scene.set_occluder(id, i % 2 == 0).unwrap();
            }
            let steps = steps_of(|| tree.sync(&scene).unwrap());
            std::println!("steps for 300 changes of 201 triangles, {fragments} of them with area: {steps}");
            assert!(steps <= 3 * 201, "{steps} steps for 201 triangles, {fragments} of them with area");
            assert_eq!(tree.tree().fragment_count(), fragments, "fragments in the tree");
            assert_eq!(tree.object(0), None, "an object with a triangle without area counts as visible");
        }
    }

    #[test]
    fn an_object_that_cannot_be_inserted_keeps_no_other_out() {
        let mut scene = Scene::new();
        insert(&mut scene, (0..4600).map(|i| across(i as f32)).collect());
        let mut tree = SceneTree::new(&scene).unwrap();
        // A triangle that the planes of all others cut, and two that none cuts.
        let [before, long, after] = [
            vec![across(-5.0)],
            vec![[Vec3::new(-1.0, -0.5, 0.0), Vec3::new(4601.0, -0.5, 0.0), Vec3::new(4601.0, 0.5, 0.0)]],
            vec![across(-6.0)],
        ]
        .map(|triangles| insert(&mut scene, triangles));
        assert!(matches!(tree.sync(&scene), Err(BspError::TooManyFragments { .. })), "too many cuts");
        let known = [before, long, after].map(|id| tree.object(index(id)));
        assert_eq!(known, [Some(before), None, Some(after)], "objects in the tree");
        assert_eq!(tree.sync(&scene), Ok(()), "nothing has changed since");
        let part = [Vec3::new(-1.0, -0.5, 0.0), Vec3::new(-0.5, -0.5, 0.0), Vec3::new(-0.5, 0.5, 0.0)];
        scene.set_triangles(long, [part]).unwrap();
        assert_eq!(tree.sync(&scene), Ok(()), "the object has another form");
        assert_eq!(tree.object(index(long)), Some(long), "the object is in the tree");
    }

    #[test]
    fn a_far_object_that_cannot_be_inserted_leaves_all_margins_as_they_were() {
        let mut scene = Scene::new();
        insert(&mut scene, (0..4600).map(|i| across(i as f32)).collect());
        let mut tree = SceneTree::new(&scene).unwrap();
        let magnitude = tree.tree().magnitude();
        let far = 1e9;
        let long = [Vec3::new(-1.0, -0.5, 0.0), Vec3::new(far, -0.5, 0.0), Vec3::new(far, 0.5, 0.0)];
        insert(&mut scene, vec![long]);
        assert!(tree.sync(&scene).is_err(), "a triangle across all planes");
        assert_eq!(tree.tree().magnitude(), magnitude, "the bound on coordinates");
        insert(&mut scene, vec![across(-1.0)]);
        let steps = steps_of(|| tree.sync(&scene).unwrap());
        assert!(steps < 10, "{steps} steps to insert a triangle");
    }

    /// Slats along all three axes, which cut each other: they can be inserted one by one, and not together.
    #[test]
    fn a_tree_that_cannot_be_built_anew_is_made_of_single_objects() {
        let mut scene = Scene::new();
        let mut tree = SceneTree::new(&scene).unwrap();
        let mut ids = vec![];
        for number in 0..96 {
            let (axis, at) = (number % 3, (number / 3) as f32 - 16.0);
            let turned = |[s, t]: [f32; 2]| {
                let p = [at + s * 1e-3 * (1.0 + at), 50.0 * s, 50.0 * t];
                Vec3::new(p[(3 - axis) % 3], p[(4 - axis) % 3], p[(5 - axis) % 3])
            };
            ids.push(insert(&mut scene, vec![[[-1.0, -1.0], [1.0, -1.0], [0.0, 1.0]].map(turned)]));
            tree.sync(&scene).unwrap();
        }
        assert!(SceneTree::new(&scene).is_err(), "all slats at once cut each other too often");
        let magnitude = tree.tree().magnitude();
        let far = insert(&mut scene, vec![across(1e9)]);
        tree.sync(&scene).unwrap();
        scene.remove(far).unwrap();
        tree.sync(&scene).unwrap();
        assert!(tree.tree().magnitude().cmple(2.0 * magnitude).all(), "the bound on coordinates");
        for &id in &ids {
            assert_eq!(tree.object(index(id)), Some(id), "a slat is in the tree");
        }
        assert_eq!(tree.object(index(far)), None, "the far object is gone");
    }

    /// The margins are for coordinates of 16 m. Whether that is 16 times as much as the rest needs
    /// decides over a new tree, from which on they are for what is left.
    #[test]
    fn a_tree_that_has_lost_its_extent_is_built_anew() {
        for (kept, is_anew) in [(0.5, true), (1f32.next_down(), true), (1.0, false), (1.5, false)] {
            for side in [1.0, -1.0] {
                let mut scene = Scene::new();
                let near = |side: f32| [[kept * side, 0.0], [0.0, 0.25], [0.0, -0.25]];
                insert(&mut scene, vec![near(side).map(|[x, y]| Vec3::new(x, y, 0.0))]);
                let far = insert(&mut scene, vec![across(16.0)]);
                let mut tree = SceneTree::new(&scene).unwrap();
                assert_eq!(tree.tree().magnitude().max_element(), 16.0, "with the far object");
                scene.remove(far).unwrap();
                tree.sync(&scene).unwrap();
                let expected = if is_anew { f64::from(kept) } else { 16.0 };
                assert_eq!(
                    tree.tree().magnitude().max_element(),
                    expected,
                    "{kept} m are kept on side {side}"
                );
            }
        }
        // What comes in the same step counts, if the tree accepts it: a triangle with an area.
        let flat = |x: f32| [Vec3::ZERO, Vec3::X * x, Vec3::X * x];
        for (new, is_anew) in [
            (vec![across(1.0)], false),
            (vec![across(1.0), across(0.5)], false),
            (vec![across(-0.5).map(|v| v * 0.5)], true),
            (vec![flat(15.0)], true),
            (vec![flat(15.0), across(0.5).map(|v| v * 0.5)], true),
            (vec![], true),
        ] {
            let mut scene = Scene::new();
            insert(&mut scene, vec![across(0.5).map(|v| v * 0.5)]);
            let far = insert(&mut scene, vec![across(16.0)]);
            let mut tree = SceneTree::new(&scene).unwrap();
            scene.remove(far).unwrap();
            insert(&mut scene, new.clone());
            tree.sync(&scene).unwrap();
            let expected = if is_anew { 0.5 } else { 16.0 };
            assert_eq!(tree.tree().magnitude().max_element(), expected, "{new:?} comes");
        }
        // Without a polygon there is nothing to build anew.
        let mut scene = Scene::new();
        let far = insert(&mut scene, vec![across(16.0)]);
        let mut tree = SceneTree::new(&scene).unwrap();
        scene.remove(far).unwrap();
        let small = insert(&mut scene, vec![across(0.5)]);
        tree.sync(&scene).unwrap();
        assert_eq!(
            tree.tree().magnitude(),
            visibility_core::glam::DVec3::new(0.5, 1.0, 1.0),
            "of the small one"
        );
        assert_eq!(tree.object(index(small)), Some(small), "the small object is in the tree");
    }

    #[test]
    fn objects_are_known_while_all_that_they_show_is_in_the_tree() {
        let mut scene = Scene::new();
        let whole = insert(&mut scene, vec![across(1.0), across(2.0)]);
        let part = insert(&mut scene, vec![across(3.0), [Vec3::ZERO; 3]]);
        let empty = scene.insert(Aabb::from_arrays([0.0; 3], [1.0; 3]));
        let changing = insert(&mut scene, vec![across(4.0)]);
        let mut tree = SceneTree::new(&scene).unwrap();
        let mut stale = StaleObjects::default();
        let known = |stale: &mut StaleObjects, tree: &SceneTree, scene: &Scene| {
            stale.begin(tree, scene);
            [whole, part, empty, changing].map(|id| (stale.is_current(index(id)), stale.is_known(tree, id)))
        };
        for frame in 0..3 {
            let found = known(&mut stale, &tree, &scene);
            let expected = [(true, true), (true, false), (true, false), (true, true)];
            assert_eq!(found, expected, "frame {frame}");
            assert!(!stale.is_current(4), "an index beyond the scene's");
        }
        scene.set_occluder(changing, true).unwrap();
        for frame in [0, 1, u32::MAX - 1, u32::MAX, 5, 5] {
            // The count of frames begins anew after the last number.
            stale.frame = if frame > 9 { frame } else { stale.frame };
            let found = known(&mut stale, &tree, &scene);
            assert!(stale.frame > 0, "number of a frame");
            let expected = [(true, true), (true, false), (true, false), (false, false)];
            assert_eq!(found, expected, "frame {frame} with a changed object");
        }
        tree.sync(&scene).unwrap();
        assert_eq!(known(&mut stale, &tree, &scene)[3], (true, true), "after the change is in the tree");
        // Another scene of the same number of indices, and one of more.
        let other = scene.clone();
        assert_eq!(known(&mut stale, &tree, &other), [(false, false); 4], "in another scene");
        assert_eq!(known(&mut stale, &tree, &scene)[0], (true, true), "back in the first scene");
        let more = insert(&mut scene, vec![across(5.0)]);
        assert_eq!(known(&mut stale, &tree, &scene)[0], (true, true), "beside a new object");
        assert!(!stale.is_current(index(more)) && !stale.is_known(&tree, more), "the new object");
        tree.sync(&scene).unwrap();
        stale.begin(&tree, &scene);
        assert!(stale.is_known(&tree, more), "the new object, in the tree");
        // An object that takes the index of another.
        scene.remove(more).unwrap();
        let next = insert(&mut scene, vec![across(5.0)]);
        assert_eq!(next.index(), more.index(), "an index that is used again");
        tree.sync(&scene).unwrap();
        stale.begin(&tree, &scene);
        assert!(stale.is_known(&tree, next) && !stale.is_known(&tree, more), "two objects of one index");
    }
}
