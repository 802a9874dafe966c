//! Technique: planar projected shadows (J. Foley, A. van Dam, S. Feiner, J. Hughes, "Computer Graphics: Principles and
//! Practice", 1990; J. Blinn, "Me and My (Fake) Shadow", 1988): the casters, flattened onto a plane.
//!
//! One pass. The stage is drawn lit; the stencil says where the ground is what the camera sees. The casters follow through
//! the matrix that flattens them, without colour: they mark the ground there, once ([`Receiver`] has the matrix). The
//! ground is drawn again in the ambient light where it is marked, so no overlap darkens twice and nothing falls off it.
//! Anti-shadows do not occur: clipping takes what lies beyond the light (its w is negative), a discard what lies below
//! the plane.
//!
//! Not drawn: shadow on anything but the plane, so no self-shadow at all.

use super::{
    FrameRequest, RenderError,
    bindings::{STORAGE, UNIFORM, buffer, group, layout},
    forward::{Forward, ForwardOptions},
    gpu::{CONSTANT_VISIBILITY, PLANAR},
    receiver::Receiver,
    stage::{Begin, Part, Stage, Targets},
    technique::{Cost, Technique},
    view_matrices::per_instance,
};
use glam::{Mat4, Vec4};

/// Stencil of all that is not ground.
const OTHER: u32 = 0;
/// Stencil of the ground.
const GROUND: u32 = 1;
/// Stencil of the ground in shadow, one above.
const SHADOWED: u32 = 2;

/// Where shadow falls.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanarOptions {
    /// Shadow falls on its plane, as far as the ground of the instances reaches, which lies in it.
    pub receiver: Receiver,
}

/// Draws the model and its shadow on a plane.
#[derive(Debug)]
pub struct Planar {
    options: PlanarOptions,
    lit: Forward,
    flattened: Forward,
    ambient: Forward,
    matrices: wgpu::Buffer,
    plane: wgpu::Buffer,
    group: wgpu::BindGroup,
    /// Does the present light lie off the plane?
    casts: bool,
}

impl Planar {
    /// For frames of `stage`.
    #[must_use]
    pub fn new(stage: &Stage, options: PlanarOptions) -> Self {
        let gpu = &stage.gpu;
        let vertex = wgpu::ShaderStages::VERTEX;
        let layout = layout(gpu, "planar shadows", &[(vertex, STORAGE), (vertex, UNIFORM)]);
        let matrices = buffer::<Mat4>(gpu, "flattened", stage.placements().len(), wgpu::BufferUsages::STORAGE);
        let plane = buffer::<Vec4>(gpu, "receiver", 1, wgpu::BufferUsages::UNIFORM);
        let group = group(gpu, &layout, &[matrices.as_entire_binding(), plane.as_entire_binding()]);
        let seen = |visibility: f64| vec![("VISIBILITY", visibility)];
        let lit = ForwardOptions {
            constants: seen(1.0),
            stencil: stencil(wgpu::CompareFunction::Always, wgpu::StencilOperation::Replace),
            ..Default::default()
        };
        let flattened = ForwardOptions {
            entry_points: ["vs_flattened", "fs_flattened", "fs_flattened"],
            depth_compare: wgpu::CompareFunction::Always,
            depth_write: false,
            stencil: stencil(wgpu::CompareFunction::Equal, wgpu::StencilOperation::IncrementClamp),
            write_mask: wgpu::ColorWrites::empty(),
            cull_mode: None,
            ..Default::default()
        };
        let ambient = ForwardOptions {
            constants: seen(0.0),
            depth_compare: wgpu::CompareFunction::Equal,
            depth_write: false,
            stencil: stencil(wgpu::CompareFunction::Equal, wgpu::StencilOperation::Keep),
            ..Default::default()
        };
        Self {
            options,
            lit: Forward::new(stage, &CONSTANT_VISIBILITY, None, lit),
            flattened: Forward::new(stage, &PLANAR, Some(&layout), flattened),
            ambient: Forward::new(stage, &CONSTANT_VISIBILITY, None, ambient),
            matrices,
            plane,
            group,
            casts: false,
        }
    }
}

/// A test against the reference, and what becomes of the stencil where stencil and depth pass.
fn stencil(compare: wgpu::CompareFunction, pass_op: wgpu::StencilOperation) -> wgpu::StencilState {
    let keep = wgpu::StencilOperation::Keep;
    let face = wgpu::StencilFaceState { compare, fail_op: keep, depth_fail_op: keep, pass_op };
    wgpu::StencilState { front: face, back: face, read_mask: 0xff, write_mask: 0xff }
}

impl Technique for Planar {
    fn name(&self) -> String {
        "planar shadows".to_string()
    }

    fn needs_stencil(&self) -> bool {
        true
    }

    fn update(
        &mut self,
        stage: &Stage,
        request: &FrameRequest,
        _: &mut wgpu::CommandEncoder,
    ) -> Result<(), RenderError> {
        let light = request.light.homogeneous();
        let plane = self.options.receiver.facing(light);
        self.casts = plane.is_some();
        if let Some(plane) = plane {
            let matrices = per_instance(stage, &[Receiver::flattened_from_world(plane, light)]);
            stage.gpu.queue.write_buffer(&self.matrices, 0, bytemuck::cast_slice(&matrices));
            stage.gpu.queue.write_buffer(&self.plane, 0, bytemuck::bytes_of(&plane));
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
        for (reference, part) in [(OTHER, Part::Casters), (GROUND, Part::Ground)] {
            pass.set_stencil_reference(reference);
            self.lit.draw(stage, request, targets, (&mut pass, part));
        }
        if self.casts {
            pass.set_bind_group(2, &self.group, &[]);
            self.flattened.draw(stage, request, targets, (&mut pass, Part::Casters));
            pass.set_stencil_reference(SHADOWED);
            self.ambient.draw(stage, request, targets, (&mut pass, Part::Ground));
        }
        Ok(())
    }

    fn cost(&self, stage: &Stage) -> Cost {
        Cost {
            passes: 1,
            draw_calls: if self.casts { 2 } else { 1 } * stage.calls_of(Part::All),
            update_passes: 0,
            update_draw_calls: 0,
            texture_bytes: 0,
            buffer_bytes: (self.matrices.size() + self.plane.size()) as usize,
            on_light_change: "a matrix an instance; all casters are drawn twice in every frame".to_string(),
        }
    }
}
