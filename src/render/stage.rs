//! What every technique draws: a model on the device, its instances, and the textures of the frame.
//!
//! In: a [`Scene`], the [`Frame`](mesh::Frame) of its mesh and where its instances stand ([`Placement`]). Vertices stay in
//! the model's unit space; each instance has its own matrix and its own light, both sent once a frame. One instance
//! with [`Placement::IDENTITY`] makes world space and unit space the same.
//!
//! Not guaranteed: equal bytes on two drivers.

use super::{
    BACKGROUND_LINEAR, FrameOptions, FrameRequest, Light, Mode, RenderError,
    bindings::{self, SAMPLER, STORAGE, UNIFORM, buffer, group, layout},
    gpu::{Gpu, Readback},
    layout::{Frame as FrameUniform, Instance},
    technique::Technique,
    upload::{Batch, Model},
};
use crate::scene::Scene;
use glam::{Mat4, Quat, Vec3, Vec4};
use shadowfit_solver::mesh;

/// Where an instance of the model stands: `p_world = translation + scale * rotation * p_unit`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Turn, a unit quaternion.
    pub rotation: Quat,
    /// Uniform scale, above 0.
    pub scale: f32,
    /// Where the model's centre lies, world space.
    pub translation: Vec3,
}

impl Placement {
    /// World space is unit space.
    pub const IDENTITY: Self = Self { rotation: Quat::IDENTITY, scale: 1.0, translation: Vec3::ZERO };

    /// The matrix.
    #[must_use]
    pub fn world_from_unit(&self) -> Mat4 {
        Mat4::from_scale_rotation_translation(Vec3::splat(self.scale), self.rotation, self.translation)
    }

    /// A light as this instance sees it, in its unit space.
    #[must_use]
    pub fn light_unit(&self, light: &Light) -> Light {
        let turned_back = self.rotation.inverse();
        match *light {
            Light::Directional { to_light } if self.rotation == Quat::IDENTITY => Light::Directional { to_light },
            Light::Directional { to_light } => Light::Directional { to_light: (turned_back * to_light).normalize() },
            Light::Point { position } => {
                Light::Point { position: turned_back * (position - self.translation) / self.scale }
            }
        }
    }
}

/// How the instances reach the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum DrawCalls {
    /// One call a batch draws all instances.
    #[default]
    Instanced,
    /// One call a batch and instance.
    OnePerInstance,
}

/// Which triangles a pass draws.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Part {
    /// All.
    All,
    /// Those that cast: all but the ground.
    Casters,
    /// Those of the ground.
    Ground,
    /// Those that no light passes.
    Opaque,
    /// Those that some light passes.
    Transparent,
}

impl Part {
    fn holds(self, batch: &Batch) -> bool {
        match self {
            Self::All => true,
            Self::Casters => !batch.ground,
            Self::Ground => batch.ground,
            Self::Opaque => !batch.transparent,
            Self::Transparent => batch.transparent,
        }
    }
}

/// The bind group layouts of all techniques: group 0 is the frame, group 1 a material; group 2 is the technique's own.
#[derive(Clone, Debug)]
pub(crate) struct Layouts {
    pub frame: wgpu::BindGroupLayout,
    pub material: wgpu::BindGroupLayout,
}

impl Layouts {
    fn new(gpu: &Gpu) -> Self {
        let (fragment, both) = (wgpu::ShaderStages::FRAGMENT, wgpu::ShaderStages::VERTEX_FRAGMENT);
        let image = bindings::texture(wgpu::TextureViewDimension::D2);
        Self {
            frame: layout(gpu, "frame", &[(both, UNIFORM), (both, STORAGE)]),
            material: layout(gpu, "material", &[(both, STORAGE), (fragment, image), (fragment, SAMPLER)]),
        }
    }
}

/// A model, its instances and a frame to draw them into.
#[derive(Debug)]
pub struct Stage {
    pub(crate) gpu: Gpu,
    pub(crate) layouts: Layouts,
    pub(crate) model: Model,
    placements: Vec<Placement>,
    /// How instances are drawn.
    pub draw_calls: DrawCalls,
    uniform: wgpu::Buffer,
    instances: wgpu::Buffer,
    frame_group: wgpu::BindGroup,
    pub(super) targets: Option<Targets>,
}

impl Stage {
    /// Uploads `scene`; `frame` is where unit space lies (`Mesh::frame`), `placements` where instances stand (1 and
    /// up).
    ///
    /// # Errors
    /// The scene exceeds the adapter's limits, or the driver reports an error.
    pub fn new(gpu: &Gpu, scene: &Scene, frame: &mesh::Frame, placements: &[Placement]) -> Result<Self, RenderError> {
        let layouts = Layouts::new(gpu);
        let model = Model::upload(gpu, &layouts.material, scene, frame)?;
        let uniform = buffer::<FrameUniform>(gpu, "frame", 1, wgpu::BufferUsages::UNIFORM);
        let instances = buffer::<Instance>(gpu, "instances", placements.len(), wgpu::BufferUsages::STORAGE);
        let frame_group = group(gpu, &layouts.frame, &[uniform.as_entire_binding(), instances.as_entire_binding()]);
        gpu.check()?;
        Ok(Self {
            gpu: gpu.clone(),
            layouts,
            model,
            placements: placements.to_vec(),
            draw_calls: DrawCalls::default(),
            uniform,
            instances,
            frame_group,
            targets: None,
        })
    }

