//! Two-phase occlusion culling on the card, with a depth pyramid of the objects visible in the last frame.
//!
//! The hierarchical z-buffer of Greene, Kass and Miller ("Hierarchical Z-Buffer Visibility", 1993), with
//! their temporal coherence. In the first phase the card draws the candidates that were visible in the last
//! frame, and makes a pyramid of farthest depths. In the second phase it tests the boxes of all candidates
//! against the pyramid, and draws visible objects that are not drawn yet. Nothing is read back: draw commands
//! are written by compute shaders.
//!
//! Whatever the first phase draws, the second phase hides no object that has a pixel in the complete picture:
//! at this pixel the object, and so its box, is at least as near as everything drawn.

use crate::pyramid::{Pyramid, Step};
use crate::{Gpu, GpuError, Meshes, Painter, Target};
use visibility_core::glam::Vec3;
use visibility_core::{Aabb, Scene, VisibleSet};
use wgpu::BufferUsages;

/// Greatest number of groups of 64 objects in a row of a dispatch.
const ROW: u32 = 65_535;
/// Coordinate from which on a box is never culled: products of greater ones could overflow, which no shader
/// has to notice.
const LARGEST: f32 = 1e15;

/// Culls and draws in two phases, for pictures of one target.
#[derive(Debug)]
pub struct TwoPhaseCuller {
    candidates: wgpu::Buffer,
    /// State of each object. Bit 0: visible in the last test; bit 1: drawn in the first phase.
    states: wgpu::Buffer,
    first_commands: wgpu::Buffer,
    second_commands: wgpu::Buffer,
    choose: Step,
    pyramid: Pyramid,
    test: Step,
    read_back: wgpu::Buffer,
    /// Scratch memory with one bit for each object.
    bits: Vec<u32>,
    /// Number of objects.
    count: usize,
}

impl TwoPhaseCuller {
    /// Creates a culler for the present objects of a scene, with their boxes as they are now: make another
    /// when objects have moved. No object counts as visible in the last frame. Wgpu reports an error of
    /// validation if the boxes, of 24 bytes each, exceed the device's `max_storage_buffer_binding_size`: by
    /// default, above 5.5 million objects.
    pub fn new(gpu: &Gpu, scene: &Scene, meshes: &Meshes, painter: &Painter, target: &Target) -> Self {
        let count = scene.index_limit();
        // Shaders may take it that no number is infinite or NaN: empty bounds are those of a box turned
        // inside out.
        let never_culled = Aabb { min: Vec3::ONE, max: Vec3::NEG_ONE };
        let mut boxes = vec![never_culled; count];
        for id in scene.ids() {
            if let (Ok(object), Ok(bounds)) = (scene.object(id), scene.bounds(id))
                && !object.is_unculled()
                && bounds.min.abs().max(bounds.max.abs()).max_element() < LARGEST
            {
                boxes[id.index()] = bounds;
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

        // A dispatch has at most 65,535 groups along each axis: the shaders count objects row by row.
        let groups = (count as u32).div_ceil(64);
        let each_object = [groups.min(ROW), groups.div_ceil(ROW).max(1)];
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
        Self {
            candidates,
            states,
            first_commands,
            second_commands,
            choose,
            pyramid,
            test,
            read_back,
            bits,
            count,
        }
    }

    /// Forgets which objects were visible in the last frame, so the first phase of the next frame draws
    /// nothing.
    pub fn reset(&self, gpu: &Gpu) {
        gpu.submit(|encoder| encoder.clear_buffer(&self.states, 0, None));
    }

    /// Culls the objects of a visible set, such as those in the frustum, clears the target that the culler
    /// was made for, and draws the remaining objects into it. The painter's camera must be set.
    ///
    /// # Errors
    /// [`GpuError::MoreObjects`] if the scene has more objects than the culler was made for.
    pub fn draw(
        &mut self,
        gpu: &Gpu,
        target: &Target,
        meshes: &Meshes,
        painter: &Painter,
        scene: &Scene,
        candidates: &VisibleSet,
    ) -> Result<(), GpuError> {
        let more = GpuError::MoreObjects { made_for: self.count, found: scene.index_limit() };
        if scene.index_limit() > self.count || candidates.write_bits(scene, &mut self.bits).is_err() {
            return Err(more);
        }
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

    /// Waits for the card, and reads two flags for each object, by index: found visible in the second phase,
    /// and drawn in either phase. Only for tests and figures.
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
