//! What the rows of a table share: held-out pairs, and the training pairs of one division of the model.

use super::table::{Counts, Curve, Point};
use crate::{
    effort::Plan,
    pipeline::{FitRequest, Purpose, seed_for},
    report::Lookups,
    scene::Scene,
};
use glam::Vec3;
use rayon::prelude::*;
use shadowfit_solver::{
    budget::{BudgetOptions, Sizing},
    fit::bake,
    lists::{ListOptions, SectionFit, assign},
    mesh::Mesh,
    metrics::measure,
    pair_table::PairTable,
    plane::{BakedSet, Encoding},
    receivers::Receivers,
    search::{Found, SearchOptions, Verdict, search},
    sections,
    visibility::Pairs,
};

/// What all tables share.
pub(super) struct Bench<'a> {
    pub request: &'a FitRequest,
    pub scene: &'a Scene,
    pub mesh: &'a Mesh,
    /// By which the model is divided.
    pub pilot: (Receivers, Pairs),
    /// Held out.
    pub pairs: Pairs,
    /// Of the same.
    pub receivers: Receivers,
}

impl Bench<'_> {
    /// Share of the light that is blocked.
    pub fn shadow_share(&self) -> f64 {
        let Pairs { shadow_weight, total_weight, .. } = self.pairs;
        if total_weight > 0.0 { shadow_weight / total_weight } else { 0.0 }
    }
}

/// When planes are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Reading {
    /// As the lists of the light's direction say.
    ByLight,
    /// Under all lights.
    Always,
}

/// What of the method can be switched off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Parts {
    pub search: SearchOptions,
    pub lists: ListOptions,
    pub budget: BudgetOptions,
    pub reading: Reading,
    /// Bakes with this bias for all planes instead of the one that each was found with.
    pub bias: Option<f32>,
}

impl Parts {
    /// The whole method.
    pub fn of(plan: &Plan) -> Self {
        let Plan { search, lists, budget, .. } = *plan;
        Self { search, lists, budget, reading: Reading::ByLight, bias: None }
    }
}

/// The training pairs of one division.
#[derive(Clone)]
pub(super) struct Training<'a> {
    bench: &'a Bench<'a>,
    min_gain: f64,
    directions: Vec<Vec3>,
    /// One a section.
    pub tables: Vec<PairTable>,
    /// The section of each held-out receiver.
    section_of: Vec<u32>,
    /// Weight of all blocked pairs.
    shadow: f64,
}

impl<'a> Training<'a> {
    /// Traces the pairs; `section_of` has one entry a triangle of the mesh.
    pub fn new(bench: &'a Bench<'a>, plan: &Plan, section_of: &[u32]) -> Self {
        let Bench { request, mesh, receivers, .. } = bench;
        let directions = request.domain.directions(plan.directions, seed_for(request, Purpose::Directions));
        let tables = sections::trace(mesh, section_of, &directions, request.domain, &plan.trace);
        let shadow = tables.iter().map(|table| table.weights().0).sum();
        let section_of = receivers.triangles.iter().map(|&triangle| section_of[triangle as usize]).collect();
        Self { bench, min_gain: plan.min_gain, directions, tables, section_of, shadow }
    }

    /// The same pairs where planes are read under all lights.
    pub fn undirected(self) -> Self {
        // Whatever the only direction is, it is the nearest.
        let tables = self.tables.into_iter().map(PairTable::undirected).collect();
        Self { directions: vec![Vec3::Y], tables, ..self }
    }

    pub fn counts(&self) -> Counts {
        let lights = self.tables.first().map_or(0, |table| table.lights.len());
        let [receivers, pairs] = [|table: &PairTable| table.receivers, |table: &PairTable| table.len()]
            .map(|count: fn(&PairTable) -> usize| self.tables.iter().map(count).sum());
        Counts { receivers, lights, pairs }
    }

    /// What a plane must lower the weighted error by.
    pub fn min_gain(&self) -> f64 {
        self.min_gain * self.shadow
    }

    /// Planes of each section.
    pub fn search(&self, parts: &Parts) -> Vec<Vec<Found>> {
        let search = |table: &PairTable| {
            search(self.bench.mesh, table, &parts.search, self.min_gain(), &mut |_| Verdict::Continue).planes
        };
        self.tables.par_iter().map(search).collect()
    }

    /// Lists and votes of each section's planes.
    pub fn assign(&self, planes: &[Vec<Found>], parts: &Parts) -> Vec<SectionFit> {
        let assign = |(table, planes): (&PairTable, &Vec<Found>)| {
            let mut planes = planes.clone();
            planes.iter_mut().for_each(|found| found.placed.bias = parts.bias.unwrap_or(found.placed.bias));
            assign(table, &planes, &parts.lists)
        };
        self.tables.par_iter().zip(planes).map(assign).collect()
    }

    pub fn bake(&self, fits: &[SectionFit], parts: &Parts) -> BakedSet {
        bake(fits, &self.directions, self.shadow, &parts.budget)
    }

    /// A set, measured on the held-out pairs.
    pub fn point(&self, set: &BakedSet, seconds: f64) -> Point {
        let pairs = &self.bench.pairs;
        let metrics = measure(set, pairs, &self.section_of);
        let lookups = Lookups::measure(set, pairs, &self.section_of).mean;
        Point::new((set.planes.len(), lookups), &metrics, set.texture_bytes(), seconds)
    }

    /// The encoding that the bake chooses.
    pub fn encoding_note(&self, fits: &[SectionFit], parts: &Parts) -> Option<String> {
        let set = self.bake(fits, parts);
        set.planes.first().map(|baked| format!("chose {}", name(baked.texture.encoding)))
    }

    /// The same planes with textures of the same size, in either encoding.
    pub fn encodings(&self, prefix: &str, fits: &[SectionFit], (parts, sizes): (&Parts, &[usize])) -> Vec<Curve> {
        let curve = |(encoding, size): (Encoding, usize)| {
            let budget =
                BudgetOptions { encoding: Some(encoding), sizing: Sizing::Largest, texture_size: size, ..parts.budget };
            let set = self.bake(fits, &Parts { budget, ..*parts });
            let method = format!("{prefix}{} {size}", name(encoding));
            Curve::new(&method, vec![self.point(&set, 0.0)])
        };
        let both = |size: &usize| [Encoding::Coverage, Encoding::Sdf].map(|encoding| curve((encoding, *size)));
        sizes.iter().flat_map(both).collect()
    }
}

fn name(encoding: Encoding) -> &'static str {
    match encoding {
        Encoding::Coverage => "coverage",
        Encoding::Sdf => "distance fields",
    }
}
