//! Ids of cells and portals.

/// Number of a cell in its [`CellGraph`](crate::cells::CellGraph), from 0.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct CellId(pub u32);

impl CellId {
    /// Returns the number of the cell as an array index.
    pub const fn index(self) -> usize {
        self.0 as usize
    }
}

/// Number of a portal in its [`CellGraph`](crate::cells::CellGraph), from 0.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct PortalId(pub u32);

impl PortalId {
    /// Returns the number of the portal as an array index.
    pub const fn index(self) -> usize {
        self.0 as usize
    }
}
