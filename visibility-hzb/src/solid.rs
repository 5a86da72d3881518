//! Convex solids, and meshes of one or two triangles, made into shapes: one outline, one bound on depth per plane.
//!
//! Sound for any mesh (see [`shape`](crate::shape)); for those that are not convex it finds only the pixels from which all of the outline
//! is seen, so they go another way. Unlike boxes, these may cross the near plane: triangles are cut there, and the cuts bound the shape.

use crate::cuboid::{Made, lower, pixels};
use crate::lens::{Lens, Placed};
use crate::shape::{Coverage, Shape};
use alloc::vec::Vec;
use visibility_core::glam::Vec3;
use visibility_core::{Edge, OccluderMesh};

/// Memory that is used again from occluder to occluder.
#[derive(Clone, Debug, Default)]
pub(crate) struct Scratch {
    corners: Vec<[f64; 5]>,
    /// On the screen, with nearness.
    screen: Vec<[f64; 3]>,
    /// For each triangle, whether it is drawn.
    drawn: Vec<bool>,
}

/// What of a mesh is needed.
#[derive(Clone, Copy)]
pub(crate) struct Parts<'a> {
    pub(crate) positions: &'a [Vec3],
    pub(crate) triangles: &'a [[u32; 3]],
    pub(crate) edges: &'a [Edge],
    pub(crate) two_sided: bool,
}

impl<'a> Parts<'a> {
    pub(crate) fn of(mesh: &'a OccluderMesh) -> Self {
        Self {
            positions: mesh.positions(),
            triangles: mesh.triangles(),
            edges: mesh.edges(),
            two_sided: mesh.is_two_sided(),
        }
    }

    /// A box, by its corners.
    pub(crate) fn of_box(corners: &'a [Vec3; 8], two_sided: bool) -> Self {
        Self { positions: corners, triangles: &BOX_TRIANGLES, edges: &BOX_EDGES, two_sided }
    }
}

/// A triangle for each face and half: enough for its plane, and for what is drawn of it.
const BOX_TRIANGLES: [[u32; 3]; 12] = OccluderMesh::CUBOID;

static BOX_EDGES: [Edge; 18] = box_edges();

const fn box_edges() -> [Edge; 18] {
    let mut edges = [Edge { vertices: [0, 0], left: 0, right: None }; 18];
    let (mut count, mut triangle) = (0, 0);
    while triangle < 12 {
        let mut corner = 0;
        while corner < 3 {
            let (a, b) = (BOX_TRIANGLES[triangle][corner], BOX_TRIANGLES[triangle][(corner + 1) % 3]);
            let mut other = 0;
            while other < 12 {
                let mut i = 0;
                while i < 3 {
                    // Each edge once, from the triangle that comes first.
                    if BOX_TRIANGLES[other][i] == b
                        && BOX_TRIANGLES[other][(i + 1) % 3] == a
                        && triangle < other
                    {
                        edges[count] =
                            Edge { vertices: [a, b], left: triangle as u32, right: Some(other as u32) };
                        count += 1;
                    }
                    i += 1;
                }
                other += 1;
            }
            corner += 1;
        }
        triangle += 1;
    }
    edges
}

/// A point as its `x`, `y` and `w`.
pub(crate) type Point = [f64; 3];

