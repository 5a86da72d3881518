//! Whether triangles meet cells, by separating axes (Akenine-Möller, "Fast 3D Triangle-Box Overlap Testing", 2001).

use crate::parts::Part;
use visibility_core::glam::DVec3;

/// Whether a triangle meets a box, given by its centre and half its size. True where rounding could tell otherwise.
pub(crate) fn triangle_meets_box(triangle: &[DVec3; 3], center: DVec3, half: DVec3) -> bool {
    let [a, b, c] = triangle.map(|p| p - center);
    // Coordinates come from f32 and the box from a grid in f64: each subtraction rounds by 2^-53 of its result, which is less than `size`, and
    // each product and sum below by as much of its own. So products of an edge and a point are known to a dozen times 2^-53 of `size` squared,
    // and the normal of two edges, the shortest of which may be all rounding, times a point to as much of `size` squared times the longest.
    // 1e-12 is several hundred times that.
    let size = a.abs().max(b.abs()).max(c.abs()).max(half).max_element() + center.abs().max_element();
    let slack = 1e-12 * size;
    let half = half + DVec3::splat(slack);
    let (least, most) = (a.min(b).min(c), a.max(b).max(c));
    if least.cmpgt(half).any() || most.cmplt(-half).any() {
        return false;
    }
    let edges = [b - a, c - b, a - c];
    let normal = edges[0].cross(edges[1]);
    let longest = edges[0].abs().max(edges[1].abs()).max_element();
    let reach = normal.abs().dot(half) + slack * size * longest;
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::whole::{Random, Whole, cross, dot, fine, minus, within};

    /// A corner, edge or face of a box and the inside, an edge or a corner of a triangle that touch each other and no more, exactly: they meet, and
    /// a step away they do not.
    #[test]
    fn what_touches_a_box_meets_it() {
        let mut random = Random(11);
        let mut apart = 0;
        for round in 0..100_000 {
            // Large and small ones: where the numbers are as large as they get, differences of them are rounded too.
            let shift = |random: &mut Random, most: i64| (random.whole(most).max(0)) as u32;
            let (a, size) = (random.vector(1 << 23), 23 - shift(&mut random, 22));
            let [b, mut c] = [(); 2].map(|()| {
                let along = random.vector(1 << size);
                [0, 1, 2].map(|i| a[i] + along[i])
            });
            if round % 2 == 0 {
                // A sliver: where its normal points depends on the last digits.
                let beside = random.vector(4);
                c = [0, 1, 2].map(|i| a[i] + (b[i] - a[i]) / 2 + beside[i]);
            }
            let half: Whole = [(); 3].map(|()| {
                let half = 1 + (random.whole(1 << 54).abs() >> shift(&mut random, 40));
                // As many digits as there are.
                half & !(half >> 53)
            });
            // Towards where the box lies from the point.
            let (point, mut sides, inside) = match round % 3 {
                0 => {
                    let (s, t) = (random.whole(1 << 29).abs(), random.whole(1 << 29).abs());
                    (within([a, b, c], s, t), cross(minus(b, a), minus(c, a)), None)
                }
                1 => {
                    let axis = round / 3 % 3;
                    let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
                    let (edge, mut sides) = (minus(b, a), [0; 3]);
                    (sides[i], sides[j]) = (-i128::from(edge[j]), i128::from(edge[i]));
                    let away = if dot(sides, minus(c, a)) > 0 { -1 } else { 1 };
                    let s = random.whole(1 << 29).abs();
                    (within([a, b, c], s, 0), sides.map(|x| x * away), Some(axis))
                }
                _ => {
                    let axis = round / 3 % 3;
                    let most = [a, b, c].into_iter().max_by_key(|p| p[axis]).unwrap_or(a);
                    (most.map(|x| x << 30), [0, 1, 2].map(|i| i128::from(i == axis)), None)
                }
            };
            if round % 3 == 0 && random.whole(2) < 0 {
                sides = sides.map(|x| -x);
            }
            let mut center: Whole = [0, 1, 2].map(|i| point[i] + sides[i].signum() as i64 * half[i]);
            if let Some(axis) = inside {
                center[axis] += random.whole(half[axis]);
            }
            if center.iter().any(|x| x.abs() > 1 << 53) {
                continue;
            }
            let triangle = [a, b, c].map(|p| DVec3::from_array(p.map(|x| x as f64)));
            let meets = |center: Whole| triangle_meets_box(&triangle, fine(center), fine(half));
            assert!(meets(center), "round {round}: {triangle:?}, {center:?}, {half:?}");
            apart += u32::from(!meets([0, 1, 2].map(|i| center[i] + ((sides[i].signum() as i64) << 30))));
        }
        assert!(apart > 40_000, "{apart}");
    }

    /// A corner of a tetrahedron in the plane of a triangle, and all of it on one side.
    #[test]
    fn what_touches_a_tetrahedron_meets_it() {
        let mut random = Random(12);
        let (mut rounds, mut apart) = (0, 0);
        while rounds < 20_000 {
            let q = random.vector(1 << 16);
            let (u, v) = (random.vector(1 << 16), random.vector(1 << 16));
            let normal = cross(u, v);
            let others = [(); 3].map(|()| {
                let w = random.vector(1 << 16);
                if dot(normal, w) < 0 { w.map(|x| -x) } else { w }
            });
            if dot(cross(others[0], others[1]), others[2]) == 0 || others.iter().any(|&w| dot(normal, w) == 0)
            {
                continue;
            }
            rounds += 1;
            // The triangle about the corner: q - s u - t v and so on, in sixteenths.
            let (s, t) = (1 + random.whole(6).abs(), 1 + random.whole(6).abs());
            let at = |x: i64, y: i64| {
                DVec3::from_array([0, 1, 2].map(|i| q[i] as f64 + (x * u[i] + y * v[i]) as f64 / 16.0))
            };
            let triangle = [at(-s, -t), at(16 - s, -t), at(-s, 16 - t)];
            let corner = |w: Whole| DVec3::from_array([0, 1, 2].map(|i| (q[i] + w[i]) as f64));
            let solid =
                Tetrahedron::new([corner([0; 3]), corner(others[0]), corner(others[1]), corner(others[2])]);
            assert!(part_meets(&Part::Triangle(triangle), &solid), "{triangle:?} {solid:?}");
            let away = DVec3::from_array(normal.map(|x| x as f64)).normalize() * 0.1;
            apart += u32::from(!part_meets(&Part::Triangle(triangle.map(|p| p - away)), &solid));
        }
        assert!(apart > 19_000, "{apart}");
    }
}
