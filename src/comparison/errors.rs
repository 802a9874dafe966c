//! How wrong each technique is, and how it looks.

use super::{
    CompareOptions,
    bench::{Bench, World},
    catalogue::{Against, Setting},
};
use crate::{
    masks::{MaskErrors, difference, mean_flip, side_by_side},
    pipeline::FitError,
    render::{
        Light, Mode, RenderError,
        ray_traced::{AreaLight, RayTraced, View},
    },
};
use image::RgbaImage;
use serde::Serialize;

/// Half the angle under which the soft references' light is seen: four times the sun's, so that penumbrae cover pixels.
pub(super) const SOFT_HALF_ANGLE_RAD: f32 = 0.02;

/// Samples a side of the soft references' light.
const SOFT_SAMPLES: usize = 8;

/// Errors of one setting; shares of the pixels that count.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Errors {
    /// Wrong share.
    pub mask_error: f64,
    /// The part that lacks shadow.
    pub missed: f64,
    /// The part that has too much.
    #[serde(rename = "false")]
    pub false_: f64,
    /// Mean FLIP of the shaded frames of the first view; `null` without the cargo feature `flip`.
    pub flip_mean: Option<f64>,
    /// Frames.
    pub frames: usize,
}

/// A technique's picture.
pub(super) struct Picture {
    pub name: String,
    pub picture: RgbaImage,
}

/// Sums of one setting.
#[derive(Clone, Default)]
struct Sums {
    masks: MaskErrors,
    flips: Vec<f64>,
    frames: usize,
}

/// What the settings of a world and a reference are compared with, in one frame.
struct Reference {
    mask: RgbaImage,
    shaded: RgbaImage,
    /// For each pixel: does it count?
    counts: Vec<bool>,
}

/// Errors of all settings, in their order, and pictures of the first frame.
pub(super) fn measure(
    bench: &mut Bench,
    settings: &mut [Setting],
    options: &CompareOptions,
    progress: &mut dyn FnMut(String),
) -> Result<(Vec<Errors>, Vec<Picture>), FitError> {
    let mut sums = vec![Sums::default(); settings.len()];
    let mut pictures = Vec::new();
    for view in 0..options.views {
        for world in [World::Model, World::Ground, World::Glass] {
            if !settings.iter().any(|setting| setting.world.bare() == world) {
                continue;
            }
            let seen = bench.traced(world).look(&bench.request(world, (view, 0), Mode::Mask))?;
            let shown = if view == 0 { Some(light_to_show(bench, world, &seen, options.lights)?) } else { None };
            for light in 0..options.lights {
                progress(format!("errors: view {} of {}, light {}", view + 1, options.views, light + 1));
                for against in [Against::Hard, Against::Soft] {
                    let same = |setting: &Setting| setting.world.bare() == world && setting.against == against;
                    if !settings.iter().any(same) {
                        continue;
                    }
                    let reference = reference(bench, (world, against), &seen, (view, light))?;
                    for (setting, sums) in settings.iter_mut().zip(&mut sums).filter(|(setting, _)| same(setting)) {
                        let picture = compare(bench, setting, sums, (&reference, view, light))?;
                        pictures.extend(picture.filter(|_| shown == Some(light)));
                    }
                }
            }
        }
    }
    Ok((sums.iter().map(Sums::errors).collect(), pictures))
}

impl Sums {
    fn errors(&self) -> Errors {
        let Self { masks, flips, frames } = self;
        Errors {
            mask_error: masks.share(masks.wrong()),
            missed: masks.share(masks.missed),
            false_: masks.share(masks.false_),
            flip_mean: (!flips.is_empty()).then(|| flips.iter().sum::<f64>() / flips.len() as f64),
            frames: *frames,
        }
    }
}

fn reference(
    bench: &Bench,
    (world, against): (World, Against),
    seen: &View,
    frame: (usize, usize),
) -> Result<Reference, RenderError> {
    let traced = bench.traced(world);
    let light = bench.request(world, frame, Mode::Mask).light;
    let picture = |mode| {
        let view = RayTraced::relit(seen, mode, light);
        match (against, light) {
            (Against::Soft, Light::Directional { to_light }) => {
                traced.soft_picture(&view, &AreaLight::distant(to_light, SOFT_HALF_ANGLE_RAD), SOFT_SAMPLES)
            }
            _ => traced.transmitted_picture(&view),
        }
    };
    let counts = if world.counts_ground() { traced.ground_seen(seen) } else { vec![true; seen.pixels()] };
    Ok(Reference { mask: picture(Mode::Mask)?, shaded: picture(Mode::Shaded)?, counts })
}

/// The light under which most of the view is in shadow.
fn light_to_show(bench: &Bench, world: World, seen: &View, lights: usize) -> Result<usize, RenderError> {
    let mut most = (0, 0);
    for light in 0..lights {
        let view = RayTraced::relit(seen, Mode::Mask, bench.request(world, (0, light), Mode::Mask).light);
        let mask = bench.traced(world).picture(&view)?;
        let in_shadow = mask.pixels().filter(|pixel| pixel.0[1] == 255 && pixel.0[0] == 0).count();
        most = most.max((in_shadow, lights - light));
    }
    Ok(lights - most.1)
}

/// Adds a frame's errors; of the first view also makes a picture, and measures FLIP.
fn compare(
    bench: &mut Bench,
    setting: &mut Setting,
    sums: &mut Sums,
    (reference, view, light): (&Reference, usize, usize),
) -> Result<Option<Picture>, RenderError> {
    let requests = [Mode::Mask, Mode::Shaded].map(|mode| bench.request(setting.world, (view, light), mode));
    let Some(stage) = bench.stage_mut(setting.world) else { return Ok(None) };
    let mask = stage.render(&mut *setting.technique, &requests[0])?;
    let errors = MaskErrors::where_seen(&reference.mask, &mask, |pixel| reference.counts[pixel]);
    sums.masks = sums.masks.plus(errors);
    sums.frames += 1;
    // FLIP takes longer than the frame: one view.
    if view > 0 {
        return Ok(None);
    }
    let shaded = stage.render(&mut *setting.technique, &requests[1])?;
    sums.flips.extend(mean_flip(&reference.shaded, &shaded));
    let pictures = [&reference.shaded, &shaded, &difference(&reference.mask, &mask)];
    Ok(Some(Picture { name: slug(&setting.name()), picture: side_by_side(&pictures) }))
}

/// A name as part of a file's name.
fn slug(name: &str) -> String {
    let words: Vec<&str> = name.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty()).collect();
    words.join("-").to_lowercase()
}
