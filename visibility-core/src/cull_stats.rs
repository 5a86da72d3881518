//! Counters of the work that a culler does.

use core::ops::AddAssign;

/// How much work a culler did: counters, the same on every machine, no clock.
///
/// ```
/// use visibility_core::CullStats;
/// let mut sum = CullStats { nodes: 2, ..CullStats::default() };
/// sum += CullStats { nodes: 1, visible: 5, ..CullStats::default() };
/// assert_eq!((sum.nodes, sum.visible), (3, 5));
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct CullStats {
    /// Nodes of a hierarchy whose children were tested.
    pub nodes: u64,
    /// Nodes whose candidates were all kept without a test of any of them.
    pub accepted_subtrees: u64,
    /// Tests of a box against a plane, a map or the like.
    pub tests: u64,
    /// Objects left in the set. In a sum, those of the last summand.
    pub visible: u64,
}

impl AddAssign for CullStats {
    fn add_assign(&mut self, other: Self) {
        self.nodes += other.nodes;
        self.accepted_subtrees += other.accepted_subtrees;
        self.tests += other.tests;
        self.visible = other.visible;
    }
}
