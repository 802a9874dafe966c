//! Ablation: error against the number of planes, of the method, of it with each part switched off, of baselines, and
//! of shadow maps.
//!
//! All planes meet the same training pairs, the same choice of bias, the same bake, and are measured on the same
//! held-out pairs; textures are those of the bake, before packing. A searched method's row for k planes is its greedy
//! phase's answer for k; its last row is its result, with replaced planes. A baseline's row for k holds the first k
//! planes that it places, or, where a method places other planes for every k, its answer for k.
//!
//! Methods that ask for a tolerance are given each of `TOLERANCES`, and the one is kept that bakes to the smallest
//! training error with all planes: so no baseline loses by a setting.

use crate::{
    asset::{AssetError, files},
    pipeline::{EXPOSURE_RAYS, FitError, FitRequest, HELD_OUT, Purpose, by_hand, sampled, selection_options, stem_of},
    scene,
};
use serde::Serialize;
use shadowfit_solver::{
    bake::{BakeOptions, bake},
    baselines::{Baseline, BaselineOptions},
    candidates::{Candidate, CandidateOptions, generate},
    mesh::Mesh,
    metrics::{Metrics, measure},
    plane::ShadowPlane,
    receivers::Receivers,
    rectangle::Turn,
    selection::{SelectionOptions, Verdict, select},
    shadow_map::{self, EquivalentSize},
    visibility::Pairs,
    votes::{BIAS, Mask, best_bias},
};
use std::{
    fmt::{self, Write as _},
    time::Instant,
};

/// Name and version of the JSON's form.
pub const SCHEMA: &str = "shadowfit.ablation/1";

/// Tolerances of billboards, unit space. Of 0.1, 0.06, 0.03, 0.015 and 0.007, held-out error of 12 billboards, the
/// first is best for the teapot (0.324), the third for the aircraft (0.252); for stochastic ones 0.450 and 0.170.
const TOLERANCES: [f32; 3] = [0.1, 0.03, 0.015];

/// Bytes of a shadow map's texel: one float of depth.
const MAP_TEXEL_BYTES: usize = 4;

/// Numbers of planes that the printed table shows, beside the last of each method.
const SHOWN: [usize; 6] = [1, 2, 3, 4, 6, 8];

/// What of the method can be switched off.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Parts {
    selection: SelectionOptions,
    bake: BakeOptions,
    /// Bakes with this bias for all planes instead of the one that each was found with.
    bias: Option<f32>,
}

/// The method without one of its parts.
struct Variant {
    name: &'static str,
    change: fn(&mut Parts),
}

/// The whole method first. One more part is one more line.
const VARIANTS: [Variant; 7] = [
    Variant { name: "shadowfit", change: |_| {} },
    Variant { name: "without refinement", change: |parts| parts.selection.refine_steps = 0 },
    Variant { name: "without replace", change: |parts| parts.selection.replace_rounds = 0 },
    Variant { name: "without re-bake", change: |parts| parts.bake.rounds = 1 },
    Variant { name: "without smoothing", change: |parts| parts.bake.smoothing = 0 },
    Variant { name: "without turning", change: |parts| parts.bake.turn = Turn::Fixed },
    Variant { name: "without a bias for each plane", change: |parts| parts.bias = Some(BIAS) },
];

/// One row of the table.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Point {
    /// Planes asked for; 0 for a shadow map.
    pub planes: usize,
    /// As [`Metrics::shadow_error`], held out.
    pub shadow_error: f64,
    /// Its part that is shadow not drawn.
    pub missed: f64,
    /// Its part that is shadow drawn where there is light.
    #[serde(rename = "false")]
    pub false_: f64,
    /// One byte a texel of all planes; of a shadow map four, for one light.
    pub texture_bytes: usize,
    /// Placing planes and baking them; of a shadow map drawing all lights' and reading them.
    pub seconds: f64,
}

