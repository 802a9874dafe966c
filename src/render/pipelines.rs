//! Bind group layouts, and pipelines made when a frame first needs them.

use super::{
    AMBIENT, Antialias, DIFFUSE, Mode,
    gpu::{FORWARD, Gpu, PLANE_RECTANGLES},
    layout::{VERTEX_ATTRIBUTES, Vertex},
};
use shadowfit_solver::{plane::SDF_BORDER, shade::EDGE_ON};
use std::collections::BTreeMap;

/// Depth buffer of every frame.
pub const DEPTH_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// Opacity of the parts of planes that lie in front of the model, and inside or behind it: enough to see where a
/// plane goes, too little to hide the surface.
const OPACITY_VISIBLE: f64 = 1.0;
const OPACITY_HIDDEN: f64 = 0.18;

/// Colour format of a mode: linear bytes for the mask, sRGB for people.
pub fn color_format(mode: Mode) -> wgpu::TextureFormat {
    match mode {
        Mode::Mask => wgpu::TextureFormat::Rgba8Unorm,
        Mode::Shaded | Mode::Planes => wgpu::TextureFormat::Rgba8UnormSrgb,
    }
}

/// What a pipeline draws.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Pass {
    /// Triangles seen from the front only.
    SingleSided,
    /// Triangles seen from both sides.
    DoubleSided,
    /// Shadow planes in front of the model.
    PlanesVisible,
    /// Shadow planes inside the model or behind it.
    PlanesHidden,
}

/// Everything that distinguishes two pipelines.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct PipelineKey {
    /// What.
    pub pass: Pass,
    /// In which mode.
    pub mode: Mode,
    /// With how many samples.
    pub antialias: Antialias,
    /// Under a point light?
    pub point_light: bool,
}

/// The bind group layouts: group 0 is the frame with its planes, group 1 a material.
#[derive(Clone, Debug)]
pub struct Layouts {
    /// Group 0.
    pub frame: wgpu::BindGroupLayout,
    /// Group 1.
    pub material: wgpu::BindGroupLayout,
    forward: wgpu::PipelineLayout,
    rectangles: wgpu::PipelineLayout,
}

impl Layouts {
    /// Makes them.
    pub fn new(gpu: &Gpu) -> Self {
        use wgpu::{BindingType, BufferBindingType, SamplerBindingType, ShaderStages, TextureViewDimension};
        let buffer = |ty| BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
        let storage = buffer(BufferBindingType::Storage { read_only: true });
        let texture = |view_dimension| BindingType::Texture {
            sample_type: wgpu::TextureSampleType::Float { filterable: true },
            view_dimension,
            multisampled: false,
        };
        let sampler = BindingType::Sampler(SamplerBindingType::Filtering);
        let group = |label, entries: &[(ShaderStages, BindingType)]| {
            let entry = |(binding, &(visibility, ty)): (usize, &(ShaderStages, BindingType))| {
                wgpu::BindGroupLayoutEntry { binding: binding as u32, visibility, ty, count: None }
            };
            let entries: Vec<_> = entries.iter().enumerate().map(entry).collect();
            let descriptor = wgpu::BindGroupLayoutDescriptor { label: Some(label), entries: &entries };
            gpu.device.create_bind_group_layout(&descriptor)
        };
        let (fragment, both) = (ShaderStages::FRAGMENT, ShaderStages::VERTEX_FRAGMENT);
        let frame = group(
            "frame",
            &[
                (both, buffer(BufferBindingType::Uniform)),
                (fragment, storage),
                (fragment, texture(TextureViewDimension::D2Array)),
                (fragment, sampler),
                (both, storage),
                (fragment, storage),
            ],
        );
        let base_image = texture(TextureViewDimension::D2);
        let material = group("material", &[(fragment, storage), (fragment, base_image), (fragment, sampler)]);
        let pipeline_layout = |groups: &[Option<&wgpu::BindGroupLayout>]| {
            gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                bind_group_layouts: groups,
                ..Default::default()
            })
        };
        let forward = pipeline_layout(&[Some(&frame), Some(&material)]);
        let rectangles = pipeline_layout(&[Some(&frame)]);
        Self { frame, material, forward, rectangles }
    }
}

/// Pipelines by key.
#[derive(Debug)]
pub struct Pipelines {
    forward: wgpu::ShaderModule,
    rectangles: wgpu::ShaderModule,
    made: BTreeMap<PipelineKey, wgpu::RenderPipeline>,
}

