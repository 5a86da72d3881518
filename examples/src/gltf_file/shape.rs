//! Geometry of a primitive: its positions at rest, morphed and skinned, and boxes of its possible positions.

use super::buffers::Buffers;
use super::motion::{Box64, Motion, around};
use super::nodes::Nodes;
use crate::error::SourceError;
use glam::{DMat4, DVec3, Vec3};
use gltf::mesh::Semantic;
use std::path::Path;

/// Positions of the vertices of a primitive.
#[derive(Default)]
pub(super) struct Shape {
    /// Positions at rest in mesh space, morphed by the weights at rest.
    pub positions: Vec<Vec3>,
    /// Box of each vertex over all possible morph weights, in mesh space. Empty without morph targets.
    morphed: Vec<Box64>,
    /// Skin, `None` for a primitive that follows its node.
    skin: Option<Skin>,
}

/// Skin of a primitive.
struct Skin {
    /// For each joint, the index of its node, and the matrix from mesh space to the joint's space.
    joints: Vec<(usize, DMat4)>,
    /// For each vertex, the joints that move it, with weights. Weights are not negative and sum to 1.
    influences: Vec<Vec<(usize, f64)>>,
}

impl Shape {
    /// Reads the positions of a primitive of a node's mesh.
    ///
    /// # Errors
    ///
    /// Returns the errors of reading the accessors, and [`SourceError::Content`] when the number of elements
    /// of a morph target or a skin differs from the number of positions, or a joint index is beyond the
    /// skin's joints. `place` names the primitive.
    pub(super) fn read(
        node: &gltf::Node<'_>,
        primitive: &gltf::Primitive<'_>,
        mut positions: Vec<Vec3>,
        motion: &Motion,
        buffers: &Buffers<'_>,
        (path, place): (&Path, &str),
    ) -> Result<Self, SourceError> {
        let wrong = |problem: String| SourceError::content(path, place, problem);
        let weights = node.weights().or(node.mesh().and_then(|mesh| mesh.weights())).unwrap_or_default();
        let ranges = motion.weights(node.index());
        let mut morphed = Vec::new();
        for (target, accessors) in primitive.morph_targets().enumerate() {
            let Some(accessor) = accessors.positions() else { continue };
            if accessor.count() != positions.len() {
                let (few, many) = (accessor.count(), positions.len());
                return Err(wrong(format!(
                    "morph target {target} has {few} positions, the primitive {many}"
                )));
            }
            let displacements = buffers.displacements(&accessor)?;
            if morphed.is_empty() {
                morphed = positions.iter().map(|p| (p.as_dvec3(), p.as_dvec3())).collect();
            }
            let at_rest = weights.get(target).copied().unwrap_or(0.0);
            // If no clip changes a target, a game may still give it any weight from 0 to 1: so it is in
            // `ranges`.
            let [low, high] = ranges.get(target).copied().unwrap_or([0.0, 1.0]);
            let (low, high) = (low.min(at_rest.into()), high.max(at_rest.into()));
            for ((position, bounds), by) in positions.iter_mut().zip(&mut morphed).zip(displacements) {
                *position += by * at_rest;
                let ends = [by.as_dvec3() * low, by.as_dvec3() * high];
                bounds.0 += ends[0].min(ends[1]);
                bounds.1 += ends[0].max(ends[1]);
            }
        }
        let skin = node.skin().map(|skin| Skin::read(&skin, primitive, positions.len(), buffers, &wrong));
        Ok(Self { positions, morphed, skin: skin.transpose()?.flatten() })
    }

    /// Returns whether the shape deforms, by morph targets or by a skin.
    pub(super) fn is_soft(&self) -> bool {
        !self.morphed.is_empty() || self.skin.is_some()
    }

    /// Returns the matrix from mesh space to world space, without the instance matrix: that of the node, or
    /// of the skin's first joint.
    pub(super) fn world(&self, node: usize, nodes: &Nodes) -> DMat4 {
        let joint = self.skin.as_ref().and_then(|skin| skin.joints.first());
        joint.map_or(nodes.worlds[node], |(joint, bind)| nodes.worlds[*joint] * *bind)
    }