    /// Where the instances stand.
    #[must_use]
    pub fn placements(&self) -> &[Placement] {
        &self.placements
    }

    /// Draw calls of a pass over everything.
    #[must_use]
    pub fn calls_per_pass(&self) -> usize {
        self.calls_of(Part::All)
    }

    /// Draw calls of a pass over a part.
    pub(crate) fn calls_of(&self, part: Part) -> usize {
        let calls = match self.draw_calls {
            DrawCalls::Instanced => 1,
            DrawCalls::OnePerInstance => self.placements.len(),
        };
        calls * self.model.batches.iter().filter(|batch| part.holds(batch)).count()
    }

    /// Does light pass some of the triangles?
    #[must_use]
    pub fn has_transparent(&self) -> bool {
        self.model.batches.iter().any(|batch| batch.transparent)
    }

    /// Draw calls over some sections of all parts, by their labels.
    pub(crate) fn calls_over(&self, wanted: &dyn Fn(u32) -> bool) -> usize {
        let runs: usize = self.model.batches.iter().map(|batch| batch.runs(wanted).len()).sum();
        match self.draw_calls {
            DrawCalls::Instanced => runs,
            DrawCalls::OnePerInstance => runs * self.placements.len(),
        }
    }

    /// Draws a frame with what `technique` prepares for its light. Alpha is 255 everywhere but on the background of
    /// [`Mode::Mask`].
    ///
    /// # Errors
    /// A size beyond the adapter's limits, a feature that the technique misses, or the driver reports an error.
    pub fn render(
        &mut self,
        technique: &mut dyn Technique,
        request: &FrameRequest,
    ) -> Result<image::RgbaImage, RenderError> {
        let targets = self.targets_for(technique, &request.options)?;
        let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        self.send(request);
        technique.update(self, request, &mut encoder)?;
        technique.draw(self, request, &targets, &mut encoder)?;
        targets.readback.copy_from(&targets.resolved, &mut encoder);
        let picture = self.gpu.submit_and_read(encoder.finish(), &targets.readback);
        self.targets = Some(targets);
        picture
    }

    /// The frame's textures and readback buffer: those of the last frame, if they fit. They belong into
    /// `self.targets` again afterwards.
    pub(super) fn targets_for(
        &mut self,
        technique: &dyn Technique,
        options: &FrameOptions,
    ) -> Result<Targets, RenderError> {
        let format = depth_format(&self.gpu, technique.needs_stencil());
        match self.targets.take() {
            Some(targets) if targets.fit(options, format) => Ok(targets),
            _ => {
                let limit = self.gpu.limits().max_texture_dimension_2d;
                let [width, height] = options.size_px;
                if width.min(height) == 0 || width.max(height) > limit {
                    return Err(RenderError::FrameSize { width, height, limit });
                }
                Ok(Targets::new(&self.gpu, *options, format))
            }
        }
    }

    /// Sends the frame's constants; every technique's passes read them.
    pub(super) fn send(&self, request: &FrameRequest) {
        let clip_from_world = request.camera.clip_from_world(request.options.size_px);
        let frame =
            FrameUniform { clip_from_world, light: request.light.homogeneous(), eye: request.camera.eye().extend(1.0) };
        let instance = |placement: &Placement| {
            let world_from_unit = placement.world_from_unit();
            Instance {
                clip_from_unit: clip_from_world * world_from_unit,
                world_from_unit,
                light: placement.light_unit(&request.light).homogeneous(),
            }
        };
        let instances: Vec<Instance> = self.placements.iter().map(instance).collect();
        self.gpu.queue.write_buffer(&self.uniform, 0, bytemuck::bytes_of(&frame));
        self.gpu.queue.write_buffer(&self.instances, 0, bytemuck::cast_slice(&instances));
    }

    /// Binds the frame and the model's vertices.
    pub(crate) fn bind(&self, pass: &mut wgpu::RenderPass<'_>) {
        pass.set_bind_group(0, &self.frame_group, &[]);
        pass.set_vertex_buffer(0, self.model.vertices.slice(..));
    }

    /// Draws all instances of a part of the model, each batch by its pipeline, whose group 1 is a material.
    /// [`Stage::bind`] comes first.
    pub(crate) fn draw<'p>(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        part: Part,
        pipeline: impl Fn(&Batch) -> &'p wgpu::RenderPipeline,
    ) {
        self.draw_sections(pass, (part, &|_| true), pipeline);
    }

    /// The same of the sections that are wanted, by their labels.
    pub(crate) fn draw_sections<'p>(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        (part, wanted): (Part, &dyn Fn(u32) -> bool),
        pipeline: impl Fn(&Batch) -> &'p wgpu::RenderPipeline,
    ) {
        let count = self.placements.len() as u32;
        for batch in self.model.batches.iter().filter(|batch| part.holds(batch)) {
            let runs = batch.runs(wanted);
            if runs.is_empty() {
                continue;
            }
            pass.set_pipeline(pipeline(batch));
            pass.set_bind_group(1, &batch.bind_group, &[]);
            for vertices in runs {
                match self.draw_calls {
                    DrawCalls::Instanced => pass.draw(vertices, 0..count),
                    DrawCalls::OnePerInstance => (0..count).for_each(|i| pass.draw(vertices.clone(), i..i + 1)),
                }
            }
        }
    }
}