/// Error against planes of one method.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Curve {
    /// Its name.
    pub method: String,
    /// What was chosen for it.
    pub note: Option<String>,
    /// Rows, fewest planes first; none where it finds no plane.
    pub points: Vec<Point>,
    /// Side of the shadow map that is as good as the last row; `null` outside the sizes measured.
    pub shadow_map_texels: Option<f64>,
}

/// How many pairs, and of what.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Counts {
    /// Surface samples.
    pub receivers: usize,
    /// Light directions.
    pub lights: usize,
    /// Pairs of both that face each other.
    pub pairs: usize,
}

/// All tables of one model.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Ablation {
    /// [`SCHEMA`].
    pub schema: &'static str,
    /// Of the program.
    pub version: &'static str,
    /// The command line.
    pub command: String,
    /// The model.
    pub model: String,
    /// Triangles with an area.
    pub triangles: usize,
    /// Seed of all sampling.
    pub seed: u64,
    /// Directions served.
    pub light_domain: String,
    /// Texels along the longer side of each plane.
    pub texture_size: usize,
    /// What planes and textures are decided on.
    pub training: Counts,
    /// What they are measured on.
    pub held_out: Counts,
    /// Share of the light that is blocked: 0 = no self-shadow, and all errors are 0.
    pub shadow_share: f64,
    /// Parts that the preset does not use, so that there is nothing to switch off.
    pub not_measured: Vec<String>,
    /// Searched methods, baselines, planes placed by hand.
    pub methods: Vec<Curve>,
    /// Shadow maps, smallest first.
    pub shadow_maps: Vec<Curve>,
}

/// What all methods share.
struct Bench<'a> {
    request: &'a FitRequest,
    mesh: &'a Mesh,
    candidates: Vec<Candidate>,
    training: Pairs,
    held_out: (Receivers, Pairs),
    bake: BakeOptions,
    max_planes: usize,
}

/// What a search leaves behind.
struct Searched {
    options: SelectionOptions,
    planes: Vec<Mask>,
    greedy: Vec<Mask>,
    found_at_s: Vec<f64>,
    total_s: f64,
}

/// Measures all methods on a model, and writes `STEM.ablation.csv` and `STEM.ablation.json`.
///
/// # Errors
/// See [`FitError`]; nothing partial is left in the output folder.
pub fn run(request: &FitRequest, progress: &mut dyn FnMut(String)) -> Result<Ablation, FitError> {
    check_outputs(request)?;
    progress(format!("reading {}", request.model.display()));
    let scene = scene::load(&request.model)?;
    let mesh = Mesh::new(&scene.soup).map_err(|source| FitError::Mesh { path: request.model.clone(), source })?;
    progress("tracing the reference".to_string());
    let bench = Bench::new(request, &mesh);
    let by_hand = bench.by_hand()?;
    let shadow_maps = bench.shadow_maps(progress);
    let (mut methods, not_measured) = bench.variants(progress);
    methods.extend(Baseline::ALL.map(|baseline| bench.baseline(baseline, progress)));
    methods.extend(by_hand);
    for curve in &mut methods {
        curve.shadow_map_texels = curve.points.last().and_then(|last| match equivalent(&shadow_maps, last) {
            EquivalentSize::Texels(texels) => Some(texels),
            EquivalentSize::BelowAll | EquivalentSize::AboveAll => None,
        });
    }
    let ablation = bench.ablation(methods, shadow_maps, not_measured);
    write(request, &ablation)?;
    Ok(ablation)
}

/// The paths written: CSV and JSON.
fn outputs(request: &FitRequest) -> [std::path::PathBuf; 2] {
    ["csv", "json"].map(|ending| request.out_dir.join(format!("{}.ablation.{ending}", stem_of(&request.model))))
}

fn check_outputs(request: &FitRequest) -> Result<(), AssetError> {
    for path in outputs(request) {
        if std::iter::once(&request.model).chain(&request.planes).any(|input| files::is_same_file(input, &path)) {
            return Err(AssetError::OverwritesInput { path });
        }
    }
    Ok(())
}

