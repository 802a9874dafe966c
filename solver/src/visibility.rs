//! The reference: traced visibility of (receiver, light) pairs.
//!
//! Out: per light, the receivers that face it, structure-of-arrays, each with a signed *vote*: its weight, positive
//! where the light is blocked, negative where it is not. A texel of an occluder texture should block exactly where
//! the votes of the pairs whose rays cross it sum to more than zero; everything later works on these four columns.

use crate::{mesh::Mesh, receivers::Receivers, sampling::hash};
use glam::Vec3;
use rayon::prelude::*;

/// The pairs of one light. The columns have one entry a pair.
#[derive(Clone, Debug)]
pub struct LightPairs {
    /// Unit direction towards the light.
    pub light: Vec3,
    /// Receiver positions, unit space.
    pub x: Vec<f32>,
    /// As `x`.
    pub y: Vec<f32>,
    /// As `x`.
    pub z: Vec<f32>,
    /// Index of the receiver.
    pub receiver: Vec<u32>,
    /// `+w` where blocked, `-w` where lit; `w = area x exposure x n.l x solid angle`.
    pub vote: Vec<f32>,
}

/// All pairs of a set of receivers and lights.
#[derive(Clone, Debug)]
pub struct Pairs {
    /// One entry a light.
    pub lights: Vec<LightPairs>,
    /// Sum of w over blocked pairs.
    pub shadow_weight: f64,
    /// Sum of w over all pairs.
    pub total_weight: f64,
    /// Receivers that the pairs were made from.
    pub receivers: usize,
}

impl LightPairs {
    /// Number of pairs.
    #[must_use]
    pub fn len(&self) -> usize {
        self.vote.len()
    }

    /// True where no receiver faces the light.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.vote.is_empty()
    }

    /// Receiver position of pair `i`.
    #[must_use]
    pub fn point(&self, i: usize) -> Vec3 {
        Vec3::new(self.x[i], self.y[i], self.z[i])
    }

    fn with_capacity(light: Vec3, capacity: usize) -> Self {
        let column = || Vec::with_capacity(capacity);
        let receiver = Vec::with_capacity(capacity);
        Self { light, x: column(), y: column(), z: column(), receiver, vote: column() }
    }

    fn push(&mut self, p: Vec3, receiver: u32, vote: f32) {
        self.x.push(p.x);
        self.y.push(p.y);
        self.z.push(p.z);
        self.receiver.push(receiver);
        self.vote.push(vote);
    }
}

impl Pairs {
    /// Number of pairs.
    #[must_use]
    pub fn len(&self) -> usize {
        self.lights.iter().map(LightPairs::len).sum()
    }

    /// True where there is no pair at all.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.lights.iter().all(LightPairs::is_empty)
    }
}

/// Traces one shadow ray for every receiver that faces a light; `solid_angle` is that of all lights together.
#[must_use]
pub fn trace(mesh: &Mesh, receivers: &Receivers, lights: &[Vec3], solid_angle: f64) -> Pairs {
    trace_sparse(mesh, receivers, lights, solid_angle, 1)
}

/// The same with one in `stride` receivers for each light, drawn anew for each. Drawn, not counted off: a lattice of
/// receivers under a lattice of lights left some directions with the same corner of every triangle.
#[must_use]
pub fn trace_sparse(mesh: &Mesh, receivers: &Receivers, lights: &[Vec3], solid_angle: f64, stride: usize) -> Pairs {
    let share = (solid_angle / lights.len().max(1) as f64) as f32 * stride as f32;
    let lights: Vec<LightPairs> =
        lights.par_iter().enumerate().map(|(k, &l)| trace_light(mesh, receivers, l, share, (stride, k))).collect();
    let (mut shadow_weight, mut total_weight) = (0.0, 0.0);
    for vote in lights.iter().flat_map(|l| &l.vote) {
        shadow_weight += f64::from(vote.max(0.0));
        total_weight += f64::from(vote.abs());
    }
    Pairs { lights, shadow_weight, total_weight, receivers: receivers.points.len() }
}

fn trace_light(
    mesh: &Mesh,
    receivers: &Receivers,
    light: Vec3,
    solid_angle: f32,
    (stride, index): (usize, usize),
) -> LightPairs {
    let mut pairs = LightPairs::with_capacity(light, receivers.points.len() / 2 / stride);
    for fold in 0..2 {
        for i in (fold..receivers.points.len()).step_by(2) {
            if stride > 1 && !hash(index as u64, i as u64).is_multiple_of(stride as u64) {
                continue;
            }
            let cosine = receivers.normals[i].dot(light);
            if cosine <= 0.0 {
                continue;
            }
            let weight = receivers.weights[i] * cosine * solid_angle;
            let blocked = mesh.is_blocked(receivers.origins[i], light);
            pairs.push(receivers.points[i], i as u32, if blocked { weight } else { -weight });
        }
    }
    pairs
}
