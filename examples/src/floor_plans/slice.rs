//! Plans as horizontal cuts through scenes: each triangle that the height cuts gives a wall.

use super::plan_file::PlanFile;
use crate::error::SourceError;
use crate::source::SceneSource;
use glam::Vec3;
use std::cmp::Ordering;
use visibility_2d::cdt::Opacity;

/// Cuts the opaque objects of a scene at a height in metres of world space along its up axis. Doors, and what
/// animations move, are left out. Returns the plan, in world space, and the opacity of each of its walls:
/// walls of objects that are drawn from their front alone are one-way. `name` is a file or a recipe, as for
/// [`open`](crate::load::open).
///
/// # Errors
///
/// Returns the errors of [`open`](crate::load::open).
pub fn load(name: &str, height: f32) -> Result<(PlanFile, Vec<Opacity>), SourceError> {
    Ok(slice(&crate::load::open(name)?, height))
}

fn slice(scene: &SceneSource, height: f32) -> (PlanFile, Vec<Opacity>) {
    let up = scene.up.abs().max_position();
    let across = [[1, 2], [0, 2], [0, 1]][up];
    // Around the front of a triangle, which is counter-clockwise, the edge that leads up is on the right hand
    // of who looks at it, where the plan's axes and the third are right-handed. A one-way wall stops what
    // comes from the right of the way from its first to its second end.
    let is_right_handed = up != 1;
    let height = f64::from(height * scene.up[up].signum()) - scene.origin[up];
    let place = |end: [f64; 3]| across.map(|axis| end[axis] + scene.origin[axis]);
    let mut walls = Vec::new();
    for object in scene.objects.iter().filter(|object| object.is_wall()) {
        for triangle in &object.triangles.view().to_vec() {
            let Some([up_end, down_end]) = cut(triangle, up, height) else { continue };
            let mut ends = if is_right_handed { [down_end, up_end] } else { [up_end, down_end] }.map(place);
            if !object.one_sided {
                ends.sort_by(|a, b| a.partial_cmp(b).unwrap_or(Ordering::Equal));
            }
            walls.push((ends, object.one_sided));
        }
    }
    walls.sort_by(|(a, a_one_sided), (b, b_one_sided)| {
        let order = a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| a.total_cmp(b));
        order.fold(Ordering::Equal, Ordering::then).then(a_one_sided.cmp(b_one_sided))
    });
    walls.dedup();
    let opacity = |&(_, one_sided): &_| if one_sided { Opacity::OneWay } else { Opacity::Opaque };
    let opacities = walls.iter().map(opacity).collect();
    let walls = walls.into_iter().map(|(ends, _)| ends).collect();
    (PlanFile { walls, ..PlanFile::default() }, opacities)
}

