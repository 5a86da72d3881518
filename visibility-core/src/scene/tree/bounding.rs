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
