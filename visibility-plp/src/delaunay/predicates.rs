//! Exact predicates on integer points: side of a plane, inside or outside of a sphere.

/// Point on the fine grid of the Delaunay tessellation: integer coordinates from 0 to 2^17.
pub(crate) type Point = [i32; 3];

/// Returns the exact difference `a - b`.
fn minus(a: Point, b: Point) -> [i64; 3] {
    [0, 1, 2].map(|i| i64::from(a[i]) - i64::from(b[i]))
}

/// Returns the determinant of the matrix with rows `a`, `b` and `c`. Exact if all sums of its products fit
/// into i64, which the caller ensures.
fn determinant(a: [i64; 3], b: [i64; 3], c: [i64; 3]) -> i64 {
    a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0])
        + a[2] * (b[0] * c[1] - b[1] * c[0])
}

/// Returns six times the signed volume of the tetrahedron with corners a, b, c and d, in cubic steps of the
/// fine grid: positive if a, b, c run anticlockwise seen from d, 0 if the tetrahedron is flat. Exact.
pub(crate) fn volume([a, b, c, d]: [Point; 4]) -> i64 {
    // Differences are at most 2^17, so all sums are less than 6 * 2^51.
    determinant(minus(b, a), minus(c, a), minus(d, a))
}

/// Number of units of a [`SubPoint`] per step of the fine grid: 2^32.
const SUB_STEPS: f64 = 4_294_967_296.0;

/// Point between the points of the fine grid: coordinates in units of 2^-32 of its steps.
pub(crate) type SubPoint = [i64; 3];

/// Rounds a point, in steps of the fine grid, towards zero to a [`SubPoint`], by less than 2^-32 of a step
/// along each axis. Coordinates more than a step beyond the cube from 0 to 2^17 are moved to a step beyond
/// it. NaN counts as 0.
pub(crate) fn sub_point(point: [f64; 3]) -> SubPoint {
    let most = f64::from(1 << 17) + 1.0;
    point.map(|x| (x.clamp(-1.0, most) * SUB_STEPS) as i64)
}

/// For each corner of a cell, the other three corners, indices 0 to 3: anticlockwise seen from this corner.
pub(crate) const FACES: [[usize; 3]; 4] = [[1, 3, 2], [0, 2, 3], [0, 3, 1], [0, 1, 2]];

/// Tests exactly whether `p` lies strictly beyond a face of a cell. `corners` are the cell's corners, whose
/// [`volume`] must be positive; `face` is the index, 0 to 3, of the corner opposite of the face.
pub(crate) fn is_beyond(corners: [Point; 4], face: usize, p: SubPoint) -> bool {
    // With the corner at `face` replaced by p, the cell has the volume (b - a) x (c - a) . (p - a), where a,
    // b and c are the other corners in the order of `FACES`. The cross product is less than
    // 2^36 and p - a less than 2^50, so each of the three products is less than 2^86.
    let [a, b, c] = FACES[face].map(|i| corners[i]);
    let (u, v) = (minus(b, a), minus(c, a));
    let product = |i: usize| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        i128::from(u[j] * v[k] - u[k] * v[j]) * i128::from(p[i] - (i64::from(a[i]) << 32))
    };
    product(0) + product(1) + product(2) < 0
}

