//! The silhouette of the casters as a light sees them, drawn into a texture of one channel: 1 wherever one is.

use super::{
    forward::{pipeline_layout, vertex_buffer},
    gpu::SILHOUETTE,
    stage::{Part, Stage},
    view_matrices::ViewMatrices,
};
use glam::Mat4;

/// What silhouettes are drawn into.
#[derive(Clone, Debug)]
pub(crate) struct SilhouetteTarget {
    /// Of the texture.
    pub format: wgpu::TextureFormat,
    /// How a silhouette mixes with what is there.
    pub blend: Option<wgpu::BlendState>,
    /// Where the pass has depth.
    pub depth: Option<wgpu::DepthStencilState>,
}

/// Draws silhouettes.
#[derive(Debug)]
pub(crate) struct Silhouette {
    pipelines: [wgpu::RenderPipeline; 2],
    matrices: ViewMatrices,
}

impl Silhouette {
    /// For up to `views` views of a frame.
    pub fn new(stage: &Stage, views: usize, target: &SilhouetteTarget) -> Self {
        let gpu = &stage.gpu;
        let matrices = ViewMatrices::new(stage, views);
        let module = gpu.module(&SILHOUETTE);
        let layout = pipeline_layout(stage, Some(&matrices.layout));
        let color = wgpu::ColorTargetState { blend: target.blend, ..target.format.into() };
        let pipelines = [false, true].map(|has_holes| {
            let holes = f64::from(u8::from(has_holes));
            let constants = [("POINT_LIGHT", 0.0), ("AMBIENT", 0.0), ("DIFFUSE", 0.0), ("HAS_HOLES", holes)];
            let compilation_options = wgpu::PipelineCompilationOptions { constants: &constants, ..Default::default() };
            gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some("silhouette"),
                layout: Some(&layout),
                vertex: wgpu::VertexState {
                    module: &module,
                    entry_point: Some("vs_depth"),
                    compilation_options: compilation_options.clone(),
                    buffers: &[Some(vertex_buffer())],
                },
                primitive: wgpu::PrimitiveState::default(),
                depth_stencil: target.depth.clone(),
                multisample: wgpu::MultisampleState::default(),
                fragment: Some(wgpu::FragmentState {
                    module: &module,
                    entry_point: Some("fs_silhouette"),
                    compilation_options,
                    targets: &[Some(color.clone())],
                }),
                multiview_mask: None,
                cache: None,
            })
        });
        Self { pipelines, matrices }
    }

    /// Draws the casters of all instances: the number of the view in this frame, and its clip space from world space.
    pub fn draw(&self, stage: &Stage, view: (usize, Mat4), pass: &mut wgpu::RenderPass<'_>) {
        stage.bind(pass);
        pass.set_bind_group(2, self.matrices.send(stage, view), &[]);
        stage.draw(pass, Part::Casters, |batch| &self.pipelines[usize::from(batch.has_holes)]);
    }

    /// Bytes of its buffers.
    pub fn buffer_bytes(&self) -> usize {
        self.matrices.bytes()
    }
}

/// Starts a pass into a texture of silhouettes, filled with `before`.
pub(crate) fn begin<'e>(
    encoder: &'e mut wgpu::CommandEncoder,
    view: &wgpu::TextureView,
    before: f64,
    depth: Option<&wgpu::TextureView>,
) -> wgpu::RenderPass<'e> {
    let clear = wgpu::LoadOp::Clear(wgpu::Color { r: before, ..wgpu::Color::TRANSPARENT });
    encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        label: Some("silhouettes"),
        color_attachments: &[Some(wgpu::RenderPassColorAttachment {
            view,
            depth_slice: None,
            resolve_target: None,
            ops: wgpu::Operations { load: clear, store: wgpu::StoreOp::Store },
        })],
        depth_stencil_attachment: depth.map(|view| wgpu::RenderPassDepthStencilAttachment {
            view,
            depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(1.0), store: wgpu::StoreOp::Discard }),
            stencil_ops: None,
        }),
        ..Default::default()
    })
}
