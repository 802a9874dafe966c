//! The wgpu renderer of one model and its planes: what `render` and the validation draw.

use super::{
    FrameRequest, RenderError,
    gpu::Gpu,
    occluder_planes::OccluderPlanes,
    stage::{Placement, Stage},
};
use crate::scene::Scene;
use shadowfit_solver::{mesh::Frame, plane::BakedSet};

/// Draws one scene. The same request gives the same bytes on the same driver.
#[derive(Debug)]
pub struct Turntable {
    stage: Stage,
    planes: OccluderPlanes,
}

impl Turntable {
    /// Uploads `scene`; `frame` is where unit space lies (`Mesh::frame`). There are no planes yet.
    ///
    /// # Errors
    /// The scene exceeds the adapter's limits, or the driver reports an error.
    pub fn new(gpu: &Gpu, scene: &Scene, frame: &Frame) -> Result<Self, RenderError> {
        let stage = Stage::new(gpu, scene, frame, &[Placement::IDENTITY])?;
        let planes = OccluderPlanes::new(&stage, &BakedSet::default())?;
        Ok(Self { stage, planes })
    }

    /// Replaces the planes (unit space) that cast in the frames to come.
    ///
    /// # Errors
    /// Their textures exceed the adapter's limits, or the driver reports an error.
    pub fn set_planes(&mut self, set: &BakedSet) -> Result<(), RenderError> {
        self.set_soft_planes(set, 0.0)
    }

    /// The same with soft edges under directional lights of an angular radius.
    ///
    /// # Errors
    /// As of [`Turntable::set_planes`].
    pub fn set_soft_planes(&mut self, set: &BakedSet, light_radius_rad: f32) -> Result<(), RenderError> {
        self.planes = OccluderPlanes::soft(&self.stage, set, light_radius_rad)?;
        Ok(())
    }

    /// Draws a frame. Alpha is 255 everywhere but on the background of [`super::Mode::Mask`].
    ///
    /// # Errors
    /// A size beyond the adapter's limits, or the driver reports an error.
    pub fn render(&mut self, request: &FrameRequest) -> Result<image::RgbaImage, RenderError> {
        self.stage.render(&mut self.planes, request)
    }
}
