//! Pseudorandom numbers for sampling, identical in each run and on every target.

/// Pseudorandom number generator: SplitMix64 (Steele, Lea and Flood, "Fast Splittable Pseudorandom Number
/// Generators", 2014). The field is the seed; any seed is good.
///
/// ```
/// let mut random = visibility_core::random::Random(1);
/// assert_eq!(random.clone().bits(), random.bits());
/// assert!(random.below(6) < 6 && random.unit() < 1.0);
/// ```
#[derive(Clone, Debug)]
pub struct Random(pub u64);

impl Random {
    /// Returns 64 random bits.
    #[inline]
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    /// Returns a number from 0 (inclusive) to 1 (exclusive), a multiple of 2^-53.
    #[inline]
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Returns an index from 0 (inclusive) to `limit` (exclusive), or 0 if `limit` is 0.
    #[inline]
    pub fn below(&mut self, limit: usize) -> usize {
        (self.bits() % (limit as u64).max(1)) as usize
    }

    /// Returns a point of the unit cube, from 0 to 1 on each axis.
    #[inline]
    pub fn point(&mut self) -> glam::DVec3 {
        glam::DVec3::new(self.unit(), self.unit(), self.unit())
    }
}
