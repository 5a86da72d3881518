//! Plans as horizontal cuts through scenes: each triangle that the height cuts gives a wall.

use super::plan_file::PlanFile;
use crate::error::SourceError;
use glam::Vec3;

/// Cuts the opaque objects of a scene at a height in metres along its up axis. Doors, and what animations
/// move, are left out. `name` is a file or a recipe, as for [`open`](crate::load::open).
///
/// # Errors
///
/// Returns the errors of [`open`](crate::load::open).
pub fn load(name: &str, height: f32) -> Result<PlanFile, SourceError> {
    let scene = crate::load::open(name)?;
    let up = scene.up.abs().max_position();
    let across = [[1, 2], [0, 2], [0, 1]][up];
    let height = height * scene.up[up].signum();
    let mut plan = PlanFile::default();
    for object in
        scene.objects.iter().filter(|object| object.opaque && !object.door && object.motion.is_none())
    {
        for triangle in &object.triangles.view().to_vec() {
            plan.walls
                .extend(cut(triangle, up, height).map(|ends| ends.map(|end| across.map(|axis| end[axis]))));
        }
    }
    plan.walls.sort_by(|a, b| {
        let [a, b] = [a, b].map(|wall| wall.as_flattened());
        a.iter()
            .zip(b)
            .map(|(a, b)| a.total_cmp(b))
            .find(|order| order.is_ne())
            .unwrap_or(std::cmp::Ordering::Equal)
    });
    plan.walls.dedup();
    Ok(plan)
}

/// Returns the segment of a triangle at a height. `None` if the triangle does not cross the height, or is not
/// finite. Triangles with a common edge have the same point on it to the last bit.
fn cut(triangle: &[Vec3; 3], up: usize, height: f32) -> Option<[[f64; 3]; 2]> {
    if !triangle.iter().all(|corner| corner.is_finite()) {
        return None;
    }
    // A corner at the height counts as above, so that each triangle has either no or two edges that cross.
    let mut ends = (0..3).filter_map(|k| {
        let mut edge = [triangle[k], triangle[(k + 1) % 3]].map(|corner| corner.as_dvec3().to_array());
        edge.sort_by(|a, b| {
            a[up].total_cmp(&b[up]).then(a.partial_cmp(b).unwrap_or(std::cmp::Ordering::Equal))
        });
        let [low, high] = edge;
        let height = f64::from(height);
        (low[up] < height && high[up] >= height).then(|| {
            let share = (height - low[up]) / (high[up] - low[up]);
            [0, 1, 2].map(|axis| low[axis] + share * (high[axis] - low[axis]))
        })
    });
    let mut ends = [ends.next()?, ends.next()?];
    ends.sort_by(|a, b| a.partial_cmp(b).unwrap_or(std::cmp::Ordering::Equal));
    (ends[0] != ends[1]).then_some(ends)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangles_are_cut_where_they_cross_the_height() {
        let corners = [Vec3::ZERO, Vec3::new(4.0, 0.0, 0.0), Vec3::new(0.0, 2.0, 4.0)];
        let cut_at = |height| cut(&corners, 2, height);
        assert_eq!(cut_at(2.0), Some([[0.0, 1.0, 2.0], [2.0, 1.0, 2.0]]), "half up");
        assert_eq!(cut_at(0.0), None, "at the lower edge, which counts as above");
        assert_eq!(cut_at(5.0), None, "above");
        assert_eq!(cut(&[corners[0], corners[1], Vec3::NAN], 2, 1.0), None, "a corner that is no point");
    }

    #[test]
    fn a_recipe_has_walls_at_the_height_of_eyes() {
        let plan = load("office:1,4", 1.5).unwrap();
        assert!(plan.walls.len() > 20, "{} walls of an office", plan.walls.len());
        assert!(load("office:1,4", 1e6).unwrap().walls.is_empty(), "no walls in the sky");
    }
}
