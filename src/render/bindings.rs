//! Bind groups, briefly: layouts and groups whose bindings are numbered in their order.

use super::gpu::Gpu;
use wgpu::{BindingType, BufferBindingType, SamplerBindingType, ShaderStages, TextureSampleType, TextureViewDimension};

/// One binding of a layout: who sees it and what it is.
pub(crate) type Binding = (ShaderStages, BindingType);

/// A buffer of one struct.
pub(crate) const UNIFORM: BindingType =
    BindingType::Buffer { ty: BufferBindingType::Uniform, has_dynamic_offset: false, min_binding_size: None };

/// A buffer that shaders read.
pub(crate) const STORAGE: BindingType = BindingType::Buffer {
    ty: BufferBindingType::Storage { read_only: true },
    has_dynamic_offset: false,
    min_binding_size: None,
};

/// A sampler that filters.
pub(crate) const SAMPLER: BindingType = BindingType::Sampler(SamplerBindingType::Filtering);

/// A sampler that compares depths.
pub(crate) const COMPARISON: BindingType = BindingType::Sampler(SamplerBindingType::Comparison);

/// A texture that may be filtered.
pub(crate) const fn texture(view_dimension: TextureViewDimension) -> BindingType {
    BindingType::Texture {
        sample_type: TextureSampleType::Float { filterable: true },
        view_dimension,
        multisampled: false,
    }
}

/// A 2D texture of integers.
pub(crate) const INTEGERS: BindingType = BindingType::Texture {
    sample_type: TextureSampleType::Uint,
    view_dimension: TextureViewDimension::D2,
    multisampled: false,
};

/// A depth texture.
pub(crate) const fn depth_texture(view_dimension: TextureViewDimension) -> BindingType {
    BindingType::Texture { sample_type: TextureSampleType::Depth, view_dimension, multisampled: false }
}

/// A layout; binding `i` is `bindings[i]`.
pub(crate) fn layout(gpu: &Gpu, label: &str, bindings: &[Binding]) -> wgpu::BindGroupLayout {
    let entry = |(binding, &(visibility, ty)): (usize, &Binding)| wgpu::BindGroupLayoutEntry {
        binding: binding as u32,
        visibility,
        ty,
        count: None,
    };
    let entries: Vec<_> = bindings.iter().enumerate().map(entry).collect();
    gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries: &entries })
}

/// A group; binding `i` is `resources[i]`.
pub(crate) fn group(
    gpu: &Gpu,
    layout: &wgpu::BindGroupLayout,
    resources: &[wgpu::BindingResource<'_>],
) -> wgpu::BindGroup {
    let entries: Vec<_> = (0..)
        .zip(resources)
        .map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource: resource.clone() })
        .collect();
    gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
}

/// A buffer of `count` structs that the CPU writes; of one where there are none, since a binding may not be empty.
pub(crate) fn buffer<T>(gpu: &Gpu, label: &str, count: usize, usage: wgpu::BufferUsages) -> wgpu::Buffer {
    gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: (count.max(1) * size_of::<T>()) as u64,
        usage: usage | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}
