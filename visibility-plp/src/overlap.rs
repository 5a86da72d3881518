//! Overlap tests between shapes and cells by separating axes, conservative under rounding (Akenine-Möller,
//! "Fast 3D Triangle-Box Overlap Testing", 2001).

use crate::shape::Shape;
use visibility_core::glam::DVec3;

/// Tests whether a triangle and a box meet. `center` and `half` are the box's centre and half size; all
/// coordinates share one space. Conservative: false only if triangle and box are certainly disjoint. True if
/// they touch, and for a triangle of NaN corners.
pub(crate) fn triangle_meets_box(triangle: &[DVec3; 3], center: DVec3, half: DVec3) -> bool {
    let [a, b, c] = triangle.map(|p| p - center);
    // Coordinates come from f32 and the box from a grid in f64. Each subtraction rounds by 2^-53 of its
    // result, which is less than `size`. Each product and sum below rounds by 2^-53 of its own result. So
    // products of an edge and a point have errors of a dozen times 2^-53 times `size` squared. The normal of
    // two edges, the shorter of which may be all rounding, times a point has an error of as much times `size`
    // squared times the longest edge. 1e-12 is several hundred times that.
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
        // Both corners of the edge have the same product with the axis; `off` is the third corner.
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
    // A triangle of NaN corners also meets the box, since every comparison above was false.
    true
}

/// Tests whether a shape and a cube meet. `center` and `half` are the cube's centre and half its side, in the
/// shape's coordinates. Conservative: false only if shape and cube are certainly disjoint. True if they
/// touch. False for a box with NaN coordinates.
pub(crate) fn shape_meets_cube(shape: &Shape, center: DVec3, half: f64) -> bool {
    match shape {
        Shape::Triangle(triangle) => triangle_meets_box(triangle, center, DVec3::splat(half)),
        Shape::Solid(min, max) => {
            // Faces of the grid are rounded by a few times 2^-53 of the grid's size, which is at most 2^11
            // times `half`, and of `center`. This margin leaves no gap between two cubes of the grid.
            let reach = DVec3::splat(half * (1.0 + 1e-12)) + center.abs() * 1e-12;
            min.cmple(center + reach).all() && max.cmpge(center - reach).all()
        }
    }
}

/// Tests whether a solid box contains a cube, with a distance between their surfaces far above rounding.
/// `center` and `half` are the cube's centre and half its side, in the shape's coordinates. False for
/// triangles, touching surfaces and NaN.
pub(crate) fn shape_contains_cube(shape: &Shape, center: DVec3, half: f64) -> bool {
    match shape {
        Shape::Triangle(_) => false,
        Shape::Solid(min, max) => {
            let reach = DVec3::splat(half * (1.0 + 1e-6)) + center.abs() * 1e-12;
            min.cmplt(center - reach).all() && max.cmpgt(center + reach).all()
        }
    }
}

/// Tetrahedron with the planes of its faces, in steps of the Delaunay tessellation's fine grid, which has
/// 2^17 steps per side of its cube.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tetrahedron {
    /// Vertices of the tetrahedron, in steps of the fine grid.
    corners: [DVec3; 4],
    /// Outward unit normals of the faces; face i is opposite of corner i. Zero for a face without area.
    normals: [DVec3; 4],
    /// Offset of each face's plane in steps of the fine grid: the dot product of its normal and any point of
    /// the plane.
    offsets: [f64; 4],
}

impl Tetrahedron {
    /// Computes the face planes from four corners in any order, in steps of the fine grid.
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

    /// Returns the minimum and maximum corner of the tetrahedron's bounding box, in steps of the fine grid.
    fn ends(&self) -> (DVec3, DVec3) {
        let [a, b, c, d] = self.corners;
        (a.min(b).min(c.min(d)), a.max(b).max(c.max(d)))
    }

    /// Returns the centre of the tetrahedron's bounding box, in steps of the fine grid.
    pub(crate) fn center(&self) -> DVec3 {
        let (min, max) = self.ends();
        (min + max) * 0.5
    }

    /// Returns half the size of the tetrahedron's bounding box along each axis, in steps of the fine grid.
    pub(crate) fn half(&self) -> DVec3 {
        let (min, max) = self.ends();
        (max - min) * 0.5
    }

