//! Projection of a cell's layers: looks up each object once, and gives it a priority of its own. An object is
//! looked up if the visible set contains it and no test proves it outside of the view or facing away.

use super::state::{FrameContext, Keep, LayerObject, MAX_TESTED_TRIANGLES, Projected, Walk};
use crate::normal_bins::EyeSide;
use crate::solidity::{Solidity, free_share, priority_factor};
use crate::tessellation::Tessellation;
use visibility_core::ObjectId;
use visibility_core::glam::DVec3;
use visibility_core::view::Eye;

impl Walk {
    /// Looks up the first `count` of `layer_objects`: pushes each object that is in the visible set and not
    /// proven outside of the view or facing away to `ready`, with its priority. `crossed` has one bit for
    /// each view plane that the objects' cell may cross, `chance` is the estimated probability that view rays
    /// reach that cell, and `area` the mean area of the objects' layer in square metres.
    fn look_up<T: Tessellation + ?Sized>(
        &mut self,
        frame: &FrameContext<'_, T>,
        count: usize,
        crossed: u16,
        chance: f32,
        area: f32,
    ) {
        let objects = self.layer_objects.iter().take(count);
        self.seen.clear();
        self.seen.extend(objects.filter_map(|&LayerObject { index, eye_side }| {
            frame.scene.id_at(index as usize).map(|id| (id, eye_side))
        }));
        let mut count = 0;
        for place in 0..self.seen.len() {
            self.seen[count] = self.seen[place];
            count += usize::from(frame.visible.contains(frame.scene, self.seen[count].0));
        }
        self.seen.truncate(count);
        // Triangles are copied before any of them is tested, so that cache misses overlap.
        self.tested.clear();
        for (place, &(id, _)) in (0..).zip(&self.seen) {
            if let Ok(triangles) = frame.scene.triangles(id)
                && triangles.len() <= MAX_TESTED_TRIANGLES
            {
                self.tested.extend(triangles.iter().map(|triangle| (place, triangle)));
            }
        }
        let mut rest = &self.tested[..];
        for (place, &(id, eye_side)) in (0..).zip(&self.seen) {
            let (own, others) = rest.split_at(rest.iter().take_while(|tested| tested.0 == place).count());
            rest = others;
            let triangles = || own.iter().map(|(_, triangle)| triangle);
            if !own.is_empty() {
                let backs = eye_side == EyeSide::Unknown
                    && frame.frustum.sees_backs(triangles())
                    && frame.scene.triangles(id).is_ok_and(|all| all.has_certain_fronts());
                if backs || frame.frustum.is_outside(triangles(), crossed) {
                    continue;
                }
            }
            let priority = match frame.settings.solidity {
                Solidity::Coverage => {
                    let (angle, distance) = match frame.frustum.eye {
                        Eye::Direction(_) => (f32::INFINITY, f32::INFINITY),
                        Eye::Point(eye) if own.is_empty() => appearance_of_box(frame, eye, id, area),
                        Eye::Point(eye) => frame.frustum.appearance(eye, triangles()),
                    };
                    let openness = frame.tessellation.content().openness(id);
                    chance * priority_factor(angle) * free_share(openness, distance / frame.far())
                }
                Solidity::Count => 1.0,
            };
            self.ready.push(priority, id);
        }
    }

    /// Looks up the objects in the next layer (group of similar objects) of one axis side of `cell`, and
    /// pushes them to `ready`. Then removes the layer from the side's range, and the side from the cell if no
    /// layer is left. `side` is an index into `Walk::sides`.
    pub(super) fn project<T: Tessellation + ?Sized>(
        &mut self,
        frame: &FrameContext<'_, T>,
        cell: u32,
        side: u32,
    ) {
        let content = frame.tessellation.content();
        let crossed = self.cells[cell as usize].crossed;
        let chance = self.cells[cell as usize].chance(frame.settings.solidity);
        let remaining = self.sides[side as usize];
        let (from, to) = (remaining.from as usize, remaining.to as usize);
        let mut layers = content.sides(cell).layers(remaining.side, from, to);
        let layer = layers.next().unwrap_or_default();
        let area = layer.class.area();
        // No unpredictable branches: every object is written to the buffer, and the count only grows if the
        // object is new and does not face away.
        let box_from_eye = frame.box_from_eye(&frame.tessellation.cell_bounds(cell));
        let mut count = 0;
        for index in layer {
            let Some(object) = self.layer_objects.get_mut(count) else { continue };
            let is_new = self.taken.insert(index as usize);
            let eye_side = box_from_eye.as_ref().map_or(EyeSide::Front, |cell| {
                content.normals.eye_side(index as usize, cell, &self.eye_offsets)
            });
            *object = LayerObject { index, eye_side };
            count += usize::from(is_new & (eye_side != EyeSide::Back));
        }
        self.look_up(frame, count, crossed, chance, area);
        if !self.sides[side as usize].advance(layers) {
            let state = &mut self.cells[cell as usize];
            state.end_side -= 1;
            self.sides.swap(side as usize, state.end_side as usize);
        }
    }

    /// Moves objects from `ready` to `order`, highest priority first, down to the priority `bound`, and
    /// charges the budget. Stops at the first object whose cost exceeds the remaining budget or for which
    /// `keep` returns false, and returns [`Projected::OutOfBudget`]. A budget above 0 of which nothing is
    /// spent admits one object of any cost.
    pub(crate) fn emit<T: ?Sized>(
        &mut self,
        frame: &FrameContext<'_, T>,
        bound: f32,
        keep: Keep<'_>,
    ) -> Projected {
        while let Some((id, priority)) = self.ready.peek(bound) {
            let cost = frame.cost(id);
            let left = frame.settings.budget.amount().saturating_sub(self.spent);
            let is_unspent = left > 0 && self.spent == 0;
            if cost > left && !is_unspent || !keep(id, priority) {
                return Projected::OutOfBudget;
            }
            self.spent = self.spent.saturating_add(cost);
            self.order.push(id);
            self.ready.pop();
        }
        Projected::Complete
    }
}

/// Returns the solid angle in steradians that an object of `area` square metres of surface covers on average
/// over all orientations, and the distance in metres from the eye to the object's bounds.
fn appearance_of_box<T: ?Sized>(
    frame: &FrameContext<'_, T>,
    eye: DVec3,
    id: ObjectId,
    area: f32,
) -> (f32, f32) {
    let Ok(bounds) = frame.scene.bounds(id) else { return (f32::INFINITY, 0.0) };
    let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
    let from_center = eye.distance_squared((min + max) * 0.5) as f32;
    (0.5 * area / from_center.max(area), frame.frustum.distance(&bounds))
}
