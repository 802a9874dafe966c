//! Ablation: error against the number of planes, of the method, of it with each part switched off, of baselines, and
//! of shadow maps; then of the divided model, and of both encodings of textures.
//!
//! All planes of a whole model meet the same training pairs, the same choice of lists, the same bake, and are measured
//! on the same held-out pairs; textures are those of the bake, before packing. A searched method's row for k planes is
//! its greedy phase's answer for k; its last row is its result, with replaced planes. A baseline's row for k holds the
//! first k planes that it places, or, where a method places other planes for every k, its answer for k. Their
//! rectangles are made tight and their biases chosen as the search does it.
//!
//! Methods that ask for a tolerance are given each of `TOLERANCES`, and the one is kept that bakes to the smallest
//! training error with all planes: so no baseline loses by a setting.

mod divided;
mod table;
mod training;

pub use table::{Ablation, Counts, Curve, Point, SCHEMA};

use crate::{
    asset::{self, AssetError, files},
    effort::Plan,
    fitting,
    pipeline::{FitError, FitRequest, HELD_OUT, Purpose, held_out, stem_of},
    scene,
};
use divided::Divided;
use shadowfit_solver::{
    baselines::{Baseline, BaselineOptions},
    metrics::measure_tables,
    plane::Encoding,
    search::{BIAS, Found, SearchOptions, Selection, Verdict, place, place_loosely, search},
    shadow_map::{self, EquivalentSize},
    visibility::Pairs,
};
use std::time::Instant;
use training::{Bench, Parts, Reading, Training};

/// Tolerances of billboards, unit space. Of 0.1, 0.06, 0.03, 0.015 and 0.007, held-out error of 12 billboards, the
/// first is best for the teapot (0.324), the third for the aircraft (0.252); for stochastic ones 0.450 and 0.170.
const TOLERANCES: [f32; 3] = [0.1, 0.03, 0.015];

/// Bytes of a shadow map's texel: one float of depth.
const MAP_TEXEL_BYTES: usize = 4;

/// Texels along the longer side at which both encodings are measured on a whole model.
const ENCODED_TEXELS: [usize; 4] = [32, 64, 128, 256];

/// The method without one of its parts.
struct Variant {
    name: &'static str,
    change: fn(&mut Parts),
}

/// The whole method first. One more part is one more line.
const VARIANTS: [Variant; 9] = [
    Variant { name: "shadowfit", change: |_| {} },
    Variant { name: "without refinement", change: |parts| parts.search.refine_steps = 0 },
    Variant { name: "without replace", change: |parts| parts.search.replace_rounds = 0 },
    Variant { name: "plus a replace round", change: |parts| parts.search.replace_rounds += 1 },
    Variant { name: "without re-bake", change: |parts| parts.lists.rounds = 0 },
    Variant { name: "without smoothing", change: |parts| (parts.lists.smoothing, parts.budget.smoothing) = (0, 0) },
    Variant { name: "without active lists", change: |parts| parts.reading = Reading::Always },
    Variant { name: "without a bias for each plane", change: |parts| parts.bias = Some(BIAS) },
    Variant { name: "coverage only", change: |parts| parts.budget.encoding = Some(Encoding::Coverage) },
];

/// What a search leaves behind.
struct Searched {
    options: SearchOptions,
    reading: Reading,
    selection: Selection,
    found_at_s: Vec<f64>,
    total_s: f64,
}

/// The whole model as one section.
struct Whole<'a> {
    bench: &'a Bench<'a>,
    /// With lists for each direction of light, and with one for all.
    trainings: [Training<'a>; 2],
    parts: Parts,
}

