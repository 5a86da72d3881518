//! Draw ranges and HLOD parents of a scene: at which distances from the eye an object is drawn, and which
//! object stands in for it from afar. The scene only stores them; the culler is `ContributionCuller` of
//! `visibility-frame`.
//!
//! HLOD is for hierarchical levels of detail: Erikson, Manocha and Baxter, "HLODs for Faster Display of Large
//! Static and Dynamic Environments", 2001.

use super::draw_range::{Detail, DrawRange, Link};
use super::{DetailBounds, Scene, SceneError, Slot};
use crate::{Aabb, ObjectId};
use core::num::NonZeroU32;

/// Greatest number of HLOD parents above an object. A frame asks all of them for each object, so a chain of n
/// objects takes time in n^2.
const MAX_PARENTS: u32 = 64;

fn link(id: ObjectId) -> Link {
    NonZeroU32::new(id.index + 1)
}

fn linked(link: Link) -> Option<usize> {
    link.map(|number| number.get() as usize - 1)
}

/// The data of one object that a culler of levels of detail needs. Returned by [`Scene::detail_at`].
#[derive(Clone, Copy, PartialEq, Debug)]
#[non_exhaustive]
pub struct DetailedObject {
    /// Id of the object.
    pub id: ObjectId,
    /// Bounds of the object, in metres relative to the scene's origin.
    pub bounds: Aabb,
    /// Distances from the eye between which the object is drawn.
    pub range: DrawRange,
    /// Leaf and lane of the HLOD parent that [stands in](Scene::stand_in) for the object. `None` if the
    /// object has no parent, or one that cannot stand in.
    pub stand_in: Option<(usize, usize)>,
}

impl Scene {
    /// Sets the distances at which an object is drawn. Objects are drawn at every distance by default. Only a
    /// `ContributionCuller` of `visibility-frame` hides by them: a pipeline without one draws every object,
    /// and says so in [`Pipeline::for_each_lack`](crate::Pipeline::for_each_lack).
    ///
    /// Bakes and other answers for [many frames](Self::is_always_drawn) do not use an object with a draw
    /// range as an occluder. A culler that works frame by frame does, as long as the object is in the set, so
    /// a `ContributionCuller` must run before that culler. It does not if the range has a
    /// [margin](DrawRange::margin) to fade over: what is transparent at some distances [hides
    /// nothing](Self::can_occlude) at any.
    ///
    /// For two levels of detail of one thing set an [HLOD parent](Self::set_hlod_parent) too. With ranges
    /// alone, there are distances at which neither level is drawn if their bounds differ.
    ///
    /// Takes logarithmic time, and time in proportion to the number of children for an [HLOD
    /// parent](Self::set_hlod_parent). Whole nodes are culled by the new range after
    /// [`maintain`](Self::maintain) or [`rebuild`](Self::rebuild).
    ///
    /// # Errors
    /// [`SceneError::UnknownObject`] if `id` is not in the scene, [`SceneError::DrawRange`] for a NaN, a
    /// negative or infinite `begin`, an `end` less than `begin`, or a negative `margin`.
    pub fn set_draw_range(&mut self, id: ObjectId, range: DrawRange) -> Result<(), SceneError> {
        self.slot(id)?;
        if !range.is_valid() {
            return Err(SceneError::DrawRange(id));
        }
        if range != self.tree.detail(id.index()).range {
            self.grow_details();
            let old = core::mem::replace(&mut self.tree.details[id.index()].range, range);
            let has_range = |range: DrawRange| usize::from(range != DrawRange::ALWAYS);
            self.ranged = self.ranged + has_range(range) - has_range(old);
            self.details_changed(id);
        }
        Ok(())
    }

    /// Returns the number of objects with a [draw range](Self::set_draw_range). Takes constant time.
    pub(crate) fn draw_range_count(&self) -> usize {
        self.ranged
    }

