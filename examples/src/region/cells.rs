//! Viewcells for programs: read from text, or placed along a scene's walks and grown until they touch
//! surfaces.

use crate::walkthrough::World;
use crate::{Frame, frames};
use glam::{DQuat, DVec3, Vec3};
use visibility_core::geometry::Plane;
use visibility_core::pvs::Viewcell;
use visibility_core::{Aabb, ObjectId};
use visibility_frame::queries::SceneQuery;

/// Number of steps in which each side of a viewcell grows to its full size.
const STEPS: u32 = 16;
/// Initial size of a growing viewcell, as a fraction of its full size.
const SEED: f64 = 1e-3;

/// Viewcell from a command line: a box, rotated about the vertical axis through its middle.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct TurnedBox {
    min: DVec3,
    max: DVec3,
    /// Angle of rotation in degrees, counter-clockwise seen from above.
    degrees: f64,
}

/// Reads a box from six numbers separated by commas: minimum x, y, z and maximum x, y, z, in metres. An
/// optional suffix `@` and an angle in degrees rotates the box about the vertical axis through its middle.
/// The error is a message for a person.
pub fn parse(text: &str) -> Result<TurnedBox, String> {
    let (corners, degrees) = text.split_once('@').unwrap_or((text, "0"));
    let ([a, b, c, d, e, f], [degrees]) = (numbers::<6>(corners)?, numbers::<1>(degrees)?);
    let (min, max) = (DVec3::new(a, b, c), DVec3::new(d, e, f));
    if min.cmpgt(max).any() {
        return Err("a maximum is less than its minimum".to_owned());
    }
    Ok(TurnedBox { min, max, degrees })
}

/// Reads a size from three numbers separated by commas: two sizes on the ground and the height, in metres.
/// The error is a message for a person.
pub fn parse_size(text: &str) -> Result<[f64; 3], String> {
    let numbers = numbers::<3>(text)?;
    if numbers.iter().all(|&size| size > 0.0) {
        Ok(numbers)
    } else {
        Err("a size must be positive".to_owned())
    }
}

/// Returns the sizes along x, y and z of a box, given its two sizes on the ground, in the order of the axes,
/// and its height.
pub fn on_axes([width, depth, height]: [f64; 3], up: Vec3) -> DVec3 {
    match up.abs().max_position() {
        0 => DVec3::new(height, width, depth),
        1 => DVec3::new(width, height, depth),
        _ => DVec3::new(width, depth, height),
    }
}

/// Reads N finite numbers separated by commas. The error is a message for a person.
pub fn numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let read = |part: &str| {
        let number = part.trim().parse::<f64>().map_err(|error| format!("{part}: {error}"))?;
        if number.is_finite() { Ok(number) } else { Err(format!("{part} is not finite")) }
    };
    let numbers = text.split(',').map(read).collect::<Result<Vec<_>, _>>()?;
    numbers.try_into().map_err(|_| format!("{N} numbers are needed, separated by commas"))
}

/// Makes the viewcell of a rotated box. `up` is the scene's up axis.
pub fn viewcell(given: &TurnedBox, up: Vec3) -> Viewcell {
    let TurnedBox { min, max, degrees } = *given;
    if degrees == 0.0 {
        return Viewcell::from_box(min, max);
    }
    let (middle, half) = ((min + max) * 0.5, (max - min) * 0.5);
    let turn = DQuat::from_axis_angle(up.as_dvec3(), degrees.to_radians());
    let axes = DVec3::AXES.map(|axis| turn * axis);
    let reach = (0..3).map(|i| axes[i].abs() * half[i]).sum::<DVec3>();
    let is_level = |i: &usize| up[*i].abs() < 0.5;
    let sides = (0..3).filter(is_level).flat_map(|i| {
        [axes[i], -axes[i]].map(|outwards| Plane::through(middle + outwards * half[i], -outwards))
    });
    Viewcell { planes: sides.collect(), ..Viewcell::from_box(middle - reach, middle + reach) }
}

/// Makes up to `count` viewcells around eyes spread evenly along the walks of a scene, no two equal. `size`
/// is two sizes on the ground and the height. Each side of a viewcell moves outwards from the eye until the
/// viewcell has its full size or would touch an opaque object, so that it stays in its room or street. An eye
/// that touches an opaque object gives no viewcell. In place of it, and of an eye of an equal viewcell where
/// walks meet, an eye between the others is taken.
pub fn along_walks(world: &World, count: usize, size: [f64; 3]) -> Vec<Viewcell> {
    let size = on_axes(size, world.source.up);
    // Takes every second of twice as many frames as cells, and so skips the first frame, because the ends of
    // walks are often at walls.
    let all: Vec<Frame> = frames(&world.source.walks, count.saturating_mul(2));
    let mut cells: Vec<Viewcell> = Vec::new();
    for frame in all.iter().skip(1).step_by(2).chain(all.iter().step_by(2)) {
        if cells.len() < count
            && let Some(cell) = grown(world, frame.camera.eye, size)
            && !cells.contains(&cell)
        {
            cells.push(cell);
        }
    }
    cells
}

