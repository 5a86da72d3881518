//! A test that judges answers, and a run of it.

use crate::test_programs::TestProgram;
use std::process::{Command, Stdio};

/// A test that judges answers.
#[derive(Clone, Debug)]
pub(super) struct Trial {
    pub(super) program: TestProgram,
    /// Name of the test within its program.
    pub(super) test: String,
}

impl Trial {
    /// Returns the name of the test after that of its crate.
    pub(super) fn name(&self) -> String {
        format!("{} {}", self.program.package, self.test)
    }
}

/// Runs a test with a seed and variables of the environment. Returns what it has judged, or `None` if it
/// fails.
pub(super) fn run(trial: &Trial, seed: u64, variables: &[(&str, String)]) -> Option<u64> {
    let output = Command::new(&trial.program.path)
        .args(["--exact", &trial.test, "--nocapture", "--test-threads=1"])
        .env("TRIAL_SEED", seed.to_string())
        .envs(variables.iter().map(|(name, value)| (name, value)))
        .current_dir(&trial.program.folder)
        .stderr(Stdio::null())
        .output()
        .ok()?;
    let text = String::from_utf8_lossy(&output.stdout);
    let counts = text.lines().filter_map(|line| line.split_once("judged: ")?.1.trim().parse::<u64>().ok());
    output.status.success().then(|| counts.sum())
}
