//! Drawing of objects, from draw lists or from draw commands that are on the card already.

use crate::target::{COLOR, DEPTH, ITEMS};
use crate::{Gpu, Meshes, Target};
use bytemuck::{Pod, Zeroable};
use glam::Mat4;
use visibility_core::ObjectId;
use visibility_frame::draw_list::DrawList;
use wgpu::BufferUsages;

/// Camera in the layout of the shaders; see `shaders/camera.wgsl`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Camera {
    clip_from_scene: [f32; 16],
    size: [f32; 2],
    half_pixel: f32,
    unused: f32,
}

impl Camera {
    /// Makes the camera for pictures of `size` pixels.
    pub(crate) fn new(clip_from_scene: Mat4, size: [u32; 2]) -> Self {
        let size = size.map(|side| side as f32);
        // A displacement by d metres moves a point by d |row| / w in normalized coordinates, where a pixel is
        // 2 / size wide.
        let half = |axis: usize| 1.0 / (clip_from_scene.row(axis).truncate().length() * size[axis]);
        Self {
            clip_from_scene: clip_from_scene.to_cols_array(),
            size,
            half_pixel: half(0).max(half(1)),
            unused: 0.0,
        }
    }
}

/// Draws objects of a scene into [`Target`]s, and holds the camera.
#[derive(Debug)]
pub struct Painter {
    pipeline: wgpu::RenderPipeline,
    bindings: wgpu::BindGroup,
    /// Camera buffer, which other passes of the same picture use too.
    pub(crate) camera: wgpu::Buffer,
    colors: wgpu::Buffer,
    /// Object indices 0, 1, 2 and so on.
    object_indices: wgpu::Buffer,
    object_count: u32,
    list: DrawList,
}

