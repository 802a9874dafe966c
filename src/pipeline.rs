//! The recipe: from a model file to a proven asset, one line a stage.

use crate::{
    asset::{self, AssetError, AssetRequest, Bounds},
    effort::Effort,
    fitting::{Fitted, fit},
    render::RenderError,
    report::{CurvePoint, GroundReport, Lookups, Report, SCHEMA, Times},
    scene::{self, Scene, SceneError, Skipped},
    validation::{ImageErrors, ValidationOptions, validate},
};
use glam::{DVec3, Vec3};
use shadowfit_solver::{
    columns::ColumnOptions,
    lights::LightDomain,
    mesh::{Mesh, MeshError},
    metrics::{Metrics, measure},
    plane::{BakedSet, Ground},
    receivers::{ReceiverOptions, Receivers, sample},
    sampling::hash,
    visibility::{Pairs, trace},
};
use std::{
    io::Cursor,
    path::{Path, PathBuf},
    time::Instant,
};

/// Rays that estimate the exposure of a held-out receiver.
const EXPOSURE_RAYS: usize = 64;

/// Held-out receivers and lights: other numbers than any preset trains on, so that the lattices differ too.
pub(crate) const HELD_OUT: [usize; 2] = [12_000, 307];

/// What a sampling is for: no two share their points.
#[derive(Clone, Copy)]
pub(crate) enum Purpose {
    Training = 1,
    HeldOut,
    Judging,
    Image,
    Pilot,
    Directions,
    Comparison,
}

/// One fit.
#[derive(Clone, Debug)]
pub struct FitRequest {
    /// The model.
    pub model: PathBuf,
    /// Folder of the output.
    pub out_dir: PathBuf,
    /// How much work.
    pub effort: Effort,
    /// Most planes, where the user names a number.
    pub max_planes: Option<usize>,
    /// Most planes that a fragment reads, where the user names a number.
    pub max_lookups: Option<usize>,
    /// Sections, where the user names a number.
    pub sections: Option<usize>,
    /// Most bytes of all textures, where the user names a number.
    pub texture_budget: Option<usize>,
    /// How to prove a bound; none without. A model is left whole for it.
    pub certificate: Option<ColumnOptions>,
    /// Is the shadow on the ground below the model served, too?
    pub ground: bool,
    /// The fewest planes that reach this held-out error, also on the ground, where there is one.
    pub max_error: Option<f64>,
    /// Texels along the longer side, where the user names a number.
    pub texture_size: Option<usize>,
    /// Directions that the fit must serve.
    pub domain: LightDomain,
    /// The same as text.
    pub domain_text: String,
    /// Bake these rectangles instead of searching.
    pub planes: Option<PathBuf>,
    /// Frames to render; none without.
    pub validation: Option<ValidationOptions>,
    /// Seed of all sampling.
    pub seed: u64,
    /// The command line, for the report.
    pub command: String,
}

