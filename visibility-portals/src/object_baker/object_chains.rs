//! The search for the objects seen from one cell, in two stages for each portal that leads from the cell.
//!
//! Pairs: a line that reaches an object has passed the first portal and, last of all, a portal into a cell of
//! the object. The planes that separate the two portals bound all such lines. An object outside the planes of
//! every such pair is hidden; the others are candidates. The cost is at most that of all pairs of portals.
//!
//! Chains: a search, depth first through chains of portals, that lead to candidates. A candidate that is not
//! outside the planes of some chain is seen. A candidate is *open* as long as no chain of the present first
//! portal has reached it: it may be seen or not. The number of chains may be exponential, so their number may
//! be limited; candidates beyond the limit count as seen.

use crate::cell_matrix::CellMatrix;
use crate::directed_portals::DirectedPortals;
use crate::portal_chain::{CellFlood, ChainFrame, PortalChain, is_outside, outward};
use crate::portal_pairs::PortalPairs;
use alloc::vec::Vec;
use core::ops::Range;
use visibility_core::bits::Bits;
use visibility_core::glam::DVec3;
use visibility_core::{
    ObjectId,
    cells::{CellGraph, CellId},
    geometry::Plane,
};

/// The objects that the graph lists, and which of them are in each cell. A *target* is the number of such an
/// object within the bake, counted from 0 in order of the objects' ids.
#[derive(Clone, Debug)]
pub(super) struct Targets {
    /// By target: centre and half extents of the object's box in world space. NaN if the object has no valid
    /// box.
    boxes: Vec<(DVec3, DVec3)>,
    /// By target (object number within the bake): the object's [index](ObjectId::index) in the scene.
    index: Vec<u32>,
    /// CSR offsets: by cell index, the index in `of_cell` of the cell's first target; one more entry marks
    /// the end of the last cell.
    first: Vec<u32>,
    of_cell: Vec<u32>,
}

impl Targets {
    pub(super) fn new(graph: &CellGraph, bounds: impl Fn(ObjectId) -> Option<[DVec3; 2]>) -> Self {
        let cells = || (0..graph.cell_count() as u32).map(CellId);
        let mut ids: Vec<ObjectId> = cells().flat_map(|cell| graph.objects_in(cell)).copied().collect();
        ids.sort_unstable();
        ids.dedup();
        let boxes = ids.iter().map(|&id| match bounds(id) {
            Some([min, max]) if min.cmple(max).all() => (min * 0.5 + max * 0.5, max * 0.5 - min * 0.5),
            _ => (DVec3::NAN, DVec3::NAN),
        });
        let (mut first, mut of_cell) = (alloc::vec![0], Vec::new());
        for cell in cells() {
            // `ids` contains every object of the graph, so every search finds its object.
            of_cell.extend(
                graph.objects_in(cell).iter().filter_map(|id| ids.binary_search(id).ok()).map(|i| i as u32),
            );
            first.push(of_cell.len() as u32);
        }
        Self {
            boxes: boxes.collect(),
            index: ids.iter().map(|id| id.index() as u32).collect(),
            first,
            of_cell,
        }
    }