    /// Tests whether a point, in steps of the fine grid, lies inside the tetrahedron or at most [`HAIR`] (a
    /// thousandth of a step) outside. False for NaN.
    pub(crate) fn contains(&self, p: DVec3) -> bool {
        self.normals.iter().zip(&self.offsets).all(|(normal, offset)| normal.dot(p) - offset <= HAIR)
    }

    /// Returns the fraction of its bounding box's cross-section that the tetrahedron's silhouette fills,
    /// along x, y and z.
    pub(crate) fn filled(&self) -> [f64; 3] {
        let [a, b, c, d] = self.corners;
        let (size, area) = (self.half() * 2.0, |p: DVec3, q: DVec3, r: DVec3| (q - p).cross(r - p).abs());
        // The near faces have the same silhouette as the far faces, and a cross product is twice a triangle's
        // area.
        let shown = (area(a, b, c) + area(a, b, d) + area(a, c, d) + area(b, c, d)) * 0.25;
        [shown.x / (size.y * size.z), shown.y / (size.z * size.x), shown.z / (size.x * size.y)]
    }
}

/// Tolerance of tests against a tetrahedron, in steps of the fine grid: far above rounding, which is 2^-35 of
/// a step, and far below the size of any cell.
const HAIR: f64 = 1e-3;

