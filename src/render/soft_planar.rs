//! Technique: soft shadows on a flat receiver by samples of the light (M. Herf, P. Heckbert, "Fast Soft Shadows", 1996;
//! P. Heckbert, M. Herf, "Simulating Soft Shadows with Graphics Hardware", 1997).
//!
//! For each sample the pyramid between it and the receiver's parallelogram is taken to clip space, where the
//! parallelogram fills the texture ([`Receiver`]). The casters drawn there are that sample's hard shadow, and one
//! pass adds all: a sample has a depth of its own, before those of the samples drawn until then, so that casters behind
//! one another count once. Half floats count exactly to 2048. The ground reads the mean.
//!
//! The authors average pictures of the lit receiver, Lambert's cosine of each sample included; here the texture
//! holds visibility alone, as the traced reference under an area light does, so that it needs no colours.
//!
//! Not drawn: shadow on anything but the receiver. Not guaranteed: smooth penumbrae (of n samples a side, n + 1 steps
//! show across an edge that is parallel to a side of the light), and light at the foot of a caster that stands on
//! the receiver: what is under it is blocked, and the filter spreads that by half a texel.

use super::{
    FrameRequest, Light, RenderError,
    bindings::{SAMPLER, UNIFORM, buffer, group, layout, texture},
    depth_pass::MAP_FORMAT,
    forward::{Forward, ForwardOptions},
    gpu::{CONSTANT_VISIBILITY, SOFT_PLANAR},
    light_map::LightMap,
    ray_traced::AreaLight,
    receiver::Receiver,
    silhouette::{Silhouette, SilhouetteTarget, begin},
    stage::{Begin, Part, Stage, Targets},
    technique::{Cost, Technique},
};
use glam::{Mat4, Vec3};

/// Half floats: blended and filtered everywhere, which single floats are not.
const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::R16Float;
/// Whole numbers up to this are half floats.
const MOST_SAMPLES: u64 = 2048;

/// A receiver, a light's extent, and how finely both are sampled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SoftPlanarOptions {
    /// Where shadow falls: the ground of the instances lies in it.
    pub receiver: Receiver,
    /// Half the edges of the parallelogram that a point light stands for.
    pub half_edges: [Vec3; 2],
    /// Half the angle under which a directional light is seen ([`AreaLight::distant`]).
    pub half_angle_rad: f32,
    /// Samples along each edge of the light, 1 (hard) to 45: penumbrae get smoother, a new light's cost grows with the
    /// square.
    pub side: u32,
    /// Width and height of the receiver's texture, 1 to the adapter's limit: borders get sharper.
    pub size_texels: u32,
}

/// Draws the model and its soft shadow on a flat receiver.
#[derive(Debug)]
pub struct SoftPlanar {
    options: SoftPlanarOptions,
    silhouette: Silhouette,
    texture_from_world: wgpu::Buffer,
    casters: Forward,
    ground: Forward,
    blocked: LightMap,
    depth: LightMap,
    group: wgpu::BindGroup,
}

impl SoftPlanar {
    /// For frames of `stage`.
    ///
    /// # Errors
    /// More samples than half floats count, or a size beyond the adapter's limits.
    pub fn new(stage: &Stage, options: SoftPlanarOptions) -> Result<Self, RenderError> {
        let gpu = &stage.gpu;
        let samples = u64::from(options.side).pow(2);
        if samples > MOST_SAMPLES {
            return Err(RenderError::TooLarge { what: "a light's samples", needed: samples, limit: MOST_SAMPLES });
        }
        LightMap::check_side(gpu, options.size_texels)?;
        let fragment = wgpu::ShaderStages::FRAGMENT;
        let image = texture(wgpu::TextureViewDimension::D2);
        let layout = layout(gpu, "soft planar", &[(fragment, image), (fragment, SAMPLER), (fragment, UNIFORM)]);
        let sampler = gpu.device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("blocked"),
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            ..Default::default()
        });
        let texture_from_world = buffer::<Mat4>(gpu, "receiver", 1, wgpu::BufferUsages::UNIFORM);
        gpu.queue.write_buffer(&texture_from_world, 0, bytemuck::bytes_of(&options.receiver.texture_from_world()));
        let blocked = LightMap::new(gpu, FORMAT, (options.size_texels, 1));
        let resources = [
            wgpu::BindingResource::TextureView(&blocked.faces[0]),
            wgpu::BindingResource::Sampler(&sampler),
            texture_from_world.as_entire_binding(),
        ];
        let group = group(gpu, &layout, &resources);
        let lit = ForwardOptions { constants: vec![("VISIBILITY", 1.0)], ..Default::default() };
        let mean = ForwardOptions { constants: vec![("SAMPLES", samples as f64)], ..Default::default() };
        let technique = Self {
            options,
            silhouette: Silhouette::new(stage, samples as usize, &counted()),
            texture_from_world,
            casters: Forward::new(stage, &CONSTANT_VISIBILITY, None, lit),
            ground: Forward::new(stage, &SOFT_PLANAR, Some(&layout), mean),
            blocked,
            depth: LightMap::new(gpu, MAP_FORMAT, (options.size_texels, 1)),
            group,
        };
        gpu.check()?;
        Ok(technique)
    }

    /// The samples of a light.
    fn samples(&self, light: &Light) -> Vec<Vec3> {
        let SoftPlanarOptions { half_edges, half_angle_rad, side, .. } = self.options;
        let area = match *light {
            Light::Directional { to_light } => AreaLight::distant(to_light, half_angle_rad),
            Light::Point { position: centre } => AreaLight { centre, half_edges },
        };
        area.samples(side as usize)
    }
}

