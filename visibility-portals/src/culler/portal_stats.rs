//! What a frame took.

/// Why a frame was not culled by portals: then the stages before have the last word.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Hash)]
pub enum NotCulled {
    /// The view begins, in whole or in part, outside all cells: in the open, in a wall, or before the near
    /// plane on its other side.
    OutsideCells,
    /// More portals to look at than the limit of steps.
    Steps,
    /// `f64` cannot tell where the view is seen from.
    View,
    /// The cells were never told of the scene, or of another one, or of too little of what happened since.
    NotSynced,
}

/// How much a frame had to look at: counters, the same on every machine.
///
/// ```
/// use visibility_portals::{PortalEye, PortalStats};
/// assert_eq!(PortalEye::new().stats(), PortalStats::default());
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct PortalStats {
    /// Cells that lines of sight begin in: one, but for eyes in or near a portal.
    pub starts: u32,
    /// Portals that were looked at, each time.
    pub portals: u64,
    /// Of these, those that something is seen through.
    pub crossed: u64,
    /// Ways by which cells are seen.
    pub ways: u64,
    /// Cells with so many ways into them that they were looked at through the whole view instead.
    pub widened: u64,
    /// Boxes tested against a window.
    pub tests: u64,
    /// Reflections, and reflections in these.
    pub reflections: u32,
    /// Mirrors left out since there are more reflections than the limit, or they are deeper.
    pub reflections_left_out: u32,
    /// Why the frame is not culled by portals, if it is not.
    pub fallback: Option<NotCulled>,
}
