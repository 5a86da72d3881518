//! The test of boxes for their size in a view, and its kernel for many boxes at once.

use super::eye_box::EyeBox;
use visibility_core::Aabb;
use visibility_core::scene::{Boxes64, FAN_OUT};

/// Tests whether objects have less than a least number of pixels in a view.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct SizeTest {
    pub(super) eye: EyeBox,
    /// An object is too small if its squared distance is greater than `limit` times its squared diagonal,
    /// both in square metres. In parallel views, 1 takes the place of the squared distance. Rounded up, which
    /// keeps more objects.
    pub(super) limit: f64,
    pub(super) is_parallel: bool,
}

impl SizeTest {
    /// Tests whether every box within `bounds` whose squared diagonal is at most `diagonal_squared` certainly
    /// has less than the least number of pixels. Agrees with the test of single boxes, whatever the rounding:
    /// if true, [`small`](Self::small) returns -1 for each such box.
    pub(super) fn is_small(&self, bounds: &Aabb, diagonal_squared: f64) -> bool {
        let gap = if self.is_parallel { 1.0 } else { self.eye.gap_squared(bounds) };
        gap > diagonal_squared * self.limit
    }

    /// For each box, returns -1 if it certainly has less than the least number of pixels, otherwise 0. The
    /// kernels collect the signs of these numbers in a mask. `rows` are the rows of [`Boxes64`] in their
    /// order: min x, y, z, max x, y, z. Computes the same as [`is_small`](Self::is_small) for each box and
    /// its own diagonal, with the operations in the same order. Eight boxes at a time stay in registers.
    #[inline(always)]
    fn small<const WIDTH: usize>(&self, rows: [&[f32; WIDTH]; 6]) -> [f32; WIDTH] {
        let mut result = [0.0; WIDTH];
        for (chunk, result) in result.as_chunks_mut::<8>().0.iter_mut().enumerate() {
            let (mut gaps, mut diagonals) = ([0.0; 8], [0.0; 8]);
            for axis in 0..3 {
                let [min, max] = [rows[axis], rows[axis + 3]].map(|row| &row.as_chunks::<8>().0[chunk]);
                let (low, high) = (self.eye.low[axis], self.eye.high[axis]);
                for lane in 0..8 {
                    let (min, max) = (f64::from(min[lane]), f64::from(max[lane]));
                    let (below, above, side) = (min - high, low - max, max - min);
                    let gap = if below > above { below } else { above };
                    let gap = if gap > 0.0 { gap } else { 0.0 };
                    let side = if side > 0.0 { side } else { 0.0 };
                    gaps[lane] += gap * gap;
                    diagonals[lane] += side * side;
                }
            }
            for lane in 0..8 {
                let gap = if self.is_parallel { 1.0 } else { gaps[lane] };
                result[lane] = if gap > diagonals[lane] * self.limit { -1.0 } else { 0.0 };
            }
        }
        result
    }
}

/// Evaluates [`SizeTest::small`] for `WIDTH` lanes at a time and returns a mask of the lanes whose box
/// certainly has less than the least number of pixels, bit i for lane i. `signs` returns a mask of the
/// negative numbers of its argument.
#[inline(always)]
pub(crate) fn small_boxes<const WIDTH: usize>(
    boxes: &Boxes64,
    test: &SizeTest,
    signs: impl Fn(&[f32; WIDTH]) -> u64,
) -> u64 {
    let mut mask = 0;
    for chunk in 0..FAN_OUT / WIDTH {
        let rows = boxes.coordinates().each_ref().map(|row| &row.as_chunks::<WIDTH>().0[chunk]);
        mask |= signs(&test.small(rows)) << (chunk * WIDTH);
    }
    mask
}
