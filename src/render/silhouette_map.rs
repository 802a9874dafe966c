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
    bindings::{depth_texture, texture},
    depth_pass::{DepthPass, MAP_FORMAT},
    forward::{Forward, ForwardOptions},
    gpu::SILHOUETTE_MAP,
    light_map::{LightMaps, MOST_VIEWS},
    light_view::views,
    shadow_map::depth_bias,
    silhouette_points::{POINT_FORMAT, SilhouettePoints},
    stage::{Begin, Part, Stage, Targets},
    technique::{Cost, Technique},
    volume::Casters,
};
use crate::scene::Scene;
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
    /// Of depth, and of points.
    maps: LightMaps,
    forward: Forward,
}

impl SilhouetteMap {
    /// For frames of `stage`, which was made of `scene` and `frame`; both maps have `size_texels` a side, 2 to the
    /// adapter's limit. Error falls and cost grows with it.
    ///
    /// # Errors
    /// A size beyond the adapter's limits.
    pub fn new(stage: &Stage, scene: &Scene, frame: &Frame, size_texels: u32) -> Result<Self, RenderError> {
        let gpu = &stage.gpu;
        let array = wgpu::TextureViewDimension::D2Array;
        let maps = [(MAP_FORMAT, depth_texture(array)), (POINT_FORMAT, texture(array))];
        let maps = LightMaps::new(stage, size_texels, &maps, None)?;
        let forward = Forward::new(stage, &SILHOUETTE_MAP, Some(&maps.layout), ForwardOptions::default());
        let depth_pass = DepthPass::new(stage, MOST_VIEWS, depth_bias(KERNEL_TEXELS));
        let (casters, _) = Casters::of_scene(scene, frame, |_| 0);
        let points = SilhouettePoints::new(stage, casters, size_texels);
        gpu.check()?;
        Ok(Self { size_texels, depth_pass, points, maps, forward })
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
        let [depth, points] = self.maps.of_views(stage, &views) else { return Ok(()) };
        for (number, (&view, face)) in views.iter().zip(&depth.faces).enumerate() {
            self.depth_pass.record(stage, (number, view), face, encoder);
        }
        self.points.record(stage, (&views, &request.light), (depth, points), encoder)?;
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
        pass.set_bind_group(2, self.maps.group(), &[]);
        self.forward.draw(stage, request, targets, (&mut pass, Part::All));
        Ok(())
    }

    fn cost(&self, stage: &Stage) -> Cost {
        // Depth in 4 bytes and a point in 2.
        const TEXEL_BYTES: usize = 6;
        let faces = self.maps.views();
        let buffers = [self.maps.buffer_bytes(), self.depth_pass.buffer_bytes(), self.points.buffer_bytes()];
        Cost {
            passes: 1,
            draw_calls: stage.calls_per_pass(),
            update_passes: 2 * faces,
            update_draw_calls: faces * (stage.calls_per_pass() + 1),
            texture_bytes: TEXEL_BYTES * self.maps.texels() + self.points.texture_bytes(),
            buffer_bytes: buffers.iter().sum(),
            on_light_change:
                "all casters drawn into the map again; each instance's silhouette found on the CPU and drawn"
                    .to_string(),
        }
    }
}