    /// Returns the positions at rest in world space. `instance` maps mesh space to the node's space.
    pub(super) fn placed(&self, node: usize, instance: &DMat4, nodes: &Nodes) -> Vec<DVec3> {
        let Some(skin) = &self.skin else {
            let world = nodes.worlds[node] * *instance;
            return self.positions.iter().map(|p| world.transform_point3(p.as_dvec3())).collect();
        };
        let worlds: Vec<DMat4> =
            skin.joints.iter().map(|(joint, bind)| nodes.worlds[*joint] * *bind).collect();
        let place = |(position, joints): (&Vec3, &Vec<(usize, f64)>)| {
            let parts = joints.iter().map(|&(joint, weight)| (worlds[joint], weight));
            parts.map(|(world, weight)| world.transform_point3(position.as_dvec3()) * weight).sum()
        };
        self.positions.iter().zip(&skin.influences).map(place).collect()
    }

    /// Returns boxes that contain the vertices at `indices` over all morph weights. Each box comes with the
    /// node that moves it and the matrix to the node's space. A skinned vertex is a weighted mean of its
    /// positions under its joints, so it lies within the box around these.
    pub(super) fn boxes(&self, node: usize, instance: &DMat4, indices: &[u32]) -> Vec<(usize, DMat4, Box64)> {
        let of_vertex = |index: usize| match self.morphed.get(index) {
            Some(&bounds) => bounds,
            None => (self.positions[index].as_dvec3(), self.positions[index].as_dvec3()),
        };
        let Some(skin) = &self.skin else {
            let ends = indices.iter().map(|&index| of_vertex(index as usize));
            return vec![(node, *instance, around(ends.flat_map(|(low, high)| [low, high])))];
        };
        let mut boxes: Vec<_> =
            skin.joints.iter().map(|&(joint, bind)| (joint, bind, super::motion::EMPTY)).collect();
        for &index in indices {
            let bounds = of_vertex(index as usize);
            for &(joint, _) in &skin.influences[index as usize] {
                boxes[joint].2 = super::motion::union(boxes[joint].2, bounds);
            }
        }
        boxes.retain(|(.., bounds)| bounds.0.cmple(bounds.1).all());
        boxes
    }
}

impl Skin {
    /// Reads the skin of a primitive with `count` vertices. `None` for a primitive without joints.
    fn read(
        skin: &gltf::Skin<'_>,
        primitive: &gltf::Primitive<'_>,
        count: usize,
        buffers: &Buffers<'_>,
        wrong: &dyn Fn(String) -> SourceError,
    ) -> Result<Option<Self>, SourceError> {
        let nodes: Vec<usize> = skin.joints().map(|joint| joint.index()).collect();
        buffers.charge(nodes.len(), || format!("skin {}", skin.index()))?;
        let binds: Vec<DMat4> = match skin.inverse_bind_matrices() {
            None => vec![DMat4::IDENTITY; nodes.len()],
            Some(accessor) => {
                let matrices = buffers.vectors::<16>(&accessor)?;
                matrices.iter().map(|matrix| DMat4::from_cols_array(&matrix.map(f64::from))).collect()
            }
        };
        if binds.len() < nodes.len() {
            let (few, many) = (binds.len(), nodes.len());
            return Err(wrong(format!("its skin has {few} inverse bind matrices for {many} joints")));
        }
        let mut influences = vec![Vec::new(); count];
        let mut is_skinned = false;
        for set in 0.. {
            let accessors = (primitive.get(&Semantic::Joints(set)), primitive.get(&Semantic::Weights(set)));
            let (Some(joints), Some(weights)) = accessors else { break };
            let (joints, weights) = (buffers.vectors::<4>(&joints)?, buffers.vectors::<4>(&weights)?);
            if joints.len() != count || weights.len() != count {
                let few = joints.len().min(weights.len());
                return Err(wrong(format!("its {count} vertices have {few} joints and weights")));
            }
            is_skinned = true;
            for ((influences, joints), weights) in influences.iter_mut().zip(&joints).zip(&weights) {
                for (&joint, &weight) in joints.iter().zip(weights).filter(|&(_, &weight)| weight > 0.0) {
                    if joint as usize >= nodes.len() {
                        return Err(wrong(format!(
                            "joint {joint} is beyond the {} of its skin",
                            nodes.len()
                        )));
                    }
                    influences.push((joint as usize, f64::from(weight)));
                }
            }
        }
        if !is_skinned || nodes.is_empty() {
            return Ok(None);
        }
        for influences in &mut influences {
            if influences.is_empty() {
                influences.push((0, 1.0));
            }
            let sum: f64 = influences.iter().map(|(_, weight)| weight).sum();
            influences.iter_mut().for_each(|(_, weight)| *weight /= sum);
        }
        Ok(Some(Self { joints: nodes.into_iter().zip(binds).collect(), influences }))
    }
}
