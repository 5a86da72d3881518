//! Counters of work.

use visibility_core::CullStats;

/// Counters of a frame's work. They do not depend on the machine or on timing.
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct vis_stats {
    /// Number of nodes of the hierarchy whose children were tested.
    pub nodes: u64,
    /// Number of nodes accepted as a whole, without tests of their children.
    pub accepted_subtrees: u64,
    /// Number of tests of one box against one plane, one occlusion map or similar.
    pub tests: u64,
    /// Number of occluders drawn.
    pub occluders: u64,
    /// Number of visible objects after the stage.
    pub visible: u64,
}

impl From<CullStats> for vis_stats {
    fn from(stats: CullStats) -> Self {
        Self {
            nodes: stats.nodes,
            accepted_subtrees: stats.accepted_subtrees,
            tests: stats.tests,
            occluders: stats.occluders,
            visible: stats.visible,
        }
    }
}
