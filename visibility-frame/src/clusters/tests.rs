//! Tests in exact arithmetic that the bounds on the rounding of planes and eye in mesh coordinates hold, and
//! that they are needed. Tests of whole views cannot show this, since the margins of the `f32` kernels are
//! wider.

use super::local_view::Placement;
use crate::backface::SplitEye;
use visibility_core::geometry::Plane;
use visibility_core::glam::{Affine3A, DVec3, Mat3A, Vec3A};
use visibility_core::view::{Eye, ViewPlane};
use visibility_testing::{Random, sign_of_sum};

fn exact(v: Vec3A) -> [f64; 3] {
    v.to_array().map(f64::from)
}

/// Returns axes of a random kind: arbitrary, almost parallel, or of very different lengths.
fn random_axes(rng: &mut Random) -> [Vec3A; 3] {
    let mut axes = [(); 3].map(|()| rng.fine_vector(1.0));
    match rng.below(3) {
        0 => {}
        1 => {
            let common = rng.fine_vector(1.0);
            axes = axes.map(|axis| common + axis * 2.0f64.powi(-rng.between(1, 16)));
        }
        _ => axes = axes.map(|axis| axis * 2.0f64.powi(rng.between(-30, 30))),
    }
    axes.map(|axis| axis.as_vec3a())
}

/// Tests points within an error bound of a plane: a point of the half-space in scene coordinates must lie in
/// the enlarged half-space in mesh coordinates.
#[test]
fn a_half_space_in_mesh_coordinates_holds_all_of_its_points() {
    let mut rng = Random(1);
    let (mut outside, mut wide) = (0, 0);
    for _ in 0..200_000 {
        let axes = random_axes(&mut rng);
        let [far, size] = [rng.between(-10, 20), rng.between(-10, 10)].map(|e| 2.0f64.powi(e));
        let translation = rng.fine_vector(far).as_vec3a();
        let transform = Affine3A { matrix3: Mat3A::from_cols(axes[0], axes[1], axes[2]), translation };
        let Some(placement) = Placement::new(&transform) else { continue };
        let p = rng.fine_vector(size).as_vec3a();
        let n = rng.fine_vector(1.0).normalize();
        let placed: DVec3 = (0..3).map(|j| axes[j].as_dvec3() * f64::from(p[j])).sum();
        // The plane is placed as near to the point as rounding allows, or a few error bounds away.
        let size = n.abs().dot(placed.abs() + translation.as_dvec3().abs());
        let off = rng.pick(&[0.0, 0.0, 1.0, -1.0, 20.0, -20.0, 1e4]);
        let offset = -n.dot(placed + translation.as_dvec3()) + off * f64::EPSILON * size;
        // In half of the cases the given plane is itself off, by its error.
        let moved = offset + rng.pick(&[0.0, 0.0, size * 1e-9, -size * 1e-9]);
        let error = (moved - offset).abs() * (1.0 + 4.0 * f64::EPSILON);
        let given = ViewPlane { plane: Plane::new(n, moved), error };
        let reach = p.as_dvec3().abs();
        let Some(ViewPlane { plane, error }) = placement.plane(&given, reach) else { continue };

        let (moved, at) = (exact(translation), exact(p));
        let mut terms = alloc::vec![(offset, 1.0)];
        for k in 0..3 {
            terms.push((n[k], moved[k]));
            for (axis, x) in axes.iter().zip(at) {
                terms.push((n[k], f64::from(axis[k]) * x));
            }
        }
        let in_scene = sign_of_sum(terms);
        let local = |by: f64| {
            let terms = (0..3).map(|j| (plane.normal[j], at[j])).chain([(plane.offset, 1.0), (by, 1.0)]);
            sign_of_sum(terms)
        };
        if in_scene >= 0 {
            assert!(local(error) >= 0, "{transform:?} {p} {given:?}");
            // Without the error bound, the point would be outside.
            outside += u32::from(local(0.0) < 0);
        }
        let length = DVec3::from_array(axes.map(|axis| n.dot(axis.as_dvec3()))).length();
        let terms: DVec3 = (0..3).map(|j| axes[j].as_dvec3().abs() * reach[j]).sum();
        let all = n.abs().dot(terms + translation.as_dvec3().abs()) + offset.abs();
        wide += u32::from(error * length > 20.0 * f64::EPSILON * all + given.error * 1.001);
    }
    assert!(outside > 4_000 && wide == 0, "{outside} {wide}");
}

fn integers(rng: &mut Random, size: i32) -> [i64; 3] {
    [(); 3].map(|()| i64::from(rng.between(-size, size)))
}

