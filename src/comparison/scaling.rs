//! How techniques scale: one instance to hundreds, and what binds them (thesis 6.2, figures 24 to 26).
//!
//! Random instances of the model in view of one camera, each turned its own way and so under its own light; the light
//! moves before every frame. Three tests tell what binds: vertices (instances a hundredth as large, next to no
//! fragments), fragments (ten times as large, seen from straight above), and the CPU (a draw call for each instance).

use super::{
    CompareOptions,
    bench::{Bench, Planes, World},
    catalogue::{Family, Subject},
    speed::WARM_UP,
};
use crate::{
    pipeline::FitError,
    render::{
        Antialias, Camera, FrameOptions, FrameRequest, Light, Mode, RenderError,
        field::field,
        occluder_planes::OccluderPlanes,
        stage::{DrawCalls, Placement, Stage},
        technique::Technique,
        timing::{Change, Timer, median},
    },
};
use glam::Vec3;
use serde::Serialize;
use std::time::Instant;

/// Seed of the instances.
pub(super) const FIELD_SEED: u64 = 1;

/// Most instances where fragments bind: each of them covers the whole frame.
const FILL_INSTANCES: usize = 10;

/// A test ends before all frames are drawn where it has taken this long for each technique, seconds, and has drawn
/// [`LEAST_FRAMES`]: hundreds of instances take seconds a frame where a CPU draws them.
const SECONDS: f64 = 6.0;
const LEAST_FRAMES: usize = 8;

/// What a test makes scarce.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Bound {
    /// Nothing in particular.
    Plain,
    /// Vertices.
    Vertices,
    /// Fragments.
    Fill,
    /// Draw calls.
    DrawCalls,
}

/// One technique in one test.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ScalingRow {
    /// Its name.
    pub technique: String,
    /// The test.
    pub bound: Bound,
    /// Instances of the model.
    pub instances: usize,
    /// Frame time against that of `none` in the same test, median, the light moving.
    pub frame: f64,
    /// The CPU's part against the same.
    pub cpu: f64,
    /// Frames timed.
    pub frames: usize,
    /// Frame time of `none` against its time with one instance in the plain test.
    pub floor: f64,
}

/// All tests; none where no numbers of instances are asked for.
pub(super) fn measure(
    bench: &Bench,
    options: &CompareOptions,
    progress: &mut dyn FnMut(String),
) -> Result<Vec<ScalingRow>, FitError> {
    let Some(&most) = options.instances.iter().max() else { return Ok(Vec::new()) };
    let mut tests: Vec<(Bound, usize)> = options.instances.iter().map(|&count| (Bound::Plain, count)).collect();
    tests.extend([(Bound::Vertices, most), (Bound::Fill, most.min(FILL_INSTANCES)), (Bound::DrawCalls, most)]);
    let (mut rows, mut one) = (Vec::new(), None);
    for (bound, instances) in tests {
        let (test_rows, floor_s) = test(bench, (bound, instances), options, progress)?;
        let one = *one.get_or_insert(floor_s);
        rows.extend(test_rows.into_iter().map(|row| ScalingRow { floor: floor_s / one, ..row }));
    }
    Ok(rows)
}

/// Where the instances stand in a test, and who looks.
fn arrange((bound, instances): (Bound, usize)) -> (Vec<Placement>, Camera) {
    let (placements, camera) = field(instances, FIELD_SEED);
    let scaled = |factor: f32| -> Vec<Placement> {
        placements.iter().map(|placement| Placement { scale: factor * placement.scale, ..*placement }).collect()
    };
    match bound {
        Bound::Plain | Bound::DrawCalls => (placements, camera),
        Bound::Vertices => (scaled(0.01), camera),
        Bound::Fill => {
            let placements = scaled(10.0);
            let top = placements.iter().map(|p| p.translation.y + p.scale).fold(0.0, f32::max);
            let middle = placements.iter().map(|p| p.translation).sum::<Vec3>() / placements.len().max(1) as f32;
            let eye = Vec3::new(middle.x, 1.5 * top, middle.z);
            let bottom = placements.iter().map(|p| p.translation.y - p.scale).fold(0.0, f32::min);
            (placements, Camera::looking(eye, middle, 0.8, [0.1 * top, eye.y - bottom + 1.0]))
        }
    }
}

