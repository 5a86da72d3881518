//! Hints that a scene file may have another unit, or another axis up, than it was read with.

use crate::SceneSource;
use crate::reading::Reading;
use glam::Vec3;

/// Height in metres from which on a scene may be in centimetres, and in millimetres.
const TALL: [f32; 2] = [300.0, 1500.0];
/// Size in metres below which a scene is a thing rather than a place, and stands in any way.
const PLACE: f32 = 30.0;

/// Returns lines for a user of a file that was read with the default unit, or the default axis up, where its
/// extents or its walls suggest others.
pub fn hints(scene: &SceneSource, reading: &Reading) -> Vec<String> {
    let Some((low, high)) = scene.bounds() else { return Vec::new() };
    let (size, up) = (high - low, scene.up.abs());
    let mut lines = Vec::new();
    let [x, y, z] = size.to_array();
    if reading.up.is_none() && scene.up == Vec3::Y && size.max_element() > PLACE {
        let is_flat = 3.0 * z < x.min(y);
        let upright = |axis: Vec3| upright_share(scene, axis);
        if is_flat || upright(Vec3::Y) < 0.5 && upright(Vec3::Z) > 0.75 {
            let why = if is_flat { "it is flat along z" } else { "its walls and floors stand along z" };
            lines.push(format!("{why}: if z is up, say --up z"));
            // The height is not known before that.
            return lines;
        }
    }
    let ground = (size * (Vec3::ONE - up)).max_element();
    let height = size.dot(up);
    if reading.unit.is_none() && height > TALL[0] && height > ground / 3.0 {
        let unit = if height < TALL[1] { "cm" } else { "mm" };
        lines.push(format!("it is {x:.0} by {y:.0} by {z:.0} m: if it is in {unit}, say --unit {unit}"));
    }
    lines
}

/// Returns the part of the area of all triangles that is upright or level, to about a degree, where an axis
/// is up; 0 without an area. Of a scene of more than four million triangles, objects are taken evenly.
fn upright_share(scene: &SceneSource, axis: Vec3) -> f64 {
    let (mut upright, mut all) = (0.0, 0.0);
    let step = scene.triangle_count().div_ceil(1 << 22).max(1);
    let objects = scene.objects.iter().step_by(step);
    for [a, b, c] in objects.flat_map(|object| object.triangles.view()) {
        let normal = (b - a).cross(c - a);
        let (area, along) = (normal.length(), normal.dot(axis).abs());
        if area.is_finite() {
            all += f64::from(area);
            upright += if along < 0.02 * area || along > 0.9998 * area { f64::from(area) } else { 0.0 };
        }
    }
    if all > 0.0 { upright / all } else { 0.0 }
}
