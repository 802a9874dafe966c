//! Textures that a light's views are drawn into, one square layer a view, and read from in the forward pass.

use super::{RenderError, gpu::Gpu};

/// A texture of a light.
#[derive(Debug)]
pub(crate) struct LightMap {
    /// Each layer, to draw into.
    pub faces: Vec<wgpu::TextureView>,
    /// All, to read: a texture array.
    pub all: wgpu::TextureView,
}

impl LightMap {
    /// With `layers` layers of `side` texels a side.
    pub fn new(gpu: &Gpu, format: wgpu::TextureFormat, (side, layers): (u32, u32)) -> Self {
        let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("light map"),
            size: wgpu::Extent3d { width: side, height: side, depth_or_array_layers: layers },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        });
        let view = |first, count, dimension| {
            texture.create_view(&wgpu::TextureViewDescriptor {
                dimension: Some(dimension),
                base_array_layer: first,
                array_layer_count: Some(count),
                ..Default::default()
            })
        };
        Self {
            faces: (0..layers).map(|layer| view(layer, 1, wgpu::TextureViewDimension::D2)).collect(),
            all: view(0, layers, wgpu::TextureViewDimension::D2Array),
        }
    }

    /// Can the adapter have such sides?
    ///
    /// # Errors
    /// [`RenderError::TooLarge`].
    pub fn check_side(gpu: &Gpu, side: u32) -> Result<(), RenderError> {
        let (needed, limit) = (u64::from(side), u64::from(gpu.limits().max_texture_dimension_2d));
        if needed > limit {
            return Err(RenderError::TooLarge { what: "the sides of a light's map", needed, limit });
        }
        Ok(())
    }
}
