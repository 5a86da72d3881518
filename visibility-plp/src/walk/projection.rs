//! Projection of a cell's layers: keeps each object at most once, until the budget is spent. An object is
//! kept if the visible set contains it and no test proves it outside of the view or facing away.

use super::state::{BATCH, Budget, Candidate, FrameContext, MAX_TESTED_TRIANGLES, Projected, Walk};
use crate::normal_bins::EyeSide;
use crate::tessellation::Tessellation;

impl Walk {
    /// Returns how many pending candidates (objects awaiting a budget check) certainly fit into the remaining
    /// budget. 0 for a budget by cost, since costs are unknown until each object is read; `usize::MAX` if
    /// `unlimited`.
    #[inline]
    fn affordable<T: ?Sized>(&self, frame: &FrameContext<'_, T>, unlimited: bool) -> usize {
        match frame.settings.budget {
            _ if unlimited => usize::MAX,
            Budget::Objects(_) => usize::try_from(self.budget_left).unwrap_or(usize::MAX),
            Budget::Cost(_) => 0,
        }
    }

    /// Checks the pending candidates: appends to `order` each object that is in the visible set and not
    /// proven outside of the view or facing away, and charges the budget for the object. Clears the
    /// candidates.
    ///
    /// Stops at the first object whose cost exceeds the remaining budget and returns
    /// [`Projected::OutOfBudget`]. Objects not appended then may become candidates again. With `unlimited`,
    /// the budget is neither checked nor charged.
    pub(crate) fn check_candidates<T: ?Sized>(
        &mut self,
        frame: &FrameContext<'_, T>,
        unlimited: bool,
    ) -> Projected {
        let candidates = self.candidates[..self.candidate_count].iter();
        self.candidate_count = 0;
        self.seen.clear();
        self.seen.extend(candidates.filter_map(|&Candidate { index, eye_side, crossed }| {
            frame.scene.id_at(index as usize).map(|id| (id, eye_side, crossed))
        }));
        let mut count = 0;
        for place in 0..self.seen.len() {
            self.seen[count] = self.seen[place];
            count += usize::from(frame.visible.contains(frame.scene, self.seen[count].0));
        }
        self.seen.truncate(count);
        self.remove_unseen(frame);
        for (place, &(id, ..)) in self.seen.iter().enumerate() {
            if !unlimited {
                let cost = frame.cost(id);
                if cost > self.budget_left {
                    for (id, ..) in &self.seen[place..] {
                        self.taken.remove(id.index());
                    }
                    return Projected::OutOfBudget;
                }
                self.budget_left -= cost;
            }
            self.order.push(id);
        }
        Projected::Complete
    }

    /// Tests the candidates in `seen` triangle by triangle and removes each object of at most
    /// [`MAX_TESTED_TRIANGLES`] triangles that is certainly invisible: all its triangles face away from the
    /// eye, or all lie outside of one view plane that the object's cell crosses. Undecided objects stay.
    fn remove_unseen<T: ?Sized>(&mut self, frame: &FrameContext<'_, T>) {
        // Triangles are copied before any of them is tested, so that cache misses overlap.
        self.tested.clear();
        for (place, &(id, eye_side, crossed)) in (0..).zip(&self.seen) {
            if (eye_side == EyeSide::Unknown || crossed != 0)
                && let Ok(triangles) = frame.scene.triangles(id)
                && triangles.len() <= MAX_TESTED_TRIANGLES
            {
                self.tested.extend(triangles.iter().map(|triangle| (place, triangle)));
            }
        }
        for of_one in self.tested.chunk_by(|a, b| a.0 == b.0) {
            let (_, eye_side, crossed) = &mut self.seen[of_one[0].0 as usize];
            let triangles = || of_one.iter().map(|(_, triangle)| triangle);
            let backs = *eye_side == EyeSide::Unknown && frame.frustum.sees_backs(triangles());
            if backs || frame.frustum.is_outside(triangles(), *crossed) {
                *eye_side = EyeSide::Back;
            }
        }
        if !self.tested.is_empty() {
            self.seen.retain(|&(_, eye_side, _)| eye_side != EyeSide::Back);
        }
    }

    /// Makes candidates of the objects in the next layer (group of similar objects) of one axis side of
    /// `cell`. Then removes the layer from the side's range, and the side from the cell if no layer is left.
    /// `side` is an index into `Walk::sides`. With `unlimited`, the budget is ignored.
    ///
    /// Checks the candidates against the visible set and the budget when the batch is full or the remaining
    /// budget may not cover them. Returns [`Projected::OutOfBudget`] if the budget ended among the
    /// candidates.
    pub(super) fn project<T: Tessellation + ?Sized>(
        &mut self,
        frame: &FrameContext<'_, T>,
        cell: u32,
        side: u32,
        unlimited: bool,
    ) -> Projected {
        let content = frame.tessellation.content();
        let crossed = self.cells[cell as usize].crossed;
        let remaining = self.sides[side as usize];
        let (from, to) = (remaining.from as usize, remaining.to as usize);
        let mut layers = content.sides(cell).layers(remaining.side, from, to);
        let layer = layers.next().unwrap_or_default();
        // All earlier candidates are within the budget.
        if self.candidate_count + layer.max_len() > self.affordable(frame, unlimited).min(BATCH) {
            self.check_candidates(frame, unlimited);
        }
        // No unpredictable branches: every object is written to the buffer, and the count only grows if the
        // object is new and does not face away.
        let box_from_eye = frame.box_from_eye(&frame.tessellation.cell_bounds(cell));
        let mut count = self.candidate_count;
        for index in layer {
            let Some(candidate) = self.candidates.get_mut(count) else { continue };
            let is_new = self.taken.insert(index as usize);
            let eye_side = box_from_eye.as_ref().map_or(EyeSide::Front, |cell| {
                content.normals.eye_side(index as usize, cell, &self.eye_offsets)
            });
            *candidate = Candidate { index, eye_side, crossed };
            count += usize::from(is_new & (eye_side != EyeSide::Back));
        }
        self.candidate_count = count;
        if count > self.affordable(frame, unlimited)
            && self.check_candidates(frame, unlimited) == Projected::OutOfBudget
        {
            return Projected::OutOfBudget;
        }
        if !self.sides[side as usize].advance(layers) {
            let state = &mut self.cells[cell as usize];
            state.end_side -= 1;
            self.sides.swap(side as usize, state.end_side as usize);
        }
        Projected::Complete
    }
}
