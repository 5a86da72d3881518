//! Comparison of speed and accuracy. Each culler at each of its settings on a scene is a [`Point`]: its time,
//! the triangles that it leaves to draw, and its errors.
//!
//! [`sweep`](mod@sweep) measures the points, [`pareto`] finds the points that no other point dominates,
//! [`output`] prints points, and [`plot`] draws them.

pub mod output;
pub mod pareto;
pub mod plot;
mod point;
pub mod sweep;

pub use pareto::best;
pub use point::Point;
pub use sweep::{Effort, Sweep, sweep};
