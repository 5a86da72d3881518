//! Numbers of cells and portals.

/// A cell of a [`CellGraph`](crate::cells::CellGraph), by its number.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct CellId(pub u32);

impl CellId {
    /// The number of the cell, to index arrays with.
    pub const fn index(self) -> usize {
        self.0 as usize
    }
}

/// A portal of a [`CellGraph`](crate::cells::CellGraph), by its number.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct PortalId(pub u32);

impl PortalId {
    /// The number of the portal, to index arrays with.
    pub const fn index(self) -> usize {
        self.0 as usize
    }
}