    /// Returns boxes, object indices and cell lists as numbers, for the bake's fingerprint.
    pub(super) fn numbers(&self) -> impl Iterator<Item = u64> + '_ {
        let boxes = self
            .boxes
            .iter()
            .flat_map(|&(middle, half)| middle.to_array().into_iter().chain(half.to_array()));
        let lists = self.index.iter().chain(&self.first).chain(&self.of_cell).copied().map(u64::from);
        boxes.map(f64::to_bits).chain(lists)
    }

    /// Returns the targets (object numbers within the bake) in the cell of index `cell`.
    fn of(&self, cell: u32) -> &[u32] {
        &self.of_cell[self.first[cell as usize] as usize..self.first[cell as usize + 1] as usize]
    }

    /// Returns the scene indices of all objects in `cells`, ascending, each once.
    pub(super) fn in_cells(&self, cells: impl Iterator<Item = CellId>) -> Vec<u32> {
        let mut all: Vec<u32> =
            cells.flat_map(|cell| self.of(cell.0)).map(|&target| self.index[target as usize]).collect();
        all.sort_unstable();
        all.dedup();
        all
    }

    /// Tests whether the box of a target is certainly on the outer side of one of the planes, opposite to the
    /// plane's normal. `false` if undecided, for a box that touches or is NaN, and without planes.
    fn is_outside(&self, target: u32, planes: &[Plane]) -> bool {
        let (middle, half) = self.boxes[target as usize];
        planes.iter().any(|plane| {
            let reach = plane.normal.abs().dot(half);
            let distance = plane.signed_distance(middle);
            // Centre, half extents and their products have a few more roundings than `error_bound` accounts
            // for. NaN compares as not outside.
            distance + reach < -4.0 * plane.error_bound(middle.abs() + half)
        })
    }
}

/// The objects seen from one cell, and the cost of the search.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct SeenObjects {
    /// Scene indices of the seen objects, ascending.
    pub(super) row: Vec<u32>,
    pub(super) steps: u64,
    /// Whether the search of chains reached the limit of steps, so that `row` may hold objects that a longer
    /// search would exclude. `false` if the search is complete.
    pub(super) gave_up: bool,
}

/// Scratch memory of the search for the objects seen from one cell: the current chain of portals and the
/// objects seen so far.
#[derive(Default, Debug)]
pub struct Chains {
    /// Whether each target is known to be seen, by target.
    seen: Vec<bool>,
    /// Whether each target is a candidate of the present first portal and not known to be seen, by target.
    open: Vec<bool>,
    /// Candidates of the present first portal: targets that may be seen through it, by tests of this portal
    /// with one further portal at a time. Each is listed once. A candidate that a chain has reached stays in
    /// the list, but is no longer `open`.
    candidates: Vec<u32>,
    /// Bit i is set if directed portal i leads to a cell with an open candidate that a line through the first
    /// portal and portal i may reach.
    goals: Bits,
    /// The current chain of portals. Bit i of its bitsets stands for directed portal i.
    chain: PortalChain,
    flood: CellFlood,
}

/// The scene data that all searches for seen objects read: portals, the cells that see each other, pairs of
/// portals that lines join, and the objects in each cell.
#[derive(Clone, Copy)]
pub(super) struct Input<'a> {
    pub(super) portals: &'a DirectedPortals,
    pub(super) matrix: &'a CellMatrix,
    pub(super) pairs: &'a PortalPairs,
    pub(super) targets: &'a Targets,
}

/// Input of one search: what is seen from cell `from` through one directed portal of it, the first portal of
/// all chains of the search.
struct Search<'a> {
    input: Input<'a>,
    from: CellId,
    /// Index of the first directed portal, with which all chains of the search begin.
    first: u32,
    /// Number of 64-bit words in a bitset over the directed portals.
    words: usize,
}

impl Chains {
    /// Searches the objects seen from cell `from`. At most `limit` steps (portal chains) are inspected,
    /// shared among the portals of the cell.
    pub(super) fn seen_from(&mut self, from: CellId, input: Input, limit: u64) -> SeenObjects {
        let Input { portals, targets, .. } = input;
        let count = targets.boxes.len();
        self.seen.clear();
        self.seen.resize(count, false);
        self.open.clear();
        self.open.resize(count, false);
        targets.of(from.0).iter().for_each(|&target| self.seen[target as usize] = true);
        let (mut steps, mut gave_up) = (0, false);
        let own = portals.from(from.0);
        for first in own.clone() {
            let search = Search { input, from, first, words: portals.all.len().div_ceil(64) };
            self.find_candidates(&search);
            if self.candidates.is_empty() {
                continue;
            }
            let share = (limit - steps) / u64::from(own.end - first);
            let complete = self.search(&search, steps + share, &mut steps);
            gave_up |= !complete;
            for target in self.candidates.drain(..) {
                // After a complete search, objects that are still open are hidden from this portal.
                self.seen[target as usize] |= core::mem::take(&mut self.open[target as usize]) && !complete;
            }
        }
        let seen = (0..count).filter(|&i| self.seen[i]).map(|i| targets.index[i]);
        SeenObjects { row: seen.collect(), steps, gave_up }
    }

