//! Sections: which triangles share a list of planes.
//!
//! In: a mesh, and a pilot sample of traced pairs. Out: a section for each triangle. Method: receivers are points of
//! (position, normal) with the shadow that falls on them as weight; the cluster with the largest weighted scatter is
//! split in two along its longest axis, until there are enough, and Lloyd's iterations settle the borders ("bisecting
//! k-means", Steinbach, Karypis, Kumar, "A Comparison of Document Clustering Techniques", 2000). Triangles go to the
//! nearest centre.
//!
//! Not guaranteed: that a section is connected.

use crate::{mesh::Mesh, receivers::Receivers, visibility::Pairs};
use glam::Vec3;

/// How a surface is divided.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SectionOptions {
    /// At most this many sections, 1 and up.
    pub count: usize,
}

/// A normal turned by a radian is as far as this way, unit space.
const NORMAL_SCALE: f32 = 0.5;

/// Share of a receiver's light that counts as shadow in any case: unshadowed surface is divided too, coarsely.
const FLOOR: f64 = 0.003;

/// Lloyd iterations after each split are few, at the end more.
const SETTLING: usize = 8;

type Feature = [f32; 6];

fn feature(p: Vec3, n: Vec3) -> Feature {
    let n = n * NORMAL_SCALE;
    [p.x, p.y, p.z, n.x, n.y, n.z]
}

fn distance(a: &Feature, b: &Feature) -> f32 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

/// Section of each triangle of the mesh, 0 up to the largest, none empty of receivers.
#[must_use]
pub fn divide(mesh: &Mesh, receivers: &Receivers, pairs: &Pairs, options: &SectionOptions) -> Vec<u32> {
    let mut weights = vec![0.0f64; receivers.points.len()];
    for light in &pairs.lights {
        for (&vote, &receiver) in light.vote.iter().zip(&light.receiver) {
            let share = if vote > 0.0 { 1.0 } else { FLOOR };
            weights[receiver as usize] += share * f64::from(vote.abs());
        }
    }
    let features: Vec<Feature> =
        receivers.points.iter().zip(&receivers.normals).map(|(p, n)| feature(*p, *n)).collect();
    let centres = cluster(&features, &weights, options.count);
    (0..mesh.triangle_count())
        .map(|t| {
            let [a, b, c] = mesh.corners[t];
            nearest(&centres, &feature((a + b + c) / 3.0, mesh.normals[t])) as u32
        })
        .collect()
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
        let Some(worst) = (0..clusters.len()).max_by(|&a, &b| clusters[a].scatter.total_cmp(&clusters[b].scatter).then(b.cmp(&a))) else {
            break;
        };
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
        let (mut sum, mut square, mut total) = ([0.0f64; 6], [0.0f64; 6], 0.0f64);
        for &i in &members {
            let w = weights[i as usize];
            total += w;
            for (k, f) in features[i as usize].iter().enumerate() {
                sum[k] += w * f64::from(*f);
                square[k] += w * f64::from(*f) * f64::from(*f);
            }
        }
        let inv = if total > 0.0 { 1.0 / total } else { 0.0 };
        let centre = sum.map(|s| (s * inv) as f32);
        let variance: [f64; 6] = std::array::from_fn(|k| (square[k] - sum[k] * sum[k] * inv).max(0.0));
        Self { members, centre, scatter: variance.iter().sum(), variance }
    }

    fn split(&self, features: &[Feature]) -> Option<(Vec<u32>, Vec<u32>)> {
        let axis = (0..6).max_by(|&a, &b| self.variance[a].total_cmp(&self.variance[b]))?;
        let (low, high): (Vec<u32>, Vec<u32>) =
            self.members.iter().partition(|&&i| features[i as usize][axis] <= self.centre[axis]);
        (!low.is_empty() && !high.is_empty()).then_some((low, high))
    }
}
