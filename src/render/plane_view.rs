//! Mode `planes`: the shaded model with lines where the planes cut it, and the planes drawn through it as tinted glass.
//! Of one instance.

use super::{
    FrameRequest, Mode,
    atlas::Slot,
    bindings::{STORAGE, buffer, group, layout},
    forward::{Forward, ForwardOptions},
    gpu::{PLANE_CUTS, PLANE_RECTANGLES},
    layout::Rectangle,
    occluder_planes::{BINDINGS, OccluderPlanes},
    stage::{Begin, Part, Stage, Targets, color_format},
};
use glam::Vec3;
use shadowfit_solver::plane::BakedPlane;
use std::collections::BTreeMap;

/// Okabe and Ito, "Color Universal Design" (2008), sRGB, without black and the yellow that vanishes on light
/// surfaces.
const PLANE_COLORS_SRGB: [[u8; 3]; 6] =
    [[213, 94, 0], [0, 114, 178], [0, 158, 115], [204, 121, 167], [230, 159, 0], [86, 180, 233]];

/// Opacity of the parts of planes that lie in front of the model, and inside or behind it: enough to see where a
/// plane goes, too little to hide the surface.
const OPACITY_VISIBLE: f64 = 1.0;
const OPACITY_HIDDEN: f64 = 0.18;

/// Draws mode `planes`.
#[derive(Debug)]
pub(crate) struct PlaneView {
    rectangles: wgpu::Buffer,
    group: wgpu::BindGroup,
    cuts: Forward,
    module: wgpu::ShaderModule,
    constants: Vec<(&'static str, f64)>,
    layout: wgpu::PipelineLayout,
    /// Hidden planes and visible ones, by the samples of a pixel.
    made: BTreeMap<u32, [wgpu::RenderPipeline; 2]>,
}

impl PlaneView {
    /// For the planes of a technique.
    pub fn new(stage: &Stage, technique: &OccluderPlanes) -> Self {
        let gpu = &stage.gpu;
        let count = technique.planes().0.planes.len();
        let rectangles = buffer::<Rectangle>(gpu, "rectangles", count, wgpu::BufferUsages::STORAGE);
        let mut bindings = BINDINGS.to_vec();
        bindings.push((wgpu::ShaderStages::VERTEX_FRAGMENT, STORAGE));
        let group_layout = layout(gpu, "plane view", &bindings);
        let [casting, occluders, sampler] = technique.resources();
        let group = group(gpu, &group_layout, &[casting, occluders, sampler, rectangles.as_entire_binding()]);
        let options = ForwardOptions {
            entry_points: ["vs_surface", "fs_plane_cuts", "fs_mask"],
            constants: technique.forward_constants(),
            ..Default::default()
        };
        let cuts = Forward::new(stage, &PLANE_CUTS, Some(&group_layout), options);
        let layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            bind_group_layouts: &[Some(&stage.layouts.frame), None, Some(&group_layout)],
            ..Default::default()
        });
        let module = gpu.module(&PLANE_RECTANGLES);
        Self {
            rectangles,
            group,
            cuts,
            module,
            constants: technique.constants().to_vec(),
            layout,
            made: BTreeMap::new(),
        }
    }

    /// Records the frame.
    pub fn draw(
        &mut self,
        stage: &Stage,
        (request, technique): (&FrameRequest, &OccluderPlanes),
        targets: &Targets,
        encoder: &mut wgpu::CommandEncoder,
    ) {
        let rectangles = rectangles_seen_along(technique, request.camera.forward());
        stage.gpu.queue.write_buffer(&self.rectangles, 0, bytemuck::cast_slice(&rectangles));
        let samples = request.options.antialias.samples();
        let made = self.made.get(&samples).cloned();
        let pipelines = made.unwrap_or_else(|| {
            let depths =
                [(wgpu::CompareFunction::Greater, OPACITY_HIDDEN), (wgpu::CompareFunction::LessEqual, OPACITY_VISIBLE)];
            depths.map(|depth| self.pipeline(stage, (samples, targets.depth_format), depth))
        });
        self.made.insert(samples, pipelines.clone());
        let mut pass = targets.begin(encoder, (Mode::Planes, Begin::Clear));
        pass.set_bind_group(2, &self.group, &[]);
        self.cuts.draw(stage, request, targets, (&mut pass, Part::All));
        for pipeline in &pipelines {
            pass.set_pipeline(pipeline);
            pass.draw(0..6, 0..rectangles.len() as u32);
        }
    }

    fn pipeline(
        &self,
        stage: &Stage,
        (samples, format): (u32, wgpu::TextureFormat),
        (compare, opacity): (wgpu::CompareFunction, f64),
    ) -> wgpu::RenderPipeline {
        let mut constants = self.constants.to_vec();
        constants.extend([("POINT_LIGHT", 0.0), ("OPACITY", opacity)]);
        let compilation_options = wgpu::PipelineCompilationOptions { constants: &constants, ..Default::default() };
        let color = color_format(Mode::Planes);
        let target = wgpu::ColorTargetState { blend: Some(wgpu::BlendState::ALPHA_BLENDING), ..color.into() };
        stage.gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("fs_rectangle"),
            layout: Some(&self.layout),
            vertex: wgpu::VertexState {
                module: &self.module,
                entry_point: Some("vs_rectangle"),
                compilation_options: compilation_options.clone(),
                buffers: &[],
            },
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: Some(wgpu::DepthStencilState {
                format,
                depth_write_enabled: Some(false),
                depth_compare: Some(compare),
                stencil: wgpu::StencilState::default(),
                bias: wgpu::DepthBiasState::default(),
            }),
            multisample: wgpu::MultisampleState { count: samples, ..Default::default() },
            fragment: Some(wgpu::FragmentState {
                module: &self.module,
                entry_point: Some("fs_rectangle"),
                compilation_options,
                targets: &[Some(target)],
            }),
            multiview_mask: None,
            cache: None,
        })
    }
}

/// All rectangles, the farthest centre first: they are blended.
fn rectangles_seen_along(technique: &OccluderPlanes, forward: Vec3) -> Vec<Rectangle> {
    let (set, slots) = technique.planes();
    let rectangle =
        |(i, (baked, slot)): (usize, (&BakedPlane, &Slot))| Rectangle::new(baked, slot, plane_color_linear(i));
    let mut rectangles: Vec<_> = set.planes.iter().zip(slots).enumerate().map(rectangle).collect();
    rectangles.sort_by(|p, q| q.centre().dot(forward).total_cmp(&p.centre().dot(forward)));
    rectangles
}

/// Colour of plane `i`: the palette, darker each time it repeats.
fn plane_color_linear(i: usize) -> Vec3 {
    let color = PLANE_COLORS_SRGB[i % PLANE_COLORS_SRGB.len()];
    let round = (i / PLANE_COLORS_SRGB.len()) % 3;
    Vec3::from_array(color.map(super::linear_from_srgb)) * [1.0, 0.45, 0.2][round]
}
