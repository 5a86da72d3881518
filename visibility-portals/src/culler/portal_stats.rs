//! Counters of a frame, and why it hid nothing.

/// Why a frame hid nothing: all objects that earlier stages have left stay visible.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Hash)]
pub enum NotCulled {
    /// Lines of sight begin outside all cells, some or all of them: the near plane, or a clip plane, is
    /// partly in a wall or in the open.
    OutsideCells,
    /// The walk came to its limit of [steps](super::PortalEye::with_step_limit).
    Steps,
    /// The position of the eye, or the direction of parallel lines of sight, cannot be computed in `f64`.
    View,
    /// The cells were never [synced](super::SceneCells::sync), or last with another scene, or so long ago
    /// that the scene no longer lists what has changed since.
    NotSynced,
}

/// Counters of one frame, reflections included. The same on every machine.
///
/// ```
/// use visibility_portals::{PortalEye, PortalStats};
/// assert_eq!(PortalEye::new().stats(), PortalStats::default());
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct PortalStats {
    /// Cells in which lines of sight begin: one, unless the near plane crosses a portal.
    pub starts: u32,
    /// Portals looked at, counted again for each path that they were looked at from.
    pub portals: u64,
    /// Portals that a line of sight may pass, counted in the same way.
    pub crossed: u64,
    /// Paths from the eye to cells, without those of reflections.
    pub paths: u64,
    /// Cells that were treated as seen through the whole view, since more than 48 paths led to them.
    pub widened: u64,
    /// Tests of the bounds of an object against the window of a path.
    pub tests: u64,
    /// Reflections that were made.
    pub reflections: u32,
    /// Mirrors that were seen and got no reflection: beyond the
    /// [limits](super::PortalEye::with_reflections), or no view could be computed.
    pub reflections_left_out: u32,
    /// Why the frame hid nothing; `None` if it was culled.
    pub fallback: Option<NotCulled>,
}
