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
/// their front, since they are drawn with back-face culling. A material with `cull_mode: Some(Face::Front)`
/// draws the backs alone, so that what is between a front and a back is seen: give such an entity no occluder
/// but an [`Occluder::Custom`] of the triangles turned round.
///
/// bevy draws an entity only once its mesh and its material are loaded and its pipeline is compiled. The
/// occluder waits for the mesh, and not for the others: until then, what is behind it is hidden by a wall
/// that is not drawn. Where that shows, insert the component once the entity is drawn.
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
    let (indices, restart): (Vec<u32>, u32) = match mesh.try_indices_option().ok()? {
        Some(Indices::U16(indices)) => (indices.iter().map(|&i| u32::from(i)).collect(), u16::MAX.into()),
        Some(Indices::U32(indices)) => (indices.clone(), u32::MAX),
        None => ((0..positions.len() as u32).collect(), u32::MAX),
    };
    let triangles: Vec<[u32; 3]> = match mesh.primitive_topology() {
        PrimitiveTopology::TriangleList => indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
        // The greatest index begins another strip. Every second triangle of a strip has the opposite winding.
        PrimitiveTopology::TriangleStrip => (indices.split(|&index| index == restart))
            .flat_map(|strip| strip.windows(3).enumerate())
            .map(|(i, t)| if i % 2 == 0 { [t[0], t[1], t[2]] } else { [t[1], t[0], t[2]] })
            .collect(),
        _ => return None,
    };
    let positions: Vec<Vec3> = positions.iter().map(|&p| Vec3::from_array(p)).collect();
    OccluderMesh::from_indexed(&positions, &triangles).ok()
}

#[cfg(test)]
mod tests {
    use super::occluder_of_mesh;
    use bevy_asset::RenderAssetUsages;
    use bevy_mesh::{Indices, Mesh, PrimitiveTopology};

    #[test]
    fn strips_end_at_the_greatest_index() {
        let positions: Vec<[f32; 3]> =
            (0..6_u8).map(|i| [f32::from(i), f32::from(i % 2), f32::from(i * i)]).collect();
        let count = |indices: Indices| {
            let mesh = Mesh::new(PrimitiveTopology::TriangleStrip, RenderAssetUsages::default());
            let mesh = mesh.with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions.clone());
            occluder_of_mesh(&mesh.with_inserted_indices(indices)).map(|made| made.triangles().len())
        };
        let two = [0, 1, 2, u16::MAX, 3, 4, 5];
        assert_eq!(count(Indices::U16(two.to_vec())), Some(2), "two strips of a triangle each");
        assert_eq!(count(Indices::U32(vec![0, 1, 2, u32::MAX, 3, 4, 5])), Some(2), "two strips again");
        assert_eq!(count(Indices::U32(two.map(u32::from).to_vec())), None, "an index beyond the positions");
    }
}
