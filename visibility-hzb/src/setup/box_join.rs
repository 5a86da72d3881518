//! Joins occluder boxes that abut into larger boxes, as the panels of a wall, the tiles of a floor and voxels
//! do. Neither box alone covers the pixels along the seam between two boxes; the joined box does.
//!
//! # Why it is sound
//! Two boxes of one transform that share a whole face, exactly equal in all coordinates, are together one
//! box, point for point. A line of sight that enters that box enters one of the two, through an outer side.
//! So the box hides exactly what the two hide from an eye outside, and no more than they from an eye inside.
//! A box that is shifted without rounding counts as a box in scene coordinates; nothing else is rounded here.

use alloc::vec::Vec;
use visibility_core::Aabb;
use visibility_core::glam::{Affine3A, Mat3A, Vec3};

/// Number of slots of the table of faces, a power of 2. A face has two slots to choose from. If both are
/// taken, it replaces another face, and two boxes that abut at the replaced face may not be joined.
const SLOTS: usize = 4096;

/// A box that occludes: a box that was added, or a box formed by joining several.
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

/// A face of a box, as an entry of the hash table that finds boxes that abut.
#[derive(Clone, Copy, Debug)]
struct Face {
    /// Hash of the face's coordinates and of its box's transform.
    hash: u32,
    /// Number of the box that has the face, plus 1. 0 in an empty slot.
    number: u32,
}

impl Face {
    const NONE: Self = Self { hash: 0, number: 0 };
}

/// The boxes of a frame. Boxes that share a whole face are joined into one.
#[derive(Clone, Debug)]
pub(crate) struct BoxJoin {
    /// Boxes of the frame in the order in which they were added or joined.
    pub(crate) boxes: Vec<OccluderBox>,
    /// Hash table of the faces of `boxes`. A face is in the slot that its hash gives or in the slot beside
    /// it. Faces of replaced boxes stay until other faces need their slots.
    faces: Vec<Face>,
}

impl BoxJoin {
    /// Creates an empty set of boxes.
    pub(crate) fn new() -> Self {
        Self { boxes: Vec::new(), faces: alloc::vec![Face::NONE; SLOTS] }
    }

    /// Removes all boxes.
    pub(crate) fn clear(&mut self) {
        if !self.boxes.is_empty() {
            self.boxes.clear();
            self.faces.fill(Face::NONE);
        }
    }

    /// Adds the box `bounds`, in its own coordinates, which `transform` maps to the scene. Two boxes abut if
    /// they share a whole face: the added box is joined with a box that it abuts, the joined box with one
    /// that this abuts, and so on. `two_sided`: true if the inner sides of its faces hide objects too, false
    /// if only the outer sides do. Returns the number of the added box in `boxes`. Each joined box is
    /// appended to `boxes` as well, after those that it replaces.
    pub(crate) fn add(&mut self, bounds: &Aabb, transform: &Affine3A, two_sided: bool) -> usize {
        let number = self.boxes.len();
        let mut next = OccluderBox { bounds: *bounds, transform: *transform, two_sided, is_replaced: false };
        if let Some(bounds) = in_scene(bounds, transform) {
            (next.bounds, next.transform) = (bounds, Affine3A::IDENTITY);
        }
        loop {
            let own = self.boxes.len();
            self.boxes.push(next);
            let hashes = face_hashes(&next);
            let Some(other) = (0..6).find_map(|face| self.abutting(&next, face, hashes[face])) else {
                for hash in hashes {
                    let [first, second] = slots(hash);
                    let is_free = self.faces[second].number == 0 && self.faces[first].number != 0;
                    self.faces[if is_free { second } else { first }] = Face { hash, number: own as u32 + 1 };
                }
                return number;
            };
            self.boxes[own].is_replaced = true;
            self.boxes[other].is_replaced = true;
            next.bounds = next.bounds.union(&self.boxes[other].bounds);
        }
    }

