//! Changes of the bounds of objects, one by one and in batches.

use super::changes::ChangeLog;
use super::object::is_unculled;
use super::tree::Scratch;
use super::{ObjectId, Scene, SceneError, Slot};
use crate::Aabb;

/// Batches of at least 1 / `MANY` of all objects are moved in one pass over the whole hierarchy.
const MANY: usize = 2;

impl Scene {
    /// Sets the bounds of an object, relative to the scene's origin, after it has moved or changed its shape.
    /// If the bounds are equal to the present ones, or to those that were given before and have been
    /// [enlarged](Self::bounds) since, mesh and triangles stay: for an object that has turned
    /// within its box, call [`set_transform`](Self::set_transform), or set its triangles and mesh again.
    ///
    /// If `bounds` differ from the present bounds, the object's [mesh](Self::set_mesh) and
    /// [triangles](Self::set_triangles) are removed, since they would hide other objects from the object's
    /// old place. Its [local bounds](Self::set_local_bounds) are removed too. Set them again after the
    /// bounds, or move the object by [`set_transform`](Self::set_transform), which moves bounds and mesh
    /// together.
    ///
    /// # Errors
    /// [`SceneError::UnknownObject`] if `id` is not in the scene.
    pub fn set_bounds(&mut self, id: ObjectId, bounds: Aabb) -> Result<(), SceneError> {
        let slot = self.slot(id)?;
        let bounds = self.resolved(id.index, bounds);
        self.forget_place(id, &bounds);
        self.move_object(slot, id, &bounds);
        self.log.push(id, self.generations.len());
        Ok(())
    }

    /// Sets the bounds of an object in the hierarchy, without any other effect on the object.
    pub(super) fn move_object(&mut self, slot: Slot, id: ObjectId, bounds: &Aabb) {
        let (was, is) =
            (self.tree.is_unculled(slot), is_unculled(bounds, self.never_cull.contains(id.index())));
        if was && is {
            self.tree.bounds[slot.node()].set(slot.lane(), bounds);
        } else if was != is || !self.tree.move_within(slot, bounds) {
            let payload = self.tree.payload(slot);
            self.tree.remove(slot);
            self.insert_into_tree(bounds, payload);
        }
        self.queue.push(slot.node());
        self.raise_children(id);
    }

    /// Sets the bounds of many objects, as [`set_bounds`](Self::set_bounds) does for one, or of none of them
    /// if an id is unknown. If an object is listed twice, its last bounds count. For batches with at least as
    /// many objects as the hierarchy has nodes, the objects are updated leaf by leaf and the bounds of the
    /// hierarchy are made as tight as possible; for batches of at least half of all objects, in one pass.
    ///
    /// # Errors
    /// [`SceneError::UnknownObject`] with the first id that is not in the scene.
    pub fn set_bounds_batch(&mut self, moved: &[(ObjectId, Aabb)]) -> Result<(), SceneError> {
        let mut scratch = core::mem::replace(&mut self.tree.scratch, Scratch::EMPTY);
        let found = self.find_slots(moved.iter().map(|&(id, _)| self.slot(id)), &mut scratch);
        if found.is_ok() {
            let mut enlarged = core::mem::take(&mut scratch.placed);
            let moved = if self.given.is_empty() {
                moved
            } else {
                enlarged.clear();
                enlarged.extend(moved.iter().map(|&(id, bounds)| (id, self.resolved(id.index, bounds))));
                &enlarged
            };
            if !self.placements.is_empty() || !self.triangles.is_empty() {
                for (id, bounds) in moved {
                    self.forget_place(*id, bounds);
                }
            }
            self.move_batch(moved, &mut scratch);
            scratch.placed = enlarged;
        }
        self.tree.scratch = scratch;
        found
    }

    /// Returns whether a batch of `count` objects is moved in one pass over all leaves of the hierarchy.
    fn is_refit(&self, count: usize) -> bool {
        count >= self.tree.node_count() && count >= self.len() / MANY && count <= Scratch::MAX_BATCH
    }

    /// Writes the slots of a batch's objects to `scratch`, as [`move_batch`](Self::move_batch) needs them.
    /// Returns the first error in `slots`, and then writes no more.
    pub(super) fn find_slots(
        &self,
        mut slots: impl ExactSizeIterator<Item = Result<Slot, SceneError>>,
        scratch: &mut Scratch,
    ) -> Result<(), SceneError> {
        scratch.slots.clear();
        if !self.is_refit(slots.len()) {
            return slots.try_for_each(|slot| slot.map(|slot| scratch.slots.push(slot)));
        }
        let positions = scratch.clear_positions(self.tree.node_count());
        slots.zip(0..).try_for_each(|(slot, position)| slot.map(|slot| positions[slot.0 as usize] = position))
    }