/// Tests whether `p` lies strictly inside the circumsphere of the tetrahedron with corners a, b, c and d,
/// whose [`volume`] must be positive. False on the sphere. Exact, as points are integers from 0 to 2^17.
pub(crate) fn is_in_sphere([a, b, c, d]: [Point; 4], p: Point) -> bool {
    let [a, b, c, d] = [a, b, c, d].map(|q| minus(q, p));
    // Squares are less than 2^36 and the determinants of three rows less than 2^54. Exact products need 128
    // bits, which are slow, so an f64 filter comes first.
    let square = |q: [i64; 3]| q[0] * q[0] + q[1] * q[1] + q[2] * q[2];
    let squares = [a, b, c, d].map(square);
    let minors = [determinant(b, c, d), -determinant(a, c, d), determinant(a, b, d), -determinant(a, b, c)];
    let terms = [0, 1, 2, 3].map(|i| squares[i] as f64 * minors[i] as f64);
    let sum = terms[0] + terms[1] + terms[2] + terms[3];
    // Each term is rounded at most three times and each sum once, by 2^-53. Eight roundings bound the
    // relative error, and 1e-14 is about ninety roundings.
    let size: f64 = terms.iter().map(|term| term.abs()).sum();
    if sum.abs() > 1e-14 * size {
        return sum > 0.0;
    }
    (0..4).map(|i| i128::from(squares[i]) * i128::from(minors[i])).sum::<i128>() > 0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_exact::{Random, RandomExact, cross, dot, minus as difference};

    const CORNER: [Point; 4] = [[0, 0, 0], [8, 0, 0], [0, 8, 0], [0, 0, 8]];

    #[test]
    fn sides_and_spheres_are_told_exactly() {
        assert_eq!(volume(CORNER), 512, "six times the volume, counterclockwise");
        assert_eq!(
            volume([CORNER[1], CORNER[0], CORNER[2], CORNER[3]]),
            -512,
            "six times the volume, clockwise"
        );
        // The sphere goes through all corners of the cube.
        assert!(!is_in_sphere(CORNER, [8, 8, 8]), "a corner of the cube on the sphere");
        assert!(!is_in_sphere(CORNER, [8, 8, 0]), "another corner on the sphere");
        assert!(is_in_sphere(CORNER, [7, 8, 8]), "a point just within the sphere");
        assert!(is_in_sphere(CORNER, [4, 4, 4]), "the middle of the sphere");
        assert!(!is_in_sphere(CORNER, [9, 8, 8]), "a point just beyond the sphere");
        // The largest coordinates, one step off the sphere.
        let n = 1 << 17;
        let large = [[0, 0, 0], [n, 0, 0], [0, n, 0], [0, 0, n]];
        assert!(
            !is_in_sphere(large, [n, n, n]) && is_in_sphere(large, [n, n, n - 1]),
            "the largest coordinates, on the sphere and one step within"
        );
    }

    /// Points in the plane of a face of a cell, and one unit beside the plane.
    #[test]
    fn points_in_a_face_are_told_from_points_beyond_it() {
        let mut random = Random(42);
        let mut told = 0;
        for round in 0..20_000 {
            // Coordinates from 0 to 2^17, all magnitudes of cells.
            let size = 1 << (2 + round % 15);
            let middle = random.integers((1 << 16) - size + 1);
            let corner = |by: [i64; 3]| [0, 1, 2].map(|i| ((1 << 16) + middle[i] + by[i]) as i32);
            let mut solid = [(); 4].map(|()| corner(random.integers(size)));
            if volume(solid) <= 0 {
                solid.swap(0, 1);
            }
            if volume(solid) == 0 {
                continue;
            }
            let face = round % 4;
            let [a, b, c] = [1, 2, 3].map(|i| solid[(face + i) % 4].map(i64::from));
            // The face's corner a moved along both of its edges from there, by multiples of 2^-32 of them.
            let (s, t) = (random.whole(1 << 32), random.whole(1 << 32));
            let inside = [0, 1, 2].map(|i| (a[i] << 32) + s * (b[i] - a[i]) + t * (c[i] - a[i]));
            assert!(!is_beyond(solid, face, inside), "{solid:?} {face} {inside:?}");
            let normal = cross(difference(b, a), difference(c, a));
            let opposite = difference(solid[face].map(i64::from), a);
            let outwards = -dot(normal, opposite).signum();
            for axis in 0..3 {
                for step in [-1, 1] {
                    let mut beside = inside;
                    beside[axis] += step;
                    let is_outside = normal[axis] * i128::from(step) * outwards > 0;
                    assert_eq!(is_beyond(solid, face, beside), is_outside, "{solid:?} {face} {beside:?}");
                    told += u32::from(is_outside);
                }
            }
        }
        assert!(told > 50_000, "{told}");
    }

    /// Points are rounded by less than a unit, and points outside of the cube stay outside.
    #[test]
    fn points_keep_their_place_in_the_cube() {
        let unit = 1.0 / SUB_STEPS;
        assert_eq!(sub_point([0.0, unit, 1.5]), [0, 1, 3 << 31], "multiples of a unit are exact");
        assert_eq!(sub_point([131_072.0 - unit; 3]), [(1 << 49) - 1; 3], "the last unit in the cube");
        let outside = sub_point([-unit, 1e300, f64::NEG_INFINITY]);
        assert_eq!(outside, [-1, (1 << 49) + (1 << 32), -1 << 32], "points outside of the cube");
    }

    /// Points on one sphere and one step off it. Points of a sphere are made by permuting three coordinate
    /// differences from its centre and changing their signs.
    #[test]
    fn points_on_a_sphere_are_told_from_points_beside_it() {
        let mut random = Random(41);
        let mut told = 0;
        for _ in 0..20_000 {
            let [x, y, z] = random.integers(1 << 15).map(|x| x as i32);
            let mut point = || {
                let order = [[x, y, z], [y, z, x], [z, x, y], [x, z, y], [z, y, x], [y, x, z]];
                let picked = order[random.whole(6).unsigned_abs() as usize % 6];
                picked.map(|x| if random.whole(2) < 0 { 65_536 - x } else { 65_536 + x })
            };
            let (mut solid, p) = ([(); 4].map(|()| point()), point());
            if volume(solid) == 0 || p[0] == 65_536 {
                continue;
            }
            if volume(solid) < 0 {
                solid.swap(0, 1);
            }
            let inwards = (65_536 - p[0]).signum();
            assert!(!is_in_sphere(solid, p), "{solid:?} {p:?}");
            assert!(is_in_sphere(solid, [p[0] + inwards, p[1], p[2]]), "{solid:?} {p:?}");
            assert!(!is_in_sphere(solid, [p[0] - inwards, p[1], p[2]]), "{solid:?} {p:?}");
            told += 1;
        }
        assert!(told > 10_000, "{told}");
    }
}