fn grown(world: &World, eye: DVec3, size: DVec3) -> Option<Viewcell> {
    let (mut min, mut max) = (eye - size * SEED, eye + size * SEED);
    let mut found = Vec::new();
    if !is_free(world, min, max, &mut found) {
        return None;
    }
    let step = size * ((0.5 - SEED) / f64::from(STEPS));
    let mut stopped = [false; 6];
    for _ in 0..STEPS {
        for (side, stopped) in stopped.iter_mut().enumerate() {
            let (axis, mut to_min, mut to_max) = (side % 3, min, max);
            if side < 3 {
                to_min[axis] -= step[axis]
            } else {
                to_max[axis] += step[axis]
            }
            if !*stopped && is_free(world, to_min, to_max, &mut found) {
                (min, max) = (to_min, to_max);
            } else {
                *stopped = true;
            }
        }
    }
    Some(Viewcell::from_box(min, max))
}

/// Returns whether a box in world space touches no triangle of an opaque object. Doors are ignored.
fn is_free(world: &World, min: DVec3, max: DVec3, found: &mut Vec<ObjectId>) -> bool {
    let origin = world.origin();
    SceneQuery::new(&world.scene).in_box(&Aabb::from_world(min, max, origin), found);
    let (center, half) = ((min + max) * 0.5 - origin, (max - min) * 0.5);
    found.iter().map(|id| &world.source.objects[id.index()]).all(|object| {
        !object.opaque || object.door || object.triangles.iter().all(|t| !touches(&t, center, half))
    })
}

/// Returns whether a triangle touches a box, by separating axes (Akenine-Moller, "Fast 3D Triangle-Box
/// Overlap Testing", 2001).
fn touches(triangle: &[Vec3; 3], center: DVec3, half: DVec3) -> bool {
    let p = triangle.map(|p| p.as_dvec3() - center);
    let edges = [p[1] - p[0], p[2] - p[1], p[0] - p[2]];
    let crosses = edges.iter().flat_map(|edge| DVec3::AXES.map(|axis| edge.cross(axis)));
    let axes = DVec3::AXES.into_iter().chain([edges[0].cross(edges[1])]).chain(crosses);
    axes.into_iter().all(|axis| {
        let along = p.map(|p| p.dot(axis));
        let (least, most) = (along[0].min(along[1]).min(along[2]), along[0].max(along[1]).max(along[2]));
        let reach = half.dot(axis.abs());
        least <= reach && most >= -reach
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_and_sizes_are_read_or_refused() {
        let (min, max) = (DVec3::new(0.0, 1.0, 2.0), DVec3::new(3.0, 4.0, 5.0));
        assert_eq!(parse("0,1, 2,3,4,5"), Ok(TurnedBox { min, max, degrees: 0.0 }), "a box");
        assert_eq!(parse("0,1,2,3,4,5@-30.5"), Ok(TurnedBox { min, max, degrees: -30.5 }), "a turned box");
        let wrong =
            ["", "1,2,3", "0,0,0,1,1,nan", "0,0,0,1,1,-1", "a,0,0,1,1,1", "0,0,0,1,1,1@", "0,0,0,1,1,1@inf"];
        for wrong in wrong {
            assert!(parse(wrong).is_err(), "{wrong}");
        }
        assert!(parse_size("1,2,3").is_ok() && parse_size("1,2,0").is_err(), "a size, and one with a 0");
    }

    #[test]
    fn a_turned_viewcell_is_the_box_turned_seen_from_above() {
        // A box of 10 by 2 by 2 m, and the same box with y up.
        for (text, up) in [("1,4,0,11,6,2@30", Vec3::Z), ("4,0,1,6,2,11@30", Vec3::Y)] {
            let cell = viewcell(&parse(text).unwrap(), up);
            // Axes along and across the box. A rotation from the first to the second is counter-clockwise
            // seen from above.
            let [along, across] = if up == Vec3::Z { [DVec3::X, DVec3::Y] } else { [DVec3::Z, DVec3::X] };
            let middle = along * 6.0 + across * 5.0 + up.as_dvec3();
            let (sin, cos) = 30f64.to_radians().sin_cos();
            let at = |x: f64, y: f64, z: f64| {
                let [x, y] = [x * cos - y * sin, x * sin + y * cos];
                middle + along * x + across * y + up.as_dvec3() * z
            };
            for [x, y, z] in [[4.99, 0.99, 0.99], [-4.99, 0.99, -0.99], [4.99, -0.99, 0.0], [0.0; 3]] {
                assert!(cell.contains(at(x, y, z)), "{text}: {x} {y} {z}");
            }
            for [x, y, z] in [[5.01, 0.0, 0.0], [-5.01, 0.9, 0.0], [0.0, 1.01, 0.0], [0.0, 0.0, 1.01]] {
                assert!(!cell.contains(at(x, y, z)), "{text}: {x} {y} {z}");
            }
        }
    }

    #[test]
    fn viewcells_differ_where_walks_meet() {
        let mut source = crate::built_in("london:3,3").unwrap();
        source.walks = vec![source.walks[0].clone(); 2];
        let cells = along_walks(&crate::region::world(source), 6, [4.0, 4.0, 2.0]);
        assert_eq!(cells.len(), 6, "as many as were asked for, along two equal walks");
        for (number, cell) in cells.iter().enumerate() {
            assert!(!cells[..number].contains(cell), "viewcell {number} is there already");
        }
    }

    #[test]
    fn triangles_touch_boxes() {
        let triangle = [Vec3::new(2.0, 0.0, 0.0), Vec3::new(0.0, 2.0, 0.0), Vec3::new(0.0, 0.0, 2.0)];
        assert!(touches(&triangle, DVec3::ZERO, DVec3::splat(0.7)), "a triangle that touches a box");
        assert!(!touches(&triangle, DVec3::ZERO, DVec3::splat(0.6)), "a triangle just beyond a box");
    }
}
