//! Hierarchical z-buffer on the graphics card, as an implementation of core's [`OcclusionMap`].
//!
//! Occluders are drawn on the card, a compute shader makes the pyramid, and the pyramid is read back: each
//! [`flush`](OcclusionMap::flush) with new occluders waits for the card. Boxes are tested on the processor,
//! in the same way as in `shaders/second_phase.wgsl` (Greene, Kass and Miller, "Hierarchical Z-Buffer
//! Visibility", 1993).

use crate::Gpu;
use crate::painter::{Camera, depth_test};
use crate::pyramid::Pyramid;
use crate::target::DEPTH;
use glam::{Affine3A, DVec3, Mat4, Vec3, Vec3A, Vec4Swizzles};
use visibility_core::geometry::keeps_orientation;
use visibility_core::occlusion::Occlusion;
use visibility_core::view::{Eye, ViewPlanes};
use visibility_core::{Aabb, Accuracy, OccluderMesh, OcclusionMap, View};
use wgpu::BufferUsages;

/// Margin for rounding and interpolation, the same as in `shaders/second_phase.wgsl`.
const ROUNDING: f32 = 1.0 / (1 << 20) as f32;
const INTERPOLATION: f32 = 1.0 / (1 << 14) as f32;
/// Maximum number of columns and of rows of a pyramid level that one test reads.
const MOST: u32 = 4;

/// Occlusion map on a graphics card, for views with reversed depth. With other depth conventions it hides
/// nothing.
#[derive(Debug)]
pub struct CardMap {
    gpu: Gpu,
    size: [u32; 2],
    depth: wgpu::TextureView,
    pipeline: wgpu::RenderPipeline,
    bindings: wgpu::BindGroup,
    camera: wgpu::Buffer,
    pyramid: Pyramid,
    read_back: wgpu::Buffer,
    clip_from_scene: Mat4,
    clip_planes: Option<ViewPlanes>,
    /// Where this frame's view is seen from, relative to the scene's origin.
    eye: Eye,
    /// Corners of the triangles of all occluders in this frame that face the eye or are two-sided.
    corners: Vec<[f32; 3]>,
    /// Number of triangles that a buffer of the device has room for.
    most_triangles: usize,
    /// Number of corners drawn into the pyramid.
    flushed: usize,
    /// Depths of all pyramid levels. Empty if nothing is hidden.
    numbers: Vec<f32>,
}

