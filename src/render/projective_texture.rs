//! Technique: a projective texture (M. Segal, C. Korobkin, R. van Widenfelt, J. Foran, P. Haeberli, "Fast Shadows and
//! Lighting Effects Using Texture Mapping", 1992; C. Everitt, "Projective Texture Mapping", 2001): the casters'
//! silhouette, one byte a texel, drawn from the light and projected onto the ground.
//!
//! A directional light has one parallel view, a point light the six faces of a cube. A fragment looks up the face that it
//! lies in, so nothing is projected back through the light.
//!
//! Not drawn: self-shadow, since a silhouette has no depth and would put all of a model into its own shadow. For the
//! same reason not guaranteed: light on a receiver that lies between two casters; the farther one casts on it too. What
//! is nearer to the light than every caster is lit. Borders, those at a caster's foot included, are a texel wide.

use super::{
    FrameRequest, RenderError,
    bindings::{SAMPLER, STORAGE, buffer, group, layout, texture},
    forward::{Forward, ForwardOptions},
    gpu::{CONSTANT_VISIBILITY, PROJECTIVE_TEXTURE},
    light_map::LightMap,
    light_view::views,
    silhouette::{Silhouette, SilhouetteTarget, begin},
    stage::{Begin, Part, Stage, Targets},
    technique::{Cost, Technique},
    view_matrices::per_instance,
};
use glam::Mat4;

/// One byte.
const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::R8Unorm;
/// The bilinear filter reaches this far, texels: views leave that much open around the casters.
const REACH_TEXELS: f32 = 1.0;

/// A texture of silhouettes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ProjectiveTextureOptions {
    /// Width and height of the texture (of each face of a point light's cube), 2 to the adapter's limit. Error falls and
    /// cost grows with it.
    pub size_texels: u32,
}

/// Draws the model and its shadow on the ground.
#[derive(Debug)]
pub struct ProjectiveTexture {
    options: ProjectiveTextureOptions,
    silhouette: Silhouette,
    matrices: wgpu::Buffer,
    layout: wgpu::BindGroupLayout,
    sampler: wgpu::Sampler,
    casters: Forward,
    ground: Forward,
    map: Option<(LightMap, wgpu::BindGroup)>,
}

impl ProjectiveTexture {
    /// For frames of `stage`.
    ///
    /// # Errors
    /// A size beyond the adapter's limits.
    pub fn new(stage: &Stage, options: ProjectiveTextureOptions) -> Result<Self, RenderError> {
        let gpu = &stage.gpu;
        LightMap::check_side(gpu, options.size_texels)?;
        let fragment = wgpu::ShaderStages::FRAGMENT;
        let array = texture(wgpu::TextureViewDimension::D2Array);
        let layout = layout(gpu, "projective texture", &[(fragment, STORAGE), (fragment, array), (fragment, SAMPLER)]);
        let sampler = gpu.device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("silhouettes"),
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            ..Default::default()
        });
        let lit = ForwardOptions { constants: vec![("VISIBILITY", 1.0)], ..Default::default() };
        let casters = Forward::new(stage, &CONSTANT_VISIBILITY, None, lit);
        let ground = Forward::new(stage, &PROJECTIVE_TEXTURE, Some(&layout), ForwardOptions::default());
        let count = 6 * stage.placements().len();
        let matrices = buffer::<Mat4>(gpu, "light matrices", count, wgpu::BufferUsages::STORAGE);
        let silhouette = Silhouette::new(stage, 6, &SilhouetteTarget { format: FORMAT, blend: None, depth: None });
        gpu.check()?;
        Ok(Self { options, silhouette, matrices, layout, sampler, casters, ground, map: None })
    }

    fn make_map(&self, stage: &Stage, count: u32) -> (LightMap, wgpu::BindGroup) {
        let map = LightMap::new(&stage.gpu, FORMAT, (self.options.size_texels, count));
        let resources = [
            self.matrices.as_entire_binding(),
            wgpu::BindingResource::TextureView(&map.all),
            wgpu::BindingResource::Sampler(&self.sampler),
        ];
        let group = group(&stage.gpu, &self.layout, &resources);
        (map, group)
    }
}

impl Technique for ProjectiveTexture {
    fn name(&self) -> String {
        format!("projective texture {}", self.options.size_texels)
    }

    fn update(
        &mut self,
        stage: &Stage,
        request: &FrameRequest,
        encoder: &mut wgpu::CommandEncoder,
    ) -> Result<(), RenderError> {
        let views = views(stage, &request.light, (self.options.size_texels, REACH_TEXELS));
        let map = match self.map.take() {
            Some(map) if map.0.faces.len() == views.len() => map,
            _ => self.make_map(stage, views.len() as u32),
        };
        for (number, (&view, face)) in views.iter().zip(&map.0.faces).enumerate() {
            let mut pass = begin(encoder, face, 0.0, None);
            self.silhouette.draw(stage, (number, view), &mut pass);
        }
        self.map = Some(map);
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
        self.casters.draw(stage, request, targets, (&mut pass, Part::Casters));
        pass.set_bind_group(2, self.map.as_ref().map(|(_, group)| group), &[]);
        self.ground.draw(stage, request, targets, (&mut pass, Part::Ground));
        Ok(())
    }

    fn cost(&self, stage: &Stage) -> Cost {
        let faces = self.map.as_ref().map_or(1, |(map, _)| map.faces.len());
        Cost {
            passes: 1,
            draw_calls: stage.calls_per_pass(),
            update_passes: faces,
            update_draw_calls: faces * stage.calls_of(Part::Casters),
            texture_bytes: faces * (self.options.size_texels as usize).pow(2),
            buffer_bytes: self.matrices.size() as usize + self.silhouette.buffer_bytes(),
            on_light_change: "the silhouette of all casters drawn again; no self-shadow".to_string(),
        }
    }
}
