//! The depth of the casters as a light sees them, drawn into a depth texture: what every map of a light starts with.
//!
//! A pass without colour. Batches without holes need no fragment stage. Back faces cast too: a soup has no outside.

use super::{
    forward::{pipeline_layout, vertex_buffer},
    gpu::DEPTH,
    stage::{Part, Stage},
    view_matrices::ViewMatrices,
};
use glam::Mat4;

/// Format of all maps of depth: float, so that its bias is relative.
pub(crate) const MAP_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// Draws depth from a light's view.
#[derive(Debug)]
pub(crate) struct DepthPass {
    pipelines: [wgpu::RenderPipeline; 2],
    matrices: ViewMatrices,
}

impl DepthPass {
    /// For up to `views` views of a frame (a point light has six), with the rasteriser's depth bias.
    pub fn new(stage: &Stage, views: usize, bias: wgpu::DepthBiasState) -> Self {
        let gpu = &stage.gpu;
        let matrices = ViewMatrices::new(stage, views);
        let module = gpu.module(&DEPTH);
        let layout = pipeline_layout(stage, Some(&matrices.layout));
        let pipelines = [false, true].map(|has_holes| {
            let constants = [("POINT_LIGHT", 0.0), ("AMBIENT", 0.0), ("DIFFUSE", 0.0)];
            let compilation_options = wgpu::PipelineCompilationOptions { constants: &constants, ..Default::default() };
            gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some("depth"),
                layout: Some(&layout),
                vertex: wgpu::VertexState {
                    module: &module,
                    entry_point: Some("vs_depth"),
                    compilation_options: compilation_options.clone(),
                    buffers: &[Some(vertex_buffer())],
                },
                primitive: wgpu::PrimitiveState::default(),
                depth_stencil: Some(wgpu::DepthStencilState {
                    format: MAP_FORMAT,
                    depth_write_enabled: Some(true),
                    depth_compare: Some(wgpu::CompareFunction::Less),
                    stencil: wgpu::StencilState::default(),
                    bias,
                }),
                multisample: wgpu::MultisampleState::default(),
                fragment: has_holes.then_some(wgpu::FragmentState {
                    module: &module,
                    entry_point: Some("fs_depth"),
                    compilation_options,
                    targets: &[],
                }),
                multiview_mask: None,
                cache: None,
            })
        });
        Self { pipelines, matrices }
    }

    /// Clears `target` and draws the casters of all instances into it: the number of the view in this frame, and its clip
    /// space from world space.
    pub fn record(
        &self,
        stage: &Stage,
        view: (usize, Mat4),
        target: &wgpu::TextureView,
        encoder: &mut wgpu::CommandEncoder,
    ) {
        let matrices = self.matrices.send(stage, view);
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("depth"),
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: target,
                depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(1.0), store: wgpu::StoreOp::Store }),
                stencil_ops: None,
            }),
            ..Default::default()
        });
        stage.bind(&mut pass);
        pass.set_bind_group(2, matrices, &[]);
        stage.draw(&mut pass, Part::Casters, |batch| &self.pipelines[usize::from(batch.has_holes)]);
    }

    /// Bytes of its buffers.
    pub fn buffer_bytes(&self) -> usize {
        self.matrices.bytes()
    }
}
