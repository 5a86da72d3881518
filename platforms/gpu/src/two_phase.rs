//! Occlusion culling on the card, by a depth pyramid of what the last frame saw.
//!
//! The hierarchical z-buffer of Greene, Kass and Miller ("Hierarchical Z-Buffer Visibility", 1993), with
//! their temporal coherence: what was visible in the last frame is drawn first, and the pyramid of its depth
//! tests all else. In the first phase the card draws those of the candidates that the last frame saw, and
//! makes a pyramid of farthest depths. In the second, it tests the boxes of all candidates, and draws those
//! that are visible and not drawn yet. Nothing is read back: draw commands are written by compute shaders.
//!
//! Whatever the first phase draws, the second hides no object that a pixel of the whole picture shows: that
//! object is at least as near, at that pixel, as anything drawn, and so is its box.

use crate::pyramid::{Pyramid, Step};
use crate::{Gpu, GpuError, Meshes, Painter, Target};
use visibility_core::visible_set::BitsError;
use visibility_core::{Aabb, Scene, VisibleSet};
use wgpu::BufferUsages;

/// Culls and draws in two phases, for pictures of one target.
#[derive(Debug)]
pub struct TwoPhaseCuller {
    candidates: wgpu::Buffer,
    /// For each object, bit 0: visible by the last test; bit 1: drawn in the first phase.
    states: wgpu::Buffer,
    first_commands: wgpu::Buffer,
    second_commands: wgpu::Buffer,
    choose: Step,
    pyramid: Pyramid,
    test: Step,
    read_back: wgpu::Buffer,
    /// Scratch: one bit for each object.
    bits: Vec<u32>,
}

impl TwoPhaseCuller {
    /// Makes a culler of the objects of a scene, as they are now, that has seen nothing.
    pub fn new(gpu: &Gpu, scene: &Scene, meshes: &Meshes, painter: &Painter, target: &Target) -> Self {
        let count = scene.index_limit();
        let mut boxes = vec![Aabb::EMPTY; count];
        for id in scene.ids() {
            // The card keeps objects with an empty box, as those that are never culled must be.
            if let Ok(object) = scene.object(id)
                && !object.is_unculled()
            {
                boxes[id.index()] = object.bounds;
            }
        }
        let boxes: Vec<[f32; 6]> = boxes.iter().map(|b| bytemuck::cast([b.min, b.max])).collect();
        let boxes = gpu.buffer("bounds", &boxes, BufferUsages::STORAGE);
        let bits = vec![0_u32; count.div_ceil(32)];
        let candidates = gpu.buffer("candidates", &bits, BufferUsages::STORAGE | BufferUsages::COPY_DST);
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
        let states = gpu.zeros("states", count.max(1) as u64 * 4, usage);
        let usage = BufferUsages::STORAGE | BufferUsages::INDIRECT;
        let [first_commands, second_commands] =
            ["first phase", "second phase"].map(|label| gpu.buffer(label, meshes.commands(), usage));

        let each_object = [(count as u32).div_ceil(64), 1];
        let first_phase = gpu.shader("first phase", include_str!("shaders/first_phase.wgsl"));
        let resources = [&candidates, &states, &first_commands, &second_commands];
        let choose = Step::new(
            gpu,
            &first_phase,
            "choose",
            &resources.map(wgpu::Buffer::as_entire_binding),
            each_object,
        );

        let pyramid = Pyramid::new(gpu, &target.depth, target.size);
        let source = concat!(include_str!("shaders/camera.wgsl"), include_str!("shaders/second_phase.wgsl"));
        let resources = [&painter.camera, &boxes, &candidates, &states, &second_commands, &pyramid.numbers];
        let resources = resources.map(wgpu::Buffer::as_entire_binding);
        let test = Step::new(gpu, &gpu.shader("second phase", source), "test", &resources, each_object);
        let usage = BufferUsages::MAP_READ | BufferUsages::COPY_DST;
        let read_back = gpu.zeros("states read back", states.size(), usage);
        Self { candidates, states, first_commands, second_commands, choose, pyramid, test, read_back, bits }
    }

    /// Forgets what the last frame saw: the first phase of the next frame draws nothing.
    pub fn reset(&self, gpu: &Gpu) {
        gpu.submit(|encoder| encoder.clear_buffer(&self.states, 0, None));
    }

    /// Culls the objects of a set of a scene, such as those in the frustum, and draws what is left into an
    /// empty target: the one that the culler was made for. The painter's camera must be set.
    ///
    /// # Errors
    /// A set of a larger scene than the one that the culler was made for.
    pub fn draw(
        &mut self,
        gpu: &Gpu,
        target: &Target,
        meshes: &Meshes,
        painter: &Painter,
        scene: &Scene,
        candidates: &VisibleSet,
    ) -> Result<(), BitsError> {
        candidates.write_bits(scene, &mut self.bits)?;
        gpu.queue.write_buffer(&self.candidates, 0, bytemuck::cast_slice(&self.bits));
        gpu.submit(|encoder| {
            self.choose.run(encoder);
            painter.record_all(encoder, target, meshes, &self.first_commands, true);
            self.pyramid.record(encoder);
            self.test.run(encoder);
            painter.record_all(encoder, target, meshes, &self.second_commands, false);
        });
        Ok(())
    }

    /// Waits for the card, and reads for each object, by index, whether the second phase found it visible,
    /// and whether it was drawn in either phase. For tests and figures: frames do not need it.
    ///
    /// # Errors
    /// [`GpuError::ReadBack`] if the device is lost.
    pub fn states(&self, gpu: &Gpu) -> Result<Vec<(bool, bool)>, GpuError> {
        gpu.submit(|encoder| encoder.copy_buffer_to_buffer(&self.states, 0, &self.read_back, 0, None));
        gpu.read(&self.read_back, |bytes| {
            let states = bytes.chunks_exact(4).map(|state| u32::from(state[0]));
            states.map(|state| (state & 1 != 0, state != 0)).collect()
        })
    }
}
