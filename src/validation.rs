//! Validation: the asset as written, rendered and compared with traced masks, pixel by pixel.
//!
//! In: the scene with its sections and the planes, both *read back from the files*, views and lights. Per view the camera rays are traced once;
//! per light a traced mask and a rendered one (wgpu on the best adapter; the CPU twin where there is none) are
//! compared on the pixels that both cover. Out: errors, and a picture of the worst light's worst view:
//! reference | planes | difference.

use crate::{
    masks::{MaskErrors, difference, mean_flip, side_by_side},
    render::{
        Antialias, Camera, FrameOptions, FrameRequest, Light, Mode, RenderError,
        cpu::{self, Primary, PrimaryHit},
        gpu::Gpu,
        turntable,
    },
    scene::Scene,
};
use glam::Vec3;
use image::RgbaImage;
use serde::Serialize;
use shadowfit_solver::{
    mesh::{Mesh, ray_origin},
    plane::BakedSet,
};

/// How much is rendered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ValidationOptions {
    /// Views around the model, 1 and up.
    pub views: usize,
    /// Lights, the worst one first, 1 and up.
    pub lights: usize,
    /// Width and height of the frames.
    pub size_px: u32,
}

impl ValidationOptions {
    /// 4 views x 2 lights of 512 x 512: a few seconds without a GPU.
    #[must_use]
    pub fn short() -> Self {
        Self { views: 4, lights: 2, size_px: 512 }
    }

    /// 8 views x 8 lights of 1024 x 1024: what baselines and reports use.
    #[must_use]
    pub fn full() -> Self {
        Self { views: 8, lights: 8, size_px: 1024 }
    }
}

/// Errors of the rendered frames; shares of the covered pixels.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ImageErrors {
    /// `wgpu:<adapter>` or `cpu`.
    pub renderer: String,
    /// Wrong share of the covered pixels.
    pub mask_error: f64,
    /// The part that lacks shadow.
    pub missed: f64,
    /// The part that has too much.
    #[serde(rename = "false")]
    pub false_: f64,
    /// Mean FLIP of the shaded frames against traced ones; `null` without the cargo feature `flip`.
    pub flip_mean: Option<f64>,
    /// Frames compared.
    pub frames: usize,
    /// Their width and height.
    pub size_px: u32,
}

/// Errors and the comparison picture.
#[derive(Clone, Debug)]
pub struct Validation {
    /// Errors over all frames.
    pub errors: ImageErrors,
    /// Reference | planes | difference.
    pub comparison: RgbaImage,
}

/// Elevations of the views in degrees, in turn: from above, from below, level.
const ELEVATIONS_DEG: [f32; 4] = [25.0, -15.0, 50.0, 5.0];

/// The renderer under test.
enum Renderer<'a> {
    Gpu(Box<turntable::Turntable>, String),
    Cpu(Box<cpu::Turntable<'a>>),
}

impl<'a> Renderer<'a> {
    /// wgpu where it can draw this scene, else the CPU twin.
    fn new(scene: &'a Scene, mesh: &'a Mesh, set: &BakedSet) -> Result<Self, RenderError> {
        let on_gpu = || {
            let gpu = Gpu::new()?;
            let mut turntable = turntable::Turntable::new(&gpu, scene, &mesh.frame)?;
            turntable.set_planes(set)?;
            Ok(Self::Gpu(Box::new(turntable), format!("wgpu:{}", gpu.adapter_name())))
        };
        match on_gpu() {
            Err(RenderError::NoAdapter | RenderError::Device { .. } | RenderError::TooLarge { .. }) => {
                let mut turntable = cpu::Turntable::new(scene, mesh);
                turntable.set_planes(set);
                Ok(Self::Cpu(Box::new(turntable)))
            }
            outcome => outcome,
        }
    }

    fn name(&self) -> String {
        match self {
            Self::Gpu(_, name) => name.clone(),
            Self::Cpu(_) => "cpu".to_string(),
        }
    }

    fn render(&mut self, request: &FrameRequest) -> Result<RgbaImage, RenderError> {
        match self {
            Self::Gpu(turntable, _) => turntable.render(request),
            Self::Cpu(turntable) => turntable.render(request),
        }
    }
}

/// `count` views around a model, in turn from above, below and level.
#[must_use]
pub fn turntable_views(count: usize) -> Vec<Camera> {
    let view = |view: usize| {
        let azimuth_deg = 360.0 * (view as f32 + 0.35) / count as f32;
        let elevation_deg = ELEVATIONS_DEG[view % ELEVATIONS_DEG.len()];
        Camera::turntable(azimuth_deg.to_radians(), elevation_deg.to_radians())
    };
    (0..count).map(view).collect()
}

/// Renders and compares. `lights` are unit directions towards the light, the worst first; as many as the options
/// ask for are used.
///
/// # Errors
/// The driver fails while drawing.
pub fn validate(
    (scene, mesh): (&Scene, &Mesh),
    set: &BakedSet,
    lights: &[Vec3],
    options: &ValidationOptions,
) -> Result<Validation, RenderError> {
    let mut renderer = Renderer::new(scene, mesh, set)?;
    let size_px = [options.size_px; 2];
    let (mut total, mut flips, mut worst) = (MaskErrors::default(), Vec::new(), None);
    let lights = &lights[..options.lights.min(lights.len())];
    for camera in turntable_views(options.views) {
        let primary = Primary::trace(mesh, &camera, size_px, Antialias::Off)?;
        for (index, &to_light) in lights.iter().enumerate() {
            let light = Light::Directional { to_light };
            let visibility =
                |hit: &PrimaryHit| mesh.transmitted(ray_origin(hit.p_unit, hit.normal), to_light, f32::INFINITY);
            let mut draw = |mode| {
                let options = FrameOptions { size_px, mode, antialias: Antialias::Off };
                renderer.render(&FrameRequest { camera, light, options })
            };
            let traced = primary.picture((scene, mesh), Mode::Mask, &light, visibility)?;
            let drawn = draw(Mode::Mask)?;
            let errors = MaskErrors::between(&traced, &drawn);
            total = total.plus(errors);
            let wrong = errors.wrong();
            let is_worst = index == 0 && worst.as_ref().is_none_or(|(most, _)| wrong > *most);
            if is_worst || cfg!(feature = "flip") {
                let reference = primary.picture((scene, mesh), Mode::Shaded, &light, visibility)?;
                let shaded = draw(Mode::Shaded)?;
                flips.extend(mean_flip(&reference, &shaded));
                if is_worst {
                    worst = Some((wrong, side_by_side(&[&reference, &shaded, &difference(&traced, &drawn)])));
                }
            }
        }
    }
    let errors = ImageErrors {
        renderer: renderer.name(),
        mask_error: total.share(total.wrong()),
        missed: total.share(total.missed),
        false_: total.share(total.false_),
        flip_mean: (!flips.is_empty()).then(|| flips.iter().sum::<f64>() / flips.len() as f64),
        frames: options.views * lights.len(),
        size_px: options.size_px,
    };
    let comparison = worst.map_or_else(|| RgbaImage::new(1, 1), |(_, picture)| picture);
    Ok(Validation { errors, comparison })
}
