//! What all techniques of a comparison are drawn on: the model alone, the model on a ground, and the model with the
//! sections of each set of planes.

use super::CompareOptions;
use crate::{
    asset,
    pipeline::{self, FitError, FitRequest, Purpose, seed_for, stem_of},
    render::{
        Antialias, Camera, FrameOptions, FrameRequest, Light, Mode,
        gpu::Gpu,
        ray_traced::RayTraced,
        stage::{Placement, Stage},
    },
    scene::{self, Scene},
    validation::turntable_views,
};
use glam::Vec3;
use shadowfit_solver::{
    lights::LightDomain,
    mesh::{Frame, Mesh},
    plane::BakedSet,
};
use std::path::{Path, PathBuf};

/// Half the side of the ground, radii of the model: the shadow of a model of radius 1 under a light 30 degrees high ends
/// 1.7 from its middle.
const GROUND_RADII: f64 = 2.5;

/// Lowest lights over a ground: below it shadows leave the ground.
const LOWEST_LIGHT_RAD: f32 = 0.5;

/// Counted planes that stand beside a divided model's.
const COUNTED_PLANES: usize = 8;

/// What is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum World {
    /// The model on itself.
    Model,
    /// The model on a ground.
    Ground,
    /// The model with the sections of a set of planes, by its number.
    Planes(usize),
}

/// Planes of the model.
pub(super) struct Planes {
    pub label: String,
    pub scene: Scene,
    pub set: BakedSet,
}

/// A model in the worlds of the comparison.
pub(super) struct Bench {
    pub gpu: Gpu,
    /// Unit space of the model; world space of all frames.
    pub frame: Frame,
    pub planes: Vec<Planes>,
    /// By world: the model, the ground, then the sets of planes.
    pub stages: Vec<Stage>,
    pub model: RayTraced,
    pub ground: RayTraced,
    pub cameras: Vec<Camera>,
    lights: Vec<Vec3>,
    pub size_px: u32,
}

impl World {
    /// The world of a stage.
    pub fn of_stage(stage: usize) -> Self {
        match stage {
            0 => Self::Model,
            1 => Self::Ground,
            n => Self::Planes(n - 2),
        }
    }

    /// Index of its stage.
    pub fn stage(self) -> usize {
        match self {
            Self::Model => 0,
            Self::Ground => 1,
            Self::Planes(set) => 2 + set,
        }
    }
}

impl Bench {
    pub fn new(
        request: &FitRequest,
        options: &CompareOptions,
        progress: &mut dyn FnMut(String),
    ) -> Result<Self, FitError> {
        let gpu = Gpu::new()?;
        let scene = scene::load(&request.model)?;
        let mesh_error = |source| FitError::Mesh { path: request.model.clone(), source };
        let frame = Mesh::new(&scene.soup).map_err(mesh_error)?.frame;
        let planes = planes(request, &frame, progress)?;
        let mut on_ground = scene.clone();
        on_ground.stand_on_ground(&frame, GROUND_RADII);
        let scenes = [&scene, &on_ground].into_iter().chain(planes.iter().map(|planes| &planes.scene));
        let identity = [Placement::IDENTITY];
        let stages = scenes.map(|scene| Stage::new(&gpu, scene, &frame, &identity)).collect::<Result<_, _>>()?;
        Ok(Self {
            stages,
            model: RayTraced::new(scene, &frame).map_err(mesh_error)?,
            ground: RayTraced::new(on_ground, &frame).map_err(mesh_error)?,
            gpu,
            frame,
            planes,
            cameras: turntable_views(options.views),
            lights: LightDomain::Sphere.directions(options.lights, seed_for(request, Purpose::Comparison)),
            size_px: options.size_px,
        })
    }

    /// One of the lights, counted round.
    pub fn light(&self, number: usize) -> Vec3 {
        self.lights[number % self.lights.len()]
    }

    /// The reference of a world.
    pub fn traced(&self, world: World) -> &RayTraced {
        if world == World::Ground { &self.ground } else { &self.model }
    }

    /// A frame of a world.
    pub fn request(&self, world: World, (view, light): (usize, usize), mode: Mode) -> FrameRequest {
        let options = FrameOptions { size_px: [self.size_px; 2], mode, antialias: Antialias::Off };
        let (mut camera, mut to_light) =
            (self.cameras[view % self.cameras.len()], self.lights[light % self.lights.len()]);
        if world == World::Ground {
            // From above, and under a light from above.
            let eye = Vec3::new(camera.eye().x, camera.eye().y.abs().max(1.5), camera.eye().z);
            camera = Camera::looking(1.6 * eye, Vec3::ZERO, std::f32::consts::FRAC_PI_6, [0.5, 20.0]);
            let (azimuth, elevation) = shadowfit_solver::lights::angles(to_light);
            to_light = shadowfit_solver::lights::direction(azimuth, elevation.abs().max(LOWEST_LIGHT_RAD));
        }
        FrameRequest { camera, light: Light::Directional { to_light }, options }
    }
}

/// The planes that the model brings, or those of two fits made now: counted ones, and a divided model's.
fn planes(request: &FitRequest, frame: &Frame, progress: &mut dyn FnMut(String)) -> Result<Vec<Planes>, FitError> {
    let load = |label: &str, path: &Path| -> Result<Planes, FitError> {
        let set = asset::read(path)?.in_unit_space(frame);
        Ok(Planes { label: label.to_string(), scene: scene::load(path)?, set })
    };
    if asset::read(&request.model).is_ok() {
        return Ok(vec![load("asset", &request.model)?]);
    }
    let fits = [("8 planes", Some(COUNTED_PLANES)), ("divided", None)];
    let fit = |(label, max_planes): (&str, Option<usize>)| {
        let folder: PathBuf = request.out_dir.join(label.replace(' ', "-"));
        let request = FitRequest { max_planes, out_dir: folder.clone(), ..request.clone() };
        pipeline::run(&request, &mut |message| progress(format!("fit of {label}: {message}")))?;
        load(label, &folder.join(format!("{}.shadow.glb", stem_of(&request.model))))
    };
    fits.map(fit).into_iter().collect()
}
