//! Tests of the clusters of instances against exact arithmetic: no cluster with a front-facing triangle in
//! view is dropped, whatever the transform. The oracles work in scene coordinates with exact sums and
//! integers, and share no code with the transformation of views.

use visibility_core::glam::{Affine3A, DMat4, DVec3, DVec4, Mat3A, Vec3, Vec3A};
use visibility_core::simd::Simd;
use visibility_core::view::{Depth, Window};
use visibility_core::{
    Aabb, FrustumCuller, Object, OccluderMesh, OcclusionMap, Pipeline, Pose, Scene, View, VisibleSet,
};
use visibility_frame::backface::NormalCone;
use visibility_frame::clusters::{ClusterInstance, ClusterMesh, ClusterView, VisibleCluster};
use visibility_testing::cameras::{
    Camera, aimed_point, box_behind, clip_planes, power_of_two, random_camera,
};
use visibility_testing::{PlainMap, Random, judged, sign_of_sum, told_enough};

fn columns(transform: &Affine3A) -> [Vec3A; 3] {
    [transform.matrix3.x_axis, transform.matrix3.y_axis, transform.matrix3.z_axis]
}

/// Tests exactly whether a point of a mesh is in view, boundary included. Products of two `f32` are exact in
/// `f64`.
fn sees(camera: &Camera, transform: &Affine3A, p: Vec3) -> bool {
    let axes = columns(transform);
    clip_planes(camera.depth).iter().all(|plane| {
        let terms = plane.iter().flat_map(|&(row, sign)| {
            let world = (0..3).flat_map(move |k| {
                let element = sign * camera.matrix[4 * k + row];
                let rotated = [0, 1, 2].map(|j| f64::from(axes[j][k]) * f64::from(p[j]));
                let moved = [f64::from(transform.translation[k]), camera.scene_origin[k], -camera.origin[k]];
                rotated.into_iter().chain(moved).map(move |x| (element, x))
            });
            world.chain([(sign * camera.matrix[12 + row], 1.0)])
        });
        sign_of_sum(terms.collect::<Vec<_>>()) >= 0
    })
}

fn view_of(camera: &Camera) -> Option<View> {
    let matrix = DMat4::from_cols_array(&camera.matrix);
    View::from_clip_from_world(matrix, camera.depth).ok()?.relative_to(camera.origin).ok()
}

/// Returns the clusters that a view lists of one instance, ascending.
fn listed(view: &View, scene: &Scene, instance: &ClusterInstance<'_>) -> Vec<u32> {
    let mut found = Vec::new();
    let stats = ClusterView::new(scene, view).cull_instance(instance, |cluster| found.push(cluster));
    assert_eq!(stats.visible as usize, found.len(), "clusters counted and listed");
    found.sort_unstable();
    found
}

/// Returns a random transform: any axes, axes that are almost parallel, or of very different lengths. The
/// translation is of the size `reach`.
fn random_transform(rng: &mut Random, reach: f64) -> Affine3A {
    let mut axes = [(); 3].map(|()| rng.fine_vector(1.0));
    match rng.below(3) {
        0 => {}
        1 => {
            let (common, least) = (rng.fine_vector(1.0), power_of_two(-rng.between(1, 14)));
            axes = axes.map(|axis| common + axis * least);
        }
        _ => axes = axes.map(|axis| axis * power_of_two(rng.between(-12, 12))),
    }
    let [x, y, z] = axes.map(|axis| axis.as_vec3a());
    Affine3A { matrix3: Mat3A::from_cols(x, y, z), translation: rng.fine_vector(reach).as_vec3a() }
}

