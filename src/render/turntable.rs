//! The wgpu renderer: a scene and its planes are uploaded once, then frames are drawn.
//!
//! A frame is one forward pass. The affine rows of each plane (thesis eq. 2-8, see `solver::shade`) are computed on
//! the CPU once per light, and the lists of the sections chosen; a plane that casts nothing under that light is in
//! none of them, so it costs no fragment anything. The same request gives the same bytes on the same driver.

use super::{
    BACKGROUND_LINEAR, FrameOptions, FrameRequest, Light, Mode, RenderError,
    atlas::{Atlas, Slot},
    gpu::{Gpu, Readback},
    layout::{CastingPlane, Frame as FrameUniform, Rectangle},
    pipelines::{DEPTH_FORMAT, Layouts, Pass, PipelineKey, Pipelines, color_format},
    upload::Model,
};
use crate::scene::Scene;
use bytemuck::Zeroable;
use glam::{Vec3, Vec4};
use shadowfit_solver::{
    mesh::Frame,
    plane::{BakedPlane, BakedSet},
};
use wgpu::util::{DeviceExt, TextureDataOrder};

/// Okabe and Ito, "Color Universal Design" (2008), sRGB, without black and the yellow that vanishes on light
/// surfaces.
const PLANE_COLORS_SRGB: [[u8; 3]; 6] =
    [[213, 94, 0], [0, 114, 178], [0, 158, 115], [204, 121, 167], [230, 159, 0], [86, 180, 233]];

/// Draws one scene.
#[derive(Debug)]
pub struct Turntable {
    gpu: Gpu,
    layouts: Layouts,
    pipelines: Pipelines,
    model: Model,
    planes: Planes,
    targets: Option<Targets>,
}

impl Turntable {
    /// Uploads `scene`; `frame` is where unit space lies (`Mesh::frame`). There are no planes yet.
    ///
    /// # Errors
    /// The scene exceeds the adapter's limits, or the driver reports an error.
    pub fn new(gpu: &Gpu, scene: &Scene, frame: &Frame) -> Result<Self, RenderError> {
        let layouts = Layouts::new(gpu);
        let model = Model::upload(gpu, &layouts, scene, frame)?;
        let planes = Planes::upload(gpu, &layouts, &BakedSet::default())?;
        let pipelines = Pipelines::new(gpu);
        gpu.check()?;
        Ok(Self { gpu: gpu.clone(), layouts, pipelines, model, planes, targets: None })
    }

    /// Replaces the planes (unit space) that cast in the frames to come.
    ///
    /// # Errors
    /// Their textures exceed the adapter's limits, or the driver reports an error.
    pub fn set_planes(&mut self, set: &BakedSet) -> Result<(), RenderError> {
        self.planes = Planes::upload(&self.gpu, &self.layouts, set)?;
        self.gpu.check()
    }

    /// Draws a frame. Alpha is 255 everywhere but on the background of [`Mode::Mask`].
    ///
    /// # Errors
    /// A size beyond the adapter's limits, or the driver reports an error.
    pub fn render(&mut self, request: &FrameRequest) -> Result<image::RgbaImage, RenderError> {
        let targets = fit_targets(&mut self.targets, &self.gpu, &request.options)?;
        let rectangle_count = self.planes.write(&self.gpu, request);
        for key in keys(request) {
            self.pipelines.get(&self.gpu, &self.layouts, key);
        }
        self.gpu.check()?;
        let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = targets.begin_pass(&mut encoder, request.options.mode);
            pass.set_bind_group(0, &self.planes.bind_group, &[]);
            pass.set_vertex_buffer(0, self.model.vertices.slice(..));
            let [single, double, hidden, visible] = keys(request);
            for batch in &self.model.batches {
                let key = if batch.double_sided { double } else { single };
                pass.set_pipeline(self.pipelines.get(&self.gpu, &self.layouts, key));
                pass.set_bind_group(1, &batch.bind_group, &[]);
                pass.draw(batch.vertices.clone(), 0..1);
            }
            if request.options.mode == Mode::Planes {
                for key in [hidden, visible] {
                    pass.set_pipeline(self.pipelines.get(&self.gpu, &self.layouts, key));
                    pass.draw(0..6, 0..rectangle_count);
                }
            }
        }
        targets.readback.copy_from(&targets.resolved, &mut encoder);
        self.gpu.submit_and_read(encoder.finish(), &targets.readback)
    }
}

/// The frame's textures and readback buffer: those of the last frame, if they fit.
fn fit_targets<'a>(
    last: &'a mut Option<Targets>,
    gpu: &Gpu,
    options: &FrameOptions,
) -> Result<&'a Targets, RenderError> {
    let key = FrameOptions { mode: format_mode(options.mode), ..*options };
    let targets = match last.take() {
        Some(targets) if targets.key == key => targets,
        _ => {
            let limit = gpu.limits().max_texture_dimension_2d;
            let [width, height] = options.size_px;
            if width.min(height) == 0 || width.max(height) > limit {
                return Err(RenderError::FrameSize { width, height, limit });
            }
            Targets::new(gpu, key)
        }
    };
    Ok(last.insert(targets))
}