/// Returns the segment of a triangle at a height: where an edge leads up through the height, and where an
/// edge leads down. `None` if the triangle does not cross the height, or is not finite. Triangles with a
/// common edge have the same point on it to the last bit.
fn cut(triangle: &[Vec3; 3], up: usize, height: f64) -> Option<[[f64; 3]; 2]> {
    if !triangle.iter().all(|corner| corner.is_finite()) {
        return None;
    }
    // A corner at the height counts as above, so that each triangle has either no or two edges that cross.
    let is_above = triangle.map(|corner| f64::from(corner[up]) >= height);
    let end = |leads_up: bool| {
        let k = (0..3).find(|&k| is_above[k] != leads_up && is_above[(k + 1) % 3] == leads_up)?;
        let [from, to] = [k, (k + 1) % 3].map(|k| triangle[k].as_dvec3().to_array());
        let (low, high) = if leads_up { (from, to) } else { (to, from) };
        let share = (height - low[up]) / (high[up] - low[up]);
        Some([0, 1, 2].map(|axis| low[axis] + share * (high[axis] - low[axis])))
    };
    let ends = [end(true)?, end(false)?];
    (ends[0] != ends[1]).then_some(ends)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::SourceObject;
    use glam::DVec3;
    use visibility_2d::cdt::{Plan, PlanView, Visibility, Wall};

    #[test]
    fn triangles_are_cut_where_they_cross_the_height() {
        let corners = [Vec3::ZERO, Vec3::new(4.0, 0.0, 0.0), Vec3::new(0.0, 2.0, 4.0)];
        let cut_at = |height| cut(&corners, 2, height);
        assert_eq!(cut_at(2.0), Some([[2.0, 1.0, 2.0], [0.0, 1.0, 2.0]]), "half up");
        assert_eq!(cut_at(0.0), None, "at the lower edge, which counts as above");
        assert_eq!(cut_at(5.0), None, "above");
        assert_eq!(cut(&[corners[0], corners[1], Vec3::NAN], 2, 1.0), None, "a corner that is no point");
    }

    #[test]
    fn a_recipe_has_walls_at_the_height_of_eyes() {
        let (plan, opacities) = load("office:1,4", 1.5).unwrap();
        assert_eq!(opacities, vec![Opacity::Opaque; plan.walls.len()], "walls of a recipe have two sides");
        assert!(plan.walls.len() > 20, "{} walls of an office", plan.walls.len());
        assert!(load("office:1,4", 1e6).unwrap().0.walls.is_empty(), "no walls in the sky");
    }

    /// Returns which of two walls an eye sees: a square across the first axis of the plan at 10, which faces
    /// towards smaller numbers or greater ones, and a larger square at `behind` that has two sides. Both are
    /// `origin` and a little away from where the file has them.
    fn seen(up: Vec3, origin: DVec3, faces_greater: bool, eye: f64, behind: f64) -> Vec<u32> {
        let axis = up.abs().max_position();
        let across = [[1, 2], [0, 2], [0, 1]][axis];
        let square = |at: f32, half: f32| {
            let corner = |b: f32, h: f32| {
                let mut corner = Vec3::ZERO;
                (corner[across[0]], corner[across[1]], corner[axis]) = (at, b * half, h);
                corner
            };
            let [a, b, c, d] = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
            let mut triangles = [[a, b, c], [a, c, d]];
            let front = (b - a).cross(c - a)[across[0]];
            if (front > 0.0) != faces_greater {
                triangles.iter_mut().for_each(|triangle| triangle.reverse());
            }
            SourceObject::new("it", triangles.to_vec())
        };
        let objects = vec![
            SourceObject { one_sided: true, opaque: true, ..square(10.0, 1.0) },
            SourceObject { one_sided: false, opaque: true, ..square(behind as f32, 0.5) },
        ];
        let scene = SceneSource { origin, objects, ..SceneSource::new("it", up, 0.1) };
        let (plan, opacities) = slice(&scene, (origin[axis] as f32 + 0.25) * up[axis]);
        let walls: Vec<Wall> = plan
            .walls
            .iter()
            .zip(&opacities)
            .map(|(&[a, b], &opacity)| Wall::new(a, b).with_opacity(opacity))
            .collect();
        assert_eq!(walls.len(), 4, "two triangles of each square");
        let eye = [eye + origin[across[0]], origin[across[1]]];
        let mut answer = Visibility::new();
        Plan::new(&walls).unwrap().look(&PlanView::new(eye), &mut answer).unwrap();
        let first =
            |&wall: &u32| ((walls[wall as usize].ends[0][0] - origin[across[0]]) as f32).round() as u32;
        let mut seen: Vec<u32> = answer.walls().iter().map(first).collect();
        seen.sort_unstable();
        seen.dedup();
        seen
    }

    #[test]
    fn one_sided_triangles_stop_the_sight_of_their_fronts_alone() {
        for up in [Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z] {
            for origin in [DVec3::ZERO, DVec3::new(4096.0, -8192.0, 16384.0)] {
                let case = format!("up {up}, origin {origin}");
                assert_eq!(seen(up, origin, false, 0.0, 20.0), [10], "from the front, {case}");
                assert_eq!(seen(up, origin, true, 30.0, 5.0), [10], "from the other front, {case}");
                assert!(seen(up, origin, true, 0.0, 20.0).contains(&20), "through the back, {case}");
                assert!(seen(up, origin, false, 30.0, 5.0).contains(&5), "through the other back, {case}");
            }
        }
    }
}
