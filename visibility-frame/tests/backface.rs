//! Tests of backface culling against exact arithmetic: no culled cluster contains a triangle whose front
//! faces an eye.

use visibility_core::glam::{DAffine3, DMat3, DVec3, Vec3};
use visibility_core::{
    Aabb, Culler, Object, Scene, View, VisibleSet, scene::Triangle, simd::Simd, view::Eye,
};
use visibility_frame::backface::{
    BackfaceCuller, ClusterError, Cones, Facing, NormalCone, cluster_mesh, facing,
};
use visibility_testing::cameras::{Camera, power_of_two, random_camera};
use visibility_testing::{FNV_START, Random, fnv, judged, sign_of_sum, told_enough};

/// A real number as an exact, unevaluated sum of floats. Empty stands for 0.
type Sum = Vec<f64>;

fn product(a: &Sum, b: &Sum) -> Sum {
    let mut sum = Sum::new();
    for &x in a {
        for &y in b {
            let high = x * y;
            sum.extend([high, x.mul_add(y, -high)]);
        }
    }
    // Zero terms do not change the sum; dropping them keeps sums short.
    sum.retain(|&x| x != 0.0);
    sum
}

fn minus(a: &Sum) -> Sum {
    a.iter().map(|x| -x).collect()
}

fn plus(a: &Sum, b: &Sum) -> Sum {
    [a.as_slice(), b].concat()
}

/// Returns the exact sign of `(b - a) x (c - a) . towards`: positive where the triangle's front is seen, 0
/// edge-on.
fn side_of([a, b, c]: [DVec3; 3], towards: [Sum; 3]) -> i32 {
    let difference = |x: DVec3, i: usize| vec![x[i], -a[i]];
    let mut terms = Vec::new();
    for (i, along) in towards.iter().enumerate() {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        let one = product(&difference(b, j), &difference(c, k));
        let two = product(&difference(b, k), &difference(c, j));
        // A component may have 16 terms, or 64 with an eye from `exact_eye`.
        let component = compress(plus(&one, &minus(&two)));
        terms.extend(component.iter().flat_map(|&x| along.iter().map(move |&y| (x, y))));
    }
    sign_of_sum(terms)
}

/// Returns a sum of equal value whose terms do not overlap, so that it is short.
fn compress(terms: Sum) -> Sum {
    let mut expansion = Sum::new();
    for mut q in terms {
        for h in &mut expansion {
            let sum = q + *h;
            let other = sum - q;
            *h = (q - (sum - other)) + (*h - other);
            q = sum;
        }
        expansion.retain(|&x| x != 0.0);
        expansion.push(q);
    }
    expansion.retain(|&x| x != 0.0);
    expansion
}

fn exact_side(triangle: &Triangle, eye: &Eye) -> i32 {
    let t = triangle.map(|p| p.as_dvec3());
    side_of(
        t,
        core::array::from_fn(|i| match *eye {
            Eye::Point(eye) => compress(vec![eye[i], -t[0][i]]),
            Eye::Direction(direction) => vec![-direction[i]],
        }),
    )
}

/// Asserts that the answer for one triangle agrees with the exact sign, positive for a front. Edge-on (0)
/// agrees with every answer, and an undecided answer with every sign.
fn check(said: Facing, exact: i32) {
    match said {
        Facing::Front => assert!(exact >= 0, "said to face the eye, but the exact sign is {exact}"),
        Facing::Back => assert!(exact <= 0, "said to face away from the eye, but the exact sign is {exact}"),
        Facing::Undecided => {}
    }
}

/// Returns a random vector with components up to `scale` times 2 to a random power from `least` to `most`.
fn far_vector(rng: &mut Random, scale: f64, least: i32, most: i32) -> DVec3 {
    let size = scale * power_of_two(rng.between(least, most));
    rng.vector(size)
}

fn point(rng: &mut Random, size: f64) -> Vec3 {
    rng.vector(size).as_vec3()
}

/// Returns the 40 triangles of a bent sheet of size `scale` around `place`, similar to modelled surfaces,
/// with normals on an arc or a cap of the unit sphere.
fn patch(rng: &mut Random, scale: f64, place: DVec3) -> Vec<Triangle> {
    let bend = [rng.range(-2.0, 2.0), rng.range(-2.0, 2.0) * f64::from(u8::from(rng.one_in(2)))];
    let frame = DMat3::from_cols(rng.vector(1.0), rng.vector(1.0), rng.vector(1.0));
    let at = |i: u32| {
        let (x, y) = (f64::from(i % 6) / 5.0 - 0.5, f64::from(i / 6) / 5.0 - 0.5);
        let height = bend[0] * x * x + bend[1] * y * y;
        (frame * DVec3::new(x, y, height) * scale + place).as_vec3()
    };
    let corners = (0..30).filter(|i| i % 6 != 5);
    corners.flat_map(|i| [[i, i + 1, i + 7], [i, i + 7, i + 6]]).map(|t| t.map(at)).collect()
}

