//! State of the portals that act as doors: whether each portal is open, and in which directions it can be
//! seen through.

use alloc::vec::Vec;
use visibility_core::cells::PortalId;

/// The directions in which an open portal can be seen through. The first and second cell of a portal are
/// those of `Portal::cells`; the portal's normal points from the first into the second.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Hash, Default)]
pub enum Passage {
    /// Both directions: each cell of the portal can be seen from the other cell.
    #[default]
    BothWays,
    /// Only the portal's second cell can be seen from its first cell: along the portal's normal.
    Forward,
    /// Only the portal's first cell can be seen from its second cell: against the portal's normal.
    Backward,
}

/// Bit of a portal whose second cell can be seen from its first cell while it is open.
const FORWARD: u8 = 1;
/// Bit of a portal whose first cell can be seen from its second cell while it is open.
const BACKWARD: u8 = 2;
/// Bit of a portal that is closed: nothing is seen through it.
const CLOSED: u8 = 4;

/// State of all portals of a graph: whether each portal is open, and in which directions it can be seen
/// through.
#[derive(Clone, Debug)]
pub(super) struct Doors {
    /// One byte per portal, by portal index: the bits `FORWARD` and `BACKWARD` for the passage, and
    /// `CLOSED`.
    flags: Vec<u8>,
}

impl Doors {
    /// Returns the state of a graph with `portals` portals, all open in both directions.
    pub(super) fn new(portals: usize) -> Self {
        Self { flags: alloc::vec![FORWARD | BACKWARD; portals] }
    }

    /// Opens (`open` true) or closes (false) a portal; its passage (the directions in which it can be seen
    /// through) is kept. Returns `false`, and changes nothing, if the portal is unknown.
    pub(super) fn set_open(&mut self, portal: PortalId, open: bool) -> bool {
        let Some(flags) = self.flags.get_mut(portal.index()) else { return false };
        *flags = if open { *flags & !CLOSED } else { *flags | CLOSED };
        true
    }

    /// Tests whether a portal is open, whatever its passage (the directions in which it can be seen through).
    /// `false` if the portal is unknown.
    pub(super) fn is_open(&self, portal: PortalId) -> bool {
        self.flags.get(portal.index()).is_some_and(|flags| flags & CLOSED == 0)
    }

    /// Sets the directions in which a portal can be seen through while it is open; a closed portal stays
    /// closed. Returns `false`, and changes nothing, if the portal is unknown.
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

    /// Tests whether a portal is open and can be seen through in one direction: along its normal if `forward`
    /// is true, against its normal if false. `false` if the portal is unknown.
    pub(super) fn passes(&self, portal: PortalId, forward: bool) -> bool {
        let side = if forward { FORWARD } else { BACKWARD };
        self.flags.get(portal.index()).is_some_and(|flags| flags & (CLOSED | side) == side)
    }
}
