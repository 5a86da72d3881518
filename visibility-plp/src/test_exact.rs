//! Exact integer vectors for tests of rounding margins. Coordinates of 24 bits and products of three such
//! coordinates are exact.

use visibility_core::glam::DVec3;
pub(crate) use visibility_testing::Random;

/// Vector of exact integer coordinates x, y and z, in whatever unit a test chooses.
pub(crate) type IntVector = [i64; 3];

/// Extends the tests' random number generator by numbers that i64 or f64 represents exactly, for tests of
/// rounding margins against exact integer arithmetic.
pub(crate) trait RandomExact {
    /// Returns a random integer from `-below` (inclusive) to `below` (exclusive).
    fn whole(&mut self, below: i64) -> i64;

    /// Returns a vector of three random integers from `-below` (inclusive) to `below` (exclusive).
    fn integers(&mut self, below: i64) -> IntVector {
        [(); 3].map(|()| self.whole(below))
    }

    /// Returns a random number from -1 (inclusive) to 1 (exclusive), a multiple of 2^-50.
    fn float(&mut self) -> f64 {
        self.whole(1 << 50) as f64 / (1i64 << 50) as f64
    }
}

impl RandomExact for Random {
    fn whole(&mut self, below: i64) -> i64 {
        ((i128::from(self.bits() >> 1) * i128::from(below)) >> 62) as i64 - below
    }
}

pub(crate) fn minus(a: IntVector, b: IntVector) -> IntVector {
    [0, 1, 2].map(|i| a[i] - b[i])
}

pub(crate) fn cross(a: IntVector, b: IntVector) -> [i128; 3] {
    let [a, b] = [a, b].map(|v| v.map(i128::from));
    [0, 1, 2].map(|i| a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3])
}

pub(crate) fn dot(a: [i128; 3], b: IntVector) -> i128 {
    (0..3).map(|i| a[i] * i128::from(b[i])).sum()
}

/// Returns the vector `a` times 2^-30, rounded to f64.
pub(crate) fn fine(a: IntVector) -> DVec3 {
    DVec3::from_array(a.map(|x| x as f64)) / f64::from(1 << 30)
}

/// Returns the point `a + s (b - a) + t (c - a)` times 2^30, exactly. `s` and `t` are given times 2^30.
pub(crate) fn within([a, b, c]: [IntVector; 3], s: i64, t: i64) -> IntVector {
    [0, 1, 2].map(|i| (a[i] << 30) + s * (b[i] - a[i]) + t * (c[i] - a[i]))
}
