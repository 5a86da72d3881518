//! Occluder meshes of objects, and the triangles that objects are drawn with.

use crate::error::{border, vis_status};
use crate::moves::affine;
use crate::pointer::{array, out, reference};
use crate::scene::{vis_box, vis_scene};
use visibility_core::glam::{Affine3A, Vec3};
use visibility_core::occlusion::Preparation;
use visibility_core::scene::{MeshId, ToAffine};
use visibility_core::{ObjectId, OccluderMesh};

/// Stores an occluder mesh in a scene, for any number of objects, and writes its id. `positions` has 3
/// numbers per vertex, `indices` 3 per triangle, counter-clockwise from the front. Only front faces occlude,
/// unless `two_sided`. The drawn object must cover every pixel that the mesh covers; otherwise visible
/// objects are hidden.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_add_mesh(
    scene: *mut vis_scene,
    positions: *const f32,
    position_count: usize,
    indices: *const u32,
    triangle_count: usize,
    two_sided: bool,
    mesh: *mut u64,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, null or valid to read: 3 numbers per position.
        let positions = unsafe { array(positions.cast::<[f32; 3]>(), position_count, "positions") }?;
        // SAFETY: by rule P1 of `visibility.h`, null or valid to read: 3 indices per triangle.
        let indices = unsafe { array(indices.cast::<[u32; 3]>(), triangle_count, "indices") }?;
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (scene, mut id) = unsafe { (reference(scene, "scene")?, out(mesh, "mesh")?) };
        let positions: Vec<Vec3> = positions.iter().copied().map(Vec3::from_array).collect();
        let mesh = OccluderMesh::from_indexed(&positions, indices)?.with_two_sided(two_sided);
        id.set(scene.write()?.scene.add_mesh(mesh).to_bits());
        Ok(())
    })
}

/// Stores the occluder mesh of a box in a scene and writes its id, for walls, houses and other solids.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_add_box_mesh(
    scene: *mut vis_scene,
    bounds: *const vis_box,
    mesh: *mut u64,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let (scene, bounds) = unsafe { (reference(scene, "scene")?, reference(bounds, "bounds")?) };
        // SAFETY: by rule P2 of `visibility.h`, the pointer is null or valid to write.
        let mut id = unsafe { out(mesh, "mesh") }?;
        let mesh = OccluderMesh::cuboid(&(*bounds).into())?;
        id.set(scene.write()?.scene.add_mesh(mesh).to_bits());
        Ok(())
    })
}

/// Removes an occluder mesh from a scene. Its id becomes invalid. Objects keep the mesh until they get
/// another or lose it. Its memory is freed when no object has it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_remove_mesh(scene: *mut vis_scene, mesh: u64) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let scene = unsafe { reference(scene, "scene") }?;
        Ok(scene.write()?.scene.remove_mesh(MeshId::from_bits(mesh))?)
    })
}

/// Writes the number of occluder meshes in a scene: meshes that were added and not removed, removed meshes
/// that an object still has, and meshes prepared from the triangles of objects.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_mesh_count(scene: *const vis_scene, count: *mut usize) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (scene, mut count) = unsafe { (reference(scene, "scene")?, out(count, "count")?) };
        count.set(scene.read()?.scene.mesh_count());
        Ok(())
    })
}

/// Gives an object an occluder mesh, which occludes while the object has the flag `VIS_OBJECT_OCCLUDER`.
/// `transform` is a matrix of 16 numbers from mesh to scene coordinates, column-major, with the last row 0 0
/// 0 1; null for the identity. An object with local bounds is moved by the same transform. Set bounds before
/// the mesh, since a change of bounds removes the mesh. A mesh that reaches outside of the bounds hides
/// nothing, and `vis_pipeline_lacks` reports it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_set_mesh(
    scene: *mut vis_scene,
    object: u64,
    mesh: u64,
    transform: *const f32,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let scene = unsafe { reference(scene, "scene") }?;
        let transform = if transform.is_null() {
            Affine3A::IDENTITY
        } else {
            // SAFETY: by rule P1 of `visibility.h`, null or valid to read: 16 numbers.
            affine(unsafe { reference(transform.cast::<[f32; 16]>(), "transform") }?)?.to_affine()
        };
        let (id, mesh) = (ObjectId::from_bits(object), MeshId::from_bits(mesh));
        Ok(scene.write()?.scene.set_mesh(id, mesh, transform)?)
    })
}

/// Replaces the triangles of an object, 9 numbers each, in scene coordinates, for
/// `vis_scene_prepare_occluders`, `vis_scene_prove_from` and `vis_measure_compare`. An error if the object's
/// bounds do not contain them. The object loses its triangles when it moves.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_set_triangles(
    scene: *mut vis_scene,
    object: u64,
    triangles: *const f32,
    count: usize,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, null or valid to read: 9 numbers for each of `count`.
        let triangles = unsafe { array(triangles.cast::<[[f32; 3]; 3]>(), count, "triangles") }?;
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let scene = unsafe { reference(scene, "scene") }?;
        let triangles: Vec<_> = triangles.iter().map(|corners| corners.map(Vec3::from_array)).collect();
        Ok(scene.write()?.scene.set_triangles(ObjectId::from_bits(object), triangles)?)
    })
}

/// Makes occluder meshes from the triangles of objects that have `VIS_OBJECT_OCCLUDER` and no mesh. Writes
/// the number of objects that got one to `count`. Call this once after loading.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_prepare_occluders(scene: *mut vis_scene, count: *mut usize) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (scene, mut count) = unsafe { (reference(scene, "scene")?, out(count, "count")?) };
        count.set(scene.write()?.scene.prepare_occluders(&Preparation::default()));
        Ok(())
    })
}
