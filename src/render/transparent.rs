//! Technique: shadow volumes of transparent casters (B. Kim, K. Kim, G. Turk, "A Shadow-Volume Algorithm for Opaque and
//! Transparent Nonmanifold Casters", 2008). Coloured shadows of any number of overlapping surfaces, in any order.
//!
//! A stencil counts surfaces; here a float target adds up, per colour, the logarithm of what each lets pass
//! ([`Material::transmittance`](crate::scene::Material)), and counts opaque ones in its fourth channel. Sides carry the
//! sum over the triangles at an edge, light and dark caps that of one triangle; faces behind a surface count, as in z-fail.
//! The exponential of the sum is the light that arrives. Passes of a frame:
//!
//! 1. opaque surfaces in the ambient light, which leaves their depth; 2. volumes; 3. opaque surfaces again, in the light
//!    that arrives, and the depth of the nearest transparent ones; 4. volumes once more, on these; 5. the nearest
//!    transparent surfaces, in the light that arrives there, blended over the opaque ones. 3 is the last where nothing is
//!    transparent.
//!
//! [`Accumulation::Products`] multiplies what passes in a 16-bit float target instead: each face divides or multiplies, and
//! each rounds to 11 bits; where many dark layers overlap the product leaves the format's range and comes back as 0.
//!
//! Not guaranteed: transparent surfaces behind the nearest one, which cast and are not seen; shading by a texture's texels
//! in shadows, where a material counts by its mean; cut-outs, which cast as if whole; antialiasing (wgpu promises no
//! multisampled float targets to add in).

use super::{
    Antialias, FrameOptions, FrameRequest, RenderError,
    bindings::{STORAGE, buffer, group, layout},
    forward::{Forward, ForwardOptions},
    gpu::{CONSTANT_VISIBILITY, TRANSPARENT, TRANSPARENT_VOLUMES},
    stage::{Begin, Part, Stage, Targets},
    technique::{Cost, Technique},
    volume::Casters,
    volume_pass::{Counted, FaceState, Multiples, VolumeOptions, VolumePass},
};
use crate::scene::Scene;
use glam::{Vec3, Vec4};
use shadowfit_solver::mesh::Frame;
use wgpu::{BlendComponent, BlendFactor, BlendOperation, BlendState};

/// The least that counts as passing, a sixteenth of what a byte can show: 0 has no logarithm, and the smaller the share,
/// the coarser the sums that its logarithm is added to and taken from.
const LEAST_TRANSMITTANCE: f32 = 1.0 / 4096.0;

const NAME: &str = "transparent volumes";

/// How the layers over a point are put together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Accumulation {
    /// Logarithms are added in 32 bits.
    Logarithms,
    /// Shares are multiplied in 16 bits: to show what is lost.
    Products,
}

/// Draws the model with shadows of opaque and transparent casters.
#[derive(Debug)]
pub struct TransparentVolumes {
    accumulation: Accumulation,
    volumes: VolumePass,
    weights: wgpu::Buffer,
    weights_group: wgpu::BindGroup,
    map_layout: wgpu::BindGroupLayout,
    map: Option<Map>,
    ambient: Forward,
    opaque: Forward,
    depth: Forward,
    blended: Forward,
}

/// What arrives at each pixel.
#[derive(Debug)]
struct Map {
    size_px: [u32; 2],
    view: wgpu::TextureView,
    group: wgpu::BindGroup,
}

