//! What is left of the cells that were opened, by the side that it faces, and which of that is worth most.

use super::{Stage, Walk};
use crate::Tessellation;
use crate::layers::{Layer, Layers};
use crate::solidity::{shown, worth};
use crate::surface_class::ANY_SIDE;
use visibility_core::Aabb;

/// What is not projected yet of one side of a cell.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rest {
    /// What part of its light its first layer is worth.
    pub(super) worth: f32,
    /// The solid angle that a square metre takes up.
    nearness: f32,
    /// Where it begins and ends, in bytes from the end of the list.
    pub(super) from: u32,
    pub(super) to: u32,
    pub(super) facing: u8,
}

/// What is seen in spite of all that was found before it.
const LEAST: f32 = 0.02;

/// More sides than there are ever.
pub(super) const ALL: u32 = u32::MAX;

impl Rest {
    /// Goes on with these layers. False if there is none.
    #[inline]
    pub(super) fn look(&mut self, mut layers: Layers<'_>) -> bool {
        self.from = self.to + layers.len() as u32;
        let next = layers.next();
        let worth = |Layer { class, .. }| worth(class.area() * self.nearness) * (class.openness() + LEAST);
        self.worth = next.clone().map_or(0.0, worth);
        next.is_some()
    }
}

impl Walk {
    /// Opens a cell if that was not done yet.
    #[inline]
    pub(super) fn open_late<T: Tessellation + ?Sized>(&mut self, stage: &Stage<'_, T>, cell: u32) {
        if self.cells[cell as usize].to == ALL {
            self.open(stage, cell, &stage.tessellation.cell_bounds(cell));
        }
    }

    /// Opens a cell with that box: looks up what it holds, by the side that it faces. Once, and not if it holds nothing.
    #[inline]
    pub(super) fn open<T: Tessellation + ?Sized>(&mut self, stage: &Stage<'_, T>, cell: u32, bounds: &Aabb) {
        let known = &mut self.cells[cell as usize];
        if known.to != ALL {
            return;
        }
        known.from = self.sides.len() as u32;
        let shown = shown(known.direction, known.is_around(), stage.rules.one_sided);
        let content = stage.tessellation.content();
        let toward = stage.toward(bounds);
        let mut sides = content.sides(cell);
        while let Some(layers) = sides.next() {
            if toward.as_ref().is_some_and(|toward| layers.is_back(toward)) {
                continue;
            }
            let nearness = known.nearness * shown[usize::from(layers.facing.min(ANY_SIDE))];
            let (facing, to) = (layers.facing, sides.len());
            let from = to + layers.len();
            let mut rest = Rest { worth: 0.0, nearness, from: from as u32, to: to as u32, facing };
            if rest.look(layers) {
                self.sides.push(rest);
            }
        }
        known.to = self.sides.len() as u32;
    }

    /// Which side of a cell shows most with its next layer, and how much that is worth; none when nothing is left of the cell.
    #[inline]
    pub(super) fn best_side(&self, cell: u32) -> Option<(u32, f32)> {
        let known = &self.cells[cell as usize];
        let mut best = None;
        for side in known.from..known.to {
            let worth = self.sides[side as usize].worth;
            if best.is_none_or(|(_, most)| worth > most) {
                best = Some((side, worth));
            }
        }
        best
    }
}
