//! Degrees of visibility of a bake: how much of each object shows from each viewcell, by samples.

use clap::Args;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use visibility_bake::{CellSandwich, DegreeSampler};
use visibility_core::Scene;
use visibility_core::pvs::{SampledDegree, Viewcells};

/// Degrees of visibility, as a user asks for them on the command line.
#[derive(Args, Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Degrees {
    /// Also estimate how much of each object shows from each viewcell, by pictures from EYES random points in
    /// it. Nothing is hidden by these estimates unless the game asks for it. Takes time beyond --time: about
    /// a second for a viewcell of a furnished floor with 32 eyes, the number if none is given. By default
    /// nothing is estimated.
    #[arg(long, value_name = "EYES", num_args = 0..=1, require_equals = true, default_missing_value = "32",
        conflicts_with = "memory", value_parser = clap::value_parser!(u32).range(1..=1 << 16))]
    pub degrees: Option<u32>,
}

impl Degrees {
    /// Returns the number of eyes in each viewcell. `None` if degrees are not wanted.
    pub(super) fn eyes(&self) -> Option<u32> {
        self.degrees
    }

    /// Samples the degree of each reported object of each viewcell, on as many threads as the machine has.
    /// The result is the same for any number.
    ///
    /// # Errors
    ///
    /// Returns a message if there is no memory for the pictures.
    pub(super) fn sample(
        &self,
        scene: &Scene,
        viewcells: &Viewcells,
        cells: &[CellSandwich],
        eyes: u32,
    ) -> Result<Vec<Vec<SampledDegree>>, String> {
        let next = AtomicUsize::new(0);
        let worker = || -> Result<Vec<(usize, Vec<SampledDegree>)>, String> {
            let mut sampler = DegreeSampler::new(eyes).map_err(|error| error.to_string())?;
            let mut sampled = Vec::new();
            loop {
                let number = next.fetch_add(1, Ordering::Relaxed);
                let Some((viewcell, cell)) = viewcells.cells().get(number).zip(cells.get(number)) else {
                    return Ok(sampled);
                };
                let is_seen = |index| cell.seen.binary_search(&index).is_ok();
                sampled.push((number, sampler.sample(scene, viewcell, &cell.reported(), is_seen)));
            }
        };
        let workers = thread::available_parallelism().map_or(1, usize::from);
        let parts: Vec<_> = thread::scope(|scope| {
            let running: Vec<_> = (0..workers).map(|_| scope.spawn(worker)).collect();
            running.into_iter().map(|handle| handle.join().expect("a worker panicked")).collect()
        });
        let mut sampled = Vec::new();
        for part in parts {
            sampled.extend(part?);
        }
        sampled.sort_by_key(|&(number, _)| number);
        Ok(sampled.into_iter().map(|(_, degrees)| degrees).collect())
    }
}
