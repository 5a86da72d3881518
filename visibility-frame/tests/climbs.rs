//! Climbs towards eyes that see the front of a triangle in a cluster that is said to be back: cones of
//! patches under transforms, mirrored and sheared ones among them. All is in integers, and sides are judged
//! exactly.

use visibility_core::glam::{DAffine3, DMat3, DVec3, Vec3};
use visibility_core::view::Eye;
use visibility_frame::backface::{Facing, NormalCone};
use visibility_testing::{ClimbInput, Random, climb, judged, told_enough};

type Point = [i64; 3];

/// A fan of triangles, the transform of its instance, and an eye.
#[derive(Clone, Debug)]
struct Patch {
    /// Corners of the fan, its middle first, in mesh coordinates; then the eye in those of the scene.
    numbers: Vec<i64>,
    matrix: [Point; 3],
    moved: Point,
}

fn minus(a: Point, b: Point) -> Point {
    [0, 1, 2].map(|k| a[k] - b[k])
}

impl Patch {
    fn random(random: &mut Random) -> Self {
        let some = |random: &mut Random, by: i32| i64::from(random.between(-by, by));
        let matrix = match random.below(2) {
            0 => [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
            _ => [0; 3].map(|_| [0; 3].map(|_| some(random, 4))),
        };
        let moved = [0; 3].map(|_| some(random, 1 << 20));
        let (count, height) = (3 + random.below(6), 1 << (4 + random.below(14)));
        let mut numbers = vec![0, 0, some(random, height)];
        for i in 0..=count {
            let angle = i as f64 * 6.0 / count as f64;
            let [x, y] = [angle.cos(), angle.sin()].map(|x| (x * f64::from(1 << 17)) as i64);
            numbers.extend([x, y, some(random, height)]);
        }
        // An eye below the patch, so that the triangles turn their backs; above if the transform mirrors.
        let [x, y, z] = matrix.map(|axis| DVec3::from_array(axis.map(|x| x as f64)));
        let down = if x.cross(y).dot(z) < 0.0 { 1 } else { -1 };
        let below = [some(random, 1 << 18), some(random, 1 << 18), down * random.magnitude(19)];
        let mut patch = Self { numbers, matrix, moved };
        patch.numbers.extend(patch.placed(below));
        patch
    }

    /// Returns a point of the mesh in coordinates of the scene.
    fn placed(&self, p: Point) -> Point {
        [0, 1, 2].map(|k| (0..3).fold(self.moved[k], |sum, axis| sum + self.matrix[axis][k] * p[axis]))
    }

    fn triangles(&self) -> Vec<[Point; 3]> {
        let point = |i: usize| [0, 1, 2].map(|k| self.numbers[3 * i + k]);
        (1..self.numbers.len() / 3 - 2).map(|i| [point(0), point(i), point(i + 1)]).collect()
    }

    fn eye(&self) -> Point {
        let first = self.numbers.len() - 3;
        [0, 1, 2].map(|k| self.numbers[first + k])
    }

    fn is_back(&self) -> bool {
        let vec3 = |p: Point| Vec3::from_array(p.map(|x| x as f32));
        let dvec3 = |p: Point| DVec3::from_array(p.map(|x| x as f64));
        let triangles: Vec<[Vec3; 3]> = self.triangles().into_iter().map(|t| t.map(vec3)).collect();
        let [x, y, z] = self.matrix.map(dvec3);
        let transform = DAffine3::from_mat3_translation(DMat3::from_cols(x, y, z), dvec3(self.moved));
        let cone = NormalCone::from_triangles(&triangles).transformed(&transform);
        cone.facing(&Eye::Point(dvec3(self.eye()))) == Facing::Back
    }
}

impl ClimbInput for Patch {
    fn numbers(&mut self) -> &mut [i64] {
        &mut self.numbers
    }

    /// The least sine of the angle by which the eye is behind a triangle.
    fn clearance(&self) -> Option<f64> {
        if self.numbers.iter().any(|x| x.abs() > 1 << 22) {
            return None;
        }
        let mut most = f64::NEG_INFINITY;
        for t in self.triangles() {
            let [a, b, c] = t.map(|p| self.placed(p));
            let [u, v, w] = [b, c, self.eye()].map(|p| minus(p, a).map(i128::from));
            let normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
            let height = normal[0] * w[0] + normal[1] * w[1] + normal[2] * w[2];
            let length = |p: [i128; 3]| p.map(|x| (x as f64).powi(2)).iter().sum::<f64>().sqrt().max(1.0);
            // Edge on, nothing is seen.
            let sine =
                if height == 0 { -f64::MIN_POSITIVE } else { height as f64 / length(normal) / length(w) };
            most = most.max(sine);
        }
        Some(-most)
    }
}

#[test]
fn no_climb_ends_at_an_eye_before_the_front_of_a_triangle_that_is_said_to_be_back() {
    let mut random = Random(1);
    let (mut started, mut all, mut mirrored) = (0, 0, 0);
    for number in 0..1000 {
        let patch = Patch::random(&mut random);
        let Some(end) = climb(patch, &mut random, 60, Patch::is_back) else { continue };
        assert!(end.least > 0.0, "patch {number}: back, and its front is seen: {:?}", end.input);
        let [x, y, z] = end.input.matrix.map(|axis| DVec3::from_array(axis.map(|x| x as f64)));
        mirrored += u64::from(x.cross(y).dot(z) < 0.0);
        started += 1;
        all += end.judged;
    }
    judged(all);
    told_enough(
        started > 150 && mirrored > 30 && all > 8 * started,
        format_args!("{started}, {mirrored} mirrored, {all} inputs"),
    );
}
