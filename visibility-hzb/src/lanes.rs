//! Loops over lanes, written so that compilers turn them into vector instructions.

/// Number of boxes, or of tiles, that are worked on together.
pub(crate) const WIDTH: usize = 16;

/// 1.5 times 2^23. A number below 2^22 in size, added to it, leaves the nearest integer in the low bits.
const WHOLE: f32 = 12_582_912.0;

/// The nearest integer, of numbers below 2^22 in size: much faster than a cast, which must not go wrong on
/// any number.
#[inline(always)]
pub(crate) fn round_to_i32(x: f32) -> i32 {
    (x + WHOLE).to_bits() as i32 - WHOLE.to_bits() as i32
}

/// A bit for each byte, which is 0 or 1. The product puts byte `i` into bit `56 + i`.
#[inline(always)]
pub(crate) fn bits(bytes: &[u8; WIDTH]) -> u32 {
    let ([low, high], _) = bytes.as_chunks::<8>() else { return 0 };
    let low = u64::from_le_bytes(*low).wrapping_mul(0x0102_0408_1020_4080) >> 56;
    let high = u64::from_le_bytes(*high).wrapping_mul(0x0102_0408_1020_4080) >> 56;
    (low | high << 8) as u32
}

/// Whether any of the numbers is below a limit. NaN is not.
#[inline(always)]
pub(crate) fn any_below(values: &[f32], limit: f32) -> bool {
    let (chunks, rest) = values.as_chunks::<16>();
    for chunk in chunks {
        let mut any = false;
        for &value in chunk {
            any |= value < limit;
        }
        if any {
            return true;
        }
    }
    let mut any = false;
    for &value in rest {
        any |= value < limit;
    }
    any
}

/// Whether all numbers are above a limit. NaN is not.
#[inline(always)]
pub(crate) fn all_above(values: &[f32], limit: f32) -> bool {
    let (chunks, rest) = values.as_chunks::<16>();
    for chunk in chunks {
        let mut all = true;
        for &value in chunk {
            all &= value > limit;
        }
        if !all {
            return false;
        }
    }
    let mut all = true;
    for &value in rest {
        all &= value > limit;
    }
    all
}
