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

#[cfg(test)]
mod tests {
    use super::*;

    fn nodes(prices: &Prices, counts: [usize; 3]) -> [u32; 3] {
        counts.map(|count| prices.budget(count).nodes)
    }

    /// A group gets a sixth of what its objects cost, up to the budget of an object, until thorough searches
    /// of groups of its size have cost more than they have saved.
    #[test]
    fn groups_are_searched_as_thoroughly_as_that_pays() {
        let mut prices = Prices::default();
        assert_eq!(nodes(&prices, [1, 8, 64]), [OBJECT.nodes, GROUP.nodes, GROUP.nodes], "at first");
        prices.add(1, OBJECT, 150, Answer::Hidden);
        prices.add(1, OBJECT, 30, Answer::Hidden);
        prices.add(1, OBJECT, 1000, Answer::Undecided);
        prices.add(64, GROUP, 50, Answer::Undecided);
        // An object costs 90 nodes. A sixth of the cost of 3 objects is 45 nodes, less than for any group.
        assert_eq!(nodes(&prices, [3, 8, 64]), [GROUP.nodes, 120, 960], "parts of the costs of objects");
        assert_eq!(nodes(&prices, [10, 80, 1]), [150, OBJECT.nodes, OBJECT.nodes], "no more than an object");
        let budget = prices.budget(8);
        prices.add(8, budget, 120, Answer::Undecided);
        assert_eq!(nodes(&prices, [8, 15, 16]), [120, 225, 240], "one search in vain");
        prices.add(8, budget, 1, Answer::Undecided);
        assert_eq!(nodes(&prices, [8, 15, 16]), [GROUP.nodes, 225, 240], "more than one search in vain");
        prices.add(9, budget, 100, Answer::Hidden);
        // 9 objects hidden are worth 270 nodes, which with 120 is more than the 221 spent.
        assert_eq!(nodes(&prices, [8, 15, 16]), [120, 225, 240], "a search that pays");
    }
}
