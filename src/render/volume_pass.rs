//! Shadow volumes on the device: lists of sides and caps of all instances, made on the CPU for each light, and the draws
//! that count their faces at the surfaces of the depth buffer.
//!
//! A point is in as many volumes as faces lie between it and a point outside all of them: in front of it, towards the eye
//! (z-pass), or behind it, to infinity (z-fail); those that face the eye count with the other sign. A light cap is drawn
//! with the vertices of the surface that it is, in their order, by the same arithmetic, so it has the same depth: it never
//! lies in front of that surface, and counts as behind it.
//!
//! One draw a kind of face holds all instances. Dark caps are needed behind surfaces alone, and under a point light alone:
//! a directional one's volumes end in one point at infinity.

use super::{
    Light, RenderError,
    bindings::{STORAGE, buffer, group, layout},
    gpu::{Gpu, Shader},
    stage::Stage,
    volume::{Casters, Side, Volume},
};
use glam::{Vec3, Vec4};
use rayon::prelude::*;
use std::{collections::BTreeMap, ops::Range};

/// Light caps are moved away from the eye by this. Where the far plane clips the surface and not its cap, the rasteriser
/// sets up different triangles, with vertices up to 1/16 pixel off (the 4 bits that Vulkan asks for) and depths rounded
/// elsewhere: without it a ground that crosses the far plane shadows itself in 11 % of a frame, in stripes. A hundred times as
/// much changes none of the errors in tests/volumes.
const CAP_BIAS: wgpu::DepthBiasState = wgpu::DepthBiasState { constant: 4, slope_scale: 0.125, clamp: 0.0 };

/// Where a face must lie to count at a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Counted {
    /// Between the eye and the surface.
    InFront,
    /// Beyond the surface.
    Behind,
}

/// How a side that stands for several is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Multiples {
    /// As many times: the stencil counts by one.
    Repeated,
    /// Once; the shader multiplies.
    Weighted,
}

/// What the volumes of a technique are made of.
#[derive(Clone, Debug)]
pub(crate) struct VolumeOptions {
    /// What casts, in the stage's unit space.
    pub casters: Casters,
    /// Which casters have a light cap.
    pub has_light_cap: Vec<bool>,
    /// Which faces count.
    pub counted: Counted,
    /// How often.
    pub multiples: Multiples,
}

/// What the faces do to the targets.
#[derive(Clone, Debug)]
pub(crate) struct FaceState {
    /// Entry point of the fragment stage.
    pub fragment: &'static str,
    /// Depth and stencil tests.
    pub depth_stencil: wgpu::DepthStencilState,
    /// Colours.
    pub color: wgpu::ColorTargetState,
    /// Samples a pixel.
    pub samples: u32,
    /// Are faces nearer or farther than the camera draws kept, at its nearest and farthest depth?
    pub unclipped_depth: bool,
}

/// The volumes of a stage's instances.
#[derive(Debug)]
pub(crate) struct VolumePass {
    options: VolumeOptions,
    module: wgpu::ShaderModule,
    pipeline_layout: wgpu::PipelineLayout,
    layout: wgpu::BindGroupLayout,
    corners: wgpu::Buffer,
    lists: Lists,
    /// By "is the light a point?" and the caller's number.
    made: BTreeMap<(bool, u32), Pipelines>,
}

/// What was made for the last light.
#[derive(Debug)]
struct Lists {
    sides: wgpu::Buffer,
    caps: wgpu::Buffer,
    group: wgpu::BindGroup,
    /// Was the light a point?
    is_point: bool,
    side_count: u32,
    /// Of the caps: those that face the light as they are wound, then the others.
    cap_ranges: [Range<u32>; 2],
}

/// One a kind of face. Caps: of casters that face the light as they are wound, and of the others, whose front is their
/// back.
#[derive(Clone, Debug)]
struct Pipelines {
    sides: wgpu::RenderPipeline,
    light_caps: [wgpu::RenderPipeline; 2],
    dark_caps: [wgpu::RenderPipeline; 2],
}