impl CardMap {
    /// Creates a map of `width` by `height` pixels, at least 1 each. Both sides of a map for which the device
    /// has no room are halved until there is room. A map of any size is correct; a smaller map hides less.
    pub fn new(gpu: &Gpu, width: u32, height: u32) -> Self {
        let limits = gpu.device.limits();
        let size = fitting([width.max(1), height.max(1)], &limits);
        let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("depth of occluders"),
            size: wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: DEPTH,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        });
        let depth = texture.create_view(&Default::default());
        let source = concat!(include_str!("shaders/camera.wgsl"), include_str!("shaders/occluders.wgsl"));
        let shader = gpu.shader("occluders", source);
        let pipeline = gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("occluders"),
            layout: None,
            vertex: wgpu::VertexState {
                module: &shader,
                entry_point: None,
                compilation_options: Default::default(),
                buffers: &[Some(wgpu::VertexBufferLayout {
                    array_stride: 12,
                    step_mode: wgpu::VertexStepMode::Vertex,
                    attributes: &wgpu::vertex_attr_array![0 => Float32x3],
                })],
            },
            primitive: Default::default(),
            depth_stencil: Some(depth_test(wgpu::CompareFunction::Greater, true)),
            multisample: Default::default(),
            fragment: None,
            multiview_mask: None,
            cache: None,
        });
        let usage = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
        let camera = gpu.zeros("camera of occluders", size_of::<Camera>() as u64, usage);
        let bindings = gpu.bind(&pipeline.get_bind_group_layout(0), &[camera.as_entire_binding()]);
        let pyramid = Pyramid::new(gpu, &depth, size);
        let usage = BufferUsages::MAP_READ | BufferUsages::COPY_DST;
        let read_back = gpu.zeros("pyramid read back", pyramid.numbers.size(), usage);
        Self {
            gpu: gpu.clone(),
            size,
            depth,
            pipeline,
            bindings,
            camera,
            pyramid,
            read_back,
            clip_from_scene: Mat4::ZERO,
            clip_planes: None,
            eye: Eye::Point(DVec3::NAN),
            corners: Vec::new(),
            most_triangles: usize::try_from(limits.max_buffer_size / 36).unwrap_or(usize::MAX),
            flushed: 0,
            numbers: Vec::new(),
        }
    }

    /// Returns whether no pixel can show any part of a box.
    fn is_hidden(&self, bounds: &Aabb) -> bool {
        let rows = [0, 1, 2, 3].map(|row| self.clip_from_scene.row(row));
        let extent = bounds.min.abs().max(bounds.max.abs()).extend(1.0);
        let error = rows.map(|row| ROUNDING * extent.dot(row.abs()));
        let size = self.size.map(|side| side as f32);
        let (mut least, mut most, mut nearest) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2], 0.0_f32);
        for corner in 0..8 {
            let pick =
                |axis: usize| if corner >> axis & 1 == 0 { bounds.min[axis] } else { bounds.max[axis] };
            let position = self.clip_from_scene * Vec3::new(pick(0), pick(1), pick(2)).extend(1.0);
            let w = position.w - error[3];
            // False also for NaN and infinities.
            let beyond_near = w > 0.0 && position.z + error[2] < w;
            if !beyond_near {
                return false;
            }
            let w_most = position.w + error[3];
            for axis in 0..2 {
                let [below, above] = [position.xy()[axis] - error[axis], position.xy()[axis] + error[axis]];
                least[axis] = least[axis].min(below / if below > 0.0 { w_most } else { w });
                most[axis] = most[axis].max(above / if above > 0.0 { w } else { w_most });
            }
            nearest = nearest.max((position.z + error[2]) / w);
        }
        let first = [(least[0] * 0.5 + 0.5) * size[0], (0.5 - most[1] * 0.5) * size[1]];
        let last = [(most[0] * 0.5 + 0.5) * size[0], (0.5 - least[1] * 0.5) * size[1]];
        if last[0] < 0.0 || last[1] < 0.0 || first[0] >= size[0] || first[1] >= size[1] {
            // The box is outside of the picture, which the frustum culler tests.
            return false;
        }
        let pixel = |at: f32, axis: usize| at.clamp(0.0, size[axis] - 1.0) as u32;
        let (mut x, mut y) =
            ([pixel(first[0], 0), pixel(last[0], 0)], [pixel(first[1], 1), pixel(last[1], 1)]);
        let mut level = 0;
        while x[1] - x[0] >= MOST || y[1] - y[0] >= MOST {
            level += 1;
            (x, y) = (x.map(|x| x / 2), y.map(|y| y / 2));
        }
        let Some(level) = self.pyramid.levels.get(level) else { return false };
        let numbers =
            (y[0]..=y[1]).flat_map(|y| (x[0]..=x[1]).map(move |x| level.start + y * level.size[0] + x));
        let farthest = |index: u32| self.numbers.get(index as usize).copied().unwrap_or(0.0);
        nearest * (1.0 + INTERPOLATION) < numbers.map(farthest).fold(1.0, f32::min)
    }
}

impl OcclusionMap for CardMap {
    fn name(&self) -> &str {
        "z-buffer on the card"
    }

    /// Approximate, because an occluder covers each pixel whose centre it covers. In a picture of the same
    /// size with one sample per pixel, nothing visible is hidden.
    fn accuracy(&self) -> Accuracy {
        Accuracy::Approximate
    }

