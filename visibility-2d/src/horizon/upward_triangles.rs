//! The triangles of a scene that face up, and the sheets that they join to.

use super::extract::placed;
use super::frame::UpAxis;
use crate::cdt::predicates::{MAX_MAGNITUDE, MIN_MAGNITUDE, orient};
use alloc::vec;
use alloc::vec::Vec;
use visibility_core::geometry::keeps_orientation;
use visibility_core::glam::{Affine3A, DVec3, Vec3};
use visibility_core::union_find::root;
use visibility_core::{Aabb, ObjectId, Scene};

/// Maximum number of sheets (connected ground) of a scene. Each sheet adds to the time of a frame.
const MAX_SHEETS: usize = 4;

/// Least area of a sheet on the plan, as a fraction of the rectangle around all triangles of the scene that
/// face up. Smaller ones are left out: roofs and rocks.
const MIN_AREA: f64 = 1.0 / 64.0;

/// Triangle of a sheet: corners on the plan and in height in metres, counter-clockwise from above.
#[derive(Clone, Copy, Debug)]
pub(super) struct Triangle {
    /// For each corner, its two coordinates on the plan and its height, in metres from the scene's origin.
    pub(super) corners: [[f64; 3]; 3],
    /// For each corner, the number of its vertex. Corners of different triangles that join have the same
    /// number.
    pub(super) vertices: [u32; 3],
    /// Bound on the distance of a corner from the exact one, in metres.
    pub(super) error: f64,
    /// Index of the triangle's object in [`Terrain::objects`](super::terrain::Terrain::objects).
    pub(super) object: u32,
}

/// Object with triangles in a sheet.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GroundObject {
    pub(crate) id: ObjectId,
    /// Bounds of its occluder mesh in metres relative to the scene's origin, rounded outwards.
    pub(crate) bounds: Aabb,
}

/// Returns a point under a transform if the result is exact. `None` if it would be rounded.
fn placed_exactly(p: Vec3, transform: &Affine3A) -> Option<DVec3> {
    if *transform == Affine3A::IDENTITY {
        return Some(p.as_dvec3());
    }
    let m = transform.matrix3;
    let columns = [m.x_axis, m.y_axis, m.z_axis].map(|axis| Vec3::from(axis).as_dvec3());
    let at = Vec3::from(transform.translation).as_dvec3();
    let mut out = DVec3::ZERO;
    for axis in 0..3 {
        // Products of two numbers of `f32` are exact.
        let products = [0, 1, 2].map(|i| columns[i][axis] * f64::from(p[i]));
        let mut sum = at[axis];
        for term in products {
            let next = sum + term;
            // Rounding error of the addition (Knuth's two-sum). Not zero for NaN.
            let back = next - sum;
            let lost = (sum - (next - back)) + (term - back);
            if lost != 0.0 || !next.is_finite() {
                return None;
            }
            sum = next;
        }
        out[axis] = sum;
    }
    Some(out)
}

/// Key of a triangle corner. Corners with equal keys are one vertex. If the corner's position is exact: the
/// bits of its three coordinates, then 0. Otherwise: the number of the vertex in its mesh, two zeros, and the
/// number of the object plus 1.
type VertexKey = [u64; 4];

