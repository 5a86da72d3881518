//! What trials have been run, kept in a file for each commit, so that the next run goes on.

use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

/// Runs of one test.
#[derive(Clone, Debug, Default)]
pub(super) struct Record {
    /// Number of runs. They had the seeds below it.
    pub(super) seeds: u64,
    pub(super) trials: u64,
    pub(super) seconds: f64,
    /// Seeds with which the test failed.
    pub(super) failed: Vec<u64>,
}

/// Runs of all tests at one commit.
#[derive(Debug)]
pub(super) struct State {
    path: PathBuf,
    /// Records by crate and test.
    records: BTreeMap<String, Record>,
}

impl State {
    /// Reads the state of the present commit and work tree, or begins with an empty one.
    pub(super) fn load(root: &Path) -> Result<Self, String> {
        let describe = ["describe", "--always", "--dirty", "--abbrev=12", "--exclude=*"];
        let output = Command::new("git").arg("-C").arg(root).args(describe).output();
        let output = output.map_err(|error| format!("git describe: {error}"))?.stdout;
        let commit = String::from_utf8_lossy(&output).trim().to_owned();
        let path = root.join(format!("target/torture/trials-{commit}.json"));
        let text = std::fs::read_to_string(&path).unwrap_or_else(|_| "{}".to_owned());
        let value: Value =
            serde_json::from_str(&text).map_err(|error| format!("{}: {error}", path.display()))?;
        let whole = |value: &Value| value.as_u64().unwrap_or(0);
        let record = |value: &Value| Record {
            seeds: whole(&value["seeds"]),
            trials: whole(&value["trials"]),
            seconds: value["seconds"].as_f64().unwrap_or(0.0),
            failed: value["failed"].as_array().into_iter().flatten().map(whole).collect(),
        };
        let all = value.as_object().into_iter().flatten();
        Ok(Self { path, records: all.map(|(name, value)| (name.clone(), record(value))).collect() })
    }

    /// Stores the state.
    pub(super) fn save(&self) -> Result<(), String> {
        let value = |record: &Record| {
            let Record { seeds, trials, seconds, failed } = record;
            json!({ "seeds": seeds, "trials": trials, "seconds": seconds, "failed": failed })
        };
        let all: serde_json::Map<String, Value> =
            self.records.iter().map(|(name, record)| (name.clone(), value(record))).collect();
        // A run that is stopped while it writes leaves the old file.
        let part = self.path.with_extension("part");
        let stored = std::fs::write(&part, Value::from(all).to_string());
        stored
            .and_then(|()| std::fs::rename(&part, &self.path))
            .map_err(|error| format!("{}: {error}", self.path.display()))
    }

    /// Returns the runs of a test.
    pub(super) fn get(&self, name: &str) -> Option<&Record> {
        self.records.get(name)
    }

    /// Adds a run of a test, which judged a number of answers or failed.
    pub(super) fn record(&mut self, name: &str, seed: u64, judged: Option<u64>, time: Duration) {
        let record = self.records.entry(name.to_owned()).or_default();
        record.seeds = record.seeds.max(seed + 1);
        record.seconds += time.as_secs_f64();
        match judged {
            Some(judged) => record.trials += judged,
            None => record.failed.push(seed),
        }
    }

    /// Returns the number of answers that were judged.
    pub(super) fn trials(&self) -> u64 {
        self.records.values().map(|record| record.trials).sum()
    }

    /// Returns the number of tests that failed with a seed.
    pub(super) fn failures(&self) -> usize {
        self.records.values().filter(|record| !record.failed.is_empty()).count()
    }

    /// Prints a table in Markdown: a row for each crate, and one for the sum.
    pub(super) fn print(&self) {
        let mut rows: BTreeMap<&str, (usize, Record)> = BTreeMap::new();
        for (name, record) in self.records.iter().filter(|(_, record)| record.trials > 0) {
            for row in [name.split(' ').next().unwrap_or_default(), "~ all"] {
                let (tests, sum) = rows.entry(row).or_default();
                *tests += 1;
                sum.seeds += record.seeds;
                sum.trials += record.trials;
                sum.seconds += record.seconds;
                sum.failed.extend(&record.failed);
            }
        }
        println!("| crate | tests | runs | trials | core hours | failed |\n|---|---:|---:|---:|---:|---:|");
        for (name, (tests, sum)) in rows {
            let Record { seeds, trials, seconds, failed } = sum;
            let (name, hours) = (name.trim_start_matches("~ "), seconds / 3600.0);
            println!("| {name} | {tests} | {seeds} | {trials} | {hours:.2} | {} |", failed.len());
        }
    }
}
