//! Occlusion queries of the graphics card, as an implementation of core's [`QueryDevice`].
//!
//! The engine culls, draws the remaining objects into a [`Target`], and calls [`CardQueries::submit`]. This
//! draws the boxes that culling asked about, with the depth test of the picture. Answers arrive when the card
//! has finished. Since everything drawn is in the depth buffer, no occluders are needed
//! ([`with_price(0)`](visibility_core::OcclusionCuller::with_price)). The engine calls
//! [`HardwareQueries::invalidate`](visibility_core::occlusion::HardwareQueries::invalidate) when something
//! has moved, gone or appeared that it draws but that is no object of the scene.
//!
//! A *look* is a cull with the map, and a submission. Each frame is one look, unless the engine
//! [looks ahead](visibility_core::OcclusionCuller::look_ahead), which adds looks to the frame.

use crate::painter::depth_test;
use crate::{Gpu, Painter, Target};
use std::collections::VecDeque;
use std::sync::{Arc, OnceLock};
use visibility_core::Aabb;
use visibility_core::occlusion::QueryDevice;
use wgpu::BufferUsages;

/// Time at which [`CardQueries`] delivers answers.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Delay {
    /// Answers are delivered in the first look that begins after they have arrived. No look waits for the
    /// card.
    Arrival,
    /// Answers are delivered a fixed number of looks, at least 1, after the look that asked. If they have not
    /// arrived by then, the look waits for the card. With 1, each look waits until the card is done. With a
    /// look ahead, use 1: answers that arrive after the last look of their frame do not count.
    Frames(u32),
}

/// Occlusion queries of a graphics card.
#[derive(Debug)]
pub struct CardQueries {
    gpu: Gpu,
    delay: Delay,
    pipeline: wgpu::RenderPipeline,
    bindings: wgpu::BindGroup,
    /// Number of the present look, which counts calls of [`QueryDevice::answers`].
    look: u64,
    /// Queries of the present look: the number of each, and how many of `boxes` it is about. The boxes of a
    /// query follow those of the query before.
    asked: Vec<(u64, u32)>,
    boxes: Vec<Aabb>,
    /// Batches of queries that the card has not answered yet, in the order of their looks.
    under_way: VecDeque<Batch>,
    /// Batches whose memory can be reused.
    idle: Vec<Batch>,
}

/// Queries sent to the card together.
#[derive(Debug)]
struct Batch {
    /// Number of each query, and how many boxes it is about.
    queries: Vec<(u64, u32)>,
    /// Number of the look that asked.
    look: u64,
    set: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    read_back: wgpu::Buffer,
    /// Set when the answers have arrived: true if they can be read.
    arrived: Arc<OnceLock<bool>>,
}

