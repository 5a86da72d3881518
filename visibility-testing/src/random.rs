//! Pseudorandom numbers, identical in each run.

use visibility_core::Aabb;
use visibility_core::glam::{DVec3, Vec3};

/// Random number generator: [`visibility_core::random`] with the kinds of draws that tests need. The field is
/// the seed; any seed is permitted. The variable `TRIAL_SEED` of the environment, a number, makes all
/// generators draw others: see [`judged`](crate::judged).
#[derive(Clone, Debug)]
pub struct Random(pub u64);

impl Random {
    /// Returns 64 random bits.
    pub fn bits(&mut self) -> u64 {
        let shift = crate::trials::shift();
        let mut random = visibility_core::random::Random(self.0.wrapping_add(shift));
        let bits = random.bits();
        self.0 = random.0.wrapping_sub(shift);
        bits
    }

    /// Returns an `f32` of random bits, including NaN, infinite and denormal numbers.
    pub fn bits32(&mut self) -> f32 {
        f32::from_bits(self.bits() as u32)
    }

    /// Returns an `f64` of random bits, including NaN, infinite and denormal numbers.
    pub fn bits64(&mut self) -> f64 {
        f64::from_bits(self.bits())
    }

    /// Returns an index from 0 (inclusive) to `limit` (exclusive). Panics if `limit` is 0.
    pub fn below(&mut self, limit: usize) -> usize {
        (self.bits() % limit as u64) as usize
    }

    /// Returns an integer between two bounds, both included, in either order.
    pub fn between(&mut self, a: i32, b: i32) -> i32 {
        let count = u64::from(a.abs_diff(b)) + 1;
        a.min(b).wrapping_add_unsigned((self.bits() % count) as u32)
    }

    /// Returns an integer from 1 to 2^`bits`, each binary order of magnitude as likely as another. Panics if
    /// `bits` is 0.
    pub fn magnitude(&mut self, bits: usize) -> i64 {
        let most = 1 << self.below(bits);
        most + self.below(most as usize + 1) as i64
    }

    /// Returns true with probability 1 in `n`. Panics if `n` is 0.
    pub fn one_in(&mut self, n: usize) -> bool {
        self.below(n) == 0
    }

    /// Returns a random element of a slice. Panics if the slice is empty.
    pub fn pick<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.below(of.len())]
    }

    /// Returns a number from 0 (inclusive) to 1 (exclusive), a multiple of 2^-24: exact in `f32`.
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 40) as f64 / 16777216.0
    }

    /// Returns a number from `least` (inclusive) to `greatest` (exclusive up to rounding), in steps of 2^-24
    /// of their difference.
    pub fn range(&mut self, least: f64, greatest: f64) -> f64 {
        least + (greatest - least) * self.unit()
    }

    /// Returns a vector whose coordinates are each from `-size` to `size`, in steps of `size / 2^23`.
    pub fn vector(&mut self, size: f64) -> DVec3 {
        DVec3::from_array(core::array::from_fn(|_| self.range(-size, size)))
    }

    /// Returns a number from 0 (inclusive) to 1 (exclusive), a multiple of 2^-53.
    pub fn fine_unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Returns a number from `least` (inclusive) to `greatest` (exclusive up to rounding), in steps of 2^-53
    /// of their difference.
    pub fn fine_range(&mut self, least: f64, greatest: f64) -> f64 {
        least + (greatest - least) * self.fine_unit()
    }

    /// Returns a vector whose coordinates are each from `-size` to `size`, in steps of `size / 2^52`.
    pub fn fine_vector(&mut self, size: f64) -> DVec3 {
        DVec3::from_array(core::array::from_fn(|_| self.fine_range(-size, size)))
    }

    /// Returns a vector of `f32` whose coordinates are each from `least` to `greatest`.
    pub fn vec3(&mut self, least: f64, greatest: f64) -> Vec3 {
        DVec3::from_array(core::array::from_fn(|_| self.fine_range(least, greatest))).as_vec3()
    }

    /// Returns a box with sides of at most a metre. The coordinates of its least corner are at most `reach`
    /// metres in magnitude.
    pub fn small_box(&mut self, reach: f64) -> Aabb {
        let min = self.vector(reach).as_vec3();
        Aabb::new(min, min + self.vector(1.0).abs().as_vec3())
    }

    /// Returns 16 points of a box: its eight corners, and eight random points inside.
    pub fn points_of(&mut self, bounds: &Aabb) -> [DVec3; 16] {
        let (corners, size) = (bounds.corners(), bounds.max - bounds.min);
        core::array::from_fn(|at| {
            let within = || bounds.min + size * self.vec3(0.0, 1.0);
            corners.get(at).copied().unwrap_or_else(within).as_dvec3()
        })
    }

    /// Returns a unit vector; all directions are equally likely.
    pub fn direction(&mut self) -> DVec3 {
        loop {
            let v = DVec3::from_array(core::array::from_fn(|_| self.fine_range(-1.0, 1.0)));
            if v.length_squared() <= 1.0 && v.length_squared() > 1e-4 {
                return v.normalize();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integers_lie_between_any_two_bounds() {
        let mut random = Random(1);
        for (a, b) in [(3, 3), (-2, 4), (4, -2), (i32::MIN, i32::MAX), (i32::MAX, i32::MIN)] {
            for _ in 0..100 {
                let drawn = random.between(a, b);
                assert!((a.min(b)..=a.max(b)).contains(&drawn), "{drawn} between {a} and {b}");
            }
        }
    }
}
