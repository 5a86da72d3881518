//! Progress of long work on standard error: a bar on a terminal, otherwise a line every ten seconds.

use crate::eprintln;
use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;
use std::time::{Duration, Instant};

/// Time between two lines if standard error is not a terminal.
const INTERVAL: Duration = Duration::from_secs(10);

/// Progress of a piece of work that is done in steps.
pub struct Steps {
    what: String,
    /// Progress bar on a terminal; hidden elsewhere.
    bar: ProgressBar,
    /// Time when the last line was printed. `None` on a terminal.
    said: Option<Instant>,
}

impl Steps {
    /// Begins to show the progress of `what`, which has `total` steps. If standard error is not a terminal,
    /// the first line is printed immediately if `at_once`, otherwise after ten seconds.
    pub fn new(what: &str, total: usize, at_once: bool) -> Self {
        if !std::io::stderr().is_terminal() {
            if at_once {
                eprintln!("{what}: {total} steps ...");
            }
            return Self { what: what.to_owned(), bar: ProgressBar::hidden(), said: Some(Instant::now()) };
        }
        let bar = ProgressBar::new(total as u64).with_message(what.to_owned());
        let style = ProgressStyle::with_template("{msg} {bar:40} {pos}/{len} {eta}");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        bar.enable_steady_tick(Duration::from_millis(100));
        Self { what: what.to_owned(), bar, said: None }
    }

    /// Shows that `done` of `total` steps are done.
    pub fn set(&mut self, done: usize, total: usize) {
        self.bar.set_length(total as u64);
        self.bar.set_position(done as u64);
        if self.said.is_some_and(|said| said.elapsed() >= INTERVAL) {
            eprintln!("{}: {done} of {total}", self.what);
            self.said = Some(Instant::now());
        }
    }

    /// Adds one finished step to the bar. Prints no line.
    pub fn step(&self) {
        self.bar.inc(1);
    }
}

impl Drop for Steps {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
