//! Versions of levels: hashes that tell whether a bake or a file of occluders was made from this level, or
//! from another level or before an edit.

use crate::binary_format::Fingerprint;
use crate::scene::Triangles;
use crate::{Object, ObjectId, OccluderMesh, Scene};
use glam::{Affine3A, DVec3};

/// Returns the version of the level that a scene holds: a hash of the scene's origin, and of the index and
/// the [hash](object_hash) of each object, as [`level_object`] returns it. Of draw ranges and HLOD parents,
/// the version contains only whether an occluder is [always drawn](Scene::is_always_drawn). Time is linear in
/// the number of triangles.
///
/// ```
/// use visibility_core::{Aabb, Object, Scene, level_version};
/// let mut scene = Scene::new();
/// let wall = scene.insert(Object { occluder: true, ..Object::new(Aabb::from_arrays([5.0; 3], [6.0; 3])) });
/// let version = level_version(&scene);
/// scene.set_occluder(wall, false)?;
/// assert_ne!(level_version(&scene), version);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn level_version(scene: &Scene) -> u64 {
    let object = |id: ObjectId| {
        let (object, mesh) = level_object(scene, id)?;
        let triangles = scene.triangles(id).unwrap_or_default();
        Some((id.index() as u32, object_hash(&object, triangles, mesh)))
    };
    version_of(scene.origin(), scene.ids().filter_map(object))
}

/// Returns an object as levels and bakes use it, with its occluder mesh and the mesh's transform. An object
/// that is not [always drawn](Scene::is_always_drawn), or is [never culled](Object::is_unculled), is returned
/// without its `occluder` flag and its mesh. `None` for an unknown object.
pub fn level_object(scene: &Scene, id: ObjectId) -> Option<(Object, Option<(&OccluderMesh, Affine3A)>)> {
    let mut object = scene.object(id).ok()?;
    object.occluder &= scene.is_always_drawn(id) && !object.is_unculled();
    if object.one_sided && !scene.triangles(id).is_ok_and(|triangles| triangles.has_certain_fronts()) {
        (object.occluder, object.one_sided) = (false, false);
    }
    Some((object, scene.occluder(id).filter(|_| object.occluder)))
}

/// Returns the [version](level_version()) of a level whose scene is not in memory. `origin` is the origin of
/// its scene in the world. `objects` are the index and the [hash](object_hash) of each object, by ascending
/// index.
pub fn version_of(origin: DVec3, objects: impl IntoIterator<Item = (u32, u64)>) -> u64 {
    let with = |hash: Fingerprint, (index, content): (u32, u64)| hash.with(index).with_u64(content);
    objects.into_iter().fold(Fingerprint::new().with_dvec3(origin), with).value()
}

