//! The recipe: from a model file to a proven asset, one line a stage.

use crate::{
    asset::{self, AssetError, AssetRequest, Bounds},
    effort::Effort,
    render::RenderError,
    report::{CurvePoint, Lookups, Report, SCHEMA, Times},
    scene::{self, Scene, SceneError, Skipped},
    validation::{ImageErrors, ValidationOptions, validate},
};
use glam::{DVec3, Vec3};
use shadowfit_solver::{
    bake::{BakeOptions, bake},
    candidates::{CandidateOptions, generate},
    lights::LightDomain,
    mesh::{Mesh, MeshError},
    metrics::{Metrics, measure},
    plane::BakedPlane,
    receivers::{ReceiverOptions, Receivers, sample},
    rectangle::Turn,
    sampling::hash,
    selection::{SelectionOptions, Verdict, select},
    shade::plane_rows,
    visibility::{Pairs, trace},
    votes::{Mask, best_bias},
};
use std::{
    io::Cursor,
    path::{Path, PathBuf},
    time::Instant,
};

/// Rays that estimate a receiver's exposure: in training, and on held-out receivers.
pub(crate) const EXPOSURE_RAYS: [usize; 2] = [32, 64];

/// Held-out receivers and lights: other numbers than any preset trains on, so that the lattices differ too.
pub(crate) const HELD_OUT: [usize; 2] = [24_000, 307];

/// Receivers and lights on which `--max-error` is decided.
const JUDGING: [usize; 2] = [12_000, 211];

/// `--max-error` aims this much lower: the judging pairs and the held-out ones are different samples.
const TARGET_MARGIN: f64 = 0.98;

/// Smallest gain of a plane while an error is to be reached: below it planes fit noise.
const TARGET_MIN_GAIN: f64 = 5e-4;

/// Most planes where `--max-error` is given without `--max-planes`.
const TARGET_MAX_PLANES: usize = 64;

/// What a sampling is for: no two share their points.
#[derive(Clone, Copy)]
pub(crate) enum Purpose {
    Training = 1,
    HeldOut,
    Judging,
    Image,
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
    /// The fewest planes that reach this held-out error.
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

/// What the search and the bake leave behind.
struct Fitted {
    planes: Vec<BakedPlane>,
    /// The greedy phase's planes, baked in order: the first k are its answer for k planes.
    greedy: Vec<BakedPlane>,
    /// Seconds into the search at which each greedy plane was found.
    found_at_s: Vec<f64>,
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
    let mesh = Mesh::new(&scene.soup).map_err(mesh_error)?;
    time_s.bvh = clock.lap();

    progress("tracing the reference".to_string());
    let effort = &request.effort;
    let receivers = sample(&mesh, &receiver_options(effort.receivers, EXPOSURE_RAYS[0], request, Purpose::Training));
    time_s.receivers = clock.lap();
    let lights = request.domain.directions(effort.lights, seed_for(request, Purpose::Training));
    let pairs = trace(&mesh, &receivers, &lights, request.domain.solid_angle());
    time_s.reference = clock.lap();

    let fitted = fit(request, &mesh, &pairs, progress, (&mut clock, &mut time_s))?;

    progress("writing the asset".to_string());
    let stem = stem_of(&request.model);
    let (out_dir, bounds) = (request.out_dir.as_path(), receiver_bounds(&mesh, &receivers));
    let asset_request = AssetRequest {
        input: &request.model,
        out_dir,
        stem: &stem,
        frame: &mesh.frame,
        bounds,
        planes: &fitted.planes,
    };
    let written = asset::write(&asset_request)?;
    time_s.write = clock.lap();

    progress("validating what was written".to_string());
    let proof = prove(request, (&scene, &mesh), &fitted, &written.model, time_s.search)?;
    time_s.validate = clock.lap();
    time_s.total = start.elapsed().as_secs_f64();

