//! Library of the benchmarks of the visibility crates: the [workload], and the [contenders] that cull it.
//!
//! - `cargo bench -p visibility-benches` runs criterion on frustum culling, moving objects and construction.
//! - `cargo run --release -p visibility-benches --bin report` measures all contenders in turns in one run. It
//!   prints the first tables of `RESULTS.md`. Times drift on a shared machine, ratios within a run much less.
//!
//! Before a contender is timed, its answer is compared with the planes of the view in f64 ([`check`]): a time
//! means little if boxes are lost.

pub mod check;
pub mod contenders;
pub mod moving;
pub mod workload;