    /// Returns the number of a box that shares face `face` with the box `own`, or `None`. Face `2 * axis` is
    /// the one of the least coordinate on the axis, `2 * axis + 1` that of the greatest. `hash` is the hash
    /// of that face.
    fn abutting(&self, own: &OccluderBox, face: usize, hash: u32) -> Option<usize> {
        let (axis, a) = (face / 2, &own.bounds);
        slots(hash).into_iter().find_map(|slot| {
            let found = self.faces[slot];
            if found.hash != hash {
                return None;
            }
            let number = (found.number as usize).checked_sub(1)?;
            let other = &self.boxes[number];
            let b = &other.bounds;
            let is_least = face.is_multiple_of(2);
            let meets = if is_least { b.max[axis] == a.min[axis] } else { b.min[axis] == a.max[axis] };
            let is_whole = (0..3).all(|k| k == axis || a.min[k] == b.min[k] && a.max[k] == b.max[k]);
            let is_alike = other.two_sided == own.two_sided && other.transform == own.transform;
            (meets && is_whole && is_alike && !other.is_replaced).then_some(number)
        })
    }
}

/// Returns a box under a transform that only shifts it, in scene coordinates. `None` for another transform,
/// or if a coordinate would have to be rounded.
fn in_scene(bounds: &Aabb, transform: &Affine3A) -> Option<Aabb> {
    if transform.matrix3 != Mat3A::IDENTITY {
        return None;
    }
    let shift = Vec3::from(transform.translation);
    let shifted = Aabb::new(bounds.min + shift, bounds.max + shift);
    let is_exact = |sum: Vec3, term: Vec3| {
        // The rounded sum of two numbers is exact if taking away either leaves the other. (A difference in
        // `f64` that equals an `f32` might have been rounded to it; the second difference then shows that.)
        let (sum, term, shift) = (sum.as_dvec3(), term.as_dvec3(), shift.as_dvec3());
        sum - term == shift && sum - shift == term
    };
    (is_exact(shifted.min, bounds.min) && is_exact(shifted.max, bounds.max)).then_some(shifted)
}

/// Returns the two slots of the hash table in which a face with the given hash may be.
fn slots(hash: u32) -> [usize; 2] {
    let slot = (hash >> (u32::BITS - SLOTS.trailing_zeros())) as usize;
    [slot, slot ^ 1]
}