impl CardQueries {
    /// Creates a query device for pictures of a painter.
    pub fn new(gpu: &Gpu, painter: &Painter, delay: Delay) -> Self {
        let source = concat!(include_str!("shaders/camera.wgsl"), include_str!("shaders/boxes.wgsl"));
        let shader = gpu.shader("boxes", source);
        let attributes = wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3];
        let pipeline = gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("boxes"),
            layout: None,
            vertex: wgpu::VertexState {
                module: &shader,
                entry_point: None,
                compilation_options: Default::default(),
                buffers: &[Some(wgpu::VertexBufferLayout {
                    array_stride: size_of::<Aabb>() as u64,
                    step_mode: wgpu::VertexStepMode::Instance,
                    attributes: &attributes,
                })],
            },
            primitive: Default::default(),
            // An object may lie on the surface of its box. Boxes are drawn slightly nearer; if the card
            // rounds this away, equal depth also passes.
            depth_stencil: Some(depth_test(wgpu::CompareFunction::GreaterEqual, false)),
            multisample: Default::default(),
            fragment: None,
            multiview_mask: None,
            cache: None,
        });
        let bindings = gpu.bind(&pipeline.get_bind_group_layout(0), &[painter.camera.as_entire_binding()]);
        Self {
            gpu: gpu.clone(),
            delay,
            pipeline,
            bindings,
            look: 0,
            asked: Vec::new(),
            boxes: Vec::new(),
            under_way: VecDeque::new(),
            idle: Vec::new(),
        }
    }

    /// Returns the number of queries asked in the present look so far.
    pub fn asked(&self) -> usize {
        self.asked.len()
    }

    /// Sends the queries of the present look to the card. Call this after drawing the objects that the look
    /// left into `target`, with the camera still set.
    pub fn submit(&mut self, target: &Target) {
        let boxes = std::mem::take(&mut self.boxes);
        let asked = std::mem::take(&mut self.asked);
        let most = wgpu::QUERY_SET_MAX_QUERIES as usize;
        let mut rest = &boxes[..];
        for queries in asked.chunks(most) {
            let mut batch = self.idle.pop().unwrap_or_else(|| Batch::new(&self.gpu));
            batch.queries.clear();
            batch.queries.extend(queries);
            batch.look = self.look;
            let count: usize = queries.iter().map(|&(_, count)| count as usize).sum();
            let (own, others) = rest.split_at(count);
            rest = others;
            self.send(&mut batch, own, target);
            self.under_way.push_back(batch);
        }
        // The memory of these lists is reused.
        (self.boxes, self.asked) = (boxes, asked);
        self.boxes.clear();
        self.asked.clear();
    }

    fn send(&self, batch: &mut Batch, boxes: &[Aabb], target: &Target) {
        let count = batch.queries.len() as u32;
        let corners: Vec<[f32; 6]> = boxes.iter().map(|b| bytemuck::cast([b.min, b.max])).collect();
        let buffer = self.gpu.buffer("boxes", &corners, BufferUsages::VERTEX);
        self.gpu.submit(|encoder| {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("queries"),
                depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                    view: &target.depth,
                    // No depth operations, since the depth is only read.
                    depth_ops: None,
                    stencil_ops: None,
                }),
                occlusion_query_set: Some(&batch.set),
                ..Default::default()
            });
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, &self.bindings, &[]);
            pass.set_vertex_buffer(0, buffer.slice(..));
            let mut first = 0;
            for (query, &(_, boxes)) in (0..).zip(&batch.queries) {
                pass.begin_occlusion_query(query);
                pass.draw(0..36, first..first + boxes);
                pass.end_occlusion_query();
                first += boxes;
            }
            drop(pass);
            encoder.resolve_query_set(&batch.set, 0..count, &batch.resolved, 0);
            encoder.copy_buffer_to_buffer(&batch.resolved, 0, &batch.read_back, 0, u64::from(count) * 8);
        });
        batch.arrived = Arc::default();
        let arrived = Arc::clone(&batch.arrived);
        batch.read_back.slice(..u64::from(count) * 8).map_async(wgpu::MapMode::Read, move |result| {
            // Set only here, so this cannot fail.
            let _ = arrived.set(result.is_ok());
        });
    }
}

impl Batch {
    fn new(gpu: &Gpu) -> Self {
        let count = wgpu::QUERY_SET_MAX_QUERIES;
        let descriptor =
            wgpu::QuerySetDescriptor { label: Some("queries"), ty: wgpu::QueryType::Occlusion, count };
        let bytes = u64::from(count) * u64::from(wgpu::QUERY_SIZE);
        let resolved = BufferUsages::QUERY_RESOLVE | BufferUsages::COPY_SRC;
        let read_back = BufferUsages::MAP_READ | BufferUsages::COPY_DST;
        Self {
            queries: Vec::new(),
            look: 0,
            set: gpu.device.create_query_set(&descriptor),
            resolved: gpu.zeros("answers", bytes, resolved),
            read_back: gpu.zeros("answers read back", bytes, read_back),
            arrived: Arc::default(),
        }
    }

    /// Delivers the answers of a batch that has arrived. A query that the card lost has no answer.
    fn hand_over(&self, each: &mut dyn FnMut(u64, u32)) {
        if self.arrived.get() != Some(&true) {
            return;
        }
        let bytes = self.queries.len() as u64 * 8;
        if let Ok(view) = self.read_back.slice(..bytes).get_mapped_range() {
            for (&(query, _), samples) in self.queries.iter().zip(view.chunks_exact(8)) {
                // WebGPU promises no count, only that it is 0 where no sample passed.
                each(query, if samples == [0; 8] { 0 } else { u32::MAX });
            }
        }
        self.read_back.unmap();
    }
}

impl QueryDevice for CardQueries {
    fn ask(&mut self, query: u64, boxes: &[Aabb]) {
        self.asked.push((query, boxes.len() as u32));
        self.boxes.extend_from_slice(boxes);
    }

    fn answers(&mut self, each: &mut dyn FnMut(u64, u32)) {
        self.look += 1;
        // Runs callbacks for answers that have arrived. On an error the device is lost, and no answers
        // arrive.
        let _ = self.gpu.device.poll(wgpu::PollType::Poll);
        while let Some(batch) = self.under_way.front() {
            if let Delay::Frames(looks) = self.delay {
                if self.look - batch.look < u64::from(looks) {
                    break;
                }
                if batch.arrived.get().is_none() && self.gpu.wait().is_err() {
                    break;
                }
            }
            if batch.arrived.get().is_none() {
                break;
            }
            let Some(batch) = self.under_way.pop_front() else { break };
            batch.hand_over(each);
            self.idle.push(batch);
        }
    }
}
