//! The fit itself: from a mesh to a set of baked planes, one line a stage.
//!
//! One section where a few planes explain all shadow, or where the user names a number of planes; else as many as the
//! preset has, each with short lists. A ground is one more section; where planes are few they serve both, the pairs of
//! model and ground being searched in one table.

use crate::{
    asset::{self, AssetError},
    effort::Plan,
    pipeline::{FitRequest, Purpose, held_out, held_out_ground, seed_for},
    report::Times,
    scene::Scene,
};
use glam::Vec3;
use rayon::prelude::*;
use shadowfit_solver::{
    budget::{BudgetOptions, Sizing},
    certificate::Certificate,
    columns::{ColumnOptions, certify_found},
    fit::{Baker, bake},
    ground::{apart, balanced, together},
    halves,
    lists::{ListOptions, SectionFit, assign},
    mesh::Mesh,
    metrics::{Metrics, measure, measure_tables},
    pair_table::{PairTable, SampleSize},
    plane::{BakedSet, Encoding, Ground, PlacedPlane, distinct},
    receivers::{ReceiverOptions, Receivers, sample},
    search::{Found, SearchOptions, Verdict, place, search},
    sections::{self, TraceOptions},
    symmetry::{self, Mirror},
    visibility::{Pairs, trace},
};
use std::{collections::HashMap, time::Instant};

/// Receivers, exposure rays and lights by which a model is divided.
const PILOT: (usize, usize, usize) = (16_384, 16, 64);

/// A model is left whole if as many planes as a list may have leave this share of its shadow unexplained: the border
/// of a texture alone costs half of that.
const WHOLE_ERROR: f64 = 0.03;

/// Receivers and lights on which `--max-error` is decided.
pub(crate) const JUDGING: [usize; 2] = [12_000, 211];

/// `--max-error` aims this much lower: the judging pairs and the held-out ones are different samples.
const TARGET_MARGIN: f64 = 0.98;

/// Smallest gain of a plane while an error is to be reached: below it planes fit noise.
const TARGET_MIN_GAIN: f64 = 5e-4;

/// Most planes where `--max-error` is given without `--max-planes`.
const TARGET_MAX_PLANES: usize = 64;

/// Pairs on which the sets of the curve and of `--max-error` are baked, and their lights.
const CURVE_SAMPLE: SampleSize = SampleSize { lights: 512, pairs: 500_000 };

/// Most texels a side of their textures: distance fields gain little from more.
const CURVE_TEXELS: usize = 64;

/// Shares of the budget that textures may take, so that their atlases stay within it: the first that does. Atlases of
/// hundreds of textures are 95 % full and more, of a dozen 80 %.
const PACKED_SHARES: [f64; 3] = [0.96, 0.9, 0.75];

/// Shares of the budget at which a divided model's error is told.
const CURVE_BUDGETS: [f64; 4] = [1.0 / 4.0, 1.0 / 16.0, 1.0 / 32.0, 1.0 / 64.0];

/// A mirrored model has this many times the sections, and so 4/3 of the pairs in each: held-out error and textures of
/// teapot_three with 1, 3/2 and 2 times the 96 sections 0.0459, 0.0454 and 0.0487, 298, 268 and 345 KiB; of cesium_air
/// 0.0687, 0.0681 and 0.0723, 548, 506 and 577 KiB (seed 7).
const MIRRORED_SECTIONS: (usize, usize) = (3, 2);

/// What search and bake leave behind.
pub(crate) struct Fitted {
    pub set: BakedSet,
    /// The section of each triangle of the scene.
    pub section_of: Vec<u32>,
    /// Smaller sets, each with the seconds into the search at which it was found.
    pub smaller: Vec<(BakedSet, f64)>,
    /// On the pairs that decided the planes.
    pub training: Metrics,
    /// Where asked for.
    pub certificate: Option<Certificate>,
}

/// Planes per section, and the smaller sets of a whole model with the seconds at which they were found.
type Searched = (Vec<Vec<Found>>, Vec<(BakedSet, f64)>);

/// Everything a fit works on.
struct Fit<'a> {
    request: &'a FitRequest,
    mesh: &'a Mesh,
    plan: Plan,
    mirror: Option<Mirror>,
    ground: Option<Ground>,
    traced: Traced,
}

