//! The divided model: as the preset divides it, and with the division or a part of it switched off.

use super::{
    Bench, Curve,
    training::{Parts, Training},
};
use crate::{
    effort::Plan,
    fitting::{plan, units},
    pipeline::FitRequest,
};
use glam::Vec3;
use shadowfit_solver::{plane::Encoding, sampling::hash, sections::divide};
use std::{collections::HashMap, time::Instant};

/// Other numbers of sections: none, and as many as one cuts by hand.
const OTHER_COUNTS: [usize; 2] = [1, 3];

/// Texels along the longer side at which both encodings are measured.
const ENCODED_TEXELS: [usize; 3] = [16, 32, 64];

/// Rows of the divided model.
#[derive(Default)]
pub(super) struct Divided {
    /// One point each.
    pub curves: Vec<Curve>,
    /// The same planes with either encoding.
    pub encodings: Vec<Curve>,
    /// Why there is none.
    pub not_measured: Vec<String>,
}

impl Divided {
    /// Runs the whole fit for each division.
    pub fn measure(bench: &Bench, progress: &mut dyn FnMut(String)) -> Self {
        let whole = plan_of(bench, bench.request.sections, bench.request.max_lookups);
        if whole.sections == 1 {
            return Self { not_measured: vec!["sections: the model is left whole".to_string()], ..Self::default() };
        }
        let mut divided = Self::default();
        divided.as_planned(bench, &whole, progress);
        let name = format!("{} sections around random points", whole.sections);
        progress(name.clone());
        let sections = around_random_points(bench, whole.sections);
        divided.curves.push(fitted(&name, bench, &whole, &sections));
        for count in OTHER_COUNTS.into_iter().filter(|count| *count != whole.sections) {
            let name = if count == 1 { "1 section".to_string() } else { format!("{count} sections") };
            progress(name.clone());
            // As long lists as the preset's sections have.
            let plan = plan_of(bench, Some(count), Some(whole.lists.max_lookups));
            divided.curves.push(fitted(&name, bench, &plan, &clusters(bench, count)));
        }
        divided
    }

    /// The preset's division, and variants of its lists and textures.
    fn as_planned(&mut self, bench: &Bench, plan: &Plan, progress: &mut dyn FnMut(String)) {
        let (name, parts) = (format!("{} sections", plan.sections), Parts::of(plan));
        progress(name.clone());
        let training = Training::new(bench, plan, &clusters(bench, plan.sections));
        let start = Instant::now();
        let planes = training.search(&parts);
        let search_s = start.elapsed().as_secs_f64();
        let mut add = |name: &str, training: &Training, parts: &Parts, planes: &[_], search_s: f64| {
            let start = Instant::now();
            let set = training.bake(&training.assign(planes, parts), parts);
            let point = training.point(&set, search_s + start.elapsed().as_secs_f64());
            self.curves.push(Curve::new(name, vec![point]));
        };
        add(&name, &training, &parts, &planes, search_s);
        let mut variant = parts;
        variant.budget.encoding = Some(Encoding::Coverage);
        add(&format!("{name}: coverage only"), &training, &variant, &planes, search_s);
        let mut variant = parts;
        variant.lists.rounds = 0;
        add(&format!("{name}: without re-bake"), &training, &variant, &planes, search_s);
        let fits = training.assign(&planes, &parts);
        let note = training.encoding_note(&fits, &parts);
        self.encodings = training.encodings(&format!("{name}: "), &fits, (&parts, &ENCODED_TEXELS));
        drop(fits);

        let without = format!("{name}: no active lists");
        progress(without.clone());
        let (training, mut parts) = (training.undirected(), parts);
        parts.lists.max_lookups = usize::MAX;
        let start = Instant::now();
        let planes = training.search(&parts);
        add(&without, &training, &parts, &planes, start.elapsed().as_secs_f64());
        self.curves[0].note = note;
    }
}

/// The program's plan for a model with that many sections; of `None`, as it would choose.
fn plan_of(bench: &Bench, sections: Option<usize>, max_lookups: Option<usize>) -> Plan {
    let request = FitRequest { sections, max_lookups, max_planes: None, planes: None, ..bench.request.clone() };
    plan(&request, bench.mesh, &bench.pilot.1)
}

/// The division of the method.
fn clusters(bench: &Bench, count: usize) -> Vec<u32> {
    let (receivers, pairs) = &bench.pilot;
    divide(bench.mesh, &units(bench.scene, bench.mesh), (receivers, pairs), count, None)
}

/// Triangles go to the nearest of `count` random points of the surface.
fn around_random_points(bench: &Bench, count: usize) -> Vec<u32> {
    let points = &bench.pilot.0.points;
    let centres: Vec<Vec3> = (0..count as u64)
        .map(|i| points[(hash(bench.request.seed, i) % points.len().max(1) as u64) as usize])
        .collect();
    let mut section_of_unit = HashMap::new();
    let section = |(unit, [a, b, c]): (u32, &[Vec3; 3])| {
        let middle = (*a + *b + *c) / 3.0;
        let nearest = || {
            let distances = (0..).zip(&centres).map(|(i, centre)| (i, centre.distance_squared(middle)));
            distances.reduce(|a, b| if b.1 < a.1 { b } else { a }).map_or(0, |(i, _)| i)
        };
        *section_of_unit.entry(unit).or_insert_with(nearest)
    };
    units(bench.scene, bench.mesh).into_iter().zip(&bench.mesh.corners).map(section).collect()
}

/// The whole fit with a division.
fn fitted(name: &str, bench: &Bench, plan: &Plan, section_of: &[u32]) -> Curve {
    let (training, parts) = (Training::new(bench, plan, section_of), Parts::of(plan));
    let start = Instant::now();
    let set = training.bake(&training.assign(&training.search(&parts), &parts), &parts);
    Curve::new(name, vec![training.point(&set, start.elapsed().as_secs_f64())])
}
