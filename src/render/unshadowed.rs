//! Technique: no shadow. Ambient light and Lambert, one pass: the floor of all costs.

use super::{
    FrameRequest, RenderError,
    forward::{Forward, ForwardOptions},
    gpu::CONSTANT_VISIBILITY,
    stage::{Begin, Part, Stage, Targets},
    technique::{Cost, Technique},
};

/// Draws the model without shadows.
#[derive(Debug)]
pub struct Unshadowed {
    forward: Forward,
}

impl Unshadowed {
    /// For frames of `stage`.
    #[must_use]
    pub fn new(stage: &Stage) -> Self {
        let options = ForwardOptions { constants: vec![("VISIBILITY", 1.0)], ..Default::default() };
        Self { forward: Forward::new(stage, &CONSTANT_VISIBILITY, None, options) }
    }
}

impl Technique for Unshadowed {
    fn name(&self) -> String {
        "none".to_string()
    }

    fn update(&mut self, _: &Stage, _: &FrameRequest, _: &mut wgpu::CommandEncoder) -> Result<(), RenderError> {
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
        self.forward.draw(stage, request, targets, (&mut pass, Part::All));
        Ok(())
    }

    fn cost(&self, stage: &Stage) -> Cost {
        Cost {
            passes: 1,
            draw_calls: stage.calls_per_pass(),
            update_passes: 0,
            update_draw_calls: 0,
            texture_bytes: 0,
            buffer_bytes: 0,
            on_light_change: "nothing".to_string(),
        }
    }
}
