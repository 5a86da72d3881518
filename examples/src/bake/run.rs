//! The run of a bake: on several threads, with a time limit, and with a state file from which it can resume.

use super::failure::Failure;
use crate::ordinary_file;
use crate::output_file::write;
use std::io::{ErrorKind, Write, stderr};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::time::{Duration, Instant};
use visibility_bake::{SandwichBaker, SandwichOutcome};
use visibility_core::bake::{Bake, Progress};

/// Returns the time since the first call of this function.
pub(super) fn clock() -> Duration {
    static FIRST: OnceLock<Instant> = OnceLock::new();
    FIRST.get_or_init(Instant::now).elapsed()
}

/// Where and how long a bake runs.
#[derive(Clone, Debug)]
pub struct Run {
    /// Number of threads; 0 for one per core of the machine.
    pub threads: usize,
    /// Time limit. When it is over, viewcells in progress are given up, and all that is undecided stays open.
    pub limit: Option<Duration>,
    /// Least time between two writes of the state file.
    pub save_every: Duration,
    /// State file with the finished work, from which an interrupted bake resumes.
    pub state: PathBuf,
}

/// Runs a bake, or resumes an interrupted one if its state file exists. The state file stays until [`forget`]
/// removes it.
///
/// # Errors
///
/// [`Failure`] if the state file cannot be read, is damaged or belongs to another bake, or if a level in a
/// file cannot be read or exceeds the memory limit. A state file that exists already is kept. A state file
/// that cannot be written is reported on standard error.
pub fn run<'a>(
    baker: impl Fn() -> SandwichBaker<'a> + Sync,
    run: &Run,
    mut progress: impl FnMut(Progress) + Send,
) -> Result<SandwichOutcome, Failure> {
    let start = Instant::now();
    let baker = || match run.limit {
        Some(limit) => baker().with_time(limit),
        None => baker(),
    };
    let mut bake = match ordinary_file::read(&run.state) {
        Ok(bytes) => Bake::resume(baker(), &bytes)
            .map_err(|error| format!("{}: {error}; remove the file to begin anew", run.state.display()))?,
        Err(error) if error.kind() == ErrorKind::NotFound => Bake::new(baker()),
        Err(error) => return Err(format!("{}: {error}", run.state.display()).into()),
    };
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(run.threads)
        .build()
        .map_err(|error| error.to_string())?;
    // A state that cannot be written, as on a full disk, is no reason to end a bake that may yet succeed.
    let save = |bake: &Bake<_>| {
        if let Err(error) = write(&run.state, &bake.save()) {
            // Unlike `eprintln`, this does not end the program if nobody reads it.
            let _ = writeln!(stderr(), "the bake goes on, but an interruption would lose work: {error}");
        }
    };
    pool.install(|| {
        progress(bake.progress());
        loop {
            let (begun, asked) = (Instant::now(), AtomicUsize::new(0));
            let is_over = || run.limit.is_some_and(|limit| start.elapsed() >= limit);
            // All threads wait for one another before a write. So the pause between writes grows to a tenth
            // of the time so far, and a crash loses at most about that much work.
            let every = run.save_every.max(start.elapsed() / 10);
            let is_due = || begun.elapsed() >= every;
            // The first call lets one item begin however little time is left, so each round makes progress.
            let is_first = || asked.fetch_add(1, Relaxed) == 0;
            loop {
                match bake.advance_unless(|| !is_first() && is_due(), is_over) {
                    Some(now) => progress(now),
                    None => {
                        // The caller has yet to write the result. If that fails, the work is not lost. Work
                        // within a limit of time cannot be repeated with the same results, so it is saved
                        // however little it is.
                        if start.elapsed() >= run.save_every || run.limit.is_some() {
                            save(&bake);
                        }
                        return Ok(bake.finish());
                    }
                }
                if let Some(error) = bake.baker().error() {
                    return Err(error.into());
                }
                if is_over() || is_due() {
                    break;
                }
            }
            save(&bake);
            if is_over() {
                return Ok(bake.finish());
            }
        }
    })
}

/// Removes the state file of a bake whose result is stored.
pub fn forget(state: &Path) {
    // Without a state file there is nothing to remove.
    let _ = std::fs::remove_file(state);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bake::Level;

    #[test]
    fn finished_work_is_saved_and_a_state_that_cannot_be_written_ends_no_bake() {
        let level = Level::of_eight_viewcells();
        let folder = std::env::temp_dir().join(format!("bake-run-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let settings = |save_every, state: &str| Run {
            threads: 1,
            limit: None,
            save_every: Duration::from_millis(save_every),
            state: folder.join(state),
        };
        // The first report takes so long that the bake is worth saving. The rest takes less than the pause
        // between two saves.
        let mut is_first = true;
        let settings_of_saved = settings(500, "state");
        let outcome = run(
            || level.baker(),
            &settings_of_saved,
            |_| {
                if std::mem::take(&mut is_first) {
                    std::thread::sleep(Duration::from_millis(500));
                }
            },
        );
        let cells = outcome.unwrap().cells;
        let state = std::fs::read(&settings_of_saved.state).expect("a state");
        let saved = Bake::resume(level.baker(), &state).unwrap();
        assert_eq!(saved.progress().done, saved.progress().total, "work in the state");
        assert!(saved.finish().cells == cells, "the outcome of the state");
        let not_saved = run(|| level.baker(), &settings(0, "none/state"), |_| {});
        assert!(not_saved.unwrap().cells == cells, "the outcome without a state");
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
