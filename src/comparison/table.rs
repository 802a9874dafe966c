//! The tables of a comparison: JSON, CSV, Markdown.

use super::{
    CompareOptions,
    bench::{Bench, World},
    catalogue::{Against, Family, Setting},
    crowd::CrowdRow,
    errors::{Errors, SOFT_HALF_ANGLE_RAD},
    scaling::{Bound, ScalingRow},
    speed::Times,
};
use crate::{
    pipeline::FitRequest,
    render::{
        technique::Cost,
        timing::{Clock, Timer},
    },
};
use serde::Serialize;
use std::fmt::Write as _;

/// Name and version of the JSON's form.
pub const SCHEMA: &str = "shadowfit.comparison/1";

/// One technique at one setting.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Its family.
    pub family: Family,
    /// Its name with its setting.
    pub technique: String,
    /// What is drawn.
    pub world: World,
    /// What its frames are compared with.
    pub against: Against,
    /// How wrong.
    #[serde(flatten)]
    pub errors: Errors,
    /// How fast.
    #[serde(flatten)]
    pub times: Times,
    /// What it needs.
    pub cost: Cost,
}

/// All tables of one model.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// [`SCHEMA`].
    pub schema: &'static str,
    /// Of the program.
    pub version: &'static str,
    /// The command line.
    pub command: String,
    /// The model.
    pub model: String,
    /// Its triangles with an area.
    pub triangles: usize,
    /// The adapter.
    pub adapter: String,
    /// Where times come from.
    pub clock: Clock,
    /// Width and height of the frames.
    pub size_px: u32,
    /// Views x lights.
    pub views: usize,
    /// Of them.
    pub lights: usize,
    /// Frames timed of each technique.
    pub frames: usize,
    /// Half the angle of the soft references' light, radians.
    pub soft_half_angle_rad: f32,
    /// One entry a setting.
    pub rows: Vec<Row>,
    /// One entry a technique and test.
    pub scaling: Vec<ScalingRow>,
    /// One entry a technique and light, where many instances shadow each other.
    pub crowd: Vec<CrowdRow>,
    /// Where shadow maps take over from planes, in words.
    pub crossing: String,
}

impl Comparison {
    pub(super) fn new(
        (request, options): (&FitRequest, &CompareOptions),
        bench: &Bench,
        (settings, errors, times): (&[Setting], &[Errors], &[Times]),
        (scaling, crowd): (Vec<ScalingRow>, Vec<CrowdRow>),
    ) -> Self {
        let row = |((setting, errors), times): ((&Setting, &Errors), &Times)| {
            Some(Row {
                family: setting.family,
                technique: setting.name(),
                world: setting.world,
                against: setting.against,
                errors: *errors,
                times: *times,
                cost: setting.technique.cost(bench.stage(setting.world)?),
            })
        };
        let rows: Vec<Row> = settings.iter().zip(errors).zip(times).filter_map(row).collect();
        Self {
            schema: SCHEMA,
            version: env!("CARGO_PKG_VERSION"),
            command: request.command.clone(),
            model: request.model.display().to_string(),
            triangles: bench.traced(World::Model).mesh().triangle_count(),
            adapter: bench.gpu.adapter_name().to_string(),
            clock: Timer::new(&bench.gpu).clock(),
            size_px: options.size_px,
            views: options.views,
            lights: options.lights,
            frames: options.frames,
            soft_half_angle_rad: SOFT_HALF_ANGLE_RAD,
            crossing: crossing(&rows),
            rows,
            scaling,
            crowd,
        }
    }

    /// One line a setting.
    #[must_use]
    pub fn csv(&self) -> String {
        let mut csv = "technique,world,against,mask_error,missed,false,flip_mean,still,moving,cpu,passes,draw_calls,\
                       update_passes,update_draw_calls,texture_bytes,buffer_bytes\n"
            .to_string();
        for Row { technique, world, against, errors, times, cost, .. } in &self.rows {
            let Errors { mask_error, missed, false_, flip_mean, .. } = errors;
            let flip = flip_mean.map_or(String::new(), |flip| format!("{flip:.5}"));
            let Times { still, moving, cpu } = times;
            let Cost { passes, draw_calls, update_passes, update_draw_calls, texture_bytes, buffer_bytes, .. } = cost;
            // Writing to a string cannot fail.
            let _ = writeln!(
                csv,
                "\"{technique}\",{},{},{mask_error:.5},{missed:.5},{false_:.5},{flip},{still:.3},{moving:.3},{cpu:.4},\
                 {passes},{draw_calls},{update_passes},{update_draw_calls},{texture_bytes},{buffer_bytes}",
                world_name(*world),
                against_name(*against),
            );
        }
        csv
    }

