//! Proposals: where the search looks for a plane.
//!
//! In: pairs that nothing explains yet. Out: rectangles across the whole model, through the middle of what blocks some
//! of these pairs: along the blocker's surface (Coleman's "cut planes"), across it, square to the light, square to an
//! axis, and anyhow.

use crate::{
    mesh::{Mesh, ray_origin},
    pair_table::PairTable,
    plane::ShadowPlane,
    rectangle::around_section,
    sampling::{hash, uniform},
};
use glam::Vec3;
use rayon::prelude::*;

/// Blockers thicker than this are cut here, unit space: the middle of a large body is far from what casts.
const MAX_THICKNESS: f32 = 0.4;

/// Rays start this far from the receiver when its blocker is looked up, unit space.
const LOOKUP_OFFSET: f32 = 1e-4;

/// Planes proposed through one blocker.
const PER_BLOCKER: usize = 5;

/// A flat model has a box without thickness: sections of it get some.
const PAD: f32 = 1e-3;

/// A model and its box.
#[derive(Clone, Copy)]
pub struct Place<'a> {
    mesh: &'a Mesh,
    low: Vec3,
    high: Vec3,
}

impl<'a> Place<'a> {
    /// Measures the box.
    #[must_use]
    pub fn new(mesh: &'a Mesh) -> Self {
        let corners = || mesh.corners.iter().flatten();
        let low = corners().fold(Vec3::INFINITY, |a, p| a.min(*p)) - PAD;
        let high = corners().fold(Vec3::NEG_INFINITY, |a, p| a.max(*p)) + PAD;
        Self { mesh, low, high }
    }

    fn through_blocker(&self, point: Vec3, light: Vec3, seed: u64) -> Vec<ShadowPlane> {
        let Some(hit) = self.mesh.nearest(point + light * LOOKUP_OFFSET, light, |_, _| true) else { return Vec::new() };
        let surface = self.mesh.normals[hit.triangle as usize];
        let inward = if surface.dot(light) > 0.0 { surface } else { -surface };
        let entry = point + light * (LOOKUP_OFFSET + hit.distance);
        let thickness =
            self.mesh.nearest(ray_origin(entry, inward), inward, |_, _| true).map_or(0.0, |hit| hit.distance);
        let middle = entry + inward * (0.5 * thickness.min(MAX_THICKNESS));
        let (t, b) = surface.any_orthonormal_pair();
        let (sin, cos) = (std::f64::consts::TAU * uniform(seed, 0)).sin_cos();
        let across = t * cos as f32 + b * sin as f32;
        let y = 2.0 * uniform(seed, 1) - 1.0;
        let (sin, cos) = (std::f64::consts::TAU * uniform(seed, 2)).sin_cos();
        let r = (1.0 - y * y).sqrt();
        let any = Vec3::new((r * cos) as f32, y as f32, (r * sin) as f32);
        let axis = Vec3::AXES[(hash(seed, 3) % 3) as usize];
        let normals: [Vec3; PER_BLOCKER] = [surface, across, light, axis, any];
        normals.iter().filter_map(|n| around_section(self.low, self.high, *n, n.dot(middle))).collect()
    }
}

/// Planes through the blockers of a few blocked pairs, drawn by their votes; rectangles across the whole model.
#[must_use]
pub fn propose(place: &Place, pairs: &PairTable, count: usize, seed: u64) -> Vec<ShadowPlane> {
    let total: f64 = pairs.vote.iter().map(|vote| f64::from(vote.max(0.0))).sum();
    let step = total * PER_BLOCKER as f64 / count.max(1) as f64;
    let mut due = step * uniform(seed, 1);
    let mut drawn = Vec::new();
    for rows in &pairs.lights {
        for i in rows.start..rows.end {
            due -= f64::from(pairs.vote[i].max(0.0));
            if due < 0.0 && pairs.vote[i] > 0.0 {
                due += step * (-due / step).ceil();
                drawn.push((pairs.point(i), rows.light));
            }
        }
    }
    let planes =
        |(k, (point, light)): (usize, &(Vec3, Vec3))| place.through_blocker(*point, *light, hash(seed, 2 + k as u64));
    drawn.par_iter().enumerate().flat_map_iter(planes).collect()
}
