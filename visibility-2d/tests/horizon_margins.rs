//! Tests of the horizon's margins: boxes that extend beyond an outline by less than rounding are visible, and
//! boxes that are inside by a few roundings are hidden, at all scales. Exact arithmetic judges.

use visibility_2d::horizon::{Horizon, UpAxis};
use visibility_core::glam::{Affine3A, DVec3};
use visibility_core::occlusion::Occlusion;
use visibility_core::{Aabb, OccluderMesh, OcclusionMap, Pose, View};
use visibility_testing::{Random, sign_of_sum};

/// A level wall across the x axis, seen from `eye`, and boxes behind it.
struct Case {
    eye: DVec3,
    wall: Aabb,
    horizon: Horizon,
}

/// Makes a wall of random size at a random scale, with faces perpendicular to the axes.
fn case(random: &mut Random, scale: f32, columns: usize) -> Case {
    // The eye is not representable in `f32`, so that differences from it are rounded.
    let exact = random.fine_vector(1.0) * f64::from(scale);
    let eye = exact.as_vec3();
    let x = eye.x + random.fine_range(2.0, 5.0) as f32 * scale;
    let y = eye.y - random.fine_range(0.3, 1.0) as f32 * scale;
    let y1 = eye.y + random.fine_range(0.1, 1.0) as f32 * scale;
    let z1 = eye.z + random.fine_range(-0.4, 0.8) as f32 * scale;
    let wall = Aabb::from_arrays([x, y, eye.z - scale], [x + scale * 0.1, y1, z1]);
    let eye = exact;
    let pose = Pose::look_at(eye, eye + DVec3::X, DVec3::Z);
    let view = View::perspective(pose, 1.5, 1.5, 1e-3 * f64::from(scale), f64::INFINITY).unwrap();
    let mut horizon = Horizon::new(UpAxis::Z).with_columns(columns);
    horizon.begin(&view, DVec3::ZERO);
    horizon.add(&OccluderMesh::cuboid(&wall).unwrap(), &Affine3A::IDENTITY);
    horizon.flush();
    Case { eye, wall, horizon }
}

/// Returns the exact sign of `(a - b) (c - d) - (e - f) (g - h)`.
fn sign([a, b, c, d, e, f, g, h]: [f64; 8]) -> i32 {
    sign_of_sum([(a, c), (-a, d), (-b, c), (b, d), (-e, g), (e, h), (f, g), (-f, h)])
}

const SCALES: [f32; 7] = [1e-12, 1e-6, 1e-3, 1.0, 1e3, 1e6, 1e12];

/// Returns `x` moved by `steps` steps of `f32`.
fn step(mut x: f32, steps: i32) -> f32 {
    for _ in 0..steps.abs() {
        x = if steps > 0 { x.next_up() } else { x.next_down() };
    }
    x
}

#[test]
fn a_box_that_shows_above_a_wall_by_less_than_rounding_is_visible() {
    let mut random = Random(3);
    let [mut close, mut hidden] = [0; 2];
    for round in 0..14_000 {
        let scale = SCALES[round % SCALES.len()];
        let Case { eye, wall, horizon } = case(&mut random, scale, 360);
        // The silhouette is the wall's near edge if the eye is below its top, else the far edge.
        let edge = if f64::from(wall.max.z) >= eye.z { wall.min.x } else { wall.max.x };
        let x = wall.max.x + random.fine_range(0.1, 3.0) as f32 * scale;
        let behind = (f64::from(x) - eye.x) / (f64::from(edge) - eye.x);
        let z = step((eye.z + (f64::from(wall.max.z) - eye.z) * behind) as f32, random.between(-3, 3));
        let middle = eye.y as f32;
        let bounds = Aabb::from_arrays([x, middle - 1e-3 * scale, z - 1e-3 * scale], [x, middle, z]);
        // The point z at distance x is above the line from the eye over the edge if (z - eye) (edge - eye) >
        // (top - eye) (x - eye).
        let top = f64::from(wall.max.z);
        let above = sign([z.into(), eye.z, edge.into(), eye.x, top, eye.z, x.into(), eye.x]) > 0;
        let is_hidden = horizon.test(&bounds) == Occlusion::Hidden;
        assert!(!(above && is_hidden), "round {round}: {bounds:?} above {wall:?} from {eye}");
        close += u32::from(above);
        // A box that is clearly below the line is hidden.
        let clear = 1e-5 * (f64::from(x) - eye.x) as f32 + 64.0 * f32::EPSILON * scale;
        let lower =
            Aabb::from_arrays([x, middle - 1e-3 * scale, z - clear - 1e-3 * scale], [x, middle, z - clear]);
        hidden += u32::from(horizon.test(&lower) == Occlusion::Hidden);
    }
    assert!(close > 3_500 && hidden > 13_500, "{close} boxes show, {hidden} are hidden");
}

