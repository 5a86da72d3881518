//! Hints to the user that a scene file may have another unit or up axis than those it was read with.

use crate::SceneSource;
use crate::reading::Reading;
use glam::Vec3;

/// Least heights in metres of scenes that may be in centimetres, and in millimetres.
const TALL: [f32; 2] = [300.0, 1500.0];
/// A scene of at least this many objects, half of them higher than this number of metres, may be in
/// millimetres regardless of its width.
const GIANTS: (f32, usize) = (1000.0, 10);
/// Size in metres below which a scene is a single thing, which may lie or stand in any way.
const PLACE: f32 = 30.0;
/// Least size in metres, and least number of objects, of a scene that may be a house with rooms.
const HOUSE: (f32, usize) = (6.0, 10);

/// Returns messages to the user of a file that was read with the default unit or up axis, if its extents or
/// walls suggest others.
pub fn hints(scene: &SceneSource, reading: &Reading) -> Vec<String> {
    let Some((low, high)) = scene.bounds() else { return Vec::new() };
    let (size, mut up) = (high - low, scene.up.abs());
    let mut lines = Vec::new();
    let [x, y, z] = size.to_array();
    if reading.up.is_none() && scene.up == Vec3::Y {
        let is_place = size.max_element() > PLACE;
        let shares = Vec3::AXES.map(|axis| SurfaceShares::new(scene, axis));
        let is_house = size.max_element() > HOUSE.0 && scene.objects.len() >= HOUSE.1;
        let why = if is_place && 3.0 * z < x.min(y) {
            Some("it is flat along z")
        } else if is_place && shares[1].upright() < 0.5 && shares[2].upright() > 0.75 {
            Some("its walls and floors stand along z")
        } else if is_house && shares[2].level > 1.5 * shares[0].level.max(shares[1].level) {
            Some("its largest faces are level along z")
        } else {
            None
        };
        if let Some(why) = why {
            lines.push(format!("{why}: if z is up, say --up z"));
            up = Vec3::Z;
        }
    }
    let ground = (size * (Vec3::ONE - up)).max_element();
    let height = size.dot(up);
    let is_tall = height > TALL[0] && height > ground / 3.0;
    if reading.unit.is_none() && (is_tall || has_giants(scene, up)) {
        let unit = if is_tall && height < TALL[1] { "cm" } else { "mm" };
        lines.push(format!("it is {x:.0} by {y:.0} by {z:.0} m: if it is in {unit}, say --unit {unit}"));
    }
    lines
}

/// Returns whether the scene has many objects, half of which are higher along `up` than real things are.
fn has_giants(scene: &SceneSource, up: Vec3) -> bool {
    let bounds = scene.objects.iter().filter_map(|object| object.triangles.view().known_bounds());
    let heights: Vec<f32> = bounds.map(|bounds| (bounds.max - bounds.min).dot(up)).collect();
    let giants = heights.iter().filter(|&&height| height >= GIANTS.0).count();
    heights.len() >= GIANTS.1 && 2 * giants >= heights.len()
}

/// Shares of the total triangle area, from 0 to 1. All are 0 if the area is 0. Of a scene with more than four
/// million triangles, evenly spaced objects are sampled.
struct SurfaceShares {
    /// Share of triangles that are level to about a degree, for a given up axis.
    level: f64,
    /// Share of triangles that are vertical to about a degree.
    vertical: f64,
}

impl SurfaceShares {
    fn new(scene: &SceneSource, axis: Vec3) -> Self {
        let (mut level, mut vertical, mut all) = (0.0, 0.0, 0.0);
        let step = scene.triangle_count().div_ceil(1 << 22).max(1);
        let objects = scene.objects.iter().step_by(step);
        for [a, b, c] in objects.flat_map(|object| object.triangles.view()) {
            let normal = (b - a).cross(c - a);
            let (area, along) = (f64::from(normal.length()), f64::from(normal.dot(axis).abs()));
            if area.is_finite() {
                all += area;
                level += if along > 0.9998 * area { area } else { 0.0 };
                vertical += if along < 0.02 * area { area } else { 0.0 };
            }
        }
        let share = |part: f64| if all > 0.0 { part / all } else { 0.0 };
        Self { level: share(level), vertical: share(vertical) }
    }

    /// Returns the share of triangles that are level or vertical.
    fn upright(&self) -> f64 {
        self.level + self.vertical
    }
}