/// Returns a hash of an object: bounds, layers, cost, flags, triangles, and occluder mesh with its transform.
/// The index does not count, and the flag `see_through` counts for occluders alone.
pub fn object_hash<'a>(
    object: &Object,
    triangles: impl Into<Triangles<'a>>,
    mesh: Option<(&OccluderMesh, Affine3A)>,
) -> u64 {
    let triangles = triangles.into();
    let flags =
        u32::from(object.never_cull) | u32::from(object.occluder) << 1 | u32::from(object.one_sided) << 2;
    // A see-through flag counts for occluders only: a level made of a scene has no see-through occluders.
    let flags = flags | u32::from(object.occluder && object.see_through) << 3;
    let hash = Fingerprint::new().with_vec3(object.bounds.min).with_vec3(object.bounds.max);
    let hash = hash.with(object.layers).with(object.cost).with(flags).with(triangles.len() as u32);
    let mut hash = triangles.iter().flatten().fold(hash, |hash, p| hash.with_vec3(p));
    if let Some((mesh, transform)) = mesh {
        hash = hash.with(u32::from(mesh.is_two_sided())).with(mesh.positions().len() as u32);
        hash = mesh.positions().iter().fold(hash, |hash, &p| hash.with_vec3(p));
        hash = mesh.triangles().as_flattened().iter().fold(hash, |hash, &corner| hash.with(corner));
        hash = transform.to_cols_array().iter().fold(hash, |hash, x| hash.with(x.to_bits()));
    }
    hash.value()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Aabb;
    use crate::scene::{DrawRange, SharedTriangles};
    use glam::{DAffine3, Vec3};

    /// Makes a scene of one object, which `change` may change, and returns its version.
    fn hash(change: impl Fn(&mut Scene, ObjectId)) -> u64 {
        let mut scene = Scene::new();
        let id =
            scene.insert(Object { occluder: true, ..Object::new(Aabb::from_arrays([1.0; 3], [2.0; 3])) });
        scene.set_triangles(id, [[Vec3::ONE, Vec3::ONE + Vec3::X, Vec3::ONE + Vec3::Y]]).unwrap();
        change(&mut scene, id);
        level_version(&scene)
    }

    #[test]
    fn every_change_of_a_level_changes_its_version() {
        let mesh = |scene: &mut Scene, high: f32, two_sided: bool, transform: Affine3A| {
            let mesh = OccluderMesh::cuboid(&Aabb::from_arrays([1.0; 3], [1.5, 1.5, high])).unwrap();
            let mesh = scene.add_mesh(mesh.with_two_sided(two_sided));
            let id = scene.id_at(0).unwrap();
            scene.set_mesh(id, mesh, transform).unwrap();
        };
        let moved = Affine3A::from_translation(Vec3::X * 0.1);
        let bounds = |scene: &mut Scene, id, min: f32, max: f32| {
            scene.set_bounds(id, Aabb::from_arrays([min; 3], [max; 3])).unwrap();
            scene.set_triangles(id, [[Vec3::ONE, Vec3::ONE + Vec3::X, Vec3::ONE + Vec3::Y]]).unwrap();
        };
        let hashes = [
            hash(|_, _| {}),
            hash(|scene, id| bounds(scene, id, 0.5, 2.0)),
            hash(|scene, id| bounds(scene, id, 1.0, 2.5)),
            hash(|scene, id| scene.set_layers(id, 2).unwrap()),
            hash(|scene, id| scene.set_cost(id, 7).unwrap()),
            hash(|scene, id| scene.set_occluder(id, false).unwrap()),
            hash(|scene, id| scene.set_never_cull(id, true).unwrap()),
            hash(|scene, id| scene.set_one_sided(id, true).unwrap()),
            hash(|scene, id| scene.set_see_through(id, true).unwrap()),
            hash(|scene, id| {
                scene.set_triangles(id, [[Vec3::ONE, Vec3::ONE + Vec3::X, Vec3::ONE + Vec3::Z]]).unwrap()
            }),
            hash(|scene, id| scene.set_triangles(id, []).unwrap()),
            hash(|scene, _| mesh(scene, 1.5, false, Affine3A::IDENTITY)),
            hash(|scene, _| mesh(scene, 1.6, false, Affine3A::IDENTITY)),
            hash(|scene, _| mesh(scene, 1.5, true, Affine3A::IDENTITY)),
            hash(|scene, _| mesh(scene, 1.5, false, moved)),
            hash(|scene, _| scene.set_origin(DVec3::X).unwrap()),
            hash(|scene, _| {
                scene.insert(Aabb::from_arrays([1.0; 3], [2.0; 3]));
            }),
            hash(|scene, id| scene.remove(id).unwrap()),
        ];
        for (number, hash) in hashes.iter().enumerate() {
            assert!(!hashes[..number].contains(hash), "change {number}");
        }
    }

    #[test]
    fn an_occluder_that_is_not_always_drawn_counts_as_none() {
        let insert = |scene: &mut Scene| scene.insert(Aabb::from_arrays([1.0; 3], [2.0; 3]));
        let none = hash(|scene, id| {
            scene.set_occluder(id, false).unwrap();
            insert(scene);
        });
        let parent = hash(|scene, id| {
            let child = insert(scene);
            scene.set_hlod_parent(child, Some(id)).unwrap();
        });
        let child = hash(|scene, id| {
            let parent = insert(scene);
            scene.set_hlod_parent(id, Some(parent)).unwrap();
        });
        let ranged = hash(|scene, id| {
            insert(scene);
            scene.set_draw_range(id, DrawRange { end: 9.0, ..DrawRange::ALWAYS }).unwrap();
        });
        assert_eq!([parent, child, ranged], [none; 3], "HLOD parent, child, object with a draw range");
        for never_cull in [false, true] {
            let mut scene = Scene::new();
            let bounds = Aabb::from_arrays([1.0; 3], [2.0; 3]);
            let id = scene.insert(Object { occluder: true, never_cull, ..Object::new(bounds) });
            let (object, _) = level_object(&scene, id).unwrap();
            assert_eq!(object.occluder, !never_cull, "an occluder, never culled: {never_cull}");
        }
        // The draw range of an object that is no occluder is not part of the version.
        let target = hash(|scene, id| {
            scene.set_occluder(id, false).unwrap();
            let other = insert(scene);
            scene.set_draw_range(other, DrawRange { end: 9.0, ..DrawRange::ALWAYS }).unwrap();
        });
        assert_eq!(target, none, "draw ranges of other objects are no part of the level");
    }

    #[test]
    fn a_one_sided_occluder_stays_one_if_its_front_is_certain() {
        let mut scene = Scene::new();
        let leaf = SharedTriangles::from([[Vec3::ZERO, Vec3::X, Vec3::Y]]);
        for (one_sided, height, expected) in [
            (true, 1.0, [true, true]),
            (true, -1.0, [true, true]),
            (true, 0.0, [false, false]),
            (false, 1.0, [true, false]),
            (false, 0.0, [true, false]),
        ] {
            let bounds = Aabb::from_arrays([0.0; 3], [1.0; 3]);
            let id = scene.insert(Object { occluder: true, one_sided, ..Object::new(bounds) });
            let placement = DAffine3::from_scale(DVec3::new(1.0, 1.0, height));
            scene.set_triangles(id, leaf.placed(placement)).unwrap();
            let (object, _) = level_object(&scene, id).unwrap();
            let found = [object.occluder, object.one_sided];
            assert_eq!(found, expected, "occluder, one-sided: {one_sided}, scaled by {height}");
        }
    }

    #[test]
    fn glass_is_another_object_only_as_an_occluder() {
        let bounds = Aabb::from_arrays([1.0; 3], [2.0; 3]);
        for occluder in [false, true] {
            let [opaque, glass] = [false, true].map(|see_through| {
                let object = Object { occluder, see_through, ..Object::new(bounds) };
                object_hash(&object, Triangles::default(), None)
            });
            assert_eq!(opaque != glass, occluder, "the hash of glass differs, of an occluder: {occluder}");
        }
    }
}
