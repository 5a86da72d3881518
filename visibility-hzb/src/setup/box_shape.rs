//! The screen shape of a box, the commonest occluder, in code without loops over triangles.
//!
//! From any point outside a box at most three faces are seen, and the set of seen faces determines the
//! outline (Schmalstieg and Tobler, "Fast Projected Area Computation for Three-Dimensional Bounding Boxes",
//! 1999). The outlines are in a table that is built when the crate is compiled.

use super::depth_plane::lower;
use super::screen_bounds::{extent, pixels};
use super::screen_projection::{ScreenProjection, project_object};
use super::screen_shape::{ScreenExtent, ScreenShape, ShapeResult};
use crate::coverage::Coverage;
use crate::vector::{cross, dot};
use visibility_core::Aabb;
use visibility_core::glam::Affine3A;

/// Corner indices of each face, counter-clockwise from outside. Faces are in the order least x, greatest x,
/// least y, greatest y, least z, greatest z. Bits 0, 1 and 2 of a corner's index select the greatest x, y and
/// z.
const FACES: [[u8; 4]; 6] =
    [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];

/// Outline of a box: its edges between a seen and an unseen face. Each edge has the direction that it has in
/// the seen face, counter-clockwise from outside.
#[derive(Clone, Copy)]
struct Outline {
    /// Corner indices of the start and end of each edge. The first `count` edges are in use.
    edges: [[u8; 2]; 6],
    /// Number of edges of the outline: 4 or 6. 0 for a set of faces that cannot be seen together, or no face.
    count: u8,
}

/// Outline for each set of seen faces, where bit i of the index stands for face i of [`FACES`]. Empty for no
/// seen face and for sets with two opposite faces.
static OUTLINES: [Outline; 64] = outlines();

/// Builds [`OUTLINES`].
const fn outlines() -> [Outline; 64] {
    let mut all = [Outline { edges: [[0; 2]; 6], count: 0 }; 64];
    let mut seen = 0;
    while seen < 64 {
        let opposites = seen & (seen >> 1) & 0b010101 != 0;
        let mut index = 0;
        while index < 24 && !opposites {
            let [a, b] = directed_edge(index);
            if seen >> (index / 4) & 1 != 0 && !has_edge(seen, [b, a]) {
                let outline = &mut all[seen];
                outline.edges[outline.count as usize] = [a, b];
                outline.count += 1;
            }
            index += 1;
        }
        seen += 1;
    }
    all
}

/// Returns the corner indices of the start and end of edge `index % 4` of face `index / 4` of [`FACES`].
const fn directed_edge(index: usize) -> [u8; 2] {
    let face = FACES[index / 4];
    [face[index % 4], face[(index + 1) % 4]]
}

/// Returns whether a face in the set `seen` has the directed edge from corner `a` to corner `b`. Bit i of
/// `seen` stands for face i of [`FACES`].
const fn has_edge(seen: usize, [a, b]: [u8; 2]) -> bool {
    let mut index = 0;
    while index < 24 {
        let [start, end] = directed_edge(index);
        if seen >> (index / 4) & 1 != 0 && start == a && end == b {
            return true;
        }
        index += 1;
    }
    false
}