#[test]
fn a_cluster_with_a_corner_in_view_is_listed_and_one_clear_of_a_plane_is_not() {
    let mut rng = Random(1);
    let (mut seen, mut clear, mut dropped) = (0, 0, 0);
    for _ in 0..60_000 {
        // Scales from a trillionth to a trillion.
        let scale = rng.between(-40, 40);
        let exponents = [0; 3].map(|_| scale + rng.between(-4, 4));
        let (mut camera, base) = random_camera(&mut rng, exponents);
        // Far from the scene's origin, the offsets of the planes in mesh coordinates are small differences
        // of large numbers.
        if rng.one_in(2) {
            camera.origin = rng.vector(1.5).round() * power_of_two(scale + rng.between(10, 40));
            camera.scene_origin = if rng.one_in(2) { camera.origin } else { DVec3::ZERO };
        }
        let Some(view) = view_of(&camera) else { continue };
        let Some((q, n, d)) = aimed_point(&mut rng, &camera, &base, exponents) else { continue };
        let q = Vec3::from_array(q).as_dvec3();
        let mut transform = random_transform(&mut rng, power_of_two(scale));
        if rng.one_in(2) {
            transform.translation = q.as_vec3a();
        }
        let axes = columns(&transform).map(|axis| Vec3::from(axis).as_dvec3());
        let translation = Vec3::from(transform.translation).as_dvec3();
        let inverse = transform.matrix3.as_dmat3().inverse();
        let mut p = (inverse * (q - translation)).as_vec3();
        let (local_n, local_d) = (DVec3::from_array(axes.map(|axis| n.dot(axis))), n.dot(translation) + d);
        // The vertex is moved onto the plane along its most influential axis.
        let say = (local_n * p.as_dvec3()).abs().to_array();
        let axis = (0..3).max_by(|&a, &b| say[a].total_cmp(&say[b])).unwrap();
        let others: f64 = (0..3).filter(|&i| i != axis).map(|i| local_n[i] * f64::from(p[i])).sum();
        p[axis] = (-(others + local_d) / local_n[axis]) as f32;
        for _ in 0..rng.below(3) {
            p[axis] = if local_n[axis] > 0.0 { p[axis].next_up() } else { p[axis].next_down() };
        }
        if !p.is_finite() || p.abs().max_element() > 1e30 {
            continue;
        }
        let sizes = [0; 3].map(|_| scale + rng.between(-6, 3));
        let bounds = box_behind(&mut rng, p.to_array(), local_n, sizes);
        let mesh = ClusterMesh::new([(bounds, NormalCone::OPEN)]);
        let mut scene = Scene::new();
        scene.set_origin(camera.scene_origin).unwrap();
        let found = !listed(&view, &scene, &ClusterInstance::new(&mesh, transform)).is_empty();
        if sees(&camera, &transform, p) {
            assert!(found, "{camera:?} {transform:?} {p}");
            seen += 1;
        }
        // Distance of the box outside the view, in multiples of the rounding error of `f32` boxes and `f64`
        // transforms.
        let worst = clip_planes(camera.depth).iter().fold(0.0f64, |worst, plane| {
            let (n, d) = camera.coefficients(plane);
            let local_n = DVec3::from_array(axes.map(|axis| n.dot(axis)));
            let local_d = n.dot(translation) + d;
            let far = DVec3::select(local_n.cmpge(DVec3::ZERO), bounds.max.as_dvec3(), bounds.min.as_dvec3());
            let reach = bounds.max.abs().max(bounds.min.abs()).as_dvec3();
            let in_f32 = local_n.abs().dot(far.abs()) + local_d.abs();
            let shift = camera.scene_origin.abs() + camera.origin.abs() + translation.abs();
            let rotated: DVec3 = (0..3).map(|j| axes[j].abs() * reach[j]).sum();
            let in_f64 = n.abs().dot(rotated + shift) + d.abs();
            worst.max(-(local_n.dot(far) + local_d) / (1e-6 * in_f32 + 1e-14 * in_f64))
        });
        if worst > 1.0 {
            assert!(!found, "must decide: {worst} {camera:?} {transform:?} {bounds:?}");
            clear += 1;
        }
        dropped += usize::from(!found);
    }
    judged((seen + dropped) as u64);
    told_enough(seen > 8_000 && clear > 2_000, format_args!("{seen} {clear} {dropped}"));
}

