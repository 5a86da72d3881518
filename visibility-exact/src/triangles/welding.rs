//! Numbers of equal vertices and edges among triangles that change.

use alloc::collections::BTreeMap;
use alloc::vec::Vec;
use visibility_core::glam::Vec3;

/// Returns the key by which vertices with equal coordinates are found.
pub(super) fn vertex_key(position: Vec3) -> [u32; 3] {
    position.to_array().map(f32::to_bits)
}

/// Returns the key by which edges between the same vertices are found: the numbers of the ends of edge `k`,
/// the lower first.
pub(super) fn edge_key(vertices: [u32; 3], k: usize) -> [u32; 2] {
    let (a, b) = (vertices[k], vertices[(k + 1) % 3]);
    [a.min(b), a.max(b)]
}

/// Numbers of equal things: those of the time when the scene was prepared, by rank, and later ones.
#[derive(Clone, Debug)]
pub(super) struct Numbers<K> {
    /// Keys in ascending order. The number of a key is its position.
    first: Vec<K>,
    /// For each later key, its number and how many triangles use it.
    later: BTreeMap<K, (u32, u32)>,
    /// Numbers of later keys that no triangle uses any more.
    free: Vec<u32>,
    /// Exclusive upper bound on all numbers.
    limit: u32,
}

impl<K: Ord + Copy> Numbers<K> {
    fn new(first: Vec<K>) -> Self {
        let limit = first.len() as u32;
        Self { first, later: BTreeMap::new(), free: Vec::new(), limit }
    }

    /// Returns the number of a key, for one more use.
    pub(super) fn take(&mut self, key: K) -> u32 {
        if let Ok(rank) = self.first.binary_search(&key) {
            return rank as u32;
        }
        let (free, limit) = (&mut self.free, &mut self.limit);
        let (number, uses) = self.later.entry(key).or_insert_with(|| {
            let number = free.pop().unwrap_or_else(|| {
                *limit += 1;
                *limit - 1
            });
            (number, 0)
        });
        *uses += 1;
        *number
    }

    /// Ends one use of a key that [`take`](Self::take) has returned a number for, or that is of the first.
    pub(super) fn release(&mut self, key: K) {
        if self.first.binary_search(&key).is_err()
            && let Some((number, uses)) = self.later.get_mut(&key)
        {
            *uses -= 1;
            if *uses == 0 {
                self.free.push(*number);
                self.later.remove(&key);
            }
        }
    }
}

/// Tables that give triangles of changed objects the numbers of equal vertices and edges.
#[derive(Clone, Debug)]
pub(super) struct Welding {
    /// For each object index of the scene, the position in the list of objects. `u32::MAX` for none.
    pub(super) place_of: Vec<u32>,
    pub(super) vertices: Numbers<[u32; 3]>,
    pub(super) edges: Numbers<[u32; 2]>,
    /// Occluding triangles at each edge at which they have changed.
    pub(super) lists: BTreeMap<u32, Vec<u32>>,
    /// Edges of triangles that were taken away since `lists` was last cleaned, with repetitions.
    pub(super) stale_edges: Vec<u32>,
    /// Indices of unused elements of `pieces`.
    pub(super) free_pieces: Vec<u32>,
    /// Indices of the occluding triangles that are not in the first tree.
    pub(super) added: Vec<u32>,
}

impl Welding {
    /// Makes the value of objects and triangles that have not changed yet: the object at each index of the
    /// scene, and the keys of vertices and edges by their numbers, which are the ranks of the keys.
    pub(super) fn new(place_of: Vec<u32>, vertices: Vec<[u32; 3]>, edges: Vec<[u32; 2]>) -> Self {
        Self {
            place_of,
            vertices: Numbers::new(vertices),
            edges: Numbers::new(edges),
            lists: BTreeMap::new(),
            stale_edges: Vec::new(),
            free_pieces: Vec::new(),
            added: Vec::new(),
        }
    }

    pub(super) fn edge_limit(&self) -> usize {
        self.edges.limit as usize
    }

    /// Returns whether all occluding triangles are in the first tree.
    #[cfg(test)]
    pub(super) fn is_merged(&self) -> bool {
        self.added.is_empty()
    }

    /// Returns the occluding triangles at an edge, if these have changed.
    pub(super) fn triangles_at(&self, edge: u32) -> Option<&[u32]> {
        let is_later = edge as usize >= self.edges.first.len();
        self.lists.get(&edge).map(Vec::as_slice).or(is_later.then_some(&[]))
    }
}
