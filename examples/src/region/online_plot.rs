//! A walk with sets that are made online, frame by frame, as a plot: objects reported, and the work for sets.

use plotters::prelude::*;
use std::error::Error;
use std::path::Path;

const SIZE: (u32, u32) = (960, 560);
const FONT: (&str, u32) = ("sans-serif", 14);

/// Frame of a walk.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    /// What answered: 0 for a viewcell, 1 for a wide box, 2 for none, so that nothing was hidden.
    pub answer: usize,
    /// Number of objects reported, in all directions.
    pub reported: usize,
    /// Number of objects that samples see from the box that answered. `None` in frames that were not judged.
    pub sampled: Option<usize>,
    /// Milliseconds of work on the next sets.
    pub work: f64,
}

/// Draws the frames of the walks of a scene as an SVG file. The walks follow each other; `rate` is the number
/// of frames a second.
///
/// # Errors
///
/// Returns the error of the plotting library when the file cannot be written.
pub fn plot(path: &Path, scene: &str, frames: &[Frame], rate: f64) -> Result<(), Box<dyn Error>> {
    let area = SVGBackend::new(path, SIZE).into_drawing_area();
    area.fill(&WHITE)?;
    let (upper, lower) = area.split_vertically(SIZE.1 * 3 / 5);
    let seconds = |frame: usize| frame as f64 / rate;
    let end = seconds(frames.len().max(1));
    let most = |value: &dyn Fn(&Frame) -> f64| 1.1 * frames.iter().map(value).fold(1.0, f64::max);
    let mut objects = ChartBuilder::on(&upper)
        .caption(format!("{scene}: a walk with sets that are made online"), ("sans-serif", 20))
        .margin(12)
        .x_label_area_size(24)
        .y_label_area_size(64)
        .build_cartesian_2d(0.0..end, 0.0..most(&|frame| frame.reported as f64))?;
    objects.configure_mesh().y_desc("objects").label_style(FONT).light_line_style(WHITE).draw()?;
    let answers = [
        ("reported by a viewcell", RGBColor(30, 110, 60)),
        ("late: reported by a wide box", RGBColor(220, 140, 20)),
        ("no answer: all objects", RGBColor(200, 60, 40)),
    ];
    for (answer, (label, color)) in answers.into_iter().enumerate() {
        let of_answer = frames.iter().enumerate().filter(|(_, frame)| frame.answer == answer);
        let bars = of_answer.map(|(number, frame)| {
            let at = [(seconds(number), 0.0), (seconds(number + 1), frame.reported as f64)];
            Rectangle::new(at, color.mix(0.6).filled())
        });
        let key = move |(x, y)| Rectangle::new([(x, y - 4), (x + 16, y + 4)], color.filled());
        objects.draw_series(bars)?.label(label).legend(key);
    }
    let judged = frames.iter().enumerate().filter_map(|(number, frame)| Some((number, frame.sampled?)));
    let dots =
        judged.map(|(number, sampled)| Circle::new((seconds(number), sampled as f64), 4, BLACK.filled()));
    let key = |(x, y)| Circle::new((x + 8, y), 4, BLACK.filled());
    objects.draw_series(dots)?.label("seen by samples").legend(key);
    objects.configure_series_labels().label_font(FONT).background_style(WHITE.mix(0.8)).draw()?;
    let mut work = ChartBuilder::on(&lower)
        .margin(12)
        .x_label_area_size(44)
        .y_label_area_size(64)
        .build_cartesian_2d(0.0..end, 0.0..most(&|frame| frame.work))?;
    let mut mesh = work.configure_mesh();
    mesh.x_desc("seconds").y_desc("ms of work a frame").label_style(FONT).light_line_style(WHITE).draw()?;
    work.draw_series(frames.iter().enumerate().map(|(number, frame)| {
        Rectangle::new([(seconds(number), 0.0), (seconds(number + 1), frame.work)], BLUE.mix(0.5).filled())
    }))?;
    area.present()?;
    Ok(())
}