impl VolumePass {
    /// Compiles `shader`, whose group 2 has the given layout, and uploads the casters.
    ///
    /// # Errors
    /// The casters exceed the adapter's limits.
    pub fn new(
        stage: &Stage,
        shader: &Shader,
        group_2: Option<&wgpu::BindGroupLayout>,
        options: VolumeOptions,
    ) -> Result<Self, RenderError> {
        let gpu = &stage.gpu;
        let layout = layout(gpu, "volumes", &[(wgpu::ShaderStages::VERTEX, STORAGE); 3]);
        let pipeline_layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            bind_group_layouts: &[Some(&stage.layouts.frame), Some(&layout), group_2],
            ..Default::default()
        });
        let points: Vec<Vec4> = options.casters.corners().as_flattened().iter().map(|p: &Vec3| p.extend(1.0)).collect();
        let corners = storage(gpu, "corners of casters", &points)?;
        let none: [Vec4; 0] = [];
        let (sides, caps) = (storage(gpu, "sides", &none)?, storage(gpu, "caps", &none)?);
        let group = bind(gpu, &layout, [&corners, &sides, &caps]);
        let lists = Lists { sides, caps, group, is_point: false, side_count: 0, cap_ranges: [0..0, 0..0] };
        let module = gpu.module(shader);
        Ok(Self { options, module, pipeline_layout, layout, corners, lists, made: BTreeMap::new() })
    }

    /// What casts.
    pub fn casters(&self) -> &Casters {
        &self.options.casters
    }

    /// Makes the volumes of all instances under `light` and sends them.
    ///
    /// # Errors
    /// They exceed the adapter's limits.
    pub fn update(&mut self, stage: &Stage, light: &Light) -> Result<(), RenderError> {
        let volume_of = |placement: &super::stage::Placement| {
            self.options.casters.volume(placement.light_unit(light).homogeneous())
        };
        let volumes: Vec<Volume> = stage.placements().par_iter().map(volume_of).collect();
        let instances = || (0u32..).zip(&volumes);
        let of_side = |instance: u32, side: &Side| {
            let times = if self.options.multiples == Multiples::Repeated { side.count } else { 1 };
            std::iter::repeat_n([side.start, side.end, instance, side.count], times as usize)
        };
        let sides: Vec<[u32; 4]> =
            instances().flat_map(|(i, volume)| volume.sides.iter().flat_map(move |side| of_side(i, side))).collect();
        let caps_of = |pick: fn(&Volume) -> &Vec<u32>| {
            let is_drawn = |t: &&u32| self.options.has_light_cap[**t as usize];
            instances().flat_map(move |(i, volume)| pick(volume).iter().filter(is_drawn).map(move |&t| [t, i]))
        };
        let mut caps: Vec<[u32; 2]> = caps_of(|volume| &volume.towards).collect();
        let towards = caps.len() as u32;
        caps.extend(caps_of(|volume| &volume.away));
        let lists = &mut self.lists;
        lists.is_point = matches!(light, Light::Point { .. });
        (lists.side_count, lists.cap_ranges) = (sides.len() as u32, [0..towards, towards..caps.len() as u32]);
        let gpu = &stage.gpu;
        let grown = [send(gpu, &mut lists.sides, "sides", &sides)?, send(gpu, &mut lists.caps, "caps", &caps)?];
        if grown.contains(&true) {
            lists.group = bind(gpu, &self.layout, [&self.corners, &lists.sides, &lists.caps]);
        }
        Ok(())
    }

    /// Draws all faces under the light of the last update; group 2 is bound already. `number` tells states apart, which
    /// `state` makes where it is new.
    pub fn draw(
        &mut self,
        stage: &Stage,
        (number, state): (u32, impl FnOnce() -> FaceState),
        pass: &mut wgpu::RenderPass<'_>,
    ) {
        let is_point = self.lists.is_point;
        let made = self.made.get(&(is_point, number)).cloned();
        let pipelines = made.unwrap_or_else(|| {
            let pipelines = self.pipelines(&stage.gpu, is_point, &state());
            self.made.insert((is_point, number), pipelines.clone());
            pipelines
        });
        stage.bind(pass);
        pass.set_bind_group(1, &self.lists.group, &[]);
        pass.set_pipeline(&pipelines.sides);
        pass.draw(0..side_vertices(is_point) * self.lists.side_count, 0..1);
        let dark = self.has_dark_caps().then_some(&pipelines.dark_caps);
        for caps in [Some(&pipelines.light_caps), dark].into_iter().flatten() {
            for (pipeline, range) in caps.iter().zip(&self.lists.cap_ranges) {
                pass.set_pipeline(pipeline);
                pass.draw(3 * range.start..3 * range.end, 0..1);
            }
        }
    }

    /// Draw calls under the light of the last update.
    pub fn draw_calls(&self) -> usize {
        if self.has_dark_caps() { 5 } else { 3 }
    }

    fn has_dark_caps(&self) -> bool {
        self.lists.is_point && self.options.counted == Counted::Behind
    }

    /// Bytes of its buffers.
    pub fn buffer_bytes(&self) -> usize {
        [&self.corners, &self.lists.sides, &self.lists.caps].iter().map(|buffer| buffer.size() as usize).sum()
    }

    fn pipelines(&self, gpu: &Gpu, is_point: bool, state: &FaceState) -> Pipelines {
        let make = |vertex, is_dark: bool, front_face| {
            let is_light_cap = vertex == "vs_cap" && !is_dark;
            let bias = if is_light_cap { CAP_BIAS } else { wgpu::DepthBiasState::default() };
            let constants = [
                ("POINT_LIGHT", f64::from(u8::from(is_point))),
                ("SIDE_VERTICES", f64::from(side_vertices(is_point))),
                ("IS_DARK", f64::from(u8::from(is_dark))),
            ];
            let compilation_options = wgpu::PipelineCompilationOptions { constants: &constants, ..Default::default() };
            gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some(vertex),
                layout: Some(&self.pipeline_layout),
                vertex: wgpu::VertexState {
                    module: &self.module,
                    entry_point: Some(vertex),
                    compilation_options: compilation_options.clone(),
                    buffers: &[],
                },
                primitive: wgpu::PrimitiveState {
                    front_face,
                    unclipped_depth: state.unclipped_depth,
                    ..Default::default()
                },
                depth_stencil: Some(wgpu::DepthStencilState { bias, ..state.depth_stencil.clone() }),
                multisample: wgpu::MultisampleState { count: state.samples, ..Default::default() },
                fragment: Some(wgpu::FragmentState {
                    module: &self.module,
                    entry_point: Some(state.fragment),
                    compilation_options,
                    targets: &[Some(state.color.clone())],
                }),
                multiview_mask: None,
                cache: None,
            })
        };
        let (ccw, cw) = (wgpu::FrontFace::Ccw, wgpu::FrontFace::Cw);
        Pipelines {
            sides: make("vs_side", false, ccw),
            light_caps: [ccw, cw].map(|front| make("vs_cap", false, front)),
            // A dark cap looks away from the light.
            dark_caps: [cw, ccw].map(|front| make("vs_cap", true, front)),
        }
    }
}