    /// Sets the bounds of `moved`, whose slots [`find_slots`](Self::find_slots) has found. Logs the changes.
    pub(super) fn move_batch(&mut self, moved: &[(ObjectId, Aabb)], scratch: &mut Scratch) {
        if ChangeLog::is_too_much(moved.len(), self.generations.len()) {
            self.log.invalidate();
        } else {
            moved.iter().for_each(|&(id, _)| self.log.push(id, self.generations.len()));
        }
        let layout = self.layout;
        if moved.len() >= self.tree.node_count() && moved.len() <= Scratch::MAX_BATCH {
            if self.is_refit(moved.len()) {
                self.tree.refit_batch(moved, scratch, &mut self.queue);
            } else {
                self.tree.move_batch_by_leaf(moved, scratch, &mut self.queue);
            }
            for &position in &scratch.leavers {
                let (id, bounds) = &moved[position as usize];
                self.move_object(self.tree.slots[id.index()], *id, bounds);
            }
            if !self.tree.details.is_empty() {
                // A child may have been measured by an HLOD parent that moved later in the batch.
                moved.iter().for_each(|&(id, _)| self.raise_children(id));
            }
            return;
        }
        for (some, slots) in moved.chunks(32).zip(scratch.slots.chunks(32)) {
            self.tree.fetch(slots);
            for ((id, bounds), &slot) in some.iter().zip(slots) {
                // An earlier object of the batch may have got another slot, and changed the slots of other
                // objects.
                let slot = if self.layout == layout { slot } else { self.tree.slots[id.index()] };
                self.move_object(slot, *id, bounds);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::OccluderMesh;
    use crate::scene::SharedTriangles;
    use alloc::vec::Vec;
    use glam::{Affine3A, Vec3};

    const BOX: Aabb = Aabb { min: Vec3::ZERO, max: Vec3::ONE };
    const MOVED: Aabb = Aabb { min: Vec3::ONE, max: Vec3::splat(2.0) };

    /// Moves an object by each call that sets bounds, and asserts that it has neither a local box nor a mesh
    /// nor triangles any more.
    fn assert_forgotten(name: &str, prepare: impl Fn(&mut Scene, ObjectId)) {
        for is_batch in [false, true] {
            let mut scene = Scene::new();
            let ids: Vec<_> = (0..3).map(|_| scene.insert(BOX)).collect();
            prepare(&mut scene, ids[1]);
            if is_batch {
                scene.set_bounds_batch(&[(ids[1], MOVED)]).unwrap();
            } else {
                scene.set_bounds(ids[1], MOVED).unwrap();
            }
            assert_eq!(scene.bounds(ids[1]), Ok(MOVED), "{name}, in a batch {is_batch}: the bounds");
            assert_eq!(scene.local_bounds(ids[1]), None, "{name}, in a batch {is_batch}: the local box");
            assert!(!scene.has_mesh(ids[1]), "{name}, in a batch {is_batch}: the mesh");
            let is_empty = scene.triangles(ids[1]).unwrap().is_empty();
            assert!(is_empty, "{name}, in a batch {is_batch}: the triangles");
        }
    }

    #[test]
    fn what_was_at_the_old_place_is_forgotten() {
        let triangles = || SharedTriangles::from([[Vec3::ZERO, Vec3::X, Vec3::Y]]);
        assert_forgotten("a local box", |scene, id| scene.set_local_bounds(id, BOX).unwrap());
        assert_forgotten("triangles", |scene, id| scene.set_triangles(id, triangles()).unwrap());
        assert_forgotten("a mesh", |scene, id| {
            let mesh = scene.add_mesh(OccluderMesh::cuboid(&BOX).unwrap());
            scene.set_mesh(id, mesh, Affine3A::IDENTITY).unwrap();
        });
        assert_forgotten("a prepared mesh", |scene, id| {
            scene.set_occluder(id, true).unwrap();
            scene.set_triangles(id, triangles()).unwrap();
            assert_eq!(scene.prepare_occluders(&crate::occlusion::Preparation::default()), 1, "it is made");
        });
    }

    /// Batches of few and of all objects, in hierarchies that have more nodes than objects, or as many.
    #[test]
    fn batches_of_any_size_move_all_their_objects() {
        for (count, left) in [(1, 1), (64, 2), (65, 65), (5000, 4), (5000, 200), (5000, 5000)] {
            for moves in [1, 2, 3, left / 2, left].into_iter().filter(|&moves| moves <= left) {
                let mut scene = Scene::new();
                let ids: Vec<_> = (0..count).map(|_| scene.insert(BOX)).collect();
                scene.remove_batch(&ids[left..]).unwrap();
                let moved: Vec<_> = ids[..moves].iter().map(|&id| (id, MOVED)).collect();
                scene.set_bounds_batch(&moved).unwrap();
                let found = ids[..left].iter().map(|&id| scene.bounds(id).unwrap());
                let expected = (0..left).map(|i| if i < moves { MOVED } else { BOX });
                assert!(found.eq(expected), "{moves} of {left} objects, of {count} that were there");
            }
        }
    }

    /// The index of a removed object has another generation, which no object has until the next is inserted.
    #[test]
    fn an_id_of_no_object_is_unknown() {
        let mut scene = Scene::new();
        let ids: Vec<_> = (0..2).map(|_| scene.insert(BOX)).collect();
        scene.remove(ids[0]).unwrap();
        let next = ObjectId { generation: ids[0].generation.wrapping_add(1), ..ids[0] };
        assert!(!scene.contains(ids[0]) && !scene.contains(next), "neither the old id nor the next is known");
        assert_eq!(scene.set_bounds(next, MOVED), Err(SceneError::UnknownObject(next)), "it cannot be moved");
        let again = scene.insert(BOX);
        let mesh = scene.add_mesh(OccluderMesh::cuboid(&BOX).unwrap());
        scene.set_mesh(again, mesh, Affine3A::IDENTITY).unwrap();
        assert!(again == next && scene.has_mesh(again), "the next object has the next id");
        assert!(!scene.has_mesh(ids[0]) && !scene.has_mesh(ids[1]), "others have no mesh");
    }

    #[test]
    fn a_mesh_of_an_earlier_object_leaves_those_of_later_ones() {
        let mut scene = Scene::new();
        let ids = [(); 2].map(|()| scene.insert(BOX));
        let mesh = scene.add_mesh(OccluderMesh::cuboid(&BOX).unwrap());
        for id in [ids[1], ids[0]] {
            scene.set_mesh(id, mesh, Affine3A::IDENTITY).unwrap();
        }
        assert_eq!(ids.map(|id| scene.has_mesh(id)), [true; 2], "objects with a mesh");
    }
}
