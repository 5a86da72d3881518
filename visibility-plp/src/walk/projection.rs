//! What is projected of the cells: objects once each, that are in the set and not surely out of sight, as far as the budget lasts.

use super::{Budget, Projected, Stage, Walk, clear};
use crate::Tessellation;
use crate::facing::Side;
use visibility_core::ObjectId;

/// An object, on which side of it the eye is, and which planes its cell crosses.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sifted {
    index: u32,
    side: Side,
    crossed: u16,
}

impl Sifted {
    pub(super) const NONE: Self = Self { index: 0, side: Side::Unknown, crossed: 0 };
}

/// So many objects are looked up together: memory is slow, but answers many at once.
pub(super) const BATCH: usize = 256;

/// More triangles than this are not looked at to find that an object turns its back or lies outside the view.
pub(super) const FEW: usize = 4;

impl Walk {
    /// What an object takes of the budget.
    pub(super) fn cost<T: ?Sized>(&self, stage: &Stage<'_, T>, id: ObjectId) -> u64 {
        match stage.rules.budget {
            Budget::Objects(_) => 1,
            Budget::Cost(_) => stage.scene.object(id).map_or(0, |object| object.cost.into()),
        }
    }

    /// How many objects are surely within the budget.
    #[inline]
    fn may_wait<T: ?Sized>(&self, stage: &Stage<'_, T>, unlimited: bool) -> usize {
        match stage.rules.budget {
            _ if unlimited => usize::MAX,
            Budget::Objects(_) => usize::try_from(self.left).unwrap_or(usize::MAX),
            Budget::Cost(_) => 0,
        }
    }

    /// Projects what waits, as far as the budget lasts: those objects that are in the set and not surely out of sight.
    pub(crate) fn settle<T: ?Sized>(&mut self, stage: &Stage<'_, T>, unlimited: bool) -> Projected {
        let waiting = self.sifted[..self.waiting].iter();
        self.waiting = 0;
        self.seen.clear();
        self.seen.extend(waiting.filter_map(|&Sifted { index, side, crossed }| {
            stage.scene.id_at(index as usize).map(|id| (id, side, crossed))
        }));
        let mut count = 0;
        for place in 0..self.seen.len() {
            self.seen[count] = self.seen[place];
            count += usize::from(stage.visible.contains(stage.scene, self.seen[count].0));
        }
        self.seen.truncate(count);
        self.turn_away(stage);
        for (place, &(id, ..)) in self.seen.iter().enumerate() {
            if !unlimited {
                let cost = self.cost(stage, id);
                if cost > self.left {
                    for (id, ..) in &self.seen[place..] {
                        clear(&mut self.taken, id.index() as u32);
                    }
                    return Projected::Cut;
                }
                self.left -= cost;
            }
            self.order.push(id);
        }
        Projected::Whole
    }

    /// Takes objects of few triangles that are surely out of sight from those at hand.
    fn turn_away<T: ?Sized>(&mut self, stage: &Stage<'_, T>) {
        // Triangles are copied before any is looked at, again for the sake of memory.
        self.asked.clear();
        for (place, &(id, side, crossed)) in (0..).zip(&self.seen) {
            if (side == Side::Unknown || crossed != 0)
                && let Ok(triangles) = stage.scene.triangles(id)
                && triangles.len() <= FEW
            {
                self.asked.extend(triangles.iter().map(|triangle| (place, *triangle)));
            }
        }
        for of_one in self.asked.chunk_by(|a, b| a.0 == b.0) {
            let (_, side, crossed) = &mut self.seen[of_one[0].0 as usize];
            let triangles = || of_one.iter().map(|(_, triangle)| triangle);
            let backs = *side == Side::Unknown && stage.sight.sees_backs(triangles());
            if backs || stage.sight.is_outside(triangles(), *crossed) {
                *side = Side::Back;
            }
        }
        if !self.asked.is_empty() {
            self.seen.retain(|&(_, side, _)| side != Side::Back);
        }
    }

    /// Projects the next layer of a side of a cell, each object once, as far as the budget lasts.
    pub(super) fn project<T: Tessellation + ?Sized>(
        &mut self,
        stage: &Stage<'_, T>,
        cell: u32,
        side: u32,
        unlimited: bool,
    ) -> Projected {
        let content = stage.tessellation.content();
        let crossed = self.cells[cell as usize].crossed;
        let rest = self.sides[side as usize];
        let mut layers = content.sides(cell).layers(rest.facing, rest.from as usize, rest.to as usize);
        let layer = layers.next().unwrap_or_default();
        // What waits is within the budget, whatever becomes of it.
        if self.waiting + layer.most() > self.may_wait(stage, unlimited).min(BATCH) {
            self.settle(stage, unlimited);
        }
        // Without branches on what cannot be foretold: every object is written down, and counts if it is new and does not turn its back.
        let toward = stage.toward(&stage.tessellation.cell_bounds(cell));
        let mut count = self.waiting;
        for index in layer {
            let (place, mark) = (index as usize / 64, 1u64 << (index % 64));
            let (Some(word), Some(sifted)) = (self.taken.get_mut(place), self.sifted.get_mut(count)) else {
                continue;
            };
            let is_new = *word & mark == 0;
            *word |= mark;
            let side = toward
                .as_ref()
                .map_or(Side::Front, |toward| content.facing.side(index as usize, toward, &self.planes));
            *sifted = Sifted { index, side, crossed };
            count += usize::from(is_new & (side != Side::Back));
        }
        self.waiting = count;
        if count > self.may_wait(stage, unlimited) && self.settle(stage, unlimited) == Projected::Cut {
            return Projected::Cut;
        }
        if !self.sides[side as usize].look(layers) {
            let known = &mut self.cells[cell as usize];
            known.to -= 1;
            self.sides.swap(side as usize, known.to as usize);
        }
        Projected::Whole
    }
}
