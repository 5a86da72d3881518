//! Render target with picture, item buffer and depth buffer, which can be read back.

use crate::{Gpu, GpuError};
use wgpu::{TextureFormat, TextureUsages};

/// Value in the item buffer for a pixel without an object.
pub const NO_ITEM: u32 = 0;

pub(crate) const ITEMS: TextureFormat = TextureFormat::R32Uint;
pub(crate) const COLOR: TextureFormat = TextureFormat::Rgba8Unorm;
pub(crate) const DEPTH: TextureFormat = TextureFormat::Depth32Float;

/// Render target: a picture, its item buffer, and its depth buffer.
#[derive(Debug)]
pub struct Target {
    /// Width and height in pixels.
    pub size: [u32; 2],
    pub(crate) items: wgpu::TextureView,
    pub(crate) color: wgpu::TextureView,
    pub(crate) depth: wgpu::TextureView,
    read_back: wgpu::Buffer,
}

impl Target {
    /// Creates a target of `width` by `height` pixels, at least 1 each.
    pub fn new(gpu: &Gpu, width: u32, height: u32) -> Self {
        let size = [width.max(1), height.max(1)];
        let texture = |label, format, usage| {
            let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size: extent(size),
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: TextureUsages::RENDER_ATTACHMENT | usage,
                view_formats: &[],
            });
            texture.create_view(&Default::default())
        };
        let bytes = u64::from(bytes_per_row(size)) * u64::from(size[1]);
        let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        Self {
            size,
            items: texture("items", ITEMS, TextureUsages::COPY_SRC),
            color: texture("color", COLOR, TextureUsages::COPY_SRC | TextureUsages::TEXTURE_BINDING),
            depth: texture("depth", DEPTH, TextureUsages::TEXTURE_BINDING),
            read_back: gpu.zeros("read back", bytes, usage),
        }
    }

    /// Waits for the card, and reads the item buffer: for each pixel, row by row from the top, 1 + the index
    /// of the object that it shows, or [`NO_ITEM`].
    ///
    /// # Errors
    /// [`GpuError::ReadBack`] if the device is lost.
    pub fn items(&self, gpu: &Gpu) -> Result<Vec<u32>, GpuError> {
        self.read(gpu, self.items.texture())
    }

    /// Waits for the card, and reads the picture: for each pixel, row by row from the top, red, green, blue
    /// and opacity.
    ///
    /// # Errors
    /// [`GpuError::ReadBack`] if the device is lost.
    pub fn pixels(&self, gpu: &Gpu) -> Result<Vec<[u8; 4]>, GpuError> {
        self.read(gpu, self.color.texture())
    }

    /// Waits for the card, and returns the indices of the objects that the picture shows, ascending.
    ///
    /// # Errors
    /// [`GpuError::ReadBack`] if the device is lost.
    pub fn visible(&self, gpu: &Gpu) -> Result<Vec<usize>, GpuError> {
        let mut items = self.items(gpu)?;
        items.sort_unstable();
        items.dedup();
        Ok(items.into_iter().filter(|&item| item != NO_ITEM).map(|item| item as usize - 1).collect())
    }

    /// Reads a texture with 4 bytes per pixel.
    fn read<T: bytemuck::Pod>(&self, gpu: &Gpu, texture: &wgpu::Texture) -> Result<Vec<T>, GpuError> {
        let [width, height] = self.size;
        let stride = bytes_per_row(self.size);
        gpu.submit(|encoder| {
            let layout = wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(stride),
                rows_per_image: Some(height),
            };
            encoder.copy_texture_to_buffer(
                texture.as_image_copy(),
                wgpu::TexelCopyBufferInfo { buffer: &self.read_back, layout },
                extent(self.size),
            );
        });
        gpu.read(&self.read_back, |bytes| {
            let rows = bytes.chunks_exact(stride as usize);
            rows.flat_map(|row| bytemuck::pod_collect_to_vec(&row[..width as usize * 4])).collect()
        })
    }
}

fn extent([width, height]: [u32; 2]) -> wgpu::Extent3d {
    wgpu::Extent3d { width, height, depth_or_array_layers: 1 }
}

/// Returns the number of bytes per row of 4-byte pixels, padded to the alignment that copies to buffers
/// require.
fn bytes_per_row([width, _]: [u32; 2]) -> u32 {
    (width * 4).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT)
}