#[inline(always)]
pub(crate) fn cross(a: Point, b: Point) -> Point {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[inline(always)]
pub(crate) fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
pub(crate) fn point(corner: &[f64; 5]) -> Point {
    [corner[0], corner[1], corner[2]]
}

#[inline(always)]
pub(crate) fn less(a: &[f64; 5], b: &[f64; 5]) -> [f64; 5] {
    let mut out = [0.0; 5];
    for i in 0..5 {
        out[i] = a[i] - b[i];
    }
    out
}

/// Makes the shape of a mesh. `Made::Near` says that it has too many edges or planes, or that it is not known to be `convex` and does not look
/// so either.
#[inline(always)]
#[expect(clippy::too_many_arguments)]
pub(crate) fn make(
    mesh: &Parts,
    placed: &Placed,
    lens: &Lens,
    facing: f64,
    coverage: Coverage,
    convex: bool,
    scratch: &mut Scratch,
    shape: &mut Shape,
) -> Made {
    let Scratch { corners, screen, drawn } = scratch;
    corners.clear();
    let beyond = placed.beyond();
    let mut nearest = f64::INFINITY;
    for p in mesh.positions {
        let corner = placed.at([f64::from(p.x), f64::from(p.y), f64::from(p.z)]);
        nearest = if corner[4] >= nearest { nearest } else { corner[4] };
        corners.push(corner);
    }
    let whole = nearest > beyond;

    // Where it is on the screen, and how far.
    let around = if whole { extent_of(corners, screen, placed) } else { None };
    let (columns, lines) = match &around {
        Some(around) => match pixels(around, lens) {
            Some(limits) => limits,
            None => return Made::Nothing,
        },
        None if !convex => return Made::Near,
        None => ([0.0, lens.size[0]], [0.0, lens.size[1]]),
    };
    let floor = match (&around, lens.perspective) {
        (Some(around), _) => around[4],
        // Nearness is 1/w, and no point has a greater w than the farthest corner.
        (None, true) => {
            let farthest = corners.iter().fold(0.0, |most: f64, c| most.max(c[2]));
            (1.0 - 4.0 * f64::EPSILON) / (farthest + placed.error[2])
        }
        (None, false) => f64::NEG_INFINITY,
    };
    shape.begin(columns, lines, floor, around.map_or(f64::INFINITY, |around| around[5]));

    // One sense of facing after the other, for two-sided meshes seen from within.
    for facing in [facing, -facing] {
        if choose(mesh, corners, drawn, facing, beyond, placed.determinant_error())
            && (convex || looks_convex(mesh, screen, drawn, facing))
        {
            return outline(mesh, corners, drawn, placed, lens, facing, coverage, beyond, shape);
        }
        if !mesh.two_sided {
            break;
        }
    }
    if convex { Made::Nothing } else { Made::Near }
}

/// As [`extent`](crate::cuboid::extent), for any number of corners, and where each is on the screen.
#[inline(always)]
fn extent_of(corners: &[[f64; 5]], screen: &mut Vec<[f64; 3]>, placed: &Placed) -> Option<[f64; 6]> {
    screen.clear();
    let [ex, ey, ew, en, _] = placed.error;
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    let mut least_w = f64::INFINITY;
    for c in corners {
        least_w = if c[2] < least_w { c[2] } else { least_w };
        let over = 1.0 / c[2];
        let at = [c[0] * over, c[1] * over, c[3] * over];
        for axis in 0..3 {
            low[axis] = if at[axis] < low[axis] { at[axis] } else { low[axis] };
            high[axis] = if at[axis] > high[axis] { at[axis] } else { high[axis] };
        }
        screen.push(at);
    }
    if !(least_w > 1024.0 * ew) {
        return None;
    }
    let mut out = [0.0; 6];
    for (axis, error) in [ex, ey, en].into_iter().enumerate() {
        let most = low[axis].abs().max(high[axis].abs());
        let margin = 2.0 * ((error + most * ew) / least_w + 2.0 * f64::EPSILON * most);
        out[2 * axis] = low[axis] - margin;
        out[2 * axis + 1] = high[axis] + margin;
    }
    Some(out)
}

/// Whether, from where the eye is, the drawn triangles show all that there is within their outline, and bulge towards the eye: then the outline
/// and their planes lose nothing. Only a guess at what pays, so rounding does no harm.
#[inline(always)]
fn looks_convex(mesh: &Parts, screen: &[[f64; 3]], drawn: &[bool], facing: f64) -> bool {
    // A tenth of a pixel, and a thousandth of the distance.
    const PIXELS: f64 = 0.1;
    const DEPTH: f64 = 1e-3;
    for edge in mesh.edges {
        let left = drawn[edge.left as usize];
        let right = edge.right.is_some_and(|t| drawn[t as usize]);
        if left == right {
            continue;
        }
        let [a, b] = edge.vertices.map(|i| &screen[i as usize]);
        let sign = if left { facing } else { -facing };
        let (dx, dy) = ((b[0] - a[0]) * sign, (b[1] - a[1]) * sign);
        let limit = -PIXELS * (dx.abs() + dy.abs());
        let mut inside = true;
        for p in screen {
            inside &= dx * (p[1] - a[1]) - dy * (p[0] - a[0]) >= limit;
        }
        if !inside {
            return false;
        }
    }
    for (i, t) in mesh.triangles.iter().enumerate() {
        if !drawn[i] {
            continue;
        }
        let [a, b, c] = t.map(|i| screen[i as usize]);
        let (u, v) = ([b[0] - a[0], b[1] - a[1], b[2] - a[2]], [c[0] - a[0], c[1] - a[1], c[2] - a[2]]);
        let normal = cross(u, v);
        let limit = DEPTH * normal[2].abs() * a[2].abs();
        let mut behind = true;
        for p in screen {
            behind &= dot(normal, [p[0] - a[0], p[1] - a[1], p[2] - a[2]]) * facing <= limit;
        }
        if !behind {
            return false;
        }
    }
    true
}

/// Decides which triangles are drawn: those surely seen from the front, and not all before the near plane. Whether there is any.
#[inline(always)]
fn choose(
    mesh: &Parts,
    corners: &[[f64; 5]],
    drawn: &mut Vec<bool>,
    facing: f64,
    beyond: f64,
    certain: f64,
) -> bool {
    drawn.clear();
    let mut any = false;
    for t in mesh.triangles {
        let [a, b, c] = t.map(|i| &corners[i as usize]);
        let height = dot(cross(point(&less(b, a)), point(&less(c, a))), point(a));
        let front = height * facing > certain && (a[4] > beyond || b[4] > beyond || c[4] > beyond);
        drawn.push(front);
        any |= front;
    }
    any
}

/// Where the side of a triangle crosses the limit beyond the near plane; the ends lie on different sides of it. Always counted from the
/// same end, so
/// that neighbours agree.
#[inline(always)]
pub(crate) fn cut(a: &[f64; 5], b: &[f64; 5], beyond: f64) -> [f64; 5] {
    let (a, b) = if a[4] < b[4] { (a, b) } else { (b, a) };
    let share = (beyond - a[4]) / (b[4] - a[4]);
    let mut out = [0.0; 5];
    for i in 0..5 {
        out[i] = a[i] * (1.0 - share) + b[i] * share;
    }
    out
}

#[inline(always)]
#[expect(clippy::too_many_arguments)]
fn outline(
    mesh: &Parts,
    corners: &[[f64; 5]],
    drawn: &[bool],
    placed: &Placed,
    lens: &Lens,
    facing: f64,
    coverage: Coverage,
    beyond: f64,
    shape: &mut Shape,
) -> Made {
    let products = placed.cross_error(lens.size);
    let certain = placed.determinant_error();
    let keep = |shape: &mut Shape, a: Point, b: Point| {
        let line = cross(a, b);
        shape.keep([line[0] * facing, line[1] * facing, line[2] * facing - products], lens.size, coverage)
    };
    for edge in mesh.edges {
        let left = drawn[edge.left as usize];
        let right = edge.right.is_some_and(|t| drawn[t as usize]);
        let [a, b] = edge.vertices.map(|i| point(&corners[i as usize]));
        // An edge wholly before the near plane bounds nothing that is drawn, but leaving it in loses little.
        let room = match (left, right) {
            (true, false) => keep(shape, a, b),
            (false, true) => keep(shape, b, a),
            _ => true,
        };
        if !room {
            return Made::Near;
        }
    }
    for (t, _) in mesh.triangles.iter().zip(drawn).filter(|(_, drawn)| **drawn) {
        let t = t.map(|i| &corners[i as usize]);
        // The normal, and the plane by Cramer's rule, as for boxes.
        let (second, third) = (less(t[1], t[0]), less(t[2], t[0]));
        let normal = cross(point(&second), point(&third));
        let height = dot(normal, point(t[0]));
        let over = 1.0 / height;
        let mut plane = [normal[0] * over, normal[1] * over, normal[2] * over];
        if !lens.perspective {
            let (p, q) = (cross(point(&third), point(t[0])), cross(point(t[0]), point(&second)));
            for i in 0..3 {
                plane[i] = (t[0][3] * normal[i] + second[3] * p[i] + third[3] * q[i]) * over;
            }
        }
        if !shape.bound(lower(plane, over, placed, lens, certain, products), lens.size) {
            return Made::Near;
        }
        // The cut at the near plane, as an edge of what is left of the triangle.
        let first = (0..3).find(|&i| t[i][4] > beyond && t[(i + 1) % 3][4] <= beyond);
        let second = (0..3).find(|&i| t[i][4] <= beyond && t[(i + 1) % 3][4] > beyond);
        if let (Some(i), Some(j)) = (first, second) {
            let a = point(&cut(t[i], t[(i + 1) % 3], beyond));
            let b = point(&cut(t[j], t[(j + 1) % 3], beyond));
            if !keep(shape, a, b) {
                return Made::Near;
            }
        }
    }
    Made::Shape
}
