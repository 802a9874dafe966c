//! How long each technique's frames take, against a frame without shadows.

use super::{
    CompareOptions,
    bench::{Bench, World},
    catalogue::Setting,
};
use crate::{
    pipeline::FitError,
    render::{
        Mode,
        timing::{Change, Timer, median},
        unshadowed::Unshadowed,
    },
};
use serde::Serialize;
use std::collections::BTreeMap;

/// Frames of each technique that are drawn before any counts: shaders are compiled and caches filled.
pub const WARM_UP: usize = 2;

/// Times of one setting.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Times {
    /// Frame time against that of `none` in the same world, median, the light standing still.
    pub still: f64,
    /// The same with a light that moves before every frame: the passes that it needs again are counted.
    pub moving: f64,
    /// What the CPU does for a moved light and to record the frame, against the frame time of `none`.
    pub cpu: f64,
}

/// Frame times in seconds, by setting: still, moving, CPU.
#[derive(Clone, Default)]
struct Samples {
    still: Vec<f64>,
    moving: Vec<f64>,
    cpu: Vec<f64>,
}

/// Times of all settings, in their order.
pub(super) fn measure(
    bench: &mut Bench,
    settings: &mut [Setting],
    options: &CompareOptions,
    progress: &mut dyn FnMut(String),
) -> Result<Vec<Times>, FitError> {
    let bare = bench.worlds().into_iter().filter(|world| world.bare() == *world);
    let mut none: BTreeMap<World, Unshadowed> =
        bare.filter_map(|world| Some((world, Unshadowed::new(bench.stage(world)?)))).collect();
    let timer = Timer::new(&bench.gpu);
    let mut floors: BTreeMap<World, Vec<f64>> = BTreeMap::new();
    let mut samples = vec![Samples::default(); settings.len()];
    for frame in 0..WARM_UP + options.frames {
        progress(format!("times: frame {} of {}", frame + 1, WARM_UP + options.frames));
        for (&world, none) in &mut none {
            let request = bench.request(world, (0, frame), Mode::Shaded);
            let Some(stage) = bench.stage_mut(world) else { continue };
            let time = timer.frame((stage, none), &request, Change::Nothing)?;
            if frame >= WARM_UP {
                floors.entry(world).or_default().push(time.frame_s);
            }
        }
        for (setting, samples) in settings.iter_mut().zip(&mut samples) {
            let request = bench.request(setting.world, (0, frame), Mode::Shaded);
            let Some(stage) = bench.stage_mut(setting.world) else { continue };
            let moving = timer.frame((stage, &mut *setting.technique), &request, Change::Light)?;
            let still = timer.frame((stage, &mut *setting.technique), &request, Change::Nothing)?;
            if frame >= WARM_UP {
                samples.still.push(still.frame_s);
                samples.moving.push(moving.frame_s);
                samples.cpu.push(moving.cpu_s);
            }
        }
    }
    let floors: BTreeMap<World, f64> = floors.into_iter().map(|(world, times)| (world, median(times))).collect();
    let times = |(setting, Samples { still, moving, cpu }): (&Setting, Samples)| {
        let floor = floors.get(&setting.world.bare()).map_or(f64::MIN_POSITIVE, |floor| floor.max(f64::MIN_POSITIVE));
        Times { still: median(still) / floor, moving: median(moving) / floor, cpu: median(cpu) / floor }
    };
    Ok(settings.iter().zip(samples).map(times).collect())
}
