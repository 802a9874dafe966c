//! The forward pass of a technique: the model, lit, its visibility from the technique's snippet.
//!
//! A [`Shader`] joins frame.wgsl, surface.wgsl, forward.wgsl and the snippet; pipelines are made when a frame first needs
//! them.

use super::{
    AMBIENT, Antialias, DIFFUSE, FrameRequest, Light, Mode,
    gpu::{Gpu, Shader},
    layout::{VERTEX_ATTRIBUTES, Vertex},
    stage::{Part, Stage, Targets, color_format},
    upload::Batch,
};
use std::collections::BTreeMap;

/// Everything that distinguishes two pipelines of a pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct PipelineKey {
    double_sided: bool,
    has_holes: bool,
    mode: Mode,
    antialias: Antialias,
    point_light: bool,
}

/// What a forward pass does beside drawing the nearest surface.
#[derive(Clone, Debug)]
pub(crate) struct ForwardOptions {
    /// Entry points of the vertex stage, and of the fragment stage for pictures and masks.
    pub entry_points: [&'static str; 3],
    /// The snippet's pipeline constants.
    pub constants: Vec<(&'static str, f64)>,
    /// Which depths pass.
    pub depth_compare: wgpu::CompareFunction,
    /// Are depths written?
    pub depth_write: bool,
    /// The stencil test, where the targets have one.
    pub stencil: wgpu::StencilState,
    /// How colours mix with what is there.
    pub blend: Option<wgpu::BlendState>,
    /// Which channels are written.
    pub write_mask: wgpu::ColorWrites,
    /// Which faces of single-sided triangles are left out.
    pub cull_mode: Option<wgpu::Face>,
}

impl Default for ForwardOptions {
    fn default() -> Self {
        Self {
            entry_points: ["vs_surface", "fs_shaded", "fs_mask"],
            constants: Vec::new(),
            depth_compare: wgpu::CompareFunction::Less,
            depth_write: true,
            stencil: wgpu::StencilState::default(),
            blend: None,
            write_mask: wgpu::ColorWrites::ALL,
            cull_mode: Some(wgpu::Face::Back),
        }
    }
}

/// The forward pass of a technique.
#[derive(Debug)]
pub(crate) struct Forward {
    module: wgpu::ShaderModule,
    layout: wgpu::PipelineLayout,
    options: ForwardOptions,
    made: BTreeMap<PipelineKey, wgpu::RenderPipeline>,
}

impl Forward {
    /// Compiles `shader`, whose group 2 has the given layout.
    pub fn new(
        stage: &Stage,
        shader: &Shader,
        group_2: Option<&wgpu::BindGroupLayout>,
        options: ForwardOptions,
    ) -> Self {
        let module = stage.gpu.module(shader);
        let layout = pipeline_layout(stage, group_2);
        Self { module, layout, options, made: BTreeMap::new() }
    }

    /// Draws all instances of a part of the model; the technique's group 2 is bound already.
    pub fn draw(
        &mut self,
        stage: &Stage,
        request: &FrameRequest,
        targets: &Targets,
        (pass, part): (&mut wgpu::RenderPass<'_>, Part),
    ) {
        self.draw_sections(stage, request, targets, (pass, part, &|_| true));
    }

    /// The same of the sections that are wanted, by their labels.
    pub fn draw_sections(
        &mut self,
        stage: &Stage,
        request: &FrameRequest,
        targets: &Targets,
        (pass, part, wanted): (&mut wgpu::RenderPass<'_>, Part, &dyn Fn(u32) -> bool),
    ) {
        let key = |batch: &Batch| PipelineKey {
            double_sided: batch.double_sided,
            has_holes: batch.has_holes,
            mode: request.options.mode,
            antialias: request.options.antialias,
            point_light: matches!(request.light, Light::Point { .. }),
        };
        for key in stage.model.batches.iter().map(key) {
            if !self.made.contains_key(&key) {
                let pipeline = self.pipeline(&stage.gpu, key, targets.depth_format);
                self.made.insert(key, pipeline);
            }
        }
        stage.bind(pass);
        stage.draw_sections(pass, (part, wanted), |batch| &self.made[&key(batch)]);
    }

    fn pipeline(&self, gpu: &Gpu, key: PipelineKey, format: wgpu::TextureFormat) -> wgpu::RenderPipeline {
        let [vertex, shaded, mask] = self.options.entry_points;
        let entry_point = if key.mode == Mode::Mask { mask } else { shaded };
        let mut constants = self.options.constants.clone();
        constants.extend([
            ("POINT_LIGHT", f64::from(u8::from(key.point_light))),
            ("HAS_HOLES", f64::from(u8::from(key.has_holes))),
            ("AMBIENT", f64::from(AMBIENT)),
            ("DIFFUSE", f64::from(DIFFUSE)),
        ]);
        let compilation_options = wgpu::PipelineCompilationOptions { constants: &constants, ..Default::default() };
        let ForwardOptions { blend, write_mask, cull_mode, .. } = self.options;
        let target = wgpu::ColorTargetState { format: color_format(key.mode), blend, write_mask };
        gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(entry_point),
            layout: Some(&self.layout),
            vertex: wgpu::VertexState {
                module: &self.module,
                entry_point: Some(vertex),
                compilation_options: compilation_options.clone(),
                buffers: &[Some(vertex_buffer())],
            },
            primitive: wgpu::PrimitiveState {
                cull_mode: if key.double_sided { None } else { cull_mode },
                ..Default::default()
            },
            depth_stencil: Some(wgpu::DepthStencilState {
                format,
                depth_write_enabled: Some(self.options.depth_write),
                depth_compare: Some(self.options.depth_compare),
                stencil: self.options.stencil.clone(),
                bias: wgpu::DepthBiasState::default(),
            }),
            multisample: wgpu::MultisampleState { count: key.antialias.samples(), ..Default::default() },
            fragment: Some(wgpu::FragmentState {
                module: &self.module,
                entry_point: Some(entry_point),
                compilation_options,
                targets: &[Some(target)],
            }),
            multiview_mask: None,
            cache: None,
        })
    }
}

/// The layout of a pass that draws the model: frame, material, and the technique's own group.
pub(crate) fn pipeline_layout(stage: &Stage, group_2: Option<&wgpu::BindGroupLayout>) -> wgpu::PipelineLayout {
    stage.gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        bind_group_layouts: &[Some(&stage.layouts.frame), Some(&stage.layouts.material), group_2],
        ..Default::default()
    })
}

/// The model's vertices.
pub(crate) fn vertex_buffer() -> wgpu::VertexBufferLayout<'static> {
    wgpu::VertexBufferLayout {
        array_stride: size_of::<Vertex>() as u64,
        step_mode: wgpu::VertexStepMode::Vertex,
        attributes: &VERTEX_ATTRIBUTES,
    }
}