type Integers = [i128; 3];

fn minus(a: Integers, b: Integers) -> Integers {
    core::array::from_fn(|i| a[i] - b[i])
}

fn determinant([a, b, c]: [Integers; 3]) -> i128 {
    a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0])
        + a[2] * (b[0] * c[1] - b[1] * c[0])
}

fn random_integers(rng: &mut Random, size: i32) -> Integers {
    [(); 3].map(|()| i128::from(rng.between(-size, size)))
}

fn to_f64(v: Integers) -> DVec3 {
    DVec3::from_array(v.map(|x| x as f64))
}

/// Tests cones with integers, and with integers times powers of two, so that mesh, transform and eye are
/// exact: eyes within a few units of the plane of a triangle, under transforms that are almost flat.
#[test]
fn a_front_facing_triangle_in_view_is_listed_under_any_transform() {
    let mut rng = Random(2);
    let scene = Scene::new();
    let (mut fronts, mut backs, mut dropped) = (0, 0, 0);
    for _ in 0..200_000 {
        let axes = match rng.below(3) {
            0 => [(); 3].map(|()| random_integers(&mut rng, 300)),
            1 => {
                let common = random_integers(&mut rng, 20_000);
                [(); 3].map(|()| {
                    let small = random_integers(&mut rng, 40);
                    core::array::from_fn(|i| common[i] + small[i])
                })
            }
            _ => {
                let mut axes = [(); 3].map(|()| random_integers(&mut rng, 9));
                axes[rng.below(3)] = random_integers(&mut rng, 30_000);
                axes
            }
        };
        let reach = rng.between(0, 21);
        let translation = random_integers(&mut rng, 1 << reach);
        let turn = determinant(axes).signum();
        let triangle = [(); 3].map(|()| random_integers(&mut rng, 60));
        let placed = triangle.map(|p| {
            core::array::from_fn(|k| translation[k] + (0..3).map(|j| axes[j][k] * p[j]).sum::<i128>())
        });
        let [a, b, c]: [Integers; 3] = placed;
        let (ab, ac) = (minus(b, a), minus(c, a));
        let scale = power_of_two(rng.between(-20, 20));
        // A view of the triangle, and the side of the triangle's plane on which its eye is.
        let (view, side) = if rng.one_in(4) {
            let axis = rng.below(3);
            let sign = if rng.one_in(2) { 1 } else { -1 };
            let mut along = [0; 3];
            along[axis] = sign;
            // A window twice as wide as any placed triangle.
            let size = 1.0 / (scale * 2e8);
            let unit = [DVec3::X, DVec3::Y, DVec3::Z];
            let rows =
                [unit[(axis + 1) % 3] * size, unit[(axis + 2) % 3] * size, unit[axis] * size * sign as f64];
            let [x, y, z] = rows.map(|row| row.extend(0.0));
            let matrix = DMat4::from_cols(x, y, z, DVec4::W).transpose();
            let view = View::from_clip_from_world(matrix, Depth::NegativeOneToOne).unwrap();
            (view, -determinant([ab, ac, along]))
        } else {
            let (i, j) = (i128::from(rng.between(-3, 3)), i128::from(rng.between(-3, 3)));
            let reach = rng.pick(&[2, 1 << 20]);
            let off = random_integers(&mut rng, reach);
            let eye: Integers = core::array::from_fn(|k| a[k] + i * ab[k] + j * ac[k] + off[k]);
            let (eye_at, target) = (to_f64(eye) * scale, to_f64(a) * scale);
            if eye_at == target {
                continue;
            }
            let up = (target - eye_at).any_orthogonal_vector();
            let near = scale * 1e-3;
            let Ok(view) =
                View::perspective(Pose::look_at(eye_at, target, up), 2.0, 1.0, near, f64::INFINITY)
            else {
                continue;
            };
            (view, determinant([ab, ac, minus(eye, a)]))
        };
        let [x, y, z] = axes.map(|axis| (to_f64(axis) * scale).as_vec3a());
        let matrix3 = Mat3A::from_cols(x, y, z);
        let transform = Affine3A { matrix3, translation: (to_f64(translation) * scale).as_vec3a() };
        let triangle = triangle.map(|p| to_f64(p).as_vec3());
        let mesh = ClusterMesh::new([(Aabb::from_points(triangle), NormalCone::from_triangles(&[triangle]))]);
        let instance = ClusterInstance::new(&mesh, transform);
        let found = !listed(&view, &scene, &instance).is_empty();
        if turn != 0 && side * turn > 0 {
            assert!(found, "{transform:?} {triangle:?} {view:?}");
            fronts += 1;
        } else {
            backs += 1;
            dropped += usize::from(!found);
        }
        assert!(
            !listed(&view, &scene, &ClusterInstance { two_sided: true, ..instance }).is_empty(),
            "a two-sided triangle is listed from both sides: {triangle:?}"
        );
    }
    judged((fronts + backs) as u64);
    told_enough(fronts > 50_000 && dropped * 2 > backs, format_args!("{fronts} {backs} {dropped}"));
}

