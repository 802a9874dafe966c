//! Textures that a light's views are drawn into, one square layer a view, and read from in the forward pass.

use super::{
    RenderError,
    bindings::{Binding, STORAGE, buffer, group, layout},
    gpu::Gpu,
    stage::Stage,
    view_matrices::per_instance,
};
use glam::Mat4;

/// Most views of a light: the faces of a cube around a point.
pub(crate) const MOST_VIEWS: usize = 6;

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

/// The maps of a light, and what a forward pass reads them by: a group of the matrices of light_views.wgsl, the maps, and
/// a sampler where there is one, in this order.
#[derive(Debug)]
pub(crate) struct LightMaps {
    side: u32,
    formats: Vec<wgpu::TextureFormat>,
    sampler: Option<wgpu::Sampler>,
    matrices: wgpu::Buffer,
    /// Of the group.
    pub layout: wgpu::BindGroupLayout,
    /// One a format, with as many layers as the last light had views.
    made: Option<(Vec<LightMap>, wgpu::BindGroup)>,
}

impl LightMaps {
    /// Maps of `side` texels a side, one of each format.
    ///
    /// # Errors
    /// A side beyond the adapter's limits.
    pub fn new(
        stage: &Stage,
        side: u32,
        maps: &[(wgpu::TextureFormat, wgpu::BindingType)],
        sampler: Option<(wgpu::Sampler, wgpu::BindingType)>,
    ) -> Result<Self, RenderError> {
        LightMap::check_side(&stage.gpu, side)?;
        let (sampler, sampler_binding) = sampler.unzip();
        let types = [STORAGE].into_iter().chain(maps.iter().map(|(_, ty)| *ty)).chain(sampler_binding);
        let bindings: Vec<Binding> = types.map(|ty| (wgpu::ShaderStages::FRAGMENT, ty)).collect();
        let count = MOST_VIEWS * stage.placements().len();
        Ok(Self {
            side,
            formats: maps.iter().map(|(format, _)| *format).collect(),
            sampler,
            matrices: buffer::<Mat4>(&stage.gpu, "light matrices", count, wgpu::BufferUsages::STORAGE),
            layout: layout(&stage.gpu, "light maps", &bindings),
            made: None,
        })
    }

    /// The maps for these views of a light, with what they held if the last light had as many; sends the matrices.
    pub fn of_views(&mut self, stage: &Stage, views: &[Mat4]) -> &[LightMap] {
        stage.gpu.queue.write_buffer(&self.matrices, 0, bytemuck::cast_slice(&per_instance(stage, views)));
        let made = match self.made.take() {
            Some(made) if layers(&made.0) == views.len() => made,
            _ => self.make(&stage.gpu, views.len() as u32),
        };
        &self.made.insert(made).0
    }

    fn make(&self, gpu: &Gpu, views: u32) -> (Vec<LightMap>, wgpu::BindGroup) {
        let maps: Vec<_> = self.formats.iter().map(|&format| LightMap::new(gpu, format, (self.side, views))).collect();
        let textures = maps.iter().map(|map| wgpu::BindingResource::TextureView(&map.all));
        let sampler = self.sampler.iter().map(wgpu::BindingResource::Sampler);
        let resources: Vec<_> =
            [self.matrices.as_entire_binding()].into_iter().chain(textures).chain(sampler).collect();
        let group = group(gpu, &self.layout, &resources);
        (maps, group)
    }

    /// The group; none before the first light.
    pub fn group(&self) -> Option<&wgpu::BindGroup> {
        self.made.as_ref().map(|(_, group)| group)
    }

    /// Views of the last light, 1 before the first.
    pub fn views(&self) -> usize {
        self.made.as_ref().map_or(1, |(maps, _)| layers(maps))
    }

    /// Texels of one map, all its layers.
    pub fn texels(&self) -> usize {
        self.views() * (self.side as usize).pow(2)
    }

    /// Bytes of the matrices.
    pub fn buffer_bytes(&self) -> usize {
        self.matrices.size() as usize
    }
}

/// Layers of each of the maps.
fn layers(maps: &[LightMap]) -> usize {
    maps.first().map_or(0, |map| map.faces.len())
}
