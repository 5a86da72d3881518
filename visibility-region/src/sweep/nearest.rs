//! Collection of the occluders of one direction, nearest first and in portions. Where the nearest houses hide
//! everything, a sweep never touches the rest of a city.

use super::direction::{CellBox, Direction, LocalBox};
use super::effort::Work;
use super::occludees::Item;
use super::occluder::{Occluder, Source};
use super::pieces::Pieces;
use super::planes::{Candidate, Cone};
use super::surfaces::Surfaces;
use crate::solids;
use alloc::collections::BinaryHeap;
use alloc::vec::Vec;
use core::cmp::Ordering;
use core::ops::Range;
use visibility_core::bits::Bits;
use visibility_core::walk::{BoxHierarchy, Child, SceneHierarchy};
use visibility_core::{ObjectId, Scene};

/// Number of occluding objects in the first portion. Each further portion is twice as large. Planes behind
/// occluders are chosen portion by portion: a smaller number here is faster, and chooses worse planes.
const FIRST_PORTION: usize = 4096;

/// Greatest number of occludees with which occluders are skipped that no ray to any of them can meet. With
/// more occludees, testing an occluder for that would take longer than drawing it.
const FEW: usize = 128;

/// Cost of an entry of the queue, in nanoseconds of [`Work`].
const ENTRY: u64 = 150;
/// Cost of each triangle when pieces are made, in nanoseconds of [`Work`].
const TRIANGLE: u64 = 300;

/// The occluders of a scene that one call may use.
#[derive(Clone, Copy)]
pub(crate) struct Occluders<'a> {
    pub(crate) scene: &'a Scene,
    /// Indices of the objects that may occlude.
    pub(crate) occluding: &'a Bits,
    pub(crate) surfaces: &'a Surfaces,
    /// Box around the viewcell.
    pub(crate) cell_box: &'a CellBox,
}

/// A node or an object of the scene's hierarchy, ordered by depth so that a max-heap returns the nearest
/// first.
#[derive(Clone, Debug)]
struct Entry {
    child: Child,
    bounds: LocalBox,
}

impl Ord for Entry {
    fn cmp(&self, other: &Self) -> Ordering {
        other.bounds.lo.z.total_cmp(&self.bounds.lo.z)
    }
}

impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Entry {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Entry {}

/// The occluders of one direction that have been collected so far, and the queue of nodes and objects still
/// to be visited.
#[derive(Clone, Debug)]
pub(crate) struct Nearest {
    queue: BinaryHeap<Entry>,
    /// Indices of the clusters of surfaces whose pieces have been collected.
    listed: Bits,
    /// The collected occluders. The first `settled` of them are sorted by depth, and keep their indices: no
    /// occluder that is collected later comes before them.
    occluders: Vec<Candidate>,
    settled: usize,
    portion: usize,
    /// Number of occluding objects collected for the present portion.
    count: usize,
    /// Range of the depths of planes, in metres, that the last portion was collected for. All occluders that
    /// begin in front of the range's end are collected.
    complete: Range<f64>,
}

impl Nearest {
    /// Begins with the occluders within `cone`. With `by_node`, they are found by the hierarchy of the scene,
    /// which must not change as long as this value is used. Otherwise all occluders are tested here, one by
    /// one.
    pub(crate) fn new(all: &Occluders<'_>, direction: &Direction, cone: &Cone, by_node: bool) -> Self {
        let mut new = Self {
            queue: BinaryHeap::new(),
            listed: Bits::new(all.surfaces.cluster_count()),
            occluders: Vec::new(),
            settled: 0,
            portion: FIRST_PORTION,
            count: 0,
            complete: 0.0..0.0,
        };
        if by_node {
            new.push_children(all, direction, cone, None);
        } else {
            for id in all.occluding.iter().filter_map(|index| all.scene.id_at(index)) {
                let Ok(bounds) = all.scene.bounds(id) else { continue };
                let (child, bounds) = (Child::Object(id), direction.local_box(&bounds));
                if cone.meets(direction, &bounds) {
                    new.queue.push(Entry { child, bounds });
                }
            }
        }
        new
    }

    /// Collects the next portion of occluders. `asked`: the occludees that are still to be tested. Occluders
    /// that no ray to them can meet may be left out. `None` if all occluders in the cone are needed. Returns
    /// the range of depths, in metres, within which planes can now be placed, since all occluders in front of
    /// them are collected. `None` after the last portion, and if `work` is used up before the portion is
    /// complete: the next call then continues it.
    pub(crate) fn advance(
        &mut self,
        all: &Occluders<'_>,
        pieces: &mut Pieces,
        direction: &Direction,
        cone: &Cone,
        asked: Option<&[Item]>,
        work: &mut Work,
    ) -> Option<Range<f64>> {
        if self.is_done() {
            return None;
        }
        let before = self.complete.end;
        // With few occludees left, occluders beside all lines of sight to them are skipped. With many, this
        // test would cost more than drawing.
        let asked = asked.filter(|items| before > 0.0 && items.len() <= FEW);
        let mut end = f64::INFINITY;
        while let Some(entry) = self.queue.pop() {
            if work.is_used_up() {
                self.queue.push(entry);
                return None;
            }
            work.use_up(1, ENTRY);
            // The portion is full. The planes that it serves end where the next occluder begins.
            if self.count >= self.portion && entry.bounds.lo.z > before.max(cone.near) {
                end = entry.bounds.lo.z;
                self.queue.push(entry);
                break;
            }
            if asked.is_some_and(|items| {
                !items.iter().any(|item| direction.is_between(&entry.bounds, &item.bounds))
            }) {
                continue;
            }
            match entry.child {
                Child::Node(node) => self.push_children(all, direction, cone, Some(node)),
                Child::Object(id) => {
                    self.count += usize::from(all.occluding.contains(id.index()));
                    let triangles = self.collect(all, pieces, direction, cone, id);
                    work.use_up(triangles, TRIANGLE);
                }
            }
        }
        // Occluders that begin before the range's end are final, in the order in which they begin. Portions
        // double in size, so that their number is logarithmic.
        let open = &mut self.occluders[self.settled..];
        open.sort_by(|a, b| a.begins.total_cmp(&b.begins));
        self.settled += open.partition_point(|occluder| occluder.begins < end);
        (self.portion, self.count) = (2 * self.portion, 0);
        self.complete = before..end;
        Some(self.complete.clone())
    }

    /// Returns whether the last portion is collected.
    pub(crate) fn is_done(&self) -> bool {
        self.complete.end == f64::INFINITY
    }

    /// Returns the occluders collected so far that begin in front of the end of the last portion's range.
    /// Indices of earlier occluders do not change.
    pub(crate) fn occluders(&self) -> &[Candidate] {
        &self.occluders[..self.settled]
    }

    fn push_children(
        &mut self,
        all: &Occluders<'_>,
        direction: &Direction,
        cone: &Cone,
        node: Option<usize>,
    ) {
        SceneHierarchy.for_each_child(all.scene, node, &mut |child, bounds| {
            let bounds = direction.local_box(&bounds);
            if cone.meets(direction, &bounds) {
                self.queue.push(Entry { child, bounds });
            }
        });
    }

    /// Collects the occluders of an object and of its cluster. Returns a measure of the work: the number of
    /// the cluster's triangles, or the number of the mesh's parts if the object has no cluster.
    fn collect(
        &mut self,
        all: &Occluders<'_>,
        pieces: &mut Pieces,
        direction: &Direction,
        cone: &Cone,
        id: ObjectId,
    ) -> usize {
        if !all.occluding.contains(id.index()) {
            return 0;
        }
        let mut push = |pieces: &Pieces, source| {
            self.occluders.extend(candidate(all, pieces, direction, cone, source));
        };
        if let Some(cluster) = all.surfaces.cluster_of(id.index()) {
            if !self.listed.insert(cluster) {
                return 0;
            }
            for piece in pieces.find(all.surfaces, cluster, all.occluding, all.cell_box) {
                push(pieces, Source::Piece(piece));
            }
            return all.surfaces.triangles_of(cluster).len();
        }
        let Some((mesh, _)) = all.scene.occluder(id) else { return 0 };
        (0..solids::pieces(mesh).len()).for_each(|part| push(pieces, Source::Part(id, part as u32)));
        mesh.triangles().len()
    }
}

impl<'a> Occluders<'a> {
    /// Returns an occluder in local coordinates of a direction. `None` if its transform flattens it.
    pub(crate) fn place(
        &self,
        pieces: &'a Pieces,
        direction: &Direction,
        source: Source,
    ) -> Option<Occluder<'a>> {
        match source {
            Source::Piece(piece) => {
                Some(Occluder::piece(direction, self.surfaces, pieces, pieces.get(piece)))
            }
            Source::Part(id, part) => {
                let (mesh, ref transform) = self.scene.occluder(id)?;
                Occluder::new(direction, solids::pieces(mesh).get(part as usize)?, transform)
            }
        }
    }
}

/// Returns the data of an occluder that is needed to choose planes. `None` if the occluder cannot cover a
/// pixel of the cone, or if its coordinates are too imprecise.
fn candidate(
    all: &Occluders<'_>,
    pieces: &Pieces,
    direction: &Direction,
    cone: &Cone,
    source: Source,
) -> Option<Candidate> {
    let mut joins = false;
    if let Source::Piece(piece) = source {
        let piece = pieces.get(piece);
        joins = piece.joins;
        if !cone.meets(direction, &direction.local_box(&piece.bounds)) {
            return None;
        }
    }
    cone.candidate(direction, &all.place(pieces, direction, source)?, source, joins)
}
