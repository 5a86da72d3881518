//! Trials that `xtask torture` repeats with other random numbers.

use std::sync::OnceLock;

/// Says how many trials a test has made: objects, rays, queries or files whose answers an oracle judged. Call
/// it at the end of a test that draws its input by [`Random`](crate::Random), and that would also pass with
/// other random numbers. The program `xtask torture` runs such a test again with each seed, and adds up what
/// it says.
pub fn judged(trials: u64) {
    println!("judged: {trials}");
}

/// Returns what is added to the seed of each [`Random`](crate::Random): 0, or a number that depends on the
/// variable `TRIAL_SEED` of the environment.
pub(crate) fn shift() -> u64 {
    static SHIFT: OnceLock<u64> = OnceLock::new();
    *SHIFT.get_or_init(|| {
        let seed: u64 = std::env::var("TRIAL_SEED").ok().and_then(|text| text.parse().ok()).unwrap_or(0);
        // Seed 0 shifts nothing. The factor is odd, so that no two seeds shift alike.
        seed.wrapping_mul(0xd134_2543_de82_ef95)
    })
}
