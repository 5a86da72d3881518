//! A block of 64 normal cones in structure-of-arrays form, and its kernel.

use super::NormalCone;
use super::split_eye::{NUMBERS, SplitEye, inside};
use visibility_core::scene::FAN_OUT;

/// The numbers of 64 cones that decide whether an eye sees only back faces, as structure of arrays:
/// `numbers[n][i]` is number `n` of cone `i`, in the order of [`NormalCone::numbers`].
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(crate) struct Cones64 {
    numbers: [[f32; FAN_OUT]; NUMBERS],
}

impl Cones64 {
    /// A block of 64 open cones, which hold no eye.
    pub(crate) const OPEN: Self = Self { numbers: [[0.0; FAN_OUT]; NUMBERS] };

    pub(crate) fn set(&mut self, lane: usize, cone: &NormalCone) {
        for (row, number) in self.numbers.iter_mut().zip(cone.numbers()) {
            row[lane] = number;
        }
    }
}

/// Evaluates [`inside`] for `WIDTH` lanes at a time and returns a mask of the lanes whose cone certainly
/// contains the eye, bit i for lane i. `signs` returns a mask of the negative numbers of its argument.
#[inline(always)]
pub(crate) fn inside_cones<const WIDTH: usize>(
    cones: &Cones64,
    eye: &SplitEye,
    signs: impl Fn(&[f32; WIDTH]) -> u64,
) -> u64 {
    let mut mask = 0;
    for chunk in 0..FAN_OUT / WIDTH {
        let numbers = cones.numbers.each_ref().map(|row| &row.as_chunks::<WIDTH>().0[chunk]);
        mask |= signs(&inside(numbers, eye)) << (chunk * WIDTH);
    }
    mask
}
