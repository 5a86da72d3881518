//! Pictures of floor plans in SVG: walls, polygons and points.

use super::plan_file::PlanFile;
use std::fmt::Write as _;

/// Longer side of the picture in pixels.
const SIDE: f64 = 1000.0;

/// SVG picture of a plan. Items added later cover earlier ones.
pub struct Drawing {
    body: String,
    low: [f64; 2],
    size: [f64; 2],
    scale: f64,
    y_down: bool,
}

impl Drawing {
    /// Creates an empty picture of the rectangle from `low` to `high`, in the units of the plan. `y_down`
    /// tells whether y grows downwards in the plan.
    pub fn new([low, high]: [[f64; 2]; 2], y_down: bool) -> Self {
        let size = [high[0] - low[0], high[1] - low[1]];
        let scale = SIDE / size[0].max(size[1]).max(f64::MIN_POSITIVE);
        Self { body: String::new(), low, size: size.map(|side| side * scale), scale, y_down }
    }

    fn place(&self, [x, y]: [f64; 2]) -> String {
        let (x, y) = ((x - self.low[0]) * self.scale, (y - self.low[1]) * self.scale);
        let y = if self.y_down { y } else { self.size[1] - y };
        format!("{x:.2} {y:.2}")
    }

    /// Adds a filled polygon; `style` is the value of the attribute `style`.
    pub fn polygon(&mut self, corners: &[[f64; 2]], style: &str) {
        if corners.is_empty() {
            return;
        }
        let path: Vec<_> = corners.iter().map(|&corner| self.place(corner)).collect();
        let _ = writeln!(self.body, "<path style=\"{style}\" d=\"M{}Z\"/>", path.join("L"));
    }

    /// Adds lines between pairs of points; `style` is the value of the attribute `style`.
    pub fn lines(&mut self, lines: impl IntoIterator<Item = [[f64; 2]; 2]>, style: &str) {
        let mut path = String::new();
        for [a, b] in lines {
            let _ = write!(path, "M{}L{}", self.place(a), self.place(b));
        }
        if !path.is_empty() {
            let _ = writeln!(self.body, "<path style=\"{style}\" fill=\"none\" d=\"{path}\"/>");
        }
    }

    /// Adds the walls of a plan in black.
    pub fn walls(&mut self, plan: &PlanFile) {
        self.lines(plan.walls.iter().copied(), "stroke:#222;stroke-width:1.5;stroke-linecap:round");
    }

    /// Adds a filled dot.
    pub fn dot(&mut self, at: [f64; 2], color: &str) {
        let place = self.place(at);
        let (x, y) = place.split_once(' ').unwrap_or_default();
        let _ = writeln!(self.body, "<circle cx=\"{x}\" cy=\"{y}\" r=\"4\" fill=\"{color}\"/>");
    }

    /// Adds a filled disc with a radius in the units of the plan.
    pub fn disc(&mut self, center: [f64; 2], radius: f64, color: &str) {
        let place = self.place(center);
        let (x, y) = place.split_once(' ').unwrap_or_default();
        let r = radius * self.scale;
        let _ = writeln!(self.body, "<circle cx=\"{x}\" cy=\"{y}\" r=\"{r:.2}\" fill=\"{color}\"/>");
    }

    /// Begins frame `index` of an animation of `count` frames, which repeats. Items added until
    /// [`end_frame`](Self::end_frame) are shown for `seconds`. Viewers without animation show the first
    /// frame.
    pub fn begin_frame(&mut self, index: usize, count: usize, seconds: f64) {
        let (begin, end) = (index as f64 / count as f64, (index + 1) as f64 / count as f64);
        let visibility = if index == 0 { "visible" } else { "hidden" };
        let _ = writeln!(
            self.body,
            "<g visibility=\"{visibility}\"><animate attributeName=\"visibility\" calcMode=\"discrete\" \
             values=\"hidden;visible;hidden;hidden\" keyTimes=\"0;{begin:.5};{end:.5};1\" dur=\"{:.2}s\" \
             repeatCount=\"indefinite\"/>",
            seconds * count as f64
        );
    }

    /// Ends the current frame of the animation.
    pub fn end_frame(&mut self) {
        self.body.push_str("</g>\n");
    }

    /// Returns the finished picture as SVG text.
    pub fn finish(self) -> String {
        let [width, height] = self.size.map(|side| side.max(1.0));
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.2} {height:.2}\" width=\"{width:.0}\" \
             height=\"{height:.0}\">\n<rect width=\"100%\" height=\"100%\" fill=\"#fafaf7\"/>\n{}</svg>\n",
            self.body
        )
    }
}
