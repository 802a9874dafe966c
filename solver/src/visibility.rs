//! The reference: traced visibility of (receiver, light) pairs.
//!
//! Out: per light, the receivers that face it, structure-of-arrays, each with a signed *vote*: its weight, positive
//! where the light is blocked, negative where it is not. A texel of an occluder texture should block exactly where
//! the votes of the pairs whose rays cross it sum to more than zero; everything later works on these four columns.
//!
//! Where surfaces let light pass, a fifth column says what arrives. A pair of which anything is taken counts as blocked;
//! how much a plane takes is decided with the lists.

use crate::{mesh::Mesh, receivers::Receivers, sampling::uniform};
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
    /// `+w` where blocked, `-w` where lit; `w = area x exposure x n.l x solid angle / rate`.
    pub vote: Vec<f32>,
    /// The share V of each linear colour that arrives, 0 to 1; empty for an opaque model, where the vote says it all.
    pub arrives: Vec<Vec3>,
}

/// All pairs of a set of receivers and lights.
#[derive(Clone, Debug)]
pub struct Pairs {
    /// One entry a light.
    pub lights: Vec<LightPairs>,
    /// Sum of w (1 - V) over all pairs, V the mean of the colours.
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

    /// The share of each colour that arrives of pair `i`.
    #[must_use]
    pub fn arriving(&self, i: usize) -> Vec3 {
        arriving(&self.vote, &self.arrives, i)
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
    trace_drawn(mesh, receivers, lights, solid_angle, |_, _| 1.0)
}

/// The same for some of the pairs: `rate(light, receiver)`, above 0, is the probability that one is drawn, and its vote
/// stands for the others. Drawn, not counted off: a lattice of receivers under a lattice of lights left some directions
/// with the same corner of every triangle.
#[must_use]
pub fn trace_drawn(
    mesh: &Mesh,
    receivers: &Receivers,
    lights: &[Vec3],
    solid_angle: f64,
    rate: impl Fn(usize, usize) -> f32 + Sync,
) -> Pairs {
    let share = (solid_angle / lights.len().max(1) as f64) as f32;
    let of_light = |(k, light): (usize, &Vec3)| {
        let draw = |i: usize| {
            let rate = rate(k, i).min(1.0);
            (rate >= 1.0 || uniform(k as u64, i as u64) < f64::from(rate)).then_some(rate)
        };
        trace_light(mesh, receivers, (*light, share), draw)
    };
    let lights: Vec<LightPairs> = lights.par_iter().enumerate().map(of_light).collect();
    let (mut shadow_weight, mut total_weight) = (0.0, 0.0);
    for light in &lights {
        for (i, vote) in light.vote.iter().enumerate() {
            shadow_weight += taken(&light.vote, &light.arrives, i);
            total_weight += f64::from(vote.abs());
        }
    }
    Pairs { lights, shadow_weight, total_weight, receivers: receivers.points.len() }
}

/// The share of each colour that arrives of pair `i` of two columns, `arrives` empty for an opaque model.
pub(crate) fn arriving(vote: &[f32], arrives: &[Vec3], i: usize) -> Vec3 {
    arrives.get(i).copied().unwrap_or(Vec3::splat(f32::from(u8::from(vote[i] <= 0.0))))
}

/// `w (1 - V)` of pair `i`.
pub(crate) fn taken(vote: &[f32], arrives: &[Vec3], i: usize) -> f64 {
    let share = arrives.get(i).map_or(1.0, |v| 1.0 - mean(*v));
    f64::from(vote[i].max(0.0) * share)
}

/// Of three colours.
pub(crate) fn mean(colors: Vec3) -> f32 {
    colors.element_sum() / 3.0
}

/// Traces the pairs of one light for which `draw(receiver)` gives the rate at which they were drawn.
fn trace_light(
    mesh: &Mesh,
    receivers: &Receivers,
    (light, solid_angle): (Vec3, f32),
    draw: impl Fn(usize) -> Option<f32>,
) -> LightPairs {
    let (x, y, z, receiver, vote, arrives) = Default::default();
    let mut pairs = LightPairs { light, x, y, z, receiver, vote, arrives };
    for (i, normal) in receivers.normals.iter().enumerate() {
        let cosine = normal.dot(light);
        if cosine <= 0.0 {
            continue;
        }
        let Some(rate) = draw(i) else { continue };
        let vote = receivers.weights[i] * cosine * solid_angle / rate;
        let origin = receivers.origins[i];
        let blocked = if mesh.is_opaque() {
            mesh.is_blocked(origin, light)
        } else {
            let arrives = mesh.transmitted(origin, light, f32::INFINITY);
            pairs.arrives.push(arrives);
            arrives != Vec3::ONE
        };
        pairs.push(receivers.points[i], i as u32, if blocked { vote } else { -vote });
    }
    pairs
}