    /// Finds the candidates of the directed portal `search.first`, the first portal: targets not known to be
    /// seen that may be seen through it. Tests each target against the planes that bound lines through the
    /// first portal and through a portal into a cell of the target. Sets `open`, `candidates` and `goals`.
    fn find_candidates(&mut self, search: &Search) {
        let Search { input: Input { portals, matrix, pairs, targets }, from, first, .. } = *search;
        self.goals.reset(portals.all.len());
        self.begin_chain(search);
        let start = self.chain.points.len();
        let frame = first_frame(first, start);
        self.try_pair(search, first);
        for last in pairs.row(first).iter().map(|last| last as u32) {
            let cell = portals.all[last as usize].to;
            let unseen = |&target: &u32| !self.seen[target as usize];
            if !matrix.sees(from, CellId(cell)) || !targets.of(cell).iter().any(unseen) {
                continue;
            }
            if let Some((source, pass)) = self.chain.narrow(portals, first, &frame, last, true) {
                self.chain.push_planes(portals, (first, &source), (last, &pass));
                self.try_pair(search, last);
                self.chain.planes.clear();
            }
            self.chain.points.truncate(start);
        }
    }

    /// Makes candidates of the targets in the cell behind directed portal `last` that are inside the chain's
    /// planes and not known to be seen. If there is any, marks `last` as a goal.
    fn try_pair(&mut self, search: &Search, last: u32) {
        let Input { portals, targets, .. } = search.input;
        let portal = &portals.all[last as usize];
        self.chain.planes.push(outward(&portal.plane, portals.margins.keep));
        for &target in targets.of(portal.to) {
            if self.seen[target as usize] || targets.is_outside(target, &self.chain.planes) {
                continue;
            }
            self.goals.insert(last as usize);
            if !core::mem::replace(&mut self.open[target as usize], true) {
                self.candidates.push(target);
            }
        }
        self.chain.planes.pop();
    }

    /// Empties the chain, and puts the vertices of the first portal on the list of its points.
    fn begin_chain(&mut self, search: &Search) {
        let portals = search.input.portals;
        self.chain.clear();
        self.chain.points.extend_from_slice(portals.vertices_of(&portals.all[search.first as usize]));
    }

    /// Searches chains that begin with the directed portal `search.first` and lead to candidates, and marks
    /// in `seen` the candidates that they reach. Adds the number of chains inspected to `steps`, which may
    /// not exceed `limit`. Returns `false` if the search ended there, so that candidates still open may be
    /// seen.
    fn search(&mut self, search: &Search, limit: u64, steps: &mut u64) -> bool {
        self.begin_chain(search);
        let all = 0..self.chain.points.len();
        if *steps >= limit {
            return false;
        }
        *steps += 1;
        self.enter(search, search.first, all.clone(), all, 0, 0);
        while let Some(child) = self.chain.next_child() {
            if *steps >= limit {
                return false;
            }
            let (points, planes) = (self.chain.points.len(), self.chain.planes.len());
            if !self.extend(search, child, points, planes, steps) {
                self.chain.points.truncate(points);
                self.chain.planes.truncate(planes);
            }
        }
        true
    }

