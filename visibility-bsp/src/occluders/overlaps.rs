//! Connected groups of rectangles in a plane: rectangles that overlap or touch along a side belong to one
//! group.
//!
//! Two sweeps, one along each axis, find pairs of rectangles whose intervals along the sweep meet and whose
//! intervals across it share more than a point. A segment tree across the sweep stores, for each of its
//! intervals, the rectangle that reaches farthest along the sweep; all other rectangles of the interval
//! belong to that rectangle's group. A subtree with rectangles of only one group is not entered again. A
//! sweep therefore takes `O(n log n)` steps, however many pairs there are.

use super::work;
use alloc::collections::BTreeMap;
use alloc::vec::Vec;

/// An axis-aligned rectangle in a plane. Coordinates are in metres along the plane's two axes.
#[derive(Clone, Debug)]
pub(super) struct Rectangle {
    /// Minimum corner in metres, along the plane's two axes.
    pub(super) low: [f64; 2],
    /// Maximum corner in metres, along the plane's two axes.
    pub(super) high: [f64; 2],
    /// Index of the object or box that the rectangle comes from, for the caller's use.
    pub(super) source: u32,
}

/// Value that stands for no rectangle in place of a rectangle's index.
const NONE: u32 = u32::MAX;

/// Node of the segment tree: an interval of the axis perpendicular to the sweep, and the rectangles stored in
/// it. Coordinates are in metres along the plane's axes.
#[derive(Clone, Copy)]
struct Interval {
    /// Index of the rectangle that reaches farthest along the sweep, of those stored whose extent
    /// perpendicular to the sweep contains this interval but not the parent node's. [`NONE`] without such a
    /// rectangle.
    spanning: u32,
    /// Index of any one rectangle in the subtree, [`NONE`] if there is none.
    any: u32,
    /// Greatest end, along the sweep, of the rectangles in the subtree; minus infinity if there are none.
    end: f64,
    /// True if all rectangles in the subtree that the sweep has not passed belong to one group; false if
    /// they belong to several or this is unknown.
    one_group: bool,
}

impl Interval {
    /// Interval that no rectangle meets.
    const EMPTY: Self = Self { spanning: NONE, any: NONE, end: f64::NEG_INFINITY, one_group: true };
}

/// State of a sweep along one axis that unites connected rectangles.
struct Sweep<'a> {
    /// The rectangles to be grouped.
    rectangles: &'a [Rectangle],
    /// Axis along which the sweep moves: 0 or 1.
    along: usize,
    /// Segment tree as a binary heap: the root is at index 1, the children of node `i` at `2 i` and `2 i +
    /// 1`.
    tree: Vec<Interval>,
    /// Union-find forest. By rectangle: a rectangle of the same group with a lower number, or itself for the
    /// group's first.
    leaders: &'a mut [u32],
}

/// Returns the groups of connected rectangles, in the order of their first members. Members keep their order.
/// Contact at a corner alone does not connect. Takes `O(n log n)` steps.
pub(super) fn groups(rectangles: &[Rectangle]) -> Vec<Vec<&Rectangle>> {
    let mut leaders: Vec<u32> = (0..rectangles.len() as u32).collect();
    if rectangles.len() > 1 {
        for along in 0..2 {
            Sweep { rectangles, along, tree: Vec::new(), leaders: &mut leaders }.run();
        }
    }
    let mut groups: BTreeMap<u32, Vec<&Rectangle>> = BTreeMap::new();
    for (number, rectangle) in (0..).zip(rectangles) {
        groups.entry(leader(&mut leaders, number)).or_default().push(rectangle);
    }
    groups.into_values().collect()
}

/// Returns the first rectangle of a rectangle's group, and shortens the path to it.
fn leader(leaders: &mut [u32], mut number: u32) -> u32 {
    while leaders[number as usize] != number {
        let above = leaders[number as usize];
        leaders[number as usize] = leaders[above as usize];
        number = above;
    }
    number
}