/// Returns the clusters of a sphere of radius 1, each a grid of two by two quads, as the corners of its
/// triangles, counter-clockwise from outside.
fn sphere(rings: usize, sectors: usize) -> Vec<Vec<[Vec3; 3]>> {
    let at = |ring: usize, sector: usize| {
        let (up, around) = (
            std::f64::consts::PI * ring as f64 / (2 * rings) as f64,
            std::f64::consts::TAU * sector as f64 / (2 * sectors) as f64,
        );
        // At the poles, triangles have exactly no area.
        let radius = if ring.is_multiple_of(2 * rings) { 0.0 } else { up.sin() };
        DVec3::new(radius * around.cos(), radius * around.sin(), up.cos()).as_vec3()
    };
    let quad = |ring, sector| {
        let [a, b, c, d] =
            [at(ring, sector), at(ring + 1, sector), at(ring + 1, sector + 1), at(ring, sector + 1)];
        [[a, b, c], [a, c, d]]
    };
    let patch = |ring, sector| {
        [(0, 0), (0, 1), (1, 0), (1, 1)].iter().flat_map(|&(i, j)| quad(ring + i, sector + j)).collect()
    };
    (0..rings).flat_map(|ring| (0..sectors).map(move |sector| patch(2 * ring, 2 * sector))).collect()
}

fn mesh_of(clusters: &[Vec<[Vec3; 3]>]) -> ClusterMesh {
    ClusterMesh::new(clusters.iter().map(|triangles| {
        (Aabb::from_points(triangles.iter().flatten().copied()), NormalCone::from_triangles(triangles))
    }))
}