fn to_vec(v: [i64; 3]) -> DVec3 {
    DVec3::from_array(v.map(|x| x as f64))
}

/// Tests eyes whose exact position in mesh coordinates is known, under integer transforms, many of them
/// almost flat.
#[test]
fn the_eye_in_mesh_coordinates_is_within_its_bound() {
    let mut rng = Random(2);
    let (mut off, mut loose, mut tried) = (0, 0, 0);
    for _ in 0..200_000 {
        let common = integers(&mut rng, 4_000_000);
        let spread = 1 << rng.between(8, 22);
        let axes = [(); 3].map(|()| {
            let own = integers(&mut rng, spread);
            [0, 1, 2].map(|k| common[k] + own[k])
        });
        let translation = integers(&mut rng, 1 << 20);
        let reach = 1 << rng.between(1, 27);
        let local = integers(&mut rng, reach);
        let rotated = [0, 1, 2].map(|k| (0..3).map(|j| axes[j][k] * local[j]).sum::<i64>());
        let eye = to_vec([0, 1, 2].map(|k| rotated[k] + translation[k]));
        let [x, y, z] = axes.map(|axis| to_vec(axis).as_vec3a());
        let transform =
            Affine3A { matrix3: Mat3A::from_cols(x, y, z), translation: to_vec(translation).as_vec3a() };
        let Some(placement) = Placement::new(&transform) else { continue };
        let (found, radius) = placement.inverse(eye - to_vec(translation), 0.0);
        let distance = (found - to_vec(local)).length();
        assert!(distance <= radius, "{transform:?} {eye}: {found} is off by {distance}, bound {radius}");
        off += u32::from(distance > radius / 32.0);
        loose += u32::from(distance == 0.0);
        // The given eye is off by up to a thousandth on each axis.
        let error = 1e-3;
        let wrong = eye - to_vec(translation) + DVec3::new(error, -error, error);
        let (found, radius) = placement.inverse(wrong, error);
        assert!((found - to_vec(local)).length() <= radius, "{transform:?} {eye}");
        tried += 1;
    }
    assert!(tried > 100_000 && off > 1_000, "{tried} tried, {off} off, {loose} exact");
}

#[test]
fn flat_transforms_have_no_placement() {
    let mut rng = Random(3);
    let mut doubtful = 0;
    for _ in 0..10_000 {
        let (a, b) = (integers(&mut rng, 1 << 22), integers(&mut rng, 1 << 22));
        let c = [0, 1, 2].map(|k| a[k] + b[k]);
        let [x, y, z] = [a, b, c].map(|axis| to_vec(axis).as_vec3a());
        let (p, q, r) = (to_vec(a), to_vec(b), to_vec(c));
        doubtful += u32::from(p.dot(q.cross(r)) != 0.0);
        let transform = Affine3A { matrix3: Mat3A::from_cols(x, y, z), translation: Vec3A::ZERO };
        assert!(Placement::new(&transform).is_none(), "{transform:?}");
    }
    assert!(doubtful > 1_000, "{doubtful} have a determinant that rounding makes");
}

/// The eye of an instance has the bound on its inverse image as its uncertainty, and a direction that of its
/// scaled image, with room for the rounding of the quotients.
#[test]
fn eyes_of_instances_are_as_uncertain_as_their_images() {
    let mut rng = Random(95);
    let mut known = 0;
    for round in 0..2_000 {
        let [a, b, c] = random_axes(&mut rng);
        let transform = Affine3A::from_cols(a, b, c, rng.vec3(-9.0, 9.0).into());
        let Some(placement) = Placement::new(&transform) else { continue };
        let (eye, error) = (rng.fine_vector(9.0), [0.0, 1e-9, 1e-4][round % 3]);
        let shift = DVec3::from(exact(transform.translation));
        let (p, radius) = placement.inverse(eye - shift, error);
        let found = placement.eye(&Eye::Point(eye), error).blur();
        assert!(found >= SplitEye::around(p, 1.0, radius).blur(), "{round}: a point");
        let along = eye.normalize();
        let (p, radius) = placement.inverse(along, error);
        let length = p.abs().max_element();
        let least = radius / length + f64::EPSILON;
        let found = placement.eye(&Eye::Direction(along), error);
        if least < 0.9e-3 {
            known += 1;
            assert!(found.blur() >= SplitEye::around(-p / length, 0.0, least).blur(), "{round}: a direction");
        } else if least > 1.1e-3 {
            assert!(found.blur().is_nan(), "{round}: a direction that is off by {least}");
        }
    }
    assert!(known > 500, "{known} directions are known");
}
