//! The search for the objects seen from one cell: depth first through chains of portals. Objects that are not
//! outside the planes of some chain are marked as seen.

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

/// The objects that the graph lists, numbered as targets from 0 in order of their ids, and the targets in
/// each cell.
#[derive(Clone, Debug)]
pub(super) struct Targets {
    /// By target: centre and half extents of the object's box in world space. NaN if the object has no valid
    /// box.
    boxes: Vec<(DVec3, DVec3)>,
    /// By target (object number within the bake): the object's [index](ObjectId::index) in the scene.
    index: Vec<u32>,
    /// CSR offsets: by cell index, the position in `of_cell` of the cell's first target; one more entry
    /// marks the end of the last cell.
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

    /// Tests whether the box of a target is certainly outside one of the planes. `false` for a box that
    /// touches or is NaN, and without planes.
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

/// A portal of the current chain. `source` (the reachable part of the first portal) and `pass` (the reachable
/// part of this portal) are ranges of `Chains::points`; `planes` is a range of `Chains::planes`; `next` is
/// the next portal to inspect; `points` is the length of `Chains::points` before this link.
#[derive(Clone, Debug)]
struct Link {
    portal: u32,
    source: Range<usize>,
    pass: Range<usize>,
    planes: Range<usize>,
    /// Offset in `Chains::sets` of this link's set: the directed portals that lines through this portal may
    /// pass later, one bit each.
    set: usize,
    next: u32,
    points: usize,
}

/// Scratch memory of the search for the objects seen from a cell.
#[derive(Default)]
pub struct Chains {
    seen: Vec<bool>,
    points: Vec<DVec3>,
    planes: Vec<Plane>,
    /// Bitsets over the directed portals, one for each link of the chain. `Link::set` is the offset of a
    /// bitset.
    sets: Vec<u64>,
    links: Vec<Link>,
    stamps: Vec<u32>,
    stamp: u32,
    queue: Vec<u32>,
}

/// The input of a search that is fixed for all chains with the same first portal.
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
    /// Searches the objects seen from cell `from`. Returns their object indices, ascending; the number of
    /// steps taken; and whether the steps exceeded `limit`, in which case the list is empty.
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

    /// Searches all chains that begin with the portal `search.first`, and marks the targets reached in
    /// `seen`. Adds to `steps`; returns `false` once they exceed `limit`.
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

    /// Returns the next directed portal by which to extend the chain, and pops the links that have none left.
    /// `None` when the chain is empty.
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

    /// Extends the chain by portal `child` if lines can pass it and then reach a target that is not yet seen.
    /// Returns `false` if the chain was not extended; the caller then truncates to `points` and `planes`, the
    /// lengths of the lists before the call.
    fn go_through(&mut self, search: &Search, child: u32, points: usize, planes: usize) -> bool {
        let Some(last) = self.links.last().cloned() else { return false };
        // A straight line passes each portal at most once.
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

    /// Returns the part of the first portal and the part of portal `child` between which lines can pass the
    /// last portal of the chain, as ranges of `points`. `None` if either part is empty. Clipped polygons are
    /// appended to `points`.
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

    /// Clips a polygon to the inner side of a plane; the argument and the result are ranges of `points`.
    /// `None` if nothing is left. `merge` is the distance below which vertices become one.
    fn clipped(&mut self, polygon: Range<usize>, plane: Plane, merge: f64) -> Option<Range<usize>> {
        match clip(&mut self.points, polygon.clone(), &plane, merge) {
            Clip::All => Some(polygon),
            Clip::Part(start) => Some(start..self.points.len()),
            Clip::Nothing => None,
        }
    }

    /// Marks the targets seen in the cell behind `portal`. If other unseen targets may be seen beyond,
    /// appends the portal to the chain, with the planes from index `planes` on, and returns `true`. `points`
    /// is the length of the points list to restore later.
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

    /// Appends to `sets` the bitset of the portals that can be reached from `cell` without leaving the planes
    /// from index `planes` on. Returns `false` if no cell behind these portals holds an unseen target inside
    /// the planes.
    fn reach(&mut self, search: &Search, cell: u32, planes: usize) -> bool {
        let set = self.sets.len();
        self.sets.resize(set + search.words, 0);
        // The new set is a subset of the previous link's set.
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

/// Returns the half-space in front of a directed portal, moved back by the margin so that the portal's plane
/// is included.
fn ahead(search: &Search, portal: u32) -> Plane {
    let plane = search.portals.all[portal as usize].plane;
    Plane::new(plane.normal, plane.offset + search.portals.margins.keep)
}

/// Tests whether all vertices of a directed portal are outside one of the planes. `false` without planes.
fn is_beyond(search: &Search, portal: u32, planes: &[Plane]) -> bool {
    let directed = &search.portals.all[portal as usize];
    planes.iter().any(|plane| {
        let middle = plane.signed_distance(directed.center);
        middle < 0.0
            && (middle < -directed.radius
                || search.portals.vertices_of(directed).iter().all(|&v| plane.signed_distance(v) < 0.0))
    })
}
