//! Sixty-four bounding boxes as structure of arrays: the boxes of one node's children, and the unit that one
//! call of the SIMD kernel tests.

use crate::Aabb;

/// Fan-out of the scene's hierarchy: number of children of a node, and of lanes of a [`Boxes64`]. The fan-out
/// is 64 because a mask of children is a `u64`.
pub const FAN_OUT: usize = u64::BITS as usize;

/// Sixty-four axis-aligned boxes, one per lane, relative to the scene's origin: rows of min x, min y, min z,
/// max x, max y and max z. A lane without a box holds [`Aabb::EMPTY`], which does not enlarge the hull.
///
/// ```
/// # use visibility_core::{scene::Boxes64, Aabb};
/// # fn first(boxes: &Boxes64) -> Aabb {
/// boxes.get(0)
/// # }
/// ```
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub struct Boxes64 {
    pub(crate) coordinates: [[f32; FAN_OUT]; 6],
}

impl Boxes64 {
    /// A block without boxes: every lane is free.
    pub const EMPTY: Self = Self {
        coordinates: [
            [f32::INFINITY; FAN_OUT],
            [f32::INFINITY; FAN_OUT],
            [f32::INFINITY; FAN_OUT],
            [f32::NEG_INFINITY; FAN_OUT],
            [f32::NEG_INFINITY; FAN_OUT],
            [f32::NEG_INFINITY; FAN_OUT],
        ],
    };

    /// Returns the box in lane `lane % 64`; [`Aabb::EMPTY`] for a free lane.
    #[inline]
    pub fn get(&self, lane: usize) -> Aabb {
        let (c, lane) = (&self.coordinates, lane % FAN_OUT);
        Aabb::from_arrays([c[0][lane], c[1][lane], c[2][lane]], [c[3][lane], c[4][lane], c[5][lane]])
    }

    /// Returns the rows min x, min y, min z, max x, max y and max z, in metres relative to the scene's
    /// origin, with one element per lane, for occlusion maps that test all lanes at once. Free lanes hold
    /// +infinity in the min rows and -infinity in the max rows.
    pub fn coordinates(&self) -> &[[f32; FAN_OUT]; 6] {
        &self.coordinates
    }

    /// Replaces the box in lane `lane % 64`.
    pub fn set(&mut self, lane: usize, bounds: &Aabb) {
        let lane = lane % FAN_OUT;
        for axis in 0..3 {
            self.coordinates[axis][lane] = bounds.min[axis];
            self.coordinates[axis + 3][lane] = bounds.max[axis];
        }
    }

    /// Returns the smallest box that contains the boxes of all lanes; [`Aabb::EMPTY`] if no lane holds a box.
    pub fn hull(&self) -> Aabb {
        let c = &self.coordinates;
        let least = |v: &[f32; FAN_OUT]| fold(v, f32::INFINITY, |a, b| if b < a { b } else { a });
        let greatest = |v: &[f32; FAN_OUT]| fold(v, f32::NEG_INFINITY, |a, b| if b > a { b } else { a });
        Aabb::from_arrays(
            [least(&c[0]), least(&c[1]), least(&c[2])],
            [greatest(&c[3]), greatest(&c[4]), greatest(&c[5])],
        )
    }
}

/// Reduces the values with `better`, a minimum or maximum, starting from `start`. Works in sixteen
/// independent columns, which compiles to SIMD; the operation is associative and commutative, so the order
/// does not affect the result.
pub(super) fn fold<T: Copy>(values: &[T; FAN_OUT], start: T, better: impl Fn(T, T) -> T) -> T {
    let mut columns = [start; 16];
    for chunk in values.chunks_exact(16) {
        for (column, &value) in columns.iter_mut().zip(chunk) {
            *column = better(*column, value);
        }
    }
    columns.into_iter().fold(start, better)
}

/// Iterates over the positions of the bits set in `mask`, lowest first: the lanes of a block that a mask
/// selects.
///
/// ```
/// assert!(visibility_core::scene::lanes(0b1010).eq([1, 3]));
/// ```
#[inline]
pub fn lanes(mut mask: u64) -> impl Iterator<Item = usize> {
    core::iter::from_fn(move || {
        (mask != 0).then(|| {
            let lane = mask.trailing_zeros() as usize;
            mask &= mask - 1;
            lane
        })
    })
}
