//! Trials that `xtask torture` repeats with other random numbers.

use std::fmt::Display;
use std::sync::OnceLock;

/// Says how many trials a test has made: objects, rays, queries or files whose answers an oracle judged. Call
/// it at the end of a test that draws its input by [`Random`](crate::Random), and that would also pass with
/// other random numbers. The program `xtask torture` runs such a test again with each seed, and adds up what
/// it says.
pub fn judged(trials: u64) {
    println!("judged: {trials}");
}

/// Asserts that a test was not too easy: that it has judged enough answers, of each kind, or that it decides
/// enough of them. The limits of such assertions are known for the random numbers of seed 0 alone. So nothing
/// is asserted where the variable `TRIAL_SEED` of the environment is another number than 0.
#[track_caller]
pub fn told_enough(condition: bool, message: impl Display) {
    assert!(condition || shift() != 0, "{message}");
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

#[cfg(test)]
mod tests {
    use super::{shift, told_enough};

    #[test]
    fn limits_hold_for_seed_0_alone() {
        told_enough(true, "enough");
        let failed = std::panic::catch_unwind(|| told_enough(false, "too little")).is_err();
        assert_eq!(failed, shift() == 0, "too little fails where no seed is set");
    }
}
