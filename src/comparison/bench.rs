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
    lights::{LightDomain, angles, direction},
    mesh::{Frame, Mesh},
    plane::BakedSet,
};
use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

/// Half the side of the ground, radii of the model: what `fit --ground` serves. The shadow of a model of radius 1 under a
/// light 30 degrees high ends 1.7 from its middle.
const GROUND_RADII: f64 = 2.0;

/// Lowest lights over a ground: below it shadows leave the ground.
const LOWEST_LIGHT_RAD: f32 = 0.5;

/// Counted planes that stand beside a divided model's.
const COUNTED_PLANES: usize = 8;

/// Share of the light, per colour, that each surface lets pass where a model without blended materials is turned into
/// glass: another share for each colour.
const GLASS: [f32; 3] = [0.75, 0.5, 0.25];

/// What is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum World {
    /// The model on itself.
    Model,
    /// The model on itself, with the sections of a set of planes that serves no ground, by its number.
    Planes(usize),
    /// The model on a ground; what counts is the ground.
    Ground,
    /// The same with the sections of a set of planes that serves the ground, too, by its number.
    PlanesOnGround(usize),
    /// The model with its blended materials, or all of glass where it has none, on a ground; what counts is the ground.
    Glass,
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
    stages: BTreeMap<World, Stage>,
    /// The references: of [`World::Model`], [`World::Ground`] and [`World::Glass`].
    traced: BTreeMap<World, RayTraced>,
    cameras: Vec<Camera>,
    lights: Vec<Vec3>,
    pub size_px: u32,
}

impl World {
    /// The world with the same surfaces and without planes: it has the reference, and the frame time without shadows.
    pub fn bare(self) -> Self {
        match self {
            Self::Model | Self::Planes(_) => Self::Model,
            Self::Ground | Self::PlanesOnGround(_) => Self::Ground,
            Self::Glass => Self::Glass,
        }
    }

    /// Do the ground's pixels alone count?
    pub fn counts_ground(self) -> bool {
        matches!(self.bare(), Self::Ground | Self::Glass)
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
        let on_ground = options.families.iter().any(|family| family.world() == World::Ground);
        let planes = planes(request, (&frame, on_ground), progress)?;
        let mut scenes = BTreeMap::from([(World::Model, scene.clone())]);
        scenes.insert(World::Ground, standing(&scene, &frame, None));
        scenes.insert(World::Glass, standing(&glass(&scene), &frame, None));
        for (number, Planes { scene, set, .. }) in planes.iter().enumerate() {
            match set.ground_section() {
                Some((_, section)) => {
                    scenes.insert(World::PlanesOnGround(number), standing(scene, &frame, Some(section)))
                }
                None => scenes.insert(World::Planes(number), scene.clone()),
            };
        }
        let stage = |(&world, scene): (&World, &Scene)| -> Result<(World, Stage), FitError> {
            Ok((world, Stage::new(&gpu, scene, &frame, &[Placement::IDENTITY])?))
        };
        let stages = scenes.iter().map(stage).collect::<Result<_, _>>()?;
        let bare = scenes.into_iter().filter(|(world, _)| world.bare() == *world);
        let trace = |(world, scene)| Ok((world, RayTraced::new(scene, &frame).map_err(mesh_error)?));
        Ok(Self {
            stages,
            traced: bare.map(trace).collect::<Result<_, FitError>>()?,
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

    /// All worlds.
    pub fn worlds(&self) -> Vec<World> {
        self.stages.keys().copied().collect()
    }

    /// The stage of a world, where there is such a world.
    pub fn stage(&self, world: World) -> Option<&Stage> {
        self.stages.get(&world)
    }

    /// The same, to draw on.
    pub fn stage_mut(&mut self, world: World) -> Option<&mut Stage> {
        self.stages.get_mut(&world)
    }

    /// The reference of a world.
    pub fn traced(&self, world: World) -> &RayTraced {
        &self.traced[&world.bare()]
    }

    /// A frame of a world.
    pub fn request(&self, world: World, (view, light): (usize, usize), mode: Mode) -> FrameRequest {
        let options = FrameOptions { size_px: [self.size_px; 2], mode, antialias: Antialias::Off };
        let (mut camera, mut to_light) = (self.cameras[view % self.cameras.len()], self.light(light));
        if world.counts_ground() {
            // From above, and under a light from above.
            let eye = Vec3::new(camera.eye().x, camera.eye().y.abs().max(1.5), camera.eye().z);
            camera = Camera::looking(1.6 * eye, Vec3::ZERO, std::f32::consts::FRAC_PI_6, [0.5, 20.0]);
            let (azimuth, elevation) = angles(to_light);
            to_light = direction(azimuth, elevation.abs().max(LOWEST_LIGHT_RAD));
        }
        FrameRequest { camera, light: Light::Directional { to_light }, options }
    }
}

/// The scene on a ground, which reads the planes of `section`.
fn standing(scene: &Scene, frame: &Frame, section: Option<u32>) -> Scene {
    let mut scene = scene.clone();
    scene.stand_on_ground(frame, GROUND_RADII);
    if let Some(section) = section {
        scene.label_ground(section);
    }
    scene
}

/// The scene as it is where some material lets light pass, else all of glass.
fn glass(scene: &Scene) -> Scene {
    let mut scene = scene.clone();
    if scene.materials.iter().all(|material| material.transmittance.is_none()) {
        scene.materials.iter_mut().for_each(|material| material.transmittance = Some(GLASS));
    }
    scene
}

/// The planes that the model brings, or those of fits made now: counted ones, a divided model's, and where a ground is
/// compared those that serve it too.
fn planes(
    request: &FitRequest,
    (frame, on_ground): (&Frame, bool),
    progress: &mut dyn FnMut(String),
) -> Result<Vec<Planes>, FitError> {
    let load = |label: &str, path: &Path| -> Result<Planes, FitError> {
        let set = asset::read(path)?.in_unit_space(frame);
        Ok(Planes { label: label.to_string(), scene: scene::load(path)?, set })
    };
    if asset::read(&request.model).is_ok() {
        return Ok(vec![load("asset", &request.model)?]);
    }
    let fits = [("8 planes", Some(COUNTED_PLANES), false), ("divided", None, false), ("with ground", None, true)];
    let fit = |(label, max_planes, ground): (&str, Option<usize>, bool)| {
        let folder: PathBuf = request.out_dir.join(label.replace(' ', "-"));
        let request = FitRequest { max_planes, ground, out_dir: folder.clone(), ..request.clone() };
        pipeline::run(&request, &mut |message| progress(format!("fit of {label}: {message}")))?;
        load(label, &folder.join(format!("{}.shadow.glb", stem_of(&request.model))))
    };
    fits.into_iter().filter(|(.., ground)| on_ground || !ground).map(fit).collect()
}