/// What planes are decided by.
struct Traced {
    /// Those of the lists.
    directions: Vec<Vec3>,
    /// One a section, with a mirror one for each two; that of the ground last.
    tables: Vec<PairTable>,
    /// Those of a whole model and of its ground in one, where the same planes serve both.
    both: Option<PairTable>,
    /// Weight of all blocked pairs of the model, or, where they are more, of the ground.
    shadow: f64,
}

/// Fits planes to a mesh; `times` gets the seconds of its stages.
pub(crate) fn fit(
    request: &FitRequest,
    (scene, mesh): (&Scene, &Mesh),
    progress: &mut dyn FnMut(String),
    times: &mut Times,
) -> Result<Fitted, AssetError> {
    let start = Instant::now();
    progress("looking at the model".to_string());
    let (pilot, pilot_pairs) = pilot(request, mesh);
    let ground = request.ground.then(|| Ground::below(mesh));
    let mut plan = plan(request, mesh, &pilot_pairs);
    let mirror = mirror((request, mesh), (&pilot, &pilot_pairs), ground.as_ref(), &mut plan);
    let section_of =
        sections::divide(mesh, &units(scene, mesh), (&pilot, &pilot_pairs), plan.sections, mirror.as_ref());
    times.receivers = start.elapsed().as_secs_f64();

    progress("tracing the reference".to_string());
    let surfaces =
        Surfaces { request, mesh, section_of: &section_of, mirror: mirror.as_ref(), ground: ground.as_ref() };
    let traced = surfaces.traced(&plan);
    times.reference = start.elapsed().as_secs_f64() - times.receivers;

    let fit = Fit { request, mesh, plan, mirror, ground, traced };
    let (searched, smaller) = fit.search(progress)?;
    times.search = start.elapsed().as_secs_f64() - times.receivers - times.reference;

    progress(format!("baking {} planes", searched.iter().map(Vec::len).sum::<usize>()));
    let (half, smaller) = fit.bake(&searched, smaller);
    times.bake = start.elapsed().as_secs_f64() - times.receivers - times.reference - times.search;
    let training = measure_tables(&half, &fit.traced.tables[..half.model_sections()]);
    let smaller = smaller.into_iter().map(|(half, seconds)| (fit.both_halves(half), seconds)).collect();

    let proving = Instant::now();
    let certificate = request.certificate.as_ref().map(|options| {
        progress("proving a bound".to_string());
        fit.certify(&searched[0], options)
    });
    times.certificate = proving.elapsed().as_secs_f64();
    let section_of = section_of_scene(scene, mesh, &section_of);
    Ok(Fitted { set: fit.both_halves(half), section_of, smaller, training, certificate })
}

/// The first look at a model: receivers by which it is divided, and their pairs.
pub(crate) fn pilot(request: &FitRequest, mesh: &Mesh) -> (Receivers, Pairs) {
    trace_pilot(request, mesh, |options| sample(mesh, options))
}

/// A first look at what `sample` gives.
fn trace_pilot(
    request: &FitRequest,
    mesh: &Mesh,
    sample: impl Fn(&ReceiverOptions) -> Receivers,
) -> (Receivers, Pairs) {
    let (count, exposure_rays, lights) = PILOT;
    let seed = seed_for(request, Purpose::Pilot);
    let receivers = sample(&ReceiverOptions { count, exposure_rays, seed });
    let lights = request.domain.directions(lights, seed);
    let pairs = trace(mesh, &receivers, &lights, request.domain.solid_angle());
    (receivers, pairs)
}

