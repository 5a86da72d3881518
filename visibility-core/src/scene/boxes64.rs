//! Sixty-four boxes held as structure of arrays: what one node of the hierarchy bounds its children with, and
//! what one call of the SIMD kernel tests.

use crate::Aabb;

/// Least x, y, z and greatest x, y, z of 64 boxes, a lane each. A free lane holds [`Aabb::EMPTY`], which
/// leaves the hull of the others as it is.
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
    pub(crate) coordinates: [[f32; 64]; 6],
}

impl Boxes64 {
    pub(crate) const EMPTY: Self = Self {
        coordinates: [
            [f32::INFINITY; 64],
            [f32::INFINITY; 64],
            [f32::INFINITY; 64],
            [f32::NEG_INFINITY; 64],
            [f32::NEG_INFINITY; 64],
            [f32::NEG_INFINITY; 64],
        ],
    };

    /// The box in a lane, counted modulo 64; [`Aabb::EMPTY`] in a free one.
    pub fn get(&self, lane: usize) -> Aabb {
        let (c, lane) = (&self.coordinates, lane % 64);
        Aabb::from_arrays([c[0][lane], c[1][lane], c[2][lane]], [c[3][lane], c[4][lane], c[5][lane]])
    }

    /// Least x, y, z and greatest x, y, z, a row of lanes each: for maps that test all of them at once.
    pub fn coordinates(&self) -> &[[f32; 64]; 6] {
        &self.coordinates
    }

    pub(crate) fn set(&mut self, lane: usize, bounds: &Aabb) {
        for axis in 0..3 {
            self.coordinates[axis][lane] = bounds.min[axis];
            self.coordinates[axis + 3][lane] = bounds.max[axis];
        }
    }

    /// The box around all lanes.
    pub(crate) fn hull(&self) -> Aabb {
        let c = &self.coordinates;
        let least = |v: &[f32; 64]| fold(v, f32::INFINITY, |a, b| if b < a { b } else { a });
        let greatest = |v: &[f32; 64]| fold(v, f32::NEG_INFINITY, |a, b| if b > a { b } else { a });
        Aabb::from_arrays(
            [least(&c[0]), least(&c[1]), least(&c[2])],
            [greatest(&c[3]), greatest(&c[4]), greatest(&c[5])],
        )
    }
}

/// Reduces in sixteen independent columns, which compiles to SIMD; the operation is associative, so the order
/// does not show.
fn fold(values: &[f32; 64], start: f32, better: impl Fn(f32, f32) -> f32) -> f32 {
    let mut columns = [start; 16];
    for chunk in values.chunks_exact(16) {
        for (column, &value) in columns.iter_mut().zip(chunk) {
            *column = better(*column, value);
        }
    }
    columns.into_iter().fold(start, better)
}

/// The lanes of a mask, lowest first.
pub(crate) fn lanes(mut mask: u64) -> impl Iterator<Item = usize> {
    core::iter::from_fn(move || {
        (mask != 0).then(|| {
            let lane = mask.trailing_zeros() as usize;
            mask &= mask - 1;
            lane
        })
    })
}
