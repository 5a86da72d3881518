//! The search for the objects seen from one cell: depth first through chains of portals. Objects that are not
//! outside the planes of some chain are marked as seen.

use crate::cell_matrix::CellMatrix;
use crate::directed_portals::DirectedPortals;
use crate::portal_chain::{CellFlood, ChainFrame, PortalChain, is_outside, outward};
use alloc::vec::Vec;
use core::ops::Range;
use visibility_core::glam::DVec3;
use visibility_core::{
    ObjectId,
    cells::{CellGraph, CellId},
    geometry::Plane,
};

/// The objects that the graph lists, and which of them are in each cell. A target is the number of such an
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
            // `ids` holds every object of the graph, so each search succeeds.
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
    /// Scene indices of the seen objects, ascending. Empty if `gave_up`.
    pub(super) row: Vec<u32>,
    pub(super) steps: u64,
    /// Whether the search from this cell reached the limit of steps, so that `row` is unknown. `false` if
    /// the search is complete.
    pub(super) gave_up: bool,
}

/// Scratch memory of the search for the objects seen from one cell: the current chain of portals and the
/// objects seen so far.
#[derive(Default)]
pub struct Chains {
    seen: Vec<bool>,
    /// The current chain of portals. Bit i of its bitsets stands for directed portal i.
    chain: PortalChain,
    flood: CellFlood,
}

/// Input of the search for the objects seen through one directed portal of the viewcell, the first portal of
/// all chains of the search.
struct Search<'a> {
    portals: &'a DirectedPortals,
    matrix: &'a CellMatrix,
    targets: &'a Targets,
    from: CellId,
    /// Index of the first directed portal, with which all chains of the search begin.
    first: u32,
    /// Number of 64-bit words in a bitset over the directed portals.
    words: usize,
}

impl Chains {
    /// Searches the objects seen from cell `from`. Gives up after `limit` steps (portal chains inspected).
    pub(super) fn seen_from(
        &mut self,
        from: CellId,
        portals: &DirectedPortals,
        matrix: &CellMatrix,
        targets: &Targets,
        limit: u64,
    ) -> SeenObjects {
        self.seen.clear();
        self.seen.resize(targets.boxes.len(), false);
        targets.of(from.0).iter().for_each(|&target| self.seen[target as usize] = true);
        let mut steps = 0;
        for first in portals.from(from.0) {
            let words = portals.all.len().div_ceil(64);
            let search = Search { portals, matrix, targets, from, first, words };
            if !self.search(&search, limit, &mut steps) {
                return SeenObjects { row: Vec::new(), steps, gave_up: true };
            }
        }
        let seen = (0..targets.boxes.len()).filter(|&i| self.seen[i]).map(|i| targets.index[i]);
        SeenObjects { row: seen.collect(), steps, gave_up: false }
    }

    /// Searches all chains that begin with the directed portal `search.first`, and marks in `seen` the
    /// targets that they reach. Adds the chains inspected to `steps`; returns `false` once `steps` exceeds
    /// `limit`.
    fn search(&mut self, search: &Search, limit: u64, steps: &mut u64) -> bool {
        let (portals, first) = (search.portals, search.first);
        self.chain.clear();
        self.chain.points.extend_from_slice(portals.vertices_of(&portals.all[first as usize]));
        let all = 0..self.chain.points.len();
        *steps += 1;
        self.enter(search, first, all.clone(), all, 0, 0);
        while let Some(child) = self.chain.next_child() {
            *steps += 1;
            if *steps > limit {
                return false;
            }
            let (points, planes) = (self.chain.points.len(), self.chain.planes.len());
            if !self.extend(search, child, points, planes) {
                self.chain.points.truncate(points);
                self.chain.planes.truncate(planes);
            }
        }
        true
    }

    /// Extends the chain by directed portal `child` if lines can pass it and then reach a target that is not
    /// yet seen. Returns `false` if the chain was not extended; the caller then truncates the chain's points
    /// and planes to `points` and `planes`, their lengths before the call.
    fn extend(&mut self, search: &Search, child: u32, points: usize, planes: usize) -> bool {
        let Some(last) = self.chain.frames.last().cloned() else { return false };
        // A straight line passes each portal at most once.
        if self.chain.frames.iter().any(|frame| frame.portal == child) {
            return false;
        }
        let Some((source, pass)) = self.chain.narrow(search.portals, search.first, &last, child, true) else {
            return false;
        };
        self.chain.push_planes(search.portals, (search.first, &source), (child, &pass));
        self.enter(search, child, source, pass, planes, points)
    }

    /// Marks the targets seen in the cell behind directed portal `portal`. If other unseen targets may be
    /// seen beyond that cell, appends the portal to the chain, with the planes from index `planes` on, and
    /// returns `true`. `source`, `pass` and `points` become the fields of these names of the appended
    /// [`ChainFrame`]: the parts of the first portal and of this portal that lines use, and the length to
    /// which the chain's points are later truncated.
    fn enter(
        &mut self,
        search: &Search,
        portal: u32,
        source: Range<usize>,
        pass: Range<usize>,
        planes: usize,
        points: usize,
    ) -> bool {
        let own_planes = planes..self.chain.planes.len();
        let entered = &search.portals.all[portal as usize];
        self.chain.planes.push(outward(&entered.plane, search.portals.margins.keep));
        for &target in search.targets.of(entered.to) {
            if !self.seen[target as usize] && !search.targets.is_outside(target, &self.chain.planes[planes..])
            {
                self.seen[target as usize] = true;
            }
        }
        let set = self.chain.sets.len();
        let more = self.push_reachable_set(search, entered.to, planes);
        self.chain.planes.truncate(own_planes.end);
        if !more {
            self.chain.sets.truncate(set);
            return false;
        }
        let children = search.portals.from(entered.to);
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

    /// Appends to the chain's sets the bitset of the directed portals that can be reached from `cell` without
    /// leaving the inner side of any of the chain's planes from index `planes` on. Returns `false` if no cell
    /// behind these portals holds an unseen target inside the planes.
    fn push_reachable_set(&mut self, search: &Search, cell: u32, planes: usize) -> bool {
        let PortalChain { frames, planes: all_planes, sets, .. } = &mut self.chain;
        let set = sets.len();
        sets.resize(set + search.words, 0);
        // The new set is a subset of the previous frame's set.
        let within = frames.last().map(|frame| frame.set);
        let planes = &all_planes[planes..];
        let source = &search.portals.all[search.first as usize];
        let mut more = false;
        self.flood.begin(search.matrix.cell_count(), cell);
        while let Some(cell) = self.flood.next_cell() {
            for next in search.portals.from(cell) {
                let portal = &search.portals.all[next as usize];
                let (word, bit) = (next as usize / 64, 1 << (next % 64));
                let known = match within {
                    Some(within) => sets[within + word] & bit != 0,
                    None => {
                        search.matrix.sees(search.from, CellId(portal.to))
                            && search.portals.can_follow(source, portal)
                    }
                };
                if !known || is_outside(search.portals, planes, next, (portal.center, portal.radius)) {
                    continue;
                }
                sets[set + word] |= bit;
                if self.flood.reach(portal.to) {
                    let unseen = |&target: &u32| {
                        !self.seen[target as usize] && !search.targets.is_outside(target, planes)
                    };
                    more |= search.targets.of(portal.to).iter().any(unseen);
                }
            }
        }
        more
    }
}
