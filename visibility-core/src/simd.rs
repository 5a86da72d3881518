//! The SIMD kernels of the hierarchy tests: 64 boxes against planes or a least size, and 64 cones against an
//! eye.
//!
//! Each kernel has one body of safe loops, which compilers turn into SIMD code. The body is compiled once for
//! the instruction set that the program is built for and, on x86-64 with `std`, also for AVX2 and AVX-512;
//! one of these is chosen at run time. Rust neither reorders nor fuses floating-point operations, so all
//! variants give bit-identical results.
//!
//! This is the only module with `unsafe` code: calls of functions compiled for instructions that the rest of
//! the program does not assume, and loads of arrays into SIMD registers.

use crate::backface::{Cones64, SplitEye, inside};
use crate::lod::SizeTest;
use crate::scene::Boxes64;
use crate::test_plane::TestPlane;
use crate::view::MAX_PLANES;

/// The instruction set that the box and cone kernels use. Culling results are identical with every
/// instruction set.
///
/// ```
/// use visibility_core::simd::Simd;
/// assert!(Simd::available().any(|simd| simd == Simd::best()));
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Simd(SimdLevel);

/// An instruction set for the kernels, from narrow to wide. A [`Simd`] with a [`level`](Simd::level) other
/// than `Portable` exists only if run-time detection found all instructions of that level on this processor,
/// which makes calls of functions compiled for them sound.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum SimdLevel {
    /// The instruction set that the program was built for; runs on every processor that runs the program.
    Portable,
    /// AVX2, BMI1, BMI2, POPCNT and LZCNT. Detected on x86-64 with the feature `std` only.
    Avx2,
    /// The instructions of [`Avx2`](Self::Avx2), and AVX-512 F, BW, DQ and VL. Detected on x86-64 with the
    /// feature `std` only.
    Avx512,
}

impl Simd {
    /// The instruction set that the program was built for: SSE2, NEON, wasm SIMD or scalar code.
    pub const PORTABLE: Self = Self(SimdLevel::Portable);

    /// Iterates over the instruction sets that this processor can run, from narrowest to widest, beginning
    /// with [`PORTABLE`](Self::PORTABLE).
    pub fn available() -> impl Iterator<Item = Self> {
        #[cfg(all(target_arch = "x86_64", feature = "std"))]
        let avx2 = std::is_x86_feature_detected!("avx2")
            && std::is_x86_feature_detected!("bmi1")
            && std::is_x86_feature_detected!("bmi2")
            && std::is_x86_feature_detected!("popcnt")
            && std::is_x86_feature_detected!("lzcnt");
        #[cfg(all(target_arch = "x86_64", feature = "std"))]
        let wide = [
            avx2.then_some(Self(SimdLevel::Avx2)),
            (avx2
                && std::is_x86_feature_detected!("avx512f")
                && std::is_x86_feature_detected!("avx512bw")
                && std::is_x86_feature_detected!("avx512dq")
                && std::is_x86_feature_detected!("avx512vl"))
            .then_some(Self(SimdLevel::Avx512)),
        ];
        #[cfg(not(all(target_arch = "x86_64", feature = "std")))]
        let wide = [None; 0];
        core::iter::once(Self::PORTABLE).chain(wide.into_iter().flatten())
    }

    /// Returns the widest instruction set that this processor can run.
    pub fn best() -> Self {
        Self::available().last().unwrap_or(Self::PORTABLE)
    }

    /// Returns the instruction set that this value selects.
    pub fn level(self) -> SimdLevel {
        self.0
    }

    /// Returns a mask of the lanes whose box is certainly outside at least one active plane; bit i stands for
    /// lane i. Bit p of `active` selects `planes[p]`. Boxes that rounding leaves undecided, boxes that touch
    /// a plane, and NaN count as not outside.
    #[allow(unsafe_code)]
    pub(crate) fn any_outside(self, boxes: &Boxes64, planes: &[TestPlane; MAX_PLANES], active: u32) -> u64 {
        match self.0 {
            // SAFETY: a value with this path exists only where the processor was found to have AVX2.
            #[cfg(all(target_arch = "x86_64", feature = "std"))]
            SimdLevel::Avx2 => unsafe { any_outside_avx2(boxes, planes, active) },
            // SAFETY: a value with this path exists only where the processor was found to have these
            // extensions.
            #[cfg(all(target_arch = "x86_64", feature = "std"))]
            SimdLevel::Avx512 => unsafe { any_outside_avx512(boxes, planes, active) },
            _ => any_outside::<16>(boxes, planes, active, signs_portable),
        }
    }