/// Replaces `shape` by the screen shape of a box. `bounds` are in the box's own coordinates, which
/// `transform` maps to the scene. `known` gives the screen bounds if they are known; then the caller
/// guarantees that the whole box is in front of the eye. Returns [`ShapeResult::DrawAsMesh`] if the box may
/// reach the near plane, and [`ShapeResult::Nothing`] if the transform is flat (its determinant may be 0),
/// the box is outside the buffer or no face is certainly seen.
#[inline(always)]
pub(crate) fn box_shape(
    bounds: &Aabb,
    transform: &Affine3A,
    projection: &ScreenProjection,
    known: Option<&ScreenExtent>,
    coverage: Coverage,
    shape: &mut ScreenShape,
) -> ShapeResult {
    let Some((object, facing)) = project_object(projection, bounds, transform) else {
        return ShapeResult::Nothing;
    };
    let (min, max) = (bounds.min.to_array().map(f64::from), bounds.max.to_array().map(f64::from));
    // The projection is linear before the division by w, so every corner is the first corner plus a subset of
    // three steps.
    let base = object.at(min);
    let mut steps = [[0.0; 5]; 3];
    for axis in 0..3 {
        for i in 0..5 {
            steps[axis][i] = object.linear[axis][i] * (max[axis] - min[axis]);
        }
    }
    // Lower bound on the near-plane distance of all corners: the first corner plus the negative parts of the
    // three steps.
    let mut nearest = base[4];
    for step in &steps {
        nearest += if step[4] < 0.0 { step[4] } else { 0.0 };
    }
    if !(nearest > object.error[4]) {
        return ShapeResult::DrawAsMesh;
    }
    let mut corners = [[0.0; 8]; 4];
    for i in 0..4 {
        for (corner, value) in corners[i].iter_mut().enumerate() {
            let mut sum = base[i];
            sum += if corner & 1 != 0 { steps[0][i] } else { 0.0 };
            sum += if corner & 2 != 0 { steps[1][i] } else { 0.0 };
            sum += if corner & 4 != 0 { steps[2][i] } else { 0.0 };
            *value = sum;
        }
    }
    let [x, y, w, n] = &corners;
    match known {
        Some(extent) => shape.begin_within(extent),
        None => {
            let Some(extent) = extent(x, y, w, n, &object) else { return ShapeResult::DrawAsMesh };
            let Some((columns, lines)) = pixels(&extent, projection) else { return ShapeResult::Nothing };
            shape.begin(columns, lines, extent[4], extent[5]);
        }
    }

    // Opposite faces share a normal: the cross product of the other two axes.
    let [u, v, t] = steps.map(|s| [s[0], s[1], s[2]]);
    let origin = [base[0], base[1], base[2]];
    let certain = object.determinant_error();
    let products = object.cross_error(projection.size);
    let mut seen = 0usize;
    for axis in 0..3 {
        // The eye certainly sees at most one of two opposite faces. The sign of the determinant tells on
        // which side of the face the eye is, if the determinant exceeds the error.
        let (second, third) = match axis {
            0 => (v, t),
            1 => (t, u),
            _ => (u, v),
        };
        let own = [u, v, t][axis];
        let normal = cross(second, third);
        let low = dot(normal, origin);
        let high = low + dot(normal, own);
        let (face, height) = if -low * facing > certain {
            (2 * axis, low)
        } else if high * facing > certain {
            (2 * axis + 1, high)
        } else {
            continue;
        };
        seen |= 1 << face;
        // The depth key on the face's plane as a linear function of the pixel. In a perspective view it is 1
        // / w.
        let over = 1.0 / height;
        let plane = if projection.perspective {
            [normal[0] * over, normal[1] * over, normal[2] * over]
        } else {
            // Cramer's rule: the plane a x + b y + c whose product with w equals n at a corner and along both
            // edges of the face.
            let (sn, tn) = match axis {
                0 => (steps[1][3], steps[2][3]),
                1 => (steps[2][3], steps[0][3]),
                _ => (steps[0][3], steps[1][3]),
            };
            let (mut corner, mut cn) = (origin, base[3]);
            if face % 2 == 1 {
                corner = core::array::from_fn(|i| origin[i] + own[i]);
                cn += steps[axis][3];
            }
            let (p, q) = (cross(third, corner), cross(corner, second));
            core::array::from_fn(|i| (cn * normal[i] + sn * p[i] + tn * q[i]) * over)
        };
        if !shape.add_depth_plane(lower(plane, over, &object, projection, certain, products), projection.size)
        {
            return ShapeResult::DrawAsMesh;
        }
    }
    // The seen faces determine which edges form the outline: an edge between a seen and an unseen face.
    let outline = &OUTLINES[seen];
    if outline.count == 0 {
        return ShapeResult::Nothing;
    }
    for edge in &outline.edges[..usize::from(outline.count)] {
        let [a, b] = edge.map(|i| {
            let i = usize::from(i % 8);
            [x[i], y[i], w[i]]
        });
        let line = cross(a, b).map(|v| v * facing);
        if !shape.add_edge([line[0], line[1], line[2] - products], projection.size, coverage) {
            return ShapeResult::DrawAsMesh;
        }
    }
    ShapeResult::Ready
}