/// Modes of the same colour format share targets.
fn format_mode(mode: Mode) -> Mode {
    if mode == Mode::Planes { Mode::Shaded } else { mode }
}

/// The pipelines of a frame: single-sided, double-sided, hidden planes, visible planes.
fn keys(request: &FrameRequest) -> [PipelineKey; 4] {
    let FrameOptions { mode, antialias, .. } = request.options;
    let point_light = matches!(request.light, Light::Point { .. });
    [Pass::SingleSided, Pass::DoubleSided, Pass::PlanesHidden, Pass::PlanesVisible].map(|pass| PipelineKey {
        pass,
        mode,
        antialias,
        point_light,
    })
}

/// The planes on the device.
#[derive(Debug)]
struct Planes {
    set: BakedSet,
    /// One a plane.
    slots: Vec<Slot>,
    uniform: wgpu::Buffer,
    casting: wgpu::Buffer,
    lists: wgpu::Buffer,
    rectangles: wgpu::Buffer,
    bind_group: wgpu::BindGroup,
}

impl Planes {
    fn upload(gpu: &Gpu, layouts: &Layouts, set: &BakedSet) -> Result<Self, RenderError> {
        let limits = gpu.limits();
        let textures: Vec<_> = set.planes.iter().map(|baked| &baked.texture).collect();
        let atlas = Atlas::pack(&textures, limits.max_texture_dimension_2d, limits.max_texture_array_layers)?;
        let view = upload_atlas(gpu, &atlas);
        let sampler = gpu.device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("occluders"),
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            ..Default::default()
        });
        let buffer = |label, size, usage| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: size as u64,
                usage: usage | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        };
        // A binding may not be empty.
        let count = set.planes.len().max(1);
        let storage = wgpu::BufferUsages::STORAGE;
        let uniform = buffer("frame", size_of::<FrameUniform>(), wgpu::BufferUsages::UNIFORM);
        let casting = buffer("casting", count * size_of::<CastingPlane>(), storage);
        let rectangles = buffer("rectangles", count * size_of::<Rectangle>(), storage);
        let lists = buffer("lists", size_of::<u32>() * (2 * (set.sections.len() + 1) + longest(set)), storage);
        let entry = |binding, resource| wgpu::BindGroupEntry { binding, resource };
        let bind_group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("frame"),
            layout: &layouts.frame,
            entries: &[
                entry(0, uniform.as_entire_binding()),
                entry(1, casting.as_entire_binding()),
                entry(2, wgpu::BindingResource::TextureView(&view)),
                entry(3, wgpu::BindingResource::Sampler(&sampler)),
                entry(4, rectangles.as_entire_binding()),
                entry(5, lists.as_entire_binding()),
            ],
        });
        Ok(Self { set: set.clone(), slots: atlas.slots, uniform, casting, lists, rectangles, bind_group })
    }

    /// Sends what depends on the light and the camera; returns the number of rectangles to draw.
    fn write(&self, gpu: &Gpu, request: &FrameRequest) -> u32 {
        let (casting, lists) = self.casting_under(&request.light);
        let rectangles = match request.options.mode {
            Mode::Planes => self.rectangles_seen_along(request.camera.forward()),
            Mode::Shaded | Mode::Mask => Vec::new(),
        };
        let light = match request.light {
            Light::Directional { to_light } => to_light,
            Light::Point { position_unit } => position_unit,
        };
        let frame = FrameUniform {
            clip_from_unit: request.camera.clip_from_unit(request.options.size_px),
            light: light.extend(0.0),
            rectangle_count: rectangles.len() as u32,
            section_count: self.set.sections.len() as u32,
            ..FrameUniform::zeroed()
        };
        gpu.queue.write_buffer(&self.uniform, 0, bytemuck::bytes_of(&frame));
        gpu.queue.write_buffer(&self.casting, 0, bytemuck::cast_slice(&casting));
        gpu.queue.write_buffer(&self.lists, 0, bytemuck::cast_slice(&lists));
        gpu.queue.write_buffer(&self.rectangles, 0, bytemuck::cast_slice(&rectangles));
        rectangles.len() as u32
    }

    /// The planes that cast under `light` and are read by some section, and `lists` of planes.wgsl.
    fn casting_under(&self, light: &Light) -> (Vec<CastingPlane>, Vec<u32>) {
        let casting_plane = |index: usize| match (*light, &self.set.planes[index], &self.slots[index]) {
            (Light::Directional { to_light }, baked, slot) => CastingPlane::directional(baked, slot, to_light),
            (Light::Point { .. }, baked, slot) => CastingPlane::point_light(baked, slot),
        };
        let sections = self.set.lists(light.from_centre());
        let (mut casting, mut ranges, mut lists) = (Vec::new(), Vec::new(), Vec::new());
        // Several sections may read a plane: its rows are made once.
        let mut number_of: Vec<Option<Option<u32>>> = vec![None; self.set.planes.len()];
        let start = 2 * (self.set.sections.len() + 1);
        for section in 0..=self.set.sections.len() {
            ranges.push((start + lists.len()) as u32);
            for &plane in sections.get(section).map_or(&[][..], Vec::as_slice) {
                let number = number_of[plane as usize].get_or_insert_with(|| {
                    casting.push(casting_plane(plane as usize)?);
                    Some(casting.len() as u32 - 1)
                });
                lists.extend(*number);
            }
            ranges.push((start + lists.len()) as u32);
        }
        ranges.extend(lists);
        (casting, ranges)
    }

    /// All rectangles, the farthest centre first: they are blended.
    fn rectangles_seen_along(&self, forward: Vec3) -> Vec<Rectangle> {
        let planes = self.set.planes.iter().zip(&self.slots).enumerate();
        let rectangle = |(i, (baked, slot)): (usize, (&BakedPlane, &Slot))| {
            Rectangle::new(&baked.plane, slot, plane_color_linear(i))
        };
        let mut rectangles: Vec<_> = planes.map(rectangle).collect();
        rectangles.sort_by(|p, q| q.centre().dot(forward).total_cmp(&p.centre().dot(forward)));
        rectangles
    }
}