    /// Returns the HLOD parent that stands in for an object, and the parent's bounds. The parent is drawn
    /// instead of the object from the begin of the parent's draw range on, and the end of the object's own
    /// range is measured from the parent's bounds. `None` if there is no parent, or if the parent cannot
    /// stand in: it is never culled, is not on all of the object's layers, or its bounds do not contain those
    /// of the object.
    pub fn stand_in(&self, id: ObjectId) -> Option<(ObjectId, Aabb)> {
        let above = self.tree.substitute(self.slot(id).ok()?)?;
        let bounds = self.tree.bounds_in(above);
        Some((self.tree.ids[above.node()][above.lane()], bounds))
    }

    /// Returns the object in a lane of a leaf. `None` beyond the last leaf or lane. For cullers that walk the
    /// hierarchy, which know the leaf and the lane of an object.
    // `inline(always)`: a call would return the object through memory, and a test of a million draw ranges
    // takes 1.3 to 1.8 times as long.
    #[inline(always)]
    pub fn detail_at(&self, leaf: usize, lane: usize) -> Option<DetailedObject> {
        let id = *self.tree.ids.get(leaf)?.get(lane)?;
        let (bounds, range) = (self.tree.bounds.get(leaf)?.get(lane), self.tree.detail(id.index()).range);
        let above = self.tree.substitute(Slot::new(leaf as u32, lane));
        Some(DetailedObject { id, bounds, range, stand_in: above.map(|above| (above.node(), above.lane())) })
    }

    /// Returns a mask of the lanes of a leaf whose objects have a draw range, an HLOD parent or children; bit
    /// i stands for lane i. `leaf` is the number of a [leaf](crate::walk::Block::leaf); the mask is 0 if it
    /// is not less than [`leaf_limit`](Self::leaf_limit).
    #[inline]
    pub fn detailed_lanes(&self, leaf: usize) -> u64 {
        self.tree.detailed.get(leaf).copied().unwrap_or(0)
    }

    /// Returns bounds on the size and the draw ranges of all objects below a node of the [scene's
    /// hierarchy](crate::walk::SceneHierarchy), by which whole nodes are dropped. For an unknown node, the
    /// bounds of an empty set of objects.
    #[inline]
    pub fn detail_bounds(&self, node: usize) -> DetailBounds {
        self.tree.detail_bounds.get(node).copied().unwrap_or(DetailBounds::NONE)
    }

    /// Returns whether an object is drawn at every distance: it has no [draw range](Self::set_draw_range), no
    /// [HLOD parent](Self::set_hlod_parent) and no children. False for an unknown object.
    ///
    /// Any other object is absent from some frames, so it must not be an occluder in an answer for many
    /// frames. Bakes, levels, region cullers and [`level_version`](crate::level_version()) do not use it as
    /// an occluder.
    pub fn is_always_drawn(&self, id: ObjectId) -> bool {
        self.contains(id) && self.tree.detail(id.index()) == Detail::NONE
    }

    /// Returns the distances at which an object is drawn, [`DrawRange::ALWAYS`] if none were set.
    ///
    /// # Errors
    /// [`SceneError::UnknownObject`] if `id` is not in the scene.
    pub fn draw_range(&self, id: ObjectId) -> Result<DrawRange, SceneError> {
        self.slot(id)?;
        Ok(self.tree.detail(id.index()).range)
    }