    /// Returns a mask of the lanes whose cone certainly contains the eye, so that the eye sees only back
    /// faces of the cone's triangles; bit i stands for lane i. Undecided cones count as not containing the
    /// eye.
    #[allow(unsafe_code)]
    pub(crate) fn inside_cones(self, cones: &Cones64, eye: &SplitEye) -> u64 {
        match self.0 {
            // SAFETY: a value with this path exists only where the processor was found to have AVX2.
            #[cfg(all(target_arch = "x86_64", feature = "std"))]
            SimdLevel::Avx2 => unsafe { inside_cones_avx2(cones, eye) },
            // SAFETY: a value with this path exists only where the processor was found to have these
            // extensions.
            #[cfg(all(target_arch = "x86_64", feature = "std"))]
            SimdLevel::Avx512 => unsafe { inside_cones_avx512(cones, eye) },
            _ => inside_cones::<16>(cones, eye, signs_portable),
        }
    }

    /// Returns a mask of the lanes whose box is certainly too small; bit i stands for lane i.
    #[allow(unsafe_code)]
    pub(crate) fn small_boxes(self, boxes: &Boxes64, test: &SizeTest) -> u64 {
        match self.0 {
            // SAFETY: a value with this path exists only where the processor was found to have AVX2.
            #[cfg(all(target_arch = "x86_64", feature = "std"))]
            SimdLevel::Avx2 => unsafe { small_boxes_avx2(boxes, test) },
            // SAFETY: a value with this path exists only where the processor was found to have these
            // extensions.
            #[cfg(all(target_arch = "x86_64", feature = "std"))]
            SimdLevel::Avx512 => unsafe { small_boxes_avx512(boxes, test) },
            _ => small_boxes::<16>(boxes, test, signs_portable),
        }
    }
}

#[cfg(all(target_arch = "x86_64", feature = "std"))]
#[target_feature(enable = "avx2")]
fn small_boxes_avx2(boxes: &Boxes64, test: &SizeTest) -> u64 {
    small_boxes::<32>(boxes, test, |values| signs_avx2(values))
}

#[cfg(all(target_arch = "x86_64", feature = "std"))]
#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
fn small_boxes_avx512(boxes: &Boxes64, test: &SizeTest) -> u64 {
    small_boxes::<64>(boxes, test, |values| signs_avx512(values))
}

/// Body of the size kernel: evaluates [`SizeTest::small`] for `WIDTH` lanes at a time and returns a mask of
/// the lanes whose box is certainly too small, bit i for lane i. `signs` returns a mask of the negative
/// numbers of its argument.
#[inline(always)]
fn small_boxes<const WIDTH: usize>(
    boxes: &Boxes64,
    test: &SizeTest,
    signs: impl Fn(&[f32; WIDTH]) -> u64,
) -> u64 {
    let mut mask = 0;
    for chunk in 0..64 / WIDTH {
        let rows = boxes.coordinates.each_ref().map(|row| &row.as_chunks::<WIDTH>().0[chunk]);
        mask |= signs(&test.small(rows)) << (chunk * WIDTH);
    }
    mask
}

#[cfg(all(target_arch = "x86_64", feature = "std"))]
#[target_feature(enable = "avx2")]
fn any_outside_avx2(boxes: &Boxes64, planes: &[TestPlane; MAX_PLANES], active: u32) -> u64 {
    any_outside::<32>(boxes, planes, active, |values| signs_avx2(values))
}

#[cfg(all(target_arch = "x86_64", feature = "std"))]
#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
fn any_outside_avx512(boxes: &Boxes64, planes: &[TestPlane; MAX_PLANES], active: u32) -> u64 {
    any_outside::<64>(boxes, planes, active, |values| signs_avx512(values))
}

#[cfg(all(target_arch = "x86_64", feature = "std"))]
#[target_feature(enable = "avx2")]
fn inside_cones_avx2(cones: &Cones64, eye: &SplitEye) -> u64 {
    inside_cones::<32>(cones, eye, |values| signs_avx2(values))
}

