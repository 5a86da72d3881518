//! Window that flies along the scene's walks.

use crate::{Culling, Gpu, Method, Viewer};
use std::error::Error;
use std::sync::Arc;
use std::time::Instant;
use visibility_core::{FrustumCuller, Pipeline, View, VisibleSet};
use wgpu::{BufferUsages, CurrentSurfaceTexture};
use winit::application::ApplicationHandler;
use winit::dpi::PhysicalSize;
use winit::event::{ElementState, KeyEvent, WindowEvent};
use winit::event_loop::{ActiveEventLoop, EventLoop};
use winit::keyboard::{Key, NamedKey};
use winit::window::{Window, WindowId};

/// Number of frames of all walks together.
const FRAMES: usize = 2000;

/// Opens a window and flies along the walks of a built-in scene until the window is closed. Keys: 1 to 7
/// choose the culling method, A shows the culled scene from above, the space bar pauses, Escape ends.
///
/// # Errors
/// No display, no graphics card, or an unknown recipe.
pub fn fly(recipe: &str, size: [u32; 2]) -> Result<(), Box<dyn Error>> {
    let events = EventLoop::new()?;
    let mut flight = Flight { recipe: recipe.to_owned(), size, shown: None, error: None };
    events.run_app(&mut flight)?;
    flight.error.map_or(Ok(()), Err)
}

/// Application state: the flight in its window.
struct Flight {
    recipe: String,
    size: [u32; 2],
    shown: Option<Shown>,
    error: Option<Box<dyn Error>>,
}

/// State that exists once the window is open.
struct Shown {
    window: Arc<Window>,
    surface: wgpu::Surface<'static>,
    configuration: wgpu::SurfaceConfiguration,
    pipeline: wgpu::RenderPipeline,
    bindings: wgpu::BindGroup,
    window_size: wgpu::Buffer,
    viewer: Viewer,
    views: Vec<View>,
    methods: Vec<Method>,
    chosen: usize,
    frame: usize,
    stopped: bool,
    from_above: bool,
    visible: VisibleSet,
    in_frustum: VisibleSet,
    frustum: Pipeline,
}

