//! Pseudorandom numbers, the same in each run: SplitMix64 (Steele, Lea and Flood, "Fast Splittable
//! Pseudorandom Number Generators", 2014).

use visibility_core::glam::DVec3;

#[derive(Clone, Debug)]
pub(super) struct Random(pub(super) u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    /// Returns a number from 0 (inclusive) to 1 (exclusive).
    pub(super) fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Returns an index below `limit`, or 0 if `limit` is 0.
    pub(super) fn below(&mut self, limit: usize) -> usize {
        (self.bits() % (limit as u64).max(1)) as usize
    }

    /// Returns a vector of random direction, of a length up to 1.
    pub(super) fn direction(&mut self) -> DVec3 {
        for _ in 0..32 {
            let v = DVec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0;
            if (1e-4..=1.0).contains(&v.length_squared()) {
                return v;
            }
        }
        DVec3::X
    }

    /// Returns a fraction between 2^-27 and 1/2. Each of 26 octaves is equally likely.
    pub(super) fn small(&mut self) -> f64 {
        (0.5 + 0.5 * self.unit()) / (1u64 << (1 + self.below(26))) as f64
    }
}
