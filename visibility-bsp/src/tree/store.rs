//! The parts of polygons that a tree holds: in a list per node and a list per owner, their vertices in one
//! array.

use super::node::NONE;
use alloc::vec::Vec;
use visibility_core::glam::DVec3;

/// A fragment as it is stored.
#[derive(Clone, Copy, Debug)]
pub(super) struct Record {
    pub(super) owner: u32,
    pub(super) polygon: u32,
    /// Where its vertices begin, and how many they are.
    pub(super) start: u32,
    pub(super) len: u32,
    pub(super) node: u32,
    /// The neighbours in the node's list.
    pub(super) next: u32,
    pub(super) previous: u32,
    pub(super) next_of_owner: u32,
    /// Whether its front is the front of the node's plane.
    pub(super) same_way: bool,
}

/// Longest polygons whose room is kept for others of the same length; longer ones share by powers of two.
const CLASSES: usize = 40;

/// All fragments of a tree and their vertices. What is freed is used again by fragments as long.
#[derive(Clone, Debug, Default)]
pub(super) struct Store {
    records: Vec<Record>,
    free: Vec<u32>,
    vertices: Vec<DVec3>,
    room: Vec<Vec<u32>>,
    /// By owner, the number of its first fragment, `NONE` if it has none.
    owners: Vec<u32>,
}

/// How much room a polygon of `len` vertices takes, and in which class of equal rooms that is.
fn room_for(len: usize) -> (usize, usize) {
    if len <= 8 {
        (len, len)
    } else {
        (len.next_power_of_two(), 5 + len.next_power_of_two().ilog2() as usize)
    }
}

impl Store {
    pub(super) fn len(&self) -> usize {
        self.records.len() - self.free.len()
    }

    pub(super) fn memory(&self) -> usize {
        self.records.capacity() * size_of::<Record>() + self.vertices.capacity() * size_of::<DVec3>()
    }

    pub(super) fn record(&self, id: u32) -> &Record {
        &self.records[id as usize]
    }

    pub(super) fn vertices(&self, record: &Record) -> &[DVec3] {
        self.vertices_at(record.start, record.len)
    }

    #[inline]
    pub(super) fn vertices_at(&self, start: u32, len: u32) -> &[DVec3] {
        &self.vertices[start as usize..][..len as usize]
    }

    /// Stores vertices and returns the index of the first.
    pub(super) fn keep(&mut self, vertices: &[DVec3]) -> u32 {
        let (room, class) = room_for(vertices.len());
        if let Some(start) = self.room.get_mut(class).and_then(Vec::pop) {
            self.vertices[start as usize..][..vertices.len()].copy_from_slice(vertices);
            return start;
        }
        let start = self.vertices.len();
        self.vertices.extend_from_slice(vertices);
        self.vertices.resize(start + room, DVec3::ZERO);
        start as u32
    }

    /// Gives the room of vertices back.
    pub(super) fn give_back(&mut self, start: u32, len: u32) {
        let class = room_for(len as usize).1;
        if self.room.is_empty() {
            self.room.resize_with(CLASSES, Vec::new);
        }
        self.room[class].push(start);
    }

    /// Puts a fragment at the head of the list of its owner and of a node's list, which begins with `head`.
    /// Returns its number.
    pub(super) fn add(&mut self, record: Record, head: u32) -> u32 {
        let owner = record.owner as usize;
        if self.owners.len() <= owner {
            self.owners.resize(owner + 1, NONE);
        }
        let record = Record { next: head, previous: NONE, next_of_owner: self.owners[owner], ..record };
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
        self.owners[owner] = id;
        if head != NONE {
            self.records[head as usize].previous = id;
        }
        id
    }

    pub(super) fn first_of(&self, owner: u32) -> u32 {
        self.owners.get(owner as usize).copied().unwrap_or(NONE)
    }

    /// Makes an owner have no fragments, which are still to be freed one by one, from the one returned.
    pub(super) fn take_owner(&mut self, owner: u32) -> u32 {
        self.owners.get_mut(owner as usize).map_or(NONE, |first| core::mem::replace(first, NONE))
    }

    /// Frees a fragment, taken out of its node's list. Returns what it was; if it was the list's first, the
    /// list now begins with its `next`.
    pub(super) fn free(&mut self, id: u32) -> Record {
        let record = self.records[id as usize];
        if record.previous != NONE {
            self.records[record.previous as usize].next = record.next;
        }
        if record.next != NONE {
            self.records[record.next as usize].previous = record.previous;
        }
        self.give_back(record.start, record.len);
        self.free.push(id);
        record
    }

    /// Copies records and vertices into new memory in the order of `lists` (the first fragment of each node),
    /// so that walking the nodes is walking memory; the heads are brought up to date.
    pub(super) fn pack<'a>(&mut self, lists: impl Iterator<Item = &'a mut u32>) {
        let old = core::mem::take(self);
        self.owners.resize(old.owners.len(), NONE);
        self.records.reserve_exact(old.len());
        for head in lists {
            let mut id = core::mem::replace(head, NONE);
            let mut last = NONE;
            while id != NONE {
                let record = old.record(id);
                let start = self.keep(old.vertices(record));
                // Appended behind the one before, by hand, since `add` puts at the head.
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
