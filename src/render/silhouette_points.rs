//! The points at which the silhouette, as a light sees it, passes through the texels of a map.
//!
//! In: the casters' edges ([`Casters`]), a light, its views and the depth drawn from them. Out: one point a texel, its
//! place in the texel in 8 bits an axis. The CPU finds the edges once a light and instance: those whose cap count is not
//! 0, which are the outline wherever faces continue each other, and all borders of an open surface. Each is drawn as a
//! widened quad; the fragment of a texel picks the point. Source: P. Sen, M. Cammarano, P. Hanrahan, "Shadow Silhouette
//! Maps", 2003.
//!
//! Texel k of the map lies between the centres of texels k and k + 1 of the depth map: the two are half a texel apart.
//!
//! Not guaranteed: more than one edge a texel (the one nearest to the light stays), edges of cut-out holes.

use super::{
    Light, RenderError,
    bindings::{STORAGE, buffer, depth_texture, group, layout},
    depth_pass::MAP_FORMAT,
    gpu::SILHOUETTE_POINTS,
    layout::SilhouetteEdge,
    light_map::LightMap,
    stage::{Placement, Stage},
    volume::Casters,
};
use glam::{Mat4, Vec3, Vec4};
use rayon::prelude::*;
use std::ops::Range;

/// Two shares of a texel's sides, each off by 1/510 of a texel at most.
pub(crate) const POINT_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rg8Unorm;

/// Edges are cut off this far outside the map: a quad is wider than its edge by less than 0.8.
const ROOM_TEXELS: f32 = 2.0;

/// Draws silhouette points.
#[derive(Debug)]
pub(crate) struct SilhouettePoints {
    casters: Casters,
    pipeline: wgpu::RenderPipeline,
    layout: wgpu::BindGroupLayout,
    edges: wgpu::Buffer,
    /// Depths of the points, for the nearest to stay.
    nearest: LightMap,
    side: u32,
}

impl SilhouettePoints {
    /// For maps of `side` texels a side.
    pub fn new(stage: &Stage, casters: Casters, side: u32) -> Self {
        let gpu = &stage.gpu;
        let both = wgpu::ShaderStages::VERTEX_FRAGMENT;
        let bindings = [(both, STORAGE), (both, depth_texture(wgpu::TextureViewDimension::D2))];
        let layout = layout(gpu, "silhouette points", &bindings);
        let pipeline = pipeline(stage, &layout);
        let edges = buffer::<SilhouetteEdge>(gpu, "silhouette", 0, wgpu::BufferUsages::STORAGE);
        let nearest = LightMap::new(gpu, MAP_FORMAT, (side, 1));
        Self { casters, pipeline, layout, edges, nearest, side }
    }

