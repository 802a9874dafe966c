//! Errors where many instances shadow each other, seen along the field: where a map warped by the camera gains, and
//! where it does not.
//!
//! One light across the view and one that shines towards the viewer. The reference traces all instances at once. Shadow
//! planes are of each instance on itself alone: what falls from one onto another is missing, and counted as missed.

use super::{
    CompareOptions,
    bench::{Bench, World},
    scaling::{self, Scaled},
};
use crate::{
    masks::MaskErrors,
    pipeline::FitError,
    render::{Antialias, FrameOptions, FrameRequest, Light, Mode, field::field, ray_traced::RayTraced},
};
use glam::{DVec3, Vec3};
use serde::Serialize;
use shadowfit_solver::mesh::Frame;

/// The lights: from above and the side, and towards the viewer, who looks along -Z.
const LIGHTS: [(&str, Vec3); 2] =
    [("across the view", Vec3::new(0.6, 0.75, 0.28)), ("towards the viewer", Vec3::new(0.0, 0.3, -0.95))];

/// The reference holds every instance's triangles: at most this many, some 1.5 GiB with their tree.
const MOST_TRIANGLES: usize = 5_000_000;

/// One technique under one light.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CrowdRow {
    /// Its name.
    pub technique: String,
    /// Where the light comes from.
    pub light: &'static str,
    /// Instances.
    pub instances: usize,
    /// Wrong share of the pixels.
    pub mask_error: f64,
    /// The part that lacks shadow.
    pub missed: f64,
    /// The part that has too much.
    #[serde(rename = "false")]
    pub false_: f64,
}

/// Errors in the largest field of the scaling tests; none where there is none, or where it is too large to trace.
pub(super) fn measure(
    bench: &Bench,
    options: &CompareOptions,
    progress: &mut dyn FnMut(String),
) -> Result<Vec<CrowdRow>, FitError> {
    let model = bench.traced(World::Model);
    let Some(&instances) = options.instances.iter().max() else { return Ok(Vec::new()) };
    if instances * model.mesh().triangle_count() > MOST_TRIANGLES {
        return Ok(Vec::new());
    }
    let (placements, camera) = field(instances, scaling::FIELD_SEED);
    let matrices: Vec<_> = placements.iter().map(|placement| placement.world_from_unit()).collect();
    let world = Frame { centre_model: DVec3::ZERO, radius: 1.0 };
    // An instance of a model with triangles has triangles.
    let Ok(traced) = RayTraced::new(model.scene().instanced(&matrices, &bench.frame), &world) else {
        return Ok(Vec::new());
    };
    let mut stages = scaling::stages(bench, &placements)?;
    let mut techniques = scaling::techniques(bench, &stages, options)?;
    let mut rows = Vec::new();
    for (name, to_light) in LIGHTS {
        progress(format!("{instances} instances, light {name}"));
        let request = FrameRequest {
            camera,
            light: Light::Directional { to_light: to_light.normalize() },
            options: FrameOptions { size_px: [bench.size_px; 2], mode: Mode::Mask, antialias: Antialias::Off },
        };
        let reference = traced.picture(&traced.look(&request)?)?;
        for Scaled { stage, name: technique, technique: drawn } in &mut techniques {
            let drawn = stages[*stage].render(&mut **drawn, &request)?;
            rows.push(row((technique, name, instances), MaskErrors::between(&reference, &drawn)));
        }
    }
    Ok(rows)
}

fn row((technique, light, instances): (&str, &'static str, usize), errors: MaskErrors) -> CrowdRow {
    let [mask_error, missed, false_] = [errors.wrong(), errors.missed, errors.false_].map(|n| errors.share(n));
    CrowdRow { technique: technique.to_string(), light, instances, mask_error, missed, false_ }
}
