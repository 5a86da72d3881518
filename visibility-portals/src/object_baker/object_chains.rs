//! The search for the objects seen from one cell: depth first through chains of portals, marking the objects
//! that are inside of the planes of a chain.

use crate::cell_matrix::CellMatrix;
use crate::clip_polygon::{Clip, clip};
use crate::directed_portals::DirectedPortals;
use crate::separating_planes::{Facing, push_separating_planes};
use alloc::vec::Vec;
use core::ops::Range;
use visibility_core::glam::DVec3;
use visibility_core::{
    ObjectId,
    cells::{CellGraph, CellId},
    geometry::Plane,
};

/// The objects, by the cells that they are in.
#[derive(Clone, Debug)]
pub(super) struct Targets {
    /// Center and half size of the box of each object; NaN if it has none.
    boxes: Vec<(DVec3, DVec3)>,
    /// [Index](ObjectId::index) of each object.
    index: Vec<u32>,
    /// By cell: where its objects begin in `of_cell`; one more entry marks the end of the last.
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
            // Every object of the graph is among the sorted ones.
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

    /// Boxes, indices and cells as numbers, for a fingerprint.
    pub(super) fn numbers(&self) -> impl Iterator<Item = u64> + '_ {
        let boxes = self
            .boxes
            .iter()
            .flat_map(|&(middle, half)| middle.to_array().into_iter().chain(half.to_array()));
        let lists = self.index.iter().chain(&self.first).chain(&self.of_cell).copied().map(u64::from);
        boxes.map(f64::to_bits).chain(lists)
    }

    /// The objects in a cell.
    fn of(&self, cell: u32) -> &[u32] {
        &self.of_cell[self.first[cell as usize] as usize..self.first[cell as usize + 1] as usize]
    }

    /// The indices of all objects in some cells, ascending.
    pub(super) fn in_cells(&self, cells: impl Iterator<Item = CellId>) -> Vec<u32> {
        let mut all: Vec<u32> =
            cells.flat_map(|cell| self.of(cell.0)).map(|&target| self.index[target as usize]).collect();
        all.sort_unstable();
        all.dedup();
        all
    }

    /// Whether the box of an object is certainly beyond one of the planes.
    fn is_outside(&self, target: u32, planes: &[Plane]) -> bool {
        let (middle, half) = self.boxes[target as usize];
        planes.iter().any(|plane| {
            let reach = plane.normal.abs().dot(half);
            let distance = plane.signed_distance(middle);
            // The middle, the half size and their products are rounded a few times more than what the bound
            // is for. NaN is not beyond.
            distance + reach < -4.0 * plane.error_bound(middle.abs() + half)
        })
    }
}

/// A portal of the chain that is being looked at.
#[derive(Clone, Debug)]
struct Link {
    portal: u32,
    source: Range<usize>,
    pass: Range<usize>,
    planes: Range<usize>,
    /// Where the set of portals that can be passed after this one begins in `Chains::sets`.
    set: usize,
    next: u32,
    points: usize,
}

/// Scratch memory of the search.
#[derive(Default)]
pub struct Chains {
    seen: Vec<bool>,
    points: Vec<DVec3>,
    planes: Vec<Plane>,
    /// One bit for each portal, a set for each link of the chain.
    sets: Vec<u64>,
    links: Vec<Link>,
    stamps: Vec<u32>,
    stamp: u32,
    queue: Vec<u32>,
}

/// What stays the same while chains that begin with one portal are looked at.
struct Search<'a> {
    portals: &'a DirectedPortals,
    matrix: &'a CellMatrix,
    targets: &'a Targets,
    from: CellId,
    /// The first portal of the chains.
    first: u32,
    /// Words in a set of portals.
    words: usize,
}

