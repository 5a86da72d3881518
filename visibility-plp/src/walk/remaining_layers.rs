//! Layers (groups of similar objects) of an opened cell that are not projected yet, one range per axis side,
//! and the choice of the side whose next layer has the highest priority.

use super::state::{FrameContext, RemainingLayers, UNOPENED, Walk};
use crate::layers::{Layer, Layers};
use crate::solidity::{free_share, priority_factor, side_factors};
use crate::surface_class::ANY_SIDE;
use crate::tessellation::Tessellation;
use visibility_core::Aabb;

/// Priority of the best objects of a layer, in units of the priority of its mean object. The objects of a
/// layer differ by a factor of up to four in area times openness, so the best have about twice the mean. A
/// layer is looked up when its best objects may be next.
const BEST_OF_LAYER: f32 = 2.0;

impl RemainingLayers {
    /// Advances this side past its first remaining layer of objects: the range becomes `layers`, the layers
    /// after the first, and `priority` is recomputed from their first layer. Returns false if no
    /// layer is left; `priority` is then 0.
    #[inline]
    pub(super) fn advance(&mut self, mut layers: Layers<'_>) -> bool {
        self.from = self.to + layers.byte_count() as u32;
        let next = layers.next();
        let priority = |Layer { class, .. }| {
            let angle = class.area() * self.solid_angle_per_area;
            BEST_OF_LAYER * priority_factor(angle) * free_share(class.openness(), self.distance)
        };
        self.priority = next.clone().map_or(0.0, priority);
        next.is_some()
    }
}

impl Walk {
    /// Appends the axis sides of a cell's object list to `sides` like [`open`](Self::open), for a cell whose
    /// box is not at hand. Does nothing if this frame has already done so for the cell.
    #[inline]
    pub(super) fn open_if_needed<T: Tessellation + ?Sized>(
        &mut self,
        frame: &FrameContext<'_, T>,
        cell: u32,
    ) {
        if self.cells[cell as usize].end_side == UNOPENED {
            self.open(frame, cell, &frame.tessellation.cell_bounds(cell));
        }
    }

    /// Appends the axis sides (plus or minus x, y or z, or none) that the objects of a cell face to `sides`,
    /// and stores their range in the cell's state. Does nothing if this frame has already done so for the
    /// cell. If back faces are culled, sides whose triangles all certainly face away from the eye are left
    /// out. `bounds` is the cell's box, relative to the scene's origin.
    #[inline]
    pub(super) fn open<T: Tessellation + ?Sized>(
        &mut self,
        frame: &FrameContext<'_, T>,
        cell: u32,
        bounds: &Aabb,
    ) {
        let state = &mut self.cells[cell as usize];
        if state.end_side != UNOPENED {
            return;
        }
        state.first_side = self.sides.len() as u32;
        let factors = side_factors(state.direction, state.is_around_eye(), frame.settings.one_sided);
        let box_from_eye = frame.box_from_eye(bounds);
        let distance = frame.frustum.distance(bounds) / frame.far();
        let mut sides = frame.tessellation.content().sides(cell);
        while let Some(layers) = sides.next() {
            if box_from_eye.as_ref().is_some_and(|cell| layers.is_back(cell)) {
                continue;
            }
            let factor = factors[usize::from(layers.side.min(ANY_SIDE))];
            let (side, to) = (layers.side, sides.byte_count());
            let from = to + layers.byte_count();
            let solid_angle_per_area = state.solid_angle_per_area * factor;
            let (from, to) = (from as u32, to as u32);
            let mut remaining =
                RemainingLayers { distance, priority: 0.0, solid_angle_per_area, from, to, side };
            if remaining.advance(layers) {
                self.sides.push(remaining);
            }
        }
        state.end_side = self.sides.len() as u32;
    }

    /// Returns the axis side of a cell whose next layer of objects has the highest priority: its index into
    /// `sides`, and that priority (about 0 to 1). Equal priorities choose the first side. `None` if the cell
    /// has no layers left. The cell's sides must have been looked up by [`open`](Self::open).
    #[inline]
    pub(super) fn best_side(&self, cell: u32) -> Option<(u32, f32)> {
        let state = &self.cells[cell as usize];
        let mut best = None;
        for side in state.first_side..state.end_side {
            let priority = self.sides[side as usize].priority;
            if best.is_none_or(|(_, most)| priority > most) {
                best = Some((side, priority));
            }
        }
        best
    }
}