/// The preset's numbers with the user's; one section where a quick search shows that it will do.
pub(crate) fn plan(request: &FitRequest, mesh: &Mesh, pilot: &Pairs) -> Plan {
    let effort = &request.effort;
    let counted = request.max_planes.is_some() || request.max_error.is_some();
    let listed = request.max_lookups.is_some() || request.texture_budget.is_some();
    let one_list = request.certificate.is_some() || (counted && !listed);
    let whole = match request.sections {
        _ if request.planes.is_some() => true,
        Some(count) => count == 1,
        None => one_list || is_simple(request, mesh, pilot),
    };
    let mut plan = if whole { effort.whole } else { effort.divided };
    // Where all shadow is on the ground there is nothing to divide.
    let sections = if pilot.shadow_weight > 0.0 { plan.sections } else { 1 };
    plan.sections = request.sections.unwrap_or(sections);
    plan.trace.seed = seed_for(request, Purpose::Training);
    plan.search.seed = request.seed;
    if let Some(search) = &mut plan.ground.search {
        search.seed = request.seed;
        search.max_planes = request.max_planes.map_or(search.max_planes, |planes| search.max_planes.min(planes));
    }
    if request.max_error.is_some() {
        (plan.min_gain, plan.search.max_planes) = (TARGET_MIN_GAIN, TARGET_MAX_PLANES);
    }
    if let Some(planes) = request.max_planes {
        plan.budget.max_planes = planes;
        plan.search.max_planes = if whole { planes } else { plan.search.max_planes.min(planes) };
    }
    plan.lists.max_lookups = request.max_lookups.unwrap_or(plan.lists.max_lookups);
    plan.budget.bytes = request.texture_budget.unwrap_or(plan.budget.bytes);
    plan.budget.texture_size = request.texture_size.unwrap_or(plan.budget.texture_size);
    plan
}

/// The mirror that halves the work: of a divided model whose planes nobody counts.
fn mirror(
    (request, mesh): (&FitRequest, &Mesh),
    pilot: (&Receivers, &Pairs),
    ground: Option<&Ground>,
    plan: &mut Plan,
) -> Option<Mirror> {
    let applies = plan.sections > 1 && request.max_planes.is_none();
    let mirror = applies.then(|| symmetry::find(mesh, pilot, request.domain, ground)).flatten()?;
    if request.sections.is_none() {
        plan.sections = plan.sections * MIRRORED_SECTIONS.0 / MIRRORED_SECTIONS.1;
    }
    Some(mirror)
}

/// What receives shadow.
struct Surfaces<'a> {
    request: &'a FitRequest,
    mesh: &'a Mesh,
    section_of: &'a [u32],
    mirror: Option<&'a Mirror>,
    ground: Option<&'a Ground>,
}

impl Surfaces<'_> {
    /// Directions of the lists and the pairs of each section; with a mirror, of each two.
    fn traced(&self, plan: &Plan) -> Traced {
        let Self { request, mesh, section_of, mirror, ground } = *self;
        let domain = request.domain;
        let lattice = domain.directions(plan.directions, seed_for(request, Purpose::Directions));
        let directions = mirror.map_or(lattice.clone(), |mirror| mirror.closed(&lattice, domain.solid_angle()));
        let tables = sections::trace(mesh, section_of, &directions, domain, &plan.trace);
        let mut tables = match mirror {
            Some(mirror) => halves::folded(tables, mirror, &directions),
            None => tables,
        };
        let mut shadow = tables.iter().map(|table| table.weights().0).sum();
        let mut both = None;
        if let Some(ground) = ground {
            let options = TraceOptions { pairs: plan.ground.pairs, ..plan.trace };
            let table = balanced(ground.trace(mesh, &directions, domain, &options), shadow);
            shadow = table.weights().0.max(shadow);
            both = plan.ground.search.is_none().then(|| together(&tables[0], &table));
            tables.push(match mirror {
                Some(mirror) => halves::folded_by_light(table, mirror, &directions),
                None => table,
            });
        }
        Traced { directions, tables, both, shadow }
    }
}