impl Chains {
    /// The indices of the objects seen from a cell, ascending; the steps taken; and whether that were more
    /// than `limit`, in which case the list is empty.
    pub(super) fn seen_from(
        &mut self,
        from: CellId,
        portals: &DirectedPortals,
        matrix: &CellMatrix,
        targets: &Targets,
        limit: u64,
    ) -> (Vec<u32>, u64, bool) {
        let cells = portals.first.len() - 1;
        self.seen.clear();
        self.seen.resize(targets.boxes.len(), false);
        self.stamps.resize(cells, 0);
        targets.of(from.0).iter().for_each(|&target| self.seen[target as usize] = true);
        let mut steps = 0;
        for first in portals.from(from.0) {
            let words = portals.all.len().div_ceil(64);
            let search = Search { portals, matrix, targets, from, first, words };
            if !self.search(&search, limit, &mut steps) {
                return (Vec::new(), steps, true);
            }
        }
        let seen = (0..targets.boxes.len()).filter(|&i| self.seen[i]).map(|i| targets.index[i]);
        (seen.collect(), steps, false)
    }

    /// Looks at all chains that begin with one portal. False if the limit of steps is reached.
    fn search(&mut self, search: &Search, limit: u64, steps: &mut u64) -> bool {
        let (all, first) = (&search.portals.all, search.first);
        self.points.clear();
        self.planes.clear();
        self.sets.clear();
        self.links.clear();
        self.points.extend_from_slice(search.portals.vertices_of(&all[first as usize]));
        let whole = 0..self.points.len();
        *steps += 1;
        self.enter(search, first, whole.clone(), whole, 0, 0);
        while let Some(child) = self.next_child(search) {
            *steps += 1;
            if *steps > limit {
                return false;
            }
            let (points, planes) = (self.points.len(), self.planes.len());
            if !self.go_through(search, child, points, planes) {
                self.points.truncate(points);
                self.planes.truncate(planes);
            }
        }
        true
    }

    /// The next portal to lengthen the chain by. Removes links that have no more; `None` when the chain is
    /// empty.
    fn next_child(&mut self, search: &Search) -> Option<u32> {
        while let Some(link) = self.links.last_mut() {
            let end = search.portals.from(search.portals.all[link.portal as usize].to).end;
            while link.next < end {
                let child = link.next;
                link.next += 1;
                if self.sets[link.set + child as usize / 64] >> (child % 64) & 1 != 0 {
                    return Some(child);
                }
            }
            self.points.truncate(link.points);
            self.planes.truncate(link.planes.start);
            self.sets.truncate(link.set);
            self.links.pop();
        }
        None
    }

    /// Lengthens the chain by a portal, if lines can pass it and then reach an object that is not yet seen.
    fn go_through(&mut self, search: &Search, child: u32, points: usize, planes: usize) -> bool {
        let Some(last) = self.links.last().cloned() else { return false };
        // A line goes through each portal once.
        if self.links.iter().any(|link| link.portal == child) {
            return false;
        }
        let Some((source, pass)) = self.narrow(search, &last, child) else { return false };
        let (a, b) = (&search.portals.all[search.first as usize], &search.portals.all[child as usize]);
        let [from, through] = [(a, &source), (b, &pass)].map(|(portal, place)| Facing {
            vertices: &self.points[place.clone()],
            normal: portal.plane.normal,
            sense: 1.0,
        });
        push_separating_planes(from, through, &search.portals.margins, &mut self.planes);
        self.enter(search, child, source, pass, planes, points)
    }

    /// The parts of the first portal and of a next one between which lines can pass the last portal of the
    /// chain.
    fn narrow(&mut self, search: &Search, last: &Link, child: u32) -> Option<(Range<usize>, Range<usize>)> {
        let (all, margins) = (&search.portals.all, &search.portals.margins);
        let portal = &all[child as usize];
        let start = self.points.len();
        self.points.extend_from_slice(search.portals.vertices_of(portal));
        let mut pass = self.clipped(start..self.points.len(), ahead(search, search.first), margins.merge)?;
        for i in last.planes.clone() {
            pass = self.clipped(pass, self.planes[i], margins.merge)?;
        }
        let behind = Plane::new(-portal.plane.normal, margins.keep - portal.plane.offset);
        let mut source = self.clipped(last.source.clone(), behind, margins.merge)?;
        if last.portal != search.first {
            let facing =
                |vertices, of: u32| Facing { vertices, normal: all[of as usize].plane.normal, sense: -1.0 };
            let planes = self.planes.len();
            let target = facing(&self.points[pass.clone()], child);
            push_separating_planes(
                target,
                facing(&self.points[last.pass.clone()], last.portal),
                margins,
                &mut self.planes,
            );
            for i in planes..self.planes.len() {
                source = self.clipped(source, self.planes[i], margins.merge)?;
            }
            self.planes.truncate(planes);
        }
        Some((source, pass))
    }

