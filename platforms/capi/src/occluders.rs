//! What objects hide others with, and the triangles that they are drawn with.

use crate::error::{border, vis_status};
use crate::moves::affine;
use crate::pointer::{array, out, reference};
use crate::scene::{vis_box, vis_scene};
use visibility_core::glam::{Affine3A, Vec3};
use visibility_core::occlusion::Preparation;
use visibility_core::scene::{MeshId, ToAffine};
use visibility_core::{ObjectId, OccluderMesh};

/// Stores an occluder mesh in a scene, for any number of objects, and writes its id. `positions` has 3
/// numbers per vertex, `indices` 3 per triangle, counter-clockwise from the front. Only front faces hide,
/// unless `two_sided`. Each pixel that the mesh covers must be covered by the object as drawn, or visible
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
        // SAFETY: rule P1 of `visibility.h`; 3 numbers for each of `position_count`.
        let positions = unsafe { array(positions.cast::<[f32; 3]>(), position_count, "positions") }?;
        // SAFETY: rule P1 of `visibility.h`; 3 indices for each of `triangle_count`.
        let indices = unsafe { array(indices.cast::<[u32; 3]>(), triangle_count, "indices") }?;
        // SAFETY: rules P1 and P2 of `visibility.h`.
        let (scene, mut id) = unsafe { (reference(scene, "scene")?, out(mesh, "mesh")?) };
        let positions: Vec<Vec3> = positions.iter().copied().map(Vec3::from_array).collect();
        let mesh = OccluderMesh::from_indexed(&positions, indices)?.with_two_sided(two_sided);
        id.set(scene.write()?.scene.add_mesh(mesh).to_bits());
        Ok(())
    })
}

/// Stores the occluder mesh of a box in a scene and writes its id: for walls, houses and other solids.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_add_box_mesh(
    scene: *mut vis_scene,
    bounds: *const vis_box,
    mesh: *mut u64,
) -> vis_status {
    border(|| {
        // SAFETY: rule P1 of `visibility.h`.
        let (scene, bounds) = unsafe { (reference(scene, "scene")?, reference(bounds, "bounds")?) };
        // SAFETY: rule P2 of `visibility.h`.
        let mut id = unsafe { out(mesh, "mesh") }?;
        let mesh = OccluderMesh::cuboid(&(*bounds).into())?;
        id.set(scene.write()?.scene.add_mesh(mesh).to_bits());
        Ok(())
    })
}

/// Removes an occluder mesh from a scene. Its id names no mesh any more. Objects that have the mesh keep it
/// until they get another or lose it; its memory is freed with the last of them, at once if there is none.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_remove_mesh(scene: *mut vis_scene, mesh: u64) -> vis_status {
    border(|| {
        // SAFETY: rule P1 of `visibility.h`.
        let scene = unsafe { reference(scene, "scene") }?;
        Ok(scene.write()?.scene.remove_mesh(MeshId::from_bits(mesh))?)
    })
}

/// Writes the number of occluder meshes that a scene holds: those that were added and not removed, those that
/// an object keeps, and those prepared from the triangles of objects.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_mesh_count(scene: *const vis_scene, count: *mut usize) -> vis_status {
    border(|| {
        // SAFETY: rules P1 and P2 of `visibility.h`.
        let (scene, mut count) = unsafe { (reference(scene, "scene")?, out(count, "count")?) };
        count.set(scene.read()?.scene.mesh_count());
        Ok(())
    })
}

/// Gives an object an occluder mesh, which hides others while the object has `VIS_OBJECT_OCCLUDER`.
/// `transform` is a matrix of 16 numbers from mesh to scene coordinates, column-major, with the last row
/// 0 0 0 1; null for the identity. An object with local bounds is moved there; set bounds before, since a
/// change of bounds takes the mesh away. A mesh that reaches out of the bounds hides nothing, and
/// `vis_pipeline_lacks` says so.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_set_mesh(
    scene: *mut vis_scene,
    object: u64,
    mesh: u64,
    transform: *const f32,
) -> vis_status {
    border(|| {
        // SAFETY: rule P1 of `visibility.h`.
        let scene = unsafe { reference(scene, "scene") }?;
        let transform = if transform.is_null() {
            Affine3A::IDENTITY
        } else {
            // SAFETY: rule P1 of `visibility.h`; 16 numbers.
            affine(unsafe { reference(transform.cast::<[f32; 16]>(), "transform") }?)?.to_affine()
        };
        let (id, mesh) = (ObjectId::from_bits(object), MeshId::from_bits(mesh));
        Ok(scene.write()?.scene.set_mesh(id, mesh, transform)?)
    })
}

/// Replaces the triangles of an object, 9 numbers each, in scene coordinates, for
/// `vis_scene_prepare_occluders` and `vis_measure_compare`. The object's bounds must contain them, or
/// they are an error. They are taken away when the object moves.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_set_triangles(
    scene: *mut vis_scene,
    object: u64,
    triangles: *const f32,
    count: usize,
) -> vis_status {
    border(|| {
        // SAFETY: rule P1 of `visibility.h`; 9 numbers for each of `count`.
        let triangles = unsafe { array(triangles.cast::<[[f32; 3]; 3]>(), count, "triangles") }?;
        // SAFETY: rule P1 of `visibility.h`.
        let scene = unsafe { reference(scene, "scene") }?;
        let triangles: Vec<_> = triangles.iter().map(|corners| corners.map(Vec3::from_array)).collect();
        Ok(scene.write()?.scene.set_triangles(ObjectId::from_bits(object), triangles)?)
    })
}

/// Makes occluder meshes from the triangles of objects that have `VIS_OBJECT_OCCLUDER` and no mesh, and
/// writes the number of objects that got one to `count`. Once after loading.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_prepare_occluders(scene: *mut vis_scene, count: *mut usize) -> vis_status {
    border(|| {
        // SAFETY: rules P1 and P2 of `visibility.h`.
        let (scene, mut count) = unsafe { (reference(scene, "scene")?, out(count, "count")?) };
        count.set(scene.write()?.scene.prepare_occluders(&Preparation::default()));
        Ok(())
    })
}
