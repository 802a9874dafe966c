//! The report: one stable JSON object a fit, and the short table for people.

use crate::{scene::Skipped, validation::ImageErrors};
use rayon::prelude::*;
use serde::Serialize;
use shadowfit_solver::{
    certificate::Certificate,
    metrics::{Metrics, measure},
    plane::BakedSet,
    shade::set_rows,
    visibility::{LightPairs, Pairs},
};
use std::fmt;

/// Version of the JSON layout; a change that breaks readers raises the number.
pub const SCHEMA: &str = "shadowfit.report/1";

/// What one fit did and how good the result is.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// [`SCHEMA`].
    pub schema: &'static str,
    /// Version of the program.
    pub version: &'static str,
    /// The input file as given.
    pub model: String,
    /// Triangles that were fitted (with an area, each once).
    pub triangles: usize,
    /// Seed of all sampling.
    pub seed: u64,
    /// Light domain as given.
    pub light_domain: String,
    /// Shadow planes in the asset.
    pub planes: usize,
    /// Sections of the model.
    pub sections: usize,
    /// Textures read per fragment, before early out.
    pub lookups: Lookups,
    /// Bytes of the atlases on the GPU.
    pub texture_bytes: u64,
    /// Errors on receivers and lights that the search never saw, of the files as written.
    pub held_out: Metrics,
    /// The same of the ground's shadow, and the planes of its section; `null` without `--ground`.
    pub ground: Option<GroundReport>,
    /// Errors on the model's pairs that decided the textures.
    pub training: Metrics,
    /// Errors of rendered frames; `null` with `--validate none`.
    pub image: Option<ImageErrors>,
    /// Proven bound on the training error of a sample; `null` without `--certificate`.
    pub certificate: Option<Certificate>,
    /// Held-out error of smaller sets: fewer planes of a whole model, fewer bytes of a divided one. The last point is
    /// the result itself.
    pub curve: Vec<CurvePoint>,
    /// Seconds per stage.
    pub time_s: Times,
    /// Largest resident set of the process; `null` where the system does not tell.
    pub peak_memory_bytes: Option<u64>,
    /// Parts of the file that the fit left out.
    pub skipped: Vec<Skipped>,
    /// The error asked for with `--max-error`.
    pub max_error: Option<f64>,
    /// The command that made this.
    pub command: String,
    /// Files written, beside this one.
    pub files: Vec<String>,
}

impl Report {
    /// The larger of the held-out errors of the model and of the ground.
    #[must_use]
    pub fn worst_error(&self) -> f64 {
        self.ground
            .map_or(self.held_out.shadow_error, |ground| ground.held_out.shadow_error.max(self.held_out.shadow_error))
    }
}

/// Textures read per fragment before early out: the planes that can cast in the list of its section.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Lookups {
    /// Mean over the surface and the light domain, weighted like the error.
    pub mean: f64,
    /// Most anywhere under any light.
    pub max: usize,
}

impl Lookups {
    /// Counts what the pairs read; `section_of` has one entry a receiver.
    #[must_use]
    pub fn measure(set: &BakedSet, pairs: &Pairs, section_of: &[u32]) -> Self {
        let of_light = |light: &LightPairs| {
            let rows = set_rows(set, light.light);
            let casting = |list: &Vec<u32>| list.iter().filter(|&&plane| rows[plane as usize].is_some()).count();
            let read: Vec<usize> = set.lists(light.light).iter().map(casting).collect();
            let (mut sum, mut weight, mut max) = (0.0, 0.0, 0);
            for (&receiver, vote) in light.receiver.iter().zip(&light.vote) {
                let (count, vote) = (read[section_of[receiver as usize] as usize], f64::from(vote.abs()));
                (sum, weight, max) = (sum + count as f64 * vote, weight + vote, max.max(count));
            }
            (sum, weight, max)
        };
        let lights: Vec<_> = pairs.lights.par_iter().map(of_light).collect();
        let (sum, weight, max) = lights.iter().fold((0.0, 0.0, 0), |a, b| (a.0 + b.0, a.1 + b.1, a.2.max(b.2)));
        Self { mean: if weight > 0.0 { sum / weight } else { 0.0 }, max }
    }
}

/// How good the shadow on the ground is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct GroundReport {
    /// Errors on receivers and lights that the search never saw, of the files as written.
    #[serde(flatten)]
    pub held_out: Metrics,
    /// Planes of its section.
    pub planes: usize,
    /// Textures read per fragment of it.
    pub lookups: Lookups,
}

