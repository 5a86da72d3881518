//! Sixty-four cones as the kernel tests them.

use super::NormalCone;
use super::split_eye::NUMBERS;

/// The numbers of 64 cones as structure of arrays, a lane each, for the kernel. Without what sees fronts.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(crate) struct Cones64 {
    pub(crate) numbers: [[f32; 64]; NUMBERS],
}

impl Cones64 {
    /// All open: a depth of zero is never negative.
    pub(crate) const OPEN: Self = Self { numbers: [[0.0; 64]; NUMBERS] };

    pub(crate) fn set(&mut self, lane: usize, cone: &NormalCone) {
        for (row, number) in self.numbers.iter_mut().zip(cone.numbers()) {
            row[lane] = number;
        }
    }
}
