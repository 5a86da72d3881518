//! Random numbers for tests, equal on every machine.

/// Returns a generator of random numbers. Each call returns a number in the half-open range between its two
/// arguments.
pub(crate) fn random(seed: u64) -> impl FnMut(f64, f64) -> f64 {
    let mut state = seed;
    move |low, high| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * ((state >> 11) as f64 / (1u64 << 53) as f64)
    }
}