    /// Sets the object that stands in for `id` from afar: one cheap mesh for a whole block of houses, or the
    /// far level of detail of a single thing. `None` takes the object's parent away. Parents may have
    /// parents, with a greater `begin`.
    ///
    /// The [draw range](Self::set_draw_range) of the parent says from which distance on the parent is drawn:
    /// at distances less than its `begin` its children are drawn, from its `begin` on the parent, never both.
    /// These distances, and the `end` of a child's own range, are measured from the parent's bounds. A child
    /// needs no range of its own. If a child's range has an `end` less than the parent's `begin`, neither
    /// child nor parent is drawn between these two distances. A child and its parent do not fade towards each
    /// other: [`DrawRange::margin`] has no effect where one takes the other's place.
    ///
    /// The parent's bounds must contain those of its children (for the levels of a single thing, give the
    /// parent a box around all of them), and the parent must be on all layers that its children are on. A
    /// child that has moved out of these bounds, or is on another layer, is drawn as if it had no parent. So
    /// are the children of a parent that is never culled. The children of a removed parent have no parent.
    ///
    /// Takes time in proportion to the number of parents above `parent` and of objects below `id`. Moving a
    /// parent takes time in proportion to the number of its children.
    ///
    /// # Errors
    /// [`SceneError::UnknownObject`] if `id` or `parent` is not in the scene, [`SceneError::Parent`] if
    /// `parent` is the object itself or one of its descendants, and [`SceneError::TooManyParents`] if the
    /// object or one of its descendants would have more than 64 parents above it, each the parent of the one
    /// before: a frame asks all of them.
    pub fn set_hlod_parent(&mut self, id: ObjectId, parent: Option<ObjectId>) -> Result<(), SceneError> {
        self.slot(id)?;
        let (mut above, mut count) = (parent, 0);
        while let Some(object) = above {
            self.slot(object)?;
            if object == id {
                return Err(SceneError::Parent(id));
            }
            above = self.hlod_parent(object)?;
            count += 1;
        }
        if parent == self.hlod_parent(id)? {
            return Ok(());
        }
        if count > 0 && count + self.levels_below(id) > MAX_PARENTS {
            return Err(SceneError::TooManyParents(id));
        }
        self.grow_details();
        let former = self.hlod_parent(id)?;
        self.unlink(id);
        if let Some(parent) = parent {
            let details = &mut self.tree.details;
            let next = core::mem::replace(&mut details[parent.index()].first_child, link(id));
            if let Some(next) = linked(next) {
                details[next].previous = link(id);
            }
            (details[id.index()].parent, details[id.index()].next) = (link(parent), next);
        }
        // With its first child an object begins to be drawn from afar alone, and without children it is drawn
        // at every distance again. Its other children are drawn as before.
        for parent in [former, parent].into_iter().flatten() {
            self.raise_bounds(self.tree.slots[parent.index()]);
            self.log.push(parent, self.generations.len());
        }
        self.details_changed(id);
        Ok(())
    }

    /// Returns the number of levels of HLOD descendants below an object: 0 without children, 1 if no child
    /// has children.
    fn levels_below(&self, id: ObjectId) -> u32 {
        let (mut at, mut level, mut most) = (id.index(), 0, 0);
        loop {
            if let Some(child) = linked(self.tree.detail(at).first_child) {
                (at, level) = (child, level + 1);
                most = most.max(level);
                continue;
            }
            // All below `at` is counted: goes on with the next sibling of `at` or of a parent of it.
            loop {
                let detail = self.tree.detail(at);
                if at == id.index() {
                    return most;
                } else if let Some(next) = linked(detail.next) {
                    at = next;
                    break;
                } else if let Some(parent) = linked(detail.parent) {
                    (at, level) = (parent, level - 1);
                } else {
                    return most;
                }
            }
        }
    }

    /// Returns the object that stands in for `id` from afar, `None` if none was set or it was removed.
    ///
    /// # Errors
    /// [`SceneError::UnknownObject`] if `id` is not in the scene.
    pub fn hlod_parent(&self, id: ObjectId) -> Result<Option<ObjectId>, SceneError> {
        self.slot(id)?;
        Ok(linked(self.tree.detail(id.index()).parent).and_then(|index| self.id_at(index)))
    }

    /// Returns whether an object is the [HLOD parent](Self::set_hlod_parent) of another. False for an unknown
    /// object.
    pub fn is_hlod_parent(&self, id: ObjectId) -> bool {
        self.contains(id) && self.tree.detail(id.index()).first_child.is_some()
    }

    /// Extends `details` to one entry for each object index.
    fn grow_details(&mut self) {
        self.tree.details.resize(self.generations.len(), Detail::NONE);
    }

    /// Takes an object out of its parent's list of children.
    fn unlink(&mut self, id: ObjectId) {
        let details = &mut self.tree.details;
        let Detail { parent, next, previous, .. } = details[id.index()];
        match (linked(previous), linked(parent)) {
            (Some(previous), _) => details[previous].next = next,
            (None, Some(parent)) => details[parent].first_child = next,
            (None, None) => {}
        }
        if let Some(next) = linked(next) {
            details[next].previous = previous;
        }
        let detail = &mut details[id.index()];
        (detail.parent, detail.next, detail.previous) = (None, None, None);
    }

