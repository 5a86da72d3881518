//! Costs of past searches of a query, which decide how much work the next search is worth.

use crate::search::{Answer, Budget};

/// Budget of the proof that the box around a group of objects is hidden, unless [`Prices`] allow more.
///
/// Groups get few search nodes and are not divided by occluder edges: a group that is not proven at once is
/// halved, and proofs for its halves take less time. With 300 nodes and divisions, a city took twice as long
/// for the same answer.
pub(super) const GROUP: Budget = Budget { nodes: 50, divided: 0, halvings: 0 };
/// Budget of the proof that the box of a single object is hidden.
const OBJECT: Budget = Budget { nodes: 1000, divided: 200, halvings: 12 };
/// Costs of past searches in nodes. They decide whether a group is searched as thoroughly as a single object.
///
/// Among houses along streets most groups are hidden as a whole, which costs the nodes of a few objects. In a
/// building of many rooms groups seldom are hidden, and the nodes are lost. A group may therefore cost a part
/// of what its objects are likely to cost, as long as groups of about its size have saved more nodes than
/// they have cost.
#[derive(Default)]
pub(super) struct Prices {
    /// Nodes spent on searches for single objects, and the number of these objects.
    single: (u64, u64),
    /// Nodes spent on thorough searches of groups, and the number of objects proven hidden by them. Indexed
    /// by the binary logarithm of the group's size.
    groups: [(u64, u64); 32],
}

impl Prices {
    /// Returns an estimate of the nodes that `objects` objects cost if each is searched by itself: `objects`
    /// times the mean of past searches for single objects.
    fn singles(&self, objects: u64) -> u64 {
        objects * self.single.0 / self.single.1.max(1)
    }

    /// Returns the budget of a search for the box around `count` objects.
    pub(super) fn budget(&self, count: usize) -> Budget {
        if count == 1 {
            return OBJECT;
        }
        let part = self.singles(count as u64) / 6;
        let (spent, hidden) = self.groups[count.ilog2() as usize % 32];
        if part > GROUP.nodes.into() && spent <= self.singles(hidden) / 3 + part {
            Budget { nodes: part.min(OBJECT.nodes.into()) as u32, ..OBJECT }
        } else {
            GROUP
        }
    }

    /// Adds a search for the box around `count` objects: its budget, the nodes used and the answer.
    pub(super) fn add(&mut self, count: usize, budget: Budget, used: u32, answer: Answer) {
        if count == 1 {
            if answer == Answer::Undecided {
                return;
            }
            self.single = (self.single.0 + u64::from(used), self.single.1 + 1);
        } else if budget.divided > 0 {
            let (spent, hidden) = &mut self.groups[count.ilog2() as usize % 32];
            *spent += u64::from(used);
            *hidden += if answer == Answer::Hidden { count as u64 } else { 0 };
        }
    }
}
