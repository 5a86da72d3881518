//! Output of results as a table for people, and as JSON lines and lists of reported objects for programs.

use super::aimed_rays::AimedRays;
use super::judge::{Judgement, Verdict, over_ideal};
use super::{Trial, World};
use crate::{Reading, SourceObject};
use comfy_table::{CellAlignment, Table, presets};
use serde::Serialize;
use std::io::{self, Write};
use visibility_measure::DrawCost;

/// Returns a culler's cost over the ideal, from its median time to cull a frame.
fn cost_over_ideal(trial: &Trial, verdict: &Verdict, judgement: &Judgement) -> f64 {
    let triangles = verdict.reported_triangles as f64 / judgement.exact.len().max(1) as f64;
    let visible = [judgement.mean_exact(), judgement.mean_visible_triangles()];
    over_ideal(trial.quantile(0.5), [trial.mean_visible(), triangles], visible)
}

/// Returns a line of text on the loaded scene: objects by kind, occluders, triangles, unit, up axis and
/// origin.
pub fn header(world: &World, reading: &Reading) -> String {
    let (source, scene) = (&world.source, &world.scene);
    let count = |is: fn(&SourceObject) -> bool| source.objects.iter().filter(|&object| is(object)).count();
    let moving = |object: &SourceObject| object.motion.is_some() || object.never_cull;
    let (occluders, up) = (scene.occluder_count(), source.up_axis());
    let shared = match source.instances() {
        [0, _] => String::new(),
        [objects, meshes] => format!(", {objects} objects share {meshes} meshes"),
    };
    format!(
        "{}: {} objects: {} opaque, {} see-through, {} moving; {occluders} occluders; {} triangles \
         ({}){shared}; unit {} m, {up} up, origin {}",
        source.name,
        source.objects.len(),
        count(|object| !object.see_through),
        count(|object| object.see_through),
        count(moving),
        source.triangle_count(),
        source.surfaces(),
        reading.metres(),
        source.origin,
    )
}

/// Returns a line of text on the exact answer: visible objects, box limit and ideal, as means per frame.
pub fn truth(judgement: &Judgement) -> String {
    let ideal = DrawCost::default().of(judgement.mean_exact(), judgement.mean_visible_triangles());
    format!(
        "a frame: {:.1} objects visible by {:.0} triangles; box limit {:.1} objects; ideal {ideal:.1} us",
        judgement.mean_exact(),
        judgement.mean_visible_triangles(),
        judgement.mean_limit(),
    )
}