/// Tests meshes of one to three levels with planes, cones and map together, against brute force over the
/// triangles of each cluster in `f64`, with a margin.
#[test]
fn instances_of_a_sphere_list_what_faces_the_view_and_little_else() {
    let mut rng = Random(3);
    for (rings, sectors) in [(4, 8), (20, 40), (50, 100)] {
        let clusters = sphere(rings, sectors);
        let mesh = mesh_of(&clusters);
        assert_eq!(mesh.len(), rings * sectors, "clusters of the sphere");
        let (mut needed, mut kept, mut all) = (0, 0, 0);
        for _ in 0..60 {
            let eye = rng.vector(20.0);
            let target = eye + rng.vector(1.0);
            let pose = Pose::look_at(eye, target, DVec3::Z);
            let view = View::perspective(pose, 1.0, 1.5, 0.1, 60.0).unwrap();
            let clip = view.clip_from(DVec3::ZERO);
            let mut scene = Scene::new();
            let transforms: Vec<Affine3A> = (0..8)
                .map(|_| {
                    let transform = random_transform(&mut rng, 0.0);
                    let place = eye + (target - eye).normalize() * rng.range(1.0, 30.0) + rng.vector(4.0);
                    Affine3A { translation: place.as_vec3a(), ..transform }
                })
                .collect();
            let unit = Aabb::from_arrays([-1.0; 3], [1.0; 3]);
            let ids = scene.insert_batch(
                transforms
                    .iter()
                    .map(|transform| Object { one_sided: true, ..Object::new(unit.transformed(transform)) }),
            );
            let mut visible = VisibleSet::new();
            Pipeline::new().with(FrustumCuller::new()).cull(&scene, &view, &mut visible);
            let mut list = Vec::new();
            let instance =
                |id: visibility_core::ObjectId| Some(ClusterInstance::new(&mesh, transforms[id.index()]));
            let stats = ClusterView::new(&scene, &view).cull(&visible, instance, &mut list);
            assert_eq!(stats.visible as usize, list.len(), "clusters counted and listed");
            for simd in Simd::available() {
                let mut again = Vec::new();
                ClusterView::new(&scene, &view).with_simd(simd).cull(&visible, instance, &mut again);
                assert_eq!(list, again, "{simd:?}");
            }
            list.sort_unstable();
            assert!(list.is_sorted_by(|a, b| a < b), "each once");
            for (&id, transform) in ids.iter().zip(&transforms) {
                let mirrored = transform.matrix3.as_dmat3().determinant() < 0.0;
                for (cluster, triangles) in (0..).zip(&clusters) {
                    let is_seen = triangles.iter().any(|triangle| {
                        let [a, b, c] =
                            triangle.map(|p| transform.as_daffine3().transform_point3(p.as_dvec3()));
                        let normal = (b - a).cross(c - a) * if mirrored { -1.0 } else { 1.0 };
                        let front = normal.dot(eye - a) > 1e-6 * normal.length() * (eye - a).length();
                        let q = clip * ((a + b + c) / 3.0).extend(1.0);
                        front && q.x.abs() < q.w && q.y.abs() < q.w && (0.0..q.w).contains(&q.z)
                    });
                    let is_listed = list.binary_search(&VisibleCluster { instance: id, cluster }).is_ok();
                    assert!(is_listed || !is_seen, "{cluster} of {transform:?} from {eye}");
                    needed += usize::from(is_seen);
                    kept += usize::from(is_listed);
                    all += 1;
                }
            }
        }
        judged(needed as u64);
        told_enough(
            needed > 4000 && kept * 2 < needed * 3 && kept * 3 < all * 2,
            format_args!("{needed} {kept} {all}"),
        );
    }
}

/// Returns whether the segment from `eye` to `p` meets the closed box.
fn blocked(eye: DVec3, p: DVec3, bounds: &Aabb) -> bool {
    let ray = p - eye;
    let (mut enter, mut leave) = (0.0f64, 1.0f64);
    for axis in 0..3 {
        let a = (f64::from(bounds.min[axis]) - eye[axis]) / ray[axis];
        let b = (f64::from(bounds.max[axis]) - eye[axis]) / ray[axis];
        (enter, leave) = (enter.max(a.min(b)), leave.min(a.max(b)));
    }
    enter <= leave
}

