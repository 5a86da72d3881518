//! Union-find: sets of numbers, each a tree in a list of parents.
//!
//! Based on: Robert Tarjan and Jan van Leeuwen, "Worst-Case Analysis of Set Union Algorithms", 1984 (path
//! halving).

/// Returns the root of the tree that has `at`, and halves the path to it. `parent` has for each number
/// another one of its set, and for the root the root itself. Returns `at` if `parent` does not have it.
///
/// To join two sets, make the root of one the parent of the other's root. A call then takes a time that grows
/// at most with the logarithm of the size of the set, on average over many calls.
///
/// ```
/// use visibility_core::union_find::root;
/// let mut parent = [0, 1, 2, 3];
/// for [a, b] in [[0, 2], [2, 3]] {
///     let (a, b) = (root(&mut parent, a), root(&mut parent, b));
///     parent[b as usize] = a;
/// }
/// assert_eq!([0, 1, 2, 3].map(|at| root(&mut parent, at)), [0, 1, 0, 0]);
/// ```
#[inline]
pub fn root(parent: &mut [u32], mut at: u32) -> u32 {
    while let Some(&above) = parent.get(at as usize)
        && above != at
    {
        let next = parent.get(above as usize).copied().unwrap_or(above);
        parent[at as usize] = next;
        at = next;
    }
    at
}