    /// Extends the chain by directed portal `child` if lines that pass the chain may pass `child`, and then
    /// reach a candidate that is still open, in the cell behind `child` or beyond. Returns whether the chain
    /// was extended. If not, the caller must truncate the chain's points and planes to the lengths `points`
    /// and `planes`, which they had before the call. Adds 1 to `steps` if the geometry of the chain and
    /// `child` was computed.
    fn extend(&mut self, search: &Search, child: u32, points: usize, planes: usize, steps: &mut u64) -> bool {
        let Some(last) = self.chain.frames.last().cloned() else { return false };
        // A straight line passes each portal at most once.
        if !self.leads_to_goal(search, last.set, child)
            || self.chain.frames.iter().any(|frame| frame.portal == child)
        {
            return false;
        }
        *steps += 1;
        let portals = search.input.portals;
        let Some((source, pass)) = self.chain.narrow(portals, search.first, &last, child, true) else {
            return false;
        };
        self.chain.push_planes(portals, (search.first, &source), (child, &pass));
        self.enter(search, child, source, pass, planes, points)
    }

    /// Tests whether directed portal `child` is a goal, or a line through it may pass one of the goals that
    /// are in the set at offset `set` of the chain's sets.
    fn leads_to_goal(&self, search: &Search, set: usize, child: u32) -> bool {
        let later = search.input.pairs.row(child).words();
        let ahead = self.chain.sets[set..].iter().zip(later).zip(self.goals.words());
        self.goals.contains(child as usize)
            || ahead.into_iter().any(|((within, later), goals)| within & later & goals != 0)
    }

    /// Marks the candidates seen in the cell behind directed portal `portal`. If other candidates may be seen
    /// beyond that cell, appends the portal to the chain, with the planes from index `planes` on, and returns
    /// `true`. `source`, `pass` and `points` become the fields of these names of the appended [`ChainFrame`]:
    /// the parts of the first portal and of this portal that lines use, and the length to which the chain's
    /// points are later truncated.
    fn enter(
        &mut self,
        search: &Search,
        portal: u32,
        source: Range<usize>,
        pass: Range<usize>,
        planes: usize,
        points: usize,
    ) -> bool {
        let Input { portals, targets, .. } = search.input;
        let own_planes = planes..self.chain.planes.len();
        let entered = &portals.all[portal as usize];
        self.chain.planes.push(outward(&entered.plane, portals.margins.keep));
        let (mut found, mut left) = (false, false);
        for &target in targets.of(entered.to) {
            if !self.open[target as usize] {
                continue;
            }
            if targets.is_outside(target, &self.chain.planes[planes..]) {
                left = true;
            } else {
                (self.seen[target as usize], self.open[target as usize]) = (true, false);
                found = true;
            }
        }
        if found && !left {
            // No open candidate is left in this cell, so portals into the cell are no goals any more.
            for out in portals.from(entered.to) {
                let into = portals.all[out as usize].reverse;
                self.goals.remove(into as usize);
            }
        }
        let set = self.chain.sets.len();
        let more = self.push_reachable_set(search, portal, planes);
        self.chain.planes.truncate(own_planes.end);
        if !more {
            self.chain.sets.truncate(set);
            return false;
        }
        let children = portals.from(entered.to);
        self.chain.frames.push(ChainFrame {
            portal,
            source,
            pass,
            planes: own_planes,
            set,
            children,
            points,
        });
        true
    }

    /// Appends to the chain's sets the bitset of the directed portals that a line through directed portal
    /// `last` can reach without leaving the inner side of any of the chain's planes from index `planes` on.
    /// Returns `false` if no cell behind these portals holds an open candidate inside the planes.
    fn push_reachable_set(&mut self, search: &Search, last: u32, planes: usize) -> bool {
        let Input { portals, matrix, pairs, targets } = search.input;
        let PortalChain { frames, planes: all_planes, sets, .. } = &mut self.chain;
        let set = sets.len();
        sets.resize(set + search.words, 0);
        // The new set is a subset of the previous frame's set.
        let within = frames.last().map(|frame| frame.set);
        let planes = &all_planes[planes..];
        let later = pairs.row(last);
        let mut more = false;
        self.flood.begin(matrix.cell_count(), portals.all[last as usize].to);
        while let Some(cell) = self.flood.next_cell() {
            for next in portals.from(cell) {
                let portal = &portals.all[next as usize];
                let (word, bit) = (next as usize / 64, 1 << (next % 64));
                let known = later.contains(next as usize)
                    && match within {
                        Some(within) => sets[within + word] & bit != 0,
                        None => matrix.sees(search.from, CellId(portal.to)),
                    };
                if !known || is_outside(portals, planes, next, (portal.center, portal.radius)) {
                    continue;
                }
                sets[set + word] |= bit;
                if self.flood.reach(portal.to) && !more {
                    let inside =
                        |&target: &u32| self.open[target as usize] && !targets.is_outside(target, planes);
                    more = targets.of(portal.to).iter().any(inside);
                }
            }
        }
        more
    }
}

