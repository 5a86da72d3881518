//! Random polygons for tests of trees.
#![allow(dead_code)]

use visibility_core::glam::DVec3;
use visibility_testing::Random;

/// Returns a random point with whole coordinates up to `reach`, so that polygons touch, coincide and lie in
/// common planes.
pub(crate) fn grid_point(random: &mut Random, reach: f64) -> DVec3 {
    random.fine_vector(reach).round()
}

/// Returns `count` polygons that a tree accepts: triangles that cross each other, and rectangles on a grid
/// that touch and coincide.
pub(crate) fn polygons(random: &mut Random, count: usize) -> Vec<Vec<DVec3>> {
    let mut polygons = Vec::new();
    while polygons.len() < count {
        let polygon = match random.below(4) {
            0 => (0..3).map(|_| random.fine_vector(8.0)).collect(),
            1 => (0..3).map(|_| grid_point(random, 8.0)).collect(),
            2 => {
                let center = random.fine_vector(8.0);
                (0..3).map(|_| center + random.fine_vector(2.0)).collect()
            }
            _ => {
                let (corner, size) = (grid_point(random, 8.0), grid_point(random, 5.0));
                let axis = random.below(3);
                let [u, v] = [DVec3::AXES[(axis + 1) % 3], DVec3::AXES[(axis + 2) % 3]];
                let [u, v] = [u * size.dot(u), v * size.dot(v)];
                vec![corner, corner + u, corner + u + v, corner + v]
            }
        };
        if visibility_bsp::BspTree::accepts(&polygon) {
            polygons.push(polygon);
        }
    }
    polygons
}

/// Returns the six faces of a box, in the box's own space, counter-clockwise as seen from outside.
pub(crate) fn box_faces(min: DVec3, max: DVec3) -> Vec<Vec<DVec3>> {
    let corner = |i: usize| {
        DVec3::new(
            if i & 1 == 0 { min.x } else { max.x },
            if i & 2 == 0 { min.y } else { max.y },
            if i & 4 == 0 { min.z } else { max.z },
        )
    };
    let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    faces.iter().map(|face| face.iter().map(|&i| corner(i)).collect()).collect()
}

/// Returns the parameter `t` at which the ray `eye + t direction` meets a convex polygon, if clearly inside
/// the polygon and in front of the eye. `None` otherwise, also for a ray nearly parallel to the plane.
pub(crate) fn hit(eye: DVec3, direction: DVec3, polygon: &[DVec3]) -> Option<f64> {
    let normal = (2..polygon.len())
        .map(|i| (polygon[i - 1] - polygon[0]).cross(polygon[i] - polygon[0]))
        .sum::<DVec3>()
        .try_normalize()?;
    let slope = normal.dot(direction);
    if slope.abs() < 1e-7 * direction.length() {
        return None;
    }
    let t = normal.dot(polygon[0] - eye) / slope;
    let p = eye + direction * t;
    let inside = (0..polygon.len()).all(|i| {
        let (a, b) = (polygon[i], polygon[(i + 1) % polygon.len()]);
        // A ray within a node's plane would run along the edges that the plane has cut.
        (b - a).cross(p - a).dot(normal) > 1e-7 * (b - a).length()
    });
    (t > 1e-9 && inside).then_some(t)
}