    /// Clips a polygon to the inner side of a plane; `None` if nothing is left.
    fn clipped(&mut self, polygon: Range<usize>, plane: Plane, merge: f64) -> Option<Range<usize>> {
        match clip(&mut self.points, polygon.clone(), &plane, merge) {
            Clip::All => Some(polygon),
            Clip::Part(start) => Some(start..self.points.len()),
            Clip::Nothing => None,
        }
    }

    /// Marks the objects seen in the cell behind a portal. If others may be seen beyond, appends the portal
    /// to the chain, with the planes from index `planes` on, and returns true.
    fn enter(
        &mut self,
        search: &Search,
        portal: u32,
        source: Range<usize>,
        pass: Range<usize>,
        planes: usize,
        points: usize,
    ) -> bool {
        let bounds = planes..self.planes.len();
        self.planes.push(ahead(search, portal));
        let cell = search.portals.all[portal as usize].to;
        for &target in search.targets.of(cell) {
            if !self.seen[target as usize] && !search.targets.is_outside(target, &self.planes[planes..]) {
                self.seen[target as usize] = true;
            }
        }
        let set = self.sets.len();
        let more = self.reach(search, cell, planes);
        self.planes.truncate(bounds.end);
        if !more {
            self.sets.truncate(set);
            return false;
        }
        let next = search.portals.from(cell).start;
        self.links.push(Link { portal, source, pass, planes: bounds, set, next, points });
        true
    }

    /// Appends the set of portals that can be reached from a cell without leaving the planes from index
    /// `planes` on. False if no cell behind them holds an object inside of the planes that is not yet seen.
    fn reach(&mut self, search: &Search, cell: u32, planes: usize) -> bool {
        let set = self.sets.len();
        self.sets.resize(set + search.words, 0);
        // The set of the link before bounds this one.
        let within = self.links.last().map(|link| link.set);
        if self.stamp == u32::MAX {
            self.stamps.fill(0);
            self.stamp = 0;
        }
        self.stamp += 1;
        self.queue.clear();
        self.queue.push(cell);
        self.stamps[cell as usize] = self.stamp;
        let planes = &self.planes[planes..];
        let source = &search.portals.all[search.first as usize];
        let mut more = false;
        while let Some(cell) = self.queue.pop() {
            for next in search.portals.from(cell) {
                let portal = &search.portals.all[next as usize];
                let (word, bit) = (next as usize / 64, 1 << (next % 64));
                let known = match within {
                    Some(within) => self.sets[within + word] & bit != 0,
                    None => {
                        search.matrix.sees(search.from, CellId(portal.to))
                            && search.portals.can_follow(source, portal)
                    }
                };
                if !known || is_beyond(search, next, planes) {
                    continue;
                }
                self.sets[set + word] |= bit;
                let to = portal.to;
                if self.stamps[to as usize] != self.stamp {
                    self.stamps[to as usize] = self.stamp;
                    self.queue.push(to);
                    let unseen = |&target: &u32| {
                        !self.seen[target as usize] && !search.targets.is_outside(target, planes)
                    };
                    more |= search.targets.of(to).iter().any(unseen);
                }
            }
        }
        more
    }
}

/// The half-space in front of a portal, its plane included.
fn ahead(search: &Search, portal: u32) -> Plane {
    let plane = search.portals.all[portal as usize].plane;
    Plane::new(plane.normal, plane.offset + search.portals.margins.keep)
}

/// Whether a portal is beyond one of the planes.
fn is_beyond(search: &Search, portal: u32, planes: &[Plane]) -> bool {
    let directed = &search.portals.all[portal as usize];
    planes.iter().any(|plane| {
        let middle = plane.signed_distance(directed.center);
        middle < 0.0
            && (middle < -directed.radius
                || search.portals.vertices_of(directed).iter().all(|&v| plane.signed_distance(v) < 0.0))
    })
}
