//! Budgets of time, by the speed at which earlier frames were drawn.

use crate::walk::Budget;

/// Share of the difference between the measured and the estimated speed by which one frame changes the
/// estimate.
const STEP: f64 = 0.25;

/// Largest factor between the measured and the estimated speed that one frame is believed. Larger factors
/// come from frames that waited for something else, or in which almost nothing was drawn.
const MAX_FACTOR: f64 = 4.0;

/// Turns a budget of time into a [`Budget`] of cost, by the speed at which the frames before were drawn. The
/// library reads no clock: the engine measures how long its frames take, on the processor or on the graphics
/// card.
///
/// The cost of a frame may be triangles, or any other sum that grows with the time to draw, as long as
/// [`record`](Self::record) and the culler count the same. A constant time in every frame, besides that for
/// the cost, is part of the measured speed: budgets converge if it is less than the budget of time.
///
/// Klosowski and Silva, "The Prioritized-Layered Projection Algorithm for Visible Set Estimation", 2000,
/// section 6, name budgets that adjust themselves as future work.
///
/// ```
/// use visibility_plp::{Budget, Pace};
/// // 50 triangles a microsecond, until frames are measured.
/// let mut pace = Pace::new(50.0);
/// assert_eq!(pace.budget(4000.0), Budget::Cost(200_000));
/// // Each frame: `plp.set_budget(pace.budget(4000.0))`, cull, draw, and once the time is known:
/// pace.record(200_000, 8000.0); // plp.spent(), microseconds
/// assert_eq!(pace.budget(4000.0), Budget::Cost(175_000));
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Pace {
    /// Estimated speed, in units of cost per microsecond; greater than 0 and finite.
    cost_per_microsecond: f64,
}

impl Pace {
    /// Starts with an estimate of the speed, in units of cost per microsecond. An estimate that is not
    /// positive or not finite counts as 1.
    pub fn new(cost_per_microsecond: f64) -> Self {
        let is_speed = cost_per_microsecond.is_normal() && cost_per_microsecond.is_sign_positive();
        Self { cost_per_microsecond: if is_speed { cost_per_microsecond } else { 1.0 } }
    }

    /// Returns the budget for a frame that may take `microseconds` to draw, rounded down, and at least 1. 0
    /// if `microseconds` is 0, negative or NaN.
    ///
    /// A budget of 1 still admits one object (see [`Budget::Cost`]). So a frame with an object in view has a
    /// cost to measure, however low the estimate of the speed has become.
    pub fn budget(&self, microseconds: f64) -> Budget {
        let cost = (microseconds * self.cost_per_microsecond) as u64;
        Budget::Cost(if microseconds > 0.0 { cost.max(1) } else { 0 })
    }

    /// Takes in a measured frame: the cost that was drawn, such as
    /// [`PlpCuller::spent`](crate::PlpCuller::spent), and the time that this took. A quarter of the
    /// difference to the speed so far changes the speed; a speed more than four times lower or higher counts
    /// as four times. A frame without cost, such as one of the sky, or without time says nothing, as does a
    /// time that is negative or not finite.
    pub fn record(&mut self, cost: u64, microseconds: f64) {
        if cost == 0 || !(microseconds > 0.0 && microseconds.is_finite()) {
            return;
        }
        let speed = self.cost_per_microsecond;
        let measured = (cost as f64 / microseconds).clamp(speed / MAX_FACTOR, speed * MAX_FACTOR);
        *self = Self::new(speed + (measured - speed) * STEP);
    }

    /// Returns the estimated speed, in units of cost per microsecond.
    pub fn cost_per_microsecond(&self) -> f64 {
        self.cost_per_microsecond
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Time in microseconds that a machine takes to draw a frame: `fixed`, and `cost` at `speed`.
    fn draw(cost: u64, fixed: f64, speed: f64) -> f64 {
        fixed + cost as f64 / speed
    }

    fn cost(budget: Budget) -> u64 {
        match budget {
            Budget::Cost(cost) => cost,
            Budget::Objects(_) => panic!("a pace gives budgets of cost"),
        }
    }

    #[test]
    fn budgets_converge_to_the_time_on_fast_and_slow_machines() {
        for (start, fixed, speed) in [(50.0, 0.0, 3.0), (1.0, 300.0, 200.0), (0.0, 900.0, 7.0)] {
            let mut pace = Pace::new(start);
            for _ in 0..80 {
                let drawn = cost(pace.budget(1000.0));
                pace.record(drawn, draw(drawn, fixed, speed));
            }
            let took = draw(cost(pace.budget(1000.0)), fixed, speed);
            assert!((took - 1000.0).abs() < 5.0, "from {start}, {fixed} us and {speed} a us: {took} us");
        }
    }

    #[test]
    fn one_odd_frame_changes_little_and_nonsense_nothing() {
        let mut pace = Pace::new(10.0);
        pace.record(10_000, 1e9);
        assert_eq!(pace.cost_per_microsecond(), 10.0 + (2.5 - 10.0) * 0.25, "after a frame that waited");
        let mut pace = Pace::new(10.0);
        pace.record(u64::MAX, 1e-9);
        assert_eq!(pace.cost_per_microsecond(), 10.0 + (40.0 - 10.0) * 0.25, "after a frame too fast");
        let before = pace;
        for (cost, time) in [(0, 5.0), (5, 0.0), (5, -1.0), (5, f64::NAN), (5, f64::INFINITY)] {
            pace.record(cost, time);
            assert_eq!(pace, before, "a cost of {cost} in {time} us");
        }
        for speed in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(Pace::new(speed), Pace::new(1.0), "a speed of {speed}");
        }
        for time in [-1.0, 0.0, f64::NAN] {
            assert_eq!(pace.budget(time), Budget::Cost(0), "a time of {time}");
        }
    }
}
