//! Rounding in a known direction, and to whole numbers without `std`.

/// To `f32`, not above.
#[inline(always)]
pub(crate) fn down(x: f64) -> f32 {
    let rounded = x as f32;
    if f64::from(rounded) > x { rounded.next_down() } else { rounded }
}

/// To `f32`, not below.
#[inline(always)]
pub(crate) fn up(x: f64) -> f32 {
    let rounded = x as f32;
    if f64::from(rounded) < x { rounded.next_up() } else { rounded }
}

/// To `f32`, not above: rounding moves by half a unit at most, and a whole one is taken off.
#[inline(always)]
pub(crate) fn lower(x: f64) -> f32 {
    (x - (x.abs() * f64::from(f32::EPSILON) + f64::from(f32::MIN_POSITIVE))) as f32
}

/// Rounding without `std`.
pub(crate) trait FloorCeil {
    fn floor_(self) -> Self;
    fn ceil_(self) -> Self;
}

impl FloorCeil for f64 {
    /// Of numbers beyond 2^52, which are whole, the number itself.
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