/// Returns eyes near a patch, far away, at infinity (directions), and on the planes of its triangles up to
/// rounding, where only error margins keep answers right.
fn eyes(rng: &mut Random, triangles: &[Triangle], scale: f64, count: usize) -> Vec<Eye> {
    let center = triangles[0][0].as_dvec3();
    (0..count)
        .map(|i| match i % 4 {
            0 => Eye::Point(center + rng.vector(scale)),
            1 => Eye::Point(center + far_vector(rng, scale, 0, 12)),
            2 => Eye::Direction(rng.vector(1.0).normalize()),
            _ => {
                // An eye on the plane of a triangle, up to rounding.
                let [a, b, c] = rng.pick(triangles).map(|p| p.as_dvec3());
                let (s, t) = (rng.range(-9.0, 9.0) / 3.0, rng.range(-9.0, 9.0) / 7.0);
                Eye::Point(a + (b - a) * s + (c - a) * t)
            }
        })
        .collect()
}

#[test]
fn the_side_of_a_triangle_is_right_or_undecided() {
    let mut rng = Random(1);
    let (mut decided, mut near) = (0, 0);
    for round in 0..20_000 {
        let scale = power_of_two(rng.between(-50, 50));
        let place = far_vector(&mut rng, scale, -4, 12);
        let triangle: Triangle = core::array::from_fn(|_| (rng.vector(scale) + place).as_vec3());
        for eye in eyes(&mut rng, &[triangle], scale, 4) {
            let exact = exact_side(&triangle, &eye);
            let said = facing(&triangle, &eye);
            check(said, exact);
            decided += usize::from(said != Facing::Undecided);
            near += usize::from(said == Facing::Undecided && exact != 0);
            assert_eq!(facing(&[triangle[0], triangle[2], triangle[1]], &eye), said.flipped(), "{round}");
        }
    }
    judged(decided as u64);
    told_enough(decided > 59_000 && near > 1000, format_args!("both cases are tried: {decided} {near}"));
}

#[test]
fn no_front_is_in_a_cluster_that_is_said_to_be_back() {
    let mut rng = Random(2);
    let mut said_so = [0; 3];
    for _ in 0..1500 {
        let scale = power_of_two(rng.between(-50, 50));
        let place = far_vector(&mut rng, scale, -4, 16);
        let triangles = patch(&mut rng, scale, place);
        let cone = NormalCone::from_triangles(&triangles);
        for eye in eyes(&mut rng, &triangles, scale, 16)
            .into_iter()
            .chain(at_the_limit(&mut rng, &cone, scale, place))
        {
            let said = cone.facing(&eye);
            said_so[said as usize] += 1;
            if said != Facing::Undecided {
                triangles.iter().for_each(|triangle| check(said, exact_side(triangle, &eye)));
            }
            assert_eq!(
                cone.flipped().facing(&eye),
                said.flipped(),
                "a flipped cone sees the other side from {eye:?}"
            );
        }
    }
    judged(said_so.iter().sum::<usize>() as u64);
    told_enough(said_so.iter().all(|&n| n > 3000), format_args!("{said_so:?}"));
}

/// Returns pairs of eyes on both sides of the boundary between two answers of a cone, found by bisection to
/// about the precision of `f64`.
fn at_the_limit(rng: &mut Random, cone: &NormalCone, scale: f64, place: DVec3) -> Vec<Eye> {
    let mut found = Vec::new();
    for _ in 0..4 {
        let (mut a, mut b) = (place + rng.vector(scale * 8.0), place + rng.vector(scale * 8.0));
        let first = cone.facing(&Eye::Point(a));
        if first == cone.facing(&Eye::Point(b)) {
            continue;
        }
        for _ in 0..40 {
            let middle = a + (b - a) * 0.5;
            if cone.facing(&Eye::Point(middle)) == first { a = middle } else { b = middle }
        }
        found.extend([Eye::Point(a), Eye::Point(b)]);
    }
    found
}

