//! Comparison: every technique on the same frames: how wrong, how fast, how much memory, and how it scales.
//!
//! In: a model, with planes or to be fitted here. Out: tables (JSON, CSV, Markdown), a chart of speed against error
//! (SVG), and each technique's picture of one frame beside its errors.
//!
//! Errors are of masks, against the reference that is proper to a technique (traced hard shadows, or traced soft ones),
//! over views x lights that no fit has seen; those of techniques that shade a ground alone are counted on the ground.
//! Times are ratios to a frame without shadows, all techniques drawn in turn (see [`crate::render::timing`]).

mod bench;
mod catalogue;
mod chart;
mod crowd;
mod errors;
mod scaling;
mod speed;
mod table;

pub use catalogue::Family;
pub use crowd::CrowdRow;
pub use scaling::ScalingRow;
pub use table::{Comparison, Row, SCHEMA};

use crate::{
    asset::files,
    pipeline::{FitError, FitRequest, png, stem_of},
};
use bench::Bench;

/// What is measured.
#[derive(Clone, Debug, PartialEq)]
pub struct CompareOptions {
    /// Techniques; `none` is always among them.
    pub families: Vec<Family>,
    /// Light directions, 1 and up.
    pub lights: usize,
    /// Views around the model, 1 and up.
    pub views: usize,
    /// Width and height of the frames.
    pub size_px: u32,
    /// Frames timed of each technique, after two that do not count.
    pub frames: usize,
    /// Instances of the model in the scaling test; empty: no such test.
    pub instances: Vec<usize>,
}

/// Measures and writes; `request` names model, output folder, preset and seed of the fits.
///
/// # Errors
/// See [`FitError`].
pub fn run(
    request: &FitRequest,
    options: &CompareOptions,
    progress: &mut dyn FnMut(String),
) -> Result<Comparison, FitError> {
    let mut bench = Bench::new(request, options, progress)?;
    let mut settings = catalogue::settings(&bench, options)?;
    let (errors, pictures) = errors::measure(&mut bench, &mut settings, options, progress)?;
    let times = speed::measure(&mut bench, &mut settings, options, progress)?;
    let scaling = scaling::measure(&bench, options, progress)?;
    let crowd = crowd::measure(&bench, options, progress)?;
    let comparison = Comparison::new((request, options), &bench, (&settings, &errors, &times), (scaling, crowd));
    write(request, &comparison, &pictures)?;
    Ok(comparison)
}

fn write(request: &FitRequest, comparison: &Comparison, pictures: &[errors::Picture]) -> Result<(), FitError> {
    let mut batch = files::Batch::default();
    let path = |ending: &str| request.out_dir.join(format!("{}.{ending}", stem_of(&request.model)));
    let json = format!("{}\n", serde_json::to_string_pretty(comparison)?);
    batch.stage(&path("techniques.json"), json.as_bytes())?;
    batch.stage(&path("techniques.csv"), comparison.csv().as_bytes())?;
    batch.stage(&path("scaling.csv"), comparison.scaling_csv().as_bytes())?;
    batch.stage(&path("techniques.md"), comparison.markdown().as_bytes())?;
    if let Some(svg) = chart::svg(comparison) {
        batch.stage(&path("techniques.svg"), svg.as_bytes())?;
    }
    for picture in pictures {
        batch.stage(&path(&format!("{}.png", picture.name)), &png(&picture.picture)?)?;
    }
    Ok(batch.commit()?)
}
