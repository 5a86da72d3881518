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
use visibility_bake::{BakeSource, CellSandwich, MethodTimes, Shard, ViewcellBudget, ViewcellFit};
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
    /// The level, as it was baked, and its fitted viewcells.
    pub source: BakeSource,
    /// Times of the methods, for all viewcells that were baked in this run, divided ones included.
    pub times: MethodTimes,
    /// Whether all that can be done was done for all viewcells of all depths. Viewcells that are
    /// [too large](Self::too_large) do not count against this.
    pub complete: bool,
    /// Number of viewcells of all depths, divided ones included, without a search, since too many triangles
    /// of instances would be copied.
    pub too_large: usize,
    /// Number of viewcells in which the time limit cut a stage short.
    pub cut: usize,
}

/// Bakes the viewcells of a level, divides those over budget and bakes their halves, and so on, and at last
/// merges neighbours. Replaces the viewcells of the level by those that result. With a limit of time, each
/// depth has all of the time left, so that viewcells are only divided if the depth before was finished.
/// `progress` is called with the number of viewcells of the present depth. Files are named after `base`, the
/// output, and the state file of `settings` is not used. The files stay until [`forget_depths`] removes them.
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
    let (mut times, mut complete, mut too_large, mut cut) = (MethodTimes::default(), true, 0, 0);
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
                let [groups, swept, .., done] = outcome.stages;
                // A viewcell that is too large to be searched counts as finished. Its halves may be small
                // enough.
                let is_finished = done + outcome.too_large == count;
                // The same depth without a limit of time has the same results.
                let is_whole = is_finished && outcome.cut == 0 && (groups, swept) == (count, count);
                times = [times, outcome.times.iter().sum()].iter().sum();
                too_large += outcome.too_large;
                cut += outcome.cut;
                complete &= is_finished;
                if is_whole {
                    let shard = Shard::new(level.fingerprint(), outcome);
                    write(&file, &shard.to_bytes())?;
                    forget(&state);
                    shard.cells
                } else {
                    // A shard does not tell which viewcells the time has cut short. The state does.
                    if !is_finished {
                        // The time is over. Halves of viewcells without a result would have none either.
                        fit.end_division();
                    }
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
    Ok(Fitted { cells, source: level.baker().source(), times, complete, too_large, cut })
}

/// Removes the files of all depths of a bake whose result is stored: results and states.
pub fn forget_depths(base: &Path) {
    for depth in 0.. {
        let file = depth_file(base, depth);
        let removed = [beside(&file, ".state"), file].map(|file| std::fs::remove_file(file).is_ok());
        // The first depth without either file ends this.
        if removed == [false; 2] {
            break;
        }
    }
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
    use glam::DVec3;
    use std::time::Duration;

    /// Returns a new folder for a test, and settings without a limit of time.
    fn folder(name: &str) -> (PathBuf, Run) {
        let folder = std::env::temp_dir().join(format!("bake-fit-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let save_every = Duration::from_secs(60);
        (folder.clone(), Run { threads: 1, limit: None, save_every, state: folder.join("unused") })
    }

    /// Returns the names of the files in a folder, sorted.
    fn names(folder: &Path) -> Vec<String> {
        let names = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name());
        let mut names: Vec<String> = names.map(|name| name.into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn viewcells_that_are_too_large_to_be_searched_are_divided() {
        let (folder, settings) = folder("large");
        let base = folder.join("set");
        let mut level = Level::of_copies();
        let budget = ViewcellBudget::new(0, DVec3::new(0.5, 0.0, 0.0));
        let fitted = fit(&mut level, budget, &settings, &base, |_, _| {}).unwrap();
        assert!(fitted.too_large > 0, "the whole viewcell is too large");
        assert!(fitted.complete, "nothing more can be done");
        let reported: Vec<usize> = fitted.cells.iter().map(|found| found.reported().len()).collect();
        // Sweeps find objects beyond the wall hidden from viewcells that do not reach through it.
        let least = reported.iter().min();
        assert!(least.is_some_and(|&least| least < 500), "objects that the viewcells report: {reported:?}");
        assert_eq!(names(&folder), ["set.depth0", "set.depth1", "set.depth2"], "files of finished depths");
        forget_depths(&base);
        assert!(names(&folder).is_empty(), "no file is left");
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn results_that_the_time_has_cut_short_are_no_finished_depth() {
        let (folder, settings) = folder("cut");
        let base = folder.join("set");
        let budget = ViewcellBudget::new(u64::MAX, DVec3::ZERO);
        // The first pause takes the time of the sweeps. On a busy machine, the rest of a short limit may be
        // too little for the searches.
        let cut = [1, 4, 16, 64].into_iter().map(Duration::from_secs).find_map(|limit| {
            let mut pause = Some(limit.mul_f64(0.9));
            let settings = Run { limit: Some(limit), ..settings.clone() };
            let fitted = fit(&mut Level::of_eight_viewcells(), budget, &settings, &base, |_, _| {
                pause.take().into_iter().for_each(std::thread::sleep);
            });
            let Fitted { complete, cut, .. } = fitted.unwrap();
            let is_cut = complete && cut > 0;
            if !is_cut {
                forget_depths(&base);
            }
            is_cut.then_some(cut)
        });
        let cut = cut.expect("a bake that the time cuts short, and that is complete");
        assert_eq!(names(&folder), ["set.depth0.state"], "files of a depth that is cut short");
        let again = fit(&mut Level::of_eight_viewcells(), budget, &settings, &base, |_, _| {}).unwrap();
        assert_eq!((again.complete, again.cut), (true, cut), "a run without a limit tells what is cut short");
        forget_depths(&base);
        assert!(names(&folder).is_empty(), "no file is left");
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn files_and_states_of_all_depths_are_forgotten() {
        let (folder, _) = folder("forget");
        for name in ["set.depth0.state", "set.depth1", "set.depth2", "set.depth2.state", "other.depth0"] {
            std::fs::write(folder.join(name), []).unwrap();
        }
        forget_depths(&folder.join("set"));
        assert_eq!(names(&folder), ["other.depth0"], "files that are left");
        std::fs::remove_dir_all(&folder).unwrap();
    }

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