/// Adds 1 where a caster is nearer than all before.
fn counted() -> SilhouetteTarget {
    let add = wgpu::BlendComponent {
        src_factor: wgpu::BlendFactor::One,
        dst_factor: wgpu::BlendFactor::One,
        operation: wgpu::BlendOperation::Add,
    };
    SilhouetteTarget {
        format: FORMAT,
        blend: Some(wgpu::BlendState { color: add, alpha: add }),
        depth: Some(wgpu::DepthStencilState {
            format: MAP_FORMAT,
            depth_write_enabled: Some(true),
            depth_compare: Some(wgpu::CompareFunction::Less),
            stencil: wgpu::StencilState::default(),
            bias: wgpu::DepthBiasState::default(),
        }),
    }
}

impl Technique for SoftPlanar {
    fn name(&self) -> String {
        let SoftPlanarOptions { side, size_texels, .. } = self.options;
        format!("soft planar shadows {side}x{side}, {size_texels}")
    }

    fn update(
        &mut self,
        stage: &Stage,
        request: &FrameRequest,
        encoder: &mut wgpu::CommandEncoder,
    ) -> Result<(), RenderError> {
        let receiver = self.options.receiver;
        let samples = self.samples(&request.light);
        let plane = receiver.facing(request.light.homogeneous());
        // The receiver sees the samples on the side of the light's middle; the others are behind it.
        let above = |sample: &Vec3| {
            let sample = sample.extend(1.0);
            plane.filter(|plane| plane.dot(sample) > 0.0).map(|plane| receiver.clip_from_world(plane, sample))
        };
        let seen: Vec<Mat4> = samples.iter().filter_map(above).collect();
        let behind = samples.len() - seen.len();
        let side = self.options.size_texels as f32;
        let mut pass = begin(encoder, &self.blocked.faces[0], behind as f64, Some(&self.depth.faces[0]));
        for (number, &clip_from_world) in seen.iter().enumerate() {
            let depth = 1.0 - (number + 1) as f32 / (samples.len() + 1) as f32;
            pass.set_viewport(0.0, 0.0, side, side, depth, depth);
            self.silhouette.draw(stage, (number, clip_from_world), &mut pass);
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
        pass.set_bind_group(2, &self.group, &[]);
        self.ground.draw(stage, request, targets, (&mut pass, Part::Ground));
        Ok(())
    }

    fn cost(&self, stage: &Stage) -> Cost {
        let samples = (self.options.side as usize).pow(2);
        // Half floats, and the depth that they are counted with.
        let texel_bytes = 2 + 4;
        Cost {
            passes: 1,
            draw_calls: stage.calls_per_pass(),
            update_passes: 1,
            update_draw_calls: samples * stage.calls_of(Part::Casters),
            texture_bytes: texel_bytes * (self.options.size_texels as usize).pow(2),
            buffer_bytes: self.texture_from_world.size() as usize + self.silhouette.buffer_bytes(),
            on_light_change: "all casters drawn once a sample of the light; no self-shadow".to_string(),
        }
    }
}
