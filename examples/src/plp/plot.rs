//! Plot of the number of visible triangles per frame, as in the paper's figures 10a and 11a.

use super::{BUDGETS, Coverage};
use plotters::prelude::*;
use std::error::Error;
use std::path::Path;

const COLORS: [RGBColor; 4] =
    [RGBColor(0, 90, 160), RGBColor(0, 140, 120), RGBColor(200, 130, 0), RGBColor(190, 50, 50)];

/// Writes an SVG plot over the frames of a walk: the number of visible triangles, the number that `method`
/// finds at each budget, and the number that sorting by distance finds at the largest budget. Sorting by
/// distance must be method 0 of `coverage`.
///
/// # Errors
///
/// Returns the error of the plotting library when the file cannot be written.
pub fn plot(path: &Path, title: &str, coverage: &Coverage, method: usize) -> Result<(), Box<dyn Error>> {
    let frames = coverage.exact.len();
    let most = coverage.exact.iter().copied().max().unwrap_or(1).max(1);
    let area = SVGBackend::new(path, (900, 480)).into_drawing_area();
    area.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&area)
        .caption(title, ("sans-serif", 18))
        .margin(12)
        .x_label_area_size(36)
        .y_label_area_size(56)
        .build_cartesian_2d(0..frames.max(2) - 1, 0..most + most / 10)?;
    chart.configure_mesh().light_line_style(WHITE).x_desc("frame").y_desc("visible triangles").draw()?;
    let mut line =
        |name: String, counts: &[u32], color: RGBColor, width: u32| -> Result<(), Box<dyn Error>> {
            let points = counts.iter().copied().enumerate();
            let style = color.stroke_width(width);
            let series = chart.draw_series(LineSeries::new(points, style))?;
            series.label(name).legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], style));
            Ok(())
        };
    line("exact".to_owned(), &coverage.exact, BLACK, 2)?;
    for (budget, color) in (0..BUDGETS.len()).rev().zip(COLORS) {
        let name = format!("plp, {} %", BUDGETS[budget] * 100.0);
        line(name, &coverage.found[method][budget].visible, color, 1)?;
    }
    let last = BUDGETS.len() - 1;
    let name = format!("nearest, {} %", BUDGETS[last] * 100.0);
    line(name, &coverage.found[0][last].visible, RGBColor(150, 150, 150), 1)?;
    chart.configure_series_labels().background_style(WHITE.mix(0.8)).border_style(BLACK).draw()?;
    area.present()?;
    Ok(())
}
