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
    bindings::{SAMPLER, texture},
    forward::{Forward, ForwardOptions},
    gpu::{CONSTANT_VISIBILITY, PROJECTIVE_TEXTURE},
    light_map::{LightMaps, MOST_VIEWS},
    light_view::views,
    silhouette::{Silhouette, SilhouetteTarget, begin},
    stage::{Begin, Part, Stage, Targets},
    technique::{Cost, Technique},
};
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
    maps: LightMaps,
    casters: Forward,
    ground: Forward,
}

impl ProjectiveTexture {
    /// For frames of `stage`.
    ///
    /// # Errors
    /// A size beyond the adapter's limits.
    pub fn new(stage: &Stage, options: ProjectiveTextureOptions) -> Result<Self, RenderError> {
        let gpu = &stage.gpu;
        let sampler = gpu.device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("silhouettes"),
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            ..Default::default()
        });
        let map = (FORMAT, texture(wgpu::TextureViewDimension::D2Array));
        let maps = LightMaps::new(stage, options.size_texels, &[map], Some((sampler, SAMPLER)))?;
        let lit = ForwardOptions { constants: vec![("VISIBILITY", 1.0)], ..Default::default() };
        let casters = Forward::new(stage, &CONSTANT_VISIBILITY, None, lit);
        let ground = Forward::new(stage, &PROJECTIVE_TEXTURE, Some(&maps.layout), ForwardOptions::default());
        let silhouette =
            Silhouette::new(stage, MOST_VIEWS, &SilhouetteTarget { format: FORMAT, blend: None, depth: None });
        gpu.check()?;
        Ok(Self { options, silhouette, maps, casters, ground })
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
        let faces = self.maps.of_views(stage, &views).iter().flat_map(|map| &map.faces);
        for (number, (&view, face)) in views.iter().zip(faces).enumerate() {
            let mut pass = begin(encoder, face, 0.0, None);
            self.silhouette.draw(stage, (number, view), &mut pass);
        }
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
        pass.set_bind_group(2, self.maps.group(), &[]);
        self.ground.draw(stage, request, targets, (&mut pass, Part::Ground));
        Ok(())
    }

    fn cost(&self, stage: &Stage) -> Cost {
        let faces = self.maps.views();
        Cost {
            passes: 1,
            draw_calls: stage.calls_per_pass(),
            update_passes: faces,
            update_draw_calls: faces * stage.calls_of(Part::Casters),
            texture_bytes: self.maps.texels(),
            buffer_bytes: self.maps.buffer_bytes() + self.silhouette.buffer_bytes(),
            on_light_change: "the silhouette of all casters drawn again; no self-shadow".to_string(),
        }
    }
}
