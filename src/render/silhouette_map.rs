//! Technique: shadow silhouette maps (P. Sen, M. Cammarano, P. Hanrahan, "Shadow Silhouette Maps", 2003).
//!
//! Passes for a light: the casters' depth, then the silhouette's points (`silhouette_points`), in a map of the same size
//! half a texel off. A fragment makes four depth tests, at the corners of its texel of points.
//! Where they disagree, lines from the texel's point to those of its four neighbours cut the texel into skewed quadrants,
//! and the corner of the fragment's own decides: along a straight edge these lines are the edge.
//!
//! The bias is that of [`shadow_map`](super::shadow_map): the casters' half for a kernel of 2, since a corner is as far from
//! the fragment as the texels of a bilinear lookup are; the receiver's for each corner. Directional and point lights; a
//! point light has six faces.
//!
//! Against a shadow map of equal size the pixels wrong along a square plate's shadow are 14 to 24 times fewer at 32 texels,
//! 160 and more at 128; on the teapot on a ground 4.6 times at 128 and 5.9 at 512.
//!
//! Not guaranteed: several edges in one texel, and corners that cover no corner of a texel: they are cut off. Holes of
//! cut-outs and surfaces that cut through each other have the borders of a shadow map. Shadows of casters nearer to a
//! receiver than the bias are lost.

use super::{
    FrameRequest, RenderError,
    bindings::{STORAGE, buffer, depth_texture, group, layout, texture},
    depth_pass::{DepthPass, MAP_FORMAT},
    forward::{Forward, ForwardOptions},
    gpu::SILHOUETTE_MAP,
    light_map::LightMap,
    light_view::views,
    shadow_map::depth_bias,
    silhouette_points::{POINT_FORMAT, SilhouettePoints},
    stage::{Begin, Part, Stage, Targets},
    technique::{Cost, Technique},
    view_matrices::per_instance,
    volume::Casters,
};
use crate::scene::Scene;
use glam::Mat4;
use shadowfit_solver::mesh::Frame;

/// A fragment's neighbour texel may be a texel off its own, whose far corner is another one off.
const REACH_TEXELS: f32 = 2.0;

/// Texels along a side of what a fragment compares with.
const KERNEL_TEXELS: u32 = 2;

/// Draws the model with a shadow silhouette map.
#[derive(Debug)]
pub struct SilhouetteMap {
    size_texels: u32,
    depth_pass: DepthPass,
    points: SilhouettePoints,
    matrices: wgpu::Buffer,
    layout: wgpu::BindGroupLayout,
    forward: Forward,
    maps: Option<Maps>,
}

/// One layer a view.
#[derive(Debug)]
struct Maps {
    depth: LightMap,
    points: LightMap,
    group: wgpu::BindGroup,
}

impl SilhouetteMap {
    /// For frames of `stage`, which was made of `scene` and `frame`; both maps have `size_texels` a side, 2 to the
    /// adapter's limit. Error falls and cost grows with it.
    ///
    /// # Errors
    /// A size beyond the adapter's limits.
    pub fn new(stage: &Stage, scene: &Scene, frame: &Frame, size_texels: u32) -> Result<Self, RenderError> {
        let gpu = &stage.gpu;
        LightMap::check_side(gpu, size_texels)?;
        let fragment = wgpu::ShaderStages::FRAGMENT;
        let array = wgpu::TextureViewDimension::D2Array;
        let bindings = [(fragment, STORAGE), (fragment, depth_texture(array)), (fragment, texture(array))];
        let layout = layout(gpu, "silhouette map", &bindings);
        let forward = Forward::new(stage, &SILHOUETTE_MAP, Some(&layout), ForwardOptions::default());
        let count = 6 * stage.placements().len();
        let matrices = buffer::<Mat4>(gpu, "light matrices", count, wgpu::BufferUsages::STORAGE);
        let depth_pass = DepthPass::new(stage, 6, depth_bias(KERNEL_TEXELS));
        let (casters, _) = Casters::of_scene(scene, frame, |_| 0);
        let points = SilhouettePoints::new(stage, casters, size_texels);
        gpu.check()?;
        Ok(Self { size_texels, depth_pass, points, matrices, layout, forward, maps: None })
    }

    fn make_maps(&self, stage: &Stage, count: u32) -> Maps {
        let map = |format| LightMap::new(&stage.gpu, format, (self.size_texels, count));
        let (depth, points) = (map(MAP_FORMAT), map(POINT_FORMAT));
        let resources = [
            self.matrices.as_entire_binding(),
            wgpu::BindingResource::TextureView(&depth.all),
            wgpu::BindingResource::TextureView(&points.all),
        ];
        let group = group(&stage.gpu, &self.layout, &resources);
        Maps { depth, points, group }
    }
}

impl Technique for SilhouetteMap {
    fn name(&self) -> String {
        format!("silhouette map {}", self.size_texels)
    }

    fn update(
        &mut self,
        stage: &Stage,
        request: &FrameRequest,
        encoder: &mut wgpu::CommandEncoder,
    ) -> Result<(), RenderError> {
        let views = views(stage, &request.light, (self.size_texels, REACH_TEXELS));
        let maps = match self.maps.take() {
            Some(maps) if maps.depth.faces.len() == views.len() => maps,
            _ => self.make_maps(stage, views.len() as u32),
        };
        for (number, (&view, face)) in views.iter().zip(&maps.depth.faces).enumerate() {
            self.depth_pass.record(stage, (number, view), face, encoder);
        }
        self.points.record(stage, (&views, &request.light), (&maps.depth, &maps.points), encoder)?;
        self.maps = Some(maps);
        stage.gpu.queue.write_buffer(&self.matrices, 0, bytemuck::cast_slice(&per_instance(stage, &views)));
        Ok(())
    }

    fn draw(
        &mut self,
        stage: &Stage,
        request: &FrameRequest,
        targets: &Targets,
        encoder: &mut wgpu::CommandEncoder,
    ) -> Result<(), RenderError> {
        let mut pass = targets.begin(encoder, (request.options.mode, Begin::Clear));
        pass.set_bind_group(2, self.maps.as_ref().map(|maps| &maps.group), &[]);
        self.forward.draw(stage, request, targets, (&mut pass, Part::All));
        Ok(())
    }

    fn cost(&self, stage: &Stage) -> Cost {
        // Depth in 4 bytes and a point in 2.
        const TEXEL_BYTES: usize = 6;
        let faces = self.maps.as_ref().map_or(1, |maps| maps.depth.faces.len());
        let texels = faces * (self.size_texels as usize).pow(2);
        let buffers = [self.matrices.size() as usize, self.depth_pass.buffer_bytes(), self.points.buffer_bytes()];
        Cost {
            passes: 1,
            draw_calls: stage.calls_per_pass(),
            update_passes: 2 * faces,
            update_draw_calls: faces * (stage.calls_per_pass() + 1),
            texture_bytes: TEXEL_BYTES * texels + self.points.texture_bytes(),
            buffer_bytes: buffers.iter().sum(),
            on_light_change:
                "all casters drawn into the map again; each instance's silhouette found on the CPU and drawn"
                    .to_string(),
        }
    }
}