impl GroundReport {
    /// Measures the ground's section on pairs of the ground.
    #[must_use]
    pub fn measure(set: &BakedSet, pairs: &Pairs, section: u32) -> Self {
        let section_of = vec![section; pairs.receivers];
        Self {
            held_out: measure(set, pairs, &section_of),
            planes: set.sections[section as usize].len(),
            lookups: Lookups::measure(set, pairs, &section_of),
        }
    }
}

/// Error for a number of planes and bytes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CurvePoint {
    /// Planes.
    pub planes: usize,
    /// Bytes of their textures, one a texel, before they are packed; shared ones count once.
    pub texture_bytes: usize,
    /// Held out.
    pub shadow_error: f64,
    /// Part of it: shadow not drawn.
    pub missed: f64,
    /// Part of it: shadow drawn where there is light.
    #[serde(rename = "false")]
    pub false_: f64,
    /// Seconds from the start of the search until these planes were found.
    pub seconds: f64,
}

/// Seconds of wall time per stage.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Times {
    /// Reading the model.
    pub load: f64,
    /// Building the BVH.
    pub bvh: f64,
    /// Sampling receivers and their exposure.
    pub receivers: f64,
    /// Tracing pairs.
    pub reference: f64,
    /// Choosing planes.
    pub search: f64,
    /// Baking textures.
    pub bake: f64,
    /// Proving the bound.
    pub certificate: f64,
    /// Writing files.
    pub write: f64,
    /// Reading them back, held-out errors, frames.
    pub validate: f64,
    /// All of it.
    pub total: f64,
}

impl CurvePoint {
    /// A point from measured errors.
    #[must_use]
    pub fn new(set: &BakedSet, metrics: &Metrics, seconds: f64) -> Self {
        let Metrics { shadow_error, missed, false_, .. } = *metrics;
        let texture_bytes = set.texture_bytes();
        Self { planes: set.planes.len(), texture_bytes, shadow_error, missed, false_, seconds }
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut line = |name: &str, value: String| writeln!(f, "{name:<14}{value}");
        line("model", format!("{} ({} triangles)", self.model, self.triangles))?;
        let sections = if self.sections > 1 { format!(" in {} sections", self.sections) } else { String::new() };
        line("planes", format!("{}{sections}", self.planes))?;
        line("lookups", format!("{:.2} mean, {} max", self.lookups.mean, self.lookups.max))?;
        let held = &self.held_out;
        if held.shadow_error == 0.0 && self.planes == 0 && self.training.shadow_error == 0.0 {
            line("shadow_error", "0 (no self-shadow)".to_string())?;
        } else {
            let (error, missed, false_) = (held.shadow_error, held.missed, held.false_);
            line("shadow_error", format!("{error:.4} held out = {missed:.4} missed + {false_:.4} false"))?;
            let [x, y, z] = held.worst_light.direction;
            line("worst light", format!("{:.4} from ({x:.3}, {y:.3}, {z:.3})", held.worst_light.max))?;
        }
        if let Some(GroundReport { held_out, planes, lookups }) = &self.ground {
            let (error, missed, false_) = (held_out.shadow_error, held_out.missed, held_out.false_);
            let read = format!("{planes} planes, {:.2} read, {} max", lookups.mean, lookups.max);
            line("ground", format!("{error:.4} held out = {missed:.4} missed + {false_:.4} false ({read})"))?;
        }
        if let Some(c) = &self.certificate {
            let (found, bound, gap) = (c.found, c.lower_bound, c.gap);
            let about = format!("{} planes of a pool of {}, {} training pairs", c.planes, c.pool, c.pairs);
            line("certificate", format!("{found:.4} found, {bound:.4} proven bound, gap {gap:.4} ({about})"))?;
        }
        match &self.image {
            None => line("image", "not validated".to_string())?,
            Some(image) => {
                let flip = image.flip_mean.map_or(String::new(), |flip| format!(", FLIP {flip:.4}"));
                let views = format!("{} frames of {} px", image.frames, image.size_px);
                line(
                    "image error",
                    format!("{:.4} of covered pixels{flip} ({views}, {})", image.mask_error, image.renderer),
                )?;
            }
        }
        line("texture", format!("{:.1} KiB", self.texture_bytes as f64 / 1024.0))?;
        let t = &self.time_s;
        let reference = t.bvh + t.receivers + t.reference;
        line(
            "seconds",
            format!(
                "{:.1} total: load {:.2}, reference {reference:.2}, search {:.2}, bake {:.2}, write {:.2}, validate {:.2}",
                t.total, t.load, t.search, t.bake, t.write, t.validate
            ),
        )?;
        for skipped in &self.skipped {
            line("note", format!("{} x {}: {}", skipped.count, skipped.what, skipped.why))?;
        }
        for (i, file) in self.files.iter().enumerate() {
            line(if i == 0 { "files" } else { "" }, file.clone())?;
        }
        Ok(())
    }
}
