//! Tests of set operations on solids: set laws, and membership of points in the results.

use crate::shapes;

use shapes::box_faces;
use visibility_bsp::Solid;
use visibility_core::glam::{DQuat, DVec3};
use visibility_testing::Random;

/// A random convex solid, a box or a ball, axis-aligned or rotated.
struct Shape {
    /// Faces of the solid, in the solid's coordinates (no unit), counter-clockwise as seen from outside.
    faces: Vec<Vec<DVec3>>,
    /// Plane of each face: outward unit normal `n` and offset `d` with `n . p + d = 0`.
    planes: Vec<(DVec3, f64)>,
}

impl Shape {
    fn new(faces: Vec<Vec<DVec3>>) -> Self {
        let planes = faces.iter().map(|f| {
            let normal = (f[1] - f[0]).cross(f[2] - f[0]).normalize();
            (normal, -normal.dot(f[0]))
        });
        Self { planes: planes.collect(), faces }
    }

    fn random(random: &mut Random) -> Self {
        let turn = match random.below(3) {
            0 => DQuat::IDENTITY,
            _ => DQuat::from_axis_angle(random.fine_vector(1.0).normalize(), random.fine_range(0.0, 6.0)),
        };
        let place = shapes::grid_point(random, 2.0);
        let faces = if random.below(3) == 0 {
            ball(6, 5)
        } else {
            let size = shapes::grid_point(random, 2.0).abs() + 1.0;
            box_faces(-size, size)
        };
        Self::new(faces.iter().map(|f| f.iter().map(|&v| turn * v + place).collect()).collect())
    }

    /// Returns `Some(true)` for a point inside the solid, `Some(false)` for one outside, `None` within 1e-9
    /// of the boundary. The point is in the solid's coordinates.
    fn contains(&self, p: DVec3) -> Option<bool> {
        let far = self.planes.iter().map(|(n, d)| n.dot(p) + d).fold(f64::NEG_INFINITY, f64::max);
        (far.abs() > 1e-9).then_some(far < 0.0)
    }
}

/// Returns the faces of a convex ball of radius 2.5 around the origin, between `around` meridians and `down`
/// bands of latitude.
fn ball(around: usize, down: usize) -> Vec<Vec<DVec3>> {
    let at = |i: usize, j: usize| {
        let (a, b) = (
            i as f64 / around as f64 * core::f64::consts::TAU,
            j as f64 / down as f64 * core::f64::consts::PI,
        );
        DVec3::new(a.cos() * b.sin(), a.sin() * b.sin(), b.cos()) * 2.5
    };
    let mut faces = Vec::new();
    for i in 0..around {
        for j in 0..down {
            let mut face = vec![at(i, j), at(i, j + 1), at((i + 1) % around, j + 1), at((i + 1) % around, j)];
            if j == 0 {
                face = vec![at(0, 0), face[1], face[2]];
            } else if j + 1 == down {
                face = vec![face[0], at(0, down), face[3]];
            }
            faces.push(face);
        }
    }
    faces
}

#[test]
fn points_are_in_what_the_operands_say() {
    check_membership(11, 150);
}

#[test]
fn the_laws_of_sets_hold() {
    check_laws(12, 200);
}

#[test]
#[ignore = "many solids: minutes"]
fn membership_and_laws_hold_of_many_solids() {
    check_membership(1011, 15_000);
    check_laws(1012, 20_000);
}

/// Asserts that random points are in unions, intersections and differences of random solids if and only if
/// membership in the operands implies it. `rounds` is the number of random pairs of solids.
fn check_membership(seed: u64, rounds: usize) {
    let mut random = Random(seed);
    let mut counts = [0; 3];
    for _ in 0..rounds {
        let [a, b, c] = [(); 3].map(|()| Shape::random(&mut random));
        let [sa, sb, sc] = [&a, &b, &c].map(|s| Solid::new(&s.faces).unwrap());
        let union = sa.union(&sb).unwrap();
        let both = sa.intersection(&sb).unwrap();
        let less = sa.difference(&sb).unwrap();
        // Operations on results of earlier operations.
        let more = union.difference(&sc).unwrap();
        let rest = sc.intersection(&less).unwrap();
        for _ in 0..300 {
            let p = random.fine_vector(6.0);
            let (Some(ia), Some(ib), Some(ic)) = (a.contains(p), b.contains(p), c.contains(p)) else {
                continue;
            };
            assert_eq!(sa.contains(p), ia, "{p} in the first solid");
            assert_eq!(union.contains(p), ia || ib, "{p}");
            assert_eq!(both.contains(p), ia && ib, "{p}");
            assert_eq!(less.contains(p), ia && !ib, "{p}");
            assert_eq!(more.contains(p), (ia || ib) && !ic, "{p}");
            assert_eq!(rest.contains(p), ic && ia && !ib, "{p}");
            for (count, found) in counts.iter_mut().zip([ia || ib, ia && ib, ia && !ib]) {
                *count += usize::from(found);
            }
        }
    }
    assert!(counts.iter().all(|&count| count > 200), "{counts:?}");
}

