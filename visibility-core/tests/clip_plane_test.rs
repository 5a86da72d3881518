//! Tests of occluders and points against the clip planes of a view, compared with exact arithmetic within a
//! few ulps of the planes.

use visibility_core::geometry::Plane;
use visibility_core::glam::{Affine3A, DVec3, Mat3A, Vec3, Vec3A};
use visibility_core::{Aabb, OccluderMesh, Pose, View};
use visibility_testing::{Random, judged, sign_of_sum, told_enough};

/// Returns the exact sign of the plane's value at the mesh corner `corner` after `transform`: positive
/// inside, 0 on the plane. Products of two `f32` numbers are exact in `f64`.
fn sign_at(plane: &Plane, transform: &Affine3A, corner: Vec3) -> i32 {
    let columns = [transform.matrix3.x_axis, transform.matrix3.y_axis, transform.matrix3.z_axis];
    let mut terms = vec![(plane.offset, 1.0)];
    for row in 0..3 {
        terms.push((plane.normal[row], f64::from(transform.translation[row])));
        let products = columns.iter().zip(corner.to_array());
        terms.extend(products.map(|(axis, c)| (plane.normal[row], f64::from(axis[row]) * f64::from(c))));
    }
    sign_of_sum(terms)
}

fn view_with(plane: Plane) -> View {
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    View::perspective(pose, 1.0, 1.0, 0.1, f64::INFINITY).unwrap().with_clip_planes(&[plane]).unwrap()
}

#[test]
fn an_occluder_that_a_plane_may_cut_is_never_inside() {
    let mut rng = Random(7);
    let (mut near, mut decided) = (0, 0);
    for _ in 0..40_000 {
        let size = 10f64.powi(rng.between(-6, 6));
        let axes = [(); 3].map(|()| Vec3A::from(rng.fine_vector(1.0).as_vec3()));
        let transform = Affine3A {
            matrix3: Mat3A::from_cols(axes[0], axes[1], axes[2]),
            translation: rng.fine_vector(size).as_vec3a(),
        };
        let corner = rng.fine_vector(size).as_vec3();
        let Ok(mesh) = OccluderMesh::cuboid(&Aabb::new(corner, corner + Vec3::splat(size as f32 * 0.1)))
        else {
            continue;
        };
        let corners = mesh.bounds().corners();
        let normal = rng.fine_vector(1.0) * 10f64.powi(rng.between(-3, 3));
        let value = |p: Vec3| {
            let placed = transform.matrix3.as_dmat3() * p.as_dvec3() + transform.translation.as_dvec3();
            normal.dot(placed)
        };
        let lowest = corners.map(value).into_iter().fold(f64::INFINITY, f64::min);
        let magnitude = normal.abs().element_sum() * 5.0 * size;
        for ulps in [-4.0, -1.0, 0.0, 1.0, 4.0, 2000.0] {
            let plane = Plane::new(normal, ulps * f64::EPSILON * magnitude - lowest);
            let inside = mesh.is_inside(&view_with(plane).clip_planes_from(DVec3::ZERO), &transform);
            let truly = corners.iter().all(|&corner| sign_at(&plane, &transform, corner) > 0);
            assert!(truly || !inside, "{plane:?} {transform:?} {corner}");
            near += i32::from(!truly);
            if ulps == 2000.0 {
                assert!(inside, "must decide: {plane:?} {transform:?} {corner}");
                decided += 1;
            }
        }
    }
    judged((near + decided) as u64);
    told_enough(near > 50_000 && decided > 30_000, format_args!("{near} {decided}"));
}

/// Huge boxes along planes that are nearly parallel to a side: the computed side of the normal may be wrong,
/// so that another corner than the computed one is cut.
#[test]
fn a_huge_occluder_that_a_nearly_parallel_plane_cuts_is_never_inside() {
    let mut rng = Random(9);
    let (mut cut, mut decided) = (0, 0);
    for _ in 0..40_000 {
        let axes = [(); 3].map(|()| rng.fine_vector(1.0).as_vec3());
        let transform = Affine3A {
            matrix3: Mat3A::from_cols(axes[0].into(), axes[1].into(), axes[2].into()),
            translation: rng.fine_vector(1.0).as_vec3a(),
        };
        let size = 10f32.powi(rng.between(0, 30));
        let max =
            Vec3::from_array([0; 3].map(|axis: usize| if rng.one_in(2) { size } else { 1.0 + axis as f32 }));
        let Ok(mesh) = OccluderMesh::cuboid(&Aabb::new(Vec3::ZERO, max)) else { continue };
        let normal = axes[0].as_dvec3().cross(axes[rng.below(2) + 1].as_dvec3());
        let plane = Plane::new(normal, 100.0);
        let inside = mesh.is_inside(&view_with(plane).clip_planes_from(DVec3::ZERO), &transform);
        let truly = mesh.bounds().corners().iter().all(|&corner| sign_at(&plane, &transform, corner) > 0);
        assert!(truly || !inside, "{plane:?} {transform:?} {max}");
        cut += i32::from(!truly);
        decided += i32::from(inside);
    }
    judged((cut + decided) as u64);
    told_enough(cut > 5_000 && decided > 5_000, format_args!("{cut} are cut, {decided} are inside"));
}

#[test]
fn a_point_on_a_plane_is_never_inside() {
    let mut rng = Random(8);
    for _ in 0..100_000 {
        let size = 10f64.powi(rng.between(-9, 9));
        let p = rng.fine_vector(size);
        let normal = rng.fine_vector(1.0) * 10f64.powi(rng.between(-3, 3));
        let magnitude = normal.abs().dot(p.abs());
        for ulps in [-2.0, -0.5, 0.0, 0.5, 2.0, 500.0] {
            let plane = Plane::new(normal, ulps * f64::EPSILON * magnitude - normal.dot(p));
            let inside = view_with(plane).clip_planes_from(DVec3::ZERO).contains(p);
            let terms = [(normal.x, p.x), (normal.y, p.y), (normal.z, p.z), (plane.offset, 1.0)];
            assert!(sign_of_sum(terms) > 0 || !inside, "{plane:?} {p}");
            assert!(inside || ulps < 500.0, "must decide: {plane:?} {p}");
        }
    }
    judged(600_000);
}

#[test]
fn no_plane_cuts_nothing_and_what_is_not_finite_is_never_inside() {
    let mesh = OccluderMesh::cuboid(&Aabb::from_arrays([0.0; 3], [1.0; 3])).unwrap();
    let view = view_with(Plane::new(DVec3::X, 10.0));
    let planes = view.clip_planes_from(DVec3::ZERO);
    assert!(mesh.is_inside(&planes, &Affine3A::IDENTITY), "a mesh in front of the plane");
    assert!(!mesh.is_inside(&planes, &Affine3A::from_translation(Vec3::NAN)), "a mesh at NaN is inside");
    assert!(
        !mesh.is_inside(&planes, &Affine3A::from_translation(Vec3::X * f32::INFINITY)),
        "a mesh at infinity is inside"
    );
    assert!(!planes.contains(DVec3::NAN), "a point that is NaN is inside");
    let none = view.with_clip_planes(&[]).unwrap().clip_planes_from(DVec3::ZERO);
    assert!(
        mesh.is_inside(&none, &Affine3A::IDENTITY) && none.contains(DVec3::NAN),
        "without planes all is inside, NaN too"
    );
}