fn write(request: &FitRequest, ablation: &Ablation) -> Result<(), FitError> {
    let [csv, json] = outputs(request);
    let mut batch = files::Batch::default();
    batch.stage(&csv, ablation.csv().as_bytes())?;
    batch.stage(&json, format!("{}\n", serde_json::to_string_pretty(ablation)?).as_bytes())?;
    Ok(batch.commit()?)
}

impl<'a> Bench<'a> {
    fn new(request: &'a FitRequest, mesh: &'a Mesh) -> Self {
        let effort = &request.effort;
        let texture_size = request.texture_size.unwrap_or(effort.texture_size);
        let counts = ([effort.receivers, effort.lights], EXPOSURE_RAYS[0]);
        Self {
            request,
            mesh,
            candidates: generate(mesh, &CandidateOptions { seed: request.seed, ..effort.candidates }),
            training: sampled(mesh, request, counts, Purpose::Training).1,
            held_out: sampled(mesh, request, (HELD_OUT, EXPOSURE_RAYS[1]), Purpose::HeldOut),
            bake: BakeOptions { texture_size, ..BakeOptions::default() },
            max_planes: selection_options(request).max_planes,
        }
    }

    /// Bakes planes and measures them; `placed_s` is what placing them took.
    fn point(&self, planes: usize, masks: &[Mask], options: &BakeOptions, placed_s: f64) -> Point {
        let start = Instant::now();
        let baked = bake(&self.training, masks, options);
        let seconds = placed_s + start.elapsed().as_secs_f64();
        let texture_bytes = baked.iter().map(|b| b.texture.coverage.len()).sum();
        Point::new(planes, &measure(&baked, &self.held_out.1), texture_bytes, seconds)
    }

    /// Planes with the bias and the side that suit each best.
    fn with_biases(&self, planes: &[ShadowPlane]) -> Vec<Mask> {
        let texels = self.request.effort.selection.texels;
        let mask = |plane: &ShadowPlane| {
            let (bias, scored) = best_bias(&self.training, plane, texels);
            Mask::open(*plane, scored.side, bias, 1, 1)
        };
        planes.iter().map(mask).collect()
    }

    /// The method and the method without each part, and the parts that the preset does not use.
    fn variants(&self, progress: &mut dyn FnMut(String)) -> (Vec<Curve>, Vec<String>) {
        let whole = Parts { selection: selection_options(self.request), bake: self.bake, bias: None };
        let (mut curves, mut not_measured) = (Vec::new(), Vec::new());
        let mut searches: Vec<Searched> = Vec::new();
        for Variant { name, change } in VARIANTS {
            let mut parts = whole;
            change(&mut parts);
            if !curves.is_empty() && parts == whole {
                not_measured.push(name.to_string());
                continue;
            }
            progress(name.to_string());
            // Variants of the bake share the search.
            let known = searches.iter().position(|searched| searched.options == parts.selection);
            let index = known.unwrap_or_else(|| {
                searches.push(self.search(&parts.selection));
                searches.len() - 1
            });
            curves.push(self.searched(name, &parts, &searches[index]));
        }
        (curves, not_measured)
    }

    fn search(&self, options: &SelectionOptions) -> Searched {
        let (start, mut found_at_s) = (Instant::now(), Vec::new());
        let selection = select(self.mesh, &self.training, &self.candidates, options, &mut |_| {
            found_at_s.push(start.elapsed().as_secs_f64());
            Verdict::Continue
        });
        let total_s = start.elapsed().as_secs_f64();
        Searched { options: *options, planes: selection.planes, greedy: selection.greedy, found_at_s, total_s }
    }

    fn searched(&self, name: &str, parts: &Parts, searched: &Searched) -> Curve {
        let biased = |masks: &[Mask]| -> Vec<Mask> {
            let mut masks = masks.to_vec();
            masks.iter_mut().for_each(|mask| mask.bias = parts.bias.unwrap_or(mask.bias));
            masks
        };
        let count = searched.planes.len();
        let greedy =
            (1..count).map(|k| self.point(k, &biased(&searched.greedy[..k]), &parts.bake, searched.found_at_s[k - 1]));
        let result = (count > 0).then(|| self.point(count, &biased(&searched.planes), &parts.bake, searched.total_s));
        Curve::new(name, greedy.chain(result).collect())
    }

