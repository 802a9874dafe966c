//! Technique: stencil shadow volumes. Three steps of one pass: the model in the ambient light, which leaves its depth;
//! the volumes, which count in the stencil how many of them each pixel's surface lies in; the model in full light, where
//! that is none and the depth is the same.
//!
//! * z-pass (F. Crow, "Shadow Algorithms for Computer Graphics", 1977): faces in front of the surface count. The eye's own
//!   count must be known. [`Counting::ZPassOutside`] takes it for 0 and is wrong wherever the eye, or the near plane, is in
//!   a volume; [`Counting::ZPass`] counts on the CPU the triangles between the eye and the light, and keeps the faces
//!   between the eye and the near plane by depth clamping. Without perspective the eye is a point far behind the camera:
//!   there it is wrong where a light shines along the view to within 1e-4 radians (`FAR_BEHIND`).
//! * z-fail (C. Everitt, M. Kilgard, "Practical and Robust Stenciled Shadow Volumes for Hardware-Accelerated Rendering",
//!   2002): faces behind count, with caps, to infinity; depth clamping keeps those beyond the far plane. Right with the eye
//!   anywhere. [`Counting::ZFailClipped`] leaves depth clamping out, and is wrong where the far plane cuts a volume open.
//!
//! What casts may be a soup (see [`volume`](super::volume)): every triangle counts, but closed bodies cast with one half,
//! as in the papers above ([`Casters::halved`]). z-pass draws light caps only of casters that may be there without having
//! left their depth: single-sided ones, seen from behind, and cut-outs, in their holes.
//!
//! Not guaranteed: cut-outs and blended materials, which cast as if opaque and whole; 256 volumes over one point, which
//! the stencil takes for none.

use super::{
    FrameRequest, Mode, RenderError,
    forward::{Forward, ForwardOptions},
    gpu::{CONSTANT_VISIBILITY, STENCIL_VOLUMES},
    stage::{Begin, Part, Stage, Targets, color_format},
    technique::{Cost, Technique},
    volume::Casters,
    volume_pass::{Counted, FaceState, Multiples, VolumeOptions, VolumePass},
};
use crate::scene::Scene;
use rayon::prelude::*;
use shadowfit_solver::mesh::{Frame, Sides};

/// From where the parallel rays of an orthographic camera come, world units behind it: scenes are some units large, and
/// farther away f32 would blur them by more than a thousandth.
const FAR_BEHIND: f32 = 1e4;

/// How the volumes around a surface are counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Counting {
    /// Faces in front; the eye is taken to be in no volume.
    ZPassOutside,
    /// Faces in front, and the volumes that the eye is in.
    ZPass,
    /// Faces behind, as far as the far plane.
    ZFailClipped,
    /// Faces behind, to infinity.
    ZFail,
}

impl Counting {
    fn counted(self) -> Counted {
        match self {
            Self::ZPassOutside | Self::ZPass => Counted::InFront,
            Self::ZFailClipped | Self::ZFail => Counted::Behind,
        }
    }

    fn clamps_depth(self) -> bool {
        matches!(self, Self::ZPass | Self::ZFail)
    }
}

/// Draws the model with stencil shadow volumes.
#[derive(Debug)]
pub struct StencilVolumes {
    counting: Counting,
    volumes: VolumePass,
    ambient: Forward,
    lit: Forward,
    /// Volumes that the eye is in.
    around_eye: u32,
}

impl StencilVolumes {
    /// For frames of `stage`, which was made of `scene` and `frame`.
    ///
    /// # Errors
    /// The adapter cannot clamp depth, or the casters exceed its limits.
    pub fn new(stage: &Stage, scene: &Scene, frame: &Frame, counting: Counting) -> Result<Self, RenderError> {
        if counting.clamps_depth() && !stage.gpu.has(wgpu::Features::DEPTH_CLIP_CONTROL) {
            return Err(RenderError::Unsupported { technique: "stencil shadow volumes", feature: "depth clamping" });
        }
        let (casters, source) = Casters::of_scene(scene, frame, |_| 0);
        let casters = casters.halved();
        let is_seen_whole = |&triangle: &u32| {
            let material = &scene.materials[scene.material_of[triangle as usize] as usize];
            scene.soup.sides[triangle as usize] == Sides::Both && material.alpha_cutoff.is_none()
        };
        let counted = counting.counted();
        let has_light_cap = source.iter().map(|t| counted == Counted::Behind || !is_seen_whole(t)).collect();
        let options = VolumeOptions { casters, has_light_cap, counted, multiples: Multiples::Repeated };
        let volumes = VolumePass::new(stage, &STENCIL_VOLUMES, None, options)?;
        let forward = |visibility, options| {
            let constants = vec![("VISIBILITY", visibility)];
            Forward::new(stage, &CONSTANT_VISIBILITY, None, ForwardOptions { constants, ..options })
        };
        let in_no_volume = wgpu::StencilFaceState { compare: wgpu::CompareFunction::Equal, ..Default::default() };
        let ambient = forward(0.0, ForwardOptions::default());
        let lit = forward(
            1.0,
            ForwardOptions {
                depth_compare: wgpu::CompareFunction::Equal,
                depth_write: false,
                stencil: stencil(in_no_volume, in_no_volume),
                ..Default::default()
            },
        );
        Ok(Self { counting, volumes, ambient, lit, around_eye: 0 })
    }

