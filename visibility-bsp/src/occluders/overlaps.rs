//! Which rectangles of a plane hang together: groups of rectangles that overlap, or touch along a side,
//! directly or by way of others.
//!
//! Two sweeps, one along each of the two axes, look for pairs whose intervals along the sweep meet and whose
//! intervals across it share more than a point. A segment tree across the sweep holds, for each of its
//! intervals, the rectangle that reaches farthest along the sweep: all others there are of its group. A
//! subtree that holds one group only is not entered again, so that a sweep takes `n log n` steps however many
//! pairs there are.

use super::work;
use alloc::collections::BTreeMap;
use alloc::vec::Vec;

/// A rectangle of a plane along the axes.
#[derive(Clone, Debug)]
pub(super) struct Rectangle {
    pub(super) low: [f64; 2],
    pub(super) high: [f64; 2],
    pub(super) source: u32,
}

/// No rectangle.
const NONE: u32 = u32::MAX;

/// An interval across the sweep, a node of the segment tree.
#[derive(Clone, Copy)]
struct Interval {
    /// Of the rectangles that span this interval, but not the one above it, the one with the greatest end
    /// along the sweep.
    spanning: u32,
    /// Any rectangle of the subtree.
    any: u32,
    /// The greatest end of all rectangles of the subtree.
    end: f64,
    /// Whether all rectangles of the subtree that are not passed yet are of one group.
    one_group: bool,
}

impl Interval {
    const EMPTY: Self = Self { spanning: NONE, any: NONE, end: f64::NEG_INFINITY, one_group: true };
}

/// A sweep along an axis.
struct Sweep<'a> {
    rectangles: &'a [Rectangle],
    /// The axis of the sweep: 0 or 1.
    along: usize,
    /// Interval `i` has the halves `2 i` and `2 i + 1`; the whole is 1.
    tree: Vec<Interval>,
    /// By rectangle, one of its group with a lower number, or itself.
    leaders: &'a mut [u32],
}

/// The groups, in the order of their first members, and the members of each in order.
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

/// The first rectangle of a group.
fn leader(leaders: &mut [u32], mut number: u32) -> u32 {
    while leaders[number as usize] != number {
        let above = leaders[number as usize];
        leaders[number as usize] = leaders[above as usize];
        number = above;
    }
    number
}

impl Sweep<'_> {
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
            let place = |x: f64| lines.partition_point(|&line| line < x);
            let range = [place(rectangle.low[across]), place(rectangle.high[across])];
            self.insert(1, [0, size], range, number);
        }
    }

    fn end_of(&self, number: u32) -> f64 {
        self.rectangles[number as usize].high[self.along]
    }

    /// Whether a rectangle still reaches to where another begins.
    fn reaches(&self, number: u32, other: u32) -> bool {
        number != NONE && self.end_of(number) >= self.rectangles[other as usize].low[self.along]
    }

    /// Makes one group of two.
    fn unite(&mut self, one: u32, two: u32) {
        let (a, b) = (leader(self.leaders, one), leader(self.leaders, two));
        self.leaders[a.max(b) as usize] = a.min(b);
    }

    /// Unites a rectangle with all that it meets between two lines, and puts it there. `node` spans the lines
    /// of `span`.
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

    /// Unites a rectangle with all of a subtree that it spans, but for what the sweep has passed.
    fn unite_below(&mut self, node: usize, number: u32) {
        work::step();
        let Interval { spanning, any, end, one_group } = self.tree[node];
        if any == NONE || end < self.rectangles[number as usize].low[self.along] {
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

    /// Tells what is in a subtree from its parts, when the sweep is where a rectangle begins.
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
            // Passed; nothing at all has no end to reach with.
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
        let mut state = 1u64;
        let mut below = |count: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (((state >> 33) * count) >> 31) as f64
        };
        for round in 0..3000u64 {
            let (count, reach) = (1 + round % 40, 4 + round % 23);
            let rectangles: Vec<Rectangle> = (0..count)
                .map(|source| {
                    let low = [below(reach), below(reach)];
                    // Small ones that touch at sides and corners, and long ones.
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