/// Returns two triangles, slopes of a roof whose ridge passes through `at`. The eye is in the plane of the
/// first slope, in the direction of steepest descent, where the cone's answer has the smallest margin.
fn roof(rng: &mut Random, at: DVec3, eye: DVec3, size: f64) -> [Triangle; 2] {
    let down = (eye - at).normalize();
    let ridge = down.any_orthonormal_vector();
    let up = down.cross(ridge);
    let slope = rng.range(0.05, 1.2);
    let axis = (up - down * slope).normalize();
    let other = axis * (2.0 * axis.dot(down)) - down;
    let triangle = |down: DVec3, outwards: DVec3| {
        let corners = [at, at + ridge * size, at + down * size];
        let [a, b, c] = corners.map(|p| p.as_vec3());
        if ridge.cross(down).dot(outwards) > 0.0 { [a, b, c] } else { [a, c, b] }
    };
    [triangle(down, up), triangle(other, axis * (2.0 * axis.dot(up)) - up)]
}

#[test]
fn eyes_that_cross_the_plane_of_a_slope_are_told_apart_in_time() {
    let mut rng = Random(11);
    let mut told = 0;
    for round in 0..6000 {
        let scale = power_of_two(rng.between(-30, 30));
        // Three cases in turn: far from the origin, where f32 is coarse; with an eye so far away that the
        // apex does not matter; with directions.
        let (place, far) = [(20, 4), (8, 24), (0, 4)][round % 3];
        let at = far_vector(&mut rng, scale, -4, place);
        let eye = at + far_vector(&mut rng, scale, -2, far);
        let slopes = roof(&mut rng, at, eye, scale);
        let cone = NormalCone::from_triangles(&slopes);
        let [a, b, c] = slopes[0].map(|p| p.as_dvec3());
        let out = (b - a).cross(c - a).normalize_or_zero() * (eye - at).length() * 0.04;
        let along = |p: DVec3| if round % 3 == 2 { Eye::Direction(at - p) } else { Eye::Point(p) };
        // Bisects for the last eye, coming from behind the plane, for which the cone answers `Back`.
        let (mut back, mut other) = (eye - out, eye + out);
        if cone.facing(&along(back)) != Facing::Back {
            continue;
        }
        told += 1;
        for _ in 0..50 {
            let middle = back + (other - back) * 0.5;
            let is_back = cone.facing(&along(middle)) == Facing::Back;
            if is_back { back = middle } else { other = middle }
        }
        for slope in &slopes {
            assert!(exact_side(slope, &along(back)) <= 0, "{round}");
        }
    }
    judged(told as u64);
    told_enough(told > 3000, format_args!("cones that answer for the eye behind the plane: {told}"));
}

#[test]
fn transformed_cones_are_right_for_any_transform() {
    let mut rng = Random(4);
    let (mut mirrored, mut decided) = (0, [0; 3]);
    for round in 0..1500 {
        // The coordinates are small integers and powers of two, so that transformed corners are exact.
        let place = DVec3::from_array(core::array::from_fn(|_| f64::from(rng.between(-64, 64))));
        let triangles = patch(&mut rng, 8.0, place);
        let triangles: Vec<Triangle> =
            triangles.iter().map(|t| t.map(|p| (p * 256.0).round() / 256.0)).collect();
        let cone = NormalCone::from_triangles(&triangles);
        let mut matrix = DMat3::from_cols_array(&core::array::from_fn(|_| f64::from(rng.between(-8, 8))));
        if round % 3 == 0 {
            let stretch = core::array::from_fn(|_| power_of_two(rng.between(-6, 6)) * rng.pick(&[-1.0, 1.0]));
            matrix = DMat3::from_diagonal(DVec3::from_array(stretch));
        }
        let moved = DVec3::from_array(core::array::from_fn(|_| f64::from(rng.between(-1000, 1000))));
        let transform = DAffine3::from_mat3_translation(matrix, moved);
        let image = cone.transformed(&transform);
        mirrored += usize::from(matrix.determinant() < 0.0);
        let exact: Vec<[DVec3; 3]> =
            triangles.iter().map(|t| t.map(|p| transform.transform_point3(p.as_dvec3()))).collect();
        let scale =
            exact.iter().flatten().map(|p| (*p - exact[0][0]).abs().max_element()).fold(0.0, f64::max);
        for i in 0..40 {
            let eye = exact[0][0] + far_vector(&mut rng, 1.0 + scale, -1, 6);
            let eye = if i % 5 == 0 { Eye::Direction(rng.vector(1.0).normalize()) } else { Eye::Point(eye) };
            let said = image.facing(&eye);
            decided[said as usize] += 1;
            for t in exact.iter().filter(|_| said != Facing::Undecided) {
                let towards = core::array::from_fn(|i| match eye {
                    Eye::Point(eye) => compress(vec![eye[i], -t[0][i]]),
                    Eye::Direction(direction) => vec![-direction[i]],
                });
                check(said, side_of(*t, towards));
            }
        }
    }
    judged(decided.iter().sum::<usize>() as u64);
    told_enough(
        mirrored > 500 && decided[0] > 3000 && decided[1] > 3000,
        format_args!("mirrored {mirrored}; front, back, undecided: {decided:?}"),
    );
}

