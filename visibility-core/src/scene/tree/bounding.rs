//! Keeps [`DetailBounds`] for every node, with which a culler by size or distance drops whole nodes.
//!
//! Like the boxes, these bounds are raised at once when an object is written, and tightened by
//! [`maintain`](super::super::maintain) and by a rebuild. Too high a bound costs time but hides nothing.

use super::detail_bounds::{DetailBounds, diagonals_squared};
use super::{Slot, Tree};
use crate::scene::boxes64::{fold, lanes};
use crate::scene::draw_range::Detail;
use crate::scene::mesh_bounds::{holds_nearly, slack};

impl Tree {
    /// Returns the draw range, the HLOD parent and the children of an object, by its index; [`Detail::NONE`]
    /// if none were set.
    #[inline]
    pub(crate) fn detail(&self, index: usize) -> Detail {
        self.details.get(index).copied().unwrap_or(Detail::NONE)
    }

    /// Returns the slot of the HLOD parent that stands in for the object in a slot from the begin of the
    /// parent's draw range on. `None` if there is none, or if the parent cannot stand in: it is never culled,
    /// is not on all of the object's layers, or its bounds do not contain those of the object, up to
    /// rounding: a box may be enlarged to hold a mesh.
    #[inline]
    pub(crate) fn substitute(&self, slot: Slot) -> Option<Slot> {
        let parent = self.detail(self.ids[slot.node()][slot.lane()].index()).parent?;
        let above = *self.slots.get(parent.get() as usize - 1)?;
        if above == Slot::NONE || self.is_unculled(above) {
            return None;
        }
        let [layers, layers_above] = [slot, above].map(|slot| self.layers[slot.node()][slot.lane()]);
        let [bounds, around] = [slot, above].map(|slot| self.bounds_in(slot));
        (holds_nearly(&around, &bounds) && layers & !layers_above == 0).then_some(above)
    }

    /// Returns an upper bound on the distance of the eye, in metres, at which the object in a slot is still
    /// drawn; infinite for an object without a limit.
    fn draw_end(&self, slot: Slot) -> f32 {
        let end = self.detail(self.ids[slot.node()][slot.lane()].index()).range.end;
        let Some(above) = self.substitute(slot) else { return end };
        // While the object is drawn, the distance of its parent is at most the object's `end` and less than
        // the parent's `begin`. The parent contains the object, up to the slack, so the object is at most the
        // parent's diagonal and the slack farther away. The factor exceeds the rounding of the sum, of the
        // root and of the conversion to `f32`.
        let begin = self.detail(self.ids[above.node()][above.lane()].index()).range.begin;
        let bounds = self.bounds_in(above);
        let diagonal = (bounds.max.as_dvec3() - bounds.min.as_dvec3()).length();
        let diagonal = diagonal + slack(&bounds).as_dvec3().length();
        (((f64::from(end.min(begin)) + diagonal) * (1.0 + 1e-6)) as f32).next_up()
    }

    /// Returns bounds on the size and the draw distance of the objects below a leaf or inner node, computed
    /// from the node's present content.
    pub(super) fn measured(&self, node: usize) -> DetailBounds {
        if self.levels[node] > 0 && !self.is_unculled_leaf(node) {
            let below = lanes(self.occupied[node]).map(|lane| self.detail_bounds[self.child(node, lane)]);
            return below.fold(DetailBounds::NONE, DetailBounds::max);
        }
        let diagonals = diagonals_squared(&self.bounds[node]);
        let diagonal_squared = fold(&diagonals, 0.0, |a, b| if b > a { b } else { a });
        let undetailed = self.occupied[node] & !self.detailed[node];
        let end = lanes(self.detailed[node]).map(|lane| self.draw_end(Slot::new(node as u32, lane)));
        let end = if undetailed == 0 { end.fold(0.0, f32::max) } else { f32::INFINITY };
        DetailBounds { diagonal_squared, end }
    }

    /// Computes the mask of a leaf's objects that have a draw range, an HLOD parent or children, and the
    /// leaf's bounds on size and draw distance.
    pub(in crate::scene) fn measure_leaf(&mut self, leaf: usize) {
        let mask = if self.details.is_empty() { 0 } else { self.occupied[leaf] };
        let detailed = lanes(mask).filter(|&lane| self.detail(self.ids[leaf][lane].index()) != Detail::NONE);
        self.detailed[leaf] = detailed.fold(0, |mask, lane| mask | 1 << lane);
        self.detail_bounds[leaf] = self.measured(leaf);
    }

    /// Raises the bounds of the leaf of a slot, and of all nodes above, to cover the object in the slot, and
    /// marks the slot's lane if the object has details.
    pub(in crate::scene) fn raise_to_object(&mut self, slot: Slot) {
        let (node, lane) = (slot.node(), slot.lane());
        let mut bounds = DetailBounds {
            diagonal_squared: self.bounds[node].get(lane).diagonal_squared(),
            end: f32::INFINITY,
        };
        if !self.details.is_empty() {
            let is_detailed = self.detail(self.ids[node][lane].index()) != Detail::NONE;
            self.detailed[node] = self.detailed[node] & !(1 << lane) | u64::from(is_detailed) << lane;
            if is_detailed {
                bounds.end = self.draw_end(slot);
            }
        }
        self.raise(node as u32, bounds);
    }

