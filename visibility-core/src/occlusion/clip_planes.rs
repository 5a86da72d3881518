//! The test of an occluder against the clip planes of a view.

use super::OccluderMesh;
use crate::view::ViewPlanes;
use glam::{Affine3A, DVec3, Vec3};

impl OccluderMesh {
    /// Returns whether the mesh, placed by `transform`, certainly lies on the inner side of every plane. Both
    /// the transform and the planes are relative to the scene's origin. True without planes; false where the
    /// mesh touches a plane, where rounding cannot decide, and for a non-finite transform.
    ///
    /// [`OcclusionMap::add`](crate::OcclusionMap::add) calls this for every occluder, with the
    /// [`clip_planes_from`](crate::View::clip_planes_from) of the view: parts that a clip plane cuts away are
    /// not drawn and must not hide anything. Takes constant time per plane, since only the corners of the
    /// mesh's bounds are tested.
    ///
    /// ```
    /// use visibility_core::glam::{Affine3A, DVec3, Vec3};
    /// use visibility_core::{geometry::Plane, Aabb, OccluderMesh, Pose, View};
    /// let view = View::perspective(Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z), 1.0, 1.0, 0.1, 100.0)?
    ///     .with_clip_planes(&[Plane::through(DVec3::new(4.0, 0.0, 0.0), DVec3::X)])?;
    /// let planes = view.clip_planes_from(DVec3::ZERO);
    /// let mesh = OccluderMesh::cuboid(&Aabb::from_arrays([0.0; 3], [1.0; 3]))?;
    /// assert!(mesh.is_inside(&planes, &Affine3A::from_translation(Vec3::X * 5.0)));
    /// assert!(!mesh.is_inside(&planes, &Affine3A::from_translation(Vec3::X * 3.5)));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn is_inside(&self, planes: &ViewPlanes, transform: &Affine3A) -> bool {
        let as_f64 = |v: Vec3| v.as_dvec3();
        let axes = [transform.matrix3.x_axis, transform.matrix3.y_axis, transform.matrix3.z_axis]
            .map(|axis| as_f64(axis.into()));
        let translation = as_f64(transform.translation.into());
        let (min, max) = (self.bounds().min.as_dvec3(), self.bounds().max.as_dvec3());
        planes.as_slice().iter().all(|plane| {
            // The plane in mesh coordinates. Its smallest value over the box is at the corner farthest
            // against the normal.
            let n = plane.plane.normal;
            let normal = DVec3::from(axes.map(|axis| n.dot(axis)));
            let corner = DVec3::select(normal.cmpge(DVec3::ZERO), min, max);
            let distance = normal.dot(corner) + n.dot(translation) + plane.plane.offset;
            // Each term `n_i axis_ji corner_j` is rounded at most eight times by products and sums, and the
            // normal errs by at most 16u of itself. 32u of the sum of magnitudes covers both, and the
            // rounding of that sum. A product that underflows loses at most the least normal number, times
            // the corner's coordinate.
            // Where the sign of a component of the normal is open, another corner may be the farthest, so
            // magnitudes are those of all corners.
            let reach = min.abs().max(max.abs());
            let underflow = 16.0 * f64::MIN_POSITIVE * (1.0 + reach.element_sum());
            let sizes = DVec3::from(axes.map(|axis| n.abs().dot(axis.abs())));
            let size = sizes.dot(reach) + n.abs().dot(translation.abs()) + plane.plane.offset.abs();
            distance > 16.0 * f64::EPSILON * size + plane.error + underflow
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Plane;
    use crate::{Aabb, Pose, View};
    use visibility_testing::{Random, sign_of_sum};

    /// Planes of a view far from the origin of the scene, where the rounding of their offsets is greater than
    /// that of the mesh.
    #[test]
    fn a_plane_of_a_view_far_away_is_not_passed_by_its_rounding() {
        let mut rng = Random(1);
        let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
        let view = View::perspective(pose, 1.0, 1.0, 0.1, f64::INFINITY).unwrap();
        let mesh = OccluderMesh::cuboid(&Aabb::from_arrays([0.0; 3], [1.0, 2.0, 3.0])).unwrap();
        let (mut cut, mut decided) = (0, 0);
        for case in 0..20_000 {
            let size = 10f64.powi(rng.between(3, 11));
            let [of_view, of_scene] = [(); 2].map(|()| rng.fine_vector(size));
            let normal = rng.fine_vector(1.0) * 10f64.powi(rng.between(-3, 3));
            let values = mesh.bounds().corners().map(|p| normal.dot(p.as_dvec3() + (of_scene - of_view)));
            let lowest = values.into_iter().fold(f64::INFINITY, f64::min);
            for ulps in [-3.0, -0.5, 0.0, 0.5, 3.0, 500.0] {
                let ulp = f64::EPSILON * size * normal.abs().element_sum();
                let plane = Plane::new(normal, ulps * ulp - lowest);
                let placed = view.relative_to(of_view).unwrap().with_clip_planes(&[plane]).unwrap();
                let is_inside = mesh.is_inside(&placed.clip_planes_from(of_scene), &Affine3A::IDENTITY);
                let is_before = |p: Vec3| {
                    let along = |v: DVec3, sign: f64| {
                        let factors = (normal * sign).to_array().into_iter();
                        factors.zip(v.to_array())
                    };
                    let of_mesh = along(p.as_dvec3(), 1.0).chain(along(of_scene, 1.0));
                    sign_of_sum(of_mesh.chain(along(of_view, -1.0)).chain([(plane.offset, 1.0)])) > 0
                };
                let is_truly_inside = mesh.bounds().corners().into_iter().all(is_before);
                assert!(is_truly_inside || !is_inside, "case {case}, {ulps} ulps: {plane:?}");
                assert!(is_inside || ulps < 500.0, "case {case}: decided at {ulps} ulps");
                (cut, decided) = (cut + u32::from(!is_truly_inside), decided + u32::from(is_inside));
            }
        }
        assert!(cut > 30_000 && decided >= 20_000, "{cut} are cut, {decided} are inside");
    }
}