/// Returns the upward triangles of all occluders that are not convex, and the objects that they belong to.
/// Triangles of two-sided meshes are turned to face up.
pub(super) fn triangles_that_face_up(scene: &Scene, up: UpAxis) -> (Vec<GroundObject>, Vec<Triangle>) {
    let (mut objects, mut triangles) = (Vec::new(), Vec::<Triangle>::new());
    let mut keys: Vec<(VertexKey, u32)> = Vec::new();
    for id in scene.ids() {
        let Some((mesh, ref transform)) = scene.occluder(id) else { continue };
        if mesh.is_convex() {
            continue;
        }
        if !(mesh.is_two_sided() || keeps_orientation(transform) == Some(true)) {
            continue;
        }
        // Triangles join at vertices whose world coordinates are bit-identical. A key is these coordinates if
        // the transform is exact, or else the object's own vertex.
        let object = objects.len() as u32;
        let mut bounds = Aabb::EMPTY;
        let points: Vec<([f64; 3], VertexKey, f64)> = (0u32..)
            .zip(mesh.positions())
            .map(|(vertex, &p)| {
                if let Some(p) = placed_exactly(p, transform) {
                    let p = up.split(p).map(|x| x + 0.0);
                    let [x, y, z] = p.map(f64::to_bits);
                    return (p, [x, y, z, 0], 0.0);
                }
                let (p, size) = placed(p.as_dvec3(), transform);
                (up.split(p), [vertex.into(), 0, 0, u64::from(object) + 1], 8.0 * f64::EPSILON * size)
            })
            .collect();
        for t in mesh.triangles() {
            let mut t = t.map(|vertex| points[vertex as usize]);
            let is_fit = |x: &f64| *x == 0.0 || (MIN_MAGNITUDE..MAX_MAGNITUDE).contains(&x.abs());
            if !t.iter().all(|(p, ..)| p.iter().all(is_fit)) {
                continue;
            }
            let [a, b, c] = t.map(|(p, ..)| [p[0], p[1]]);
            // A triangle faces up if it is counter-clockwise on the plan.
            let area = orient(a, b, c);
            if area < 0.0 && mesh.is_two_sided() {
                t.swap(1, 2);
            } else if area.is_nan() || area <= 0.0 {
                continue;
            }
            let error = t.iter().fold(0.0f64, |most, (.., error)| most.max(*error));
            for (p, key, error) in t {
                keys.push((key, keys.len() as u32));
                let p = up.join(p);
                // Two roundings to `f32`: of the point, and of the amount added to it.
                let by = p.abs() * f64::from(f32::EPSILON) + error + f64::from(f32::MIN_POSITIVE);
                bounds.min = bounds.min.min((p - by).as_vec3());
                bounds.max = bounds.max.max((p + by).as_vec3());
            }
            triangles.push(Triangle { corners: t.map(|(p, ..)| p), vertices: [0; 3], error, object });
        }
        if bounds.min.x <= bounds.max.x {
            objects.push(GroundObject { id, bounds });
        }
    }
    // Corners with equal keys get the same vertex number.
    keys.sort_unstable();
    for (vertex, group) in (0u32..).zip(keys.chunk_by(|a, b| a.0 == b.0)) {
        for &(_, corner) in group {
            triangles[corner as usize / 3].vertices[corner as usize % 3] = vertex;
        }
    }
    (objects, triangles)
}

/// Sides of triangles at which a sheet ends, and those at which two triangles join.
pub(super) struct Borders {
    /// For each triangle, whether each of its sides (from corner `k` to corner `k + 1`) is a border: shared
    /// with no other triangle, or with several.
    pub(super) sides: Vec<[bool; 3]>,
    /// Indices of each two triangles that join at a side.
    pub(super) pairs: Vec<[u32; 2]>,
}

/// Joins triangles at the sides that exactly two of them share, in opposite directions. All other sides are
/// borders.
pub(super) fn join(triangles: &[Triangle]) -> Borders {
    let mut sides: Vec<([u32; 2], bool, u32)> = Vec::with_capacity(3 * triangles.len());
    for (i, t) in (0u32..).zip(triangles) {
        for side in 0..3 {
            let (a, b) = (t.vertices[side], t.vertices[(side + 1) % 3]);
            sides.push(([a.min(b), a.max(b)], a > b, 3 * i + side as u32));
        }
    }
    sides.sort_unstable();
    let mut borders = Borders { sides: vec![[true; 3]; triangles.len()], pairs: Vec::new() };
    for group in sides.chunk_by(|a, b| a.0 == b.0) {
        if let [(_, a, from), (_, b, to)] = *group
            && a != b
        {
            for side in [from, to] {
                borders.sides[side as usize / 3][side as usize % 3] = false;
            }
            borders.pairs.push([from / 3, to / 3]);
        }
    }
    borders
}