    /// One line a technique and scaling test.
    #[must_use]
    pub fn scaling_csv(&self) -> String {
        let mut csv = "technique,bound,instances,frame,cpu,frames,floor\n".to_string();
        for ScalingRow { technique, bound, instances, frame, cpu, frames, floor } in &self.scaling {
            let bound = bound_name(*bound);
            let _ = writeln!(csv, "\"{technique}\",{bound},{instances},{frame:.3},{cpu:.4},{frames},{floor:.2}");
        }
        csv
    }

    /// Both tables for people.
    #[must_use]
    pub fn markdown(&self) -> String {
        let Self { model, triangles, adapter, size_px, views, lights, frames, command, .. } = self;
        let mut text = format!(
            "# Techniques on {model}\n\n`{command}`\n\n{triangles} triangles, {adapter}, {size_px} x {size_px} pixels; errors \
             over {views} views x {lights} lights, times the median of {frames} frames against a frame without shadows.\n\n\
             {}\n\n",
            self.crossing
        );
        text.push_str(
            "| technique | world | against | mask error | missed + false | FLIP | still | moving light | CPU | passes | \
             KiB | a new light needs |\n|---|---|---|---|---|---|---|---|---|---|---|---|\n",
        );
        for Row { technique, world, against, errors, times, cost, .. } in &self.rows {
            let flip = errors.flip_mean.map_or("-".to_string(), |flip| format!("{flip:.4}"));
            let _ = writeln!(
                text,
                "| {technique} | {} | {} | {:.4} | {:.4} + {:.4} | {flip} | {:.2} | {:.2} | {:.3} | {} + {} | {} | {} |",
                world_name(*world),
                against_name(*against),
                errors.mask_error,
                errors.missed,
                errors.false_,
                times.still,
                times.moving,
                times.cpu,
                cost.passes,
                cost.update_passes,
                (cost.texture_bytes + cost.buffer_bytes) / 1024,
                cost.on_light_change,
            );
        }
        text.push_str("\n| technique | bound by | instances | frame | CPU | frames | none against one instance |\n|---|---|---|---|---|---|---|\n");
        for ScalingRow { technique, bound, instances, frame, cpu, frames, floor } in &self.scaling {
            let bound = bound_name(*bound);
            let _ = writeln!(
                text,
                "| {technique} | {bound} | {instances} | {frame:.2} | {cpu:.3} | {frames} | {floor:.2} |"
            );
        }
        text.push_str("\n| technique | light | instances | mask error | missed + false |\n|---|---|---|---|---|\n");
        for CrowdRow { technique, light, instances, mask_error, missed, false_ } in &self.crowd {
            let _ =
                writeln!(text, "| {technique} | {light} | {instances} | {mask_error:.4} | {missed:.4} + {false_:.4} |");
        }
        text
    }
}

/// Name of a world in tables.
fn world_name(world: World) -> &'static str {
    match world {
        World::Model | World::Planes(_) => "model",
        World::Ground | World::PlanesOnGround(_) => "ground",
        World::Glass => "glass over ground",
    }
}

fn against_name(against: Against) -> &'static str {
    match against {
        Against::Hard => "hard",
        Against::Soft => "soft",
    }
}

fn bound_name(bound: Bound) -> &'static str {
    match bound {
        Bound::Plain => "-",
        Bound::Vertices => "vertices",
        Bound::Fill => "fill",
        Bound::DrawCalls => "draw calls",
    }
}

/// Where shadow maps take over from planes while the light moves: below which error, and which map.
fn crossing(rows: &[Row]) -> String {
    let of = |family| rows.iter().filter(move |row| row.family == family && row.against == Against::Hard);
    let best = of(Family::Planes)
        .filter(|row| !row.world.counts_ground())
        .min_by(|a, b| a.errors.mask_error.total_cmp(&b.errors.mask_error));
    let Some(planes) = best else { return "No planes were compared.".to_string() };
    // The cheapest map that is at least as good.
    let better = of(Family::ShadowMap).filter(|map| map.errors.mask_error <= planes.errors.mask_error);
    let Some(map) = better.min_by(|a, b| a.times.moving.total_cmp(&b.times.moving)) else {
        return format!("No shadow map of this table is as exact as {}.", planes.technique);
    };
    let (error, [p, m]) = (planes.errors.mask_error, [planes.times.moving, map.times.moving]);
    if p < m {
        format!(
            "Under a moving light planes are cheaper ({p:.2} against {m:.2}) until an error below {error:.4} of the pixels is \
             needed; there {} takes over.",
            map.technique
        )
    } else {
        format!(
            "Under a moving light {} is both cheaper ({m:.2} against {p:.2}) and at least as exact as {} (error {error:.4}).",
            map.technique, planes.technique
        )
    }
}
