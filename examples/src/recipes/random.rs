//! Random numbers of the recipes: a 64-bit linear congruential generator, so that a recipe makes an identical
//! scene on every machine.
//!
//! The upper 31 bits of the state give a number in [0, 1). The order of the draws is part of a recipe: moving
//! a call changes the scene.

/// Random number generator. Two generators with equal seeds draw equal numbers.
#[derive(Debug, Clone)]
pub(crate) struct Random {
    state: u64,
}

impl Random {
    const MULTIPLIER: u64 = 6_364_136_223_846_793_005;
    const INCREMENT: u64 = 1_442_695_040_888_963_407;
    /// Number of draws that `new` discards, because the first draws of neighbouring seeds resemble each
    /// other.
    const DISCARDED: usize = 4;

    /// Creates a generator. The seeds 0 to 2^63 - 1 give different sequences.
    pub(crate) fn new(seed: u64) -> Self {
        let mut random = Self { state: seed.wrapping_mul(2).wrapping_add(1) };
        for _ in 0..Self::DISCARDED {
            random.unit();
        }
        random
    }

    /// Draws a number in [0, 1), a multiple of 2^-31 with equal chance for each.
    pub(crate) fn unit(&mut self) -> f64 {
        self.state = self.state.wrapping_mul(Self::MULTIPLIER).wrapping_add(Self::INCREMENT);
        (self.state >> 33) as f64 / f64::from(1_u32 << 31)
    }

    /// Draws a number in [low, high), up to rounding. Returns `low` when both are equal.
    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Draws an index in the half-open range `0..count`. Returns 0 when `count` is 0.
    pub(crate) fn below(&mut self, count: usize) -> usize {
        (self.unit() * count as f64) as usize
    }

    /// Draws an angle in [0, 2 pi), in radians.
    pub(crate) fn angle(&mut self) -> f64 {
        self.unit() * 2.0 * std::f64::consts::PI
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sequence_is_pinned() {
        let mut random = Random::new(1);
        let mut state = 3_u64;
        for _ in 0..5 {
            state = (u128::from(state) * 6_364_136_223_846_793_005 + 1_442_695_040_888_963_407) as u64;
        }
        assert_eq!(random.unit(), (state >> 33) as f64 / 2_147_483_648.0, "the first number of the sequence");
        for _ in 0..1000 {
            assert!((0.0..1.0).contains(&random.unit()), "a number from 0 to 1");
            assert!(random.below(7) < 7, "a whole number below 7");
        }
    }
}