impl TransparentVolumes {
    /// For frames of `stage`, which was made of `scene` and `frame`.
    ///
    /// # Errors
    /// The adapter cannot clamp depth, or add in 32-bit float targets; or the casters exceed its limits.
    pub fn new(stage: &Stage, scene: &Scene, frame: &Frame, accumulation: Accumulation) -> Result<Self, RenderError> {
        let gpu = &stage.gpu;
        let adds = accumulation == Accumulation::Logarithms;
        let needs = [
            (true, wgpu::Features::DEPTH_CLIP_CONTROL, "depth clamping"),
            (adds, wgpu::Features::FLOAT32_BLENDABLE, "blending of 32-bit floats"),
        ];
        if let Some((.., feature)) = needs.into_iter().find(|(needed, wanted, _)| *needed && !gpu.has(*wanted)) {
            return Err(RenderError::Unsupported { technique: NAME, feature });
        }
        // Opaque materials are one class, so that sides between two of them cancel.
        let class_of = |material: usize| scene.materials[material].transmittance.map_or(0, |_| material as u32 + 1);
        let (casters, source) = Casters::of_scene(scene, frame, class_of);
        let weights_layout = layout(gpu, "weights", &[(wgpu::ShaderStages::FRAGMENT, STORAGE)]);
        let weights: Vec<Vec4> = source.iter().map(|&triangle| weight(scene, triangle as usize)).collect();
        let weights_buffer = buffer::<Vec4>(gpu, "weights", weights.len(), wgpu::BufferUsages::STORAGE);
        gpu.queue.write_buffer(&weights_buffer, 0, bytemuck::cast_slice(&weights));
        let weights_group = group(gpu, &weights_layout, &[weights_buffer.as_entire_binding()]);
        let options = VolumeOptions {
            casters,
            has_light_cap: vec![true; source.len()],
            counted: Counted::Behind,
            multiples: Multiples::Weighted,
        };
        let volumes = VolumePass::new(stage, &TRANSPARENT_VOLUMES, Some(&weights_layout), options)?;
        let map_layout = layout(gpu, "arriving light", &[(wgpu::ShaderStages::FRAGMENT, MAP)]);
        let ambient = |blend| {
            let constants = vec![("VISIBILITY", 0.0)];
            Forward::new(stage, &CONSTANT_VISIBILITY, None, ForwardOptions { constants, blend, ..Default::default() })
        };
        let shadowed = |entry_points, blend| {
            let constants = vec![("HAS_LOGARITHMS", f64::from(u8::from(adds)))];
            let depth_compare = wgpu::CompareFunction::Equal;
            let options = ForwardOptions {
                entry_points,
                constants,
                depth_compare,
                depth_write: false,
                blend,
                ..Default::default()
            };
            Forward::new(stage, &TRANSPARENT, Some(&map_layout), options)
        };
        Ok(Self {
            accumulation,
            volumes,
            weights: weights_buffer,
            weights_group,
            map: None,
            ambient: ambient(None),
            opaque: shadowed(["vs_surface", "fs_shaded", "fs_mask"], None),
            depth: ambient(Some(blend(BlendFactor::Zero, BlendFactor::One))),
            blended: shadowed(["vs_surface", "fs_blended", "fs_mask"], Some(BlendState::ALPHA_BLENDING)),
            map_layout,
        })
    }

    fn format(&self) -> wgpu::TextureFormat {
        match self.accumulation {
            Accumulation::Logarithms => wgpu::TextureFormat::Rgba32Float,
            Accumulation::Products => wgpu::TextureFormat::Rgba16Float,
        }
    }

    fn make_map(&self, stage: &Stage, size_px: [u32; 2]) -> Map {
        let [width, height] = size_px;
        let texture = stage.gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("arriving light"),
            size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: self.format(),
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        });
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        let group = group(&stage.gpu, &self.map_layout, &[wgpu::BindingResource::TextureView(&view)]);
        Map { size_px, view, group }
    }

    /// What a face does to the map.
    fn face_state(&self, depth_format: wgpu::TextureFormat) -> FaceState {
        let sum = blend(BlendFactor::One, BlendFactor::One);
        let (fragment, blend) = match self.accumulation {
            Accumulation::Logarithms => ("fs_sum", sum),
            Accumulation::Products => {
                ("fs_product", BlendState { alpha: sum.alpha, ..blend(BlendFactor::Dst, BlendFactor::Zero) })
            }
        };
        FaceState {
            fragment,
            depth_stencil: wgpu::DepthStencilState {
                format: depth_format,
                depth_write_enabled: Some(false),
                depth_compare: Some(wgpu::CompareFunction::GreaterEqual),
                stencil: wgpu::StencilState::default(),
                bias: wgpu::DepthBiasState::default(),
            },
            color: wgpu::ColorTargetState { blend: Some(blend), ..self.format().into() },
            samples: 1,
            unclipped_depth: true,
        }
    }

    /// Fills the map for the surfaces whose depths the targets hold.
    fn count(&mut self, stage: &Stage, map: &Map, targets: &Targets, encoder: &mut wgpu::CommandEncoder) {
        let all_passes = match self.accumulation {
            Accumulation::Logarithms => wgpu::Color::TRANSPARENT,
            Accumulation::Products => wgpu::Color { r: 1.0, g: 1.0, b: 1.0, a: 0.0 },
        };
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("volumes"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &map.view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations { load: wgpu::LoadOp::Clear(all_passes), store: wgpu::StoreOp::Store },
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &targets.depth,
                depth_ops: None,
                stencil_ops: None,
            }),
            ..Default::default()
        });
        pass.set_bind_group(2, &self.weights_group, &[]);
        let state = self.face_state(targets.depth_format);
        self.volumes.draw(stage, (0, || state), &mut pass);
    }
}