    fn baseline(&self, baseline: Baseline, progress: &mut dyn FnMut(String)) -> Curve {
        progress(baseline.name().to_string());
        let tolerances: &[f32] = if baseline.has_tolerance() { &TOLERANCES } else { &TOLERANCES[..1] };
        let options = |tolerance| BaselineOptions { count: self.max_planes, seed: self.request.seed, tolerance };
        let tried = tolerances.iter().map(|&tolerance| {
            let (masks, seconds) = self.placed(baseline, &options(tolerance));
            let error = measure(&bake(&self.training, &masks, &self.bake), &self.training).shadow_error;
            (error, tolerance, masks, seconds)
        });
        let Some((_, tolerance, masks, seconds)) = tried.reduce(|a, b| if b.0 < a.0 { b } else { a }) else {
            return Curve::new(baseline.name(), Vec::new());
        };
        let point = |k: usize| {
            if baseline.is_nested() {
                self.point(k, &masks[..k], &self.bake, seconds)
            } else {
                let (masks, seconds) = self.placed(baseline, &BaselineOptions { count: k, ..options(tolerance) });
                self.point(k, &masks, &self.bake, seconds)
            }
        };
        let points = (1..=masks.len()).map(point).collect();
        let note = baseline.has_tolerance().then(|| format!("tolerance {tolerance}"));
        Curve { note, ..Curve::new(baseline.name(), points) }
    }

    /// A baseline's planes and the seconds that they took.
    fn placed(&self, baseline: Baseline, options: &BaselineOptions) -> (Vec<Mask>, f64) {
        let start = Instant::now();
        let masks = self.with_biases(&baseline.planes(self.mesh, options));
        (masks, start.elapsed().as_secs_f64())
    }

    /// The planes of the file, where one is given.
    fn by_hand(&self) -> Result<Option<Curve>, AssetError> {
        let Some(path) = &self.request.planes else { return Ok(None) };
        let start = Instant::now();
        let masks = by_hand(self.request, self.mesh, &self.training, path)?;
        let (placed_s, options) = (start.elapsed().as_secs_f64(), BakeOptions { turn: Turn::Fixed, ..self.bake });
        let points = (1..=masks.len()).map(|k| self.point(k, &masks[..k], &options, placed_s)).collect();
        Ok(Some(Curve { note: Some(path.display().to_string()), ..Curve::new("placed by hand", points) }))
    }

    fn shadow_maps(&self, progress: &mut dyn FnMut(String)) -> Vec<Curve> {
        let map = |size: usize| {
            progress(format!("shadow map {size}"));
            let start = Instant::now();
            let metrics = shadow_map::measure(self.mesh, &self.held_out.0, &self.held_out.1, size);
            let point = Point::new(0, &metrics, size * size * MAP_TEXEL_BYTES, start.elapsed().as_secs_f64());
            let curve = Curve::new(&format!("shadow map {size}"), vec![point]);
            Curve { shadow_map_texels: Some(size as f64), ..curve }
        };
        shadow_map::SIZES.map(map).to_vec()
    }

    fn ablation(&self, methods: Vec<Curve>, shadow_maps: Vec<Curve>, not_measured: Vec<String>) -> Ablation {
        let pairs = &self.held_out.1;
        Ablation {
            schema: SCHEMA,
            version: env!("CARGO_PKG_VERSION"),
            command: self.request.command.clone(),
            model: self.request.model.display().to_string(),
            triangles: self.mesh.triangle_count(),
            seed: self.request.seed,
            light_domain: self.request.domain_text.clone(),
            texture_size: self.bake.texture_size,
            training: Counts::of(&self.training),
            held_out: Counts::of(pairs),
            shadow_share: if pairs.total_weight > 0.0 { pairs.shadow_weight / pairs.total_weight } else { 0.0 },
            not_measured,
            methods,
            shadow_maps,
        }
    }
}

