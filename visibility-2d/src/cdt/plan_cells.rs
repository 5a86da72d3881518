//! `PlanCells`: a floor plan as cells for visibility between moving objects.

use super::error::PlanError;
use super::plan::Plan;
use super::predicates::{MIN_MAGNITUDE, checked};
use super::region::RegionVisibility;
use super::wall::Opacity;
use alloc::{boxed::Box, vec::Vec};
use visibility_core::bits::Bits;
use visibility_core::stamp::Stamp;
use visibility_core::who_sees::{Reach, SightCells};

/// A floor plan as the cells of visibility between movers: its triangles are the cells. Doors may open and
/// close.
///
/// A mover is in the triangles that its box overlaps on the ground. Its reach does not pass through walls
/// that no line of sight passes, so a reach that sticks through a wall does not make the room behind visible.
/// A mover that is not entirely inside the rectangle around the plan sees all others and is seen by all.
///
/// The triangles seen from a triangle are computed when a mover first enters it, in 10 us to 1 ms, and kept
/// until a door changes, at 4 bytes per triangle seen. A mover sees everything that its triangles see, and
/// triangles are seen as a whole, so large triangles report more than needed. [Clear](Opacity::Clear) walls
/// along a grid of some metres make triangles smaller.
///
/// ```
/// use visibility_2d::cdt::{Opacity, Plan, PlanCells, Wall};
/// use visibility_core::glam::DVec3;
/// use visibility_core::who_sees::{Reach, WhoSees};
/// // Two rooms side by side, and a door between them.
/// let walls = [[0.0, 0.0, 8.0, 0.0], [8.0, 0.0, 8.0, 4.0], [8.0, 4.0, 0.0, 4.0], [0.0, 4.0, 0.0, 0.0],
///     [4.0, 0.0, 4.0, 3.0], [4.0, 3.0, 4.0, 4.0]];
/// let plan = Plan::new(&walls.map(|[a, b, c, d]| Wall::new([a, b], [c, d])))?;
/// let mut level = PlanCells::new(plan, [0, 1])?;
/// let at = |x: f64| Reach::new(DVec3::new(x, 1.0, 0.0), DVec3::new(x + 0.5, 1.5, 1.8)).within(0.1, 6.0);
/// let players = [at(3.2), at(6.0)];
/// let mut who = WhoSees::new();
/// who.look(&mut level, &players, &players);
/// assert!(!who.sees(0, 1), "the reach of player 0 sticks through the wall");
/// level.set_opacity(5, Opacity::Clear)?;
/// who.look(&mut level, &players, &players);
/// assert!(who.sees(0, 1));
/// # Ok::<(), visibility_2d::cdt::PlanError>(())
/// ```
#[derive(Clone, Debug)]
pub struct PlanCells {
    plan: Plan,
    /// Indices (0 to 2) of the world axes that are the plan's x and y.
    axes: [usize; 2],
    /// Stamp that changes with the opacity of walls.
    stamp: Stamp,
    /// For each triangle, the indices of the triangles seen from it. `None` until a mover has entered the
    /// triangle. An empty list if computing them would take too many steps: then everything counts as seen
    /// from the triangle.
    rows: Vec<Option<Box<[u32]>>>,
    /// Scratch: the triangles that the mover of the present call may be in.
    reached: RegionVisibility,
    /// Scratch: triangles seen from the present triangle.
    seen: RegionVisibility,
}

impl PlanCells {
    /// Makes cells from a plan. `axes` are the indices of the world axes of the plan's x and y: `[0, 1]` if z
    /// is up. Walls with [heights](super::Wall::heights) become clear, since movers may look over them.
    ///
    /// # Errors
    /// [`PlanError::Axes`] if an axis is above 2, or both are the same.
    pub fn new(mut plan: Plan, axes: [usize; 2]) -> Result<Self, PlanError> {
        if axes[0] > 2 || axes[1] > 2 || axes[0] == axes[1] {
            return Err(PlanError::Axes { axes });
        }
        for wall in 0..plan.walls().len() as u32 {
            if !plan.walls()[wall as usize].is_endless() {
                // The wall exists, so this cannot fail.
                _ = plan.set_opacity(wall, Opacity::Clear);
            }
        }
        let rows = alloc::vec![None; plan.triangle_count()];
        let (reached, seen) = (RegionVisibility::new(), RegionVisibility::new());
        Ok(Self { plan, axes, stamp: Stamp::new(), rows, reached, seen })
    }

    /// Returns the plan.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Changes the opacity of a wall, like [`Plan::set_opacity`]. A wall with heights stays clear.
    ///
    /// # Errors
    /// [`PlanError::UnknownWall`] if the plan has no wall of that number.
    pub fn set_opacity(&mut self, wall: u32, opacity: Opacity) -> Result<(), PlanError> {
        if self.plan.walls().get(wall as usize).is_some_and(|wall| !wall.is_endless()) {
            return Ok(());
        }
        let before = self.plan.stamp();
        self.plan.set_opacity(wall, opacity)?;
        if self.plan.stamp() != before {
            self.stamp = Stamp::new();
            self.rows.fill(None);
        }
        Ok(())
    }

    /// Finds the triangles that a mover may be in, and stores them in `self.reached`. False if it may be
    /// outside the plan.
    fn find(&mut self, reach: &Reach) -> bool {
        let corners = |reach: &Reach| {
            // A plan rounds small coordinates to 0, so such bounds are moved outwards.
            let outward = |x: f64, least: f64| if x.abs() < MIN_MAGNITUDE { least } else { x };
            let [low, high] = reach.bounds();
            let low = self.axes.map(|axis| outward(low[axis], -MIN_MAGNITUDE));
            let high = self.axes.map(|axis| outward(high[axis], MIN_MAGNITUDE));
            let corners = [low, [high[0], low[1]], high, [low[0], high[1]]];
            corners.iter().all(|&p| checked(p, 0).is_ok()).then_some(corners)
        };
        let body = corners(&Reach { margin: 0.0, ..*reach });
        let (Some(body), Some(outer)) = (body, corners(reach)) else { return false };
        self.plan.reached(&body, &outer, &mut self.reached).is_ok() && !self.reached.triangles().is_empty()
    }
}

impl SightCells for PlanCells {
    fn cell_count(&self) -> usize {
        self.plan.triangle_count()
    }

    fn stamp(&self) -> Stamp {
        self.stamp
    }

    fn cells_of(&mut self, reach: &Reach, cells: &mut Vec<u32>) -> bool {
        let is_known = self.find(reach);
        cells.extend_from_slice(self.reached.triangles());
        is_known
    }

    fn seen_from(&mut self, reach: &Reach, seen: &mut Bits) -> bool {
        if !self.find(reach) {
            return false;
        }
        for &triangle in self.reached.triangles() {
            let row = self.rows[triangle as usize].get_or_insert_with(|| {
                let found = self.plan.look_from_triangle(triangle, &mut self.seen);
                found.map_or_else(|_| Box::default(), |()| self.seen.triangles().into())
            });
            if row.is_empty() {
                return false;
            }
            row.iter().for_each(|&triangle| _ = seen.insert(triangle as usize));
        }
        true
    }
}
