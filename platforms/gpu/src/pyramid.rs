//! Depth pyramid, made by compute shaders, and the dispatch of such shaders.

use crate::Gpu;
use bytemuck::{Pod, Zeroable};
use wgpu::BufferUsages;

/// Pyramid of the farthest depths of a depth buffer; see `shaders/pyramid.wgsl`.
#[derive(Debug)]
pub(crate) struct Pyramid {
    /// Depths of all levels, finest first.
    pub(crate) numbers: wgpu::Buffer,
    /// Start and size of each level.
    pub(crate) levels: Vec<Level>,
    steps: Vec<Step>,
}

impl Pyramid {
    /// Creates the pyramid of a depth buffer of `size` pixels.
    pub(crate) fn new(gpu: &Gpu, depth: &wgpu::TextureView, size: [u32; 2]) -> Self {
        let levels = levels(size);
        let count: u64 = levels.iter().map(|level| u64::from(level.size[0]) * u64::from(level.size[1])).sum();
        let numbers = gpu.zeros("pyramid", count * 4, BufferUsages::STORAGE | BufferUsages::COPY_SRC);
        let shader = gpu.shader("pyramid", include_str!("shaders/pyramid.wgsl"));
        let steps = levels.iter().enumerate().map(|(i, level)| {
            let buffer = gpu.buffer("level", &[*level], BufferUsages::UNIFORM);
            let groups = level.size.map(|side| side.div_ceil(8));
            let mut resources = vec![buffer.as_entire_binding(), numbers.as_entire_binding()];
            if i > 0 {
                return Step::new(gpu, &shader, "halve", &resources, groups);
            }
            resources.push(wgpu::BindingResource::TextureView(depth));
            Step::new(gpu, &shader, "copy", &resources, groups)
        });
        let steps = steps.collect();
        Self { numbers, levels, steps }
    }

    /// Records commands that compute the pyramid from the depth buffer's content at that time.
    pub(crate) fn record(&self, encoder: &mut wgpu::CommandEncoder) {
        self.steps.iter().for_each(|step| step.run(encoder));
    }
}

/// Dispatch of a compute shader, with its pipeline and resources.
#[derive(Debug)]
pub(crate) struct Step {
    pipeline: wgpu::ComputePipeline,
    bindings: wgpu::BindGroup,
    groups: [u32; 2],
}

impl Step {
    /// Creates a dispatch of an entry point of `shader`. The resources have bindings numbered from 0.
    pub(crate) fn new(
        gpu: &Gpu,
        shader: &wgpu::ShaderModule,
        entry: &str,
        resources: &[wgpu::BindingResource<'_>],
        groups: [u32; 2],
    ) -> Self {
        let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(entry),
            layout: None,
            module: shader,
            entry_point: Some(entry),
            compilation_options: Default::default(),
            cache: None,
        });
        let bindings = gpu.bind(&pipeline.get_bind_group_layout(0), resources);
        Self { pipeline, bindings, groups }
    }

    pub(crate) fn run(&self, encoder: &mut wgpu::CommandEncoder) {
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.bindings, &[]);
        pass.dispatch_workgroups(self.groups[0], self.groups[1], 1);
    }
}

/// Level of the pyramid; see `shaders/pyramid.wgsl`.
#[derive(Clone, Copy, Pod, Zeroable, Debug)]
#[repr(C)]
pub(crate) struct Level {
    pub(crate) start: u32,
    start_below: u32,
    pub(crate) size: [u32; 2],
    size_below: [u32; 2],
}

/// Returns the levels of the pyramid of a picture, down to a single number.
fn levels(size: [u32; 2]) -> Vec<Level> {
    let mut levels = vec![Level { start: 0, start_below: 0, size, size_below: size }];
    let mut last = levels[0];
    while last.size != [1, 1] {
        last = Level {
            start: last.start + last.size[0] * last.size[1],
            start_below: last.start,
            size: last.size.map(|side| side.div_ceil(2)),
            size_below: last.size,
        };
        levels.push(last);
    }
    levels
}