/// Returns the sheets (sets of joined triangles) with the largest areas on the plan, at most [`MAX_SHEETS`].
/// Each is given by the indices of its triangles. Sheets smaller than [`MIN_AREA`] are left out.
pub(super) fn largest(triangles: &[Triangle], borders: &Borders) -> Vec<Vec<u32>> {
    let mut parent: Vec<u32> = (0..triangles.len() as u32).collect();
    // Union-find: triangles with a common edge belong to one sheet, which is named by its least triangle.
    for &[a, b] in &borders.pairs {
        let (a, b) = (root(&mut parent, a), root(&mut parent, b));
        parent[a.max(b) as usize] = a.min(b);
    }
    let mut order: Vec<(u32, u32)> = (0..triangles.len() as u32).map(|i| (root(&mut parent, i), i)).collect();
    order.sort_unstable();
    // Twice the area on the plan. All triangles face up, so no parts cancel.
    let area = |group: &[(u32, u32)]| -> f64 {
        let of = |&(_, i): &(u32, u32)| {
            let [a, b, c] = triangles[i as usize].corners;
            (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        };
        group.iter().map(of).sum()
    };
    let mut sheets: Vec<(f64, &[(u32, u32)])> =
        order.chunk_by(|a, b| a.0 == b.0).map(|group| (area(group), group)).collect();
    sheets.sort_by(|a, b| b.0.total_cmp(&a.0));
    let (mut min, mut max) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for p in triangles.iter().flat_map(|t| t.corners) {
        for axis in 0..2 {
            (min[axis], max[axis]) = (min[axis].min(p[axis]), max[axis].max(p[axis]));
        }
    }
    // Sheets below this share of the scene's extent cost more than they hide.
    let least = MIN_AREA * (max[0] - min[0]) * (max[1] - min[1]);
    let is_large = |sheet: &&(f64, &[(u32, u32)])| sheet.0 >= least;
    sheets
        .iter()
        .take(MAX_SHEETS)
        .take_while(is_large)
        .map(|(_, group)| group.iter().map(|&(_, i)| i).collect())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::geometry::DoubleDouble;
    use visibility_core::glam::{Mat3, Quat};
    use visibility_core::{Object, OccluderMesh};
    use visibility_testing::Random;

    /// A scene of one mesh.
    fn scene(triangles: &[[Vec3; 3]], two_sided: bool, transform: Affine3A) -> Scene {
        let mut scene = Scene::new();
        let mesh = OccluderMesh::from_triangles(triangles).unwrap().with_two_sided(two_sided);
        let bounds = Aabb::new(Vec3::splat(-1e37), Vec3::splat(1e37));
        let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
        let mesh = scene.add_mesh(mesh);
        scene.set_mesh(id, mesh, transform).unwrap();
        scene
    }

    /// The determinant of the transform underflows at the least scales, and overflows at the greatest.
    #[test]
    fn fronts_are_those_of_the_transform_at_all_scales() {
        let axes = [[-4.0, 1.0, 0.0], [0.0, 2.0, 3.0], [-2.0, 1.0, 1.0]].map(Vec3::from_array);
        for scale in [-51, -40, 0, 20, 44, 60].map(|power| 2f32.powi(power)) {
            for (turn, expected) in [(1.0, 0), (-1.0, 1)] {
                let [x, y, z] = axes.map(|axis| axis * scale);
                let transform = Affine3A::from_mat3(Mat3::from_cols(x, y, z * turn));
                let corners = [Vec3::ZERO, Vec3::Y / scale, Vec3::X / scale];
                let found = triangles_that_face_up(&scene(&[corners], false, transform), UpAxis::Z).1.len();
                assert_eq!(found, expected, "the third axis turned by {turn}, scale {scale:e}");
            }
        }
    }

    /// Triangles that face up are found; those that face down only if they are two-sided, and then turned;
    /// upright ones never.
    #[test]
    fn triangles_are_found_if_a_side_that_hides_faces_up() {
        let [a, b, c] = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let upright = [a, b, Vec3::Z];
        let mirror = Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0));
        let down = Affine3A::from_quat(Quat::from_rotation_x(core::f32::consts::PI));
        let found = |triangle, two_sided, transform| {
            let triangles = triangles_that_face_up(&scene(&[triangle], two_sided, transform), UpAxis::Z).1;
            triangles.iter().for_each(|t| {
                let [a, b, c] = t.corners.map(|p| [p[0], p[1]]);
                assert!(orient(a, b, c) > 0.0, "{t:?} is counter-clockwise");
            });
            triangles.len()
        };
        for (name, triangle, transform, expected) in [
            ("up", [a, b, c], Affine3A::IDENTITY, [1, 1]),
            ("down", [a, c, b], Affine3A::IDENTITY, [0, 1]),
            ("up, turned over", [a, b, c], down, [0, 1]),
            ("down, turned over", [a, c, b], down, [1, 1]),
            ("mirrored", [a, b, c], mirror, [0, 1]),
            ("upright", upright, Affine3A::IDENTITY, [0, 0]),
            ("flattened", [a, b, c], Affine3A::from_scale(Vec3::new(1.0, 1.0, 0.0)), [0, 1]),
        ] {
            let counts = [false, true].map(|two_sided| found(triangle, two_sided, transform));
            assert_eq!(counts, expected, "{name}, one-sided and two-sided");
        }
        // Coordinates below those that the predicates decide.
        for (scale, expected) in [(1e-15, 1), (1e-25, 0)] {
            let tiny = Affine3A::from_scale(Vec3::splat(scale));
            assert_eq!(found([a, b, c].map(|p| p * 1e-20), true, tiny), expected, "scaled by {scale}");
        }
    }

    /// Positions are exact, or within the error of their triangle, and within the bounds of their object.
    #[test]
    fn corners_are_within_the_error_and_the_bounds() {
        let mut random = Random(1);
        let (mut exact, mut rounded) = (0, 0);
        for trial in 0..3_000 {
            let columns = [0; 3].map(|_| random.vec3(-2.0, 2.0));
            let far = [1e-3, 1e5][trial % 2];
            let matrix = if trial % 3 == 0 {
                Mat3::IDENTITY
            } else {
                Mat3::from_cols_array_2d(&columns.map(Into::into))
            };
            let columns = [matrix.x_axis, matrix.y_axis, matrix.z_axis];
            let transform = Affine3A::from_mat3_translation(matrix, random.vec3(-far, far));
            let points = [0; 3].map(|_| random.vec3(-9.0, 9.0));
            let (objects, triangles) = triangles_that_face_up(&scene(&[points], true, transform), UpAxis::Z);
            let Some(t) = triangles.first() else { continue };
            for p in points {
                let at = [0, 1, 2].map(|k| {
                    let [x, y, z] =
                        [0, 1, 2].map(|i| DoubleDouble::product(columns[i][k].into(), p[i].into()));
                    x.plus(y).plus(z).plus(f64::from(transform.translation[k]).into())
                });
                let off = |corner: &[f64; 3]| {
                    let off = [0, 1, 2].map(|k| at[k].plus((-corner[k]).into()).hi);
                    off.iter().map(|x| x * x).sum::<f64>().sqrt()
                };
                let least = t.corners.iter().map(off).fold(f64::INFINITY, f64::min);
                assert!(least <= t.error, "trial {trial}: off by {least}, not {}", t.error);
                (exact, rounded) = (exact + usize::from(t.error == 0.0), rounded + usize::from(least > 0.0));
                let bounds = objects[0].bounds;
                for (k, at) in at.iter().enumerate() {
                    let [min, max] =
                        [bounds.min[k], bounds.max[k]].map(|x| at.plus((-f64::from(x)).into()).hi);
                    assert!(min >= 0.0 && max <= 0.0, "trial {trial}: {p} in {bounds:?}");
                }
            }
        }
        assert!(exact > 500 && rounded > 1_000, "{exact} exact corners, {rounded} rounded ones");
    }

    /// A sum that rounds is not exact, whichever of its terms it loses.
    #[test]
    fn positions_are_exact_if_no_sum_rounds() {
        let at =
            |scale: f32, by: f32| Affine3A::from_mat3_translation(Mat3::IDENTITY * scale, Vec3::splat(by));
        let p = Vec3::new(1.0, 2.0, 3.0);
        assert_eq!(placed_exactly(p, &Affine3A::IDENTITY), Some(p.as_dvec3()), "the identity");
        assert_eq!(placed_exactly(p, &at(2.0, 8.0)), Some(DVec3::new(10.0, 12.0, 14.0)), "whole numbers");
        assert_eq!(placed_exactly(p, &at(1e-20, 1.0)), None, "tiny numbers are lost");
        assert_eq!(placed_exactly(p, &at(f32::INFINITY, 1.0)), None, "an infinite scale");
        assert_eq!(placed_exactly(Vec3::new(f32::NAN, 0.0, 0.0), &at(2.0, 8.0)), None, "no number");
    }

    /// Triangles join at a side that exactly two of them have, in opposite directions.
    #[test]
    fn triangles_join_at_sides_that_two_of_them_have() {
        let triangle =
            |vertices: [u32; 3]| Triangle { corners: [[0.0; 3]; 3], vertices, error: 0.0, object: 0 };
        let joined = |all: &[[u32; 3]]| {
            let triangles: Vec<Triangle> = all.iter().map(|&vertices| triangle(vertices)).collect();
            let borders = join(&triangles);
            (borders.pairs, borders.sides)
        };
        let open = [true; 3];
        assert_eq!(
            joined(&[[0, 1, 2], [2, 1, 3]]),
            (vec![[0, 1]], vec![[true, false, true], [false, true, true]]),
            "two"
        );
        assert_eq!(joined(&[[0, 1, 2], [1, 2, 3]]), (vec![], vec![open; 2]), "two in one direction");
        let three = [[0, 1, 2], [2, 1, 3], [2, 1, 4]];
        assert_eq!(joined(&three), (vec![], vec![open; 3]), "three at one side");
        assert_eq!(joined(&[[0, 1, 2], [3, 4, 5]]), (vec![], vec![open; 2]), "two apart");
    }

    /// The largest sheets are those of joined triangles with the greatest areas, if these are not small.
    #[test]
    fn the_largest_sheets_come_first_and_small_ones_are_left_out() {
        let square = |x: f64, side: f64, first: u32| {
            let at = |u: f64, v: f64| [x + u * side, v * side, 0.0];
            let corners =
                [[at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0)], [at(0.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)]];
            let vertices = [[0, 1, 2], [0, 2, 3]].map(|t| t.map(|v: u32| v + first));
            [0, 1].map(|i| Triangle { corners: corners[i], vertices: vertices[i], error: 0.0, object: 0 })
        };
        let sheets = |sides: &[f64]| {
            let squares =
                sides.iter().enumerate().map(|(i, &side)| square(20.0 * i as f64, side, 4 * i as u32));
            let triangles: Vec<Triangle> = squares.flatten().collect();
            largest(&triangles, &join(&triangles))
        };
        assert_eq!(sheets(&[8.0, 10.0]), [vec![2, 3], vec![0, 1]], "the greater one first");
        // The rectangle around all is 30 by 10 metres.
        assert_eq!(sheets(&[1.5, 10.0]), [vec![2, 3]], "a small one of 2.25 square metres");
        assert_eq!(sheets(&[2.3, 10.0]).len(), 2, "one of more than a 64th");
        assert_eq!(sheets(&[9.0; 6]).len(), 4, "at most four");
    }
}
