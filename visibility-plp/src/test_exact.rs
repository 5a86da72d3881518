//! Exact integer vectors for tests of rounding margins: coordinates of 24 bits, and products of three of
//! them, fit.

use visibility_core::glam::DVec3;
pub(crate) use visibility_testing::Random;

/// A vector of integers.
pub(crate) type IntVector = [i64; 3];

/// Random numbers that are exact.
pub(crate) trait RandomExact {
    /// An integer between `-below` and `below`, without `below` itself.
    fn whole(&mut self, below: i64) -> i64;

    /// Three such integers.
    fn integers(&mut self, below: i64) -> IntVector {
        [(); 3].map(|()| self.whole(below))
    }

    /// A number from -1 to 1.
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

/// The vector `a` times 2^-30, rounded to f64.
pub(crate) fn fine(a: IntVector) -> DVec3 {
    DVec3::from_array(a.map(|x| x as f64)) / f64::from(1 << 30)
}

/// The point `a + s (b - a) + t (c - a)` times 2^30, where `s` and `t` are given times 2^30.
pub(crate) fn within([a, b, c]: [IntVector; 3], s: i64, t: i64) -> IntVector {
    [0, 1, 2].map(|i| (a[i] << 30) + s * (b[i] - a[i]) + t * (c[i] - a[i]))
}
