//! Rays cast at hidden objects, triangle by triangle, for the tests of several cullers.

use visibility_core::glam::{Affine3A, DVec3, Vec3};
use visibility_core::{Aabb, Object, ObjectId, OccluderMesh, Scene};

/// Triangle in the scene: its corners, counter-clockwise from the front, and whether its back occludes too.
pub(crate) type Face = ([DVec3; 3], bool);

/// Mesh with its transform.
pub(crate) struct Occluder {
    pub(crate) mesh: OccluderMesh,
    pub(crate) transform: Affine3A,
}

impl Occluder {
    pub(crate) fn faces(&self) -> impl Iterator<Item = Face> + '_ {
        let triangles = self.mesh.triangles().iter().map(|t| t.map(|i| self.mesh.positions()[i as usize]));
        faces(triangles, &self.transform, self.mesh.is_two_sided())
    }
}

/// Returns the triangles of placed meshes. A mirroring transform keeps their fronts.
pub(crate) fn faces(
    triangles: impl Iterator<Item = [Vec3; 3]>,
    transform: &Affine3A,
    two_sided: bool,
) -> impl Iterator<Item = Face> {
    let m = transform.matrix3;
    let axes = [m.x_axis, m.y_axis, m.z_axis].map(|axis| Vec3::from(axis).as_dvec3());
    let at = Vec3::from(transform.translation).as_dvec3();
    let is_mirrored = axes[0].cross(axes[1]).dot(axes[2]) < 0.0;
    triangles.map(move |t| {
        let mut corners = t.map(|p| {
            let p = p.as_dvec3();
            axes[0] * p.x + axes[1] * p.y + axes[2] * p.z + at
        });
        if is_mirrored {
            corners.swap(1, 2);
        }
        (corners, two_sided)
    })
}

/// Returns whether the open segment from `from` to `to` meets an occluding face beyond the plane `near`,
/// given by its normal and offset. Faces count as closed and slightly enlarged.
pub(crate) fn is_blocked(from: DVec3, to: DVec3, near: (DVec3, f64), faces: &[Face]) -> bool {
    let along = to - from;
    faces.iter().any(|&([a, b, c], two_sided)| {
        let normal = (b - a).cross(c - a);
        let speed = normal.dot(along);
        if speed == 0.0 || speed > 0.0 && !two_sided {
            return false;
        }
        let part = normal.dot(a - from) / speed;
        let p = from + along * part;
        let slack = -1e-9 * normal.length();
        let inside = |a: DVec3, b: DVec3| (b - a).cross(p - a).dot(normal) / normal.length() >= slack;
        part > 0.0
            && part < 1.0
            && near.0.dot(p) + near.1 > 0.0
            && inside(a, b)
            && inside(b, c)
            && inside(c, a)
    })
}

/// Returns a scene of an occluder and a box that occludes nothing, and the box's id.
pub(crate) fn scene_of(mesh: &OccluderMesh, transform: Affine3A, bounds: Aabb) -> (Scene, ObjectId) {
    let mut scene = Scene::new();
    let around = mesh.bounds().transformed(&transform);
    let occluder = scene.insert(Object { occluder: true, ..Object::new(around) });
    let mesh = scene.add_mesh(mesh.clone());
    scene.set_mesh(occluder, mesh, transform).unwrap();
    let target = scene.insert(bounds);
    (scene, target)
}