/// Do as many planes as a list may have explain nearly all shadow of the first look, on the model and on its ground?
fn is_simple(request: &FitRequest, mesh: &Mesh, pilot: &Pairs) -> bool {
    let ground = request.ground.then(|| {
        let ground = Ground::below(mesh);
        (ground, trace_pilot(request, mesh, |options| ground.sample(mesh, options)).1)
    });
    if pilot.shadow_weight <= 0.0 && ground.is_none() {
        return true;
    }
    let plan = request.effort.whole;
    let max_planes = request.max_lookups.unwrap_or(request.effort.divided.lists.max_lookups);
    let mut directions = request.domain.directions(PILOT.2 / 4, request.seed);
    let (mut table, mut shadow) = (PairTable::new(pilot, &directions), pilot.shadow_weight);
    if let Some((_, pairs)) = &ground {
        let on_ground = balanced(PairTable::new(pairs, &directions), shadow);
        (table, shadow) = (together(&table, &on_ground), on_ground.weights().0.max(shadow));
        directions = directions.repeat(2);
    }
    let options = SearchOptions { max_planes, seed: request.seed, replace_rounds: 1, ..plan.search };
    let found = search(mesh, &table.by_loss(), &options, plan.min_gain * shadow, &mut |_| Verdict::Continue);
    let fits = [assign(&table, &found.planes, &ListOptions { max_lookups: max_planes, grid: 128, ..plan.lists })];
    let set = bake(&fits, &directions, shadow, &plan.budget);
    let error = |set: &BakedSet, pairs: &Pairs, section: u32| measure(set, pairs, &vec![section; pairs.receivers]);
    let is_explained = |metrics: Metrics| metrics.shadow_error < WHOLE_ERROR;
    match ground {
        None => is_explained(error(&set, pilot, 0)),
        Some((ground, pairs)) => {
            let set = apart(set, ground);
            is_explained(error(&set, pilot, 0)) && is_explained(error(&set, &pairs, 1))
        }
    }
}

/// For each triangle of the mesh a number that its copies in the scene share.
pub(crate) fn units(scene: &Scene, mesh: &Mesh) -> Vec<u32> {
    let mut numbers = HashMap::new();
    let mut number = |source: &u32| {
        let next = numbers.len() as u32;
        *numbers.entry(scene.origins[*source as usize]).or_insert(next)
    };
    mesh.source.iter().map(&mut number).collect()
}

/// The section of each triangle of the scene; triangles that the mesh leaves out have that of their copies, or 0.
fn section_of_scene(scene: &Scene, mesh: &Mesh, section_of: &[u32]) -> Vec<u32> {
    let by_origin: HashMap<_, u32> = mesh
        .source
        .iter()
        .zip(section_of)
        .map(|(source, section)| (scene.origins[*source as usize], *section))
        .collect();
    scene.origins.iter().map(|origin| by_origin.get(origin).copied().unwrap_or(0)).collect()
}

/// Bytes of the atlases that a set needs.
fn packed_bytes(set: &BakedSet) -> u64 {
    let (textures, _) = distinct(set.planes.iter().map(|baked| &baked.texture));
    let sizes: Vec<[u32; 2]> =
        textures.into_iter().map(|texture| [texture.width as u32, texture.height as u32]).collect();
    asset::atlas::pack(&sizes).map_or(0, |layout| layout.texture_bytes())
}

