//! The result of a bake of sandwiches.

use crate::bake_cache::BakeCache;
use crate::cell_sandwich::CellSandwich;
use crate::level_error::LevelError;
use crate::method_times::MethodTimes;

/// The result of a bake.
#[derive(Clone, PartialEq, Eq, Debug)]
#[non_exhaustive]
pub struct SandwichOutcome {
    /// Number of the first viewcell of the baker's range, whose result is `cells[0]`.
    pub first: usize,
    /// Result for each viewcell, in order. In a viewcell that was not worked on, all objects are open.
    pub cells: Vec<CellSandwich>,
    /// Time that each method took, by viewcell. 0 without a [clock](crate::SandwichBaker::with_clock), and in
    /// a viewcell that was not worked on. Without a limit of time, all other parts of the outcome are the
    /// same whatever the times.
    pub times: Vec<MethodTimes>,
    /// Whether all viewcells were worked on to the end: never if some are [too large](Self::too_large).
    pub complete: bool,
    /// Number of viewcells that were through with each stage: swept in groups, swept by themselves, looked
    /// from along rays, searched by proofs of boxes, and by proofs of triangles. A viewcell that does not
    /// need a stage any more counts, too.
    pub stages: [usize; 5],
    /// Number of viewcells whose results, apart from the sweeps, were taken from the
    /// [cache](crate::SandwichBaker::with_cache).
    pub reused: usize,
    /// Results of this bake for the next one. Groups that are not complete are left out.
    pub cache: BakeCache,
    /// Number of viewcells that were swept and not searched, since the objects that the sweeps have left have
    /// more triangles than a search may copy: 2^21, or as many as the level has with each shared mesh counted
    /// once.
    pub too_large: usize,
    /// Number of viewcells with a sweep or a search that the [limit of time](crate::SandwichBaker::with_time)
    /// left out or cut short, of those that are through with all stages.
    pub cut: usize,
    /// First reason why a viewcell could not be worked on, for a level in a file: its objects not proven
    /// hidden before count as visible. `None` if there was no such error.
    pub error: Option<LevelError>,
}
