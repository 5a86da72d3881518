//! Loops over lanes, written so that compilers turn them into vector instructions.

/// Number of boxes, or of tiles, that are processed together.
pub(crate) const WIDTH: usize = 16;

/// 1.5 times 2^23. Adding it to an `f32` of magnitude below 2^22 leaves the nearest integer in the low bits
/// of the sum.
pub(crate) const WHOLE: f32 = 12_582_912.0;

/// Returns the lesser of two numbers. `b` if one of them is NaN.
#[inline(always)]
pub(crate) fn least<T: PartialOrd>(a: T, b: T) -> T {
    if a < b { a } else { b }
}

/// Returns the greater of two numbers. `b` if one of them is NaN.
#[inline(always)]
pub(crate) fn greatest<T: PartialOrd>(a: T, b: T) -> T {
    if a > b { a } else { b }
}

/// Returns the integer nearest to `x`, ties to even. The magnitude of `x` must be below 2^22; else, and for
/// NaN, the result is meaningless. This is much faster than a cast, which must saturate.
#[inline(always)]
pub(crate) fn round_to_i32(x: f32) -> i32 {
    (x + WHOLE).to_bits() as i32 - WHOLE.to_bits() as i32
}

/// Returns a mask whose bit i is byte i of `bytes`. Each byte must be 0 or 1.
#[inline(always)]
pub(crate) fn bits(bytes: &[u8; WIDTH]) -> u32 {
    let ([low, high], _) = bytes.as_chunks::<8>() else { return 0 };
    // The factor moves the lowest bit of byte i to bit 56 + i of the product.
    let low = u64::from_le_bytes(*low).wrapping_mul(0x0102_0408_1020_4080) >> 56;
    let high = u64::from_le_bytes(*high).wrapping_mul(0x0102_0408_1020_4080) >> 56;
    (low | high << 8) as u32
}

/// Returns the least or the greatest of all lanes, where `pick` is [`least`] or [`greatest`]. No lane may be
/// NaN.
#[inline(always)]
pub(crate) fn of_all(lanes: &[f32; WIDTH], pick: impl Fn(f32, f32) -> f32) -> f32 {
    // Reduces by halves, in four dependent steps instead of sixteen.
    let mut halves = *lanes;
    let mut half = WIDTH / 2;
    while half > 0 {
        for i in 0..half {
            halves[i] = pick(halves[i], halves[i + half]);
        }
        half /= 2;
    }
    halves[0]
}

/// Returns whether any of `values` is strictly less than `limit`. False for no values; NaN is not less.
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

/// Returns whether all of `values` are strictly greater than `limit`. True for no values; NaN is not greater.
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

#[cfg(test)]
mod tests {
    use super::{all_above, any_below};

    /// A number at the limit is on neither side of it, in whichever lane it is.
    #[test]
    fn numbers_at_the_limit_are_on_neither_side() {
        for count in 1..40 {
            for at in 0..count {
                let with = |other: f32| {
                    let mut values = [2.0; 40];
                    values[at] = other;
                    (any_below(&values[..count], 2.0), all_above(&values[..count], 1.0))
                };
                assert_eq!(with(2.0), (false, true), "{count} numbers, all at the limit");
                assert_eq!(with(2.0f32.next_down()), (true, true), "lane {at} of {count} is below");
                assert_eq!(with(1.0), (true, false), "lane {at} of {count} is not above");
                assert_eq!(with(f32::NAN), (false, false), "lane {at} of {count} is no number");
            }
        }
        assert!(!any_below(&[], 1.0) && all_above(&[], 1.0), "no numbers");
    }
}
