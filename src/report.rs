//! The report: one stable JSON object a fit, and the short table for people.

use crate::{scene::Skipped, validation::ImageErrors};
use serde::Serialize;
use shadowfit_solver::{certificate::Certificate, metrics::Metrics};
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
    /// Sections in the asset.
    pub sections: usize,
    /// Textures read per fragment, before early out.
    pub lookups: Lookups,
    /// Bytes of the atlases on the GPU.
    pub texture_bytes: u64,
    /// Errors on receivers and lights that the search never saw, of the files as written.
    pub held_out: Metrics,
    /// Errors on the pairs that decided the textures.
    pub training: Metrics,
    /// Errors of rendered frames; `null` with `--validate none`.
    pub image: Option<ImageErrors>,
    /// Proven bound on the training error of a sample; `null` without `--certificate`.
    pub certificate: Option<Certificate>,
    /// Held-out error after each plane of the greedy phase; the last point is the result itself.
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

/// Textures read per fragment: the length of the list of planes that can cast.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Lookups {
    /// Mean over the light domain.
    pub mean: f64,
    /// Most under any light.
    pub max: usize,
}

/// Error for a number of planes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CurvePoint {
    /// Planes.
    pub planes: usize,
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
    pub fn new(planes: usize, metrics: &Metrics, seconds: f64) -> Self {
        Self { planes, shadow_error: metrics.shadow_error, missed: metrics.missed, false_: metrics.false_, seconds }
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut line = |name: &str, value: String| writeln!(f, "{name:<14}{value}");
        line("model", format!("{} ({} triangles)", self.model, self.triangles))?;
        line("planes", self.planes.to_string())?;
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
