//! An exact oracle on a grid, in integers: whether a segment touches a triangle or a box.
//!
//! Coordinates are multiples of 2^-12 metres and at most 64 metres. In grid units, differences are below
//! 2^20, and a determinant of three of them is below 6 * 2^60: all fits into `i64`.

use visibility_core::glam::{DVec3, Vec3};
use visibility_core::pvs::Viewcell;
use visibility_testing::Random;

/// Grid units per metre.
pub const FINE: f64 = 4096.0;

/// A point in grid units.
pub type Point = [i64; 3];

/// Returns a point of the grid. Panics if `v` is not on the grid, or beyond 64 metres.
pub fn on_grid(v: DVec3) -> Point {
    (v * FINE).to_array().map(|x| {
        assert!(x.fract() == 0.0 && x.abs() <= 64.0 * FINE, "{v} is off the grid");
        x as i64
    })
}

/// Returns the nearest point of the grid.
pub fn rounded(v: DVec3) -> DVec3 {
    (v * FINE).round() / FINE
}

/// Returns a random start on the grid of a segment that ends at `q`: inside a viewcell's box, in a face of it
/// or at a corner. With `edge_of`, the segment passes an edge of that triangle at a distance of 3 micrometres
/// to 0.3 metres, and the start may be outside of the box.
pub fn start_of_segment(random: &mut Random, cell: &Viewcell, q: DVec3, edge_of: Option<[Vec3; 3]>) -> DVec3 {
    let at = |random: &mut Random, axis: usize| match random.below(4) {
        0 => cell.min[axis],
        1 => cell.max[axis],
        _ => random.fine_range(cell.min[axis], cell.max[axis]),
    };
    let Some(t) = edge_of else { return rounded(DVec3::from_array(core::array::from_fn(|k| at(random, k)))) };
    let t = t.map(Vec3::as_dvec3);
    let side = random.below(3);
    let beside = random.direction() * 10f64.powf(random.fine_range(-5.5, -0.5));
    let edge = t[side] + (t[(side + 1) % 3] - t[side]) * random.fine_unit() + beside;
    let x = at(random, 0);
    rounded(q + (edge - q) * ((x - q.x) / (edge.x - q.x)))
}

pub fn triangle_on_grid(t: &[Vec3; 3]) -> [Point; 3] {
    t.map(|v| on_grid(v.as_dvec3()))
}

fn difference(a: Point, b: Point) -> Point {
    core::array::from_fn(|k| a[k] - b[k])
}

fn cross(u: Point, v: Point) -> Point {
    [(1, 2), (2, 0), (0, 1)].map(|(i, j)| u[i] * v[j] - u[j] * v[i])
}

fn dot(u: Point, v: Point) -> i64 {
    (0..3).map(|k| u[k] * v[k]).sum()
}

/// Returns the sign of det(b - a, c - a, d - a), exactly.
fn orientation(a: Point, b: Point, c: Point, d: Point) -> i64 {
    dot(difference(b, a), cross(difference(c, a), difference(d, a))).signum()
}

/// Returns whether the closed segment from p to q and a closed triangle do not touch. Also false for any
/// segment in the triangle's plane, even one beside the triangle.
pub fn misses_triangle(p: Point, q: Point, t: &[Point; 3]) -> bool {
    let (from, to) = (orientation(t[0], t[1], t[2], p), orientation(t[0], t[1], t[2], q));
    if from * to > 0 {
        return true;
    }
    let sides = [(0, 1), (1, 2), (2, 0)].map(|(i, j)| orientation(p, q, t[i], t[j]));
    (from, to) != (0, 0) && sides.contains(&1) && sides.contains(&-1)
}

/// Returns whether the closed segment from p to q and a closed box do not touch. They do not if an axis of
/// the box, or the cross product of the segment and an axis, separates them.
pub fn misses_box(p: Point, q: Point, min: Point, max: Point) -> bool {
    let axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
    let across = axes.map(|axis| cross(difference(q, p), axis));
    axes.into_iter().chain(across).any(|axis| {
        let corner = |i: usize| core::array::from_fn(|k| if i >> k & 1 == 1 { max[k] } else { min[k] });
        let range = |points: &mut dyn Iterator<Item = Point>| {
            points.map(|x| dot(axis, x)).fold((i64::MAX, i64::MIN), |(a, b), h| (a.min(h), b.max(h)))
        };
        let ((a, b), (c, d)) = (range(&mut [p, q].into_iter()), range(&mut (0..8).map(corner)));
        b < c || d < a
    })
}
