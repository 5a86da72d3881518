//! Doors: which portals are open now, and from which sides one can see through them.

use alloc::vec::Vec;
use visibility_core::cells::PortalId;

/// The directions in which an open portal can be seen through.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Hash, Default)]
pub enum Passage {
    /// From either of its cells into the other.
    #[default]
    BothWays,
    /// Along its normal: from the first of its cells into the second.
    Forward,
    /// Against its normal: from the second of its cells into the first.
    Backward,
}

const FORWARD: u8 = 1;
const BACKWARD: u8 = 2;
const CLOSED: u8 = 4;

/// Whether each portal is open, and its passage.
#[derive(Clone, Debug)]
pub(super) struct Doors {
    /// By portal: `FORWARD`, `BACKWARD` and `CLOSED`, as bits.
    flags: Vec<u8>,
}

impl Doors {
    /// All portals open, both ways.
    pub(super) fn new(portals: usize) -> Self {
        Self { flags: alloc::vec![FORWARD | BACKWARD; portals] }
    }

    /// Opens or closes a portal. False for an unknown one.
    pub(super) fn set_open(&mut self, portal: PortalId, open: bool) -> bool {
        let Some(flags) = self.flags.get_mut(portal.index()) else { return false };
        *flags = if open { *flags & !CLOSED } else { *flags | CLOSED };
        true
    }

    /// Whether a portal is open, from either side; false for an unknown one.
    pub(super) fn is_open(&self, portal: PortalId) -> bool {
        self.flags.get(portal.index()).is_some_and(|flags| flags & CLOSED == 0)
    }

    /// Says from which sides one can see through a portal while it is open. False for an unknown one.
    pub(super) fn set_passage(&mut self, portal: PortalId, passage: Passage) -> bool {
        let Some(flags) = self.flags.get_mut(portal.index()) else { return false };
        let sides = match passage {
            Passage::BothWays => FORWARD | BACKWARD,
            Passage::Forward => FORWARD,
            Passage::Backward => BACKWARD,
        };
        *flags = *flags & CLOSED | sides;
        true
    }

    /// Whether one can now see through a portal, along its normal or against it; false for an unknown one.
    pub(super) fn passes(&self, portal: PortalId, forward: bool) -> bool {
        let side = if forward { FORWARD } else { BACKWARD };
        self.flags.get(portal.index()).is_some_and(|flags| flags & (CLOSED | side) == side)
    }
}
