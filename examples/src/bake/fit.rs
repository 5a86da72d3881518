//! A bake whose viewcells are divided and merged until they fit a budget: one bake for each depth of the
//! division. The results of finished depths lie in files beside the output, from which an interrupted bake
//! resumes.

use super::failure::Failure;
use super::level::Level;
use super::run::{Run, forget, run};
use crate::output_file::{beside, write};
use crate::region::cells::on_axes;
use crate::{eprintln, ordinary_file};
use clap::Args;
use glam::Vec3;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::Instant;
use visibility_bake::{CellSandwich, MethodTimes, Shard, ViewcellBudget, ViewcellFit};
use visibility_core::bake::Progress;
use visibility_core::pvs::Viewcells;

/// Budget of the viewcells, as a user states it on the command line.
#[derive(Args, Clone, Debug)]
pub struct Budget {
    /// Greatest number of triangles that a viewcell may report, as in 200k-triangles. Viewcells over it are
    /// halved, down to --least, and neighbours with equal sets are merged. By default viewcells stay as they
    /// are.
    #[arg(long, value_name = "TRIANGLES", value_parser = triangles)]
    pub budget: Option<u64>,

    /// Least size in metres of a viewcell that --budget divides, in the order of --size. By default a quarter
    /// of --size on the ground, and all of its height.
    #[arg(long, value_name = "WIDTH,DEPTH,HEIGHT", value_parser = crate::region::cells::parse_size,
        requires = "budget")]
    pub least: Option<[f64; 3]>,

    /// Share of the triangles by which the sets of neighbours may differ that --budget merges, as in 5%.
    #[arg(long, value_name = "SHARE", value_parser = crate::arguments::parse_share, default_value = "0",
        requires = "budget")]
    pub agree: f64,
}

/// Reads a number of triangles, such as 200k-triangles, 1.5M or 20000.
fn triangles(text: &str) -> Result<u64, String> {
    let number = text.strip_suffix("-triangles").unwrap_or(text);
    let (number, unit) = match number.strip_suffix(['k', 'M']) {
        Some(start) => (start, if number.ends_with('k') { 1e3 } else { 1e6 }),
        None => (number, 1.0),
    };
    let count = number.parse().map_or(f64::NAN, |count: f64| count * unit);
    // Beyond 2^53 not all numbers can be told apart.
    let is_usable = (0.0..=9e15).contains(&count);
    is_usable
        .then_some(count as u64)
        .ok_or_else(|| "a budget is a number of triangles, as in 200k-triangles".into())
}

impl Budget {
    /// Returns the budget for viewcells of a size in the order of `--size`, in a scene whose up axis is `up`.
    /// `None` if the user has set no budget.
    pub fn of(&self, size: [f64; 3], up: Vec3) -> Option<ViewcellBudget> {
        let [width, depth, height] = size;
        let least = on_axes(self.least.unwrap_or([width / 4.0, depth / 4.0, height]), up);
        self.budget.map(|cost| ViewcellBudget::new(cost, least).with_agreement(self.agree))
    }
}

/// Result of a bake with a budget. The viewcells are in the level.
pub struct Fitted {
    /// Result of each viewcell.
    pub cells: Vec<CellSandwich>,
    /// Times of the methods, for all viewcells that were baked in this run, divided ones included.
    pub times: MethodTimes,
    /// Whether all viewcells of all depths were finished.
    pub complete: bool,
    /// Number of viewcells without a search, since too many triangles of instances would be copied.
    pub too_large: usize,
    /// Number of viewcells in which the time limit cut a stage short.
    pub cut: usize,
}

