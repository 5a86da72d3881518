//! Boxes that are enlarged by rounding errors, so that they hold the occluder mesh and the triangles of their
//! object. Such a mesh lies before the box by the rounding: a culler would find the object hidden behind
//! itself. The box that was given stays known, since the caller goes on giving it.

use super::placement::Placement;
use super::{ObjectId, Scene, SharedTriangles, Slot};
use crate::Aabb;

impl Scene {
    /// Returns the bounds of an object as they were given, or as they follow from the local box that was
    /// given.
    pub(super) fn given_bounds(&self, index: u32, slot: Slot) -> Aabb {
        let given = self.given.get(&index);
        match self.placements.get(index) {
            Some(&Placement { local: Some(local), transform, .. }) => {
                given.and_then(|given| given.local).unwrap_or(local).transformed(&transform)
            }
            _ => given.and_then(|given| given.bounds).unwrap_or_else(|| self.tree.bounds_in(slot)),
        }
    }

    /// Returns the present bounds of an object if `bounds` are those that were [enlarged](Self::enlarge) to
    /// the present ones. Otherwise returns `bounds`.
    pub(super) fn as_enlarged(&self, index: u32, bounds: Aabb) -> Aabb {
        let is_given = self.given.get(&index).is_some_and(|given| given.bounds == Some(bounds));
        let slot = self.tree.slots[index as usize];
        if is_given { self.tree.bounds_in(slot) } else { bounds }
    }

    /// Returns the bounds to set for an object that is given the bounds `bounds` in scene coordinates: its
    /// present bounds, if these were made of the given ones. Otherwise forgets the box that was given before.
    pub(super) fn resolved(&mut self, index: u32, bounds: Aabb) -> Aabb {
        if !self.given.contains_key(&index) {
            return bounds;
        }
        let bounds = self.as_enlarged(index, bounds);
        let slot = self.tree.slots[index as usize];
        if self.tree.bounds_in(slot) != bounds {
            self.given.remove(&index);
        }
        bounds
    }

    /// Enlarges the box of an object so that it holds `content`, which reaches out of the box by rounding
    /// errors: the local box if `is_local`, otherwise the bounds in scene coordinates. The box that was given
    /// is kept beside it.
    pub(super) fn enlarge(&mut self, index: u32, content: &Aabb, is_local: bool) {
        let slot = self.tree.slots[index as usize];
        let bounds = self.tree.bounds_in(slot);
        let placement = self.placements.get_mut(index).filter(|_| is_local);
        let held = placement.as_ref().and_then(|placement| placement.local).unwrap_or(bounds);
        let enlarged = held.union(content);
        if enlarged == held {
            return;
        }
        let given = self.given.entry(index).or_default();
        let bounds = match placement {
            Some(placement) => {
                given.local.get_or_insert(held);
                placement.local = Some(enlarged);
                let moved = enlarged.transformed(&placement.transform);
                // The bounds go on holding the triangles for which they were enlarged.
                match &mut given.bounds {
                    Some(given) => {
                        *given = moved;
                        moved.union(&bounds)
                    }
                    None => moved,
                }
            }
            None => {
                given.bounds.get_or_insert(held);
                enlarged
            }
        };
        self.move_object(slot, ObjectId { index, generation: self.generations[index as usize] }, &bounds);
    }

    /// Enlarges the bounds of an object so that they hold its triangles, which reach out of them by rounding
    /// errors. Improper bounds stay.
    pub(super) fn hold_triangles(&mut self, index: u32, triangles: &SharedTriangles) {
        let slot = self.tree.slots[index as usize];
        let bounds = self.tree.bounds_in(slot);
        let holds =
            |content: Aabb| bounds.min.cmple(content.min).all() && content.max.cmple(bounds.max).all();
        if bounds.is_proper() && !triangles.view().known_bounds().is_some_and(holds) {
            // Cullers leave out triangles with a corner that is not finite, and hide behind the others.
            let content = triangles.finite_bounds();
            if content.is_finite() {
                self.enlarge(index, &content, false);
            }
        }
    }
}
