//! Forecast of a bake with a time limit, printed before the bake begins.

use super::level::Level;
use std::time::{Duration, Instant};
use visibility_bake::SWEEP_TIME;
use visibility_core::bake::Bake;

/// Share of the time limit for a trial sweep of the first viewcell. The trial's result is not kept.
const TRIAL: f64 = 0.1;

/// Forecast of a bake.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Plan {
    /// Number of viewcells.
    pub viewcells: usize,
    /// Seconds that the sweep of the first viewcell alone took on one thread. `None` if it did not finish
    /// within a tenth of the limit.
    pub first: Option<f64>,
    /// Seconds that the bake may take.
    pub limit: f64,
    /// Number of threads, at least 1.
    pub threads: usize,
}

impl Plan {
    /// Sweeps the first viewcell of a level to measure the time, for at most a tenth of the limit.
    pub fn measure(level: &Level, limit: Duration, threads: usize) -> Self {
        let trial = level.baker().with_range(0..1).with_time(limit.mul_f64(TRIAL));
        let mut bake = Bake::new(trial);
        // The sweep of a group of viewcells, and what is prepared once for all viewcells.
        bake.advance();
        let start = Instant::now();
        bake.advance();
        let first = start.elapsed().as_secs_f64();
        let is_swept = bake.finish().stages[1] > 0;
        Self {
            viewcells: level.viewcells.cells().len(),
            first: is_swept.then_some(first),
            limit: limit.as_secs_f64(),
            threads,
        }
    }

    /// Returns the forecast as one line of text for the terminal.
    pub fn text(&self) -> String {
        let Self { viewcells, first, limit, threads } = *self;
        let Some(first) = first.filter(|_| limit > 0.0) else {
            let trial = limit * TRIAL;
            return format!(
                "{viewcells} viewcells, and not even the first was swept in {trial:.1} s, a tenth of the time: \
                 for most only what is hidden from their groups will be known, if that"
            );
        };
        let needed = first * viewcells as f64 / threads as f64;
        let begin = format!("{viewcells} viewcells, the first swept in {first:.2} s: ");
        let time = limit * SWEEP_TIME;
        if needed <= time {
            let left = limit - needed;
            return format!(
                "{begin}all are in some {needed:.0} s, and {left:.0} s are left for rays and proofs"
            );
        }
        let reached = (time / needed * viewcells as f64) as usize;
        let whole = needed / SWEEP_TIME;
        format!(
            "{begin}some {reached} are in {limit:.0} s, and all in some {whole:.0} s; for the others only what is \
             hidden from their groups is known; larger viewcells (--size) are fewer, and less is hidden from \
             each"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plan_says_what_is_reached() {
        let plan = Plan { viewcells: 4000, first: Some(0.25), limit: 60.0, threads: 2 };
        let needs = "4000 viewcells, the first swept in 0.25 s: some 408 are in 60 s, and all in some 588 s; \
                     for the others only what is hidden from their groups is known; larger viewcells (--size) \
                     are fewer, and less is hidden from each";
        assert_eq!(plan.text(), needs, "a plan that does not reach all");
        let all = "100 viewcells, the first swept in 0.25 s: all are in some 12 s, and 48 s are left for rays \
                   and proofs";
        assert_eq!(Plan { viewcells: 100, ..plan }.text(), all, "a plan that reaches all");
        let none = "4000 viewcells, and not even the first was swept in 6.0 s, a tenth of the time: for most only \
                    what is hidden from their groups will be known, if that";
        assert_eq!(
            Plan { first: None, ..plan }.text(),
            none,
            "a plan in which the first viewcell takes too long"
        );
        assert!(
            Plan { limit: 0.0, ..plan }.text().contains("not even the first was swept in 0.0 s"),
            "a plan without time"
        );
    }
}
