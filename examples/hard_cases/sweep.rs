//! A light swept in small steps: how much more the prediction changes from frame to frame than the traced reference.

use crate::fit::Fitted;
use glam::{Quat, Vec3};
use rayon::prelude::*;
use shadowfit_solver::{
    pair_table::nearest,
    receivers::Receivers,
    shade::{set_rows, visibility},
};

/// From one frame to the next.
pub const STEP_DEG: f32 = 0.01;

/// Frames on either side of the middle of a sweep: past [`shadowfit_solver::shade::EDGE_ON`], which is 0.11 degrees.
const HALF_STEPS: i32 = 20;

/// What happened between two frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// The light moved.
    Plain,
    /// A plane that is read became edge-on, or ceased to be.
    EdgeOn,
    /// Another direction's lists are read.
    Border,
}

/// What changed between two frames, as shares of the light that falls on the surface.
#[derive(Clone, Copy, Debug)]
pub struct Jump {
    pub kind: Kind,
    /// Of the prediction.
    pub predicted: f64,
    /// Of the reference.
    pub traced: f64,
    /// Wrong share of the light in the frame before and in the one after.
    pub errors: [f64; 2],
}

impl Jump {
    pub fn excess(&self) -> f64 {
        (self.predicted - self.traced).max(0.0)
    }
}

struct Frame {
    direction: usize,
    /// Planes that are read and cast.
    casting: Vec<bool>,
    /// Per receiver: weight under this light (0 where it faces away), predicted and traced visibility.
    lit: Vec<[f32; 3]>,
    error: f64,
}

fn frame(fitted: &Fitted, receivers: &Receivers, section_of: &[u32], light: Vec3) -> Frame {
    let set = &fitted.set;
    let (rows, lists) = (set_rows(set, light), set.lists(light));
    let direction = set.active.as_ref().map_or(0, |active| nearest(&active.directions, light));
    let mut casting = vec![false; set.planes.len()];
    lists.iter().flatten().for_each(|&plane| casting[plane as usize] = rows[plane as usize].is_some());
    let lit = |i: usize| {
        let cosine = receivers.normals[i].dot(light);
        if cosine <= 0.0 {
            return [0.0; 3];
        }
        let predicted = visibility(&set.planes, &rows, &lists[section_of[i] as usize], receivers.points[i]).x;
        let traced = f32::from(u8::from(!fitted.mesh.is_blocked(receivers.origins[i], light)));
        [receivers.weights[i] * cosine, predicted, traced]
    };
    let lit: Vec<[f32; 3]> = (0..receivers.points.len()).map(lit).collect();
    let total: f64 = lit.iter().map(|[weight, ..]| f64::from(*weight)).sum();
    let wrong: f64 = lit.iter().map(|[weight, p, t]| f64::from(weight * (p - t).abs())).sum();
    Frame { direction, casting, lit, error: wrong / total.max(f64::MIN_POSITIVE) }
}

fn jump(a: &Frame, b: &Frame) -> Jump {
    let (mut total, mut changed) = (0.0, [0.0; 2]);
    for (a, b) in a.lit.iter().zip(&b.lit).filter(|(a, b)| a[0] > 0.0 && b[0] > 0.0) {
        total += f64::from(a[0]);
        for (changed, k) in changed.iter_mut().zip([1, 2]) {
            *changed += f64::from(a[0] * (a[k] - b[k]).abs());
        }
    }
    let kind = match (a.direction == b.direction, a.casting == b.casting) {
        (false, _) => Kind::Border,
        (true, false) => Kind::EdgeOn,
        (true, true) => Kind::Plain,
    };
    let [predicted, traced] = changed.map(|changed| changed / f64::max(total, f64::MIN_POSITIVE));
    Jump { kind, predicted, traced, errors: [a.error, b.error] }
}

/// Jumps of a light that turns around `axis` through `middle`.
fn sweep(fitted: &Fitted, receivers: &Receivers, (middle, axis): (Vec3, Vec3)) -> Vec<Jump> {
    let section_of = fitted.sections(receivers);
    let at = |step: i32| Quat::from_axis_angle(axis, (step as f32 * STEP_DEG).to_radians()) * middle;
    let frames: Vec<Frame> = (-HALF_STEPS..=HALF_STEPS)
        .into_par_iter()
        .map(|step| frame(fitted, receivers, &section_of, at(step).normalize()))
        .collect();
    frames.windows(2).map(|pair| jump(&pair[0], &pair[1])).collect()
}

/// Through the middle between each direction of the lists and its nearest neighbour, `count` of them.
pub fn across_borders(fitted: &Fitted, receivers: &Receivers, count: usize) -> Vec<Jump> {
    let Some(active) = &fitted.set.active else { return Vec::new() };
    let directions = &active.directions;
    let through = |&d: &Vec3| {
        let others: Vec<Vec3> = directions.iter().copied().filter(|other| *other != d).collect();
        let other = others[nearest(&others, d)];
        sweep(fitted, receivers, ((d + other).normalize(), d.cross(other).normalize()))
    };
    directions.iter().take(count).flat_map(through).collect()
}

/// Through the planes, edge-on, `count` of them.
pub fn through_planes(fitted: &Fitted, receivers: &Receivers, count: usize) -> Vec<Jump> {
    let through = |(k, baked): (usize, &shadowfit_solver::plane::BakedPlane)| {
        let n = baked.plane.normal();
        let within = Quat::from_axis_angle(n, 2.4 * k as f32) * n.any_orthonormal_vector();
        sweep(fitted, receivers, (within, n.cross(within)))
    };
    fitted.set.planes.iter().enumerate().take(count).flat_map(through).collect()
}

/// The jump of this kind that exceeds its reference most, and how many there are.
pub fn largest(jumps: &[Jump], kind: Kind) -> (Option<Jump>, usize) {
    let of_kind = || jumps.iter().filter(|jump| jump.kind == kind);
    (of_kind().copied().max_by(|a, b| a.excess().total_cmp(&b.excess())), of_kind().count())
}
