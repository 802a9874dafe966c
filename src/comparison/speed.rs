//! How long each technique's frames take, against a frame without shadows.

use super::{CompareOptions, bench::Bench, catalogue::Setting};
use crate::{
    pipeline::FitError,
    render::{
        Mode,
        timing::{Change, Timer, median},
        unshadowed::Unshadowed,
    },
};
use serde::Serialize;

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
    let timer = Timer::new(&bench.stages[0]);
    let mut none: Vec<Unshadowed> = bench.stages.iter().map(Unshadowed::new).collect();
    let mut floors = vec![Vec::new(); none.len()];
    let mut samples = vec![Samples::default(); settings.len()];
    for frame in 0..WARM_UP + options.frames {
        progress(format!("times: frame {} of {}", frame + 1, WARM_UP + options.frames));
        for (stage, none) in none.iter_mut().enumerate() {
            let world = super::bench::World::of_stage(stage);
            let request = bench.request(world, (0, frame), Mode::Shaded);
            let time = timer.frame((&mut bench.stages[stage], none), &request, Change::Nothing)?;
            if frame >= WARM_UP {
                floors[stage].push(time.frame_s);
            }
        }
        for (setting, samples) in settings.iter_mut().zip(&mut samples) {
            let request = bench.request(setting.world, (0, frame), Mode::Shaded);
            let stage = &mut bench.stages[setting.world.stage()];
            let moving = timer.frame((stage, &mut *setting.technique), &request, Change::Light)?;
            let still = timer.frame((stage, &mut *setting.technique), &request, Change::Nothing)?;
            if frame >= WARM_UP {
                samples.still.push(still.frame_s);
                samples.moving.push(moving.frame_s);
                samples.cpu.push(moving.cpu_s);
            }
        }
    }
    let floors: Vec<f64> = floors.into_iter().map(median).collect();
    let times = |(setting, Samples { still, moving, cpu }): (&Setting, Samples)| {
        let floor = floors[setting.world.stage()].max(f64::MIN_POSITIVE);
        Times { still: median(still) / floor, moving: median(moving) / floor, cpu: median(cpu) / floor }
    };
    Ok(settings.iter().zip(samples).map(times).collect())
}
