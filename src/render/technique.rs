//! What the techniques have in common: one trait, and what a frame costs in passes, calls and bytes.
//!
//! A technique draws the [`Stage`] with its shadows. What must be done again when the light moves (of some: the camera)
//! is [`Technique::update`]; what every frame needs is [`Technique::draw`]. So a still light and a moving one can be
//! timed apart.

use super::{
    FrameRequest, RenderError,
    stage::{Stage, Targets},
};
use serde::Serialize;

/// What a technique needs, counted rather than timed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Cost {
    /// Passes of a frame whose light stands still.
    pub passes: usize,
    /// Draw calls of these passes.
    pub draw_calls: usize,
    /// Passes that a new light adds.
    pub update_passes: usize,
    /// Draw calls of these.
    pub update_draw_calls: usize,
    /// Bytes of textures beside the model's and the frame's colour and depth.
    pub texture_bytes: usize,
    /// Bytes of buffers beside the model's.
    pub buffer_bytes: usize,
    /// What a new light makes to be done again, in words.
    pub on_light_change: String,
}

/// A way to draw shadows.
pub trait Technique {
    /// Its name in tables, with its setting: `shadow map 512, PCF 5x5`.
    fn name(&self) -> String;

    /// Must the depth buffer have a stencil?
    fn needs_stencil(&self) -> bool {
        false
    }

    /// Does a new camera need [`Technique::update`] too?
    fn depends_on_camera(&self) -> bool {
        false
    }

    /// Does what a new light needs: work on the CPU, uploads, passes recorded into `encoder`.
    ///
    /// # Errors
    /// Something exceeds the adapter's limits, or the adapter misses a feature.
    fn update(
        &mut self,
        stage: &Stage,
        request: &FrameRequest,
        encoder: &mut wgpu::CommandEncoder,
    ) -> Result<(), RenderError>;

    /// Records a frame under the light of the last update.
    ///
    /// # Errors
    /// As of [`Technique::update`].
    fn draw(
        &mut self,
        stage: &Stage,
        request: &FrameRequest,
        targets: &Targets,
        encoder: &mut wgpu::CommandEncoder,
    ) -> Result<(), RenderError>;

    /// What it costs on `stage`, after a frame.
    fn cost(&self, stage: &Stage) -> Cost;
}