/// Bakes the viewcells of a level, divides those over budget and bakes their halves, and so on, and at last
/// merges neighbours. Replaces the viewcells of the level by those that result. With a limit of time, each
/// depth has all of the time left, so that viewcells are only divided if the depth before was finished.
/// `progress` is called with the number of
/// viewcells of the present depth. Files are named after `base`, the output, and the state file of `settings`
/// is not used.
///
/// # Errors
///
/// The [`Failure`]s of [`run`](super::run), also for a file of a finished depth.
pub fn fit(
    level: &mut Level,
    budget: ViewcellBudget,
    settings: &Run,
    base: &Path,
    mut progress: impl FnMut(usize, Progress) + Send,
) -> Result<Fitted, Failure> {
    let start = Instant::now();
    let mut fit = ViewcellFit::new(budget, level.viewcells.cells().iter().cloned());
    let mut all =
        Fitted { cells: Vec::new(), times: MethodTimes::default(), complete: true, too_large: 0, cut: 0 };
    for depth in 0.. {
        level.viewcells = Viewcells::new(fit.waiting());
        let count = level.viewcells.cells().len();
        let file = depth_file(base, depth);
        let state = beside(&file, ".state");
        let cells = match finished(&file, level)? {
            Some(cells) => {
                // A run that ended between two files has left the state as well.
                forget(&state);
                cells
            }
            None => {
                let left = settings.limit.map(|limit| limit.saturating_sub(start.elapsed()));
                let settings = Run { limit: left, state: state.clone(), ..*settings };
                let outcome = run(|| level.baker(), &settings, |now| progress(count, now))?;
                all.times = [all.times, outcome.times.iter().sum()].iter().sum();
                all.too_large += outcome.too_large;
                all.cut += outcome.cut;
                all.complete &= outcome.complete;
                if outcome.complete {
                    let shard = Shard::new(level.fingerprint(), outcome);
                    write(&file, &shard.to_bytes())?;
                    forget(&state);
                    shard.cells
                } else {
                    // The time is over. Halves of viewcells without a result would have none either.
                    fit.end_division();
                    outcome.cells
                }
            }
        };
        let division = fit.take_in(cells, |index| cost(level, index));
        eprintln!(
            "depth {depth}: {} viewcells, {} over budget, {} divided",
            division.evaluated, division.over_budget, division.divided
        );
        if fit.is_done() {
            break;
        }
    }
    let (viewcells, cells) = fit.finish(|index| cost(level, index));
    level.viewcells = Viewcells::new(viewcells);
    Ok(Fitted { cells, ..all })
}

/// Removes the files of all depths of a bake whose result is stored.
pub fn forget_depths(base: &Path) {
    let mut files = (0..).map(|depth| depth_file(base, depth));
    // The first depth without a file ends this.
    while files.next().is_some_and(|file| std::fs::remove_file(file).is_ok()) {}
}

/// Returns the path of the file with the results of a finished depth of a bake that writes `base`. The state
/// of a depth that is not finished lies beside it.
fn depth_file(base: &Path, depth: u32) -> PathBuf {
    beside(base, &format!(".depth{depth}"))
}

/// Returns the number of triangles of the object at an index, 0 if there is none.
fn cost(level: &Level, index: u32) -> u64 {
    level.cost(index).map_or(0, u64::from)
}

/// Reads the results of a depth that an earlier run has finished. `None` if there is no such file.
fn finished(file: &Path, level: &Level) -> Result<Option<Vec<CellSandwich>>, String> {
    let named = |error: String| format!("{}: {error}; remove the file to begin anew", file.display());
    let bytes = match ordinary_file::read(file) {
        Ok(bytes) => bytes,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(format!("{}: {error}", file.display())),
    };
    let shard = Shard::from_bytes(&bytes).map_err(|error| named(error.to_string()))?;
    let is_of_level = shard.fingerprint == level.fingerprint()
        && (shard.first, shard.cells.len()) == (0, level.viewcells.cells().len());
    if is_of_level {
        Ok(Some(shard.cells))
    } else {
        Err(named("it is of another scene, other viewcells or other settings".to_owned()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn budgets_are_numbers_of_triangles() {
        for (text, count) in
            [("200k-triangles", Some(200_000)), ("1.5M", Some(1_500_000)), ("70", Some(70)), ("0", Some(0))]
        {
            assert_eq!(triangles(text).ok(), count, "{text}");
        }
        for text in ["", "k", "-1", "NaN", "inf", "1e300", "20-objects", "5G"] {
            assert!(triangles(text).is_err(), "{text}");
        }
    }
}
