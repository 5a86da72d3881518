//! Search for the shortest chain of portals from a cell to an outside cell, which shows where a map that is
//! meant to be closed has a hole.

use super::{CellGraph, CellId, PortalId};
use alloc::collections::VecDeque;
use alloc::vec::Vec;
use core::fmt;

/// A chain of portals from a cell to a cell that should not be reachable, with the fewest portals possible.
/// Found by [`CellGraph::leak`].
#[derive(Clone, PartialEq, Eq, Debug)]
#[non_exhaustive]
pub struct Leak {
    /// The cell in which the chain begins, as given to [`CellGraph::leak`].
    pub from: CellId,
    /// The cell in which the chain ends, accepted by the `outside` of [`CellGraph::leak`].
    pub to: CellId,
    /// The portals of the chain in order from `from` to `to`. Empty if `from` equals `to`.
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
    /// Returns a chain with the fewest portals from the cell `from` to any cell for which `outside` returns
    /// true. `None` if no such cell can be reached, or if `from` is unknown. Time and memory are linear in
    /// the numbers of cells and portals.
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
        // For each cell, the portal through which the search reached the cell first.
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
