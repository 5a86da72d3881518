//! Exact random vectors of integers, for tests of error margins.

use visibility_core::glam::DVec3;

/// A vector of integers. Sums and products are exact while no coordinate or intermediate result exceeds 2^126
/// in absolute value.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct IntegerVector(pub(crate) [i128; 3]);

impl IntegerVector {
    pub(crate) fn plus(self, other: Self) -> Self {
        Self([0, 1, 2].map(|k| self.0[k] + other.0[k]))
    }

    pub(crate) fn minus(self, other: Self) -> Self {
        self.plus(other.times(-1))
    }

    pub(crate) fn times(self, factor: i128) -> Self {
        Self(self.0.map(|x| x * factor))
    }

    pub(crate) fn dot(self, other: Self) -> i128 {
        (0..3).map(|k| self.0[k] * other.0[k]).sum()
    }

    pub(crate) fn cross(self, other: Self) -> Self {
        Self([0, 1, 2].map(|k| {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            self.0[i] * other.0[j] - self.0[j] * other.0[i]
        }))
    }

    /// Returns the nearest `f64` vector; exact if the coordinates are at most 2^53 in absolute value.
    pub(crate) fn to_f64(self) -> DVec3 {
        DVec3::from(self.0.map(|x| x as f64))
    }
}

/// A linear congruential generator of random numbers with Knuth's constants. The field is its state, at first
/// the seed.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    /// Returns a random integer from `-most` to `most`, both included. `most` is at most 2^52.
    pub(crate) fn below(&mut self, most: i64) -> i128 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        i128::from((self.0 >> 10) as i64 % (2 * most + 1) - most)
    }

    /// Returns a vector with each coordinate random from `-most` to `most`, both included.
    pub(crate) fn vector(&mut self, most: i64) -> IntegerVector {
        IntegerVector([0; 3].map(|_| self.below(most)))
    }
}