/// Formats the results as a table with a row per culler, in the order of the trials.
pub fn table(world: &World, trials: &[Trial], judgement: &Judgement) -> Table {
    let frames = world.views.len() as f64;
    let frustum = trials.iter().find(|trial| trial.name == "frustum");
    let over_gain = |trial: &Trial| match frustum {
        Some(frustum) => format!("{:.2}", trial.worst_over_gain(frustum)),
        None => "-".to_owned(),
    };
    let mut table = Table::new();
    table.load_style(presets::UTF8_HORIZONTAL_ONLY).set_header([
        "culler",
        "promises",
        "reported",
        "/ limit",
        "us a frame",
        "p99",
        "/ gain",
        "/ ideal",
        "false hidden",
        "ties",
        "false visible",
        "wrong pixels",
    ]);
    for (trial, verdict) in trials.iter().zip(&judgement.verdicts) {
        table.add_row([
            trial.name.clone(),
            trial.accuracy.to_string(),
            format!("{:.1}", trial.mean_visible()),
            format!("{:.2}", trial.mean_visible() / judgement.mean_limit().max(1.0)),
            format!("{:.2}", trial.quantile(0.5)),
            format!("{:.2}", trial.quantile(0.99)),
            over_gain(trial),
            format!("{:.1}", cost_over_ideal(trial, verdict, judgement)),
            verdict.false_hidden.to_string(),
            verdict.tied_hidden.to_string(),
            format!("{:.1}", verdict.false_visible as f64 / frames),
            format!("{:.1}", verdict.wrong_pixels as f64 / frames),
        ]);
    }
    for column in table.column_iter_mut().skip(2) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

/// Returns a line of text on the aimed rays, and a line for each culler with the number of objects that rays
/// met although the culler hid them, over all frames, and the first of these objects.
pub fn aimed_rays(trials: &[Trial], found: &AimedRays) -> String {
    let mut text = format!("aimed rays: {} cast, {} met an object\n", found.rays, found.met);
    for (trial, hidden) in trials.iter().zip(&found.hidden) {
        text += &format!(" {}: {} objects were met and hidden", trial.name, hidden.len());
        if let Some((frame, object)) = hidden.first() {
            text += &format!(", first in frame {frame} object {object}");
        }
        text += "\n";
    }
    text
}

/// Explanation of the columns of [`table`], to be printed below it.
pub const LEGEND: &str = "\
reported: objects a frame by the culler; visible: in truth (an item buffer: opaque triangles, and see-through ones before them)
box limit: objects a frame that a culler must report which tests only boxes: before opaque triangles, a pixel is free for their box
/ limit: reported objects for each one of the box limit; 1 is the best that boxes allow
us a frame, p99: median and 99th percentile of the time to cull one frame, one thread
/ gain: of the worst frame, the time to cull over 4 times the time of `frustum` and 1 us for each object that it reports more
/ ideal: time to cull and to draw what is reported, over the ideal: to draw visible triangles alone, without any time to cull
(1 us for each object and 1 us for a thousand triangles)
false hidden: visible objects that the culler hid, all frames together: what a user sees vanish
ties: hidden objects that show only where a reported object shows alike, on an edge or in one plane with it, all frames together
false visible: reported objects of which no pixel shows, a frame
wrong pixels: pixels that are not what they should be when only the reported objects are drawn, a frame";

#[derive(Serialize)]
struct Line<'a> {
    scene: &'a str,
    culler: &'a str,
    accuracy: &'a str,
    objects: usize,
    frames: usize,
    median_us: f64,
    p99_us: f64,
    mean_visible: f64,
    mean_exact: f64,
    mean_box_limit: f64,
    over_ideal: f64,
    false_hidden: u64,
    tied_hidden: u64,
    false_visible: u64,
    mean_wrong_pixels: f64,
}

/// Writes one line of JSON per culler. `false_hidden`, `tied_hidden` and `false_visible` are summed over all
/// frames, the other counts are means per frame.
///
/// # Errors
///
/// Returns the error of the writer.
pub fn json(out: &mut impl Write, world: &World, trials: &[Trial], judgement: &Judgement) -> io::Result<()> {
    for (trial, verdict) in trials.iter().zip(&judgement.verdicts) {
        let line = Line {
            scene: &world.source.name,
            culler: &trial.name,
            accuracy: trial.accuracy.name(),
            objects: world.scene.len(),
            frames: world.views.len(),
            median_us: trial.quantile(0.5),
            p99_us: trial.quantile(0.99),
            mean_visible: trial.mean_visible(),
            mean_exact: judgement.mean_exact(),
            mean_box_limit: judgement.mean_limit(),
            over_ideal: cost_over_ideal(trial, verdict, judgement),
            false_hidden: verdict.false_hidden,
            tied_hidden: verdict.tied_hidden,
            false_visible: verdict.false_visible,
            mean_wrong_pixels: verdict.wrong_pixels as f64 / world.views.len() as f64,
        };
        serde_json::to_writer(&mut *out, &line)?;
        writeln!(out)?;
    }
    Ok(())
}

/// Writes a line `frame culler id id id ...` per frame and culler; the ids are indices of the reported
/// objects, ascending.
///
/// # Errors
///
/// Returns the error of the writer.
pub fn dump(out: &mut impl Write, trials: &[Trial]) -> io::Result<()> {
    for frame in 0..trials.first().map_or(0, |trial| trial.reported.len()) {
        for trial in trials {
            write!(out, "{frame} {}", trial.name)?;
            trial.reported[frame].iter().try_for_each(|id| write!(out, " {id}"))?;
            writeln!(out)?;
        }
    }
    Ok(())
}