#[cfg(all(target_arch = "x86_64", feature = "std"))]
#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
fn inside_cones_avx512(cones: &Cones64, eye: &SplitEye) -> u64 {
    inside_cones::<64>(cones, eye, |values| signs_avx512(values))
}

/// Body of the cone kernel: evaluates [`inside`] for `WIDTH` lanes at a time and returns a mask of the lanes
/// whose cone certainly contains the eye, bit i for lane i. `signs` returns a mask of the negative numbers of
/// its argument.
#[inline(always)]
fn inside_cones<const WIDTH: usize>(
    cones: &Cones64,
    eye: &SplitEye,
    signs: impl Fn(&[f32; WIDTH]) -> u64,
) -> u64 {
    let mut mask = 0;
    for chunk in 0..64 / WIDTH {
        let numbers = cones.numbers.each_ref().map(|row| &row.as_chunks::<WIDTH>().0[chunk]);
        mask |= signs(&inside(numbers, eye)) << (chunk * WIDTH);
    }
    mask
}

/// Body of the box kernel: returns a mask of the lanes whose box is certainly outside an `active` plane, bit
/// i for lane i. Works on `WIDTH` lanes at a time, as many as the registers hold. `signs` returns a mask of
/// the negative numbers of its argument, which is the one step that compilers do not vectorize well by
/// themselves.
#[inline(always)]
fn any_outside<const WIDTH: usize>(
    boxes: &Boxes64,
    planes: &[TestPlane; MAX_PLANES],
    active: u32,
    signs: impl Fn(&[f32; WIDTH]) -> u64,
) -> u64 {
    let mut outside = 0;
    for chunk in 0..64 / WIDTH {
        let [x0, y0, z0, x1, y1, z1] =
            core::array::from_fn(|row| &boxes.coordinates[row].as_chunks::<WIDTH>().0[chunk]);
        // Least upper bound, over the planes, of the signed distance of each box; negative for a box outside.
        let mut least = [0.0f32; WIDTH];
        let mut rest = active & ((1 << MAX_PLANES) - 1);
        while rest != 0 {
            let plane = &planes[rest.trailing_zeros() as usize % MAX_PLANES];
            rest &= rest - 1;
            let x = if plane.greatest[0] { x1 } else { x0 };
            let y = if plane.greatest[1] { y1 } else { y0 };
            let z = if plane.greatest[2] { z1 } else { z0 };
            for lane in 0..WIDTH {
                let x = greater(x[lane] * plane.high[0], x[lane] * plane.low[0]);
                let y = greater(y[lane] * plane.high[1], y[lane] * plane.low[1]);
                let z = greater(z[lane] * plane.high[2], z[lane] * plane.low[2]);
                let distance = ((x + y) + z) + plane.offset;
                // The comparison is false for NaN, so an undecided box is kept.
                least[lane] = if distance < least[lane] { distance } else { least[lane] };
            }
        }
        outside |= signs(&least) << (chunk * WIDTH);
    }
    outside
}

#[inline(always)]
fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Returns a mask of the numbers less than zero, bit i for `values[i]`. Negative zero and NaN give 0. Scalar
/// version, for targets with neither SSE2 nor SIMD of WebAssembly.
#[cfg(not(any(
    all(target_arch = "x86_64", target_feature = "sse2"),
    all(target_arch = "wasm32", target_feature = "simd128")
)))]
#[inline(always)]
fn signs_portable(values: &[f32; 16]) -> u64 {
    let mut mask = 0u16;
    for (lane, &value) in values.iter().enumerate() {
        mask |= u16::from(value < 0.0) << lane;
    }
    mask.into()
}

/// Returns a mask of the numbers less than zero, bit i for `values[i]`. Negative zero and NaN give 0. For
/// programs built with SSE2.
#[cfg(all(target_arch = "x86_64", target_feature = "sse2"))]
#[inline(always)]
#[allow(unsafe_code)]
fn signs_portable(values: &[f32; 16]) -> u64 {
    use core::arch::x86_64::{_mm_cmplt_ps, _mm_loadu_ps, _mm_movemask_ps, _mm_setzero_ps};
    let mut mask = 0;
    for (i, part) in values.as_chunks::<4>().0.iter().enumerate() {
        // SAFETY: the program is built for processors with SSE2; the load reads the four numbers of `part`
        // and needs no alignment.
        let bits = unsafe { _mm_movemask_ps(_mm_cmplt_ps(_mm_loadu_ps(part.as_ptr()), _mm_setzero_ps())) };
        mask |= u64::from(bits as u32) << (4 * i);
    }
    mask
}

