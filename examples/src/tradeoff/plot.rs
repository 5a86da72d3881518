//! Plots of one scene's points: time against overdraw, and time against wrong pixels.

use super::pareto::best;
use super::point::Point;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::error::Error;
use std::path::Path;

const SIZE: (u32, u32) = (960, 600);
const FONT: (&str, u32) = ("sans-serif", 14);

/// Quantity on the vertical axis: its label, and its value for a point.
struct Quantity {
    name: &'static str,
    of: fn(&Point) -> f64,
    /// Minimum value at which a point is drawn, since a logarithmic axis has no zero.
    floor: f64,
}

/// Writes `SCENE-overdraw.svg` and `SCENE-wrong-pixels.svg` to a folder, with the points of one scene.
///
/// # Errors
///
/// Returns the error of the plotting library when a file cannot be written.
pub fn plots(folder: &Path, scene: &str, points: &[Point]) -> Result<(), Box<dyn Error>> {
    let overdraw = Quantity { name: "triangles drawn for each visible one", of: Point::overdraw, floor: 1.0 };
    let wrong = Quantity {
        name: "wrong pixels, percent (those with none stand on the lower edge)",
        of: |point| point.wrong_pixels_percent,
        floor: 1e-4,
    };
    plot(&folder.join(format!("{scene}-overdraw.svg")), scene, points, &overdraw)?;
    plot(&folder.join(format!("{scene}-wrong-pixels.svg")), scene, points, &wrong)
}

fn plot(path: &Path, scene: &str, points: &[Point], quantity: &Quantity) -> Result<(), Box<dyn Error>> {
    let area = SVGBackend::new(path, SIZE).into_drawing_area();
    area.fill(&WHITE)?;
    let height = |point: &Point| (quantity.of)(point).max(quantity.floor);
    let times = around(points.iter().map(|point| point.frame_us));
    let heights = around(points.iter().map(height));
    let mut chart = ChartBuilder::on(&area)
        .caption(format!("{scene}: every culler, every dial"), ("sans-serif", 20))
        .margin(12)
        .x_label_area_size(44)
        .y_label_area_size(64)
        .build_cartesian_2d((times.0..times.1).log_scale(), (heights.0..heights.1).log_scale())?;
    chart
        .configure_mesh()
        .x_desc("microseconds to cull a frame (median, one thread)")
        .y_desc(quantity.name)
        .label_style(FONT)
        .light_line_style(WHITE)
        .draw()?;
    let front = best(points);
    for (index, point) in points.iter().enumerate() {
        let (at, hides) = ((point.frame_us, height(point)), point.false_hidden > 0);
        let color = if hides { RGBColor(200, 60, 40) } else { RGBColor(30, 110, 60) };
        let on_front = front.contains(&index);
        let style = if on_front { color.filled() } else { color.stroke_width(1) };
        chart.draw_series([Circle::new(at, if on_front { 5 } else { 3 }, style)])?;
        if on_front {
            // A label in the right half is written to the left of its point, so that the label stays within
            // the picture.
            let right = (at.0 / times.0).ln() > 0.5 * (times.1 / times.0).ln();
            let (anchor, gap) = if right { (HPos::Right, -8) } else { (HPos::Left, 8) };
            let style = FONT.into_font().color(&color).pos(Pos::new(anchor, VPos::Center));
            chart.draw_series([EmptyElement::at(at) + Text::new(point.culler.clone(), (gap, 0), style)])?;
        }
    }
    let (green, red) = (RGBColor(30, 110, 60), RGBColor(200, 60, 40));
    for (line, (color, text)) in [
        (green, "nothing visible was hidden"),
        (red, "something visible was hidden"),
        (BLACK, "filled and named: no other culler is better in time, triangles and pixels at once"),
    ]
    .into_iter()
    .enumerate()
    {
        let style = FONT.into_font().color(&color).pos(Pos::new(HPos::Right, VPos::Top));
        area.draw(&Text::new(text, (SIZE.0 as i32 - 20, 44 + 18 * line as i32), style))?;
    }
    area.present()?;
    Ok(())
}

/// Returns a range of a logarithmic axis that contains the positive finite values, with a margin on both
/// sides; 0.1 to 10 without such values.
fn around(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (least, most) = values
        .filter(|value| value.is_finite() && *value > 0.0)
        .fold((f64::INFINITY, 0.0_f64), |(least, most), value| (least.min(value), most.max(value)));
    if least <= most { (least / 1.5, most * 1.8) } else { (0.1, 10.0) }
}
