//! A block of 64 normal cones in structure-of-arrays form.

use super::NormalCone;
use super::split_eye::NUMBERS;

/// The parts of 64 cones that find back faces, as structure of arrays: `numbers[n][i]` is number `n` of cone
/// `i`, in the order of [`NormalCone::numbers`].
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(crate) struct Cones64 {
    pub(crate) numbers: [[f32; 64]; NUMBERS],
}

impl Cones64 {
    /// A block of 64 open cones, which hold no eye.
    pub(crate) const OPEN: Self = Self { numbers: [[0.0; 64]; NUMBERS] };

    pub(crate) fn set(&mut self, lane: usize, cone: &NormalCone) {
        for (row, number) in self.numbers.iter_mut().zip(cone.numbers()) {
            row[lane] = number;
        }
    }
}