/// Why a fit failed.
#[derive(Debug, thiserror::Error)]
pub enum FitError {
    /// The model cannot be read.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The model has nothing to fit.
    #[error("{}: {source}", .path.display())]
    Mesh {
        /// The model.
        path: PathBuf,
        /// What is wrong.
        source: MeshError,
    },
    /// A file cannot be written or read back.
    #[error(transparent)]
    Asset(#[from] AssetError),
    /// The driver fails.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// A picture cannot be encoded.
    #[error("cannot encode a picture: {0}")]
    Encode(#[from] image::ImageError),
    /// The report cannot be encoded.
    #[error("cannot encode the report: {0}")]
    Report(#[from] serde_json::Error),
}

impl FitError {
    /// The program's exit code.
    #[must_use]
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Scene(error) => error.exit_code(),
            Self::Mesh { .. } => 3,
            Self::Asset(error) => error.exit_code(),
            Self::Render(_) | Self::Encode(_) | Self::Report(_) => 4,
        }
    }
}

/// Seconds since the last lap.
struct Clock(Instant);

impl Clock {
    fn lap(&mut self) -> f64 {
        let now = Instant::now();
        std::mem::replace(&mut self.0, now).elapsed().as_secs_f64()
    }
}

/// Loads, fits, bakes, writes, reads back and proves. `progress` is told what goes on.
///
/// # Errors
/// See [`FitError`]; nothing partial is left in the output folder.
pub fn run(request: &FitRequest, progress: &mut dyn FnMut(String)) -> Result<Report, FitError> {
    let (start, mut clock, mut time_s) = (Instant::now(), Clock(Instant::now()), Times::default());
    progress(format!("reading {}", request.model.display()));
    check_files(request)?;
    let scene = scene::load(&request.model)?;
    time_s.load = clock.lap();
    let mesh_error = |source| FitError::Mesh { path: request.model.clone(), source };
    let mesh = scene.mesh().map_err(mesh_error)?;
    time_s.bvh = clock.lap();

    let fitted = fit(request, (&scene, &mesh), progress, &mut time_s)?;
    clock.lap();

    progress("writing the asset".to_string());
    let stem = stem_of(&request.model);
    let (out_dir, bounds) = (request.out_dir.as_path(), bounds(&mesh));
    let asset_request = AssetRequest {
        input: &request.model,
        out_dir,
        stem: &stem,
        frame: &mesh.frame,
        bounds,
        set: &fitted.set,
        origins: &scene.origins,
        section_of: &fitted.section_of,
    };
    let written = asset::write(&asset_request)?;
    time_s.write = clock.lap();

    progress("validating what was written".to_string());
    let proof = prove(request, &mesh, &fitted, &written.model, time_s.search)?;
    time_s.validate = clock.lap();
    time_s.total = start.elapsed().as_secs_f64();

    let mut report = Report {
        schema: SCHEMA,
        version: env!("CARGO_PKG_VERSION"),
        model: request.model.display().to_string(),
        triangles: mesh.triangle_count(),
        seed: request.seed,
        light_domain: request.domain_text.clone(),
        planes: fitted.set.planes.len(),
        sections: fitted.set.model_sections(),
        lookups: proof.lookups,
        texture_bytes: written.texture_bytes,
        held_out: proof.held_out,
        ground: proof.ground,
        training: fitted.training,
        image: proof.image,
        certificate: fitted.certificate,
        curve: proof.curve,
        time_s,
        peak_memory_bytes: peak_memory_bytes(),
        skipped: skipped(&scene, &mesh, &written.not_copied),
        max_error: request.max_error,
        command: request.command.clone(),
        files: written.files().map(|path| path.display().to_string()).collect(),
    };
    write_report(&mut report, out_dir, &stem, proof.picture)?;
    Ok(report)
}

/// Refuses, before the long search, an input that cannot be extended and an output in the place of an input.
fn check_files(request: &FitRequest) -> Result<(), AssetError> {
    asset::check_input(&request.model)?;
    let inputs: Vec<&Path> = std::iter::once(&request.model).chain(&request.planes).map(PathBuf::as_path).collect();
    asset::check_outputs(&request.out_dir, &stem_of(&request.model), &inputs)
}

/// What the written files are worth.
struct Proof {
    held_out: Metrics,
    ground: Option<GroundReport>,
    lookups: Lookups,
    curve: Vec<CurvePoint>,
    image: Option<ImageErrors>,
    picture: Option<image::RgbaImage>,
}

/// Reads the asset back, planes and labels, and measures it on pairs and frames that the search never saw.
fn prove(request: &FitRequest, mesh: &Mesh, fitted: &Fitted, written: &Path, search_s: f64) -> Result<Proof, FitError> {
    // The written scene has the same triangles as the input's, in the same order: the mesh holds for both.
    let (set, scene) = (asset::read(written)?.in_unit_space(&mesh.frame), scene::load(written)?);
    let (pairs, receivers) = held_out(mesh, request, HELD_OUT, Purpose::HeldOut);
    let section_of = receiver_sections(mesh, &receivers, &scene.section_of);
    let held_out = measure(&set, &pairs, &section_of);
    let curve = curve(fitted, (&set, &held_out), (mesh, &pairs, &receivers), search_s);
    let lookups = Lookups::measure(&set, &pairs, &section_of);
    let ground = set.ground_section().map(|(ground, section)| {
        let pairs = held_out_ground((mesh, &ground), request, HELD_OUT, Purpose::HeldOut);
        GroundReport::measure(&set, &pairs, section)
    });
    let mut proof = Proof { held_out, ground, lookups, curve, image: None, picture: None };
    if let Some(options) = &request.validation {
        let lights = validation_lights(request, &held_out, options.lights);
        let validation = validate((&scene, mesh), &set, &lights, options)?;
        (proof.image, proof.picture) = (Some(validation.errors), Some(validation.comparison));
    }
    Ok(proof)
}

/// The section of each receiver, from that of each triangle of the scene.
#[must_use]
pub fn receiver_sections(mesh: &Mesh, receivers: &Receivers, section_of: &[u32]) -> Vec<u32> {
    receivers.triangles.iter().map(|&triangle| section_of[mesh.source[triangle as usize] as usize]).collect()
}

pub(crate) fn seed_for(request: &FitRequest, purpose: Purpose) -> u64 {
    hash(request.seed, purpose as u64)
}

/// Pairs that the search does not see, and their receivers.
pub(crate) fn held_out(
    mesh: &Mesh,
    request: &FitRequest,
    [receivers, lights]: [usize; 2],
    purpose: Purpose,
) -> (Pairs, Receivers) {
    let sampling = ReceiverOptions { count: receivers, exposure_rays: EXPOSURE_RAYS, seed: seed_for(request, purpose) };
    let receivers = sample(mesh, &sampling);
    let lights = request.domain.directions(lights, seed_for(request, purpose));
    (trace(mesh, &receivers, &lights, request.domain.solid_angle()), receivers)
}

/// The same of the ground.
pub(crate) fn held_out_ground(
    (mesh, ground): (&Mesh, &Ground),
    request: &FitRequest,
    [receivers, lights]: [usize; 2],
    purpose: Purpose,
) -> Pairs {
    let sampling = ReceiverOptions { count: receivers, exposure_rays: EXPOSURE_RAYS, seed: seed_for(request, purpose) };
    let receivers = ground.sample(mesh, &sampling);
    let lights = request.domain.directions(lights, seed_for(request, purpose));
    trace(mesh, &receivers, &lights, request.domain.solid_angle())
}

/// The worst held-out light first, then others that neither search nor metrics used.
fn validation_lights(request: &FitRequest, held_out: &Metrics, count: usize) -> Vec<Vec3> {
    let others = request.domain.directions(count, seed_for(request, Purpose::Image));
    let worst = Vec3::from_array(held_out.worst_light.direction);
    let worst = (held_out.worst_light.max > 0.0).then_some(worst);
    worst.into_iter().chain(others).take(count).collect()
}

/// Held-out error of the smaller sets; the last point is the result.
fn curve(
    fitted: &Fitted,
    written: (&BakedSet, &Metrics),
    held_out: (&Mesh, &Pairs, &Receivers),
    search_s: f64,
) -> Vec<CurvePoint> {
    let (mesh, pairs, receivers) = held_out;
    let section_of = receiver_sections(mesh, receivers, &fitted.section_of);
    let mut nothing =
        BakedSet { sections: fitted.set.sections.clone(), ground: fitted.set.ground, ..BakedSet::default() };
    nothing.sections.iter_mut().for_each(Vec::clear);
    let mut curve = vec![CurvePoint::new(&nothing, &measure(&nothing, pairs, &section_of), 0.0)];
    let point = |(set, seconds): &(BakedSet, f64)| CurvePoint::new(set, &measure(set, pairs, &section_of), *seconds);
    curve.extend(fitted.smaller.iter().map(point));
    if !written.0.planes.is_empty() {
        curve.push(CurvePoint::new(written.0, written.1, search_s));
    }
    curve
}

/// Box of the mesh in model space.
fn bounds(mesh: &Mesh) -> Bounds {
    let corners = mesh.corners.iter().flatten().map(|p| mesh.frame.model_from_unit(*p));
    let (min, max) = corners.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
    Bounds { min, max }
}

/// All that the file holds and the fit did not use.
fn skipped(scene: &Scene, mesh: &Mesh, not_copied: &[String]) -> Vec<Skipped> {
    let mut out = scene.skipped.clone();
    let mut add = |what: &str, count: usize, why: &str| {
        if count > 0 {
            out.push(Skipped { what: what.to_string(), count, why: why.to_string() });
        }
    };
    add("triangles without area", mesh.zero_area, "they neither cast nor receive");
    add("duplicate triangles", mesh.duplicates, "fitted once");
    add("missing images", not_copied.len(), "the asset names them as the input does");
    out
}

/// File name of the model without its ending.
pub(crate) fn stem_of(model: &Path) -> String {
    model.file_stem().map_or_else(|| "model".to_string(), |stem| stem.to_string_lossy().into_owned())
}

/// Adds `STEM.compare.png` and `STEM.report.json`.
fn write_report(
    report: &mut Report,
    out_dir: &Path,
    stem: &str,
    picture: Option<image::RgbaImage>,
) -> Result<(), FitError> {
    let mut batch = asset::files::Batch::default();
    if let Some(picture) = picture {
        let path = out_dir.join(format!("{stem}.compare.png"));
        batch.stage(&path, &png(&picture)?)?;
        report.files.push(path.display().to_string());
    }
    let path = out_dir.join(format!("{stem}.report.json"));
    report.files.push(path.display().to_string());
    batch.stage(&path, format!("{}\n", serde_json::to_string_pretty(report)?).as_bytes())?;
    Ok(batch.commit()?)
}

/// Writes a picture, complete or not at all.
///
/// # Errors
/// The file system says no.
pub fn write_png(path: &Path, picture: &image::RgbaImage) -> Result<(), FitError> {
    let mut batch = asset::files::Batch::default();
    batch.stage(path, &png(picture)?)?;
    Ok(batch.commit()?)
}

pub(crate) fn png(picture: &image::RgbaImage) -> Result<Vec<u8>, image::ImageError> {
    let mut out = Cursor::new(Vec::new());
    picture.write_to(&mut out, image::ImageFormat::Png)?;
    Ok(out.into_inner())
}

/// Largest resident set so far, from the kernel's own count.
fn peak_memory_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kib: u64 = line.trim().trim_end_matches("kB").trim().parse().ok()?;
    Some(kib * 1024)
}
