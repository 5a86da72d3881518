//! The trade of speed for accuracy: every culler with every setting of its dial over a scene, each a
//! [`Point`]: what it costs, what it leaves to be drawn, and what it gets wrong.
//!
//! [`sweep`](mod@sweep) measures the points, [`pareto`] finds those that no other beats, [`output`] prints
//! them, and [`plot`] draws them.

pub mod output;
pub mod pareto;
pub mod plot;
mod point;
pub mod sweep;

pub use pareto::best;
pub use point::Point;
pub use sweep::{Effort, Sweep, sweep};
