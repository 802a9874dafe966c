//! How wrong baked planes are against the traced reference.
//!
//! Visibility has three colours where surfaces let light pass: `|V~-V|` is the mean over them.

use crate::{
    pair_table::{LightRows, PairTable},
    plane::BakedSet,
    shade::{set_rows, visibility},
    visibility::{LightPairs, Pairs, mean},
};
use glam::Vec3;
use rayon::prelude::*;
use serde::Serialize;

/// Errors over a set of pairs; all are shares, 0 = perfect. Where nothing is in shadow all are 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Metrics {
    /// `sum w|V~-V| / sum w(1-V)`; 1 = no better than drawing no shadow.
    pub shadow_error: f64,
    /// `sum w|V~-V| / sum w`: share of the direct light that is wrong.
    pub light_error: f64,
    /// The part of `shadow_error` that is shadow not drawn.
    pub missed: f64,
    /// The part of `shadow_error` that is shadow drawn where there is light.
    #[serde(rename = "false")]
    pub false_: f64,
    /// The lights that come out worst.
    pub worst_light: WorstLight,
    /// Receivers measured.
    pub receivers: usize,
    /// Light directions measured.
    pub lights: usize,
}

/// Per-light error, divided by the mean shadow energy of a light (so a light with hardly any shadow does not win).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct WorstLight {
    /// The largest.
    pub max: f64,
    /// The 95th percentile.
    pub p95: f64,
    /// Unit direction of the largest.
    pub direction: [f32; 3],
}

/// Weighted errors of one light.
#[derive(Clone, Copy, Default)]
pub(crate) struct LightError {
    missed: f64,
    false_: f64,
}

impl LightError {
    fn add(&mut self, weight: f32, arrives: Vec3, predicted: Vec3) {
        let (weight, wrong) = (f64::from(weight), predicted - arrives);
        self.missed += weight * f64::from(mean(wrong.max(Vec3::ZERO)));
        self.false_ += weight * f64::from(mean((-wrong).max(Vec3::ZERO)));
    }

    /// Sums up what `predicted`, the visibility 0..1 of a pair, gets wrong.
    pub(crate) fn of(light: &LightPairs, predicted: impl Fn(usize) -> Vec3) -> Self {
        let mut error = Self::default();
        (0..light.len()).for_each(|i| error.add(light.vote[i].abs(), light.arriving(i), predicted(i)));
        error
    }
}

/// Measures planes with the shader's arithmetic, bilinear taps and all. `section_of` has one entry a receiver.
#[must_use]
pub fn measure(set: &BakedSet, pairs: &Pairs, section_of: &[u32]) -> Metrics {
    collect(pairs, |light| {
        let (rows, lists) = (set_rows(set, light.light), set.lists(light.light));
        LightError::of(light, |i| {
            let list = &lists[section_of[light.receiver[i] as usize] as usize];
            visibility(&set.planes, &rows, list, light.point(i))
        })
    })
}

/// Measures the errors of each light and sums them up.
pub(crate) fn collect(pairs: &Pairs, error_of: impl Fn(&LightPairs) -> LightError + Send + Sync) -> Metrics {
    let errors = pairs.lights.par_iter().map(error_of).collect();
    let lights: Vec<Vec3> = pairs.lights.iter().map(|light| light.light).collect();
    let metrics = from_errors(errors, &lights, (pairs.shadow_weight, pairs.total_weight));
    Metrics { receivers: pairs.receivers, ..metrics }
}

/// The same on the pairs that decided the planes, one table a section, all under the same lights.
#[must_use]
pub fn measure_tables(set: &BakedSet, tables: &[PairTable]) -> Metrics {
    let lights: Vec<Vec3> = tables.first().map_or_else(Vec::new, |t| t.lights.iter().map(|rows| rows.light).collect());
    let of_light = |(k, light): (usize, &Vec3)| {
        let (rows, lists) = (set_rows(set, *light), set.lists(*light));
        let mut error = LightError::default();
        for (table, list) in tables.iter().zip(lists) {
            let LightRows { start, end, .. } = table.lights[k];
            for i in start..end {
                let predicted = visibility(&set.planes, &rows, list, table.point(i));
                error.add(table.vote[i].abs(), table.arriving(i), predicted);
            }
        }
        error
    };
    let errors = lights.par_iter().enumerate().map(of_light).collect();
    let weights = tables.iter().map(PairTable::weights).fold((0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1));
    let receivers = tables.iter().map(|table| table.receivers).sum();
    Metrics { receivers, ..from_errors(errors, &lights, weights) }
}

/// Sums of all lights, with the worst one. Where nothing is in shadow all are 0.
fn from_errors(errors: Vec<LightError>, lights: &[Vec3], (shadow, total): (f64, f64)) -> Metrics {
    let count = lights.len();
    let mut metrics = Metrics { lights: count, ..Metrics::default() };
    if shadow <= 0.0 {
        return metrics;
    }
    let sum = |part: fn(&LightError) -> f64| errors.iter().map(part).sum::<f64>();
    metrics.missed = sum(|e| e.missed) / shadow;
    metrics.false_ = sum(|e| e.false_) / shadow;
    metrics.shadow_error = metrics.missed + metrics.false_;
    metrics.light_error = metrics.shadow_error * shadow / total;
    let mean_shadow = shadow / count as f64;
    let mut by_light: Vec<(f64, Vec3)> =
        errors.iter().zip(lights).map(|(e, l)| ((e.missed + e.false_) / mean_shadow, *l)).collect();
    by_light.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (max, direction) = by_light[count - 1];
    metrics.worst_light = WorstLight { max, p95: by_light[(count - 1) * 95 / 100].0, direction: direction.to_array() };
    metrics
}
