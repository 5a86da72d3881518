//! Groups of neighbouring viewcells. A bake first sweeps the scene once for each group, to find the objects
//! that are hidden from all of the group's viewcells. The remaining objects are then swept from each single
//! viewcell.

use visibility_core::glam::DVec3;
use visibility_core::pvs::{Viewcell, Viewcells};

/// Greatest number of viewcells in a group.
const MAX_CELLS: usize = 16;

/// Number of viewcells in the first portion of a bake. The second portion has as many, and each further
/// portion has as many as all portions before it.
const FIRST_CELLS: usize = 64;

/// Greatest ratio of the volume of the box around a group to the sum of the volumes of its viewcells. A group
/// of one viewcell may exceed it.
const SPREAD: f64 = 2.5;

/// Groups of at most [`MAX_CELLS`] viewcells that lie close together. Each viewcell is in exactly one group.
///
/// The viewcells of each portion of the bake are halved along the longest axis of the box around them until
/// they are few enough, and the volume of the box around them is at most [`SPREAD`] times the sum of theirs.
/// The groups depend only on the boxes of the viewcells and their order, not on objects or settings, so each
/// shard of a bake finds the same groups.
pub(crate) struct CellGroups {
    /// Number of the group of each viewcell. Groups are numbered in the order of their first viewcells.
    pub of: Vec<u32>,
    /// Indices of the viewcells of each group, ascending.
    pub cells: Vec<Vec<u32>>,
}

impl CellGroups {
    pub(crate) fn new(viewcells: &Viewcells) -> Self {
        let all = viewcells.cells();
        let mut cells = Vec::new();
        // A portion is completed before the next is begun, so a group must not extend over two portions.
        let mut waiting = Vec::new();
        let (mut start, mut end) = (0, FIRST_CELLS);
        while start < all.len() {
            waiting.push((start as u32..end.min(all.len()) as u32).collect::<Vec<u32>>());
            (start, end) = (end, end.saturating_mul(2));
        }
        while let Some(mut part) = waiting.pop() {
            if part.is_empty() {
                continue;
            }
            let bounds = bounds(all, &part);
            let volume = |cell: &Viewcell| (cell.max - cell.min).max(DVec3::ZERO).element_product();
            let sum: f64 = part.iter().map(|&cell| volume(&all[cell as usize])).sum();
            if part.len() == 1 || part.len() <= MAX_CELLS && volume(&bounds) <= SPREAD * sum {
                part.sort_unstable();
                cells.push(part);
                continue;
            }
            waiting.extend(halves(all, part));
        }
        cells.sort_unstable();
        let mut of = vec![0; all.len()];
        for (group, cells) in (0..).zip(&cells) {
            cells.iter().for_each(|&cell| of[cell as usize] = group);
        }
        Self { of, cells }
    }

    /// Returns the portion of the bake that a group belongs to, 0 for the first.
    pub(crate) fn portion(&self, group: u32) -> u32 {
        let first = self.cells[group as usize].first().map_or(0, |&cell| cell as usize);
        usize::BITS - (first / FIRST_CELLS).leading_zeros()
    }
}

/// Divides viewcells by their centres into two halves, along the longest axis of the box around them. If
/// their number is odd, the second half has one more.
pub(crate) fn halves(all: &[Viewcell], mut part: Vec<u32>) -> [Vec<u32>; 2] {
    let bounds = bounds(all, &part);
    let extent = bounds.max - bounds.min;
    let axis = (1..3).fold(0, |most, axis| if extent[axis] > extent[most] { axis } else { most });
    let key = |&cell: &u32| all[cell as usize].min[axis] * 0.5 + all[cell as usize].max[axis] * 0.5;
    part.sort_unstable_by(|a, b| key(a).total_cmp(&key(b)).then(a.cmp(b)));
    let rest = part.split_off(part.len() / 2);
    [part, rest]
}

/// Returns the box around the viewcells with the given numbers. Empty viewcells are ignored. The box is empty
/// if all viewcells are.
pub(crate) fn bounds(all: &[Viewcell], some: &[u32]) -> Viewcell {
    let usable = some.iter().map(|&cell| &all[cell as usize]).filter(|cell| cell.min.cmple(cell.max).all());
    let (min, max) = usable.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), cell| {
        (min.min(cell.min), max.max(cell.max))
    });
    Viewcell::from_box(min, max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_are_compact_and_those_of_the_first_viewcells_come_first() {
        // Two layers of 20 x 20 viewcells, one empty viewcell, and one far away.
        let at = |i: u32| DVec3::new(f64::from(i % 20), f64::from(i / 20 % 20), f64::from(i / 400)) * 4.0;
        let mut cells: Vec<Viewcell> =
            (0..800).map(|i| Viewcell::from_box(at(i), at(i) + DVec3::splat(4.0))).collect();
        cells.push(Viewcell::from_box(DVec3::ONE, DVec3::ZERO));
        cells.push(Viewcell::from_box(DVec3::splat(1e6), DVec3::splat(1e6 + 1.0)));
        let viewcells = Viewcells::new(cells);
        let groups = CellGroups::new(&viewcells);
        let mut all: Vec<u32> = groups.cells.concat();
        all.sort_unstable();
        assert!(all.into_iter().eq(0..802), "each viewcell is in one group");
        for (number, members) in (0..).zip(&groups.cells) {
            assert!(members.is_sorted() && members.len() <= MAX_CELLS, "group {number}: {members:?}");
            assert!(
                members.iter().all(|&cell| groups.of[cell as usize] == number),
                "group {number}: each of {members:?} knows its group"
            );
            let bounds = bounds(viewcells.cells(), members);
            let volume = (bounds.max - bounds.min).max(DVec3::ZERO).element_product();
            assert!(volume <= SPREAD * 64.0 * members.len() as f64, "{members:?}");
            assert!(members[0] >= 64 || members.iter().all(|&cell| cell < 64), "{members:?}");
        }
        assert!(groups.cells.len() < 100, "{}", groups.cells.len());
        assert!(groups.cells.is_sorted(), "in the order of their first viewcells");
    }

    /// The box around a group holds its flat viewcells too. A viewcell without a volume ends the division.
    #[test]
    fn flat_and_endless_viewcells_are_in_their_groups() {
        let flat = Viewcell::from_box(DVec3::new(5.0, 0.0, 0.0), DVec3::new(5.0, 1.0, 1.0));
        let cells = [Viewcell::from_box(DVec3::ZERO, DVec3::ONE), flat];
        assert_eq!(bounds(&cells, &[0, 1]).max, DVec3::new(5.0, 1.0, 1.0), "the box around both");
        let endless = Viewcell::from_box(DVec3::ZERO, DVec3::new(f64::INFINITY, 1.0, 0.0));
        assert_eq!(CellGroups::new(&Viewcells::new([endless])).cells, [[0]], "a group of its own");
    }
}
