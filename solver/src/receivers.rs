//! Receivers: samples of the drawn surface, weighted by area and exposure.
//!
//! In: a mesh. Out: points stratified by area (one per equal share of the running area, R2 inside a triangle), each
//! with the normal of its side, its ray origin and its weight = area x exposure. Exposure is the cosine-weighted
//! share of outside directions from which the point can be seen, estimated with rays; points that no ray reaches
//! are dropped: what nobody sees weighs nothing. Holes of cut-out textures are no surface.

use crate::{
    mesh::{Mesh, Sides, ray_origin},
    sampling::{barycentric, cosine_hemisphere, r2, uniform},
};
use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// How the surface is sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReceiverOptions {
    /// Receivers wanted; about that many are returned. 1 and up; error of a fit falls with its square root.
    pub count: usize,
    /// Rays a receiver that estimate its exposure, 1 and up. Below 16 shallow hollows are dropped as invisible.
    pub exposure_rays: usize,
    /// Another seed gives other points.
    pub seed: u64,
}

/// A second draw may take at most this many times the wanted points: models with 90 % hidden surface still get the
/// count asked for, and one that is nearly all hidden costs a bounded time.
const MAX_OVERSAMPLING: usize = 12;

/// Surface samples; the vectors have one entry a receiver, in the order of the mesh's triangles.
#[derive(Clone, Debug, Default)]
pub struct Receivers {
    /// Points on the surface, unit space.
    pub points: Vec<Vec3>,
    /// Where rays start: just outside the surface.
    pub origins: Vec<Vec3>,
    /// Unit normal of the side that the receiver stands for.
    pub normals: Vec<Vec3>,
    /// Area (unit space) x exposure.
    pub weights: Vec<f32>,
    /// The mesh's triangle that each lies on; empty for those of a ground.
    pub triangles: Vec<u32>,
}

/// One receiver.
pub(crate) struct Receiver {
    pub point: Vec3,
    pub normal: Vec3,
    /// The area that it stands for.
    pub area: f32,
    pub triangle: Option<u32>,
}

/// Samples the drawn surface of `mesh`.
#[must_use]
pub fn sample(mesh: &Mesh, options: &ReceiverOptions) -> Receivers {
    let all: Vec<u32> = (0..mesh.triangle_count() as u32).collect();
    sample_triangles(mesh, &all, options)
}

/// Samples the drawn surface of some triangles, given in rising order.
#[must_use]
pub fn sample_triangles(mesh: &Mesh, triangles: &[u32], options: &ReceiverOptions) -> Receivers {
    let strata = Strata::new(mesh, triangles);
    let first = draw(mesh, &strata, options, options.count);
    let kept = first.points.len();
    // Hidden surface was drawn in vain: draw again so that about `count` are left.
    if kept == 0 || kept * 5 >= options.count * 4 {
        return first;
    }
    let wanted = (options.count * options.count / kept).min(options.count * MAX_OVERSAMPLING);
    draw(mesh, &strata, options, wanted)
}

/// The drawn sides with their running area.
struct Strata {
    /// Triangle and whether its front is meant.
    sides: Vec<(u32, f32)>,
    /// Area up to and including each side.
    running_area: Vec<f64>,
}

impl Strata {
    fn new(mesh: &Mesh, triangles: &[u32]) -> Self {
        let (mut sides, mut running_area, mut total) = (Vec::new(), Vec::new(), 0.0);
        for &triangle in triangles {
            let triangle = triangle as usize;
            let signs: &[f32] = if mesh.sides[triangle] == Sides::Both { &[1.0, -1.0] } else { &[1.0] };
            for &sign in signs {
                total += f64::from(mesh.areas[triangle]);
                sides.push((triangle as u32, sign));
                running_area.push(total);
            }
        }
        Self { sides, running_area }
    }
}

fn draw(mesh: &Mesh, strata: &Strata, options: &ReceiverOptions, count: usize) -> Receivers {
    let total = strata.running_area.last().copied().unwrap_or(0.0);
    if strata.sides.is_empty() {
        return Receivers::default();
    }
    let area = (total / count as f64) as f32;
    let one = |i: usize| {
        let at = (i as f64 + uniform(options.seed, i as u64)) / count as f64 * total;
        let side = strata.running_area.partition_point(|&a| a <= at).min(strata.sides.len() - 1);
        let (triangle, sign) = strata.sides[side];
        let weights = barycentric(r2(options.seed, i as u64));
        let (point, normal) = (mesh.point(triangle, weights), mesh.normals[triangle as usize] * sign);
        mesh.is_solid(triangle, weights).then_some(Receiver { point, normal, area, triangle: Some(triangle) })
    };
    seen(mesh, count, options, one)
}

/// Those of `count` receivers that are there and that somebody can see.
pub(crate) fn seen(
    mesh: &Mesh,
    count: usize,
    options: &ReceiverOptions,
    one: impl Fn(usize) -> Option<Receiver> + Sync,
) -> Receivers {
    let weighted = |i: usize| {
        let receiver = one(i)?;
        let origin = ray_origin(receiver.point, receiver.normal);
        let exposure = exposure(mesh, origin, receiver.normal, options, i as u64);
        (exposure > 0.0).then_some((receiver, origin, exposure))
    };
    let drawn: Vec<_> = (0..count).into_par_iter().map(weighted).collect();
    let mut receivers = Receivers::default();
    for (receiver, origin, exposure) in drawn.into_iter().flatten() {
        receivers.points.push(receiver.point);
        receivers.origins.push(origin);
        receivers.normals.push(receiver.normal);
        receivers.weights.push(receiver.area * exposure);
        receivers.triangles.extend(receiver.triangle);
    }
    receivers
}

/// Share of cosine-weighted directions above `origin` that leave the model.
fn exposure(mesh: &Mesh, origin: Vec3, normal: Vec3, options: &ReceiverOptions, index: u64) -> f32 {
    let n = options.exposure_rays;
    let turn = r2(options.seed ^ 0x5EED, index);
    let open = (0..n).filter(|&k| {
        let stratum = Vec2::new(((k as f32 + 0.5) / n as f32 + turn.x).fract(), (r2(0, k as u64).y + turn.y).fract());
        !mesh.is_blocked(origin, cosine_hemisphere(normal, stratum))
    });
    open.count() as f32 / n as f32
}
