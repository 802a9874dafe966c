//! How wrong baked planes are against the traced reference.

use crate::{
    plane::BakedPlane,
    shade::{plane_rows, visibility},
    visibility::{LightPairs, Pairs},
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
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct LightError {
    missed: f64,
    false_: f64,
}

impl LightError {
    /// Sums up what `predicted`, the visibility 0..1 of a pair, gets wrong.
    pub(crate) fn of(light: &LightPairs, predicted: impl Fn(usize) -> f32) -> Self {
        let mut error = Self::default();
        for (i, &vote) in light.vote.iter().enumerate() {
            let (predicted, vote) = (f64::from(predicted(i)), f64::from(vote));
            if vote > 0.0 {
                error.missed += vote * predicted;
            } else {
                error.false_ -= vote * (1.0 - predicted);
            }
        }
        error
    }
}

/// Measures `planes` with the shader's arithmetic, bilinear taps and all.
#[must_use]
pub fn measure(planes: &[BakedPlane], pairs: &Pairs) -> Metrics {
    collect(pairs, |light| {
        let rows: Vec<_> = planes.iter().map(|b| plane_rows(&b.plane, b.side, light.light)).collect();
        LightError::of(light, |i| visibility(planes, &rows, light.point(i)))
    })
}

/// Measures the errors of each light and sums them up.
pub(crate) fn collect(pairs: &Pairs, error_of: impl Fn(&LightPairs) -> LightError + Send + Sync) -> Metrics {
    let count = pairs.lights.len();
    let mut metrics = Metrics { receivers: pairs.receivers, lights: count, ..Metrics::default() };
    if pairs.shadow_weight <= 0.0 {
        return metrics;
    }
    let errors: Vec<LightError> = pairs.lights.par_iter().map(error_of).collect();
    let sum = |part: fn(&LightError) -> f64| errors.iter().map(part).sum::<f64>();
    metrics.missed = sum(|e| e.missed) / pairs.shadow_weight;
    metrics.false_ = sum(|e| e.false_) / pairs.shadow_weight;
    metrics.shadow_error = metrics.missed + metrics.false_;
    metrics.light_error = metrics.shadow_error * pairs.shadow_weight / pairs.total_weight;
    let mean_shadow = pairs.shadow_weight / count as f64;
    let mut by_light: Vec<(f64, Vec3)> =
        errors.iter().zip(&pairs.lights).map(|(e, l)| ((e.missed + e.false_) / mean_shadow, l.light)).collect();
    by_light.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (max, direction) = by_light[count - 1];
    metrics.worst_light = WorstLight { max, p95: by_light[(count - 1) * 95 / 100].0, direction: direction.to_array() };
    metrics
}