/// A technique of the scaling tests, and the number of its stage.
pub(super) struct Scaled {
    pub stage: usize,
    pub name: String,
    pub technique: Box<dyn Technique>,
}

/// The techniques that scale: those of the model's world, one setting each, and every set of planes.
pub(super) fn techniques(
    bench: &Bench,
    stages: &[Stage],
    options: &CompareOptions,
) -> Result<Vec<Scaled>, RenderError> {
    let traced = bench.traced(World::Model);
    let subject = Subject { stage: &stages[0], scene: traced.scene(), mesh: traced.mesh(), frame: &bench.frame };
    let mut out = Vec::new();
    for &family in &options.families {
        if family == Family::Planes {
            let scaled = |(set, _): &(usize, &Planes)| bench.stage(World::Planes(*set)).is_some();
            for (set, planes) in bench.planes.iter().enumerate().filter(scaled) {
                let technique: Box<dyn Technique> = Box::new(OccluderPlanes::new(&stages[1 + set], &planes.set)?);
                let name = format!("{}, {}", technique.name(), planes.label);
                out.push(Scaled { stage: 1 + set, name, technique });
            }
        }
        if let Some(technique) = subject.representative(family)? {
            out.push(Scaled { stage: 0, name: technique.name(), technique });
        }
    }
    Ok(out)
}

/// The model and the model with the sections of each set of planes, as instances.
pub(super) fn stages(bench: &Bench, placements: &[Placement]) -> Result<Vec<Stage>, RenderError> {
    let scenes =
        std::iter::once(bench.traced(World::Model).scene()).chain(bench.planes.iter().map(|planes| &planes.scene));
    scenes.map(|scene| Stage::new(&bench.gpu, scene, &bench.frame, placements)).collect()
}

fn test(
    bench: &Bench,
    (bound, instances): (Bound, usize),
    options: &CompareOptions,
    progress: &mut dyn FnMut(String),
) -> Result<(Vec<ScalingRow>, f64), FitError> {
    let (placements, camera) = arrange((bound, instances));
    let mut stages = stages(bench, &placements)?;
    let draw_calls = if bound == Bound::DrawCalls { DrawCalls::OnePerInstance } else { DrawCalls::Instanced };
    stages.iter_mut().for_each(|stage| stage.draw_calls = draw_calls);
    let timer = Timer::new(&bench.gpu);
    let mut techniques = techniques(bench, &stages, options)?;
    let mut samples = vec![(Vec::new(), Vec::new()); techniques.len()];
    let start = Instant::now();
    for frame in 0..WARM_UP + options.frames {
        let is_over = start.elapsed().as_secs_f64() > SECONDS * techniques.len() as f64;
        if is_over && frame >= WARM_UP + LEAST_FRAMES {
            break;
        }
        progress(format!("{instances} instances, {bound:?}: frame {} of {}", frame + 1, options.frames));
        for (Scaled { stage, technique, .. }, (frames, cpu)) in techniques.iter_mut().zip(&mut samples) {
            let request = FrameRequest {
                camera,
                light: Light::Directional { to_light: bench.light(frame) },
                options: FrameOptions { size_px: [bench.size_px; 2], mode: Mode::Shaded, antialias: Antialias::Off },
            };
            let time = timer.frame((&mut stages[*stage], &mut **technique), &request, Change::Light)?;
            if frame >= WARM_UP {
                frames.push(time.frame_s);
                cpu.push(time.cpu_s);
            }
        }
    }
    let timed = samples.first().map_or(0, |(frames, _)| frames.len());
    let medians: Vec<[f64; 2]> = samples.into_iter().map(|(frames, cpu)| [median(frames), median(cpu)]).collect();
    let floor = medians.first().map_or(f64::MIN_POSITIVE, |none| none[0].max(f64::MIN_POSITIVE));
    let row = |(Scaled { name, .. }, [frame, cpu]): (Scaled, [f64; 2])| ScalingRow {
        technique: name,
        bound,
        instances,
        frame: frame / floor,
        cpu: cpu / floor,
        frames: timed,
        floor: 1.0,
    };
    Ok((techniques.into_iter().zip(medians).map(row).collect(), floor))
}
