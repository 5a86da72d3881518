//! Rounding to `f32` in a known direction, and rounding to integers without `std`.

/// Returns the greatest `f32` that is not above `x`. NaN stays NaN.
#[inline(always)]
pub(crate) fn down(x: f64) -> f32 {
    let rounded = x as f32;
    if f64::from(rounded) > x { rounded.next_down() } else { rounded }
}

/// Returns the least `f32` that is not below `x`. NaN stays NaN.
#[inline(always)]
pub(crate) fn up(x: f64) -> f32 {
    let rounded = x as f32;
    if f64::from(rounded) < x { rounded.next_up() } else { rounded }
}

/// Returns an `f32` that is not above `x`, within a relative distance of about 2^-22 or an absolute one of a
/// few 1e-38. Takes fewer instructions than [`down`]: rounding moves `x` by half a unit in the last place at
/// most, and a whole unit is subtracted first.
///
/// Numbers beyond the greatest `f32` by more than 1.5e-7 of it become infinity, which is above `x`. As the
/// depth key of an occluder, infinity hides what `x` does: every finite `f32` is below `x`, a key above `x`
/// is rounded up to infinity as well, and equal keys do not hide. Numbers below the least `f32`, or within
/// 9e-8 of it, become negative infinity. NaN and infinity become NaN.
#[inline(always)]
pub(crate) fn lower(x: f64) -> f32 {
    (x - (x.abs() * f64::from(f32::EPSILON) + f64::from(f32::MIN_POSITIVE))) as f32
}

/// `floor` and `ceil` without `std`.
pub(crate) trait FloorCeil {
    /// Returns the greatest integer that is not above `self`.
    fn floor_(self) -> Self;
    /// Returns the least integer that is not below `self`.
    fn ceil_(self) -> Self;
}

impl FloorCeil for f64 {
    /// Returns the greatest integer that is not above `self`. Magnitudes from 2^52 on are integers already
    /// and are returned as they are, as are NaN and infinities.
    #[inline(always)]
    fn floor_(self) -> f64 {
        if self.abs() < 4503599627370496.0 {
            let cut = self as i64 as f64;
            if cut > self { cut - 1.0 } else { cut }
        } else {
            self
        }
    }

    #[inline(always)]
    fn ceil_(self) -> f64 {
        -(-self).floor_()
    }
}

#[cfg(test)]
mod tests {
    use super::{FloorCeil, down, lower, up};
    use visibility_testing::{Random, UNIT, ends};

    /// Each `f32` stays, and a number between two of them becomes the neighbour on the side asked for.
    #[test]
    fn numbers_are_rounded_to_the_next_of_f32() {
        let mut random = Random(1);
        for round in 0..10_000 {
            let a = random.bits32();
            if !(a.is_finite() && a.next_up().is_finite()) {
                continue;
            }
            let (low, high) = (f64::from(a), f64::from(a.next_up()));
            assert_eq!([down(low), up(low)], [a; 2], "round {round}: {a} is a number of f32");
            for x in [low.next_up(), 0.5 * (low + high), high.next_down()] {
                assert_eq!([down(x), up(x)], [a, a.next_up()], "round {round}: {x} above {a}");
            }
            assert!(f64::from(lower(high)) < high && f64::from(lower(low)) < low, "round {round}: {a}");
        }
        assert!(down(f64::NAN).is_nan() && up(f64::NAN).is_nan(), "no number");
        let huge = f64::from(f32::MAX) * 2.0;
        assert_eq!(
            [down(huge), up(huge), down(-huge), up(-huge)].map(|x| x.is_finite()),
            [true, false, false, true],
            "numbers beyond f32 become the greatest number or infinity"
        );
    }

    /// Only numbers beyond the greatest `f32`, which are above all finite ones, are lowered to infinity. No
    /// other number is lowered to one above it.
    #[test]
    fn numbers_beyond_f32_are_lowered_to_infinity() {
        let most = f64::from(f32::MAX);
        for x in [1.0, 1.0 + 1e-8, 1.0 + 1.4e-7, 1.0 + 1.6e-7, 2.0, 1e200].map(|by| most * by) {
            assert_eq!(lower(x) == f32::INFINITY, x > most * (1.0 + 1.5e-7), "{x} lowered is {}", lower(x));
            assert!(f64::from(lower(x)) < x || x > most, "{x} lowered is {}", lower(x));
            assert!(f64::from(lower(-x)) < -x, "{} lowered is {}", -x, lower(-x));
        }
        assert_eq!(lower(f64::NEG_INFINITY), f32::NEG_INFINITY, "the least number");
        assert!(lower(f64::NAN).is_nan() && lower(f64::INFINITY).is_nan(), "no number");
    }

    #[test]
    fn floors_and_ceilings_are_integers_beside_a_number() {
        for end in ends(-3, 3) {
            let floor = end.rank.div_euclid(UNIT);
            let ceil = floor + i64::from(end.rank != floor * UNIT);
            assert_eq!([end.value.floor_(), end.value.ceil_()], [floor as f64, ceil as f64], "{end:?}");
        }
        let whole = 4503599627370496.0f64;
        for x in [whole, -whole, 1e300, f64::INFINITY] {
            assert_eq!([x.floor_(), x.ceil_()], [x; 2], "the whole number {x}");
        }
        let last = whole.next_down();
        assert_eq!(
            [last.floor_(), last.ceil_()],
            [last - 0.5, last + 0.5],
            "the last number with a fraction"
        );
    }
}