    fn begin(&mut self, view: &View, origin: DVec3) {
        self.corners.clear();
        self.numbers.clear();
        self.flushed = 0;
        self.clip_from_scene =
            if view.depth().is_reversed() { view.clip_from(origin).as_mat4() } else { Mat4::NAN };
        self.clip_planes = Some(view.clip_planes_from(origin));
        self.eye = view.eye(origin);
        let camera = Camera::new(self.clip_from_scene, self.size);
        self.gpu.queue.write_buffer(&self.camera, 0, bytemuck::bytes_of(&camera));
    }

    fn add(&mut self, occluder: &OccluderMesh, transform: &Affine3A) {
        if !self.clip_planes.as_ref().is_some_and(|planes| occluder.is_inside(planes, transform)) {
            return;
        }
        // Occluders beyond the greatest buffer of the device are left out.
        let room = self.most_triangles.saturating_sub(self.corners.len() / 3);
        let triangles = occluding_triangles(occluder, transform, self.eye).take(room);
        self.corners.extend(triangles.flatten().map(|corner| corner.to_array()));
    }

    fn flush(&mut self) {
        if self.flushed == self.corners.len() {
            return;
        }
        let count = self.corners.len() as u32;
        let buffer = self.gpu.buffer("occluders", &self.corners, BufferUsages::VERTEX);
        self.gpu.submit(|encoder| {
            let ops = wgpu::Operations { load: wgpu::LoadOp::Clear(0.0), store: wgpu::StoreOp::Store };
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("occluders"),
                depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                    view: &self.depth,
                    depth_ops: Some(ops),
                    stencil_ops: None,
                }),
                ..Default::default()
            });
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, &self.bindings, &[]);
            pass.set_vertex_buffer(0, buffer.slice(..));
            pass.draw(0..count, 0..1);
            drop(pass);
            self.pyramid.record(encoder);
            encoder.copy_buffer_to_buffer(&self.pyramid.numbers, 0, &self.read_back, 0, None);
        });
        self.flushed = self.corners.len();
        self.numbers.clear();
        let numbers = &mut self.numbers;
        // If the device is lost, the map hides nothing.
        let _ = self
            .gpu
            .read(&self.read_back, |bytes| numbers.extend(bytemuck::pod_collect_to_vec::<u8, f32>(bytes)));
    }

    fn test(&self, bounds: &Aabb) -> Occlusion {
        if !bounds.is_finite() {
            return Occlusion::Visible;
        }
        if !self.numbers.is_empty() && self.is_hidden(bounds) {
            Occlusion::Hidden
        } else {
            Occlusion::Partial
        }
    }
}

/// Returns a size in pixels, halved until a texture of it and the pyramid over it are within the limits of a
/// device.
fn fitting(mut size: [u32; 2], limits: &wgpu::Limits) -> [u32; 2] {
    let most = limits.max_buffer_size.min(limits.max_storage_buffer_binding_size);
    // The levels above the first have a third of its numbers, and a row and a column more each.
    let numbers = |[width, height]: [u64; 2]| width * height * 4 / 3 + (width + height) * 2;
    let fits = |size: [u32; 2]| {
        size.iter().all(|&side| side <= limits.max_texture_dimension_2d)
            && numbers(size.map(u64::from)) <= most / 4
    };
    while !fits(size) && size != [1, 1] {
        size = size.map(|side| (side / 2).max(1));
    }
    size
}