impl Pipelines {
    /// Compiles the shaders.
    pub fn new(gpu: &Gpu) -> Self {
        Self { forward: gpu.module(&FORWARD), rectangles: gpu.module(&PLANE_RECTANGLES), made: BTreeMap::new() }
    }

    /// The pipeline of `key`, made on first use.
    pub fn get(&mut self, gpu: &Gpu, layouts: &Layouts, key: PipelineKey) -> &wgpu::RenderPipeline {
        let (forward, rectangles) = (&self.forward, &self.rectangles);
        self.made.entry(key).or_insert_with(|| match key.pass {
            Pass::SingleSided | Pass::DoubleSided => forward_pipeline(gpu, layouts, forward, key),
            Pass::PlanesVisible | Pass::PlanesHidden => rectangle_pipeline(gpu, layouts, rectangles, key),
        })
    }
}

fn constants_of(key: PipelineKey) -> [(&'static str, f64); 3] {
    let point_light = f64::from(u8::from(key.point_light));
    [("POINT_LIGHT", point_light), ("EDGE_ON", f64::from(EDGE_ON)), ("SDF_BORDER", f64::from(SDF_BORDER))]
}

fn multisample(key: PipelineKey) -> wgpu::MultisampleState {
    wgpu::MultisampleState { count: key.antialias.samples(), ..Default::default() }
}

fn depth(compare: wgpu::CompareFunction, write: bool) -> Option<wgpu::DepthStencilState> {
    Some(wgpu::DepthStencilState {
        format: DEPTH_FORMAT,
        depth_write_enabled: Some(write),
        depth_compare: Some(compare),
        stencil: wgpu::StencilState::default(),
        bias: wgpu::DepthBiasState::default(),
    })
}

fn forward_pipeline(
    gpu: &Gpu,
    layouts: &Layouts,
    module: &wgpu::ShaderModule,
    key: PipelineKey,
) -> wgpu::RenderPipeline {
    let entry_point = match key.mode {
        Mode::Shaded => "fs_shaded",
        Mode::Mask => "fs_mask",
        Mode::Planes => "fs_planes",
    };
    let mut constants = constants_of(key).to_vec();
    constants.extend([("AMBIENT", f64::from(AMBIENT)), ("DIFFUSE", f64::from(DIFFUSE))]);
    let compilation_options = wgpu::PipelineCompilationOptions { constants: &constants, ..Default::default() };
    let cull_mode = if key.pass == Pass::SingleSided { Some(wgpu::Face::Back) } else { None };
    gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(entry_point),
        layout: Some(&layouts.forward),
        vertex: wgpu::VertexState {
            module,
            entry_point: Some("vs_surface"),
            compilation_options: compilation_options.clone(),
            buffers: &[Some(wgpu::VertexBufferLayout {
                array_stride: size_of::<Vertex>() as u64,
                step_mode: wgpu::VertexStepMode::Vertex,
                attributes: &VERTEX_ATTRIBUTES,
            })],
        },
        primitive: wgpu::PrimitiveState { cull_mode, ..Default::default() },
        depth_stencil: depth(wgpu::CompareFunction::Less, true),
        multisample: multisample(key),
        fragment: Some(wgpu::FragmentState {
            module,
            entry_point: Some(entry_point),
            compilation_options,
            targets: &[Some(color_format(key.mode).into())],
        }),
        multiview_mask: None,
        cache: None,
    })
}

fn rectangle_pipeline(
    gpu: &Gpu,
    layouts: &Layouts,
    module: &wgpu::ShaderModule,
    key: PipelineKey,
) -> wgpu::RenderPipeline {
    let (compare, opacity) = match key.pass {
        Pass::PlanesHidden => (wgpu::CompareFunction::Greater, OPACITY_HIDDEN),
        _ => (wgpu::CompareFunction::LessEqual, OPACITY_VISIBLE),
    };
    let mut constants = constants_of(key).to_vec();
    constants.push(("OPACITY", opacity));
    let compilation_options = wgpu::PipelineCompilationOptions { constants: &constants, ..Default::default() };
    let target =
        wgpu::ColorTargetState { blend: Some(wgpu::BlendState::ALPHA_BLENDING), ..color_format(key.mode).into() };
    gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("fs_rectangle"),
        layout: Some(&layouts.rectangles),
        vertex: wgpu::VertexState {
            module,
            entry_point: Some("vs_rectangle"),
            compilation_options: compilation_options.clone(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: depth(compare, false),
        multisample: multisample(key),
        fragment: Some(wgpu::FragmentState {
            module,
            entry_point: Some("fs_rectangle"),
            compilation_options,
            targets: &[Some(target)],
        }),
        multiview_mask: None,
        cache: None,
    })
}