    let mut files = vec![written.model.clone(), written.sidecar.clone()];
    files.extend(written.atlases.iter().map(|atlas| atlas.path.clone()));
    let mut report = Report {
        schema: SCHEMA,
        version: env!("CARGO_PKG_VERSION"),
        model: request.model.display().to_string(),
        triangles: mesh.triangle_count(),
        seed: request.seed,
        light_domain: request.domain_text.clone(),
        planes: fitted.planes.len(),
        sections: 1,
        lookups: proof.lookups,
        texture_bytes: written.texture_bytes,
        held_out: proof.held_out,
        training: measure(&fitted.planes, &pairs),
        image: proof.image,
        certificate: None,
        curve: proof.curve,
        time_s,
        peak_memory_bytes: peak_memory_bytes(),
        skipped: skipped(&scene, &mesh, &written.not_copied),
        max_error: request.max_error,
        command: request.command.clone(),
        files: files.iter().map(|path| path.display().to_string()).collect(),
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
    lookups: Lookups,
    curve: Vec<CurvePoint>,
    image: Option<ImageErrors>,
    picture: Option<image::RgbaImage>,
}

/// Reads the asset back and measures it on pairs and frames that the search never saw.
fn prove(
    request: &FitRequest,
    (scene, mesh): (&Scene, &Mesh),
    fitted: &Fitted,
    written: &Path,
    search_s: f64,
) -> Result<Proof, FitError> {
    let planes = asset::read(written)?.in_unit_space(&mesh.frame);
    let pairs = held_out(mesh, request, HELD_OUT, Purpose::HeldOut);
    let held_out = measure(&planes, &pairs);
    let curve = curve(fitted, &pairs, (planes.len(), &held_out), search_s);
    let mut proof = Proof { held_out, lookups: lookups(&planes, &pairs), curve, image: None, picture: None };
    if let Some(options) = &request.validation {
        let lights = validation_lights(request, &held_out, options.lights);
        let validation = validate((scene, mesh), &planes, &lights, options)?;
        (proof.image, proof.picture) = (Some(validation.errors), Some(validation.comparison));
    }
    Ok(proof)
}

/// Searches planes, or takes those of a file, and bakes them.
fn fit(
    request: &FitRequest,
    mesh: &Mesh,
    pairs: &Pairs,
    progress: &mut dyn FnMut(String),
    (clock, time_s): (&mut Clock, &mut Times),
) -> Result<Fitted, FitError> {
    let texture_size = request.texture_size.unwrap_or(request.effort.texture_size);
    let options = BakeOptions { texture_size, ..BakeOptions::default() };
    if let Some(path) = &request.planes {
        let by_hand = by_hand(request, mesh, pairs, path)?;
        time_s.search = clock.lap();
        let planes = bake(pairs, &by_hand, &BakeOptions { turn: Turn::Fixed, ..options });
        time_s.bake = clock.lap();
        return Ok(Fitted { planes, greedy: Vec::new(), found_at_s: Vec::new() });
    }
    let selection = selection_options(request);
    let candidates = generate(mesh, &CandidateOptions { seed: request.seed, ..request.effort.candidates });
    let judging = request.max_error.map(|target| (target, held_out(mesh, request, JUDGING, Purpose::Judging)));
    let (start, mut found_at_s) = (Instant::now(), Vec::new());
    let selected = select(mesh, pairs, &candidates, &selection, &mut |planes| {
        progress(format!("searching: {} planes", planes.len()));
        found_at_s.push(start.elapsed().as_secs_f64());
        match &judging {
            Some((target, judging))
                if measure(&bake(pairs, planes, &options), judging).shadow_error <= target * TARGET_MARGIN =>
            {
                Verdict::Enough
            }
            _ => Verdict::Continue,
        }
    });
    time_s.search = clock.lap();
    progress(format!("baking {} planes", selected.planes.len()));
    let planes = bake(pairs, &selected.planes, &options);
    let greedy = bake(pairs, &selected.greedy, &BakeOptions { rounds: 1, ..options });
    time_s.bake = clock.lap();
    Ok(Fitted { planes, greedy, found_at_s })
}

/// The rectangles of a plane file, each with the bias that suits it best.
pub(crate) fn by_hand(request: &FitRequest, mesh: &Mesh, pairs: &Pairs, path: &Path) -> Result<Vec<Mask>, AssetError> {
    let placed = asset::read_plane_file(path)?.into_iter().map(|given| {
        let plane = given.rectangle.in_unit_space(&mesh.frame);
        let (bias, _) = best_bias(pairs, &plane, request.effort.selection.texels);
        Mask::open(plane, given.side, bias, 1, 1)
    });
    Ok(placed.collect())
}

/// The preset's options with the user's numbers.
pub(crate) fn selection_options(request: &FitRequest) -> SelectionOptions {
    let mut options = request.effort.selection;
    if request.max_error.is_some() {
        options.min_gain = TARGET_MIN_GAIN;
        options.max_planes = TARGET_MAX_PLANES;
    }
    options.max_planes = request.max_planes.unwrap_or(options.max_planes);
    options
}

fn seed_for(request: &FitRequest, purpose: Purpose) -> u64 {
    hash(request.seed, purpose as u64)
}

fn receiver_options(count: usize, exposure_rays: usize, request: &FitRequest, purpose: Purpose) -> ReceiverOptions {
    ReceiverOptions { count, exposure_rays, seed: seed_for(request, purpose) }
}

/// Pairs that the search does not see.
fn held_out(mesh: &Mesh, request: &FitRequest, counts: [usize; 2], purpose: Purpose) -> Pairs {
    sampled(mesh, request, (counts, EXPOSURE_RAYS[1]), purpose).1
}

/// Receivers and their traced pairs.
pub(crate) fn sampled(
    mesh: &Mesh,
    request: &FitRequest,
    ([receivers, lights], exposure_rays): ([usize; 2], usize),
    purpose: Purpose,
) -> (Receivers, Pairs) {
    let receivers = sample(mesh, &receiver_options(receivers, exposure_rays, request, purpose));
    let lights = request.domain.directions(lights, seed_for(request, purpose));
    let pairs = trace(mesh, &receivers, &lights, request.domain.solid_angle());
    (receivers, pairs)
}

/// The worst held-out light first, then others that neither search nor metrics used.
fn validation_lights(request: &FitRequest, held_out: &Metrics, count: usize) -> Vec<Vec3> {
    let others = request.domain.directions(count, seed_for(request, Purpose::Image));
    let worst = Vec3::from_array(held_out.worst_light.direction);
    let worst = (held_out.worst_light.max > 0.0).then_some(worst);
    worst.into_iter().chain(others).take(count).collect()
}

/// Held-out error after each greedy plane; the last point is the result.
fn curve(fitted: &Fitted, pairs: &Pairs, (planes, result): (usize, &Metrics), seconds: f64) -> Vec<CurvePoint> {
    let none = CurvePoint::new(0, &measure(&[], pairs), 0.0);
    let greedy = (1..planes.min(fitted.greedy.len() + 1)).map(|k| {
        let seconds = fitted.found_at_s.get(k - 1).copied().unwrap_or(seconds);
        CurvePoint::new(k, &measure(&fitted.greedy[..k], pairs), seconds)
    });
    let result = (planes > 0).then(|| CurvePoint::new(planes, result, seconds));
    std::iter::once(none).chain(greedy).chain(result).collect()
}

/// Planes that can cast, per light: mean weighted like the error, and the maximum.
fn lookups(planes: &[BakedPlane], pairs: &Pairs) -> Lookups {
    let (mut sum, mut weight, mut max) = (0.0, 0.0, 0);
    for light in &pairs.lights {
        let active = planes.iter().filter(|b| plane_rows(&b.plane, b.side, light.light).is_some()).count();
        let light_weight: f64 = light.vote.iter().map(|v| f64::from(v.abs())).sum();
        sum += active as f64 * light_weight;
        weight += light_weight;
        max = max.max(active);
    }
    Lookups { mean: if weight > 0.0 { sum / weight } else { 0.0 }, max }
}

/// Box of the receivers in model space; of the model where nothing is seen.
fn receiver_bounds(mesh: &Mesh, receivers: &Receivers) -> Bounds {
    let extent = |points: &mut dyn Iterator<Item = Vec3>| {
        points.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| {
            let p_model = mesh.frame.model_from_unit(p);
            (low.min(p_model), high.max(p_model))
        })
    };
    let (min, max) = if receivers.points.is_empty() {
        extent(&mut mesh.corners.iter().flatten().copied())
    } else {
        extent(&mut receivers.points.iter().copied())
    };
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

fn png(picture: &image::RgbaImage) -> Result<Vec<u8>, image::ImageError> {
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
