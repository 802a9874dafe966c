//! A fit in memory, small enough to be repeated for every case.

use glam::Vec3;
use rayon::prelude::*;
use shadowfit::effort::Effort;
use shadowfit_solver::{
    budget::BudgetOptions,
    fit::bake,
    lights::LightDomain,
    lists::{ListOptions, assign},
    mesh::{Mesh, Soup},
    metrics::{Metrics, measure},
    pair_table::{PairTable, SampleSize},
    plane::BakedSet,
    receivers::{ReceiverOptions, Receivers, sample},
    sampling::hash,
    search::{Found, SearchOptions, Verdict, search},
    sections::{self, TraceOptions},
    visibility::{Pairs, trace, trace_drawn},
};

/// How a case is fitted.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    pub sections: usize,
    pub domain: LightDomain,
    /// Training receivers of one section, instead of as many as the pairs need.
    pub receivers: Option<usize>,
    pub max_lookups: usize,
    pub seed: u64,
}

impl Default for Settings {
    fn default() -> Self {
        Self { sections: 6, domain: LightDomain::Sphere, receivers: None, max_lookups: 4, seed: 1 }
    }
}

/// Training pairs and lights.
const TRAINING: (usize, usize) = (600_000, 384);

/// Directions of the lists.
const DIRECTIONS: usize = 48;

/// Held-out receivers and lights.
const HELD_OUT: (usize, usize) = (6_000, 101);

/// What a fit leaves behind.
pub struct Fitted {
    pub mesh: Mesh,
    pub set: BakedSet,
    pub section_of: Vec<u32>,
    pub domain: LightDomain,
}

pub fn receivers(mesh: &Mesh, count: usize, seed: u64) -> Receivers {
    sample(mesh, &ReceiverOptions { count, exposure_rays: 16, seed })
}

fn search_options(seed: u64) -> SearchOptions {
    SearchOptions {
        max_planes: 6,
        proposals: 160,
        screening: SampleSize { lights: 96, pairs: 5_000 },
        screening_texels: 32,
        finalists: 8,
        refined: 2,
        scoring: SampleSize { lights: 192, pairs: 20_000 },
        texels: 48,
        refine_steps: 4,
        replace_rounds: 0,
        seed,
    }
}

/// Fits `soup`, which must have an area.
pub fn fit(soup: &Soup, settings: &Settings) -> Fitted {
    let Settings { sections, domain, seed, .. } = *settings;
    let mesh = Mesh::new(soup).expect("the case has an area");
    let directions = domain.directions(DIRECTIONS, hash(seed, 2));
    let (section_of, tables) = match settings.receivers {
        Some(count) => (vec![0; mesh.triangle_count()], vec![whole(&mesh, count, &directions, settings)]),
        None => {
            let pilot = receivers(&mesh, 4_000, hash(seed, 1));
            let pairs = trace(&mesh, &pilot, &domain.directions(48, hash(seed, 1)), domain.solid_angle());
            let units: Vec<u32> = (0..mesh.triangle_count() as u32).collect();
            let section_of = sections::divide(&mesh, &units, (&pilot, &pairs), sections, None);
            let (pairs, lights) = TRAINING;
            let options = TraceOptions { pairs, lights, stride: 4, exposure_rays: 16, seed: hash(seed, 3) };
            let tables = sections::trace(&mesh, &section_of, &directions, domain, &options);
            (section_of, tables)
        }
    };
    let shadow: f64 = tables.iter().map(|table| table.weights().0).sum();
    let lists = ListOptions { max_lookups: settings.max_lookups, grid: 128, rounds: 2, smoothing: 1 };
    let fit_section = |table: &PairTable| {
        let go_on = &mut |_: &[Found]| Verdict::Continue;
        let planes = search(&mesh, table, &search_options(seed), 2e-4 * shadow, go_on).planes;
        assign(table, &planes, &lists)
    };
    let fits: Vec<_> = tables.par_iter().map(fit_section).collect();
    let budget = BudgetOptions { bytes: 1 << 20, byte_gain: 2e-9, ..Effort::balanced().whole.budget };
    let set = bake(&fits, &directions, shadow, &budget);
    Fitted { mesh, set, section_of, domain }
}

/// All pairs of so many receivers; of many only a sparse part.
fn whole(mesh: &Mesh, count: usize, directions: &[Vec3], settings: &Settings) -> PairTable {
    let domain = settings.domain;
    let lights = domain.directions(TRAINING.1, hash(settings.seed, 3));
    let receivers = receivers(mesh, count, hash(settings.seed, 4));
    let stride = (count * TRAINING.1 / 2 / TRAINING.0).max(1);
    PairTable::new(
        &trace_drawn(mesh, &receivers, &lights, domain.solid_angle(), |_, _| 1.0 / stride as f32),
        directions,
    )
}

impl Fitted {
    /// Section of each receiver.
    pub fn sections(&self, receivers: &Receivers) -> Vec<u32> {
        receivers.triangles.iter().map(|&triangle| self.section_of[triangle as usize]).collect()
    }

    /// Pairs that the fit did not see, with the section of each receiver.
    pub fn held_out(&self) -> (Pairs, Vec<u32>) {
        let (count, lights) = HELD_OUT;
        let receivers = receivers(&self.mesh, count, hash(77, 5));
        let lights = self.domain.directions(lights, hash(77, 6));
        let pairs = trace(&self.mesh, &receivers, &lights, self.domain.solid_angle());
        (pairs, self.sections(&receivers))
    }

    pub fn metrics(&self) -> Metrics {
        let (pairs, section_of) = self.held_out();
        measure(&self.set, &pairs, &section_of)
    }

    pub fn error(&self) -> f64 {
        self.metrics().shadow_error
    }
}