#[test]
fn a_box_that_shows_beside_a_wall_by_less_than_rounding_is_visible() {
    let mut random = Random(4);
    let [mut close, mut hidden] = [0; 2];
    for round in 0..14_000 {
        let scale = SCALES[round % SCALES.len()];
        // A wall that ends next to the boundary of a column.
        let columns = 360;
        let Case { eye, mut wall, .. } = case(&mut random, scale, columns);
        let column = random.between(5, 30);
        let edge = eye.y + (f64::from(wall.min.x) - eye.x) * f64::from(column) / (columns as f64 / 2.0);
        wall.max.y = step(edge as f32, random.between(-2, 2));
        let pose = Pose::look_at(eye, eye + DVec3::X, DVec3::Z);
        let view = View::perspective(pose, 1.5, 1.5, 1e-3 * f64::from(scale), f64::INFINITY).unwrap();
        let mut horizon = Horizon::new(UpAxis::Z).with_columns(columns);
        horizon.begin(&view, DVec3::ZERO);
        horizon.add(&OccluderMesh::cuboid(&wall).unwrap(), &Affine3A::IDENTITY);
        let x = wall.max.x + random.fine_range(0.1, 3.0) as f32 * scale;
        let behind = (f64::from(x) - eye.x) / (f64::from(wall.min.x) - eye.x);
        let y = step((eye.y + (f64::from(wall.max.y) - eye.y) * behind) as f32, random.between(-3, 3));
        let z = eye.z as f32 - 0.9 * scale;
        let bounds = |y: f32| Aabb::from_arrays([x, y - 1e-4 * scale, z], [x, y, z]);
        let (edge, near) = (f64::from(wall.max.y), f64::from(wall.min.x));
        let beside = sign([y.into(), eye.y, near, eye.x, edge, eye.y, x.into(), eye.x]) > 0;
        let is_hidden = horizon.test(&bounds(y)) == Occlusion::Hidden;
        assert!(!(beside && is_hidden), "round {round}: {:?} beside {wall:?} from {eye}", bounds(y));
        close += u32::from(beside);
        // A box more than a column inside the wall's end is hidden, if the wall reaches low enough in the
        // picture.
        let inner = y - (2.0 / 180.0) * (f64::from(x) - eye.x) as f32;
        hidden += u32::from(horizon.test(&bounds(inner)) == Occlusion::Hidden);
    }
    assert!(close > 3_500 && hidden > 3_500, "{close} boxes show, {hidden} are hidden");
}

#[test]
fn a_box_before_a_wall_by_less_than_rounding_is_visible() {
    let mut random = Random(5);
    let [mut close, mut hidden] = [0; 2];
    for round in 0..14_000 {
        let scale = SCALES[round % SCALES.len()];
        let Case { eye, wall, horizon } = case(&mut random, scale, 90);
        if f64::from(wall.max.z) < eye.z + 0.1 * f64::from(scale) {
            continue;
        }
        let (y, z) = (eye.y as f32, eye.z as f32);
        let at = |x: f32| Aabb::from_arrays([x, y, z], [x + scale, y, z + 0.01 * scale]);
        let x = step(wall.min.x, -random.between(0, 3));
        assert_eq!(horizon.test(&at(x)), Occlusion::Partial, "round {round}: {x} before {wall:?} from {eye}");
        close += 1;
        hidden += u32::from(horizon.test(&at(wall.min.x + 1e-4 * scale)) == Occlusion::Hidden);
    }
    assert!(close > 4_000 && hidden * 10 > close * 9, "{close} boxes before, {hidden} hidden behind");
}