    /// Draws the points of each view of a light into its face of `points`, given the depth that it sees.
    ///
    /// # Errors
    /// The edges exceed the adapter's limits.
    pub fn record(
        &mut self,
        stage: &Stage,
        (views, light): (&[Mat4], &Light),
        (depth, points): (&LightMap, &LightMap),
        encoder: &mut wgpu::CommandEncoder,
    ) -> Result<(), RenderError> {
        let (edges, ranges) = self.edges_of(stage, views, light);
        self.send(stage, &edges)?;
        for ((range, depth), points) in ranges.into_iter().zip(&depth.faces).zip(&points.faces) {
            let resources = [self.edges.as_entire_binding(), wgpu::BindingResource::TextureView(depth)];
            let group = group(&stage.gpu, &self.layout, &resources);
            let mut pass = self.begin(points, encoder);
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, &group, &[]);
            pass.draw(6 * range.start..6 * range.end, 0..1);
        }
        Ok(())
    }

    /// The silhouette of all instances in the map of each view, and which edges are whose.
    fn edges_of(&self, stage: &Stage, views: &[Mat4], light: &Light) -> (Vec<SilhouetteEdge>, Vec<Range<u32>>) {
        let corners = self.casters.corners().as_flattened();
        let of_instance = |placement: &Placement| {
            let sides = self.casters.volume(placement.light_unit(light).homogeneous()).sides;
            let ends = sides.iter().map(|side| [side.start, side.end].map(|corner| corners[corner as usize]));
            (placement.world_from_unit(), ends.collect::<Vec<_>>())
        };
        let silhouettes: Vec<_> = stage.placements().par_iter().map(of_instance).collect();
        let (mut edges, mut ranges) = (Vec::new(), Vec::new());
        for &view in views {
            let first = edges.len() as u32;
            for (world_from_unit, ends) in &silhouettes {
                let clip_from_unit = view * *world_from_unit;
                edges.extend(ends.iter().filter_map(|ends| edge_in_map(&clip_from_unit, ends, self.side as f32)));
            }
            ranges.push(first..edges.len() as u32);
        }
        (edges, ranges)
    }

    fn send(&mut self, stage: &Stage, edges: &[SilhouetteEdge]) -> Result<(), RenderError> {
        let (needed, limit) = (size_of_val(edges) as u64, stage.gpu.limits().max_storage_buffer_binding_size);
        if needed > limit {
            return Err(RenderError::TooLarge { what: "the silhouette's edges", needed, limit });
        }
        if needed > self.edges.size() {
            self.edges = buffer::<SilhouetteEdge>(&stage.gpu, "silhouette", edges.len(), wgpu::BufferUsages::STORAGE);
        }
        stage.gpu.queue.write_buffer(&self.edges, 0, bytemuck::cast_slice(edges));
        Ok(())
    }

    fn begin<'e>(&self, points: &wgpu::TextureView, encoder: &'e mut wgpu::CommandEncoder) -> wgpu::RenderPass<'e> {
        // Where no edge passes, the quadrants are those of the depth map's own texels.
        let centre = wgpu::Color { r: 0.5, g: 0.5, b: 0.0, a: 1.0 };
        encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("silhouette points"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: points,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations { load: wgpu::LoadOp::Clear(centre), store: wgpu::StoreOp::Store },
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &self.nearest.faces[0],
                depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(1.0), store: wgpu::StoreOp::Discard }),
                stencil_ops: None,
            }),
            ..Default::default()
        })
    }

    /// Bytes of its buffers.
    pub fn buffer_bytes(&self) -> usize {
        self.edges.size() as usize
    }

    /// Bytes of its texture.
    pub fn texture_bytes(&self) -> usize {
        4 * (self.side as usize).pow(2)
    }
}

/// An edge in the map of a view, or `None` where it lies outside.
fn edge_in_map(clip_from_unit: &Mat4, ends: &[Vec3; 2], side: f32) -> Option<SilhouetteEdge> {
    let [a, b] = ends.map(|p| *clip_from_unit * p.extend(1.0));
    let reach = 1.0 + 2.0 * ROOM_TEXELS / side;
    // Positive inside: beyond the nearest depth, and not far off the map's sides.
    let distances = |p: Vec4| {
        let reach = reach * p.w;
        [p.z, reach - p.x, reach + p.x, reach - p.y, reach + p.y]
    };
    let (mut first, mut last) = (0.0_f32, 1.0_f32);
    for (at_a, at_b) in distances(a).into_iter().zip(distances(b)) {
        match (at_a < 0.0, at_b < 0.0) {
            (true, true) => return None,
            (true, false) => first = first.max(at_a / (at_a - at_b)),
            (false, true) => last = last.min(at_a / (at_a - at_b)),
            (false, false) => {}
        }
    }
    let in_map = |along: f32| {
        let p = a + along * (b - a);
        let ndc = p.truncate() / p.w;
        let texels = |share: f32| (0.5 + 0.5 * share) * side - 0.5;
        Vec4::new(texels(ndc.x), texels(-ndc.y), ndc.z, 0.0)
    };
    (first <= last).then(|| SilhouetteEdge { a: in_map(first), b: in_map(last) })
}

fn pipeline(stage: &Stage, layout: &wgpu::BindGroupLayout) -> wgpu::RenderPipeline {
    let device = &stage.gpu.device;
    let module = stage.gpu.module(&SILHOUETTE_POINTS);
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        bind_group_layouts: &[Some(layout)],
        ..Default::default()
    });
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("silhouette points"),
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("vs_edge"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: Some(wgpu::DepthStencilState {
            format: MAP_FORMAT,
            depth_write_enabled: Some(true),
            depth_compare: Some(wgpu::CompareFunction::Less),
            stencil: wgpu::StencilState::default(),
            bias: wgpu::DepthBiasState::default(),
        }),
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some("fs_point"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            targets: &[Some(POINT_FORMAT.into())],
        }),
        multiview_mask: None,
        cache: None,
    })
}
