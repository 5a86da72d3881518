//! One point of the trade.

use serde::Serialize;
use visibility_measure::DrawCost;

/// One culler with one setting on one scene. Counts are means over the frames.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Point {
    /// The scene.
    pub scene: String,
    /// The culler as `walkthrough --cullers` takes it.
    pub culler: String,
    /// What it promises.
    pub accuracy: &'static str,
    /// Median time to cull a frame, in microseconds.
    pub frame_us: f64,
    /// 99th percentile of that.
    pub p99_us: f64,
    /// Objects reported.
    pub objects: f64,
    /// Objects of which a pixel shows.
    pub visible_objects: f64,
    /// Triangles of the reported objects: what is drawn.
    pub triangles: f64,
    /// Triangles of which a pixel shows.
    pub visible_triangles: f64,
    /// Visible objects that were hidden, of all frames together.
    pub false_hidden: u64,
    /// Share of the picture that is wrong when only the reported objects are drawn, in percent.
    pub wrong_pixels_percent: f64,
    /// Memory that the culler holds besides the scene, in bytes.
    pub memory_bytes: usize,
    /// Time to make the culler ready for the scene, in milliseconds.
    pub preparation_ms: f64,
}

impl Point {
    /// Time to cull a frame and to draw what is reported, by [`DrawCost`]'s default.
    pub fn total_us(&self) -> f64 {
        self.frame_us + DrawCost::default().of(self.objects, self.triangles)
    }

    /// How many times more triangles are drawn than show.
    pub fn overdraw(&self) -> f64 {
        self.triangles / self.visible_triangles.max(1.0)
    }
}
