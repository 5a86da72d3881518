//! Convex solids, and meshes of one or two triangles, made into shapes: one outline, one bound on depth per plane.
//!
//! Sound for any mesh (see [`shape`](crate::shape)); for those that are not convex it finds only the pixels from which all of the outline
//! is seen, so they go another way. Unlike boxes, these may cross the near plane: triangles are cut there, and the cuts bound the shape.

use crate::cuboid::{Made, extent, lower, pixels};
use crate::lens::{Lens, Placed};
use crate::shape::{Coverage, Shape};
use alloc::vec::Vec;
use visibility_core::glam::Vec3;
use visibility_core::{Edge, OccluderMesh};

/// Memory that is used again from occluder to occluder.
#[derive(Clone, Debug, Default)]
pub(crate) struct Scratch {
    pub(crate) corners: Vec<[f64; 5]>,
    /// For each triangle, whether it is drawn.
    pub(crate) drawn: Vec<bool>,
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

/// Makes the shape of a mesh. `Made::Near` says that it has too many edges or planes.
pub(crate) fn make(
    mesh: &Parts,
    placed: &Placed,
    lens: &Lens,
    facing: f64,
    coverage: Coverage,
    scratch: &mut Scratch,
    shape: &mut Shape,
) -> Made {
    let Scratch { corners, drawn } = scratch;
    corners.clear();
    corners.extend(mesh.positions.iter().map(|p| placed.at(p.to_array().map(f64::from))));
    // Beyond this, a point is surely beyond the near plane, by a margin that dwarfs rounding of the cuts.
    let beyond = 1024.0 * placed.error[4];
    let nearest = corners.iter().fold(f64::INFINITY, |least, c| least.min(c[4]));
    let whole = nearest > beyond;

    // Where it is on the screen, and how far.
    let mut around = [
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::INFINITY,
        f64::NEG_INFINITY,
    ];
    let mut known = whole;
    for c in corners.iter() {
        match extent(&[c[0]], &[c[1]], &[c[2]], &[c[3]], placed) {
            Some(one) => {
                for axis in 0..3 {
                    around[2 * axis] = around[2 * axis].min(one[2 * axis]);
                    around[2 * axis + 1] = around[2 * axis + 1].max(one[2 * axis + 1]);
                }
            }
            None => known = false,
        }
    }
    let (columns, lines) = if known {
        match pixels(&around, lens) {
            Some(limits) => limits,
            None => return Made::Nothing,
        }
    } else {
        ([0.0, lens.size[0]], [0.0, lens.size[1]])
    };
    let floor = match (known, lens.perspective) {
        (true, _) => around[4],
        // Nearness is 1/w, and no point has a greater w than the farthest corner.
        (false, true) => {
            let farthest = corners.iter().fold(0.0, |most: f64, c| most.max(c[2]));
            (1.0 - 4.0 * f64::EPSILON) / (farthest + placed.error[2])
        }
        (false, false) => f64::NEG_INFINITY,
    };
    shape.begin(columns, lines, floor, if known { around[5] } else { f64::INFINITY });

    // One sense of facing after the other, for two-sided meshes seen from within.
    for facing in [facing, -facing] {
        if choose(mesh, corners, drawn, facing, beyond, placed.determinant_error()) {
            return outline(mesh, corners, drawn, placed, lens, facing, coverage, beyond, shape);
        }
        if !mesh.two_sided {
            break;
        }
    }
    Made::Nothing
}

/// Decides which triangles are drawn: those surely seen from the front, and not all before the near plane. Whether there is any.
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
pub(crate) fn cut(a: &[f64; 5], b: &[f64; 5], beyond: f64) -> [f64; 5] {
    let (a, b) = if a[4] < b[4] { (a, b) } else { (b, a) };
    let share = (beyond - a[4]) / (b[4] - a[4]);
    core::array::from_fn(|i| a[i] * (1.0 - share) + b[i] * share)
}

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
        let line = cross(a, b).map(|v| v * facing);
        shape.keep([line[0], line[1], line[2] - products], lens.size, coverage)
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
        let plane = if lens.perspective {
            normal.map(|a| a / height)
        } else {
            let (p, q) = (cross(point(&third), point(t[0])), cross(point(t[0]), point(&second)));
            core::array::from_fn(|i| (t[0][3] * normal[i] + second[3] * p[i] + third[3] * q[i]) / height)
        };
        if !shape.bound(lower(plane, height, placed, lens, certain, products), lens.size) {
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
