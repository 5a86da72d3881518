//! A culler from a point, for tests of cullers that use one.

use visibility_core::glam::{DAffine3, DVec3};
use visibility_core::{Aabb, Accuracy, CullStats, Culler, Scene, View, VisibleSet};

/// Removes the objects that a single cuboid among the occluders hides from a point: each segment from the
/// point to a corner of the object's box passes through the inside of the cuboid. Works with slabs in mesh
/// coordinates, unlike the crate.
#[derive(Clone, Debug)]
pub struct PointShadows;

impl PointShadows {
    /// Returns whether the segment passes through the inside of the box, shrunk by a margin.
    fn passes(bounds: &Aabb, from: DVec3, to: DVec3) -> bool {
        let (mut enter, mut leave) = (0.0f64, 1.0f64 - 1e-7);
        for axis in 0..3 {
            let (o, d) = (from[axis], to[axis] - from[axis]);
            let (low, high) = (f64::from(bounds.min[axis]) + 1e-6, f64::from(bounds.max[axis]) - 1e-6);
            if d.abs() < 1e-12 {
                if o < low || o > high {
                    return false;
                }
                continue;
            }
            let (a, b) = ((low - o) / d, (high - o) / d);
            enter = enter.max(a.min(b));
            leave = leave.min(a.max(b));
        }
        enter + 1e-7 < leave
    }
}

impl Culler for PointShadows {
    fn name(&self) -> &str {
        "point shadows"
    }

    fn accuracy(&self) -> Accuracy {
        Accuracy::Conservative
    }

    fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats {
        let mut cuboids = Vec::new();
        visible.for_each_occluder(scene, |id| {
            let (mesh, transform) = scene.occluder(id).expect("occluders of the copy have meshes");
            let columns = transform.matrix3.to_cols_array_2d().map(|c| DVec3::from_array(c.map(f64::from)));
            let [x, y, z] = columns;
            let translation = DVec3::from_array(transform.translation.to_array().map(f64::from));
            let inverse =
                DAffine3 { matrix3: visibility_core::glam::DMat3::from_cols(x, y, z), translation }.inverse();
            cuboids.push((*mesh.bounds(), inverse));
        });
        let visibility_core::view::Eye::Point(eye) = view.eye(scene.origin()) else {
            return CullStats::default();
        };
        visible.retain(scene, |_, bounds| {
            let corners = bounds.corners().map(|corner| corner.as_dvec3());
            !cuboids.iter().any(|(cuboid, inverse)| {
                let eye = inverse.transform_point3(eye);
                corners.iter().all(|&corner| Self::passes(cuboid, eye, inverse.transform_point3(corner)))
            })
        })
    }
}
