//! Whether triangles meet cells, by separating axes (Akenine-Möller, "Fast 3D Triangle-Box Overlap Testing", 2001).

use crate::parts::Part;
use visibility_core::glam::DVec3;

/// Whether a triangle meets a box, given by its centre and half its size. True where rounding could tell otherwise.
pub(crate) fn triangle_meets_box(triangle: &[DVec3; 3], center: DVec3, half: DVec3) -> bool {
    let [a, b, c] = triangle.map(|p| p - center);
    // Coordinates come from f32 and the box from a grid in f64: each subtraction rounds by 2^-53 of its result, each product and
    // sum below a few times more, of magnitudes no greater than `size` squared. 1e-12 is two thousand times as much as all of it.
    let size = a.abs().max(b.abs()).max(c.abs()).max(half).max_element() + center.abs().max_element();
    let slack = 1e-12 * size;
    let half = half + DVec3::splat(slack);
    let (least, most) = (a.min(b).min(c), a.max(b).max(c));
    if least.cmpgt(half).any() || most.cmplt(-half).any() {
        return false;
    }
    let edges = [b - a, c - b, a - c];
    let normal = edges[0].cross(edges[1]);
    let reach = normal.abs().dot(half) + slack * size;
    if normal.dot(a).abs() > reach {
        return false;
    }
    for (i, edge) in edges.iter().enumerate() {
        // The edge's third corner, and one of its own: their products are all that differ.
        let (on, off) = ([a, b, c][i], [c, a, b][i]);
        let e = edge.abs();
        let axes = [
            (DVec3::new(0.0, -edge.z, edge.y), e.z * half.y + e.y * half.z),
            (DVec3::new(edge.z, 0.0, -edge.x), e.z * half.x + e.x * half.z),
            (DVec3::new(-edge.y, edge.x, 0.0), e.y * half.x + e.x * half.y),
        ];
        for (axis, reach) in axes {
            let (p, q) = (axis.dot(on), axis.dot(off));
            let reach = reach + slack * size;
            if p.min(q) > reach || p.max(q) < -reach {
                return false;
            }
        }
    }
    // Also where something is NaN: every comparison above was false.
    true
}

/// A tetrahedron, made ready to be tested: planes with normals outwards.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tetrahedron {
    corners: [DVec3; 4],
    normals: [DVec3; 4],
    offsets: [f64; 4],
}

impl Tetrahedron {
    pub(crate) fn new(corners: [DVec3; 4]) -> Self {
        let (mut normals, mut offsets) = ([DVec3::ZERO; 4], [0.0; 4]);
        for face in 0..4 {
            let [a, b, c] = [1, 2, 3].map(|i| corners[(face + i) % 4]);
            let across = (b - a).cross(c - a).normalize_or_zero();
            normals[face] = if across.dot(corners[face] - a) > 0.0 { -across } else { across };
            offsets[face] = normals[face].dot(a);
        }
        Self { corners, normals, offsets }
    }

    fn ends(&self) -> (DVec3, DVec3) {
        let [a, b, c, d] = self.corners;
        (a.min(b).min(c.min(d)), a.max(b).max(c.max(d)))
    }

    /// The centre of the box around it.
    pub(crate) fn center(&self) -> DVec3 {
        let (min, max) = self.ends();
        (min + max) * 0.5
    }

    /// Half the size of that box.
    pub(crate) fn half(&self) -> DVec3 {
        let (min, max) = self.ends();
        (max - min) * 0.5
    }

    /// Whether a point lies in it, or a hair outside.
    pub(crate) fn contains(&self, p: DVec3) -> bool {
        self.normals.iter().zip(&self.offsets).all(|(normal, offset)| normal.dot(p) - offset <= HAIR)
    }

    /// The share of the box that it fills, seen along each axis.
    pub(crate) fn filled(&self) -> [f64; 3] {
        let [a, b, c, d] = self.corners;
        let (size, area) = (self.half() * 2.0, |p: DVec3, q: DVec3, r: DVec3| (q - p).cross(r - p).abs());
        // Each face counts half, and the near ones show the same as the far ones.
        let shown = (area(a, b, c) + area(a, b, d) + area(a, c, d) + area(b, c, d)) * 0.25;
        [shown.x / (size.y * size.z), shown.y / (size.z * size.x), shown.z / (size.x * size.y)]
    }
}

/// In steps of a grid of 2^17: far above rounding, which is 2^-35 of them, and far below the size of any cell.
const HAIR: f64 = 1e-3;

/// Whether a part of an object meets a tetrahedron. True where rounding could tell otherwise: two convex bodies are apart only if they are
/// so along a normal of either or along what is normal to an edge of each (Gottschalk, "Separating axis theorem", 1996).
pub(crate) fn part_meets(part: &Part, solid: &Tetrahedron) -> bool {
    let points = part.corners();
    let points = points.as_slice();
    let (min, max) = solid.ends();
    let (least, most) = points.iter().fold((points[0], points[0]), |(a, b), &p| (a.min(p), b.max(p)));
    if least.cmpgt(max + DVec3::splat(HAIR)).any() || most.cmplt(min - DVec3::splat(HAIR)).any() {
        return false;
    }
    let beyond = |(normal, offset): (&DVec3, &f64)| points.iter().all(|p| normal.dot(*p) - offset > HAIR);
    if solid.normals.iter().zip(&solid.offsets).any(beyond) {
        return false;
    }
    let apart = |axis: DVec3| {
        let range = |of: &[DVec3]| {
            let at = |p: &DVec3| axis.dot(*p);
            of.iter().map(at).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)))
        };
        let ((a, b), (c, d)) = (range(points), range(&solid.corners));
        // A hair along the axis, and what rounding does to products of 2^17 with it.
        let slack = HAIR * axis.abs().element_sum();
        a > d + slack || b < c - slack
    };
    let [a, b, c, d] = solid.corners;
    let edges = [b - a, c - a, d - a, c - b, d - b, d - c];
    match part {
        Part::Triangle([p, q, r]) => {
            let sides = [*q - *p, *r - *q, *p - *r];
            !apart(sides[0].cross(sides[1]).normalize_or_zero())
                && !sides
                    .iter()
                    .any(|side| edges.iter().any(|edge| apart(side.cross(*edge).normalize_or_zero())))
        }
        Part::Solid(..) => {
            let axes = [DVec3::X, DVec3::Y, DVec3::Z];
            !axes.iter().any(|axis| edges.iter().any(|edge| apart(axis.cross(*edge).normalize_or_zero())))
        }
    }
}
