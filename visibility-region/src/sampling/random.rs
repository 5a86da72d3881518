//! Random directions and small random fractions for sampling.

use visibility_core::glam::DVec3;
use visibility_core::random::Random;

/// Returns a vector of random direction, of a length up to 1.
pub(super) fn direction(random: &mut Random) -> DVec3 {
    for _ in 0..32 {
        let v = random.point() * 2.0 - 1.0;
        if (1e-4..=1.0).contains(&v.length_squared()) {
            return v;
        }
    }
    DVec3::X
}

/// Returns a random fraction between 2^-27 and 1/2. Each of the 26 ranges from one power of 2 to the next is
/// equally likely, so that small fractions are frequent.
pub(super) fn small(random: &mut Random) -> f64 {
    (0.5 + 0.5 * random.unit()) / (1u64 << (1 + random.below(26))) as f64
}