#[test]
fn a_map_hides_the_clusters_behind_a_wall_and_no_others() {
    let mut rng = Random(4);
    let clusters = sphere(20, 40);
    let mesh = mesh_of(&clusters);
    let (mut hidden, mut kept) = (0, 0);
    for round in 0..40 {
        let scene = Scene::new();
        let eye = rng.vector(1.0);
        let pose = Pose::look_at(eye, eye + DVec3::X, DVec3::Z);
        let view = if round % 4 == 0 {
            View::orthographic(pose, Window::centered(12.0, 12.0), 0.1, 90.0).unwrap()
        } else {
            View::perspective(pose, 1.0, 1.0, 0.1, 90.0).unwrap()
        };
        let wall = Aabb::from_arrays([8.0, -1.0, -5.0], [8.5, 5.0, 5.0]);
        let mut map = PlainMap::new(96, 96);
        map.begin(&view, DVec3::ZERO);
        map.add(&OccluderMesh::cuboid(&wall).unwrap(), &Affine3A::IDENTITY);
        map.flush();
        let mut transform = random_transform(&mut rng, 3.0);
        transform.matrix3 =
            Mat3A::from_rotation_y(rng.unit() as f32) * Mat3A::from_diagonal(Vec3::new(2.0, -3.0, 3.0));
        transform.translation += Vec3A::X * 16.0;
        let instance = ClusterInstance::new(&mesh, transform);
        let without = listed(&view, &scene, &instance);
        let mut with = Vec::new();
        ClusterView::new(&scene, &view).with_map(&map).cull_instance(&instance, |cluster| with.push(cluster));
        with.sort_unstable();
        for cluster in without {
            let is_kept = with.binary_search(&cluster).is_ok();
            let is_seen = clusters[cluster as usize].iter().flatten().any(|p| {
                let p = transform.as_daffine3().transform_point3(p.as_dvec3());
                let from = if round % 4 == 0 { DVec3::new(eye.x, p.y, p.z) } else { eye };
                !blocked(from, p, &wall)
            });
            assert!(is_kept || !is_seen, "{cluster} of {transform:?} from {eye}");
            hidden += usize::from(!is_kept);
            kept += usize::from(is_kept);
        }
        assert!(
            with.iter().all(|cluster| listed(&view, &scene, &instance).contains(cluster)),
            "the map adds a cluster of {transform:?}"
        );
    }
    judged((hidden + kept) as u64);
    told_enough(hidden > 2_000 && kept > 1_000, format_args!("{hidden} {kept}"));
}

#[test]
fn what_cannot_be_decided_is_listed() {
    let clusters = sphere(4, 8);
    let mesh = mesh_of(&clusters);
    let scene = Scene::new();
    let view = View::perspective(Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z), 1.0, 1.0, 0.1, 9.0).unwrap();
    let behind = Affine3A::from_translation(Vec3::X * -50.0);
    assert!(
        listed(&view, &scene, &ClusterInstance::new(&mesh, behind)).is_empty(),
        "a sphere behind the eye"
    );
    let all: Vec<u32> = (0..32).collect();
    let with_axis = |z| Affine3A { matrix3: Mat3A::from_cols(Vec3A::X, Vec3A::Y, z), ..behind };
    let infinite = Vec3::X * f32::NEG_INFINITY;
    for transform in [
        Affine3A::from_translation(Vec3::NAN),
        Affine3A::from_translation(infinite),
        with_axis(Vec3A::ZERO),
        with_axis(Vec3A::X + Vec3A::Y),
        with_axis(Vec3A::NAN),
        with_axis(Vec3A::splat(f32::INFINITY)),
        Affine3A::from_scale(Vec3::ZERO),
    ] {
        assert_eq!(listed(&view, &scene, &ClusterInstance::new(&mesh, transform)), all, "{transform:?}");
    }
    // With scales at the ends of the range of `f32`, transforms are still decided or listed, never dropped in
    // front of the eye.
    for scale in [1e-38, 1e-30, 1e30, 1e38] {
        let ahead = Affine3A { translation: Vec3A::X * 5.0, ..Affine3A::from_scale(Vec3::splat(scale)) };
        assert!(
            !listed(&view, &scene, &ClusterInstance::new(&mesh, ahead)).is_empty() || scale > 1.0,
            "a sphere 5 m ahead, of scale {scale}"
        );
    }
    // A cluster without a usable box must be listed, although all others are out of view.
    let unit = Aabb::from_arrays([-1.0; 3], [1.0; 3]);
    let floor = NormalCone::from_triangles(&[[Vec3::ZERO, Vec3::X, Vec3::Y]]);
    for odd in [
        Aabb::new(Vec3::NAN, Vec3::NAN),
        Aabb::new(Vec3::ONE, -Vec3::ONE),
        Aabb::EMPTY,
        Aabb::new(Vec3::ZERO, Vec3::INFINITY),
    ] {
        for count in [1, 70, 5000] {
            let boxes = (0..count).map(|i| (if i == count / 2 { odd } else { unit }, floor));
            let mesh = ClusterMesh::new(boxes);
            let found = listed(&view, &scene, &ClusterInstance::new(&mesh, behind));
            assert_eq!(found, [count / 2], "{odd:?} of {count}");
        }
    }
    let none = ClusterMesh::new([]);
    assert!(none.is_empty() && none.memory() == 0, "a mesh without clusters takes no memory");
    assert!(
        listed(&view, &scene, &ClusterInstance::new(&none, Affine3A::IDENTITY)).is_empty(),
        "a mesh without clusters has none to list"
    );
    assert!(
        listed(&view, &scene, &ClusterInstance::new(&none, with_axis(Vec3A::ZERO))).is_empty(),
        "a mesh without clusters, with a transform that cannot be decided"
    );
}