    /// Raises the bounds of a node and of all nodes above it, stopping at the first that includes `bounds`
    /// already.
    pub(super) fn raise(&mut self, node: u32, bounds: DetailBounds) {
        let mut node = node as usize;
        loop {
            let raised = self.detail_bounds[node].max(bounds);
            if raised == self.detail_bounds[node] {
                return;
            }
            self.detail_bounds[node] = raised;
            let Some(above) = self.parent(node as u32) else { return };
            node = above.node();
        }
    }

    /// Computes the bounds on details of a node and of the nodes above it from their contents. Stops at the
    /// first node whose bounds do not change.
    pub(in crate::scene) fn lower(&mut self, node: u32) {
        let mut node = node as usize;
        loop {
            let measured = self.measured(node);
            if measured == self.detail_bounds[node] {
                return;
            }
            self.detail_bounds[node] = measured;
            let Some(above) = self.parent(node as u32) else { return };
            node = above.node();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::DrawRange;
    use crate::{Aabb, Object, ObjectId, Scene};
    use glam::Vec3;

    /// Returns a scene with a parent that is drawn from 100 m on, in a box of 10 m at `at`, and a child that
    /// reaches out of it by `out` on each axis.
    fn family(at: f32, out: f32) -> (Scene, [ObjectId; 2]) {
        let mut scene = Scene::new();
        let [low, high] = [Vec3::splat(at), Vec3::splat(at + 10.0)];
        let parent = scene.insert(Object::new(Aabb::new(low, high)));
        let child = scene.insert(Object::new(Aabb::new(low + 1.0, high + out)));
        scene.set_draw_range(parent, DrawRange { begin: 100.0, ..DrawRange::ALWAYS }).unwrap();
        scene.set_hlod_parent(child, Some(parent)).unwrap();
        (scene, [parent, child])
    }

    #[test]
    fn a_parent_stands_in_for_children_that_it_holds_and_shows() {
        let (mut scene, [parent, child]) = family(0.0, 0.0);
        let stands_in = |scene: &Scene| {
            let [above, own] = [parent, child].map(|id| scene.tree().slots[id.index()]);
            assert!(scene.tree().substitute(above).is_none(), "a parent has no parent");
            scene.tree().substitute(own).map(|slot| slot == above)
        };
        assert_eq!(stands_in(&scene), Some(true), "a parent around its child");
        scene.set_layers(parent, 5).unwrap();
        assert_eq!(stands_in(&scene), None, "a parent on fewer layers");
        scene.set_layers(child, 4).unwrap();
        assert_eq!(stands_in(&scene), Some(true), "a child on fewer layers");
        scene.set_never_cull(parent, true).unwrap();
        assert_eq!(stands_in(&scene), None, "a parent that is never culled");
        scene.set_never_cull(parent, false).unwrap();
        assert_eq!(stands_in(&scene), Some(true), "a parent that is culled again");
        scene.set_bounds(child, Aabb::from_arrays([0.0; 3], [10.1; 3])).unwrap();
        assert_eq!(stands_in(&scene), None, "a child that reaches out of its parent");
    }

    /// A child is drawn up to the distance at which its parent begins, and is farther away than its parent by
    /// the parent's diagonal, and by what the child may reach out of the parent's box.
    #[test]
    fn children_are_drawn_up_to_the_begin_of_their_parent() {
        for at in [0.0, 1e6] {
            let (mut scene, [parent, child]) = family(at, 0.0);
            let slack = slack(&scene.bounds(parent).unwrap()).as_dvec3().length();
            assert!(at == 0.0 || slack > 6.0, "a slack of {slack} m");
            let end = |scene: &Scene| f64::from(scene.tree().draw_end(scene.tree().slots[child.index()]));
            let farther = 300f64.sqrt() + slack;
            let up_to = |begin: f64, end: f64| {
                let exact = begin + farther;
                assert!(end >= exact && end < exact + 0.01, "{end} m, at least {exact} m, at {at}");
            };
            up_to(100.0, end(&scene));
            scene.set_draw_range(child, DrawRange { end: 50.0, ..DrawRange::ALWAYS }).unwrap();
            up_to(50.0, end(&scene));
            scene.set_hlod_parent(child, None).unwrap();
            assert_eq!(end(&scene), 50.0, "the child's own end, without a parent");
        }
    }

    /// Leaves of objects that are never culled are no inner nodes, whatever indices their objects have.
    #[test]
    fn leaves_of_unculled_objects_are_measured_by_their_objects() {
        let mut scene = Scene::new();
        let ids = scene.insert_batch([Aabb::from_arrays([0.0; 3], [1.0; 3]); 500]);
        let last = ids[499];
        scene.set_never_cull(last, true).unwrap();
        scene.set_draw_range(last, DrawRange { end: 7.0, ..DrawRange::ALWAYS }).unwrap();
        let leaf = scene.tree().slots[last.index()].node();
        let measured = scene.tree().measured(leaf);
        assert_eq!(measured.end, 7.0, "the only object of the leaf");
        assert!((measured.diagonal_squared - 3.0).abs() < 1e-6, "{measured:?}");
    }
}
