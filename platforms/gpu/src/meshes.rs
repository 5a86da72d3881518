//! Meshes of a scene in the card's memory.

use crate::Gpu;
use visibility_core::Scene;
use visibility_frame::draw_list::DrawIndexedIndirect;
use wgpu::BufferUsages;

/// Triangles of all objects of a scene, each object a mesh of its own.
#[derive(Debug)]
pub struct Meshes {
    /// Coordinates of all vertices, relative to the scene's origin.
    pub(crate) vertices: wgpu::Buffer,
    /// Indices 0, 1, 2 and so on, as many as the largest mesh has vertices, since triangles share no
    /// vertices.
    pub(crate) indices: wgpu::Buffer,
    /// For each object, by index, the draw command of one instance.
    commands: Vec<DrawIndexedIndirect>,
}

impl Meshes {
    /// Uploads the triangles of a scene's objects. Objects without triangles draw nothing.
    pub fn new(gpu: &Gpu, scene: &Scene) -> Self {
        let mut vertices: Vec<[f32; 3]> = Vec::new();
        let mut commands = vec![DrawIndexedIndirect::default(); scene.index_limit()];
        let mut most = 0;
        for id in scene.ids() {
            let triangles = scene.triangles(id).unwrap_or_default();
            let count = triangles.len() as u32 * 3;
            most = most.max(count);
            commands[id.index()] = DrawIndexedIndirect {
                index_count: count,
                instance_count: 1,
                first_index: 0,
                base_vertex: vertices.len() as i32,
                first_instance: id.index() as u32,
            };
            vertices.extend(triangles.iter().flatten().map(|corner| corner.to_array()));
        }
        let indices: Vec<u32> = (0..most).collect();
        Self {
            vertices: gpu.buffer("vertices", &vertices, BufferUsages::VERTEX),
            indices: gpu.buffer("indices", &indices, BufferUsages::INDEX),
            commands,
        }
    }

    /// Returns for each object, by index, a draw command of one instance. Its instance number is the object's
    /// index.
    pub fn commands(&self) -> &[DrawIndexedIndirect] {
        &self.commands
    }
}
