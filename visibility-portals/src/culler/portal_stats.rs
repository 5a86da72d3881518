//! Counters of a frame, and the reasons for a frame without culling.

/// Reason why a frame removed no object: all objects that earlier stages have left stay visible.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Hash)]
pub enum NotCulled {
    /// Some lines of sight begin outside all cells: part of the near plane or of a clip plane lies in a wall
    /// or beyond the building.
    OutsideCells,
    /// The walk through portals reached its limit of inspected portals,
    /// [`PortalEye::with_step_limit`](super::PortalEye::with_step_limit).
    Steps,
    /// The position of the eye, or the direction of parallel lines of sight, cannot be computed in `f64`.
    View,
    /// The cells were never [synced](super::SceneCells::sync), were last synced with another scene, or were
    /// synced so long ago that the scene no longer lists the changes since.
    NotSynced,
}

/// Counters of one frame. They include reflections in mirrors unless stated otherwise. The same input gives
/// the same counters on every machine.
///
/// ```
/// use visibility_portals::{PortalEye, PortalStats};
/// assert_eq!(PortalEye::new().stats(), PortalStats::default());
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
#[non_exhaustive]
pub struct PortalStats {
    /// Number of cells in which lines of sight begin: usually one, the cell of the eye, and more where the
    /// near plane crosses a portal. A reflection in a mirror adds one for each window (part of the view seen
    /// along one path of portals) through which the mirror is seen.
    pub starts: u32,
    /// Number of portals inspected. A portal counts once for each path of portals that reached it.
    pub portals: u64,
    /// Number of inspected portals that a line of sight may pass, counted once for each path of portals.
    pub crossed: u64,
    /// Number of paths of portals from the eye to cells. Paths of reflections are not counted.
    pub paths: u64,
    /// Number of times that more than 48 paths led to a cell, so that the whole view into the cell counted
    /// as seen.
    pub widened: u64,
    /// Number of tests of an object's bounds against a window (the part of the view seen along one path of
    /// portals).
    pub tests: u64,
    /// Number of reflections in mirrors made this frame.
    pub reflections: u32,
    /// Number of seen mirrors without a reflection: beyond the [limits](super::PortalEye::with_reflections),
    /// or with no reflected view that can be computed. Also counts each mirror whose reflection shows no
    /// further mirrors, since the eye of its reflected view is unknown.
    pub reflections_left_out: u32,
    /// Why the frame removed no object. `None` if the frame was culled.
    pub fallback: Option<NotCulled>,
}