/// Returns a mask of the numbers less than zero, bit i for `values[i]`. Negative zero and NaN give 0. For
/// WebAssembly built with SIMD.
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
#[inline(always)]
fn signs_portable(values: &[f32; 16]) -> u64 {
    use core::arch::wasm32::{f32x4, f32x4_lt, f32x4_splat, i32x4_bitmask};
    let mut mask = 0;
    for (i, &[a, b, c, d]) in values.as_chunks::<4>().0.iter().enumerate() {
        let negative = f32x4_lt(f32x4(a, b, c, d), f32x4_splat(0.0));
        mask |= u64::from(i32x4_bitmask(negative)) << (4 * i);
    }
    mask
}

#[cfg(all(target_arch = "x86_64", feature = "std"))]
#[target_feature(enable = "avx2")]
#[inline]
#[allow(unsafe_code)]
fn signs_avx2(values: &[f32; 32]) -> u64 {
    use core::arch::x86_64::{
        _CMP_LT_OQ, _mm256_cmp_ps, _mm256_loadu_ps, _mm256_movemask_ps, _mm256_setzero_ps,
    };
    let mut mask = 0;
    for (i, part) in values.as_chunks::<8>().0.iter().enumerate() {
        // SAFETY: reads the eight numbers of `part`; the load needs no alignment.
        let part = unsafe { _mm256_loadu_ps(part.as_ptr()) };
        let negative = _mm256_cmp_ps::<_CMP_LT_OQ>(part, _mm256_setzero_ps());
        mask |= u64::from(_mm256_movemask_ps(negative) as u32) << (8 * i);
    }
    mask
}

#[cfg(all(target_arch = "x86_64", feature = "std"))]
#[target_feature(enable = "avx512f")]
#[inline]
#[allow(unsafe_code)]
fn signs_avx512(values: &[f32; 64]) -> u64 {
    use core::arch::x86_64::{_CMP_LT_OQ, _mm512_cmp_ps_mask, _mm512_loadu_ps, _mm512_setzero_ps};
    let mut mask = 0;
    for (i, part) in values.as_chunks::<16>().0.iter().enumerate() {
        // SAFETY: reads the sixteen numbers of `part`; the load needs no alignment.
        let part = unsafe { _mm512_loadu_ps(part.as_ptr()) };
        mask |= u64::from(_mm512_cmp_ps_mask::<_CMP_LT_OQ>(part, _mm512_setzero_ps())) << (16 * i);
    }
    mask
}

#[cfg(all(test, target_arch = "x86_64", feature = "std"))]
mod tests {
    use super::*;

    #[test]
    #[allow(unsafe_code)]
    fn all_ways_to_gather_signs_agree() {
        let mut seed = 1u64;
        for _ in 0..1000 {
            let values: [f32; 64] = core::array::from_fn(|_| {
                seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                f32::from_bits((seed >> 32) as u32)
            });
            let expected = (0..64).fold(0, |mask, lane| mask | u64::from(values[lane] < 0.0) << lane);
            let parts = values.as_chunks::<16>().0.iter().enumerate();
            assert_eq!(parts.fold(0, |mask, (i, part)| mask | signs_portable(part) << (16 * i)), expected);
            for simd in Simd::available() {
                let found = match simd.0 {
                    SimdLevel::Portable => expected,
                    // SAFETY: `available` yields this level only where the processor was found to have AVX2.
                    SimdLevel::Avx2 => values
                        .as_chunks::<32>()
                        .0
                        .iter()
                        .enumerate()
                        .fold(0, |mask, (i, part)| mask | unsafe { signs_avx2(part) } << (32 * i)),
                    // SAFETY: `available` yields this level only where the processor was found to have
                    // AVX-512.
                    SimdLevel::Avx512 => unsafe { signs_avx512(&values) },
                };
                assert_eq!(found, expected, "{simd:?}");
            }
        }
    }
}
