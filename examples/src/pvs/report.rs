//! Reports of a finished bake: text for people, and JSON for programs.

use super::bake::{Baked, Map};
use serde::Serialize;
use std::fmt::Write;

/// Statistics of a bake, to be serialized as one line of JSON.
#[derive(Serialize)]
pub struct Line<'a> {
    map: &'a str,
    cells: usize,
    portals: usize,
    mode: &'a str,
    threads: usize,
    seconds: f64,
    mean_visible: f64,
    fallbacks: usize,
}

impl<'a> Line<'a> {
    /// Collects the statistics of a bake. `mode` names the kind of test and `threads` the number of threads.
    pub fn new(map: &'a Map, baked: &Baked, mode: &'a str, threads: usize) -> Self {
        Self {
            map: &map.name,
            cells: map.graph.cell_count(),
            portals: map.graph.portals().len(),
            mode,
            threads,
            seconds: baked.seconds,
            mean_visible: baked.outcome.matrix.mean_visible(),
            fallbacks: baked.outcome.fallbacks.len(),
        }
    }
}

/// Describes a bake in words, one line per fact, followed by the `slowest` cells that took the most chains of
/// portals.
pub fn summary(map: &Map, baked: &Baked, slowest: usize) -> String {
    let (graph, outcome) = (&map.graph, &baked.outcome);
    let mut text = String::new();
    let steps: u64 = outcome.steps.iter().sum();
    // Writing to a string cannot fail.
    let _ = writeln!(
        text,
        "{}: {} cells, {} portals: a cell sees {:.2} cells in the mean; {:.2} s, {steps} chains of portals",
        map.name,
        graph.cell_count(),
        graph.portals().len(),
        outcome.matrix.mean_visible(),
        baked.seconds,
    );
    if outcome.rejected > 0 {
        let _ =
            writeln!(text, "{} chains rejected in Pluecker space, each with a certificate", outcome.rejected);
    }
    for fallback in &outcome.fallbacks {
        let _ = writeln!(
            text,
            "cell {}: the limit of steps was reached; {} of its portals count all that is possible as seen",
            fallback.cell.0, fallback.portals
        );
    }
    let mut cells: Vec<usize> = (0..outcome.steps.len()).collect();
    cells.sort_by_key(|&cell| (std::cmp::Reverse(outcome.steps[cell]), cell));
    for &cell in cells.iter().take(slowest) {
        let id = visibility_core::cells::CellId(cell as u32);
        let _ = writeln!(
            text,
            "cell {cell}: {} chains ({:.1} %), {} portals, sees {} cells",
            outcome.steps[cell],
            outcome.steps[cell] as f64 / steps.max(1) as f64 * 100.0,
            graph.portals_of(id).len(),
            outcome.matrix.seen_from(id).count(),
        );
    }
    text
}
