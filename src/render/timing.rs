//! How long frames take: techniques in turn, so that whatever else the machine does meets all of them.
//!
//! A frame's time is that between two timestamps of the device around its commands, where the adapter has such; else the
//! time from recording to the end of the work. What a new light makes the CPU do is timed apart. Only ratios within one
//! run mean something.

use super::{FrameRequest, RenderError, gpu::Gpu, stage::Stage, technique::Technique};
use std::time::{Duration, Instant};

/// Which clock a frame's time comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Clock {
    /// The device's timestamps.
    Timestamps,
    /// From recording to the end of the work.
    Wall,
}

/// What happens between two frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// Nothing that the technique must follow.
    Nothing,
    /// The light (and whatever else the technique follows) has moved.
    Light,
}

/// One frame's time, seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameTime {
    /// The passes.
    pub frame_s: f64,
    /// The CPU's part: what a new light needs, and recording.
    pub cpu_s: f64,
}

/// Timestamps around a frame's commands, and how to read them.
#[derive(Debug)]
struct Timestamps {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    readable: wgpu::Buffer,
}

/// Bytes of two timestamps.
const TWO_TIMESTAMPS: u64 = 16;

/// Times frames.
#[derive(Debug)]
pub struct Timer {
    timestamps: Option<Timestamps>,
}

impl Timer {
    /// For the stages of a device.
    #[must_use]
    pub fn new(gpu: &Gpu) -> Self {
        let needed = wgpu::Features::TIMESTAMP_QUERY | wgpu::Features::TIMESTAMP_QUERY_INSIDE_ENCODERS;
        let buffer = |label, usage| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: TWO_TIMESTAMPS,
                usage,
                mapped_at_creation: false,
            })
        };
        let timestamps = gpu.has(needed).then(|| Timestamps {
            queries: gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("frame time"),
                ty: wgpu::QueryType::Timestamp,
                count: 2,
            }),
            resolved: buffer("timestamps", wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC),
            readable: buffer("read timestamps", wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ),
        });
        Self { timestamps }
    }

    /// Where its times come from.
    #[must_use]
    pub fn clock(&self) -> Clock {
        if self.timestamps.is_some() { Clock::Timestamps } else { Clock::Wall }
    }

    /// Draws a frame and times it. A technique must have drawn one frame before: its light stands.
    ///
    /// # Errors
    /// As of [`Stage::render`].
    pub fn frame(
        &self,
        (stage, technique): (&mut Stage, &mut dyn Technique),
        request: &FrameRequest,
        change: Change,
    ) -> Result<FrameTime, RenderError> {
        let targets = stage.targets_for(technique, &request.options)?;
        let start = Instant::now();
        stage.send(request);
        let mut encoder = stage.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let stamp = |index, encoder: &mut wgpu::CommandEncoder| {
            if let Some(timestamps) = &self.timestamps {
                encoder.write_timestamp(&timestamps.queries, index);
            }
        };
        stamp(0, &mut encoder);
        if change == Change::Light {
            technique.update(stage, request, &mut encoder)?;
        }
        technique.draw(stage, request, &targets, &mut encoder)?;
        stamp(1, &mut encoder);
        if let Some(Timestamps { queries, resolved, readable }) = &self.timestamps {
            encoder.resolve_query_set(queries, 0..2, resolved, 0);
            encoder.copy_buffer_to_buffer(resolved, 0, readable, 0, TWO_TIMESTAMPS);
        }
        let commands = encoder.finish();
        let cpu = start.elapsed();
        stage.gpu.queue.submit([commands]);
        stage.gpu.wait()?;
        let wall = start.elapsed();
        stage.targets = Some(targets);
        let frame_s = match &self.timestamps {
            Some(timestamps) => timestamps.seconds(stage)?,
            None => (wall - cpu.min(wall)).as_secs_f64(),
        };
        Ok(FrameTime { frame_s, cpu_s: Duration::as_secs_f64(&cpu) })
    }
}

impl Timestamps {
    /// Seconds between the two.
    fn seconds(&self, stage: &Stage) -> Result<f64, RenderError> {
        let driver = |reason: String| RenderError::Driver { reason };
        self.readable.map_async(wgpu::MapMode::Read, .., |_| ());
        stage.gpu.wait()?;
        let ticks = {
            let bytes = self.readable.get_mapped_range(..).map_err(|error| driver(error.to_string()))?;
            let stamps: &[u64] = bytemuck::cast_slice(&bytes);
            stamps[1].saturating_sub(stamps[0])
        };
        self.readable.unmap();
        Ok(ticks as f64 * f64::from(stage.gpu.queue.get_timestamp_period()) * 1e-9)
    }
}

/// The middle of `values`, the upper one of two; 0 of none.
#[must_use]
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}
