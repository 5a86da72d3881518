//! The kernel of every hierarchical test: 64 boxes against planes, for each instruction set.
//!
//! There is one body, in plain safe loops that compilers turn into SIMD; it is compiled once for the instruction set that
//! the program is built for and, on x86-64 with `std`, again for AVX2 and AVX-512, one of which is chosen at run time.
//! Rust neither reorders nor fuses floating-point operations, so all of them give the same bits.
//!
//! This is the only module with `unsafe` code: the calls of functions compiled for instructions that the program
//! at large does not assume.

use crate::frustum::TestPlane;
use crate::scene::Boxes64;
use crate::view::MAX_PLANES;

/// Which instructions to use. Answers are the same on all.
///
/// ```
/// use visibility_core::Simd;
/// assert!(Simd::available().any(|simd| simd == Simd::best()));
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Simd(Path);

/// Values beyond `Portable` are made by [`Simd::available`] alone, after it has asked the processor: that is what makes
/// the calls below sound.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Path {
    Portable,
    #[cfg(all(target_arch = "x86_64", feature = "std"))]
    Avx2,
    #[cfg(all(target_arch = "x86_64", feature = "std"))]
    Avx512,
}

impl Simd {
    /// Whatever the program was built for: SSE2, NEON, wasm SIMD or scalar.
    pub const PORTABLE: Self = Self(Path::Portable);

    /// The paths that this processor can run, from the narrowest to the widest.
    pub fn available() -> impl Iterator<Item = Self> {
        #[cfg(all(target_arch = "x86_64", feature = "std"))]
        let wide = [
            std::is_x86_feature_detected!("avx2").then_some(Self(Path::Avx2)),
            (std::is_x86_feature_detected!("avx512f")
                && std::is_x86_feature_detected!("avx512bw")
                && std::is_x86_feature_detected!("avx512dq")
                && std::is_x86_feature_detected!("avx512vl"))
            .then_some(Self(Path::Avx512)),
        ];
        #[cfg(not(all(target_arch = "x86_64", feature = "std")))]
        let wide = [None; 0];
        core::iter::once(Self::PORTABLE).chain(wide.into_iter().flatten())
    }

    /// The widest path that this processor can run.
    pub fn best() -> Self {
        Self::available().last().unwrap_or(Self::PORTABLE)
    }

    /// The lanes whose boxes lie surely outside at least one of the planes that are set in `active`.
    #[allow(unsafe_code)]
    pub(crate) fn any_outside(self, boxes: &Boxes64, planes: &[TestPlane; MAX_PLANES], active: u32) -> u64 {
        match self.0 {
            Path::Portable => any_outside::<false>(boxes, planes, active),
            // SAFETY: a value with this path exists only where the processor was found to have AVX2.
            #[cfg(all(target_arch = "x86_64", feature = "std"))]
            Path::Avx2 => unsafe { any_outside_avx2(boxes, planes, active) },
            // SAFETY: a value with this path exists only where the processor was found to have these extensions.
            #[cfg(all(target_arch = "x86_64", feature = "std"))]
            Path::Avx512 => unsafe { any_outside_avx512(boxes, planes, active) },
        }
    }
}

#[cfg(all(target_arch = "x86_64", feature = "std"))]
#[target_feature(enable = "avx2")]
fn any_outside_avx2(boxes: &Boxes64, planes: &[TestPlane; MAX_PLANES], active: u32) -> u64 {
    any_outside::<true>(boxes, planes, active)
}

#[cfg(all(target_arch = "x86_64", feature = "std"))]
#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
fn any_outside_avx512(boxes: &Boxes64, planes: &[TestPlane; MAX_PLANES], active: u32) -> u64 {
    any_outside::<false>(boxes, planes, active)
}

/// Lanes that are worked on at once: one AVX-512 register, two of AVX2, four of SSE2 and NEON.
const WIDTH: usize = 16;

/// The body. `GATHER` chooses how signs become a mask, which is all that compilers need help with.
#[inline(always)]
fn any_outside<const GATHER: bool>(boxes: &Boxes64, planes: &[TestPlane; MAX_PLANES], active: u32) -> u64 {
    let mut outside = 0;
    for chunk in 0..64 / WIDTH {
        let columns: [&[f32; WIDTH]; 6] =
            core::array::from_fn(|row| &boxes.coordinates[row].as_chunks::<WIDTH>().0[chunk]);
        // The least of the upper bounds on the distance to each plane; below zero, the box is outside.
        let mut least = [0.0f32; WIDTH];
        let mut rest = active & ((1 << MAX_PLANES) - 1);
        while rest != 0 {
            let plane = &planes[rest.trailing_zeros() as usize % MAX_PLANES];
            rest &= rest - 1;
            let [x, y, z] = plane.rows.map(|row| columns[row as usize % 6]);
            for lane in 0..WIDTH {
                let x = greater(x[lane] * plane.high[0], x[lane] * plane.low[0]);
                let y = greater(y[lane] * plane.high[1], y[lane] * plane.low[1]);
                let z = greater(z[lane] * plane.high[2], z[lane] * plane.low[2]);
                let distance = ((x + y) + z) + plane.offset;
                // False for NaN, so that what cannot be decided stays.
                least[lane] = if distance < least[lane] { distance } else { least[lane] };
            }
        }
        outside |= if GATHER { signs_by_bytes(&least) } else { signs_by_bits(&least) } << (chunk * WIDTH);
    }
    outside
}

#[inline(always)]
fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// A bit for each negative number. Compiles to a mask register with AVX-512 and to movemask with SSE2.
#[inline(always)]
fn signs_by_bits(values: &[f32; WIDTH]) -> u64 {
    let mut mask = 0u16;
    for (lane, &value) in values.iter().enumerate() {
        mask |= u16::from(value < 0.0) << lane;
    }
    mask.into()
}

/// The same by way of bytes, whose low bits a multiplication gathers eight at a time: faster with AVX2.
#[inline(always)]
fn signs_by_bytes(values: &[f32; WIDTH]) -> u64 {
    let mut bytes = [0u8; WIDTH];
    for (byte, &value) in bytes.iter_mut().zip(values) {
        *byte = (value < 0.0).into();
    }
    let gather = |bytes: [u8; 8]| u64::from_le_bytes(bytes).wrapping_mul(0x0102_0408_1020_4080) >> 56;
    let [low, high] = [0, 1].map(|half| bytes.as_chunks::<8>().0[half]);
    gather(low) | gather(high) << 8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_ways_to_gather_signs_agree() {
        let mut seed = 1u64;
        for _ in 0..1000 {
            let values: [f32; WIDTH] = core::array::from_fn(|_| {
                seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                f32::from_bits((seed >> 32) as u32)
            });
            let expected = (0..WIDTH).fold(0, |mask, lane| mask | u64::from(values[lane] < 0.0) << lane);
            assert_eq!(signs_by_bits(&values), expected);
            assert_eq!(signs_by_bytes(&values), expected);
        }
    }
}
