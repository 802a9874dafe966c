//! Stochastic billboard clouds: the best of many random planes through triangles, greedily.
//!
//! A plane is drawn as that of a random triangle that no plane covers yet, likelier the larger it is, tilted at random
//! about a point of it by as much as moves the triangle's surroundings by the tolerance. Of the draws, the one is kept
//! that stands for the largest projected area of uncovered triangles, all corners within the tolerance; these are
//! then covered.
//!
//! Source: Lacewell, Edwards, Shirley, Thompson, "Stochastic Billboard Clouds for Interactive Foliage Rendering" (2006).

use super::{BaselineOptions, Unbounded};
use crate::{
    mesh::Mesh,
    sampling::{barycentric, hash, uniform},
};
use glam::{Quat, Vec2, Vec3};
use rayon::prelude::*;
use std::f32::consts::TAU;

/// Planes drawn for each one kept; the paper's examples draw 300 and 600.
const DRAWS: usize = 300;

/// Tilt at most, in tolerances per unit length: a plane that leaves its triangle by the tolerance at the distance of
/// the model's radius still stands for what surrounds the triangle.
const TILT: f32 = 1.0;

pub(super) fn planes(mesh: &Mesh, options: &BaselineOptions) -> Vec<Unbounded> {
    let mut open: Vec<u32> = (0..mesh.triangle_count() as u32).collect();
    let mut planes = Vec::new();
    while planes.len() < options.count && !open.is_empty() {
        let running = running_areas(mesh, &open);
        let seed = hash(options.seed, planes.len() as u64);
        let drawn = (0..DRAWS).into_par_iter().map(|i| {
            let plane = draw(mesh, (&open, &running), options.tolerance, hash(seed, i as u64));
            (captured_area(mesh, &open, &plane, options.tolerance), plane)
        });
        let drawn: Vec<(f64, Unbounded)> = drawn.collect();
        let Some((_, plane)) = drawn.into_iter().reduce(|a, b| if b.0 > a.0 { b } else { a }) else { break };
        let is_far = |face: &u32| !plane.is_near(&mesh.corners[*face as usize], options.tolerance);
        open.retain(is_far);
        planes.push(plane);
    }
    planes
}

fn running_areas(mesh: &Mesh, faces: &[u32]) -> Vec<f64> {
    let add = |sum: &mut f64, face: &u32| {
        *sum += f64::from(mesh.areas[*face as usize]);
        Some(*sum)
    };
    faces.iter().scan(0.0, add).collect()
}

/// A plane through a point of a random open triangle.
fn draw(mesh: &Mesh, (open, running): (&[u32], &[f64]), tolerance: f32, seed: u64) -> Unbounded {
    let number = |k: u64| uniform(seed, k);
    let at = number(0) * running[running.len() - 1];
    let face = open[running.partition_point(|&a| a <= at).min(open.len() - 1)];
    let point = mesh.point(face, barycentric(Vec2::new(number(1) as f32, number(2) as f32)));
    let normal = mesh.normals[face as usize];
    let (t, b) = normal.any_orthonormal_pair();
    let (sin, cos) = (TAU * number(3) as f32).sin_cos();
    let tilt = Quat::from_axis_angle((t * cos + b * sin).normalize(), TILT * tolerance * number(4) as f32);
    let normal: Vec3 = (tilt * normal).normalize();
    Unbounded { normal, offset: normal.dot(point) }
}

fn captured_area(mesh: &Mesh, faces: &[u32], plane: &Unbounded, tolerance: f32) -> f64 {
    let area = |face: &u32| {
        let i = *face as usize;
        let is_near = plane.is_near(&mesh.corners[i], tolerance);
        if is_near { f64::from(mesh.areas[i] * mesh.normals[i].dot(plane.normal).abs()) } else { 0.0 }
    };
    faces.iter().map(area).sum()
}