impl Technique for TransparentVolumes {
    fn name(&self) -> String {
        match self.accumulation {
            Accumulation::Logarithms => NAME.to_string(),
            Accumulation::Products => format!("{NAME}, 16-bit products"),
        }
    }

    fn update(
        &mut self,
        stage: &Stage,
        request: &FrameRequest,
        _: &mut wgpu::CommandEncoder,
    ) -> Result<(), RenderError> {
        self.volumes.update(stage, &request.light)
    }

    fn draw(
        &mut self,
        stage: &Stage,
        request: &FrameRequest,
        targets: &Targets,
        encoder: &mut wgpu::CommandEncoder,
    ) -> Result<(), RenderError> {
        let FrameOptions { size_px, mode, antialias } = request.options;
        if antialias != Antialias::Off {
            return Err(RenderError::Unsupported { technique: NAME, feature: "multisampled float targets" });
        }
        let map = match self.map.take() {
            Some(map) if map.size_px == size_px => map,
            _ => self.make_map(stage, size_px),
        };
        {
            let mut pass = targets.begin(encoder, (mode, Begin::Clear));
            self.ambient.draw(stage, request, targets, (&mut pass, Part::Opaque));
        }
        self.count(stage, &map, targets, encoder);
        {
            let mut pass = targets.begin(encoder, (mode, Begin::Load));
            pass.set_bind_group(2, &map.group, &[]);
            self.opaque.draw(stage, request, targets, (&mut pass, Part::Opaque));
            self.depth.draw(stage, request, targets, (&mut pass, Part::Transparent));
        }
        if stage.has_transparent() {
            self.count(stage, &map, targets, encoder);
            let mut pass = targets.begin(encoder, (mode, Begin::Load));
            pass.set_bind_group(2, &map.group, &[]);
            self.blended.draw(stage, request, targets, (&mut pass, Part::Transparent));
        }
        self.map = Some(map);
        Ok(())
    }

    fn cost(&self, stage: &Stage) -> Cost {
        let (passes, counts) = if stage.has_transparent() { (5, 2) } else { (3, 1) };
        let pixels = self.map.as_ref().map_or(0, |map| map.size_px[0] as usize * map.size_px[1] as usize);
        let pixel_bytes = if self.accumulation == Accumulation::Logarithms { 16 } else { 8 };
        Cost {
            passes,
            draw_calls: 2 * stage.calls_per_pass() + counts * self.volumes.draw_calls(),
            update_passes: 0,
            update_draw_calls: 0,
            texture_bytes: pixel_bytes * pixels,
            buffer_bytes: self.volumes.buffer_bytes() + self.weights.size() as usize,
            on_light_change: "outlines of all instances found on the CPU and sent".to_string(),
        }
    }
}

/// A map's texels are loaded, never filtered.
const MAP: wgpu::BindingType = wgpu::BindingType::Texture {
    sample_type: wgpu::TextureSampleType::Float { filterable: false },
    view_dimension: wgpu::TextureViewDimension::D2,
    multisampled: false,
};

fn blend(src_factor: BlendFactor, dst_factor: BlendFactor) -> BlendState {
    let component = BlendComponent { src_factor, dst_factor, operation: BlendOperation::Add };
    BlendState { color: component, alpha: component }
}

/// What a triangle does to the light: `weights` of transparent_volumes.wgsl.
fn weight(scene: &Scene, triangle: usize) -> Vec4 {
    match scene.materials[scene.material_of[triangle] as usize].transmittance {
        None => Vec4::W,
        Some(share) => Vec3::from_array(share.map(|share| share.max(LEAST_TRANSMITTANCE).ln())).extend(0.0),
    }
}