/// How a pass starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Begin {
    /// With the background, the farthest depth and stencil 0.
    Clear,
    /// With what the last pass left.
    Load,
}

/// Format of the depth buffer, with a stencil where a technique needs one.
pub(crate) fn depth_format(gpu: &Gpu, needs_stencil: bool) -> wgpu::TextureFormat {
    match needs_stencil {
        false => wgpu::TextureFormat::Depth32Float,
        true if gpu.has(wgpu::Features::DEPTH32FLOAT_STENCIL8) => wgpu::TextureFormat::Depth32FloatStencil8,
        true => wgpu::TextureFormat::Depth24PlusStencil8,
    }
}

/// Colour format of a mode: linear bytes for the mask, sRGB for people.
pub(crate) fn color_format(mode: Mode) -> wgpu::TextureFormat {
    match mode {
        Mode::Mask => wgpu::TextureFormat::Rgba8Unorm,
        Mode::Shaded | Mode::Planes => wgpu::TextureFormat::Rgba8UnormSrgb,
    }
}

/// The textures that a frame is drawn into.
#[derive(Debug)]
pub struct Targets {
    options: FrameOptions,
    /// Of [`Targets::depth`].
    pub(crate) depth_format: wgpu::TextureFormat,
    /// What is drawn into, where that is not `resolved` itself.
    multisampled: Option<wgpu::TextureView>,
    resolved: wgpu::Texture,
    resolved_view: wgpu::TextureView,
    /// Depth, and stencil where the technique needs one.
    pub(crate) depth: wgpu::TextureView,
    readback: Readback,
}

impl Targets {
    fn new(gpu: &Gpu, options: FrameOptions, depth_format: wgpu::TextureFormat) -> Self {
        let [width, height] = options.size_px;
        let texture = |label, format, sample_count, usage| {
            gpu.device.create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: usage | wgpu::TextureUsages::RENDER_ATTACHMENT,
                view_formats: &[],
            })
        };
        let view = |texture: &wgpu::Texture| texture.create_view(&wgpu::TextureViewDescriptor::default());
        let (samples, none) = (options.antialias.samples(), wgpu::TextureUsages::empty());
        let color = color_format(options.mode);
        let resolved = texture("colour", color, 1, wgpu::TextureUsages::COPY_SRC);
        Self {
            options,
            depth_format,
            multisampled: (samples > 1).then(|| view(&texture("samples", color, samples, none))),
            resolved_view: view(&resolved),
            resolved,
            depth: view(&texture("depth", depth_format, samples, none)),
            readback: Readback::new(gpu, options.size_px),
        }
    }

    /// Are these the targets of such a frame? Modes of the same colour format share them.
    fn fit(&self, options: &FrameOptions, depth_format: wgpu::TextureFormat) -> bool {
        let FrameOptions { size_px, mode, antialias } = self.options;
        (size_px, antialias, self.depth_format) == (options.size_px, options.antialias, depth_format)
            && color_format(mode) == color_format(options.mode)
    }

    /// Starts a pass into colour, depth and stencil.
    pub(crate) fn begin<'e>(
        &self,
        encoder: &'e mut wgpu::CommandEncoder,
        (mode, begin): (Mode, Begin),
    ) -> wgpu::RenderPass<'e> {
        let background = match mode {
            Mode::Mask => Vec4::ZERO,
            Mode::Shaded | Mode::Planes => Vec3::from_array(BACKGROUND_LINEAR).extend(1.0),
        };
        let [r, g, b, a] = background.to_array().map(f64::from);
        fn load<T>(begin: Begin, value: T) -> wgpu::LoadOp<T> {
            if begin == Begin::Clear { wgpu::LoadOp::Clear(value) } else { wgpu::LoadOp::Load }
        }
        let store = wgpu::StoreOp::Store;
        let (view, resolve_target) = match &self.multisampled {
            Some(samples) => (samples, Some(&self.resolved_view)),
            None => (&self.resolved_view, None),
        };
        let has_stencil = self.depth_format.has_stencil_aspect();
        encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("frame"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view,
                depth_slice: None,
                resolve_target,
                ops: wgpu::Operations { load: load(begin, wgpu::Color { r, g, b, a }), store },
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &self.depth,
                depth_ops: Some(wgpu::Operations { load: load(begin, 1.0), store }),
                stencil_ops: has_stencil.then(|| wgpu::Operations { load: load(begin, 0), store }),
            }),
            ..Default::default()
        })
    }
}