/// The shadow map that is as good as a row.
fn equivalent(shadow_maps: &[Curve], point: &Point) -> EquivalentSize {
    let errors = shadow_maps.iter().flat_map(|curve| curve.points.first()).map(|first| first.shadow_error);
    shadow_map::interpolated(shadow_map::SIZES.into_iter().zip(errors), point.shadow_error)
}

impl Counts {
    fn of(pairs: &Pairs) -> Self {
        Self { receivers: pairs.receivers, lights: pairs.lights.len(), pairs: pairs.len() }
    }
}

impl Point {
    fn new(planes: usize, metrics: &Metrics, texture_bytes: usize, seconds: f64) -> Self {
        let Metrics { shadow_error, missed, false_, .. } = *metrics;
        Self { planes, shadow_error, missed, false_, texture_bytes, seconds }
    }
}

impl Curve {
    fn new(method: &str, points: Vec<Point>) -> Self {
        Self { method: method.to_string(), note: None, points, shadow_map_texels: None }
    }
}

impl Ablation {
    /// The rows of all methods.
    #[must_use]
    pub fn csv(&self) -> String {
        let mut csv = "method,planes,shadow_error,missed,false,texture_bytes,seconds\n".to_string();
        for Curve { method, points, .. } in self.methods.iter().chain(&self.shadow_maps) {
            for Point { planes, shadow_error, missed, false_, texture_bytes, seconds } in points {
                let errors = format!("{shadow_error:.5},{missed:.5},{false_:.5}");
                // Writing to a string cannot fail.
                let _ = writeln!(csv, "{method},{planes},{errors},{texture_bytes},{seconds:.2}");
            }
        }
        csv
    }
}

impl fmt::Display for Ablation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Counts { receivers, lights, .. } = self.held_out;
        writeln!(f, "{}: held-out shadow_error, {receivers} receivers x {lights} lights", self.model)?;
        if self.shadow_share == 0.0 {
            writeln!(f, "no self-shadow: all errors are 0")?;
        }
        write!(f, "{:<30}", "planes")?;
        SHOWN.iter().try_for_each(|k| write!(f, "{k:>7}"))?;
        writeln!(f, " | last: error missed  false     KiB seconds     map")?;
        for curve in &self.methods {
            write!(f, "{:<30}", curve.method)?;
            for k in SHOWN {
                match curve.points.iter().find(|point| point.planes == k) {
                    Some(point) => write!(f, "{:>7.3}", point.shadow_error)?,
                    None => write!(f, "{:>7}", "")?,
                }
            }
            match curve.points.last() {
                Some(last) => {
                    write!(f, " |")?;
                    last.fmt_last(f)?;
                    match equivalent(&self.shadow_maps, last) {
                        EquivalentSize::BelowAll => writeln!(f, " {:>7}", format!("<{}", shadow_map::SIZES[0]))?,
                        EquivalentSize::Texels(texels) => writeln!(f, " {texels:>7.0}")?,
                        EquivalentSize::AboveAll => {
                            writeln!(f, " {:>7}", format!(">{}", shadow_map::SIZES[shadow_map::SIZES.len() - 1]))?
                        }
                    }
                }
                None => writeln!(f, " | no planes")?,
            }
        }
        for curve in &self.shadow_maps {
            write!(f, "{:<72} |", curve.method)?;
            curve.points.iter().try_for_each(|point| point.fmt_last(f))?;
            writeln!(f)?;
        }
        self.not_measured.iter().try_for_each(|name| writeln!(f, "not part of this preset: {name}"))
    }
}

impl Point {
    fn fmt_last(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { planes, shadow_error, missed, false_, texture_bytes, seconds } = self;
        let kib = texture_bytes / 1024;
        write!(f, "{planes:>3}: {shadow_error:>7.3}{missed:>7.3}{false_:>7.3}{kib:>8}{seconds:>8.1}")
    }
}
