//! Sections: which triangles share a list of planes.
//!
//! In: a mesh, and a pilot sample of traced pairs. Out: a section for each triangle. Method: receivers are points of
//! (position, normal) with the shadow that falls on them as weight; the cluster with the largest weighted scatter is
//! split in two along its longest axis, until there are enough, and Lloyd's iterations settle the borders ("bisecting
//! k-means", Steinbach, Karypis, Kumar, "A Comparison of Document Clustering Techniques", 2000). Triangles go to the
//! nearest centre.
//!
//! Not guaranteed: that a section is connected.

use crate::{
    importance::Rates,
    lights::LightDomain,
    mesh::Mesh,
    pair_table::PairTable,
    receivers::{ReceiverOptions, Receivers, sample_triangles},
    sampling::hash,
    symmetry::Mirror,
    visibility::{Pairs, trace_drawn},
};
use glam::Vec3;
use rayon::prelude::*;
use std::collections::HashMap;

/// How the pairs of sections are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TraceOptions {
    /// Pairs of all sections together, about, the same number for each. By shadow instead, sections with little of it
    /// had too few to keep false shadows out (held-out error 0.079 against 0.074).
    pub pairs: usize,
    /// Light directions. What over-fits first: 48 sections, 12 M pairs, held-out error 0.072 with 384 lights and 0.060
    /// with 1024 on half of the receivers each.
    pub lights: usize,
    /// One in this many receivers that face a light is drawn for it, more where shadow is undecided (`importance`).
    pub stride: usize,
    /// Rays a receiver that estimate its exposure.
    pub exposure_rays: usize,
    /// Another seed draws other receivers and lights.
    pub seed: u64,
}

/// Fewest receivers of a section.
const MIN_RECEIVERS: usize = 64;

/// A normal turned by a radian is as far as this way, unit space.
const NORMAL_SCALE: f32 = 0.5;

/// Share of a receiver's light that counts as shadow in any case: unshadowed surface is divided too, coarsely.
const FLOOR: f64 = 0.003;

/// Lloyd iterations after each split are few, at the end more.
const SETTLING: usize = 8;

/// Position and normal.
pub(crate) type Feature = [f32; 6];

pub(crate) fn feature(p: Vec3, n: Vec3) -> Feature {
    let n = n * NORMAL_SCALE;
    [p.x, p.y, p.z, n.x, n.y, n.z]
}

fn distance(a: &Feature, b: &Feature) -> f32 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

/// Section of each triangle of the mesh, below `count`. Triangles with the same entry in `unit_of` are one in the file
/// and get the same section. With a mirror, section 2k + 1 is what lies where the image of section 2k does: both halves
/// are folded onto the near one before they are clustered.
#[must_use]
pub fn divide(
    mesh: &Mesh,
    unit_of: &[u32],
    (receivers, pairs): (&Receivers, &Pairs),
    count: usize,
    mirror: Option<&Mirror>,
) -> Vec<u32> {
    let halves = if mirror.is_some() { 2 } else { 1 };
    let folded = |p: Vec3, n: Vec3| match mirror {
        Some(mirror) if mirror.is_far(p) => (feature(mirror.point(p), mirror.vector(n)), 1),
        _ => (feature(p, n), 0),
    };
    let mut weights = vec![0.0f64; receivers.points.len()];
    for light in &pairs.lights {
        for (&vote, &receiver) in light.vote.iter().zip(&light.receiver) {
            let share = if vote > 0.0 { 1.0 } else { FLOOR };
            weights[receiver as usize] += share * f64::from(vote.abs());
        }
    }
    let features: Vec<Feature> =
        receivers.points.iter().zip(&receivers.normals).map(|(p, n)| folded(*p, *n).0).collect();
    let centres = cluster(&features, &weights, (count / halves).max(1));
    let mut section_of_unit: HashMap<u32, u32> = HashMap::new();
    let section = |triangle: usize| {
        let [a, b, c] = mesh.corners[triangle];
        let own = || {
            let (feature, half) = folded((a + b + c) / 3.0, mesh.normals[triangle]);
            (nearest(&centres, &feature) * halves + half) as u32
        };
        *section_of_unit.entry(unit_of[triangle]).or_insert_with(own)
    };
    (0..mesh.triangle_count()).map(section).collect()
}

/// The lights that pairs are traced under.
pub(crate) struct Lights<'a> {
    pub lights: Vec<Vec3>,
    /// Those of the lists.
    pub directions: &'a [Vec3],
    pub solid_angle: f64,
}

impl<'a> Lights<'a> {
    pub(crate) fn new(directions: &'a [Vec3], domain: LightDomain, options: &TraceOptions) -> Self {
        let lights = domain.directions(options.lights, hash(options.seed, 0));
        Self { lights, directions, solid_angle: domain.solid_angle() }
    }

    /// One in `stride` of the pairs.
    fn evenly(&self, mesh: &Mesh, receivers: &Receivers, stride: usize) -> PairTable {
        self.drawn(mesh, receivers, |_, _| 1.0 / stride as f32)
    }

    /// About `wanted` pairs, where shadow is undecided.
    pub(crate) fn undecided(&self, mesh: &Mesh, receivers: &Receivers, wanted: usize, seed: u64) -> PairTable {
        let rates = Rates::new((mesh, receivers), &self.lights, self.directions, wanted, seed);
        self.drawn(mesh, receivers, |light, receiver| rates.of(light, receiver))
    }

