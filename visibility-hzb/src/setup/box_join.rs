//! Joins occluder boxes that abut into larger boxes, as the panels of a wall, the tiles of a floor and voxels
//! do. Along the seam between two of them no pixel is covered by either alone.
//!
//! # Why it is sound
//! Two boxes of one transform that share a whole face, exactly equal in all coordinates, are together one
//! box, point for point. A line of sight that enters that box enters one of the two, through an outer side.
//! So the box hides exactly what the two hide. A box that is shifted without rounding counts as a box in
//! scene coordinates; nothing else is rounded here.

use alloc::vec::Vec;
use visibility_core::Aabb;
use visibility_core::glam::{Affine3A, Mat3A, Vec3};

/// Number of slots of the table of faces, a power of 2. A face that finds its slot taken replaces the other
/// one, and then a pair that abuts may be missed.
const SLOTS: usize = 4096;

/// A box that occludes: one that was added, or several that together are a box.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OccluderBox {
    /// Bounds in the box's own coordinates.
    pub(crate) bounds: Aabb,
    /// Transform from the box's own coordinates to the scene.
    pub(crate) transform: Affine3A,
    /// Whether the inner sides of its faces hide objects too.
    pub(crate) two_sided: bool,
    /// Whether a larger box has taken the place of this one.
    pub(crate) is_replaced: bool,
}

/// The boxes of a frame, joined as far as they abut.
#[derive(Clone, Debug)]
pub(crate) struct BoxJoin {
    /// Boxes of the frame in the order in which they were added or joined.
    pub(crate) boxes: Vec<OccluderBox>,
    /// For each face of a box, in the slot that its coordinates hash to: the number of the box, plus 1. 0 in
    /// an empty slot.
    slots: Vec<u32>,
}

impl BoxJoin {
    /// Creates an empty set of boxes.
    pub(crate) fn new() -> Self {
        Self { boxes: Vec::new(), slots: alloc::vec![0; SLOTS] }
    }

    /// Removes all boxes.
    pub(crate) fn clear(&mut self) {
        if !self.boxes.is_empty() {
            self.boxes.clear();
            self.slots.fill(0);
        }
    }

    /// Adds a box and joins it with those that it abuts. Returns its number in `boxes`. A join is a box
    /// of its own behind those that it replaces.
    pub(crate) fn add(&mut self, bounds: &Aabb, transform: &Affine3A, two_sided: bool) -> usize {
        let (bounds, transform) = in_scene(bounds, transform).map_or((*bounds, *transform), |bounds| (bounds, Affine3A::IDENTITY));
        let number = self.boxes.len();
        let mut next = OccluderBox { bounds, transform, two_sided, is_replaced: false };
        loop {
            let own = self.boxes.len();
            self.boxes.push(next);
            let faces = face_slots(&next.bounds);
            let Some(other) = (0..6).find_map(|face| self.abutting(&next, face, faces[face]).or_else(|| self.abutting(&next, face, faces[face] ^ 1))) else {
                for slot in faces {
                    let is_free = |slot: usize| self.number(slot).is_none_or(|other| self.boxes[other].is_replaced);
                    let slot = if is_free(slot) || !is_free(slot ^ 1) { slot } else { slot ^ 1 };
                    self.slots[slot] = own as u32 + 1;
                }
                return number;
            };
            self.boxes[own].is_replaced = true;
            self.boxes[other].is_replaced = true;
            next.bounds = next.bounds.union(&self.boxes[other].bounds);
        }
    }

    fn number(&self, slot: usize) -> Option<usize> {
        (self.slots[slot] as usize).checked_sub(1)
    }

    /// Returns the number of the box that shares a face with a box: face `2 * axis` is the one of the least
    /// coordinate, `2 * axis + 1` that of the greatest.
    fn abutting(&self, of: &OccluderBox, face: usize, slot: usize) -> Option<usize> {
        let number = self.number(slot)?;
        let other = &self.boxes[number];
        let axis = face / 2;
        let (a, b) = (&of.bounds, &other.bounds);
        let meets = if face % 2 == 0 { b.max[axis] == a.min[axis] } else { b.min[axis] == a.max[axis] };
        let is_whole = (0..3).all(|k| k == axis || a.min[k] == b.min[k] && a.max[k] == b.max[k]);
        (meets && is_whole && !other.is_replaced && other.two_sided == of.two_sided && other.transform == of.transform)
            .then_some(number)
    }
}

/// Returns a box under a transform that only shifts it, in scene coordinates. `None` if that takes rounding,
/// or for another transform.
fn in_scene(bounds: &Aabb, transform: &Affine3A) -> Option<Aabb> {
    if transform.matrix3 != Mat3A::IDENTITY {
        return None;
    }
    let shift = Vec3::from(transform.translation);
    let shifted = Aabb::new(bounds.min + shift, bounds.max + shift);
    // In `f64` the difference of two `f32` sums' terms shows any rounding of the sum: the sum is exact if
    // either term is what is left when the other is taken away again.
    let is_exact = |sum: Vec3, p: Vec3| {
        let (sum, p, shift) = (sum.as_dvec3(), p.as_dvec3(), shift.as_dvec3());
        sum - p == shift && sum - shift == p
    };
    (is_exact(shifted.min, bounds.min) && is_exact(shifted.max, bounds.max)).then_some(shifted)
}

/// Returns the slots of the six faces of a box: least and greatest along x, then y, then z.
fn face_slots(bounds: &Aabb) -> [usize; 6] {
    /// Odd numbers without a pattern.
    const FACTORS: [u64; 9] = [
        0x9e37_79b9_7f4a_7c15, 0xbf58_476d_1ce4_e5b9, 0x94d0_49bb_1331_11eb, 0xd6e8_feb8_6659_fd93, 0xa076_1d64_78bd_642f,
        0xe703_7ed1_a0b4_28db, 0x8ebc_6af0_9c88_c6e3, 0x5899_65cc_7537_4cc3, 0x1d8e_4e27_c47d_124f,
    ];
    // Zeros of either sign are equal.
    let number = |x: f32| u64::from((x + 0.0).to_bits());
    let (min, max) = (bounds.min.to_array().map(number), bounds.max.to_array().map(number));
    let extents: [u64; 3] =
        core::array::from_fn(|k| min[k].wrapping_mul(FACTORS[k]).wrapping_add(max[k].wrapping_mul(FACTORS[k + 3])));
    let all = extents[0].wrapping_add(extents[1]).wrapping_add(extents[2]);
    core::array::from_fn(|face| {
        let axis = face / 2;
        let at = if face % 2 == 0 { min[axis] } else { max[axis] };
        let hash = at.wrapping_mul(FACTORS[axis + 6]).wrapping_add(all.wrapping_sub(extents[axis]));
        (hash >> (u64::BITS - SLOTS.trailing_zeros())) as usize
    })
}