/// Returns hashes of the six faces of a box: least and greatest along x, then y, then z. Equal faces of
/// boxes with equal transforms have equal hashes.
fn face_hashes(of: &OccluderBox) -> [u32; 6] {
    /// Factors of the hash, odd numbers without a pattern. For each axis: the factors of a box's least
    /// coordinate, of its greatest coordinate, and of the coordinate of a face on that axis.
    const FACTORS: [[u64; 3]; 3] = [
        [0x9e37_79b9_7f4a_7c15, 0xbf58_476d_1ce4_e5b9, 0x94d0_49bb_1331_11eb],
        [0xd6e8_feb8_6659_fd93, 0xa076_1d64_78bd_642f, 0xe703_7ed1_a0b4_28db],
        [0x8ebc_6af0_9c88_c6e3, 0x5899_65cc_7537_4cc3, 0x1d8e_4e27_c47d_124f],
    ];
    // Adding 0 makes zeros of either sign equal.
    let number = |x: f32| u64::from((x + 0.0).to_bits());
    let (min, max) = (of.bounds.min.to_array().map(number), of.bounds.max.to_array().map(number));
    let extents: [u64; 3] = core::array::from_fn(|axis| {
        let [least, greatest, _] = FACTORS[axis];
        min[axis].wrapping_mul(least).wrapping_add(max[axis].wrapping_mul(greatest))
    });
    let mut all = 0_u64;
    if of.transform != Affine3A::IDENTITY {
        let numbers = of.transform.to_cols_array().map(number);
        all =
            numbers.iter().fold(all, |all, x| all.rotate_left(5).wrapping_add(x.wrapping_mul(FACTORS[0][0])));
    }
    all = extents.iter().fold(all, |all, extent| all.wrapping_add(*extent));
    core::array::from_fn(|face| {
        let axis = face / 2;
        let at = if face.is_multiple_of(2) { min[axis] } else { max[axis] };
        let hash = at.wrapping_mul(FACTORS[axis][2]).wrapping_add(all.wrapping_sub(extents[axis]));
        (hash >> 32) as u32
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::random;
    use visibility_core::glam::Quat;

    /// Returns the bounds of the boxes that no joined box has replaced.
    fn left(join: &BoxJoin) -> Vec<Aabb> {
        join.boxes.iter().filter(|own| !own.is_replaced).map(|own| own.bounds).collect()
    }

    fn cell(x: usize, y: usize, z: usize) -> Aabb {
        let least = Vec3::new(x as f32, y as f32, z as f32);
        Aabb::new(least, least + 1.0)
    }

    #[test]
    fn a_lattice_of_boxes_is_one_box_whatever_turns_or_shifts_it() {
        let turned =
            Affine3A::from_rotation_translation(Quat::from_rotation_y(0.7), Vec3::new(3.3, 0.1, 7.7));
        for transform in [Affine3A::IDENTITY, turned] {
            let mut join = BoxJoin::new();
            for (x, y, z) in (0..60).map(|i| (i % 5, i / 5 % 4, i / 20)) {
                join.add(&cell(x, y, z), &transform, false);
            }
            assert_eq!(left(&join), [Aabb::from_arrays([0.0; 3], [5.0, 4.0, 3.0])], "60 cells are one box");
            assert_eq!(
                join.boxes.last().unwrap().transform,
                transform,
                "the joined box has the transform of its parts"
            );
        }
        // Three objects that share one mesh and are shifted along x.
        let mut join = BoxJoin::new();
        for shift in [Vec3::ZERO, Vec3::X, Vec3::new(2.0, 0.0, 0.0)] {
            join.add(&cell(7, 0, 0), &Affine3A::from_translation(shift), true);
        }
        assert_eq!(
            left(&join),
            [Aabb::from_arrays([7.0, 0.0, 0.0], [10.0, 1.0, 1.0])],
            "one mesh in three places is one box"
        );
    }

    #[test]
    fn boxes_that_do_not_share_a_whole_face_stay_apart() {
        let apart = |other: Aabb, transform: Affine3A, two_sided: bool| {
            let mut join = BoxJoin::new();
            join.add(&cell(1, 1, 1), &Affine3A::IDENTITY, false);
            join.add(&other, &transform, two_sided);
            left(&join).len() == 2
        };
        let beside = cell(2, 1, 1);
        assert!(!apart(beside, Affine3A::IDENTITY, false), "boxes that share a face");
        assert!(apart(beside, Affine3A::IDENTITY, true), "the back of one of them does not hide");
        assert!(apart(beside, Affine3A::from_rotation_x(0.1), false), "a box that is turned");
        assert!(apart(cell(1, 1, 1), Affine3A::IDENTITY, false), "the same box twice");
        assert!(apart(cell(3, 1, 1), Affine3A::IDENTITY, false), "a box one cell away");
        assert!(apart(cell(2, 2, 1), Affine3A::IDENTITY, false), "only an edge is shared");
        let step = 2.0_f32.next_up() - 2.0;
        for axis in 0..3 {
            for (min, max) in [(step, 0.0), (-step, 0.0), (0.0, step), (0.0, -step)] {
                let mut other = beside;
                other.min[axis] += min;
                other.max[axis] += max;
                // Boxes are joined only at a whole face that both have, so nothing but the side of `other`
                // opposite that face may change.
                let is_whole = axis == 0 && min == 0.0;
                assert_eq!(apart(other, Affine3A::IDENTITY, false), !is_whole, "axis {axis}: {min} {max}");
            }
        }
        // The shift is rounded, so one box ends a little beyond the other.
        let far = Aabb::from_arrays([0.0, 1.0, 1.0], [1.0, 2.0, 2.0]);
        assert!(
            !apart(far, Affine3A::from_translation(Vec3::new(2.0, 0.0, 0.0)), false),
            "a box moved to share a face exactly"
        );
        let fine = Aabb::new(Vec3::new(1e-9, 1.0, 1.0), far.max);
        assert!(
            apart(fine, Affine3A::from_translation(Vec3::new(2.0, 0.0, 0.0)), false),
            "a box that ends 1e-9 beyond the face"
        );
    }

    /// Tests boxes of a part of a lattice, added in any order: each remaining box is a union of added boxes,
    /// and each added box is in a remaining one.
    #[test]
    fn joined_boxes_are_the_boxes_that_were_added() {
        let mut random = random(5);
        let mut joins = 0;
        for _ in 0..300 {
            let share = random(0.2, 1.0);
            let mut cells: Vec<[usize; 3]> = (0..64).map(|i| [i % 4, i / 4 % 4, i / 16]).collect();
            for i in 0..cells.len() {
                let other = random(0.0, cells.len() as f64) as usize;
                cells.swap(i, other);
            }
            cells.truncate((share * 64.0) as usize);
            let mut join = BoxJoin::new();
            for &[x, y, z] in &cells {
                join.add(&cell(x, y, z), &Affine3A::IDENTITY, false);
            }
            let boxes = left(&join);
            joins += cells.len() - boxes.len();
            let is_added = |p: Vec3| cells.contains(&p.to_array().map(|x| x as usize));
            let mut volume = 0;
            for own in &boxes {
                let size = (own.max - own.min).to_array().map(|x| x as usize);
                for i in 0..size[0] * size[1] * size[2] {
                    let step = [i % size[0], i / size[0] % size[1], i / size[0] / size[1]];
                    assert!(
                        is_added(own.min + Vec3::from_array(step.map(|x| x as f32))),
                        "{own:?}: {cells:?}"
                    );
                    volume += 1;
                }
            }
            assert_eq!(volume, cells.len(), "{boxes:?}: {cells:?}");
        }
        assert!(joins > 5000, "{joins}");
    }

    /// A box whose face has the hash of another box's face by chance does not abut that box.
    #[test]
    fn equal_hashes_are_no_equal_faces() {
        let (at, mut join) = (
            |bounds, transform, two_sided| OccluderBox { bounds, transform, two_sided, is_replaced: false },
            BoxJoin::new(),
        );
        join.add(&cell(1, 1, 1), &Affine3A::IDENTITY, false);
        let beside = at(cell(2, 1, 1), Affine3A::IDENTITY, false);
        let hash = face_hashes(&beside)[0];
        assert_eq!(join.abutting(&beside, 0, hash), Some(0), "a box that abuts");
        let mut others: Vec<OccluderBox> = [(1, 0.5), (2, 0.5), (1, -0.5), (2, -0.5)]
            .into_iter()
            .flat_map(|(axis, by)| {
                let (mut low, mut high) = (beside, beside);
                low.bounds.min[axis] += by;
                high.bounds.max[axis] += by;
                [low, high]
            })
            .collect();
        others.push(at(cell(3, 1, 1), Affine3A::IDENTITY, false));
        others.push(at(beside.bounds, Affine3A::from_translation(Vec3::Y), false));
        others.push(at(beside.bounds, Affine3A::IDENTITY, true));
        for other in others {
            assert_eq!(join.abutting(&other, 0, hash), None, "{other:?} with the hash of a box that abuts");
        }
    }

    /// A shift is exact if neither term is lost in the sum, at either end of the box.
    #[test]
    fn shifts_that_are_rounded_are_none() {
        for (min, max, shift, is_exact) in [
            (0.5, 1.5, 2.0, true),
            (0.0, 1e-20, 1.0, false),
            (-1e-20, 0.0, 1.0, false),
            (1.0, 2.0, 1e-20, false),
            (1e-20, 2e-20, 1.0, false),
        ] {
            for axis in 0..3 {
                let (mut bounds, mut by) = (cell(1, 1, 1), Vec3::ZERO);
                (bounds.min[axis], bounds.max[axis], by[axis]) = (min, max, shift);
                let moved = in_scene(&bounds, &Affine3A::from_translation(by));
                assert_eq!(moved.is_some(), is_exact, "{min} to {max}, shifted by {shift} on axis {axis}");
            }
        }
    }
}
