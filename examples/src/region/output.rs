//! Output of trials, as a table for people and as lines of JSON for programs.

use super::judge::LeftOut;
use super::trial::Trial;
use crate::walkthrough::World;
use comfy_table::{CellAlignment, Table, presets};
use serde::Serialize;
use std::io::{self, Write};
use visibility_core::pvs::Viewcell;

/// Trials of all methods on one viewcell, and the objects that samples see.
pub struct Judged {
    /// The viewcell.
    pub cell: Viewcell,
    /// For each object, by its index in the source, whether a line of sight from samples or from a method
    /// reaches it.
    pub sampled: Vec<bool>,
    /// Trials, one for each method.
    pub trials: Vec<Trial>,
}

impl Judged {
    /// Returns the number of objects that samples see.
    pub fn sampled_count(&self) -> usize {
        self.sampled.iter().filter(|&&seen| seen).count()
    }

    /// Returns the objects that samples see and a trial does not report, ascending.
    pub fn sampled_and_left_out(&self, trial: &Trial) -> Vec<u32> {
        let is_lost =
            |&index: &u32| self.sampled[index as usize] && trial.reported.binary_search(&index).is_err();
        (0..self.sampled.len() as u32).filter(is_lost).collect()
    }
}

/// Formats results as a table with a row for each viewcell and method. If there are several viewcells, a row
/// with the mean of each method follows. All viewcells must have the same methods.
pub fn table(results: &[Judged]) -> Table {
    let mut table = Table::new();
    table.load_style(presets::UTF8_HORIZONTAL_ONLY).set_header([
        "cell",
        "method",
        "promises",
        "seconds",
        "reported",
        "sampled",
        "times",
        "false hidden",
        "narrow",
        "seen/hidden/open",
        "proofs",
    ]);
    let mut row = |cell: String, trial: &Trial, [seconds, reported, sampled, lost, narrow]: [f64; 5]| {
        table.add_row([
            cell,
            trial.method.clone(),
            trial.accuracy.to_string(),
            format!("{seconds:.4}"),
            format!("{reported:.0}"),
            format!("{sampled:.0}"),
            format!("{:.2}", reported / sampled.max(1.0)),
            format!("{lost:.0}"),
            format!("{narrow:.0}"),
            trial.sandwich.map_or_else(String::new, |s| format!("{}/{}/{}", s.seen, s.hidden, s.open)),
            trial.sandwich.map_or_else(String::new, |s| match s.bad_proofs {
                0 => s.proofs.to_string(),
                bad => format!("{} ({bad} BAD)", s.proofs),
            }),
        ]);
    };
    let figures = |judged: &Judged, trial: &Trial| {
        let LeftOut { false_hidden, narrow } = &trial.left_out;
        let counts = [trial.reported.len(), judged.sampled_count(), false_hidden.len(), narrow.len()];
        let [reported, sampled, lost, narrow] = counts.map(|count| count as f64);
        [trial.seconds, reported, sampled, lost, narrow]
    };
    for (number, judged) in results.iter().enumerate() {
        judged.trials.iter().for_each(|trial| row(number.to_string(), trial, figures(judged, trial)));
    }
    if let Some(first) = results.first().filter(|_| results.len() > 1) {
        for (index, trial) in first.trials.iter().enumerate() {
            let mut sum = [0.0; 5];
            for judged in results {
                let figures = figures(judged, &judged.trials[index]);
                (0..5).for_each(|i| sum[i] += figures[i]);
            }
            let count = results.len() as f64;
            let trial = &Trial { sandwich: None, ..trial.clone() };
            let means = [sum[0] / count, sum[1] / count, sum[2] / count, sum[3], sum[4]];
            row("mean".to_owned(), trial, means);
        }
    }
    for column in table.column_iter_mut().skip(3) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

/// Explanation of the columns of [`table`], to be printed below it.
pub const LEGEND: &str = "\
seconds: processor time of one thread for a viewcell, without what is made once for a scene
reported, sampled: objects by the method, and by samples, which may miss some; times: reported for each sampled one
false hidden: sampled objects that the method does not report, though exact arithmetic finds a line of sight to
them that the method promises to find; narrow: objects seen only along lines closer to an occluder than six times
the method's clearance (.6 mm by default), which it may leave out. In the rows of means, of all viewcells together
seen/hidden/open, proofs: objects seen for certain, proven hidden, and neither, which are reported; checked proofs";

#[derive(Serialize)]
struct Line<'a> {
    scene: &'a str,
    cell: [f64; 6],
    #[serde(skip_serializing_if = "Vec::is_empty")]
    planes: Vec<[f64; 4]>,
    method: &'a str,
    accuracy: &'a str,
    seconds: f64,
    objects: usize,
    reported: usize,
    sampled: usize,
    false_hidden: usize,
    narrow: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    seen: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    hidden: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    open: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    proofs: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    bad_proofs: Option<usize>,
    ids: &'a [u32],
}

/// Writes a line of JSON for each viewcell and method. `ids` are the indices of the objects reported, in the
/// order of the scene's file. Viewcells with planes have `planes`, each as inward normal and offset. Methods
/// with bounds on the true answer have `seen`, `hidden`, `open`, `proofs` and `bad_proofs` as well.
///
/// # Errors
///
/// Returns the error of the writer.
pub fn json(out: &mut impl Write, world: &World, results: &[Judged]) -> io::Result<()> {
    for judged in results {
        let Viewcell { min, max, planes } = &judged.cell;
        for trial in &judged.trials {
            let line = Line {
                scene: &world.source.name,
                cell: [min.x, min.y, min.z, max.x, max.y, max.z],
                planes: planes.iter().map(|p| [p.normal.x, p.normal.y, p.normal.z, p.offset]).collect(),
                method: &trial.method,
                accuracy: trial.accuracy.name(),
                seconds: trial.seconds,
                objects: world.source.objects.len(),
                reported: trial.reported.len(),
                sampled: judged.sampled_count(),
                false_hidden: trial.left_out.false_hidden.len(),
                narrow: trial.left_out.narrow.len(),
                seen: trial.sandwich.map(|sandwich| sandwich.seen),
                hidden: trial.sandwich.map(|sandwich| sandwich.hidden),
                open: trial.sandwich.map(|sandwich| sandwich.open),
                proofs: trial.sandwich.map(|sandwich| sandwich.proofs),
                bad_proofs: trial.sandwich.map(|sandwich| sandwich.bad_proofs),
                ids: &trial.reported,
            };
            serde_json::to_writer(&mut *out, &line)?;
            writeln!(out)?;
        }
    }
    Ok(())
}