/// Returns the corners of the triangles of an occluder that occlude for an eye: those whose front faces the
/// eye, or all triangles of a two-sided mesh. Corners and eye are in metres, relative to the scene's
/// origin. A mirroring transform takes fronts to fronts. Of a one-sided mesh, triangles that are seen
/// edge-on, or are not finite, are left out, and all if rounding leaves open whether the transform mirrors.
fn occluding_triangles(
    occluder: &OccluderMesh,
    transform: &Affine3A,
    eye: Eye,
) -> impl Iterator<Item = [Vec3A; 3]> {
    // The corners of a front run counter-clockwise, and clockwise in a mirror.
    let turn = keeps_orientation(transform).map_or(0.0, |keeps| if keeps { 1.0 } else { -1.0 });
    let corners = |triangle: &[u32; 3]| {
        triangle.map(|corner| transform.transform_point3a(occluder.positions()[corner as usize].into()))
    };
    occluder.triangles().iter().map(corners).filter(move |triangle| {
        let [a, b, c] = triangle.map(|corner| corner.as_dvec3());
        let to_eye = match eye {
            Eye::Point(eye) => eye - a,
            Eye::Direction(along) => -along,
        };
        occluder.is_two_sided() || turn * (b - a).cross(c - a).dot(to_eye) > 0.0
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Quat;

    #[test]
    fn sizes_are_within_the_limits_of_a_device() {
        let limits = wgpu::Limits::default();
        assert_eq!(fitting([1920, 1080], &limits), [1920, 1080], "what fits stays");
        assert_eq!(fitting([8193, 1], &limits), [4096, 1], "a side above 8192");
        for size in [[8192, 4096], [8192, 8192], [u32::MAX, u32::MAX], [u32::MAX, 1]] {
            let [width, height] = fitting(size, &limits).map(u64::from);
            let levels = std::iter::successors(Some([width, height]), |size| {
                (*size != [1, 1]).then(|| size.map(|side| side.div_ceil(2)))
            });
            let bytes: u64 = levels.map(|[width, height]| 4 * width * height).sum();
            assert!(
                width.max(height) <= 8192 && bytes <= 1 << 27,
                "{size:?}: {width} by {height}, {bytes} bytes"
            );
        }
    }

    #[test]
    fn one_sided_occluders_occlude_by_the_triangles_that_face_the_eye() {
        let plane = |two_sided: bool| {
            let corners =
                [[0.0, -1.0, -1.0], [0.0, 1.0, -1.0], [0.0, 1.0, 1.0], [0.0, -1.0, 1.0]].map(Vec3::from);
            // The front is towards +x.
            OccluderMesh::from_indexed(&corners, &[[0, 1, 2], [0, 2, 3]]).unwrap().with_two_sided(two_sided)
        };
        let cube = OccluderMesh::cuboid(&Aabb::from_arrays([-1.0; 3], [1.0; 3])).unwrap();
        let place = Vec3::new(5.0, 0.0, 0.0);
        let [there, turned, mirrored] = [Vec3::ONE, Vec3::new(-1.0, -1.0, 1.0), Vec3::new(1.0, -1.0, 1.0)]
            .map(|scale| Affine3A::from_scale_rotation_translation(scale, Quat::IDENTITY, place));
        let [behind, before] = [0.0, 10.0].map(|x| Eye::Point(DVec3::new(x, 0.5, 0.0)));
        for (name, mesh, transform, eye, count) in [
            ("a front", plane(false), there, before, 2),
            ("a back", plane(false), there, behind, 0),
            ("a back of a two-sided mesh", plane(true), there, behind, 2),
            ("a front, turned away", plane(false), turned, before, 0),
            ("a back, turned round", plane(false), turned, behind, 2),
            ("a front in a mirror", plane(false), mirrored, before, 2),
            ("a back in a mirror", plane(false), mirrored, behind, 0),
            ("a front, in parallel", plane(false), there, Eye::Direction(DVec3::NEG_X), 2),
            ("a back, in parallel", plane(false), there, Eye::Direction(DVec3::X), 0),
            ("edge-on", plane(false), there, Eye::Direction(DVec3::Y), 0),
            ("a side of a cube", cube.clone(), there, before, 2),
            ("a cube from within", cube, there, Eye::Point(place.as_dvec3()), 0),
            ("an eye nowhere", plane(false), there, Eye::Point(DVec3::NAN), 0),
        ] {
            let shown = occluding_triangles(&mesh, &transform, eye).count();
            assert_eq!(shown, count, "triangles of {name}");
        }
    }
}
