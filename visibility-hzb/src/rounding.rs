//! Rounding in a known direction, and to whole numbers without `std`.

/// The greatest `f32` not above `x`. NaN stays NaN.
#[inline(always)]
pub(crate) fn down(x: f64) -> f32 {
    let rounded = x as f32;
    if f64::from(rounded) > x { rounded.next_down() } else { rounded }
}

/// The least `f32` not below `x`. NaN stays NaN.
#[inline(always)]
pub(crate) fn up(x: f64) -> f32 {
    let rounded = x as f32;
    if f64::from(rounded) < x { rounded.next_up() } else { rounded }
}

/// An `f32` not above `x`, perhaps not the greatest, in fewer instructions than [`down`]: rounding moves by
/// half a unit at most, and a whole unit is taken off.
#[inline(always)]
pub(crate) fn lower(x: f64) -> f32 {
    (x - (x.abs() * f64::from(f32::EPSILON) + f64::from(f32::MIN_POSITIVE))) as f32
}

/// `floor` and `ceil` without `std`.
pub(crate) trait FloorCeil {
    fn floor_(self) -> Self;
    fn ceil_(self) -> Self;
}

impl FloorCeil for f64 {
    /// The greatest whole number not above. Numbers beyond 2^52 are whole and stay; so do NaN and infinities.
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