impl Painter {
    /// Creates a painter for the objects of `meshes`. Colours are derived from object indices.
    pub fn new(gpu: &Gpu, meshes: &Meshes) -> Self {
        let source = concat!(include_str!("shaders/camera.wgsl"), include_str!("shaders/paint.wgsl"));
        let shader = gpu.shader("paint", source);
        let buffer = |array_stride, step_mode, attributes| {
            Some(wgpu::VertexBufferLayout { array_stride, step_mode, attributes })
        };
        let target = |format: wgpu::TextureFormat| Some(wgpu::ColorTargetState::from(format));
        let pipeline = gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("paint"),
            layout: None,
            vertex: wgpu::VertexState {
                module: &shader,
                entry_point: None,
                compilation_options: Default::default(),
                buffers: &[
                    buffer(12, wgpu::VertexStepMode::Vertex, &wgpu::vertex_attr_array![0 => Float32x3]),
                    buffer(4, wgpu::VertexStepMode::Instance, &wgpu::vertex_attr_array![1 => Uint32]),
                ],
            },
            primitive: Default::default(),
            depth_stencil: Some(depth_test(wgpu::CompareFunction::Greater, true)),
            multisample: Default::default(),
            fragment: Some(wgpu::FragmentState {
                module: &shader,
                entry_point: None,
                compilation_options: Default::default(),
                targets: &[target(ITEMS), target(COLOR)],
            }),
            multiview_mask: None,
            cache: None,
        });
        let count = meshes.commands().len() as u32;
        let colors: Vec<u32> = (0..count).map(color_of).collect();
        let colors = gpu.buffer("colors", &colors, BufferUsages::STORAGE | BufferUsages::COPY_DST);
        let usage = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
        let camera = gpu.zeros("camera", size_of::<Camera>() as u64, usage);
        let resources = [camera.as_entire_binding(), colors.as_entire_binding()];
        let bindings = gpu.bind(&pipeline.get_bind_group_layout(0), &resources);
        let object_indices: Vec<u32> = (0..count).collect();
        let object_indices = gpu.buffer("object indices", &object_indices, BufferUsages::VERTEX);
        Self {
            pipeline,
            bindings,
            camera,
            colors,
            object_indices,
            object_count: count,
            list: DrawList::new(),
        }
    }

    /// Sets the camera for everything submitted after this call.
    pub fn look(&self, gpu: &Gpu, target: &Target, clip_from_scene: Mat4) {
        let camera = Camera::new(clip_from_scene, target.size);
        gpu.queue.write_buffer(&self.camera, 0, bytemuck::bytes_of(&camera));
    }

    /// Returns the initial colour of each object, by index, with red in the lowest byte.
    pub fn own_colors(&self) -> Vec<u32> {
        (0..self.object_count).map(color_of).collect()
    }

    /// Sets the colour of each object, by index, with red in the lowest byte.
    pub fn set_colors(&self, gpu: &Gpu, colors: &[u32]) {
        let count = colors.len().min(self.object_count as usize);
        gpu.queue.write_buffer(&self.colors, 0, bytemuck::cast_slice(&colors[..count]));
    }

    /// Clears the target and draws objects into it: groups them into a draw list, uploads its commands, and
    /// submits. Objects newer than `meshes` have no triangles there: nothing of them is drawn.
    pub fn draw(&mut self, gpu: &Gpu, target: &Target, meshes: &Meshes, objects: &[ObjectId]) {
        // Each object is a mesh of its own, so its index is its key.
        self.list.group(objects.iter().copied(), |id| id.index() as u32);
        let commands =
            self.list.commands(|mesh| meshes.commands().get(mesh as usize).copied().unwrap_or_default());
        let commands: Vec<_> = commands.collect();
        let buffer = gpu.buffer("commands", &commands, BufferUsages::INDIRECT);
        let instances = gpu.buffer("instances", self.list.instances(), BufferUsages::VERTEX);
        gpu.submit(|encoder| {
            let commands = (&buffer, commands.len() as u32);
            self.record(encoder, target, meshes, &instances, commands, true);
        });
    }

    /// Records drawing by commands on the card, one for each object. The instance number of a command is the
    /// object index.
    pub(crate) fn record_all(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        target: &Target,
        meshes: &Meshes,
        commands: &wgpu::Buffer,
        clear: bool,
    ) {
        let commands = (commands, meshes.commands().len() as u32);
        self.record(encoder, target, meshes, &self.object_indices, commands, clear);
    }

    fn record(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        target: &Target,
        meshes: &Meshes,
        instances: &wgpu::Buffer,
        (commands, count): (&wgpu::Buffer, u32),
        clear: bool,
    ) {
        let store = wgpu::StoreOp::Store;
        let attachment = |view, empty| {
            let load = if clear { wgpu::LoadOp::Clear(empty) } else { wgpu::LoadOp::Load };
            let ops = wgpu::Operations { load, store };
            Some(wgpu::RenderPassColorAttachment { view, depth_slice: None, resolve_target: None, ops })
        };
        let sky = wgpu::Color { r: 0.80, g: 0.88, b: 0.96, a: 1.0 };
        // Depth 0 is infinitely far.
        let load = if clear { wgpu::LoadOp::Clear(0.0) } else { wgpu::LoadOp::Load };
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("paint"),
            color_attachments: &[
                attachment(&target.items, wgpu::Color::TRANSPARENT),
                attachment(&target.color, sky),
            ],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &target.depth,
                depth_ops: Some(wgpu::Operations { load, store }),
                stencil_ops: None,
            }),
            ..Default::default()
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.bindings, &[]);
        pass.set_vertex_buffer(0, meshes.vertices.slice(..));
        pass.set_vertex_buffer(1, instances.slice(..));
        pass.set_index_buffer(meshes.indices.slice(..), wgpu::IndexFormat::Uint32);
        if count > 0 {
            pass.multi_draw_indexed_indirect(commands, 0, count);
        }
    }
}

/// Returns the depth test of a pass, with depth 1 at the near plane and 0 at infinity.
pub(crate) fn depth_test(compare: wgpu::CompareFunction, write: bool) -> wgpu::DepthStencilState {
    wgpu::DepthStencilState {
        format: DEPTH,
        depth_write_enabled: Some(write),
        depth_compare: Some(compare),
        stencil: Default::default(),
        bias: Default::default(),
    }
}

/// Derives a colour from an object's index.
fn color_of(object: u32) -> u32 {
    let hash = object.wrapping_add(1).wrapping_mul(0x9e37_79b9);
    // Bytes from 96 to 223 are neither too dark nor too bright.
    u32::from_le_bytes([hash, hash >> 7, hash >> 14, 0].map(|bits| 96 + (bits >> 11 & 127) as u8))
        | 0xff00_0000
}
