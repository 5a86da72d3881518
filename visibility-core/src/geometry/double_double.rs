//! Double-double arithmetic: numbers with about 106 significant bits, for certificates and for tests of error
//! margins that `f64` cannot resolve.
//!
//! This work is based on: T. J. Dekker, "A Floating-Point Technique for Extending the Available Precision",
//! 1971, and M. Joldes, J.-M. Muller and V. Popescu, "Tight and Rigorous Error Bounds for Basic Building
//! Blocks of DoubleDouble-Word Arithmetic", 2017. The latter proves relative error bounds of 3 u^2 for a sum
//! and 8 u^2 for a product, with u = 2^-53, if nothing underflows or overflows.

/// The unevaluated sum `hi + lo` of two `f64`, where `hi` is that sum rounded to nearest.
///
/// The relative error of a sum or product is at most [`ERROR`](Self::ERROR), as long as nothing overflows and
/// no product has a magnitude below 2^-969 (its low part would underflow). An infinite or NaN operand makes
/// `lo` NaN.
///
/// ```
/// use visibility_core::geometry::DoubleDouble;
/// let tiny = 1e-20;
/// let sum = DoubleDouble::sum(1.0, tiny).plus(DoubleDouble::from(-1.0));
/// assert_eq!(sum.hi, tiny);
/// ```
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct DoubleDouble {
    /// Leading part: the represented number rounded to the nearest `f64`.
    pub hi: f64,
    /// Trailing part: the represented number minus `hi`. Its magnitude is at most half a unit in the last
    /// place of `hi`.
    pub lo: f64,
}

impl DoubleDouble {
    /// Zero.
    pub const ZERO: Self = Self { hi: 0.0, lo: 0.0 };

    /// Upper bound on the relative error of [`plus`](Self::plus) and [`times`](Self::times): 16 u^2 = 2^-102,
    /// where u = 2^-53.
    pub const ERROR: f64 = 1.0 / (1u128 << 102) as f64;

    /// Returns `a + b` exactly, unless the sum overflows (Knuth's two-sum).
    pub fn sum(a: f64, b: f64) -> Self {
        let hi = a + b;
        let of_b = hi - a;
        Self { hi, lo: (a - (hi - of_b)) + (b - of_b) }
    }

    /// Returns `a - b` exactly, unless the difference overflows.
    pub fn difference(a: f64, b: f64) -> Self {
        Self::sum(a, -b)
    }

    /// Returns `a + b` exactly, if the magnitude of `a` is at least that of `b` (Dekker's fast two-sum).
    fn sum_ordered(a: f64, b: f64) -> Self {
        let hi = a + b;
        Self { hi, lo: b - (hi - a) }
    }

    /// Returns `a * b` (Dekker's product). The result is exact if the magnitude of the product is 0 or at
    /// least 2^-969 and nothing overflows.
    pub fn product(a: f64, b: f64) -> Self {
        let hi = a * b;
        let [(a1, a2), (b1, b2)] = [halves(a), halves(b)];
        Self { hi, lo: ((a1 * b1 - hi) + a1 * b2 + a2 * b1) + a2 * b2 }
    }

    /// Returns `self + other` with a relative error of at most [`ERROR`](Self::ERROR).
    #[must_use]
    pub fn plus(self, other: Self) -> Self {
        let (s, t) = (Self::sum(self.hi, other.hi), Self::sum(self.lo, other.lo));
        let v = Self::sum_ordered(s.hi, s.lo + t.hi);
        Self::sum_ordered(v.hi, t.lo + v.lo)
    }

    /// Returns the number with the opposite sign, exactly.
    #[must_use]
    pub fn negated(self) -> Self {
        Self { hi: -self.hi, lo: -self.lo }
    }

    /// Returns `self * other`. The relative error is at most [`ERROR`](Self::ERROR) if the magnitude of the
    /// product is 0 or at least 2^-969.
    #[must_use]
    pub fn times(self, other: Self) -> Self {
        let p = Self::product(self.hi, other.hi);
        Self::sum_ordered(p.hi, p.lo + (self.hi * other.lo + self.lo * other.hi))
    }

    /// Returns `self * power`, exactly. `power` must be a power of two, and neither part may overflow or
    /// underflow.
    #[must_use]
    pub fn scaled(self, power: f64) -> Self {
        Self { hi: self.hi * power, lo: self.lo * power }
    }
}

impl From<f64> for DoubleDouble {
    fn from(hi: f64) -> Self {
        Self { hi, lo: 0.0 }
    }
}

/// Splits `a` into a high and a low part of at most 26 bits each with `high + low == a` exactly (Veltkamp,
/// 1968). The parts are NaN if `a` is not finite or its magnitude is above about 2^996.
fn halves(a: f64) -> (f64, f64) {
    let c = a * 134_217_729.0;
    let high = c - (c - a);
    (high, a - high)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Converts a number to an integer in units of 2^-80, so that products of the test's numbers are
    /// integers. Panics if a part is not a multiple of that unit.
    fn exact(a: DoubleDouble) -> i128 {
        let scaled = |v: f64| {
            let v = v * (1u128 << 80) as f64;
            assert_eq!(v, v.trunc(), "a part is not a multiple of 2^-80");
            v as i128
        };
        scaled(a.hi) + scaled(a.lo)
    }

    #[test]
    fn sums_and_products_of_two_numbers_are_exact() {
        let mut random = visibility_testing::Random(1);
        let mut random = || {
            let state = random.bits();
            // Random values are multiples of 2^-26 below 2^20 and thus have 46 bits, so a product has 92.
            ((state >> 17) as i64 - (1 << 46)) >> (state % 40)
        };
        for _ in 0..10_000 {
            let (a, b) = (random(), random());
            let [x, y] = [a, b].map(|v| v as f64 / (1 << 26) as f64);
            assert_eq!(
                exact(DoubleDouble::difference(x, y)),
                i128::from(a - b) << 54,
                "the difference of {x} and {y}, in units of 2^-80"
            );
            // The exact product in units of 2^-52, for comparison.
            assert_eq!(
                exact(DoubleDouble::product(x, y)),
                (i128::from(a) * i128::from(b)) << 28,
                "the product of {x} and {y}, in units of 2^-80"
            );
            let sum = DoubleDouble::product(x, y)
                .plus(DoubleDouble::product(y, y))
                .plus(DoubleDouble::product(x, -y));
            let error = exact(sum) - ((i128::from(b) * i128::from(b)) << 28);
            assert!(error.abs() <= 1 << 26, "{error}");
        }
    }

    #[test]
    fn products_of_long_numbers_keep_their_digits() {
        // The exact product is (1 + 2^-60) (1 - 2^-60) = 1 - 2^-120.
        let tiny = 2f64.powi(-60);
        let p = DoubleDouble { hi: 1.0, lo: tiny }.times(DoubleDouble { hi: 1.0, lo: -tiny });
        assert_eq!((p.hi, p.lo), (1.0, 0.0), "a product whose rest is below the last digit");
        let p = DoubleDouble { hi: 1.0, lo: tiny }.times(DoubleDouble { hi: 1.0, lo: tiny });
        assert_eq!((p.hi, p.lo), (1.0, 2.0 * tiny), "a product whose rest of 2^-59 is kept");
    }
}
