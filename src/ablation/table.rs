//! The tables of an ablation: JSON, CSV and text.

use serde::Serialize;
use shadowfit_solver::{
    metrics::Metrics,
    shadow_map::{self, EquivalentSize},
};
use std::fmt::{self, Write as _};

/// Name and version of the JSON's form.
pub const SCHEMA: &str = "shadowfit.ablation/1";

/// Numbers of planes that the printed table shows, beside the last of each method.
const SHOWN: [usize; 6] = [1, 2, 3, 4, 6, 8];

/// One row of the table.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Point {
    /// Planes asked for; of a divided model those kept; 0 for a shadow map.
    pub planes: usize,
    /// Textures read per fragment before early out, mean.
    pub lookups: f64,
    /// As [`Metrics::shadow_error`], held out.
    pub shadow_error: f64,
    /// Its part that is shadow not drawn.
    pub missed: f64,
    /// Its part that is shadow drawn where there is light.
    #[serde(rename = "false")]
    pub false_: f64,
    /// One byte a texel of all planes; of a shadow map four, for one light.
    pub texture_bytes: usize,
    /// Placing planes and baking them; of a shadow map drawing all lights' and reading them; 0 where rows differ only
    /// in their textures.
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
    /// Most texels along the longer side of each plane.
    pub texture_size: usize,
    /// What planes and textures of the whole model are decided on.
    pub training: Counts,
    /// What they are measured on.
    pub held_out: Counts,
    /// Share of the light that is blocked: 0 = no self-shadow, and all errors are 0.
    pub shadow_share: f64,
    /// Parts that are not used here, so that there is nothing to switch off.
    pub not_measured: Vec<String>,
    /// Searched methods, baselines, planes placed by hand: the whole model.
    pub methods: Vec<Curve>,
    /// The divided model, one row each.
    pub divided: Vec<Curve>,
    /// The method's planes with textures all of a size, in either encoding.
    pub encodings: Vec<Curve>,
    /// Shadow maps, smallest first.
    pub shadow_maps: Vec<Curve>,
}

/// The shadow map that is as good as a row.
pub(super) fn equivalent(shadow_maps: &[Curve], point: &Point) -> EquivalentSize {
    let errors = shadow_maps.iter().flat_map(|curve| curve.points.first()).map(|first| first.shadow_error);
    shadow_map::interpolated(shadow_map::SIZES.into_iter().zip(errors), point.shadow_error)
}

impl Point {
    /// A row from measured errors.
    pub(super) fn new((planes, lookups): (usize, f64), metrics: &Metrics, texture_bytes: usize, seconds: f64) -> Self {
        let Metrics { shadow_error, missed, false_, .. } = *metrics;
        Self { planes, lookups, shadow_error, missed, false_, texture_bytes, seconds }
    }

    fn fmt_last(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { planes, lookups, shadow_error, missed, false_, texture_bytes, seconds } = self;
        let kib = texture_bytes / 1024;
        write!(f, "{planes:>6}{lookups:>8.2}{shadow_error:>7.3}{missed:>7.3}{false_:>7.3}{kib:>8}{seconds:>8.1}")
    }
}

impl Curve {
    pub(super) fn new(method: &str, points: Vec<Point>) -> Self {
        Self { method: method.to_string(), note: None, points, shadow_map_texels: None }
    }
}

impl Ablation {
    fn curves(&self) -> impl Iterator<Item = &Curve> {
        self.methods.iter().chain(&self.divided).chain(&self.encodings).chain(&self.shadow_maps)
    }

    /// The rows of all methods.
    #[must_use]
    pub fn csv(&self) -> String {
        let mut csv = "method,planes,lookups,shadow_error,missed,false,texture_bytes,seconds\n".to_string();
        for Curve { method, points, .. } in self.curves() {
            for Point { planes, lookups, shadow_error, missed, false_, texture_bytes, seconds } in points {
                let errors = format!("{lookups:.3},{shadow_error:.5},{missed:.5},{false_:.5}");
                // Writing to a string cannot fail.
                let _ = writeln!(csv, "{method},{planes},{errors},{texture_bytes},{seconds:.2}");
            }
        }
        csv
    }

    fn fmt_curve(&self, f: &mut fmt::Formatter<'_>, curve: &Curve) -> fmt::Result {
        write!(f, "{:<34}", curve.method)?;
        for k in SHOWN {
            // A single row is the last.
            match curve.points.iter().find(|point| point.planes == k && curve.points.len() > 1) {
                Some(point) => write!(f, "{:>7.3}", point.shadow_error)?,
                None => write!(f, "{:>7}", "")?,
            }
        }
        let Some(last) = curve.points.last() else { return writeln!(f, " | no planes") };
        write!(f, " |")?;
        last.fmt_last(f)?;
        let map = curve.shadow_map_texels.map_or_else(|| equivalent(&self.shadow_maps, last), EquivalentSize::Texels);
        match map {
            EquivalentSize::BelowAll => write!(f, " {:>7}", format!("<{}", shadow_map::SIZES[0]))?,
            EquivalentSize::Texels(texels) => write!(f, " {texels:>7.0}")?,
            EquivalentSize::AboveAll => {
                write!(f, " {:>7}", format!(">{}", shadow_map::SIZES[shadow_map::SIZES.len() - 1]))?;
            }
        }
        writeln!(f, "{}", curve.note.as_ref().map_or(String::new(), |note| format!("  {note}")))
    }
}

impl fmt::Display for Ablation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Counts { receivers, lights, .. } = self.held_out;
        writeln!(f, "{}: held-out shadow_error, {receivers} receivers x {lights} lights", self.model)?;
        if self.shadow_share == 0.0 {
            writeln!(f, "no self-shadow: all errors are 0")?;
        }
        write!(f, "{:<34}", "planes")?;
        SHOWN.iter().try_for_each(|k| write!(f, "{k:>7}"))?;
        writeln!(f, " |  last lookups  error missed  false     KiB seconds     map")?;
        self.curves().try_for_each(|curve| self.fmt_curve(f, curve))?;
        self.not_measured.iter().try_for_each(|name| writeln!(f, "not part of this fit: {name}"))
    }
}