    /// Raises the bounds of the nodes above an object and above its HLOD children, after the draw range or
    /// the HLOD parent of the object has changed. Logs the change.
    fn details_changed(&mut self, id: ObjectId) {
        self.raise_bounds(self.tree.slots[id.index()]);
        self.raise_children(id);
        self.log.push(id, self.generations.len());
    }

    /// Raises the [bounds](DetailBounds) of the nodes above the object in `slot` to include the object, and
    /// queues the object's leaf, so that [`maintain`](Self::maintain) lowers bounds that are too high.
    fn raise_bounds(&mut self, slot: Slot) {
        self.tree.raise_to_object(slot);
        self.queue.push(slot.node());
    }

    /// Raises the bounds of the nodes above the HLOD children of an object: the distance up to which the
    /// children are drawn depends on the object.
    pub(super) fn raise_children(&mut self, id: ObjectId) {
        let mut child = linked(self.tree.detail(id.index()).first_child);
        while let Some(index) = child {
            self.raise_bounds(self.tree.slots[index]);
            child = linked(self.tree.details[index].next);
        }
    }

    /// Forgets the draw range and the HLOD parent of an object that is being removed. Its children have no
    /// parent from then on.
    pub(super) fn forget_details(&mut self, id: ObjectId) {
        if self.tree.detail(id.index()) == Detail::NONE {
            return;
        }
        if let Some(former) = linked(self.tree.detail(id.index()).parent).and_then(|index| self.id_at(index))
        {
            self.log.push(former, self.generations.len());
        }
        self.unlink(id);
        while let Some(child) = linked(self.tree.details[id.index()].first_child) {
            self.unlink(ObjectId { index: child as u32, generation: 0 });
            self.raise_bounds(self.tree.slots[child]);
            if let Some(child) = self.id_at(child) {
                self.log.push(child, self.generations.len());
            }
        }
        let old = core::mem::replace(&mut self.tree.details[id.index()], Detail::NONE);
        self.ranged -= usize::from(old.range != DrawRange::ALWAYS);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;

    fn scene(count: usize) -> (Scene, Vec<ObjectId>) {
        let mut scene = Scene::new();
        let ids = scene.insert_batch((0..count).map(|_| Aabb::from_arrays([0.0; 3], [1.0; 3])));
        (scene, ids)
    }

    /// Makes each of `ids` the child of the next.
    fn chain(scene: &mut Scene, ids: &[ObjectId]) {
        for pair in ids.windows(2) {
            scene.set_hlod_parent(pair[0], Some(pair[1])).unwrap();
        }
    }

    #[test]
    fn an_object_has_at_most_64_parents_above_it() {
        let (mut whole, ids) = scene(66);
        chain(&mut whole, &ids[..65]);
        assert_eq!(
            whole.set_hlod_parent(ids[64], Some(ids[65])),
            Err(SceneError::TooManyParents(ids[64])),
            "the first object would have 65 parents"
        );
        assert_eq!(whole.set_hlod_parent(ids[63], None), Ok(()), "a parent may always be taken away");
        for (below, is_ok) in [(40, true), (41, false)] {
            let (mut scene, ids) = scene(65 + 2);
            let (low, high) = ids[..below + 24 + 1].split_at(below + 1);
            chain(&mut scene, low);
            chain(&mut scene, high);
            // A second child, on either side of the first in the list, has fewer descendants.
            let other = ids[ids.len() - 1];
            scene.set_hlod_parent(other, Some(low[below / 2])).unwrap();
            let linked = scene.set_hlod_parent(low[below], Some(high[0]));
            let error = Err(SceneError::TooManyParents(low[below]));
            assert_eq!(linked, if is_ok { Ok(()) } else { error }, "{below} levels below 24 parents");
            scene.set_hlod_parent(low[below], None).unwrap();
            assert_eq!(scene.levels_below(low[below]), below as u32, "levels below");
            assert_eq!(scene.levels_below(ids[0]), 0, "an object without children");
        }
    }

    #[test]
    fn no_object_is_its_own_parent() {
        let (mut scene, ids) = scene(4);
        chain(&mut scene, &ids);
        for id in ids.iter().copied() {
            assert_eq!(
                scene.set_hlod_parent(ids[3], Some(id)),
                Err(SceneError::Parent(ids[3])),
                "{id} is the object or below it"
            );
        }
        let gone = ids[1];
        scene.remove(gone).unwrap();
        assert_eq!(scene.hlod_parent(ids[0]), Ok(None), "the child of a removed parent has none");
        let unknown = Err(SceneError::UnknownObject(gone));
        assert_eq!(scene.set_hlod_parent(ids[0], Some(gone)), unknown, "a removed parent");
        assert_eq!(scene.set_hlod_parent(gone, None), unknown, "a removed child");
    }

    #[test]
    fn an_object_with_details_is_not_always_drawn() {
        let (mut scene, ids) = scene(5);
        let [child, parent, ranged, plain, gone] = ids[..] else { panic!("five objects") };
        scene.set_hlod_parent(child, Some(parent)).unwrap();
        scene.set_draw_range(ranged, DrawRange { end: 9.0, ..DrawRange::ALWAYS }).unwrap();
        scene.set_hlod_parent(gone, Some(parent)).unwrap();
        scene.remove(gone).unwrap();
        let again = scene.insert(Aabb::from_arrays([0.0; 3], [1.0; 3]));
        assert_eq!(again.index(), gone.index(), "the place is taken again");
        let all = [child, parent, ranged, plain, gone, again];
        let drawn = all.map(|id| scene.is_always_drawn(id));
        assert_eq!(
            drawn,
            [false, false, false, true, false, true],
            "plain objects are, unknown ones are not"
        );
        let parents = all.map(|id| scene.is_hlod_parent(id));
        assert_eq!(parents, [false, true, false, false, false, false], "one is a parent");
        scene.remove(parent).unwrap();
        scene.insert(Aabb::from_arrays([0.0; 3], [1.0; 3]));
        assert!(!scene.is_hlod_parent(parent) && scene.is_always_drawn(child), "the parent is gone");
        assert_eq!(scene.draw_range_count(), 1, "objects with a draw range");
        scene.set_draw_range(ranged, DrawRange::ALWAYS).unwrap();
        assert_eq!(scene.draw_range_count(), 0, "objects with a draw range");
    }

    #[test]
    fn an_id_of_before_is_no_parent() {
        let (mut scene, ids) = scene(2);
        scene.remove(ids[0]).unwrap();
        let again = scene.insert(Aabb::from_arrays([0.0; 3], [1.0; 3]));
        assert_eq!(again.index(), ids[0].index(), "the object takes the place of the other");
        scene.set_hlod_parent(ids[1], Some(again)).unwrap();
        assert!(scene.is_hlod_parent(again) && !scene.is_hlod_parent(ids[0]), "parents");
    }

    #[test]
    fn lanes_are_of_layers_and_occluders_of_flags() {
        let bounds = Aabb::from_arrays([0.0; 3], [1.0; 3]);
        let lanes = |scene: &Scene, layers: u32| -> u32 {
            (0..scene.leaf_limit()).map(|leaf| scene.lanes_on_layers(leaf, layers).count_ones()).sum()
        };
        let mut scene = Scene::new();
        let plain = scene.insert(bounds);
        assert_eq!([0, 1].map(|layers| lanes(&scene, layers)), [0, 1], "an object on all layers");
        let wall = scene.insert(crate::Object { occluder: true, layers: 2, ..crate::Object::new(bounds) });
        assert_eq!([0, 2, 4].map(|layers| lanes(&scene, layers)), [0, 2, 1], "and one on layer 2");
        let improper = Aabb::from_arrays([f32::NAN; 3], [1.0; 3]);
        let lost = scene.insert(crate::Object { occluder: true, ..crate::Object::new(improper) });
        assert_eq!([plain, wall, lost].map(|id| scene.can_occlude(id)), [false, true, false], "occluders");
    }
}
