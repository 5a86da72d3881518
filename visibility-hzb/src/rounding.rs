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
