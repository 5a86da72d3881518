//! The graphics device: finding and opening it, and reading results back.

use std::fmt;
use wgpu::util::{BufferInitDescriptor, DeviceExt};

/// Device of a graphics card, and its queue.
#[derive(Debug, Clone)]
pub struct Gpu {
    /// Instance that found the adapter, also for surfaces of windows.
    pub instance: wgpu::Instance,
    /// Adapter that the device belongs to.
    pub adapter: wgpu::Adapter,
    /// Device of the graphics card.
    pub device: wgpu::Device,
    /// Queue of the device.
    pub queue: wgpu::Queue,
}

/// Reason why a graphics device cannot be used.
#[derive(Debug)]
#[non_exhaustive]
pub enum GpuError {
    /// The system has no graphics adapter.
    NoAdapter(wgpu::RequestAdapterError),
    /// The adapter cannot draw from indirect draw commands, or refuses to open.
    NoDevice(wgpu::RequestDeviceError),
    /// The device was lost, or a buffer could not be read back.
    ReadBack,
    /// A scene has more objects than what draws it was made for.
    MoreObjects {
        /// Number of objects that it was made for.
        made_for: usize,
        /// Number of objects of the scene, counted by the greatest index.
        found: usize,
    },
}

impl fmt::Display for GpuError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoAdapter(cause) => write!(f, "no graphics adapter: {cause}"),
            Self::NoDevice(cause) => write!(f, "the graphics device does not open: {cause}"),
            Self::ReadBack => write!(f, "a buffer of the graphics card could not be read back"),
            Self::MoreObjects { made_for, found } => {
                write!(f, "a culler made for {made_for} objects cannot draw {found}: make another")
            }
        }
    }
}

impl std::error::Error for GpuError {}

impl Gpu {
    /// Opens the fastest adapter. Environment variables such as `WGPU_BACKEND` are respected.
    ///
    /// # Errors
    /// [`GpuError::NoAdapter`] on a machine without one, [`GpuError::NoDevice`] if the adapter cannot draw
    /// from indirect draw commands.
    pub fn open() -> Result<Self, GpuError> {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle_from_env());
        Self::of(instance, None)
    }

    /// Opens the fastest adapter of an instance. If a surface is given, the adapter must be able to draw into
    /// it.
    ///
    /// # Errors
    /// The errors of [`open`](Self::open).
    pub fn of(instance: wgpu::Instance, surface: Option<&wgpu::Surface<'_>>) -> Result<Self, GpuError> {
        let options = wgpu::RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::HighPerformance,
            compatible_surface: surface,
            ..Default::default()
        };
        let adapter = pollster::block_on(instance.request_adapter(&options)).map_err(GpuError::NoAdapter)?;
        let descriptor = wgpu::DeviceDescriptor {
            // Indirect draw commands state their first instance.
            required_features: wgpu::Features::INDIRECT_FIRST_INSTANCE,
            ..Default::default()
        };
        let (device, queue) =
            pollster::block_on(adapter.request_device(&descriptor)).map_err(GpuError::NoDevice)?;
        Ok(Self { instance, adapter, device, queue })
    }

    /// Returns a description of the adapter for people.
    pub fn description(&self) -> String {
        let info = self.adapter.get_info();
        let software = if info.device_type == wgpu::DeviceType::Cpu { ", software" } else { "" };
        format!("{} ({}{software})", info.name, info.backend)
    }

    /// Creates a buffer that holds `values`. An empty slice makes a buffer of 4 bytes.
    pub(crate) fn buffer<T: bytemuck::NoUninit>(
        &self,
        label: &str,
        values: &[T],
        usage: wgpu::BufferUsages,
    ) -> wgpu::Buffer {
        let bytes: &[u8] = bytemuck::cast_slice(values);
        let contents = if bytes.is_empty() { &[0; 4] } else { bytes };
        self.device.create_buffer_init(&BufferInitDescriptor { label: Some(label), contents, usage })
    }

    /// Creates a buffer of `size` zero bytes.
    pub(crate) fn zeros(&self, label: &str, size: u64, usage: wgpu::BufferUsages) -> wgpu::Buffer {
        let descriptor =
            wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false };
        self.device.create_buffer(&descriptor)
    }

    /// Records commands with `record`, and submits them.
    pub fn submit(&self, record: impl FnOnce(&mut wgpu::CommandEncoder)) {
        let mut encoder = self.device.create_command_encoder(&Default::default());
        record(&mut encoder);
        self.queue.submit([encoder.finish()]);
    }

    /// Waits until all submitted work is done.
    ///
    /// # Errors
    /// [`GpuError::ReadBack`] if the device is lost.
    pub fn wait(&self) -> Result<(), GpuError> {
        self.device.poll(wgpu::PollType::wait_indefinitely()).map(|_| ()).map_err(|_| GpuError::ReadBack)
    }

    /// Waits for a buffer with the usage `MAP_READ`, and calls `read` with its content.
    pub(crate) fn read<R>(
        &self,
        buffer: &wgpu::Buffer,
        read: impl FnOnce(&[u8]) -> R,
    ) -> Result<R, GpuError> {
        buffer.slice(..).map_async(wgpu::MapMode::Read, |_| ());
        self.wait()?;
        let view = buffer.slice(..).get_mapped_range().map_err(|_| GpuError::ReadBack)?;
        let result = read(&view);
        drop(view);
        buffer.unmap();
        Ok(result)
    }

    /// Makes a shader module of WGSL.
    pub(crate) fn shader(&self, label: &str, source: &str) -> wgpu::ShaderModule {
        self.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(label),
            source: wgpu::ShaderSource::Wgsl(source.into()),
        })
    }

    /// Makes a bind group of whole buffers and views, with bindings numbered from 0.
    pub(crate) fn bind(
        &self,
        layout: &wgpu::BindGroupLayout,
        resources: &[wgpu::BindingResource<'_>],
    ) -> wgpu::BindGroup {
        let entries: Vec<_> = (0..)
            .zip(resources)
            .map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource: resource.clone() })
            .collect();
        self.device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
    }
}
