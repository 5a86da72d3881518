//! The result of a bake of sandwiches.

use crate::bake_cache::BakeCache;
use crate::cell_sandwich::CellSandwich;
use crate::fingerprints::BakeSource;
use crate::level_error::LevelError;
use crate::method_times::MethodTimes;

/// The result of a bake of sandwiches for a range of viewcells.
#[derive(Clone, PartialEq, Eq, Debug)]
#[non_exhaustive]
pub struct SandwichOutcome {
    /// Level and viewcells that were baked.
    pub source: BakeSource,
    /// Number of the first viewcell of the baker's range, whose result is `cells[0]`.
    pub first: usize,
    /// Result for each viewcell, in order. All objects are open in a viewcell that was not worked on.
    pub cells: Vec<CellSandwich>,
    /// Times of the methods for each viewcell. Zero without a [clock](crate::SandwichBaker::with_clock), and
    /// for a viewcell that was not worked on. Without a limit of time, all other fields are independent of
    /// the times.
    pub times: Vec<MethodTimes>,
    /// Whether the work on all viewcells is complete. False if some viewcells are [too
    /// large](Self::too_large) to be searched.
    pub complete: bool,
    /// Number of viewcells that have completed each stage: sweep of their group, own sweep, rays, proofs of
    /// boxes, proofs of triangles. Viewcells that do not need a stage count too.
    pub stages: [usize; 5],
    /// Number of viewcells whose results after the sweeps were taken from the
    /// [cache](crate::SandwichBaker::with_cache).
    pub reused: usize,
    /// Results of this bake for the next one, without groups that are not complete.
    pub cache: BakeCache,
    /// Number of viewcells that were swept but not searched, because the objects left have more triangles
    /// than a search may copy: 2^21, or the number of triangles of the level, with each shared mesh counted
    /// once, if that is more.
    pub too_large: usize,
    /// Number of viewcells that have completed all stages, but with a sweep or a search that was skipped or
    /// ended early because of the [limit of time](crate::SandwichBaker::with_time).
    pub cut: usize,
    /// First reason why a viewcell of a level in a file could not be worked on. Objects of the viewcell that
    /// were not proven hidden before count as visible. `None` without such an error.
    pub error: Option<LevelError>,
}