/// Asserts the laws of sets, such as commutativity, on pairs of random solids.
fn check_laws(seed: u64, rounds: usize) {
    let mut random = Random(seed);
    let empty = Solid::new::<Vec<DVec3>>([]).unwrap();
    assert!(empty.is_empty(), "a solid without faces is empty");
    for _ in 0..rounds {
        let [a, b] = [(); 2].map(|()| Shape::random(&mut random));
        let [sa, sb] = [&a, &b].map(|s| Solid::new(&s.faces).unwrap());
        // A union A and A intersected with A equal A, node for node; A minus A is empty.
        assert_eq!(
            sa.union(&sa).unwrap().node_count(),
            sa.node_count(),
            "nodes of the union of a solid with itself"
        );
        assert_eq!(
            sa.intersection(&sa).unwrap().node_count(),
            sa.node_count(),
            "nodes of the intersection of a solid with itself"
        );
        assert!(sa.difference(&sa).unwrap().is_empty(), "a solid less itself");
        assert!(
            sa.difference(&empty).unwrap().node_count() == sa.node_count(),
            "nodes of a solid less the empty solid"
        );
        assert!(
            sa.intersection(&empty).unwrap().is_empty() && empty.difference(&sa).unwrap().is_empty(),
            "the intersection with the empty solid, and the empty solid less another"
        );
        // (A minus B) union (A and B) equals A again.
        let again = sa.difference(&sb).unwrap().union(&sa.intersection(&sb).unwrap()).unwrap();
        let pairs = [
            (sa.union(&sb).unwrap(), sb.union(&sa).unwrap()),
            (sa.intersection(&sb).unwrap(), sb.intersection(&sa).unwrap()),
            (again, sa.clone()),
        ];
        for _ in 0..200 {
            let p = random.fine_vector(6.0);
            if a.contains(p).is_some() && b.contains(p).is_some() {
                pairs.iter().for_each(|(one, two)| assert_eq!(one.contains(p), two.contains(p), "{p}"));
            }
        }
    }
}

#[test]
fn turned_copies_and_scales_are_no_trouble() {
    // The same faces in another order give another tree of the same solid.
    let mut random = Random(13);
    for scale in [1e-6, 1.0, 1e9] {
        for _ in 0..40 {
            let shape = Shape::random(&mut random);
            let faces: Vec<Vec<DVec3>> =
                shape.faces.iter().map(|f| f.iter().map(|&v| v * scale).collect()).collect();
            let mut shuffled = faces.clone();
            for i in 0..shuffled.len() {
                let j = random.below(i + 1);
                shuffled.swap(i, j);
            }
            let [a, b] = [Solid::new(&faces).unwrap(), Solid::new(&shuffled).unwrap()];
            assert!(
                a.difference(&b).unwrap().is_empty() && b.difference(&a).unwrap().is_empty(),
                "scale {scale}: the same faces in another order are the same solid"
            );
        }
    }
}

#[test]
fn many_faces_are_no_trouble() {
    // A convex solid: every face's plane has all other faces behind it. A tree of face planes only would
    // degenerate into a list.
    let n = 1500;
    let at = |i: usize, z: f64| {
        let a = (i % n) as f64 / n as f64 * core::f64::consts::TAU;
        DVec3::new(a.cos(), a.sin(), z)
    };
    let mut faces: Vec<Vec<DVec3>> =
        (0..n).map(|i| vec![at(i, 0.0), at(i + 1, 0.0), at(i + 1, 1.0), at(i, 1.0)]).collect();
    faces.push((0..n).map(|i| at(i, 1.0)).collect());
    faces.push((0..n).rev().map(|i| at(i, 0.0)).collect());
    let solid = Solid::new(&faces).unwrap();
    assert!(
        solid.union(&solid).unwrap().contains(DVec3::new(0.5, 0.5, 0.5)),
        "the middle is in the union of the cylinder with itself"
    );
    assert!(solid.difference(&solid).unwrap().is_empty(), "the cylinder less itself");
}