impl Shown {
    fn open(events: &ActiveEventLoop, recipe: &str, size: [u32; 2]) -> Result<Self, Box<dyn Error>> {
        let attributes = Window::default_attributes().with_inner_size(PhysicalSize::new(size[0], size[1]));
        let window = Arc::new(events.create_window(attributes)?);
        let display = Box::new(events.owned_display_handle());
        let instance =
            wgpu::Instance::new(wgpu::InstanceDescriptor::new_with_display_handle_from_env(display));
        let surface = instance.create_surface(Arc::clone(&window))?;
        let gpu = Gpu::of(instance, Some(&surface))?;
        let mut configuration = surface
            .get_default_config(&gpu.adapter, size[0], size[1])
            .ok_or("the adapter cannot draw into the window")?;
        // A format without sRGB conversion, so that colours are shown unchanged.
        let formats = surface.get_capabilities(&gpu.adapter).formats;
        configuration.format =
            formats.into_iter().find(|format| !format.is_srgb()).unwrap_or(configuration.format);
        surface.configure(&gpu.device, &configuration);
        let viewer = Viewer::new(gpu, recipe, size)?;
        let gpu = &viewer.gpu;
        let shader = gpu.shader("window", include_str!("shaders/window.wgsl"));
        let pipeline = gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("window"),
            layout: None,
            vertex: wgpu::VertexState {
                module: &shader,
                entry_point: None,
                compilation_options: Default::default(),
                buffers: &[],
            },
            primitive: Default::default(),
            depth_stencil: None,
            multisample: Default::default(),
            fragment: Some(wgpu::FragmentState {
                module: &shader,
                entry_point: None,
                compilation_options: Default::default(),
                targets: &[Some(configuration.format.into())],
            }),
            multiview_mask: None,
            cache: None,
        });
        let usage = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
        let window_size = gpu.buffer("window size", &size.map(|side| side as f32), usage);
        let resources =
            [wgpu::BindingResource::TextureView(&viewer.target.color), window_size.as_entire_binding()];
        let bindings = gpu.bind(&pipeline.get_bind_group_layout(0), &resources);
        let (views, methods) = (viewer.views(FRAMES)?, Method::all(&viewer));
        Ok(Self {
            window,
            surface,
            configuration,
            pipeline,
            bindings,
            window_size,
            viewer,
            views,
            methods,
            chosen: 2,
            frame: 0,
            stopped: false,
            from_above: false,
            visible: VisibleSet::new(),
            in_frustum: VisibleSet::new(),
            frustum: Pipeline::new().with(FrustumCuller::new()),
        })
    }

    fn resize(&mut self, size: PhysicalSize<u32>) {
        // The picture keeps its size when the window is resized.
        (self.configuration.width, self.configuration.height) = (size.width.max(1), size.height.max(1));
        self.surface.configure(&self.viewer.gpu.device, &self.configuration);
        let size = [size.width as f32, size.height as f32];
        self.viewer.gpu.queue.write_buffer(&self.window_size, 0, bytemuck::bytes_of(&size));
    }

    fn draw(&mut self) -> Result<(), Box<dyn Error>> {
        let Some(&view) = self.views.get(self.frame) else { return Ok(()) };
        if !self.stopped {
            self.frame = (self.frame + 1) % self.views.len();
        }
        let start = Instant::now();
        let method = &mut self.methods[self.chosen];
        let cull_ms = method.frame(&mut self.viewer, &view, &mut self.visible)?;
        let on_card = if let Culling::TwoPhase(..) = method.culling { ", then on the card" } else { "" };
        let count = self.visible.count(&self.viewer.world.scene);
        if self.from_above {
            self.frustum.cull(&self.viewer.world.scene, &view, &mut self.in_frustum);
            self.viewer.draw_from_above(&view, &self.in_frustum, &self.visible)?;
        }
        let texture = match self.surface.get_current_texture() {
            CurrentSurfaceTexture::Success(texture) | CurrentSurfaceTexture::Suboptimal(texture) => texture,
            CurrentSurfaceTexture::Outdated | CurrentSurfaceTexture::Lost => {
                self.surface.configure(&self.viewer.gpu.device, &self.configuration);
                return Ok(());
            }
            _ => return Ok(()),
        };
        let target = texture.texture.create_view(&Default::default());
        self.viewer.gpu.submit(|encoder| {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: &target,
                    depth_slice: None,
                    resolve_target: None,
                    ops: Default::default(),
                })],
                ..Default::default()
            });
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, &self.bindings, &[]);
            pass.draw(0..3, 0..1);
        });
        self.viewer.gpu.queue.present(texture);
        let title = format!(
            "{}: {count} of {} objects{on_card}, culled in {cull_ms:.2} ms, drawn in {:.1} ms",
            method.name,
            self.viewer.world.scene.len(),
            start.elapsed().as_secs_f64() * 1e3
        );
        self.window.set_title(&title);
        Ok(())
    }

    fn press(&mut self, key: &str) {
        match key {
            "a" => self.from_above = !self.from_above,
            _ => {
                let chosen = key.parse::<usize>().unwrap_or(0).wrapping_sub(1);
                if chosen < self.methods.len() {
                    self.chosen = chosen;
                }
            }
        }
    }
}

impl ApplicationHandler for Flight {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        match Shown::open(events, &self.recipe, self.size) {
            Ok(shown) => {
                shown.window.request_redraw();
                self.shown = Some(shown);
            }
            Err(error) => {
                self.error = Some(error);
                events.exit();
            }
        }
    }

    fn window_event(&mut self, events: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let Some(shown) = &mut self.shown else { return };
        match event {
            WindowEvent::CloseRequested => events.exit(),
            WindowEvent::Resized(size) => shown.resize(size),
            WindowEvent::RedrawRequested => {
                if let Err(error) = shown.draw() {
                    self.error = Some(error);
                    events.exit();
                }
                shown.window.request_redraw();
            }
            WindowEvent::KeyboardInput {
                event: KeyEvent { logical_key, state: ElementState::Pressed, .. },
                ..
            } => match logical_key {
                Key::Named(NamedKey::Escape) => events.exit(),
                Key::Named(NamedKey::Space) => shown.stopped = !shown.stopped,
                Key::Character(text) => shown.press(&text.to_lowercase()),
                _ => {}
            },
            _ => {}
        }
    }
}
