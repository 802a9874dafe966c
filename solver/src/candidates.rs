//! Candidate planes: where a search starts to look.
//!
//! Generators, each a few hundred to a few thousand planes:
//! - *uniform*: directions over the hemisphere times offsets over the model's extent: misses nothing large;
//! - *medial*: the plane of a random surface point moved to the middle of the solid behind it: the mid-plane of
//!   plates, wings, fins (Coleman's "cut planes"); the surface's own plane where the solid has no thickness;
//! - *section*: planes through such a middle point at right angles to the surface: profiles of limbs.
//!
//! Planes tangent to a thick body (the habit of billboard clouds) are not made: receivers lie on them.

use crate::{
    lights::LightDomain,
    mesh::{Mesh, ray_origin},
    sampling::{barycentric, r2, uniform},
};
use glam::Vec3;

/// An unbounded plane, `normal . p = offset`, unit space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// Unit normal.
    pub normal: Vec3,
    /// Signed distance from the origin.
    pub offset: f32,
    /// Which generator made it.
    pub origin: Generator,
}

/// Where a candidate comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Generator {
    /// Direction x offset grid.
    Uniform,
    /// Middle plane of the solid under a surface point.
    Medial,
    /// Across the solid under a surface point.
    Section,
}

/// How many candidates are made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CandidateOptions {
    /// Directions of the uniform generator, 1 and up; neighbours are about 200/sqrt(n) degrees apart.
    pub directions: usize,
    /// Offsets per direction, 1 and up.
    pub offsets: usize,
    /// Surface points of the medial and section generators each.
    pub surface_points: usize,
    /// Another seed gives other candidates.
    pub seed: u64,
}

impl Default for CandidateOptions {
    fn default() -> Self {
        Self { directions: 150, offsets: 12, surface_points: 400, seed: 0 }
    }
}

/// Planes square to the axes have this many times the offsets of the others.
const AXIS_FINENESS: usize = 4;

/// All candidates of a mesh, in a fixed order.
#[must_use]
pub fn generate(mesh: &Mesh, options: &CandidateOptions) -> Vec<Candidate> {
    let mut out = uniform_planes(mesh, options);
    for (index, (point, normal)) in medial_points(mesh, options).into_iter().enumerate() {
        out.push(Candidate { normal, offset: normal.dot(point), origin: Generator::Medial });
        let (t, b) = normal.any_orthonormal_pair();
        let (sin, cos) = (std::f64::consts::PI * uniform(options.seed ^ 0x5EC7, index as u64)).sin_cos();
        let across = t * cos as f32 + b * sin as f32;
        out.push(Candidate { normal: across, offset: across.dot(point), origin: Generator::Section });
    }
    out
}

fn uniform_planes(mesh: &Mesh, options: &CandidateOptions) -> Vec<Candidate> {
    let mut out = Vec::with_capacity(options.directions * options.offsets);
    // The three axes first, and finer: models are built along them, with rims, floors and rings that a plane must hit
    // within a hundredth of their size.
    let axes = [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| (axis, options.offsets * AXIS_FINENESS));
    let lattice = LightDomain::Hemisphere.directions(options.directions, options.seed);
    for (normal, offsets) in axes.into_iter().chain(lattice.into_iter().map(|n| (n, options.offsets))) {
        let heights = || mesh.corners.iter().flatten().map(|p| normal.dot(*p));
        let (low, high) = heights().fold((f32::MAX, f32::MIN), |(l, h), x| (l.min(x), h.max(x)));
        for k in 0..offsets {
            let offset = low + (high - low) * (k as f32 + 0.5) / offsets as f32;
            out.push(Candidate { normal, offset, origin: Generator::Uniform });
        }
    }
    out
}

/// Points half-way through the solid under area-uniform surface points, with the surface normal there.
fn medial_points(mesh: &Mesh, options: &CandidateOptions) -> Vec<(Vec3, Vec3)> {
    let mut running = Vec::with_capacity(mesh.areas.len());
    let total = mesh.areas.iter().fold(0.0f64, |sum, &a| {
        running.push(sum + f64::from(a));
        sum + f64::from(a)
    });
    let n = options.surface_points;
    (0..n)
        .map(|i| {
            let at = (i as f64 + uniform(options.seed ^ 0x3ED1, i as u64)) / n as f64 * total;
            let triangle = running.partition_point(|&a| a <= at).min(running.len() - 1);
            let normal = mesh.normals[triangle];
            let point = mesh.point(triangle as u32, barycentric(r2(options.seed ^ 0x3ED1, i as u64)));
            // Thickness: the way inwards to a surface seen from its back. Open surfaces have none.
            let inward = mesh.nearest(ray_origin(point, -normal), -normal, |_, _| true);
            let thickness = match inward {
                Some(hit) if mesh.normals[hit.triangle as usize].dot(-normal) > 0.0 => hit.distance,
                _ => 0.0,
            };
            (point - normal * (0.5 * thickness), normal)
        })
        .collect()
}
