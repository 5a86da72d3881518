//! Tests which side of a triangle faces every point of a viewcell.

use visibility_core::glam::DVec3;

/// Returns 1 if the front of a triangle faces all points of a box, and -1 if its back does. Returns 0 if the
/// plane of the triangle cuts the box or nearly does: such a triangle never occludes, since each of its sides
/// faces some viewpoint.
///
/// `center` and `half` describe the box, in the coordinates of the corners. Each corner is in error by up to
/// `error`. `mirrored` tells that these coordinates are left-handed, so that fronts run clockwise.
#[inline]
pub(crate) fn facing([a, b, c]: [DVec3; 3], center: DVec3, half: DVec3, error: f64, mirrored: bool) -> i8 {
    let (e, f, to) = (b - a, c - a, center - a);
    let normal = e.cross(f);
    // The height of the box's centre over the plane must exceed the heights of the box's corners over the
    // centre. Both are sums of products of e, f and `to`, each of which errs by 2 `error`. `size` bounds e
    // and f, so the products err by less than 16 `error` times the sizes of the other factors. Products and
    // sums round by less than 16 EPSILON of their sizes.
    let size = e.abs().max(f.abs()).element_sum();
    let distance = to.abs().element_sum() + half.element_sum();
    let margin = size * (size + distance) * (16.0 * error) + size * size * (distance * (16.0 * f64::EPSILON));
    let (height, reach) = (normal.dot(to), normal.abs().dot(half) + margin);
    let side = i8::from(height > reach) - i8::from(height < -reach);
    if mirrored { -side } else { side }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_testing::Random;

    /// Six times the volume of the tetrahedron of a triangle and a point: positive in front of the triangle.
    fn height(triangle: [[i128; 3]; 3], at: [i128; 3]) -> i128 {
        let from = |p: [i128; 3]| [0, 1, 2].map(|k| p[k] - triangle[0][k]);
        let [e, f, to] = [from(triangle[1]), from(triangle[2]), from(at)];
        (0..3).map(|k| (e[(k + 1) % 3] * f[(k + 2) % 3] - e[(k + 2) % 3] * f[(k + 1) % 3]) * to[k]).sum()
    }

    /// A box that a triangle is said to face is on that side of all of its exact planes: corners may be off
    /// by an error, which is large here, and rounding decides where it is 0. Compared in integers.
    #[test]
    fn a_triangle_faces_the_whole_box_wherever_its_corners_are() {
        let mut random = Random(1);
        let mut counts = [0; 4];
        for trial in 0..60_000 {
            let large = trial % 2 == 0;
            let mut number = |most: i64| i128::from((random.bits() >> 10) as i64 % (2 * most + 1) - most);
            let most = if large { 1 << 16 } else { 1 << 33 };
            let mut vector = |most: i64| [0; 3].map(|_| number(most));
            let (a, e, f) = (vector(most), vector(most), vector(most));
            let plus = |p: [i128; 3], q: [i128; 3], by: i128| [0, 1, 2].map(|k| p[k] + by * q[k]);
            let triangle = [a, plus(a, e, 1), plus(a, f, 1)];
            // The middle of the box is near the plane of the triangle, or in it.
            let [i, j, error] = [vector(4)[0], vector(4)[0], if large { vector(64)[0].abs() } else { 0 }];
            let middle = plus(
                plus(plus(a, e, i), f, j),
                vector(if large { 1 << 11 } else { (trial % 4) as i64 / 2 }),
                1,
            );
            let half = if large { vector(1 << 9).map(i128::abs) } else { [0; 3] };
            let float = |p: [i128; 3]| DVec3::from(p.map(|x| x as f64));
            let side = facing(triangle.map(float), float(middle), float(half), error as f64, false);
            assert_eq!(
                -side,
                facing(triangle.map(float), float(middle), float(half), error as f64, true),
                "mirrored"
            );
            for _ in 0..16 {
                let signs = vector(1 << 20).map(|x| if x % 2 == 0 { 1 } else { -1 });
                let corner = [0, 1, 2].map(|k| middle[k] + signs[k] * half[k]);
                let exact = triangle.map(|p| {
                    let signs = vector(1 << 20).map(|x| if x % 2 == 0 { 1 } else { -1 });
                    [0, 1, 2].map(|k| p[k] + signs[k] * error)
                });
                let height = height(exact, corner) * i128::from(side);
                assert!(
                    side == 0 || height > 0,
                    "trial {trial}: {triangle:?} off by {error}, {middle:?}, {half:?}"
                );
            }
            counts[usize::from(large) * 2 + usize::from(side != 0)] += 1;
        }
        assert!(counts.iter().all(|&count| count > 200), "undecided and decided: {counts:?}");
    }
}