#[test]
fn objects_that_are_never_culled_list_all_clusters_and_others_of_no_mesh_none() {
    let mesh = mesh_of(&sphere(4, 8));
    let unit = Aabb::from_arrays([-51.0, -1.0, -1.0], [-49.0, 1.0, 1.0]);
    let mut scene = Scene::new();
    let never = scene.insert(Object { never_cull: true, ..Object::new(unit) });
    let improper = scene.insert(Aabb::new(Vec3::NAN, Vec3::NAN));
    let plain = scene.insert(unit);
    let removed = scene.insert(unit);
    let view = View::perspective(Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z), 1.0, 1.0, 0.1, 9.0).unwrap();
    let mut visible = VisibleSet::new();
    visible.fill(&scene, &view);
    scene.remove(removed).unwrap();
    let behind = Affine3A::from_translation(Vec3::X * -50.0);
    let mut list = Vec::new();
    let clusters = ClusterView::new(&scene, &view);
    let stats = clusters.cull(&visible, |_| Some(ClusterInstance::new(&mesh, behind)), &mut list);
    assert_eq!(
        (list.len(), stats.visible),
        (64, 64),
        "all clusters of the two objects that are never culled"
    );
    assert!(
        list.iter().all(|at| at.instance == never || at.instance == improper),
        "clusters of objects that are culled or removed"
    );
    list.clear();
    clusters.cull(
        &visible,
        |id| (id == plain).then(|| ClusterInstance::new(&mesh, Affine3A::IDENTITY)),
        &mut list,
    );
    assert!(!list.is_empty() || scene.contains(plain), "the plain object lists clusters, or is left");
    list.clear();
    clusters.cull(&visible, |_| None, &mut list);
    assert!(list.is_empty(), "objects without a mesh list clusters");
}

#[test]
fn the_back_of_an_object_that_is_not_one_sided_is_listed() {
    let floor = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let mesh = mesh_of(&[vec![floor]]);
    let mut scene = Scene::new();
    let object = Object::new(Aabb::from_points(floor));
    let leaf = scene.insert(object);
    scene.insert(Object { one_sided: true, ..object });
    let pose = Pose::look_at(DVec3::new(0.2, 0.2, -3.0), DVec3::new(0.2, 0.2, 0.0), DVec3::X);
    let view = View::perspective(pose, 1.0, 1.0, 0.1, 9.0).unwrap();
    let (mut visible, mut list) = (VisibleSet::new(), Vec::new());
    visible.fill(&scene, &view);
    let instance = |_| Some(ClusterInstance::new(&mesh, Affine3A::IDENTITY));
    ClusterView::new(&scene, &view).cull(&visible, instance, &mut list);
    assert_eq!(list, [VisibleCluster { instance: leaf, cluster: 0 }], "the leaf alone is drawn from below");
}