/// The quad of a side is a triangle where all extruded corners are one point.
fn side_vertices(is_point: bool) -> u32 {
    if is_point { 6 } else { 3 }
}

fn bind(gpu: &Gpu, layout: &wgpu::BindGroupLayout, buffers: [&wgpu::Buffer; 3]) -> wgpu::BindGroup {
    group(gpu, layout, &buffers.map(wgpu::Buffer::as_entire_binding))
}

/// A new buffer of `contents`.
fn storage<T: bytemuck::Pod>(gpu: &Gpu, label: &str, contents: &[T]) -> Result<wgpu::Buffer, RenderError> {
    let needed = size_of_val(contents) as u64;
    let limit = gpu.limits().max_storage_buffer_binding_size;
    if needed > limit {
        return Err(RenderError::TooLarge { what: "the lists of shadow volumes", needed, limit });
    }
    let buffer = buffer::<T>(gpu, label, contents.len(), wgpu::BufferUsages::STORAGE);
    gpu.queue.write_buffer(&buffer, 0, bytemuck::cast_slice(contents));
    Ok(buffer)
}

/// Sends `contents` to a buffer; true where it had to be replaced by a larger one.
fn send<T: bytemuck::Pod>(
    gpu: &Gpu,
    buffer: &mut wgpu::Buffer,
    label: &str,
    contents: &[T],
) -> Result<bool, RenderError> {
    let grows = size_of_val(contents) as u64 > buffer.size();
    if grows {
        *buffer = storage(gpu, label, contents)?;
    } else {
        gpu.queue.write_buffer(buffer, 0, bytemuck::cast_slice(contents));
    }
    Ok(grows)
}