    fn drawn(&self, mesh: &Mesh, receivers: &Receivers, rate: impl Fn(usize, usize) -> f32 + Sync) -> PairTable {
        PairTable::new(&trace_drawn(mesh, receivers, &self.lights, self.solid_angle, rate), self.directions)
    }
}

impl TraceOptions {
    /// Receivers of each of `sections`: half of them face a light.
    pub(crate) fn receivers(&self, sections: usize) -> usize {
        (2 * self.pairs * self.stride / (sections.max(1) * self.lights.max(1))).max(MIN_RECEIVERS)
    }
}

/// The pairs of each section under the lights of `domain`, for lists with the given directions. A whole model's are
/// drawn evenly: with rates, one in 8, its planes were worse (11 of teapot_three, seed 7: 0.159 against 0.137).
#[must_use]
pub fn trace(
    mesh: &Mesh,
    section_of: &[u32],
    directions: &[Vec3],
    domain: LightDomain,
    options: &TraceOptions,
) -> Vec<PairTable> {
    let count = section_of.iter().max().map_or(0, |last| *last as usize + 1);
    let mut triangles = vec![Vec::new(); count];
    for (triangle, &section) in (0..).zip(section_of) {
        triangles[section as usize].push(triangle);
    }
    let lights = Lights::new(directions, domain, options);
    let of_section = |(section, triangles): (usize, &Vec<u32>)| {
        let sampling = ReceiverOptions {
            count: options.receivers(count),
            exposure_rays: options.exposure_rays,
            seed: hash(options.seed, 1 + section as u64),
        };
        let receivers = sample_triangles(mesh, triangles, &sampling);
        if count > 1 {
            lights.undecided(mesh, &receivers, options.pairs / count, hash(sampling.seed, 0))
        } else {
            lights.evenly(mesh, &receivers, options.stride)
        }
    };
    triangles.par_iter().enumerate().map(of_section).collect()
}

fn nearest(centres: &[Feature], f: &Feature) -> usize {
    let mut best = (0, f32::INFINITY);
    for (i, centre) in centres.iter().enumerate() {
        let d = distance(centre, f);
        if d < best.1 {
            best = (i, d);
        }
    }
    best.0
}

fn cluster(features: &[Feature], weights: &[f64], count: usize) -> Vec<Feature> {
    let all: Vec<u32> = (0..features.len() as u32).collect();
    let mut clusters = vec![Cluster::new(features, weights, all)];
    while clusters.len() < count {
        let larger = |a: &usize, b: &usize| clusters[*a].scatter.total_cmp(&clusters[*b].scatter).then(b.cmp(a));
        let Some(worst) = (0..clusters.len()).max_by(larger) else { break };
        let Some((low, high)) = clusters[worst].split(features) else { break };
        clusters[worst] = Cluster::new(features, weights, low);
        clusters.push(Cluster::new(features, weights, high));
    }
    let mut centres: Vec<Feature> = clusters.iter().map(|c| c.centre).collect();
    for _ in 0..SETTLING {
        let mut sums = vec![([0.0f64; 6], 0.0f64); centres.len()];
        for (f, &w) in features.iter().zip(weights) {
            let (sum, total) = &mut sums[nearest(&centres, f)];
            sum.iter_mut().zip(f).for_each(|(s, f)| *s += w * f64::from(*f));
            *total += w;
        }
        for (centre, (sum, total)) in centres.iter_mut().zip(sums) {
            if total > 0.0 {
                *centre = sum.map(|s| (s / total) as f32);
            }
        }
    }
    centres
}

struct Cluster {
    members: Vec<u32>,
    centre: Feature,
    /// Weighted sum of squared distances.
    scatter: f64,
    variance: [f64; 6],
}

impl Cluster {
    fn new(features: &[Feature], weights: &[f64], members: Vec<u32>) -> Self {
        let (centre, variance) = moments(features, &members, |i| weights[i as usize]);
        Self { members, centre, scatter: variance.iter().sum(), variance }
    }

    fn split(&self, features: &[Feature]) -> Option<(Vec<u32>, Vec<u32>)> {
        let axis = widest(&self.variance)?;
        let (low, high): (Vec<u32>, Vec<u32>) =
            self.members.iter().partition(|&&i| features[i as usize][axis] <= self.centre[axis]);
        (!low.is_empty() && !high.is_empty()).then_some((low, high))
    }
}

/// Weighted mean of some features, and per axis the weighted sum of squared distances from it.
fn moments(features: &[Feature], members: &[u32], weight: impl Fn(u32) -> f64) -> (Feature, [f64; 6]) {
    let (mut sum, mut square, mut total) = ([0.0f64; 6], [0.0f64; 6], 0.0f64);
    for &i in members {
        let w = weight(i);
        total += w;
        for (k, f) in features[i as usize].iter().enumerate() {
            sum[k] += w * f64::from(*f);
            square[k] += w * f64::from(*f) * f64::from(*f);
        }
    }
    let inv = if total > 0.0 { 1.0 / total } else { 0.0 };
    let variance = std::array::from_fn(|k| (square[k] - sum[k] * sum[k] * inv).max(0.0));
    (sum.map(|s| (s * inv) as f32), variance)
}

fn widest(variance: &[f64; 6]) -> Option<usize> {
    (0..6).max_by(|&a, &b| variance[a].total_cmp(&variance[b]))
}

/// The axis along which some features, all of the same weight, are spread most.
pub(crate) fn widest_axis(features: &[Feature], members: &[u32]) -> usize {
    widest(&moments(features, members, |_| 1.0).1).unwrap_or(0)
}