/// Tests whether a shape and a tetrahedron meet, both in steps of the fine grid. Conservative: false only if
/// they are certainly disjoint; true if they touch. Two convex bodies are disjoint only if they are separated
/// along a normal of one of them, or along a direction perpendicular to an edge of each (Gottschalk,
/// "Separating axis theorem", 1996).
pub(crate) fn shape_meets_tetrahedron(shape: &Shape, solid: &Tetrahedron) -> bool {
    let points = shape.corners();
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
        // The tolerance along the axis, which also covers the rounding of products of coordinates up to 2^17
        // with the axis.
        let slack = HAIR * axis.abs().element_sum();
        a > d + slack || b < c - slack
    };
    let [a, b, c, d] = solid.corners;
    let edges = [b - a, c - a, d - a, c - b, d - b, d - c];
    match shape {
        Shape::Triangle([p, q, r]) => {
            let sides = [*q - *p, *r - *q, *p - *r];
            !apart(sides[0].cross(sides[1]).normalize_or_zero())
                && !sides
                    .iter()
                    .any(|side| edges.iter().any(|edge| apart(side.cross(*edge).normalize_or_zero())))
        }
        Shape::Solid(..) => {
            let axes = [DVec3::X, DVec3::Y, DVec3::Z];
            !axes.iter().any(|axis| edges.iter().any(|edge| apart(axis.cross(*edge).normalize_or_zero())))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::{Grid, STEPS};
    use crate::test_exact::{IntVector, Random, RandomExact, cross, dot, fine, minus, within};
    use alloc::vec::Vec;
    use visibility_core::Aabb;
    use visibility_core::glam::Vec3;

    /// Boxes and triangles that touch in exactly one point: a corner, edge or face of the box, and the
    /// inside, an edge or a corner of the triangle. They meet, and most no longer meet with the box one step
    /// away.
    #[test]
    fn what_touches_a_box_meets_it() {
        let mut random = Random(11);
        let mut apart = 0;
        for round in 0..100_000 {
            // Large and small triangles. With the largest coordinates, differences are rounded too.
            let shift = |random: &mut Random, most: i64| (random.whole(most).max(0)) as u32;
            let (a, size) = (random.integers(1 << 23), 23 - shift(&mut random, 22));
            let [b, mut c] = [(); 2].map(|()| {
                let along = random.integers(1 << size);
                [0, 1, 2].map(|i| a[i] + along[i])
            });
            if round % 2 == 0 {
                // A sliver whose normal's direction depends on the last digits.
                let beside = random.integers(4);
                c = [0, 1, 2].map(|i| a[i] + (b[i] - a[i]) / 2 + beside[i]);
            }
            let half: IntVector = [(); 3].map(|()| {
                let half = 1 + (random.whole(1 << 54).abs() >> shift(&mut random, 40));
                // The lowest bits are cleared that f64 cannot represent.
                half & !(half >> 53)
            });
            // `sides` is the direction from the point in which the box lies.
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
            let mut center: IntVector = [0, 1, 2].map(|i| point[i] + sides[i].signum() as i64 * half[i]);
            if let Some(axis) = inside {
                center[axis] += random.whole(half[axis]);
            }
            if center.iter().any(|x| x.abs() > 1 << 53) {
                continue;
            }
            let triangle = [a, b, c].map(|p| DVec3::from_array(p.map(|x| x as f64)));
            let meets = |center: IntVector| triangle_meets_box(&triangle, fine(center), fine(half));
            assert!(meets(center), "round {round}: {triangle:?}, {center:?}, {half:?}");
            apart += u32::from(!meets([0, 1, 2].map(|i| center[i] + ((sides[i].signum() as i64) << 30))));
        }
        assert!(apart > 40_000, "{apart}");
    }

    /// A tetrahedron with one corner in the plane of a triangle and the rest on one side: they meet. With the
    /// triangle moved away by a tenth of a step, most no longer meet.
    #[test]
    fn what_touches_a_tetrahedron_meets_it() {
        let mut random = Random(12);
        let (mut rounds, mut apart) = (0, 0);
        while rounds < 20_000 {
            let q = random.integers(1 << 16);
            let (u, v) = (random.integers(1 << 16), random.integers(1 << 16));
            let normal = cross(u, v);
            // The tetrahedron lies on either side of the triangle.
            let side = if rounds % 2 == 0 { 1 } else { -1 };
            let others = [(); 3].map(|()| {
                let w = random.integers(1 << 16);
                if dot(normal, w) * i128::from(side) < 0 { w.map(|x| -x) } else { w }
            });
            if dot(cross(others[0], others[1]), others[2]) == 0 || others.iter().any(|&w| dot(normal, w) == 0)
            {
                continue;
            }
            rounds += 1;
            // Corners of the triangle around the tetrahedron's corner q: q - s u - t v and so on, in
            // sixteenths.
            let (s, t) = (1 + random.whole(6).abs(), 1 + random.whole(6).abs());
            let at = |x: i64, y: i64| {
                DVec3::from_array([0, 1, 2].map(|i| q[i] as f64 + (x * u[i] + y * v[i]) as f64 / 16.0))
            };
            let triangle = [at(-s, -t), at(16 - s, -t), at(-s, 16 - t)];
            let corner = |w: IntVector| DVec3::from_array([0, 1, 2].map(|i| (q[i] + w[i]) as f64));
            let solid =
                Tetrahedron::new([corner([0; 3]), corner(others[0]), corner(others[1]), corner(others[2])]);
            assert!(shape_meets_tetrahedron(&Shape::Triangle(triangle), &solid), "{triangle:?} {solid:?}");
            let away = DVec3::from_array(normal.map(|x| x as f64)).normalize() * (0.1 * side as f64);
            apart +=
                u32::from(!shape_meets_tetrahedron(&Shape::Triangle(triangle.map(|p| p - away)), &solid));
        }
        assert!(apart > 19_000, "{apart}");
    }

    /// Returns whether some of a triangle is left after clipping it by half-spaces `normal . p <= offset`.
    fn is_left(triangle: &[DVec3; 3], half_spaces: &[(DVec3, f64)]) -> bool {
        let mut polygon = triangle.to_vec();
        for &(normal, offset) in half_spaces {
            let mut kept = Vec::new();
            for (i, &p) in polygon.iter().enumerate() {
                let q = polygon[(i + 1) % polygon.len()];
                let (a, b) = (normal.dot(p) - offset, normal.dot(q) - offset);
                if a <= 0.0 {
                    kept.push(p);
                }
                if (a < 0.0 && b > 0.0) || (a > 0.0 && b < 0.0) {
                    kept.push(p.lerp(q, a / (a - b)));
                }
            }
            polygon = kept;
        }
        !polygon.is_empty()
    }

    /// Returns the half-spaces of a box, moved outwards by `by`.
    fn box_sides(min: DVec3, max: DVec3, by: f64) -> Vec<(DVec3, f64)> {
        DVec3::AXES.iter().flat_map(|&n| [(n, n.dot(max) + by), (-n, by - n.dot(min))]).collect()
    }

    /// Returns the half-spaces of a tetrahedron, moved outwards by `by`.
    fn tetrahedron_sides(corners: &[DVec3; 4], by: f64) -> Vec<(DVec3, f64)> {
        let side = |face: usize| {
            let [a, b, c] = [1, 2, 3].map(|i| corners[(face + i) % 4]);
            let normal = (b - a).cross(c - a).normalize();
            let normal = if normal.dot(corners[face] - a) > 0.0 { -normal } else { normal };
            (normal, normal.dot(a) + by)
        };
        (0..4).map(side).collect()
    }

    /// Random triangles, boxes and tetrahedra: those that meet by clipping meet, and those that clipping
    /// finds apart by more than the tolerances are apart.
    #[test]
    fn overlaps_are_those_of_clipping() {
        let mut random = Random(23);
        let mut counts = [[0; 2]; 5];
        let mut told = |kind: usize, meets: bool, expected: [bool; 2], what: &dyn core::fmt::Debug| {
            // Clipped by what is a little smaller and a little larger.
            let [smaller, larger] = expected;
            if smaller || !larger {
                assert_eq!(meets, smaller, "kind {kind}: {what:?}");
                counts[kind][usize::from(meets)] += 1;
            }
        };
        for round in 0..40_000 {
            let size = [1.0, 4.0][round % 2];
            let mut point = |size: f64| DVec3::new(random.float(), random.float(), random.float()) * size;
            let (offset, half) = (point(6.0 * size), point(3.0).abs() + 0.1);
            let triangle = [(); 3].map(|()| offset + point(4.0 * size));
            let center = point(2.0);
            let clipped =
                [-0.01, 0.01].map(|by| is_left(&triangle, &box_sides(center - half, center + half, by)));
            told(0, triangle_meets_box(&triangle, center, half), clipped, &(triangle, center, half));
            let corners = [(); 4].map(|()| point(4.0));
            let solid = Tetrahedron::new(corners);
            if solid.normals.iter().zip(corners).any(|(n, p)| (n.dot(p) - n.dot(center)).abs() < 0.05) {
                continue;
            }
            let clipped = [-0.01, 0.01].map(|by| is_left(&triangle, &tetrahedron_sides(&corners, by)));
            let shape = Shape::Triangle(triangle);
            told(1, shape_meets_tetrahedron(&shape, &solid), clipped, &(triangle, corners));
            // A box meets a tetrahedron if a face of the one meets the other, or a corner is inside.
            let (min, max) = (offset - half, offset + half);
            let clipped = [-0.01, 0.01].map(|by| {
                let sides = box_sides(min, max, by);
                let inside = tetrahedron_sides(&corners, by).iter().all(|(n, at)| n.dot(offset) <= *at);
                let face = |face: usize| [1, 2, 3].map(|i| corners[(face + i) % 4]);
                inside || (0..4).any(|i| is_left(&face(i), &sides))
            });
            let shape = Shape::Solid(min, max);
            told(2, shape_meets_tetrahedron(&shape, &solid), clipped, &(min, max, corners));
            // Two boxes, of which one is a cube.
            let gap = ((center - offset).abs() - half - 2.0).max_element();
            let meets = shape_meets_cube(&shape, center, 2.0);
            told(3, meets, [gap < -0.01, gap < 0.01], &(min, max, center));
            let gap = ((center - offset).abs() - half + 0.3).max_element();
            let contains = shape_contains_cube(&shape, center, 0.3);
            told(4, contains, [gap < -0.01, gap < 0.01], &(min, max, center));
        }
        assert!(counts.as_flattened().iter().all(|&count| count > 100), "{counts:?}");
    }

    /// Flat boxes and triangles within one f32 step of the rounded face between two cells: at least one of
    /// the two cells meets them.
    #[test]
    fn nothing_falls_between_cells() {
        let mut random = Random(21);
        for round in 0..4000 {
            let size = random.direction().abs().as_vec3() * 100.0;
            // Half of the scenes lie around the origin, where f32 has numbers between those that f64 has
            // elsewhere.
            let far = if round % 2 == 0 { Vec3::ZERO } else { random.direction().as_vec3() * 1e4 };
            let grid = Grid::around(&Aabb::new(far - size, far + size));
            let side: u32 = 1 << (random.whole(4) + 4);
            let count = i64::from(STEPS / side);
            let mut voxel =
                [(); 3].map(|()| (1 + random.whole(count).unsigned_abs() as u32 % (STEPS / side - 1)) * side);
            let axis = round % 3;
            if round % 4 == 0 {
                voxel[axis] = STEPS / 2;
            }
            let cube = |voxel: [u32; 3]| {
                let half = f64::from(side) * 0.5 * grid.step;
                (grid.corner(voxel) + DVec3::splat(half), half)
            };
            let mut below = voxel;
            below[axis] -= side;
            let ((a, half), (b, _)) = (cube(voxel), cube(below));
            let face = grid.corner(voxel)[axis] as f32;
            for x in [face.next_down(), face, face.next_up(), 0.0, face * 0.5] {
                if (f64::from(x) - (a[axis] - half)).abs() > half {
                    continue;
                }
                let at = |u: f64, v: f64| {
                    let mut point = a;
                    (point[axis], point[(axis + 1) % 3]) = (x.into(), point[(axis + 1) % 3] + u * half);
                    point[(axis + 2) % 3] += v * half;
                    point
                };
                let (low, high) = (at(-0.5, -0.5), at(0.5, 0.5));
                for part in [Shape::Solid(low, high), Shape::Triangle([low, high, at(-0.5, 0.5)])] {
                    assert!(
                        shape_meets_cube(&part, a, half) || shape_meets_cube(&part, b, half),
                        "{part:?} {a} {b} {half}"
                    );
                }
            }
        }
    }

    /// Walls in the face between two cells, so far from the origin that the face is rounded by more than the
    /// margin relative to the cell's size: at least one of the two cells meets each wall. f32 has a number
    /// that close to a face only where the face's coordinate is an integer: every 25 grid steps from the
    /// middle, since the grid is 51/50 as wide as the scene.
    #[test]
    fn nothing_falls_between_cells_far_away() {
        let mut random = Random(22);
        let mut between = 0;
        for round in 0..20_000 {
            let (axis, sign) = (round % 3, if round % 2 == 0 { 1 } else { -1 });
            // Half the scene's side is `1024 * size`. Cells have `side` steps per side, and the wall is `25 *
            // steps` steps from the middle of the grid.
            let size = 1 + random.whole(8).abs();
            let side = 1 << random.whole(2).abs();
            let steps = side * random.whole(20 / side);
            // Just below a power of two, beyond which numbers are coarser: cells on the two sides are rounded
            // differently.
            let wall = (1 << (22 + random.whole(2))) - 1 - random.whole(8).abs();
            let mut middle = random.integers(1 << 20);
            middle[axis] = (wall - 51 * size * steps) * sign;
            let ends = [-1024 * size, 1024 * size].map(|by| middle.map(|x| (x + by) as f32));
            let grid = Grid::around(&Aabb::from_arrays(ends[0], ends[1]));
            let [mut upper, mut lower] = [[STEPS / 2; 3]; 2];
            upper[axis] = (i64::from(STEPS / 2) + 25 * steps * sign) as u32;
            lower[axis] = upper[axis] - side as u32;
            let half = side as f64 * 0.5 * grid.step;
            let [a, b] = [upper, lower].map(|voxel| grid.corner(voxel) + DVec3::splat(half));
            let wall_at = [[-0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]].map(|[u, v]| {
                let mut point = a;
                point[axis] = (wall * sign) as f64;
                point[(axis + 1) % 3] += u * half;
                point[(axis + 2) % 3] += v * half;
                point
            });
            for part in [Shape::Solid(wall_at[0], wall_at[1]), Shape::Triangle(wall_at)] {
                assert!(
                    shape_meets_cube(&part, a, half) || shape_meets_cube(&part, b, half),
                    "{part:?} {a} {b} {half}"
                );
            }
            // Counts walls for which a margin proportional to the half side alone would be too small.
            let (x, reach) = (wall_at[0][axis], half * (1.0 + 1e-12));
            between += u32::from(x < a[axis] - reach && x > b[axis] + reach);
        }
        assert!(between > 100, "{between}");
    }
}
