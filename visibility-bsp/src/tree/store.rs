//! Storage of a tree's fragments: records in one list per node and one list per owner, and their vertices in
//! one array.

use super::node::NONE;
use alloc::vec::Vec;
use hashbrown::HashMap;
use visibility_core::glam::DVec3;

/// Stored data of one fragment: its polygon, its vertices, its node, and its links in two lists.
#[derive(Clone, Copy, Debug)]
pub(super) struct Record {
    /// Number of the owner of the fragment's polygon.
    pub(super) owner: u32,
    /// Index of the polygon among those of the same `build` or `insert` call.
    pub(super) polygon: u32,
    /// Index in `Store::vertices` of the first vertex.
    pub(super) start: u32,
    /// Number of the fragment's vertices.
    pub(super) len: u32,
    /// Index of the node in whose plane the fragment lies.
    pub(super) node: u32,
    /// Index of the next fragment in the node's list, `NONE` at the end.
    pub(super) next: u32,
    /// Index of the previous fragment in the node's list, `NONE` for the first.
    pub(super) previous: u32,
    /// Index of the next fragment in the owner's list, `NONE` at the end.
    pub(super) next_of_owner: u32,
    /// True if the polygon's front faces the front of the node's plane, false if it faces the back.
    pub(super) same_way: bool,
}

/// Number of size classes of vertex ranges. Freed ranges are reused within their class: lengths up to 8 have
/// one class each, longer ones share a class per power of two.
const CLASSES: usize = 40;

/// All fragments of a tree and their vertices. Freed memory is reused for fragments of the same size class.
#[derive(Clone, Debug, Default)]
pub(super) struct Store {
    /// Records by fragment index, free ones included.
    records: Vec<Record>,
    /// Indices in `records` of free records.
    free: Vec<u32>,
    /// Vertices of all fragments, in the tree's coordinates.
    vertices: Vec<DVec3>,
    /// By size class: start indices of free ranges of `vertices`. Empty until the first range is freed.
    free_ranges: Vec<Vec<u32>>,
    /// By owner: index of the owner's first fragment, `NONE` while the owner is being inserted.
    owners: HashMap<u32, u32>,
}

/// Returns the capacity, in vertices, of the range that stores `len` vertices, and its size class.
fn capacity_for(len: usize) -> (usize, usize) {
    if len <= 8 {
        (len, len)
    } else {
        (len.next_power_of_two(), 5 + len.next_power_of_two().ilog2() as usize)
    }
}

impl Store {
    /// Returns the number of fragments stored.
    pub(super) fn len(&self) -> usize {
        self.records.len() - self.free.len()
    }

    /// Returns the record of the fragment with index `id`.
    pub(super) fn record(&self, id: u32) -> &Record {
        &self.records[id as usize]
    }

    /// Returns the vertices of a fragment in the tree's coordinates, in boundary order.
    pub(super) fn vertices(&self, record: &Record) -> &[DVec3] {
        self.vertices_at(record.start, record.len)
    }

    /// Returns `len` entries of `Store::vertices` from index `start` on, in the tree's coordinates.
    #[inline]
    pub(super) fn vertices_at(&self, start: u32, len: u32) -> &[DVec3] {
        &self.vertices[start as usize..][..len as usize]
    }

    /// Stores vertices in the tree's coordinates, in a freed range of the same size class if there is one.
    /// Returns the index in `Store::vertices` of the first.
    pub(super) fn alloc(&mut self, vertices: &[DVec3]) -> u32 {
        let (capacity, class) = capacity_for(vertices.len());
        if let Some(start) = self.free_ranges.get_mut(class).and_then(Vec::pop) {
            self.vertices[start as usize..][..vertices.len()].copy_from_slice(vertices);
            return start;
        }
        let start = self.vertices.len();
        self.vertices.extend_from_slice(vertices);
        self.vertices.resize(start + capacity, DVec3::ZERO);
        start as u32
    }

    /// Frees the range of `len` vertices that begins at index `start`, for reuse.
    pub(super) fn free_range(&mut self, start: u32, len: u32) {
        let class = capacity_for(len as usize).1;
        if self.free_ranges.is_empty() {
            self.free_ranges.resize_with(CLASSES, Vec::new);
        }
        self.free_ranges[class].push(start);
    }

    /// Stores a fragment and puts it at the head of its owner's list and of a node's list, whose head so far
    /// is `head` (`NONE` if empty). Returns the fragment's index, the new head of both lists.
    pub(super) fn add(&mut self, record: Record, head: u32) -> u32 {
        let first = self.owners.entry(record.owner).or_insert(NONE);
        let record = Record { next: head, previous: NONE, next_of_owner: *first, ..record };
        let id = match self.free.pop() {
            Some(id) => {
                self.records[id as usize] = record;
                id
            }
            None => {
                self.records.push(record);
                self.records.len() as u32 - 1
            }
        };
        *first = id;
        if head != NONE {
            self.records[head as usize].previous = id;
        }
        id
    }

    /// Returns the index of an owner's first fragment, `NONE` if the owner has none.
    pub(super) fn first_of(&self, owner: u32) -> u32 {
        self.owners.get(&owner).copied().unwrap_or(NONE)
    }

    /// Empties an owner's list of fragments and returns the index of the first fragment in it, `NONE` if the
    /// list was empty. The caller must free the list's fragments one by one.
    pub(super) fn take_owner(&mut self, owner: u32) -> u32 {
        self.owners.remove(&owner).unwrap_or(NONE)
    }

    /// Frees the fragment with index `id` and unlinks it from its node's list. Returns its record. If the
    /// fragment was the head of the list, the caller must make the record's `next` the new head.
    pub(super) fn free(&mut self, id: u32) -> Record {
        let record = self.records[id as usize];
        if record.previous != NONE {
            self.records[record.previous as usize].next = record.next;
        }
        if record.next != NONE {
            self.records[record.next as usize].previous = record.previous;
        }
        self.free_range(record.start, record.len);
        self.free.push(id);
        record
    }

    /// Copies records and vertices into new memory in the order of `lists`, so that walking the nodes reads
    /// memory sequentially. `lists` yields the head of each node's list, which is updated.
    pub(super) fn pack<'a>(&mut self, lists: impl Iterator<Item = &'a mut u32>) {
        let old = core::mem::take(self);
        self.owners.reserve(old.owners.len());
        self.records.reserve_exact(old.len());
        for head in lists {
            let mut id = core::mem::replace(head, NONE);
            let mut last = NONE;
            while id != NONE {
                let record = old.record(id);
                let start = self.alloc(old.vertices(record));
                // Appended behind the previous fragment, since `add` inserts at the head.
                let new = self.add(Record { start, ..*record }, NONE);
                self.records[new as usize].previous = last;
                match last {
                    NONE => *head = new,
                    last => self.records[last as usize].next = new,
                }
                last = new;
                id = record.next;
            }
        }
        self.vertices.shrink_to_fit();
    }
}
