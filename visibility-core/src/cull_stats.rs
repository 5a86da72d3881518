//! Counters of the work that a culler does in one frame.

use core::ops::AddAssign;

/// Counters of the work that a culler did in one frame. They do not depend on the machine or on time, so
/// tests can compare them. `+=` adds the counters of stages that ran one after another.
///
/// ```
/// use visibility_core::CullStats;
/// let mut sum = CullStats::default().with_nodes(2);
/// sum += CullStats::default().with_nodes(1).with_visible(5);
/// assert_eq!((sum.nodes, sum.visible), (3, 5));
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
#[non_exhaustive]
pub struct CullStats {
    /// Number of hierarchy nodes whose children were tested.
    pub nodes: u64,
    /// Number of nodes whose candidates were all kept without further tests.
    pub accepted_subtrees: u64,
    /// Number of tests of one bounding box against one plane, one occlusion map or similar.
    pub tests: u64,
    /// Number of occluders added to an occlusion map.
    pub occluders: u64,
    /// Number of objects left in the set. `+=` takes this number from the right-hand side instead of adding,
    /// since the later stage removed objects from the same set.
    pub visible: u64,
}

impl CullStats {
    /// Returns these counters with [`nodes`](Self::nodes) replaced.
    #[must_use]
    pub fn with_nodes(self, nodes: u64) -> Self {
        Self { nodes, ..self }
    }

    /// Returns these counters with [`tests`](Self::tests) replaced.
    #[must_use]
    pub fn with_tests(self, tests: u64) -> Self {
        Self { tests, ..self }
    }

    /// Returns these counters with [`visible`](Self::visible) replaced.
    #[must_use]
    pub fn with_visible(self, visible: u64) -> Self {
        Self { visible, ..self }
    }
}

impl AddAssign for CullStats {
    fn add_assign(&mut self, other: Self) {
        self.nodes += other.nodes;
        self.accepted_subtrees += other.accepted_subtrees;
        self.tests += other.tests;
        self.occluders += other.occluders;
        self.visible = other.visible;
    }
}
