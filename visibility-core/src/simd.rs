//! The instruction sets that kernels are compiled for, and the kernel of the hierarchy tests: 64 boxes
//! against planes.
//!
//! Each kernel has one body of safe loops, which compilers turn into SIMD code. The body is compiled once for
//! the instruction set that the program is built for and, on x86-64 with `std`, also for AVX2 and AVX-512;
//! one of these is chosen at run time. Rust neither reorders nor fuses floating-point operations, so all
//! variants give bit-identical results.
//!
//! This is the only module with `unsafe` code: calls of functions compiled for instructions that the rest of
//! the program does not assume, and loads of arrays into SIMD registers.

use crate::scene::{Boxes64, FAN_OUT};
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
}

/// Declares a trait `Kernels` with methods that return a mask of 64 lanes, and implements it for [`Simd`].
/// Each method calls the function given for it, the body, compiled for the instruction set of the [`Simd`].
/// The body takes the method's arguments and, last, `signs_portable`, `signs_avx2` or `signs_avx512`, whose
/// argument's length is the number of lanes to work on at a time. It must be `#[inline(always)]`. For the
/// SIMD modules of this crate and of other crates of the workspace.
#[doc(hidden)]
#[macro_export]
macro_rules! mask_kernels {
    ($($(#[$attribute:meta])* $name:ident = $body:path, ($($argument:ident: $type:ty),*);)*) => {
        pub(crate) trait Kernels {
            $($(#[$attribute])* fn $name(self, $($argument: $type),*) -> u64;)*
        }

        impl Kernels for $crate::simd::Simd {
            $(
                #[allow(unsafe_code)]
                fn $name(self, $($argument: $type),*) -> u64 {
                    #[cfg(all(target_arch = "x86_64", feature = "std"))]
                    #[target_feature(enable = "avx2")]
                    fn avx2($($argument: $type),*) -> u64 {
                        $body($($argument,)* |values| $crate::simd::signs_avx2(values))
                    }

                    #[cfg(all(target_arch = "x86_64", feature = "std"))]
                    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
                    fn avx512($($argument: $type),*) -> u64 {
                        $body($($argument,)* |values| $crate::simd::signs_avx512(values))
                    }

                    match self.level() {
                        // SAFETY: a value of this level exists only where the processor was found to have
                        // AVX2.
                        #[cfg(all(target_arch = "x86_64", feature = "std"))]
                        $crate::simd::SimdLevel::Avx2 => unsafe { avx2($($argument),*) },
                        // SAFETY: a value of this level exists only where the processor was found to have
                        // these extensions.
                        #[cfg(all(target_arch = "x86_64", feature = "std"))]
                        $crate::simd::SimdLevel::Avx512 => unsafe { avx512($($argument),*) },
                        _ => $body($($argument,)* $crate::simd::signs_portable),
                    }
                }
            )*
        }
    };
}

mask_kernels! {
    /// Returns a mask of the lanes whose box is certainly outside at least one active plane; bit i stands for
    /// lane i. Bit p of `active` selects `planes[p]`. Boxes that rounding leaves undecided, boxes that touch
    /// a plane, and NaN count as not outside.
    any_outside = any_outside, (boxes: &Boxes64, planes: &[TestPlane; MAX_PLANES], active: u32);
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
    for chunk in 0..FAN_OUT / WIDTH {
        let [x0, y0, z0, x1, y1, z1] =
            core::array::from_fn(|row| &boxes.coordinates[row].as_chunks::<WIDTH>().0[chunk]);
        // For each box, the least of its upper bounds on the signed distance from the planes; negative if the
        // box is outside a plane.
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
#[doc(hidden)]
pub fn signs_portable(values: &[f32; 16]) -> u64 {
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
#[doc(hidden)]
#[allow(unsafe_code)]
pub fn signs_portable(values: &[f32; 16]) -> u64 {
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
#[doc(hidden)]
pub fn signs_portable(values: &[f32; 16]) -> u64 {
    use core::arch::wasm32::{f32x4, f32x4_lt, f32x4_splat, i32x4_bitmask};
    let mut mask = 0;
    for (i, &[a, b, c, d]) in values.as_chunks::<4>().0.iter().enumerate() {
        let negative = f32x4_lt(f32x4(a, b, c, d), f32x4_splat(0.0));
        mask |= u64::from(i32x4_bitmask(negative)) << (4 * i);
    }
    mask
}

/// Returns a mask of the numbers less than zero, bit i for `values[i]`. Negative zero and NaN give 0.
#[cfg(all(target_arch = "x86_64", feature = "std"))]
#[target_feature(enable = "avx2")]
#[inline]
#[doc(hidden)]
#[allow(unsafe_code)]
pub fn signs_avx2(values: &[f32; 32]) -> u64 {
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

/// Returns a mask of the numbers less than zero, bit i for `values[i]`. Negative zero and NaN give 0.
#[cfg(all(target_arch = "x86_64", feature = "std"))]
#[target_feature(enable = "avx512f")]
#[inline]
#[doc(hidden)]
#[allow(unsafe_code)]
pub fn signs_avx512(values: &[f32; FAN_OUT]) -> u64 {
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
        let mut random = visibility_testing::Random(1);
        for _ in 0..1000 {
            let values: [f32; FAN_OUT] = core::array::from_fn(|_| random.bits32());
            let expected = (0..FAN_OUT).fold(0, |mask, lane| mask | u64::from(values[lane] < 0.0) << lane);
            let parts = values.as_chunks::<16>().0.iter().enumerate();
            assert_eq!(
                parts.fold(0, |mask, (i, part)| mask | signs_portable(part) << (16 * i)),
                expected,
                "the portable way, in parts of 16"
            );
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
