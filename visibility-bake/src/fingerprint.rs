//! What identifies the scene that a bake was made from.

use visibility_core::Scene;
use visibility_core::binary_format::Fingerprint;
use visibility_core::glam::Vec3;

/// Returns a hash of all that a bake of a scene depends on: its origin, and for each object its index,
/// bounds, layers, cost, flags and triangles. A scene that is built anew in the same way has the same hash.
/// Time is linear in the number of triangles.
///
/// ```
/// use visibility_core::{Aabb, Scene};
/// let mut scene = Scene::new();
/// let id = scene.insert(Aabb::from_arrays([0.0; 3], [1.0; 3]));
/// let before = visibility_bake::scene_fingerprint(&scene);
/// scene.set_bounds(id, Aabb::from_arrays([0.0; 3], [2.0; 3]))?;
/// assert_ne!(visibility_bake::scene_fingerprint(&scene), before);
/// # Ok::<(), visibility_core::scene::SceneError>(())
/// ```
pub fn scene_fingerprint(scene: &Scene) -> u64 {
    let mut hash = Fingerprint::new().with_u64(bounds_fingerprint(scene));
    for id in scene.ids() {
        let Ok(object) = scene.object(id) else { continue };
        let flags = u32::from(object.never_cull) | u32::from(object.occluder) << 1;
        hash = hash.with(object.layers).with(object.cost).with(flags);
        let triangles = scene.triangles(id).unwrap_or_default();
        hash = hash.with(triangles.len() as u32);
        hash = triangles.as_flattened().iter().fold(hash, |hash, &p| point(hash, p));
    }
    hash.value()
}

/// Returns a hash of the origin of a scene and of the indices and bounds of its objects.
pub(crate) fn bounds_fingerprint(scene: &Scene) -> u64 {
    let origin = scene.origin().to_array();
    let mut hash = origin.iter().fold(Fingerprint::new(), |hash, x| hash.with_u64(x.to_bits()));
    for id in scene.ids() {
        let Ok(bounds) = scene.bounds(id) else { continue };
        hash = point(point(hash.with(id.index() as u32), bounds.min), bounds.max);
    }
    hash.value()
}

fn point(hash: Fingerprint, p: Vec3) -> Fingerprint {
    p.to_array().iter().fold(hash, |hash, x| hash.with(x.to_bits()))
}
