//! `shadowfit render`.

use super::CliError;
use crate::{
    asset::{self, AssetError},
    pipeline::{self, FitError},
    render::{Antialias, Camera, FrameOptions, FrameRequest, Light, Mode, RenderError, cpu, gpu::Gpu, turntable},
    scene::{self, Scene},
};
use clap::{Args, ValueEnum};
use glam::Vec3;
use shadowfit_solver::{lights::direction, mesh::Mesh, plane::BakedSet};
use std::path::PathBuf;

/// How much farther away the camera stands where the ground is drawn, so that half of it is seen.
const BACK: f32 = 1.7;

/// The turntable's field of view, radians.
const GROUND_VIEW_RAD: f32 = std::f32::consts::FRAC_PI_6;

/// Nearest and farthest depth, radii of the model: the camera stands 6.8 away, the ground's corners lie 2.9 from its
/// middle.
const GROUND_DEPTHS: [f32; 2] = [2.0, 12.0];

#[derive(Debug, Args)]
pub(super) struct RenderArgs {
    /// The asset: STEM.shadow.glb.
    asset: PathBuf,
    /// The picture to write.
    #[arg(short, long, value_name = "PNG")]
    out: PathBuf,
    /// Where the light is, seen from the model: azimuth (0 = +Z, 90 = +X) and elevation, degrees.
    #[arg(long, value_name = "AZ,EL", default_value = "35,40", value_parser = angles, allow_hyphen_values = true)]
    light: [f32; 2],
    /// Angular radius of the light, degrees: soft edges, 0 for hard ones. The sun has 0.27.
    #[arg(long, value_name = "DEG", default_value_t = 0.0, value_parser = radius)]
    light_radius: f32,
    /// Where the camera is, seen from the model: azimuth and elevation, degrees.
    #[arg(long, value_name = "AZ,EL", default_value = "30,20", value_parser = angles, allow_hyphen_values = true)]
    view: [f32; 2],
    /// Width and height in pixels.
    #[arg(long, value_name = "PX", default_value_t = 1024, value_parser = clap::value_parser!(u32).range(16..=8192))]
    size: u32,
    /// What to draw: the shaded model, the raw visibility, or the model with its planes.
    #[arg(long, value_enum, default_value_t = Picture::Shaded)]
    mode: Picture,
    /// Draw the ground, too, that the asset was fitted with (`fit --ground`), from a little farther away.
    #[arg(long)]
    ground: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Picture {
    Shaded,
    Mask,
    Planes,
}

/// `AZ,EL` in degrees, as radians.
fn angles(text: &str) -> Result<[f32; 2], String> {
    let numbers: Vec<f32> = text.split(',').filter_map(|n| n.trim().parse().ok()).collect();
    match numbers[..] {
        [az, el] if text.split(',').count() == 2 && az.is_finite() && el.abs() <= 90.0 => {
            Ok([az.to_radians(), el.to_radians()])
        }
        _ => Err("AZIMUTH,ELEVATION in degrees is needed, elevation from -90 to 90".to_string()),
    }
}

/// Most degrees of a light's radius: beyond, no border is left that could be soft.
const MAX_LIGHT_RADIUS_DEG: f32 = 45.0;

/// Degrees from 0 to [`MAX_LIGHT_RADIUS_DEG`].
fn radius(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(degrees) if (0.0..=MAX_LIGHT_RADIUS_DEG).contains(&degrees) => Ok(degrees),
        _ => Err(format!("degrees from 0 to {MAX_LIGHT_RADIUS_DEG} are needed")),
    }
}

/// Draws an asset: with wgpu, or with the CPU twin where there is no adapter.
pub(super) fn render(args: &RenderArgs) -> Result<(), CliError> {
    if asset::files::is_same_file(&args.asset, &args.out) {
        return Err(FitError::Asset(AssetError::OverwritesInput { path: args.out.clone() }).into());
    }
    let mut scene = scene::load(&args.asset).map_err(FitError::Scene)?;
    let planes = asset::read(&args.asset).map_err(FitError::Asset)?;
    let mesh_error = |source| FitError::Mesh { path: args.asset.clone(), source };
    let mut mesh = Mesh::new(&scene.soup).map_err(mesh_error)?;
    let mut camera = Camera::turntable(args.view[0], args.view[1]);
    if args.ground {
        let model = mesh.frame;
        let Some((ground, section)) = planes.in_unit_space(&model).ground_section() else {
            return Err(CliError::Usage(format!("--ground: {} was fitted without one", args.asset.display())));
        };
        scene.stand_on_ground(&model, f64::from(ground.half_extent));
        scene.label_ground(section);
        mesh = Mesh::new(&scene.soup).map_err(mesh_error)?;
        // The ground makes unit space larger.
        let (scale, centre) =
            ((model.radius / mesh.frame.radius) as f32, mesh.frame.unit_from_model(model.centre_model));
        camera = Camera::looking(BACK * camera.eye(), Vec3::ZERO, GROUND_VIEW_RAD, GROUND_DEPTHS).moved(scale, centre);
    }
    let set = planes.in_unit_space(&mesh.frame);
    let (mode, antialias) = match args.mode {
        Picture::Shaded => (Mode::Shaded, Antialias::Msaa4),
        Picture::Mask => (Mode::Mask, Antialias::Off),
        Picture::Planes => (Mode::Planes, Antialias::Msaa4),
    };
    let light = Light::Directional { to_light: direction(args.light[0], args.light[1]) };
    let options = FrameOptions { size_px: [args.size; 2], mode, antialias };
    let picture = draw((&scene, &mesh, &set), &FrameRequest { camera, light, options }, args.light_radius.to_radians());
    pipeline::write_png(&args.out, &picture.map_err(FitError::Render)?)?;
    Ok(())
}

fn draw(
    (scene, mesh, set): (&Scene, &Mesh, &BakedSet),
    request: &FrameRequest,
    light_radius_rad: f32,
) -> Result<image::RgbaImage, RenderError> {
    let on_gpu = || {
        let mut turntable = turntable::Turntable::new(&Gpu::new()?, scene, &mesh.frame)?;
        turntable.set_soft_planes(set, light_radius_rad)?;
        turntable.render(request)
    };
    match on_gpu() {
        Err(RenderError::NoAdapter | RenderError::Device { .. } | RenderError::TooLarge { .. }) => {
            tracing::warn!("no graphics adapter can draw this: drawing with the CPU");
            let mut turntable = cpu::Turntable::new(scene, mesh);
            turntable.set_soft_planes(set, light_radius_rad);
            turntable.render(request)
        }
        outcome => outcome,
    }
}
