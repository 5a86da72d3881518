//! Random numbers, the same in each run.

use visibility_core::glam::{DVec3, Vec3};

/// A sequence of random numbers: SplitMix64 (Steele, Lea and Flood, "Fast Splittable Pseudorandom Number
/// Generators", 2014). The field is the seed, and any seed is good. Integer arithmetic makes the bits, so
/// they are the same on every target.
///
/// ```
/// let mut random = visibility_testing::Random(1);
/// assert!((10..=20).contains(&random.between(10, 20)));
/// assert_eq!(random.clone().bits(), random.bits());
/// ```
#[derive(Clone, Debug)]
pub struct Random(pub u64);

impl Random {
    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    /// An `f32` of any bits: NaN, infinite and denormal ones among them.
    pub fn bits32(&mut self) -> f32 {
        f32::from_bits(self.bits() as u32)
    }

    /// An `f64` of any bits.
    pub fn bits64(&mut self) -> f64 {
        f64::from_bits(self.bits())
    }

    /// An index less than `limit`, which must not be 0.
    pub fn below(&mut self, limit: usize) -> usize {
        (self.bits() % limit as u64) as usize
    }

    /// An integer from `least` to `greatest`, both included.
    pub fn between(&mut self, least: i32, greatest: i32) -> i32 {
        least + self.below((greatest - least + 1) as usize) as i32
    }

    /// True once in `n` calls, on average.
    pub fn one_in(&mut self, n: usize) -> bool {
        self.below(n) == 0
    }

    /// One of the elements.
    pub fn pick<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.below(of.len())]
    }

    /// A number from 0 to 1, 1 excluded, of 24 bits: exact in `f32`.
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 40) as f64 / 16777216.0
    }

    /// A number from `least` to `greatest`, in steps of a 2^24th of their difference.
    pub fn range(&mut self, least: f64, greatest: f64) -> f64 {
        least + (greatest - least) * self.unit()
    }

    /// A vector whose coordinates are each from `-size` to `size`, in steps of `size / 2^23`.
    pub fn vector(&mut self, size: f64) -> DVec3 {
        DVec3::from_array(core::array::from_fn(|_| self.range(-size, size)))
    }

    /// A number from 0 to 1, 1 excluded, of 53 bits.
    pub fn fine_unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// A number from `least` to `greatest`, in steps of a 2^53rd of their difference.
    pub fn fine_range(&mut self, least: f64, greatest: f64) -> f64 {
        least + (greatest - least) * self.fine_unit()
    }

    /// A vector whose coordinates are each from `-size` to `size`, in steps of `size / 2^52`.
    pub fn fine_vector(&mut self, size: f64) -> DVec3 {
        DVec3::from_array(core::array::from_fn(|_| self.fine_range(-size, size)))
    }

    /// A vector whose coordinates are each from `least` to `greatest`.
    pub fn vec3(&mut self, least: f64, greatest: f64) -> Vec3 {
        DVec3::from_array(core::array::from_fn(|_| self.fine_range(least, greatest))).as_vec3()
    }

    /// A unit vector; all directions are equally likely.
    pub fn direction(&mut self) -> DVec3 {
        loop {
            let v = DVec3::from_array(core::array::from_fn(|_| self.fine_range(-1.0, 1.0)));
            if v.length_squared() <= 1.0 && v.length_squared() > 1e-4 {
                return v.normalize();
            }
        }
    }
}
