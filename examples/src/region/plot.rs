//! Time against tightness: the means of each method over the viewcells of a scene, as CSV and as a plot.

use super::output::Judged;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use serde::Serialize;
use std::error::Error;
use std::io::Write;
use std::path::Path;

const SIZE: (u32, u32) = (960, 560);
const FONT: (&str, u32) = ("sans-serif", 14);

/// Least time in the plot, in seconds, which is the resolution of processor clocks.
const FLOOR: f64 = 1e-4;

/// Means of a method over viewcells.
#[derive(Clone, Debug, Serialize)]
pub struct Point {
    /// Name of the scene.
    pub scene: String,
    /// Entry of the method on the command line.
    pub method: String,
    /// Accuracy class that the method promises.
    pub accuracy: String,
    /// Number of viewcells.
    pub viewcells: usize,
    /// Mean processor time in seconds for a viewcell.
    pub seconds: f64,
    /// Mean number of objects that the method reports.
    pub reported: f64,
    /// Mean number of objects that samples see.
    pub sampled: f64,
    /// Number of objects that samples see and the method does not report, summed over all viewcells.
    pub false_hidden: usize,
}

impl Point {
    /// Returns the number of reported objects per sampled object.
    fn times(&self) -> f64 {
        self.reported / self.sampled.max(1.0)
    }
}

/// Returns one point for each method. All viewcells must have the same methods. Empty without viewcells.
pub fn points(scene: &str, results: &[Judged]) -> Vec<Point> {
    let count = results.len().max(1) as f64;
    let methods = results.first().map_or(0, |judged| judged.trials.len());
    let mean = |of: &dyn Fn(&Judged) -> f64| results.iter().map(of).sum::<f64>() / count;
    (0..methods)
        .map(|index| Point {
            scene: scene.to_owned(),
            method: results[0].trials[index].method.clone(),
            accuracy: results[0].trials[index].accuracy.to_string(),
            viewcells: results.len(),
            seconds: mean(&|judged| judged.trials[index].seconds),
            reported: mean(&|judged| judged.trials[index].reported.len() as f64),
            sampled: mean(&|judged| judged.sampled_count() as f64),
            false_hidden: results.iter().map(|judged| judged.trials[index].left_out.false_hidden.len()).sum(),
        })
        .collect()
}

/// Writes points as CSV, a line per point below a line of column names. Returns the error of the writer.
pub fn csv(out: impl Write, points: &[Point]) -> csv::Result<()> {
    let mut writer = csv::Writer::from_writer(out);
    points.iter().try_for_each(|point| writer.serialize(point))?;
    writer.flush()?;
    Ok(())
}

/// Draws the points of one scene as an SVG file.
///
/// # Errors
///
/// Returns the error of the plotting library when the file cannot be written.
pub fn plot(path: &Path, scene: &str, points: &[Point]) -> Result<(), Box<dyn Error>> {
    let area = SVGBackend::new(path, SIZE).into_drawing_area();
    area.fill(&WHITE)?;
    let time = |point: &Point| point.seconds.max(FLOOR);
    let range = |values: &dyn Fn(&Point) -> f64| {
        let least = points.iter().map(values).fold(f64::INFINITY, f64::min);
        let most = points.iter().map(values).fold(0.0, f64::max);
        if least > 0.0 && least <= most { least / 1.5..most * 1.8 } else { 0.1..10.0 }
    };
    let mut chart = ChartBuilder::on(&area)
        .caption(format!("{scene}: what can be seen from a viewcell"), ("sans-serif", 20))
        .margin(12)
        .x_label_area_size(44)
        .y_label_area_size(64)
        .build_cartesian_2d(range(&time).log_scale(), range(&Point::times).log_scale())?;
    chart
        .configure_mesh()
        .x_desc("seconds for a viewcell (processor time of one thread, mean)")
        .y_desc("objects reported for each one that samples see")
        .label_style(FONT)
        .light_line_style(WHITE)
        .draw()?;
    let (green, red) = (RGBColor(30, 110, 60), RGBColor(200, 60, 40));
    for point in points {
        let color = if point.false_hidden > 0 { red } else { green };
        let at = (time(point), point.times());
        chart.draw_series([Circle::new(at, 5, color.filled())])?;
        let style = FONT.into_font().color(&color).pos(Pos::new(HPos::Left, VPos::Center));
        chart.draw_series([EmptyElement::at(at) + Text::new(point.method.clone(), (8, 0), style)])?;
    }
    for (line, (color, text)) in
        [(green, "hides nothing that samples see"), (red, "hides something that samples see")]
            .into_iter()
            .enumerate()
    {
        let style = FONT.into_font().color(&color).pos(Pos::new(HPos::Right, VPos::Top));
        area.draw(&Text::new(text, (SIZE.0 as i32 - 20, 44 + 18 * line as i32), style))?;
    }
    area.present()?;
    Ok(())
}