impl Sweep<'_> {
    /// Sweeps over all rectangles along the axis and unites, in `leaders`, those that it finds connected.
    fn run(&mut self) {
        let across = 1 - self.along;
        let mut lines: Vec<f64> =
            self.rectangles.iter().flat_map(|r| [r.low[across], r.high[across]]).collect();
        lines.sort_unstable_by(f64::total_cmp);
        lines.dedup();
        let mut order: Vec<u32> = (0..self.rectangles.len() as u32).collect();
        let low = |i: &u32| self.rectangles[*i as usize].low[self.along];
        order.sort_unstable_by(|a, b| low(a).total_cmp(&low(b)).then(a.cmp(b)));
        let size = lines.len().next_power_of_two();
        self.tree = alloc::vec![Interval::EMPTY; 2 * size];
        for number in order {
            let rectangle = &self.rectangles[number as usize];
            let line_index = |x: f64| lines.partition_point(|&line| line < x);
            let range = [line_index(rectangle.low[across]), line_index(rectangle.high[across])];
            self.insert(1, [0, size], range, number);
        }
    }

    /// Returns the coordinate in metres at which a rectangle ends along the sweep.
    fn end_of(&self, number: u32) -> f64 {
        self.rectangles[number as usize].high[self.along]
    }

    /// Tests whether rectangle `number` reaches the beginning of rectangle `other` along the sweep; touching
    /// counts. False for [`NONE`].
    fn reaches(&self, number: u32, other: u32) -> bool {
        number != NONE && self.end_of(number) >= self.rectangles[other as usize].low[self.along]
    }

    /// Unites the groups of the rectangles `one` and `two`; the lower of the two leaders becomes the leader.
    fn unite(&mut self, one: u32, two: u32) {
        let (a, b) = (leader(self.leaders, one), leader(self.leaders, two));
        self.leaders[a.max(b) as usize] = a.min(b);
    }

    /// Unites rectangle `number` with all rectangles stored in the subtree `node` that overlap or touch the
    /// rectangle, and stores `number` in this subtree. `range` is the extent of the rectangle perpendicular
    /// to the sweep, and `span` that of the node. Both are half-open ranges of indices into the sorted
    /// coordinates at which rectangles begin or end in that direction.
    fn insert(&mut self, node: usize, span: [usize; 2], range: [usize; 2], number: u32) {
        if range[0].max(span[0]) >= range[1].min(span[1]) {
            return;
        }
        work::step();
        let Interval { spanning, .. } = self.tree[node];
        if self.reaches(spanning, number) {
            self.unite(spanning, number);
        }
        if range[0] <= span[0] && span[1] <= range[1] {
            self.unite_below(node, number);
            let end = self.end_of(number);
            if spanning == NONE || end > self.end_of(spanning) {
                self.tree[node].spanning = number;
            }
        } else {
            let middle = usize::midpoint(span[0], span[1]);
            self.insert(2 * node, [span[0], middle], range, number);
            self.insert(2 * node + 1, [middle, span[1]], range, number);
        }
        self.sum_up(node, number);
    }

    /// Unites rectangle `number`, which spans the node's whole interval, with all rectangles of the subtree
    /// that the sweep has not passed.
    fn unite_below(&mut self, node: usize, number: u32) {
        work::step();
        let Interval { spanning, any, end, one_group } = self.tree[node];
        // An empty interval has the end minus infinity.
        if end < self.rectangles[number as usize].low[self.along] {
            return;
        }
        if one_group {
            return self.unite(any, number);
        }
        if self.reaches(spanning, number) {
            self.unite(spanning, number);
        }
        self.unite_below(2 * node, number);
        self.unite_below(2 * node + 1, number);
        self.sum_up(node, number);
    }

    /// Recomputes a node from its `spanning` rectangle and its children. The sweep is at the beginning of
    /// rectangle `at`; rectangles that end before that position are ignored.
    fn sum_up(&mut self, node: usize, at: u32) {
        let low = self.rectangles[at as usize].low[self.along];
        let spanning = self.tree[node].spanning;
        let own = if spanning == NONE {
            Interval::EMPTY
        } else {
            Interval { any: spanning, end: self.end_of(spanning), ..Interval::EMPTY }
        };
        let below = |half: usize| self.tree.get(2 * node + half).copied().unwrap_or(Interval::EMPTY);
        let mut sum = Interval { spanning, ..Interval::EMPTY };
        for part in [own, below(0), below(1)] {
            // Passed by the sweep. An empty part has the end minus infinity.
            if part.end < low {
                continue;
            }
            let same = sum.any == NONE || leader(self.leaders, part.any) == leader(self.leaders, sum.any);
            sum.one_group &= part.one_group && same;
            sum.any = part.any;
            sum.end = sum.end.max(part.end);
        }
        self.tree[node] = sum;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_are_those_of_comparing_each_with_each() {
        let mut random = visibility_testing::Random(1);
        let mut below = |count: u64| random.below(count as usize) as f64;
        for round in 0..3000u64 {
            let (count, reach) = (1 + round % 40, 4 + round % 23);
            let rectangles: Vec<Rectangle> = (0..count)
                .map(|source| {
                    let low = [below(reach), below(reach)];
                    // Small rectangles that touch at sides and corners, and long ones.
                    let size = if round % 3 == 0 { [1, 1] } else { [1 + round % 5, 1 + round % 9] };
                    let high = [low[0] + 1.0 + below(size[0]), low[1] + 1.0 + below(size[1])];
                    Rectangle { low, high, source: source as u32 }
                })
                .collect();
            let mut leaders: Vec<usize> = (0..rectangles.len()).collect();
            for i in 0..rectangles.len() {
                for j in 0..i {
                    let (a, b) = (&rectangles[i], &rectangles[j]);
                    let shared = [0, 1].map(|k| a.high[k].min(b.high[k]) - a.low[k].max(b.low[k]));
                    if shared[0].min(shared[1]) >= 0.0 && shared[0].max(shared[1]) > 0.0 {
                        let (x, y) = (leaders[i].max(leaders[j]), leaders[i].min(leaders[j]));
                        leaders.iter_mut().filter(|leader| **leader == x).for_each(|leader| *leader = y);
                    }
                }
            }
            let mut expected: BTreeMap<usize, Vec<u32>> = BTreeMap::new();
            for (i, leader) in leaders.iter().enumerate() {
                expected.entry(*leader).or_default().push(i as u32);
            }
            let found: Vec<Vec<u32>> =
                groups(&rectangles).iter().map(|group| group.iter().map(|r| r.source).collect()).collect();
            assert_eq!(found, expected.into_values().collect::<Vec<_>>(), "round {round}: {rectangles:?}");
        }
    }
}
