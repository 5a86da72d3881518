//! Growth of a virtual occluder along a line behind a seed, the solid that the line was laid behind.

use super::cell_solids::{CellBox, CellSolids};
use super::chain::{BackLine, Chain, Task, WIDEST};
use super::lines::Point;

/// Distance beyond the end of a chain's reach at which the next chain is tried, as a fraction of the line's
/// distance from the viewcell. After a failure, a quarter of the distance is tried.
const STEP: f64 = 1.0 / 32.0;
const TRIES: u32 = 5;

/// Maximum number of chains by which a segment grows to each side of its middle.
const CHAINS: usize = 256;

/// Segment on the plan that no line of sight from the viewcell reaches, as long as the line of sight rises by
/// at most `slope` metres per metre on the plan and stays above the height `bottom`.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Grown {
    /// Ends of the segment. As seen from the viewcell, the first is counter-clockwise of the second.
    pub(crate) ends: [Point; 2],
    /// Height in metres at which the solids of the chains begin to occlude. Lines of sight that pass lower
    /// are not known to be hidden.
    pub(crate) bottom: f64,
    pub(crate) slope: f64,
    /// Bound in metres on the distance between the hidden segment and the straight one between `ends`.
    pub(crate) error: f64,
}

impl Grown {
    /// Returns the distance between the ends.
    pub(crate) fn width(&self) -> f64 {
        let [a, b] = self.ends;
        visibility_core::geometry::sqrt((b.x - a.x) * (b.x - a.x) + (b.y - a.y) * (b.y - a.y))
    }
}

/// Finds the widest segment around the middle of a line that is hidden from a viewcell. `None` if the middle
/// itself is not hidden.
pub(crate) fn grow(
    chain: &mut Chain,
    solids: &mut CellSolids,
    cell: &CellBox,
    line: BackLine,
    slope: f64,
) -> Option<Grown> {
    let corners = cell.corners();
    if !corners.iter().all(|&corner| line.is_before(corner)) {
        return None;
    }
    solids.restrict(slope, |post| post.low <= cell.min[2] && line.is_before(post.at));
    let task = Task { solids, corners: &corners, line, slope };
    let mut bottom = f64::NEG_INFINITY;
    let mut ends = [0.0; 2];
    for (end, side) in ends.iter_mut().zip([-1.0, 1.0]) {
        chain.clear();
        if !chain.cover(&task, 0.0) || !chain.holds(&task, 0.0) {
            return None;
        }
        *end = grow_to(chain, &task, side, &mut bottom);
    }
    (ends[0] < ends[1]).then(|| Grown {
        ends: ends.map(|position| line.at(position)),
        bottom,
        slope,
        error: line.error,
    })
}

/// Grows a segment from its middle to one side. Each step is a chain that hides all points between two
/// positions. Returns the position of the end.
fn grow_to(chain: &mut Chain, task: &Task, side: f64, bottom: &mut f64) -> f64 {
    let (limit, step) = (side * WIDEST * task.line.distance, side * STEP * task.line.distance);
    let (mut begin, mut position) = (0.0f64, 0.0f64);
    for _ in 0..CHAINS {
        let end = chain.reach(task, position, limit);
        if end != begin {
            *bottom = bottom.max(chain.low());
        }
        (begin, position) = (end, end);
        if end == limit {
            break;
        }
        let mut by = step;
        let is_found = (0..TRIES).any(|_| {
            position = if (limit - end).abs() < by.abs() { limit } else { end + by };
            by *= 0.25;
            chain.cover(task, position) && chain.holds(task, position) && chain.holds(task, end)
        });
        if !is_found {
            break;
        }
    }
    begin
}