#[test]
fn every_path_says_the_same_of_a_hundred_thousand_cones() {
    let mut rng = Random(5);
    let patches: Vec<NormalCone> = (0..500)
        .map(|_| {
            let (size, place) = (power_of_two(rng.between(-8, 8)), rng.vector(100.0));
            NormalCone::from_triangles(&patch(&mut rng, size, place))
        })
        .collect();
    let cones: Vec<NormalCone> = (0..2000).map(|_| rng.pick(&patches)).collect();
    let mut hash = FNV_START;
    for round in 0..64 {
        let eye = match round % 8 {
            0 => Eye::Direction(rng.vector(1.0)),
            1 => Eye::Point(DVec3::new(rng.bits64(), rng.bits64(), rng.bits64())),
            2 => Eye::Point(rng.vector(1e30)),
            3 => Eye::Point(DVec3::new(f64::NAN, f64::INFINITY, 0.0)),
            _ => Eye::Point(rng.vector(200.0)),
        };
        let mut expected = vec![0; 40];
        Cones::new(cones.iter().copied()).with_simd(Simd::PORTABLE).back_facing(&eye, &mut expected);
        let one_by_one = cones.iter().map(|cone| cone.facing(&eye) == Facing::Back);
        for (i, back) in one_by_one.enumerate() {
            assert_eq!(expected[i / 64] >> (i % 64) & 1 == 1, back, "{i}");
        }
        for simd in Simd::available() {
            let mut found = vec![u64::MAX; 40];
            Cones::new(cones.iter().copied()).with_simd(simd).back_facing(&eye, &mut found);
            assert_eq!(found, expected, "{simd:?}");
        }
        hash = expected.iter().fold(hash, |hash, word| fnv(hash, &word.to_le_bytes()));
    }
    println!("hash {hash:#018x}");
    assert_eq!(hash, PINNED, "the same answers on every platform");
}

/// Expected hash of the kernel's answers on every platform. The cones are fitted with basic arithmetic and
/// square roots only, which IEEE 754 fixes to the last bit.
const PINNED: u64 = 0x74f6_5c25_0d1e_5809;

#[test]
fn clusters_are_a_permutation_of_the_right_sizes() {
    let mut rng = Random(7);
    for count in [0usize, 1, 63, 64, 128, 129, 191, 192, 193, 1000, 4321] {
        let positions: Vec<Vec3> = (0..count + 3).map(|_| point(&mut rng, 1.0)).collect();
        let mut indices: Vec<[u32; 3]> =
            (0..count).map(|_| core::array::from_fn(|_| rng.below(positions.len()) as u32)).collect();
        let clusters = cluster_mesh(&positions, &indices).unwrap();
        let mut all: Vec<u32> =
            clusters.iter().flat_map(|cluster| cluster.triangles.iter().copied()).collect();
        all.sort_unstable();
        assert_eq!(
            all,
            (0..count as u32).collect::<Vec<_>>(),
            "the clusters of {count} triangles hold each once"
        );
        for cluster in &clusters {
            assert!(
                cluster.triangles.len() <= 128 && (cluster.triangles.len() >= 64 || count < 64),
                "{count} triangles: a cluster of {}",
                cluster.triangles.len()
            );
            let corners = cluster.triangles.iter().flat_map(|&t| indices[t as usize]);
            assert!(
                corners.clone().all(|v| cluster.bounds.contains_point(positions[v as usize])),
                "{count} triangles: a corner is outside of its cluster's bounds"
            );
        }
        assert_eq!(cluster_mesh(&positions, &indices).unwrap(), clusters, "the same again");
        indices.push([0, count as u32 + 3, 1]);
        let error = ClusterError::Index { triangle: count, vertex: count as u32 + 3 };
        assert_eq!(
            cluster_mesh(&positions, &indices),
            Err(error),
            "{count} triangles and one with an unknown vertex"
        );
    }
}