impl Fit<'_> {
    /// Pairs that have lists of their own.
    fn listed(&self) -> &[PairTable] {
        self.traced.both.as_ref().map_or(&self.traced.tables, std::slice::from_ref)
    }

    /// The directions of their lists.
    fn list_directions(&self) -> Vec<Vec3> {
        self.traced.directions.repeat(if self.traced.both.is_some() { 2 } else { 1 })
    }

    /// A set baked for the lists, with the ground's section behind those of the model.
    fn with_ground(&self, set: BakedSet) -> BakedSet {
        match self.ground {
            Some(ground) if self.traced.both.is_some() => apart(set, ground),
            ground => BakedSet { ground, ..set },
        }
    }

    /// A set of one half as that of both, where there is a mirror.
    fn both_halves(&self, half: BakedSet) -> BakedSet {
        match &self.mirror {
            Some(mirror) => halves::unfolded(half, mirror),
            None => half,
        }
    }

    /// Planes per section, and the smaller sets of a whole model.
    fn search(&self, progress: &mut dyn FnMut(String)) -> Result<Searched, AssetError> {
        let Plan { search: options, min_gain, ground, .. } = &self.plan;
        if let Some(path) = &self.request.planes {
            let rectangles = asset::read_plane_file(path)?;
            let planes: Vec<_> =
                rectangles.iter().map(|given| (given.rectangle.in_unit_space(&self.mesh.frame), given.side)).collect();
            return Ok((vec![place(self.mesh, &self.listed()[0], &planes, options)], Vec::new()));
        }
        if let [table] = self.listed() {
            return Ok(self.search_whole(table, progress));
        }
        let tables = &self.traced.tables;
        progress(format!("searching {} sections", tables.len()));
        let search = |(section, table): (usize, &PairTable)| {
            let is_ground = self.ground.is_some() && section + 1 == tables.len();
            let options = ground.search.as_ref().filter(|_| is_ground).unwrap_or(options);
            let min_gain = min_gain * self.traced.shadow;
            search(self.mesh, &table.by_loss(), options, min_gain, &mut |_| Verdict::Continue).planes
        };
        Ok((tables.par_iter().enumerate().map(search).collect(), Vec::new()))
    }

    fn search_whole(&self, table: &PairTable, progress: &mut dyn FnMut(String)) -> Searched {
        let start = Instant::now();
        let sample = table.sample(CURVE_SAMPLE, self.request.seed);
        let quick = ListOptions { rounds: 1, ..self.plan.lists };
        let budget = &self.plan.budget;
        let texels = BudgetOptions {
            texture_size: budget.texture_size.min(CURVE_TEXELS),
            sizing: Sizing::Largest,
            encoding: budget.encoding.or(Some(Encoding::Sdf)),
            ..*budget
        };
        let (directions, shadow) = (self.list_directions(), self.traced.shadow);
        let bake_prefix =
            |planes: &[Found]| self.with_ground(bake(&[assign(&sample, planes, &quick)], &directions, shadow, &texels));
        let judging = self.request.max_error.map(|target| (target, self.judging()));
        let mut found_at_s = Vec::new();
        let mut judge = |planes: &[Found]| {
            progress(format!("searching: {} planes", planes.len()));
            found_at_s.push(start.elapsed().as_secs_f64());
            match &judging {
                Some((target, surfaces)) => {
                    let set = bake_prefix(planes);
                    let error = |(section, pairs): (u32, &Pairs)| {
                        measure(&set, pairs, &vec![section; pairs.receivers]).shadow_error
                    };
                    let reached = |surface| error(surface) <= target * TARGET_MARGIN;
                    if (0..).zip(surfaces).all(reached) { Verdict::Enough } else { Verdict::Continue }
                }
                None => Verdict::Continue,
            }
        };
        let min_gain = self.plan.min_gain * shadow;
        let selection = search(self.mesh, &table.by_loss(), &self.plan.search, min_gain, &mut judge);
        let count = selection.planes.len();
        let prefixes: Vec<BakedSet> = (1..count).into_par_iter().map(|k| bake_prefix(&selection.greedy[..k])).collect();
        (vec![selection.planes], prefixes.into_iter().zip(found_at_s).collect())
    }

    /// What `--max-error` is decided on: pairs of the whole model, and of the ground.
    fn judging(&self) -> Vec<Pairs> {
        let ground =
            self.ground.map(|ground| held_out_ground((self.mesh, &ground), self.request, JUDGING, Purpose::Judging));
        [held_out(self.mesh, self.request, JUDGING, Purpose::Judging).0].into_iter().chain(ground).collect()
    }

    /// How far the planes of a whole model are from the best ones of a pool, all read everywhere.
    fn certify(&self, searched: &[Found], options: &ColumnOptions) -> Certificate {
        let planes: Vec<PlacedPlane> = searched.iter().map(|found| found.placed).collect();
        certify_found((self.mesh, &self.listed()[0]), &planes, &self.plan.search, options)
    }

    /// The set, and sets of fewer planes or bytes.
    fn bake(&self, searched: &[Vec<Found>], mut smaller: Vec<(BakedSet, f64)>) -> (BakedSet, Vec<(BakedSet, f64)>) {
        let fits: Vec<SectionFit> = self
            .listed()
            .par_iter()
            .zip(searched)
            .map(|(table, planes)| assign(table, planes, &self.plan.lists))
            .collect();
        let budget = &self.plan.budget;
        let directions = self.list_directions();
        let baker = Baker::new(&fits, &directions, self.traced.shadow, budget);
        let within = |share: &f64| self.with_ground(baker.within((budget.bytes as f64 * share) as usize));
        if self.listed().len() > 1 {
            smaller.extend(CURVE_BUDGETS.iter().rev().map(|share| (within(share), 0.0)));
        }
        let [largest, others @ ..] = &PACKED_SHARES;
        let mut set = within(largest);
        for share in others {
            if packed_bytes(&set) <= budget.bytes as u64 {
                break;
            }
            set = within(share);
        }
        (set, smaller)
    }
}
