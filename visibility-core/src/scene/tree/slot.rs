//! Positions in the hierarchy: a node and one of its 64 lanes.

use crate::scene::FAN_OUT;

/// Node number that no node has.
pub(crate) const NONE: u32 = u32::MAX;

/// A lane of a node, encoded as `node * 64 + lane`.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Slot(pub(crate) u32);

impl Slot {
    /// No slot: of an object that is not in the scene, or of a node without parent.
    pub(crate) const NONE: Self = Self(NONE);

    pub(crate) fn new(node: u32, lane: usize) -> Self {
        Self(node * FAN_OUT as u32 + lane as u32)
    }

    pub(crate) fn node(self) -> usize {
        self.0 as usize / FAN_OUT
    }

    pub(crate) fn lane(self) -> usize {
        self.0 as usize % FAN_OUT
    }
}