/// Indices in all lists of a set, under the light where there are most.
fn longest(set: &BakedSet) -> usize {
    let active = set.active.iter().flat_map(|active| &active.lists);
    active.chain([&set.sections]).map(|lists| lists.iter().map(Vec::len).sum()).max().unwrap_or(0)
}

/// Colour of plane `i`: the palette, darker each time it repeats.
fn plane_color_linear(i: usize) -> Vec3 {
    let color = PLANE_COLORS_SRGB[i % PLANE_COLORS_SRGB.len()];
    let round = (i / PLANE_COLORS_SRGB.len()) % 3;
    Vec3::from_array(color.map(super::linear_from_srgb)) * [1.0, 0.45, 0.2][round]
}

fn upload_atlas(gpu: &Gpu, atlas: &Atlas) -> wgpu::TextureView {
    let descriptor = wgpu::TextureDescriptor {
        label: Some("occluders"),
        size: wgpu::Extent3d { width: atlas.side, height: atlas.side, depth_or_array_layers: atlas.layers },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rgba8Unorm,
        usage: wgpu::TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    };
    let texture =
        gpu.device.create_texture_with_data(&gpu.queue, &descriptor, TextureDataOrder::LayerMajor, &atlas.rgba);
    texture.create_view(&wgpu::TextureViewDescriptor {
        dimension: Some(wgpu::TextureViewDimension::D2Array),
        ..Default::default()
    })
}

/// The textures that a frame is drawn into.
#[derive(Debug)]
struct Targets {
    key: FrameOptions,
    /// What is drawn into, where that is not `resolved` itself.
    multisampled: Option<wgpu::TextureView>,
    resolved: wgpu::Texture,
    resolved_view: wgpu::TextureView,
    depth: wgpu::TextureView,
    readback: Readback,
}

impl Targets {
    fn new(gpu: &Gpu, key: FrameOptions) -> Self {
        let [width, height] = key.size_px;
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
        let (samples, none) = (key.antialias.samples(), wgpu::TextureUsages::empty());
        let color = color_format(key.mode);
        let resolved = texture("colour", color, 1, wgpu::TextureUsages::COPY_SRC);
        Self {
            key,
            multisampled: (samples > 1).then(|| view(&texture("samples", color, samples, none))),
            resolved_view: view(&resolved),
            resolved,
            depth: view(&texture("depth", DEPTH_FORMAT, samples, none)),
            readback: Readback::new(gpu, key.size_px),
        }
    }

    fn begin_pass<'a>(&self, encoder: &'a mut wgpu::CommandEncoder, mode: Mode) -> wgpu::RenderPass<'a> {
        let background = match mode {
            Mode::Mask => Vec4::ZERO,
            Mode::Shaded | Mode::Planes => Vec3::from_array(BACKGROUND_LINEAR).extend(1.0),
        };
        let [r, g, b, a] = background.to_array().map(f64::from);
        let clear = wgpu::LoadOp::Clear(wgpu::Color { r, g, b, a });
        let (view, resolve_target, store) = match &self.multisampled {
            Some(samples) => (samples, Some(&self.resolved_view), wgpu::StoreOp::Discard),
            None => (&self.resolved_view, None, wgpu::StoreOp::Store),
        };
        encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("forward"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view,
                depth_slice: None,
                resolve_target,
                ops: wgpu::Operations { load: clear, store },
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &self.depth,
                depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(1.0), store: wgpu::StoreOp::Discard }),
                stencil_ops: None,
            }),
            ..Default::default()
        })
    }
}
