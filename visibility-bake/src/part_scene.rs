//! Scenes of a part of the objects of another scene.
//!
//! All that is found for a viewcell after a first sweep is found in a scene of the objects that the sweep
//! left. What a hidden object would occlude is hidden behind others anyway: the first surface on a line of
//! sight is seen. So an edit of the level that does not touch these objects cannot change what is found.

use std::collections::HashMap;
use visibility_core::occlusion::OccluderMesh;
use visibility_core::scene::MeshId;
use visibility_core::{ObjectId, Scene};

/// Occluder meshes that a part has already, by their addresses in the whole scene. A mesh of several objects
/// is stored once.
pub(crate) type Meshes = HashMap<*const OccluderMesh, MeshId>;

/// Copies the content of an object `id` of `scene` to the object `new` of `part`: its triangles if
/// `with_triangles`, and its occluder mesh if there are `meshes`.
pub(crate) fn copy_content(
    scene: &Scene,
    id: ObjectId,
    part: &mut Scene,
    new: ObjectId,
    with_triangles: bool,
    meshes: Option<&mut Meshes>,
) {
    if with_triangles
        && let Ok(triangles) = scene.triangles(id)
        && !triangles.is_empty()
    {
        let _ = part.set_triangles(new, triangles);
    }
    if let Some(meshes) = meshes
        && let Some((mesh, transform)) = scene.occluder(id)
    {
        let shared = *meshes.entry(mesh).or_insert_with(|| part.add_mesh(mesh.clone()));
        let _ = part.set_mesh(new, shared, *transform);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tiled_scene::TiledScene;
    use visibility_core::glam::{Affine3A, Vec3};
    use visibility_core::{Aabb, Object};

    fn hashes(scene: &Scene) -> Vec<u64> {
        TiledScene::new(scene).objects.iter().map(|object| object.hash).collect()
    }

    /// Makes a scene of one object, which `change` may change, and returns the hash of the object.
    fn hash(change: impl Fn(&mut Scene, ObjectId)) -> u64 {
        let mut scene = Scene::new();
        let id =
            scene.insert(Object { occluder: true, ..Object::new(Aabb::from_arrays([1.0; 3], [2.0; 3])) });
        scene.set_triangles(id, [[Vec3::ONE, Vec3::X, Vec3::Y]]).unwrap();
        change(&mut scene, id);
        hashes(&scene)[0]
    }

    #[test]
    fn every_change_of_an_object_changes_its_hash() {
        let mesh = |scene: &mut Scene, high: f32, two_sided: bool, transform: Affine3A| {
            let mesh = OccluderMesh::cuboid(&Aabb::from_arrays([1.0; 3], [1.5, 1.5, high])).unwrap();
            let mesh = scene.add_mesh(mesh.with_two_sided(two_sided));
            let id = scene.id_at(0).unwrap();
            scene.set_mesh(id, mesh, transform).unwrap();
        };
        let moved = Affine3A::from_translation(Vec3::X * 0.1);
        let bounds = |scene: &mut Scene, id, min: f32, max: f32| {
            scene.set_bounds(id, Aabb::from_arrays([min; 3], [max; 3])).unwrap();
            scene.set_triangles(id, [[Vec3::ONE, Vec3::X, Vec3::Y]]).unwrap();
        };
        let hashes = [
            hash(|_, _| {}),
            hash(|scene, id| bounds(scene, id, 0.5, 2.0)),
            hash(|scene, id| bounds(scene, id, 1.0, 2.5)),
            hash(|scene, id| scene.set_layers(id, 2).unwrap()),
            hash(|scene, id| scene.set_cost(id, 7).unwrap()),
            hash(|scene, id| scene.set_occluder(id, false).unwrap()),
            hash(|scene, id| scene.set_never_cull(id, true).unwrap()),
            hash(|scene, id| scene.set_triangles(id, [[Vec3::ONE, Vec3::X, Vec3::Z]]).unwrap()),
            hash(|scene, id| scene.set_triangles(id, []).unwrap()),
            hash(|scene, _| mesh(scene, 1.5, false, Affine3A::IDENTITY)),
            hash(|scene, _| mesh(scene, 1.6, false, Affine3A::IDENTITY)),
            hash(|scene, _| mesh(scene, 1.5, true, Affine3A::IDENTITY)),
            hash(|scene, _| mesh(scene, 1.5, false, moved)),
        ];
        for (number, hash) in hashes.iter().enumerate() {
            assert!(!hashes[..number].contains(hash), "change {number}");
        }
    }

    #[test]
    fn parts_have_the_content_of_the_whole() {
        let mut scene = Scene::new();
        scene.set_origin(visibility_core::glam::DVec3::splat(1e6)).unwrap();
        let boxes = (0..9).map(|i| Aabb::from_arrays([i as f32; 3], [i as f32 + 1.0; 3]));
        let ids =
            scene.insert_batch(boxes.map(|bounds| Object { occluder: true, cost: 3, ..Object::new(bounds) }));
        let mesh = scene.add_mesh(OccluderMesh::cuboid(&Aabb::from_arrays([0.2; 3], [0.8; 3])).unwrap());
        for (i, &id) in ids.iter().enumerate() {
            let at = Vec3::splat(i as f32);
            scene.set_triangles(id, [[at, at + Vec3::X, at + Vec3::Y]]).unwrap();
            if i % 3 > 0 {
                scene.set_mesh(id, mesh, Affine3A::from_translation(at)).unwrap();
            }
        }
        let level = TiledScene::new(&scene);
        for with_triangles in [false, true] {
            let part = level.scene_of(
                &[7, 3, 4],
                [Object::new(Aabb::from_arrays([0.0; 3], [1.0; 3]))],
                with_triangles,
            );
            let part = part.unwrap();
            assert!(part.origin() == scene.origin() && part.len() == 4);
            for (id, new) in [ids[7], ids[3], ids[4]].into_iter().zip(part.ids()) {
                assert_eq!(part.object(new), scene.object(id));
                let triangles = if with_triangles { scene.triangles(id).unwrap() } else { &[] };
                assert_eq!(part.triangles(new).unwrap(), triangles);
                assert_eq!(part.occluder(new), scene.occluder(id).filter(|_| !with_triangles));
            }
        }
    }
}