/// Measures all methods on a model, and writes `STEM.ablation.csv` and `STEM.ablation.json`.
///
/// # Errors
/// See [`FitError`]; nothing partial is left in the output folder.
pub fn run(request: &FitRequest, progress: &mut dyn FnMut(String)) -> Result<Ablation, FitError> {
    check_outputs(request)?;
    progress(format!("reading {}", request.model.display()));
    let scene = scene::load(&request.model)?;
    let mesh = scene.mesh().map_err(|source| FitError::Mesh { path: request.model.clone(), source })?;
    progress("tracing the reference".to_string());
    let (pairs, receivers) = held_out(&mesh, request, HELD_OUT, Purpose::HeldOut);
    let pilot = fitting::pilot(request, &mesh);
    let bench = Bench { request, scene: &scene, mesh: &mesh, pilot, pairs, receivers };
    let whole = Whole::new(&bench);
    let by_hand = whole.by_hand()?;
    let shadow_maps = shadow_maps(&bench, progress);
    let (mut methods, mut encodings, mut not_measured) = whole.variants(progress);
    methods.extend(Baseline::ALL.map(|baseline| whole.baseline(baseline, progress)));
    methods.extend(by_hand);
    let (training, texture_size) = (whole.trainings[0].counts(), whole.parts.budget.texture_size);
    drop(whole);
    let divided = Divided::measure(&bench, progress);
    not_measured.extend(divided.not_measured);
    encodings.extend(divided.encodings);
    let mut ablation = Ablation {
        schema: SCHEMA,
        version: env!("CARGO_PKG_VERSION"),
        command: request.command.clone(),
        model: request.model.display().to_string(),
        triangles: mesh.triangle_count(),
        seed: request.seed,
        light_domain: request.domain_text.clone(),
        texture_size,
        training,
        held_out: counts(&bench.pairs),
        shadow_share: bench.shadow_share(),
        not_measured,
        methods,
        divided: divided.curves,
        encodings,
        shadow_maps,
    };
    ablation.find_equivalent_maps();
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

fn counts(pairs: &Pairs) -> Counts {
    Counts { receivers: pairs.receivers, lights: pairs.lights.len(), pairs: pairs.len() }
}

fn shadow_maps(bench: &Bench, progress: &mut dyn FnMut(String)) -> Vec<Curve> {
    let map = |size: usize| {
        progress(format!("shadow map {size}"));
        let start = Instant::now();
        let metrics = shadow_map::measure(bench.mesh, &bench.receivers, &bench.pairs, size);
        let seconds = start.elapsed().as_secs_f64();
        // Every fragment reads the map once.
        let point = Point::new((0, 1.0), &metrics, size * size * MAP_TEXEL_BYTES, seconds);
        Curve::new(&format!("shadow map {size}"), vec![point])
    };
    shadow_map::SIZES.map(map).to_vec()
}

/// The plan of a whole model.
fn whole_plan(bench: &Bench) -> Plan {
    let request = FitRequest { sections: Some(1), ..bench.request.clone() };
    fitting::plan(&request, bench.mesh, &bench.pilot.1)
}

impl<'a> Whole<'a> {
    fn new(bench: &'a Bench<'a>) -> Self {
        let plan = whole_plan(bench);
        let by_light = Training::new(bench, &plan, &vec![0; bench.mesh.triangle_count()]);
        let always = by_light.clone().undirected();
        Self { bench, trainings: [by_light, always], parts: Parts::of(&plan) }
    }

    fn training(&self, reading: Reading) -> &Training<'a> {
        &self.trainings[usize::from(reading == Reading::Always)]
    }

    /// Bakes planes and measures them; `placed_s` is what placing them took.
    fn point(&self, planes: &[Found], parts: &Parts, placed_s: f64) -> Point {
        let (start, training) = (Instant::now(), self.training(parts.reading));
        let set = training.bake(&training.assign(&[planes.to_vec()], parts), parts);
        let seconds = placed_s + start.elapsed().as_secs_f64();
        Point { planes: planes.len(), ..training.point(&set, seconds) }
    }

    /// The method and the method without each part; the method's planes with either encoding; and the parts that the
    /// preset does not use.
    fn variants(&self, progress: &mut dyn FnMut(String)) -> (Vec<Curve>, Vec<Curve>, Vec<String>) {
        let (mut curves, mut not_measured) = (Vec::new(), Vec::new());
        let mut searches: Vec<Searched> = Vec::new();
        for Variant { name, change } in VARIANTS {
            let mut parts = self.parts;
            change(&mut parts);
            if !curves.is_empty() && parts == self.parts {
                not_measured.push(name.to_string());
                continue;
            }
            progress(name.to_string());
            // Variants of the bake share the search.
            let is_same = |s: &Searched| s.options == parts.search && s.reading == parts.reading;
            let index = searches.iter().position(is_same).unwrap_or_else(|| {
                searches.push(self.search(&parts));
                searches.len() - 1
            });
            curves.push(self.searched(name, &parts, &searches[index]));
        }
        progress("encodings".to_string());
        let (training, planes) = (self.training(Reading::ByLight), &searches[0].selection.planes);
        let fits = training.assign(std::slice::from_ref(planes), &self.parts);
        curves[0].note = training.encoding_note(&fits, &self.parts);
        let encodings = training.encodings("", &fits, (&self.parts, &ENCODED_TEXELS));
        (curves, encodings, not_measured)
    }

    fn search(&self, parts: &Parts) -> Searched {
        let (start, mut found_at_s) = (Instant::now(), Vec::new());
        let training = self.training(parts.reading);
        let mut judge = |_: &[Found]| {
            found_at_s.push(start.elapsed().as_secs_f64());
            Verdict::Continue
        };
        let selection = search(self.bench.mesh, &training.tables[0], &parts.search, training.min_gain(), &mut judge);
        let total_s = start.elapsed().as_secs_f64();
        Searched { options: parts.search, reading: parts.reading, selection, found_at_s, total_s }
    }

    fn searched(&self, name: &str, parts: &Parts, searched: &Searched) -> Curve {
        let Searched { selection: Selection { planes, greedy, .. }, found_at_s, total_s, .. } = searched;
        let greedy = (1..planes.len()).map(|k| self.point(&greedy[..k], parts, found_at_s[k - 1]));
        let result = (!planes.is_empty()).then(|| self.point(planes, parts, *total_s));
        Curve::new(name, greedy.chain(result).collect())
    }

    fn baseline(&self, baseline: Baseline, progress: &mut dyn FnMut(String)) -> Curve {
        progress(baseline.name().to_string());
        let tolerances: &[f32] = if baseline.has_tolerance() { &TOLERANCES } else { &TOLERANCES[..1] };
        let (count, seed) = (self.parts.search.max_planes, self.bench.request.seed);
        let options = |tolerance| BaselineOptions { count, seed, tolerance };
        let training = self.training(Reading::ByLight);
        let tried = tolerances.iter().map(|&tolerance| {
            let (planes, seconds) = self.placed(baseline, &options(tolerance));
            let set = training.bake(&training.assign(std::slice::from_ref(&planes), &self.parts), &self.parts);
            (measure_tables(&set, &training.tables).shadow_error, tolerance, planes, seconds)
        });
        let Some((_, tolerance, planes, seconds)) = tried.reduce(|a, b| if b.0 < a.0 { b } else { a }) else {
            return Curve::new(baseline.name(), Vec::new());
        };
        let point = |k: usize| {
            if baseline.is_nested() {
                self.point(&planes[..k], &self.parts, seconds)
            } else {
                let (planes, seconds) = self.placed(baseline, &BaselineOptions { count: k, ..options(tolerance) });
                self.point(&planes, &self.parts, seconds)
            }
        };
        let points = (1..=planes.len()).map(point).collect();
        let note = baseline.has_tolerance().then(|| format!("tolerance {tolerance}"));
        Curve { note, ..Curve::new(baseline.name(), points) }
    }

    /// A baseline's planes and the seconds that they took.
    fn placed(&self, baseline: Baseline, options: &BaselineOptions) -> (Vec<Found>, f64) {
        let (start, table) = (Instant::now(), &self.training(Reading::ByLight).tables[0]);
        let planes = baseline.planes(self.bench.mesh, options);
        let found = place_loosely(self.bench.mesh, table, &planes, &self.parts.search);
        (found, start.elapsed().as_secs_f64())
    }

    /// The planes of the file, where one is given.
    fn by_hand(&self) -> Result<Option<Curve>, AssetError> {
        let Bench { request, mesh, .. } = self.bench;
        let Some(path) = &request.planes else { return Ok(None) };
        let start = Instant::now();
        let given = asset::read_plane_file(path)?;
        let rectangles: Vec<_> =
            given.iter().map(|given| (given.rectangle.in_unit_space(&mesh.frame), given.side)).collect();
        let planes = place(mesh, &self.training(Reading::ByLight).tables[0], &rectangles, &self.parts.search);
        let placed_s = start.elapsed().as_secs_f64();
        let points = (1..=planes.len()).map(|k| self.point(&planes[..k], &self.parts, placed_s)).collect();
        Ok(Some(Curve { note: Some(path.display().to_string()), ..Curve::new("placed by hand", points) }))
    }
}

impl Ablation {
    /// For each method the shadow map that is as good as its last row.
    fn find_equivalent_maps(&mut self) {
        let maps = self.shadow_maps.clone();
        for curve in self.methods.iter_mut().chain(&mut self.divided).chain(&mut self.encodings) {
            curve.shadow_map_texels = curve.points.last().and_then(|last| match table::equivalent(&maps, last) {
                EquivalentSize::Texels(texels) => Some(texels),
                EquivalentSize::BelowAll | EquivalentSize::AboveAll => None,
            });
        }
        for (curve, size) in self.shadow_maps.iter_mut().zip(shadow_map::SIZES) {
            curve.shadow_map_texels = Some(size as f64);
        }
    }
}