/// Returns the frame of the first portal of a chain, whose vertices are the first `count` of the chain's
/// points.
fn first_frame(portal: u32, count: usize) -> ChainFrame {
    let (source, pass) = (0..count, 0..count);
    ChainFrame { portal, source, pass, planes: 0..0, set: 0, children: 0..0, points: 0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_testing::{Random, sign_of_sum};

    fn targets(boxes: &[[DVec3; 2]]) -> Targets {
        let mut scene = visibility_core::Scene::new();
        let unit = visibility_core::Aabb::from_arrays([0.0; 3], [1.0; 3]);
        let ids: Vec<ObjectId> = boxes.iter().map(|_| scene.insert(unit)).collect();
        let mut graph = CellGraph::new(1, []).unwrap();
        graph.set_objects(ids.iter().map(|&id| (CellId(0), id))).unwrap();
        Targets::new(&graph, |id| boxes.get(id.index()).copied())
    }

    /// Boxes whose farthest corner is in a plane up to its rounding, in front of it or behind it, are outside
    /// only if exact arithmetic says so.
    #[test]
    fn boxes_that_touch_a_plane_are_not_outside() {
        let (mut random, mut outside, mut touching) = (Random(1), 0, 0);
        for i in 0..5_000 {
            let min = random.fine_vector(10f64.powi(i % 7));
            let max = min + random.fine_vector(10f64.powi(i % 3)).abs();
            let normal = random.direction();
            let far = DVec3::select(normal.cmpge(DVec3::ZERO), max, min);
            let size = normal.abs().dot(min.abs().max(max.abs()));
            let moved = f64::from(random.between(-8, 8)) * size * f64::EPSILON;
            let plane = Plane::new(normal, moved - normal.dot(far));
            let terms = (0..3).map(|k| (normal[k], far[k])).chain([(plane.offset, 1.0)]);
            let is_outside = targets(&[[min, max]]).is_outside(0, &[plane]);
            let sign = sign_of_sum(terms);
            assert!(!is_outside || sign < 0, "case {i}: a box from {min} to {max}, {plane:?}");
            touching += u32::from(!is_outside && sign < 0);
            let moved = Plane::new(normal, plane.offset - 200.0 * size * f64::EPSILON);
            outside += u32::from(targets(&[[min, max]]).is_outside(0, &[moved]));
        }
        assert!(outside == 5_000 && touching > 1_000, "{outside} clearly outside, {touching} undecided");
    }

    #[test]
    fn boxes_are_outside_of_any_of_the_planes_and_flat_ones_too() {
        let [low, high] = [DVec3::ZERO, DVec3::new(2.0, 2.0, 0.0)];
        let all = targets(&[[low, high], [high, low + DVec3::Z], [DVec3::NAN, high]]);
        let right_of = |x: f64| Plane::new(DVec3::X, -x);
        assert!(!all.is_outside(0, &[]), "no planes");
        for (x, expected) in [(-1.0, false), (1.0, false), (2.0, false), (2.1, true)] {
            assert_eq!(all.is_outside(0, &[right_of(x)]), expected, "a flat box and a plane at {x}");
            assert_eq!(all.is_outside(0, &[right_of(-5.0), right_of(x)]), expected, "planes at -5 and {x}");
            for bad in [1, 2] {
                assert!(!all.is_outside(bad, &[right_of(x)]), "a box that is none, and a plane at {x}");
            }
        }
    }
}