    /// Volumes of all instances that the eye is in.
    fn around_eye(&self, stage: &Stage, request: &FrameRequest) -> u32 {
        let camera = &request.camera;
        let behind = if camera.is_orthographic() { FAR_BEHIND } else { 0.0 };
        let eye = camera.eye() - behind * camera.forward();
        let of_instance = |placement: &super::stage::Placement| {
            let eye_unit = placement.rotation.inverse() * (eye - placement.translation) / placement.scale;
            self.volumes.casters().blockers(eye_unit, placement.light_unit(&request.light).homogeneous())
        };
        stage.placements().par_iter().map(of_instance).sum()
    }

    fn face_state(counting: Counting, request: &FrameRequest, targets: &Targets) -> FaceState {
        use wgpu::StencilOperation::{DecrementWrap, IncrementWrap};
        let keep = wgpu::StencilFaceState { compare: wgpu::CompareFunction::Always, ..Default::default() };
        let faces = match counting.counted() {
            Counted::InFront => {
                [IncrementWrap, DecrementWrap].map(|pass_op| wgpu::StencilFaceState { pass_op, ..keep })
            }
            Counted::Behind => {
                [DecrementWrap, IncrementWrap].map(|depth_fail_op| wgpu::StencilFaceState { depth_fail_op, ..keep })
            }
        };
        FaceState {
            fragment: "fs_volume",
            depth_stencil: wgpu::DepthStencilState {
                format: targets.depth_format,
                depth_write_enabled: Some(false),
                depth_compare: Some(wgpu::CompareFunction::Less),
                stencil: stencil(faces[0], faces[1]),
                bias: wgpu::DepthBiasState::default(),
            },
            color: wgpu::ColorTargetState {
                write_mask: wgpu::ColorWrites::empty(),
                ..color_format(request.options.mode).into()
            },
            samples: request.options.antialias.samples(),
            unclipped_depth: counting.clamps_depth(),
        }
    }
}

impl Technique for StencilVolumes {
    fn name(&self) -> String {
        let counting = match self.counting {
            Counting::ZPassOutside => "z-pass, eye outside",
            Counting::ZPass => "z-pass",
            Counting::ZFailClipped => "z-fail, clipped",
            Counting::ZFail => "z-fail",
        };
        format!("stencil volumes, {counting}")
    }

    fn needs_stencil(&self) -> bool {
        true
    }

    fn depends_on_camera(&self) -> bool {
        self.counting == Counting::ZPass
    }

    fn update(
        &mut self,
        stage: &Stage,
        request: &FrameRequest,
        _: &mut wgpu::CommandEncoder,
    ) -> Result<(), RenderError> {
        if self.counting == Counting::ZPass {
            self.around_eye = self.around_eye(stage, request);
        }
        self.volumes.update(stage, &request.light)
    }

    fn draw(
        &mut self,
        stage: &Stage,
        request: &FrameRequest,
        targets: &Targets,
        encoder: &mut wgpu::CommandEncoder,
    ) -> Result<(), RenderError> {
        let mut pass = targets.begin(encoder, (request.options.mode, Begin::Clear));
        self.ambient.draw(stage, request, targets, (&mut pass, Part::All));
        let number = 2 * request.options.antialias.samples() + u32::from(request.options.mode == Mode::Mask);
        let state = (number, || Self::face_state(self.counting, request, targets));
        self.volumes.draw(stage, state, &mut pass);
        // The stencil holds the surface's count less the eye's.
        pass.set_stencil_reference(self.around_eye.wrapping_neg() & 0xff);
        self.lit.draw(stage, request, targets, (&mut pass, Part::All));
        Ok(())
    }

    fn cost(&self, stage: &Stage) -> Cost {
        let counts =
            if self.counting == Counting::ZPass { ", the eye's volumes counted (new cameras too)" } else { "" };
        Cost {
            passes: 1,
            draw_calls: 2 * stage.calls_per_pass() + self.volumes.draw_calls(),
            update_passes: 0,
            update_draw_calls: 0,
            texture_bytes: 0,
            buffer_bytes: self.volumes.buffer_bytes(),
            on_light_change: format!("outlines of all instances found on the CPU and sent{counts}"),
        }
    }
}

fn stencil(front: wgpu::StencilFaceState, back: wgpu::StencilFaceState) -> wgpu::StencilState {
    wgpu::StencilState { front, back, read_mask: 0xff, write_mask: 0xff }
}
