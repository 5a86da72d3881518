//! Component that makes entities occlude what is behind them.

use bevy_ecs::prelude::*;
use bevy_math::Affine3A;
use bevy_mesh::{Indices, Mesh, PrimitiveTopology, VertexAttributeValues};
use std::sync::Arc;
use visibility_core::OccluderMesh;
use visibility_core::geometry::keeps_orientation;
use visibility_core::glam::Vec3;

/// Component that makes an entity occlude the entities behind it, for cameras that cull by occlusion.
///
/// The entity must be drawn opaque, by a mesh that covers at least what the occluder covers: no transparent
/// material, no alpha mask, no vertex shader that moves the mesh elsewhere. Faces only occlude as seen from
/// their front, since they are drawn with back-face culling.
///
/// bevy draws an entity only once its material is loaded and its pipeline is compiled. The occluder does not
/// wait for these: until then, what is behind it is hidden by a wall that is not drawn. Where that shows,
/// insert the component once the entity is drawn.
///
/// Walls, floors, terrain and houses are good occluders. Small things, and meshes with many triangles, cost
/// more than they save: give these a simpler occluder that lies inside of them, or none.
///
/// Never an occluder, whatever this component says: an entity that is hidden by its [`Visibility`], that has
/// a `VisibilityRange`, `SkinnedMesh` or `MeshMorphWeights`, that is on a layer above 30, that is mirrored
/// (its transform has a negative determinant), that is a light too, or that has `NoFrustumCulling` or no
/// [`Aabb`].
///
/// [`Visibility`]: bevy_camera::visibility::Visibility
/// [`Aabb`]: bevy_camera::primitives::Aabb
#[derive(Component, Clone, Debug)]
pub enum Occluder {
    /// The triangles of the entity's `Mesh3d`. The entity occludes nothing until the asset is loaded, or if
    /// its data is not kept in the main world. Changes of the asset are followed.
    Mesh,
    /// The entity's local box, its [`Aabb`](bevy_camera::primitives::Aabb), less what rounding may have added
    /// to it: for entities that are boxes.
    Box,
    /// Any mesh in the entity's local coordinates.
    Custom(Arc<OccluderMesh>),
}

/// Returns whether an entity with this transform can occlude: it is finite and surely does not mirror. Under
/// a mirroring transform, bevy draws the faces that look away.
pub(crate) fn can_occlude(affine: &Affine3A) -> bool {
    affine.is_finite() && keeps_orientation(affine) == Some(true)
}

/// Makes an occluder from a mesh. `None` unless the mesh is a triangle list or strip whose positions the main
/// world can read.
pub(crate) fn occluder_of_mesh(mesh: &Mesh) -> Option<OccluderMesh> {
    let Ok(VertexAttributeValues::Float32x3(positions)) = mesh.try_attribute(Mesh::ATTRIBUTE_POSITION) else {
        return None;
    };
    let indices: Vec<u32> = match mesh.try_indices_option().ok()? {
        Some(Indices::U16(indices)) => indices.iter().map(|&i| u32::from(i)).collect(),
        Some(Indices::U32(indices)) => indices.clone(),
        None => (0..positions.len() as u32).collect(),
    };
    let triangles: Vec<[u32; 3]> = match mesh.primitive_topology() {
        PrimitiveTopology::TriangleList => indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
        // Every second triangle of a strip has the opposite winding.
        PrimitiveTopology::TriangleStrip => (indices.windows(3).enumerate())
            .map(|(i, t)| if i % 2 == 0 { [t[0], t[1], t[2]] } else { [t[1], t[0], t[2]] })
            .collect(),
        _ => return None,
    };
    let positions: Vec<Vec3> = positions.iter().map(|&p| Vec3::from_array(p)).collect();
    OccluderMesh::from_indexed(&positions, &triangles).ok()
}
