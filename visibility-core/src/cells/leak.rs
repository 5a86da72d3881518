//! The shortest chain of portals from a cell to an outside cell, to find where a map that is meant to be
//! closed is not.

use super::{CellGraph, CellId, PortalId};
use alloc::collections::VecDeque;
use alloc::vec::Vec;
use core::fmt;

/// A chain of portals from a cell to one that it should not lead to; no other has fewer portals.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Leak {
    /// The cell that it begins in.
    pub from: CellId,
    /// The cell that it ends in.
    pub to: CellId,
    /// The portals in order. Empty if `from` is itself an outside cell.
    pub portals: Vec<PortalId>,
}

impl fmt::Display for Leak {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "cell {} leaks to cell {}", self.from.0, self.to.0)?;
        for (i, portal) in self.portals.iter().enumerate() {
            write!(f, "{}{}", if i == 0 { " through portals " } else { ", " }, portal.0)?;
        }
        Ok(())
    }
}

impl core::error::Error for Leak {}

impl CellGraph {
    /// Finds the chain with the fewest portals from a cell to any cell that `outside` accepts. `None` if
    /// there is none, or no cell `from`. Takes time and memory in proportion to cells and portals.
    ///
    /// ```
    /// use visibility_core::{
    ///     cells::{CellGraph, CellId, PortalId}, geometry::ConvexPolygon, glam::DVec3,
    /// };
    /// let corners = [[1.0, 0.0], [2.0, 0.0], [2.0, 2.0], [1.0, 2.0]];
    /// let door = |x: f64| ConvexPolygon::new(corners.map(|[y, z]| DVec3::new(x, y, z)));
    /// let doors = [(door(4.0)?, [CellId(0), CellId(1)]), (door(8.0)?, [CellId(1), CellId(2)])];
    /// let graph = CellGraph::new(4, doors)?;
    /// let leak = graph.leak(CellId(0), |cell| cell == CellId(2)).unwrap();
    /// assert_eq!(leak.to_string(), "cell 0 leaks to cell 2 through portals 0, 1");
    /// assert_eq!(graph.leak(CellId(0), |cell| cell == CellId(3)), None);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn leak(&self, from: CellId, outside: impl Fn(CellId) -> bool) -> Option<Leak> {
        if from.index() >= self.cell_count() {
            return None;
        }
        // By cell, the portal that it was reached through.
        let mut through: Vec<Option<PortalId>> = alloc::vec![None; self.cell_count()];
        let mut known = alloc::vec![false; self.cell_count()];
        known[from.index()] = true;
        let mut queue = VecDeque::from([from]);
        while let Some(cell) = queue.pop_front() {
            if outside(cell) {
                let (mut portals, mut at) = (Vec::new(), cell);
                while let Some(portal) = through[at.index()] {
                    portals.push(portal);
                    at = self.portals[portal.index()].other(at);
                }
                portals.reverse();
                return Some(Leak { from, to: cell, portals });
            }
            for &portal in self.portals_of(cell) {
                let next = self.portals[portal.index()].other(cell);
                if !core::mem::replace(&mut known[next.index()], true) {
                    through[next.index()] = Some(portal);
                    queue.push_back(next);
                }
            }
        }
        None
    }
}
