//! Technique: a shadow map (L. Williams, "Casting Curved Shadows on Curved Surfaces", 1978; C. Everitt, A. Rege, C.
//! Cebenoyan, "Hardware Shadow Mapping", 2001), with percentage-closer filtering (W. Reeves, D. Salesin, R. Cook,
//! "Rendering Antialiased Shadows with Depth Maps", 1987), whose kernel is also the technique's soft edge.
//!
//! A pass draws the casters' depth from the light, a second one the model. One rule for the bias, whatever the size and
//! the kernel, each half for what one side of the comparison may be off:
//! * casters: the rasteriser adds `kernel` times the triangle's depth slope per texel. A filter of n texels reaches n/2
//!   texels to each side, along both axes: a plane's depth changes by at most n times its slope on the way.
//! * receivers: what is compared with a texel is the depth of the fragment's plane there, where that is nearer to the
//!   light than the fragment; of the four texels of a bilinear tap, the nearest.
//!
//! Each half alone leaves false shadow. Wrong share of the covered pixels at 512 texels, kernel 1: casters' half alone
//! 2.8 % in a field of 200 bodies under light from above (a steep plane is compared with its gentle neighbour's depth) and
//! 0.38 % on the teapot; receivers' half alone 0.53 % and 0.54 % (a facet with a gentler one); both 0.18 % and 0.09 %.
//!
//! Not guaranteed: shadows of casters nearer to a receiver than that bias.

use super::{
    FrameRequest, RenderError,
    bindings::{COMPARISON, depth_texture},
    depth_pass::{DepthPass, MAP_FORMAT},
    forward::{Forward, ForwardOptions},
    gpu::SHADOW_MAP,
    light_map::{LightMaps, MOST_VIEWS},
    light_view::views,
    stage::{Begin, Part, Stage, Targets},
    technique::{Cost, Technique},
};
use glam::Mat4;

/// Rounding of a depth and of its interpolation, in units of its last place.
const BIAS_ULPS: i32 = 4;

/// A map and its filter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ShadowMapOptions {
    /// Width and height of the map (of each face of a point light's cube), 2 to the adapter's limit. Error falls and
    /// cost grows with it.
    pub size_texels: u32,
    /// Texels along a side of the filter, 1 (hard) and up: borders get softer and cost grows with its square.
    pub kernel_texels: u32,
}

/// Draws the model with a shadow map.
#[derive(Debug)]
pub struct ShadowMap {
    options: ShadowMapOptions,
    depth_pass: DepthPass,
    maps: LightMaps,
    forward: Forward,
}

impl ShadowMap {
    /// For frames of `stage`.
    ///
    /// # Errors
    /// A size beyond the adapter's limits.
    pub fn new(stage: &Stage, options: ShadowMapOptions) -> Result<Self, RenderError> {
        let (gpu, kernel) = (&stage.gpu, options.kernel_texels);
        let filter = if kernel == 1 { wgpu::FilterMode::Nearest } else { wgpu::FilterMode::Linear };
        let sampler = gpu.device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("shadow map"),
            mag_filter: filter,
            min_filter: filter,
            compare: Some(wgpu::CompareFunction::LessEqual),
            ..Default::default()
        });
        let map = (MAP_FORMAT, depth_texture(wgpu::TextureViewDimension::D2Array));
        let maps = LightMaps::new(stage, options.size_texels, &[map], Some((sampler, COMPARISON)))?;
        let constants = vec![("KERNEL", f64::from(kernel))];
        let forward =
            Forward::new(stage, &SHADOW_MAP, Some(&maps.layout), ForwardOptions { constants, ..Default::default() });
        let depth_pass = DepthPass::new(stage, MOST_VIEWS, depth_bias(kernel));
        gpu.check()?;
        Ok(Self { options, depth_pass, maps, forward })
    }

    /// Texels along a side, and how many the filter reaches beyond a lookup.
    pub(super) fn extent_texels(&self) -> (u32, f32) {
        (self.options.size_texels, 0.5 * self.options.kernel_texels as f32)
    }

    /// Draws the casters from these views: 1, or 6 of a point light.
    pub(super) fn redraw(&mut self, stage: &Stage, views: &[Mat4], encoder: &mut wgpu::CommandEncoder) {
        let faces = self.maps.of_views(stage, views).iter().flat_map(|map| &map.faces);
        for (number, (&view, face)) in views.iter().zip(faces).enumerate() {
            self.depth_pass.record(stage, (number, view), face, encoder);
        }
    }
}

/// The casters' half of the module's rule, for lookups in `kernel_texels` texels a side.
pub(super) fn depth_bias(kernel_texels: u32) -> wgpu::DepthBiasState {
    wgpu::DepthBiasState { constant: BIAS_ULPS, slope_scale: kernel_texels as f32, clamp: 0.0 }
}

impl Technique for ShadowMap {
    fn name(&self) -> String {
        let ShadowMapOptions { size_texels, kernel_texels } = self.options;
        match kernel_texels {
            1 => format!("shadow map {size_texels}"),
            n => format!("shadow map {size_texels}, PCF {n}x{n}"),
        }
    }

    fn update(
        &mut self,
        stage: &Stage,
        request: &FrameRequest,
        encoder: &mut wgpu::CommandEncoder,
    ) -> Result<(), RenderError> {
        let views = views(stage, &request.light, self.extent_texels());
        self.redraw(stage, &views, encoder);
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
        let faces = self.maps.views();
        Cost {
            passes: 1,
            draw_calls: stage.calls_per_pass(),
            update_passes: faces,
            update_draw_calls: faces * stage.calls_per_pass(),
            texture_bytes: 4 * self.maps.texels(),
            buffer_bytes: self.maps.buffer_bytes() + self.depth_pass.buffer_bytes(),
            on_light_change: "all casters drawn into the map again".to_string(),
        }
    }
}
