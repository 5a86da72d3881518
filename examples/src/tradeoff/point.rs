//! Measured point of the comparison: a culler's costs and errors on a scene.

use serde::Serialize;
use visibility_measure::DrawCost;

/// Costs and errors of one culler with one setting on one scene. Counts are means per frame unless stated
/// otherwise.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Point {
    /// Name of the scene.
    pub scene: String,
    /// Culler with its setting, in the syntax of `walkthrough --cullers`.
    pub culler: String,
    /// Name of the accuracy that the culler promises.
    pub accuracy: &'static str,
    /// Median time to cull a frame, in microseconds.
    pub frame_us: f64,
    /// 99th percentile of the time to cull a frame, in microseconds.
    pub p99_us: f64,
    /// Number of objects that the culler reports.
    pub objects: f64,
    /// Number of objects with at least one visible pixel.
    pub visible_objects: f64,
    /// Number of triangles of the reported objects, which would be drawn.
    pub triangles: f64,
    /// Number of triangles with at least one visible pixel.
    pub visible_triangles: f64,
    /// Number of visible objects that the culler hid, summed over all frames.
    pub false_hidden: u64,
    /// Percentage of pixels that are wrong when only the reported objects are drawn.
    pub wrong_pixels_percent: f64,
    /// Memory in bytes that the culler's precomputed structures take, besides the scene.
    pub memory_bytes: usize,
    /// Time in milliseconds to make the culler ready for the scene.
    pub preparation_ms: f64,
    /// Number of objects that any culler must report if it only tests boxes: the box limit.
    pub box_limit: f64,
    /// Time to cull a frame and to draw the reported objects, divided by the time to draw the visible
    /// triangles alone: see [`over_ideal`](crate::walkthrough::judge::over_ideal).
    pub over_ideal: f64,
}

impl Point {
    /// Returns the time in microseconds to cull a frame and to draw the reported objects, by the default
    /// [`DrawCost`].
    pub fn total_us(&self) -> f64 {
        self.frame_us + DrawCost::default().of(self.objects, self.triangles)
    }

    /// Returns the number of triangles drawn per visible triangle. With fewer than one visible triangle per
    /// frame, that number counts as one.
    pub fn overdraw(&self) -> f64 {
        self.triangles / self.visible_triangles.max(1.0)
    }
}