#[test]
fn hostile_triangles_neither_panic_nor_lie() {
    let floor = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let below = Eye::Point(DVec3::new(0.2, 0.2, -3.0));
    let with = |t: Triangle| NormalCone::from_triangles(&[floor, t]).facing(&below);
    assert_eq!(with([Vec3::ONE; 3]), Facing::Back, "without area");
    assert_eq!(with([Vec3::ZERO, Vec3::ONE, Vec3::ONE * 3.0]), Facing::Back, "without area");
    assert_eq!(with([Vec3::NAN, Vec3::ONE, Vec3::ZERO]), Facing::Undecided, "a corner that is NaN");
    assert_eq!(with([Vec3::INFINITY, Vec3::ONE, Vec3::ZERO]), Facing::Undecided, "a corner at infinity");
    assert_eq!(with([Vec3::ZERO, Vec3::Y, Vec3::X]), Facing::Undecided, "all directions");
    // The triangle is so thin that its computed normal is unreliable. Its front faces the eye, so it must not
    // be culled.
    let thin = [Vec3::ZERO, Vec3::new(1.0, 1.0, 1.0), Vec3::new(1e10, 1e10, 1e10_f32.next_up())];
    assert_ne!(exact_side(&thin, &Eye::Point(DVec3::X)), 0, "the thin triangle is not edge-on");
    let cone = NormalCone::from_triangles(&[thin]);
    for eye in [DVec3::X, DVec3::Y, DVec3::NEG_X, DVec3::NEG_Y].map(Eye::Point) {
        check(cone.facing(&eye), exact_side(&thin, &eye));
    }
    assert!(NormalCone::from_triangles(&[]).is_open(), "a cone of no triangles is open");
    let cone = NormalCone::from_triangles(&[floor]);
    for broken in [DAffine3::ZERO, DAffine3::from_scale(DVec3::new(1.0, f64::NAN, 1.0))] {
        assert!(cone.transformed(&broken).is_open(), "a transform that is broken: {broken:?}");
    }
    let mut rng = Random(8);
    for _ in 0..20_000 {
        let bits: Vec<Triangle> = (0..rng.below(4))
            .map(|_| core::array::from_fn(|_| Vec3::new(rng.bits32(), rng.bits32(), rng.bits32())))
            .collect();
        let cone = NormalCone::from_triangles(&bits);
        let eye = Eye::Point(DVec3::new(rng.bits64(), rng.bits64(), rng.bits64()));
        let image = cone.transformed(&DAffine3::from_cols_array(&core::array::from_fn(|_| rng.bits64())));
        assert_eq!(
            image.is_open() && cone.is_open(),
            cone.is_open(),
            "transforming closes an open cone: {bits:?}"
        );
        let _ = (cone.facing(&eye), image.facing(&eye));
        for triangle in &bits {
            let _ = facing(triangle, &eye);
        }
        let corners: Vec<Vec3> = bits.iter().flatten().copied().collect();
        let indices: Vec<[u32; 3]> = (0..bits.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        assert!(cluster_mesh(&corners, &indices).is_ok(), "triangles of any bits are clustered: {bits:?}");
    }
}

#[test]
fn clear_cases_are_decided_at_all_scales() {
    let mut rng = Random(9);
    for exponent in -50..=50 {
        let scale = power_of_two(exponent);
        let place = rng.vector(scale * 1000.0);
        let sheet: Vec<Triangle> = (0..10)
            .map(|i| {
                let a = place + DVec3::X * scale * f64::from(i);
                [a, a + DVec3::X * scale, a + DVec3::Y * scale].map(|p| p.as_vec3())
            })
            .collect();
        let cone = NormalCone::from_triangles(&sheet);
        // A hundredth of a degree from edge-on is a thousand times the rounding error at this distance from
        // the origin; the smallest ellipse spans a tenth of a degree.
        for (height, expected) in [(0.2, Facing::Front), (-0.2, Facing::Back)] {
            let eye = place + DVec3::new(5.0 * scale, 50.0 * scale, height * scale);
            assert_eq!(cone.facing(&Eye::Point(eye)), expected, "2^{exponent}");
        }
    }
}

/// Returns the exact eye of a camera's clip matrix, in homogeneous coordinates relative to the camera's
/// origin: the 3x3 minors of the rows x, y and w.
fn exact_eye(camera: &Camera) -> [Sum; 4] {
    let m = |row: usize, column: usize| vec![camera.matrix[4 * column + row]];
    let minor = |columns: [usize; 3], sign: f64| {
        let mut sum = Sum::new();
        for k in 0..3 {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            for (a, b, s) in [(i, j, sign), (j, i, -sign)] {
                let two = product(&m(1, columns[a]), &m(3, columns[b]));
                sum.extend(product(&product(&m(0, columns[k]), &two), &vec![s]));
            }
        }
        compress(sum)
    };
    [minor([1, 2, 3], 1.0), minor([0, 2, 3], -1.0), minor([0, 1, 3], 1.0), minor([0, 1, 2], -1.0)]
}

fn sign(sum: &Sum) -> f64 {
    f64::from(sign_of_sum(sum.iter().map(|&x| (x, 1.0))))
}

#[test]
fn any_camera_hides_only_what_its_matrix_sees_from_behind() {
    let mut rng = Random(10);
    let (mut hidden, mut backs, mut parallel) = (0, 0, 0);
    for _ in 0..600 {
        let exponents = [rng.between(-8, 8); 3];
        let (mut camera, _) = random_camera(&mut rng, exponents);
        if rng.one_in(3) {
            // Rows that are nearly linearly dependent make the position of the eye ill-conditioned.
            let (x, y, off) =
                (rng.range(-1.0, 1.0), rng.range(-1.0, 1.0), power_of_two(rng.between(-46, -20)));
            for column in 0..4 {
                let [a, b, _, w] = core::array::from_fn(|row| camera.matrix[4 * column + row]);
                camera.matrix[4 * column + 3] = a * x + b * y + w * off;
            }
        }
        camera.origin = rng.vector(1e6).round();
        camera.scene_origin = camera.origin + rng.vector(8.0).round();
        let shift = camera.scene_origin - camera.origin;
        let view = View::from_clip_from_world(camera.matrix, camera.depth);
        let Ok(view) = view.and_then(|view| view.relative_to(camera.origin)) else { continue };
        let eye = exact_eye(&camera);
        let towards = |a: DVec3| -> [Sum; 3] {
            if eye[3].is_empty() {
                let along: Sum =
                    (0..3).flat_map(|i| product(&eye[i], &vec![camera.matrix[4 * i + 2]])).collect();
                let away = sign(&compress(along)) * if camera.depth.is_reversed() { -1.0 } else { 1.0 };
                return core::array::from_fn(|i| product(&eye[i], &vec![-away]));
            }
            // The difference eye / w - (a + shift), times the magnitude of w.
            let w = sign(&eye[3]);
            core::array::from_fn(|i| {
                let back = product(&eye[3], &compress(vec![-a[i], -shift[i]]));
                compress(product(&plus(&eye[i], &back), &vec![w]))
            })
        };
        parallel += usize::from(eye[3].is_empty());
        let size = power_of_two(exponents[0]);
        let about = match view.eye(camera.scene_origin) {
            Eye::Point(eye) => eye,
            Eye::Direction(_) => DVec3::ZERO,
        };
        let mut scene = Scene::new();
        scene.set_origin(camera.scene_origin).unwrap();
        let mut culler = BackfaceCuller::new();
        let objects: Vec<_> = (0..64)
            .map(|i| {
                let at = about + rng.vector(size * 4.0);
                let shape: Vec<Triangle> = match i % 2 {
                    0 => vec![core::array::from_fn(|_| (at + rng.vector(size)).as_vec3())],
                    _ => roof(&mut rng, at, about, size / 256.0).to_vec(),
                };
                let bounds = Aabb::from_points(shape.iter().flatten().copied());
                let id = scene.insert(Object { one_sided: true, ..Object::new(bounds) });
                scene.set_triangles(id, shape.clone()).unwrap();
                (id, shape)
            })
            .collect();
        culler.sync(&scene);
        let mut visible = VisibleSet::new();
        visible.fill(&scene, &view);
        culler.cull(&scene, &view, &mut visible);
        for (id, shape) in objects {
            let corners = shape.iter().map(|t| t.map(|p| p.as_dvec3()));
            let back = corners.map(|t| side_of(t, towards(t[0]))).all(|side| side <= 0);
            backs += usize::from(back);
            if !visible.contains(&scene, id) {
                hidden += 1;
                assert!(back, "{id} is hidden, but its front is in view of {camera:?}");
            }
        }
    }
    judged(hidden as u64);
    told_enough(
        hidden > backs / 4 && parallel > 30,
        format_args!("hidden {hidden} of {backs} backs, {parallel} parallel views"),
    );
}
