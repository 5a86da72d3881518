//! Sets of the voxels of a box, and the parts of a set that are connected through faces.
//!
//! The *place* of a voxel is its position in the box, as x, y and z from 0. Voxels are numbered along x, then
//! y, then z. A connected part is found row by row: all connected voxels of a row along x are taken at once,
//! and the search continues in the four adjacent rows.

/// A set of voxels of a box, as one bit for each voxel.
#[derive(Clone)]
pub(super) struct VoxelSet {
    /// Number of voxels of the box on each axis.
    pub counts: [usize; 3],
    bits: Vec<u64>,
}

/// Bounds of a set of voxels: the first and the last place on each axis, both included.
pub(super) struct VoxelBounds {
    pub first: [usize; 3],
    pub last: [usize; 3],
}

/// Returns the place of the voxel with number `voxel`. `counts` are the numbers of voxels of the box on each
/// axis.
pub(super) fn voxel_place(voxel: usize, counts: [usize; 3]) -> [usize; 3] {
    [voxel % counts[0], voxel / counts[0] % counts[1], voxel / counts[0] / counts[1]]
}

/// Returns the number of the voxel at a place. `counts` are the numbers of voxels of the box on each axis.
pub(super) fn voxel_number(place: [usize; 3], counts: [usize; 3]) -> usize {
    place[0] + counts[0] * (place[1] + counts[1] * place[2])
}

impl VoxelSet {
    /// Returns the empty set of the voxels of a box.
    pub(super) fn empty(counts: [usize; 3]) -> Self {
        Self { counts, bits: vec![0; counts.iter().product::<usize>().div_ceil(64)] }
    }

    /// Returns the numbers of all voxels of the box.
    pub(super) fn all(&self) -> std::ops::Range<usize> {
        0..self.counts.iter().product()
    }

    pub(super) fn contains(&self, voxel: usize) -> bool {
        self.bits[voxel / 64] >> (voxel % 64) & 1 == 1
    }

    pub(super) fn insert(&mut self, voxel: usize) {
        self.bits[voxel / 64] |= 1 << (voxel % 64);
    }

    /// Returns the voxels of this set that are not in `other`, a set of voxels of the same box.
    pub(super) fn without(mut self, other: &Self) -> Self {
        self.bits.iter_mut().zip(&other.bits).for_each(|(bits, other)| *bits &= !other);
        self
    }

    /// Returns the set of the voxels of the box that are not in this set.
    pub(super) fn complement(mut self) -> Self {
        self.bits.iter_mut().for_each(|bits| *bits = !*bits);
        self
    }

    /// Removes the part of the set that is connected with `voxel`, and returns the part's bounds. `None` if
    /// `voxel` is not in the set.
    pub(super) fn take_part(&mut self, voxel: usize) -> Option<VoxelBounds> {
        if !self.contains(voxel) {
            return None;
        }
        let place = voxel_place(voxel, self.counts);
        let mut bounds = VoxelBounds { first: place, last: place };
        self.take_connected(vec![voxel as u32], |first, last| {
            bounds.add(first);
            bounds.add([last, first[1], first[2]]);
        });
        Some(bounds)
    }

    /// Removes from the set all voxels that are connected with those of `list`. Calls `each` with runs of the
    /// removed voxels along x: the place of the first, and the x of the last.
    pub(super) fn take_connected(&mut self, mut list: Vec<u32>, mut each: impl FnMut([usize; 3], usize)) {
        let counts = self.counts;
        let strides = [1, counts[0], counts[0] * counts[1]];
        while let Some(voxel) = list.pop() {
            if !self.contains(voxel as usize) {
                continue;
            }
            let place = voxel_place(voxel as usize, counts);
            let row = voxel as usize - place[0];
            let (mut first, mut last) = (place[0], place[0]);
            while first > 0 && self.contains(row + first - 1) {
                first -= 1;
            }
            while last + 1 < counts[0] && self.contains(row + last + 1) {
                last += 1;
            }
            (row + first..=row + last).for_each(|voxel| self.bits[voxel / 64] &= !(1 << (voxel % 64)));
            each([first, place[1], place[2]], last);
            for axis in 1..3 {
                let lower = (place[axis] > 0).then(|| row - strides[axis]);
                let upper = (place[axis] + 1 < counts[axis]).then(|| row + strides[axis]);
                for row in lower.into_iter().chain(upper) {
                    let is_start =
                        |&x: &usize| self.contains(row + x) && (x == first || !self.contains(row + x - 1));
                    list.extend((first..=last).filter(is_start).map(|x| (row + x) as u32));
                }
            }
        }
    }
}

impl VoxelBounds {
    /// Extends the bounds to the voxel at a place.
    fn add(&mut self, place: [usize; 3]) {
        self.first = [0, 1, 2].map(|axis| self.first[axis].min(place[axis]));
        self.last = [0, 1, 2].map(|axis| self.last[axis].max(place[axis]));
    }

    /// Extends the bounds to all voxels within `around` voxels of a place on each axis, within a box of
    /// `counts` voxels.
    pub(super) fn add_around(&mut self, place: [usize; 3], around: [usize; 3], counts: [usize; 3]) {
        self.add([0, 1, 2].map(|axis| place[axis].saturating_sub(around[axis])));
        self.add([0, 1, 2].map(|axis| place[axis].saturating_add(around[axis]).min(counts[axis] - 1)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_testing::Random;

    /// Parts of random sets are those that a flood of single voxels finds, each with its bounds.
    #[test]
    fn parts_are_connected_through_faces() {
        let mut random = Random(1);
        for round in 0..300 {
            let counts = [(); 3].map(|()| 1 + random.below(5));
            let mut set = VoxelSet::empty(counts);
            let all = set.all();
            let share = 1 + random.below(4);
            all.clone().filter(|_| random.below(5) < share).for_each(|voxel| set.insert(voxel));
            let is_in: Vec<bool> = all.clone().map(|voxel| set.contains(voxel)).collect();
            let mut is_taken = vec![false; all.len()];
            for start in all {
                let mut list = vec![start];
                let (mut first, mut last) = ([usize::MAX; 3], [0; 3]);
                while let Some(voxel) = list.pop() {
                    if !is_in[voxel] || std::mem::replace(&mut is_taken[voxel], true) {
                        continue;
                    }
                    let place = voxel_place(voxel, counts);
                    for axis in 0..3 {
                        (first[axis], last[axis]) =
                            (first[axis].min(place[axis]), last[axis].max(place[axis]));
                        for step in [-1, 1] {
                            let mut other = place;
                            other[axis] = other[axis].wrapping_add_signed(step);
                            if other[axis] < counts[axis] {
                                list.push(voxel_number(other, counts));
                            }
                        }
                    }
                }
                let expected = (first[0] != usize::MAX).then_some((first, last));
                let found = set.take_part(start).map(|part| (part.first, part.last));
                assert_eq!(found, expected, "round {round}: the part of voxel {start} of {counts:?}");
                let is_left = (0..is_in.len()).all(|at| set.contains(at) == (is_in[at] && !is_taken[at]));
                assert!(is_left, "round {round}: the voxels that are left after that of {start}");
            }
        }
    }

    #[test]
    fn bounds_are_extended_within_the_box() {
        let mut bounds = VoxelBounds { first: [2; 3], last: [2; 3] };
        bounds.add_around([3, 1, 0], [1, 2, usize::MAX], [4, 4, 5]);
        assert_eq!((bounds.first, bounds.last), ([2, 0, 0], [3, 3, 4]), "places around a voxel");
    }
}
