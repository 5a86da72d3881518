//! Counters of a frame, and the reasons for a frame without culling.

/// Why a frame removed no object: all objects that earlier stages have left stay visible.
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

/// Counters of one frame, reflections included unless stated otherwise. The same input gives the same
/// counters on every machine.
///
/// ```
/// use visibility_portals::{PortalEye, PortalStats};
/// assert_eq!(PortalEye::new().stats(), PortalStats::default());
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct PortalStats {
    /// Number of cells in which lines of sight begin: one for the eye unless the near plane crosses a
    /// portal, plus one for each window through which a mirror is reflected.
    pub starts: u32,
    /// Number of portals inspected, counted once for each path from which the portal was inspected.
    pub portals: u64,
    /// Number of inspected portals that a line of sight may pass, counted once for each path.
    pub crossed: u64,
    /// Number of paths from the eye to cells. Paths of reflections are not counted.
    pub paths: u64,
    /// Number of cells that were treated as seen through the whole view, because more than 48 paths led to
    /// them.
    pub widened: u64,
    /// Number of tests of an object's bounds against the window of a path.
    pub tests: u64,
    /// Number of reflections in mirrors made this frame.
    pub reflections: u32,
    /// Number of seen mirrors without a reflection: beyond the [limits](super::PortalEye::with_reflections),
    /// or with no reflected view that can be computed.
    pub reflections_left_out: u32,
    /// Why the frame removed no object. `None` if the frame was culled.
    pub fallback: Option<NotCulled>,
}
