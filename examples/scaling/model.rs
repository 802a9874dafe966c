//! One shape with as many triangles as wanted: a trefoil knot over a ground with waves. Its shadow stays the same while
//! triangles get smaller, so that what grows is the cost alone.

use glam::{DVec3, Vec2};
use shadowfit_solver::mesh::{Sides, Soup};
use std::f64::consts::TAU;

/// Share of the triangles that the knot gets.
const KNOT_SHARE: f64 = 0.75;

/// Rings of the knot per corner of a ring: cells come out about square.
const RINGS_PER_SIDE: usize = 8;

const TUBE_M: f64 = 0.45;

/// Triangles that share vertices, metres, counter-clockwise seen from outside.
#[derive(Default)]
pub struct Model {
    /// Corners.
    pub positions: Vec<[f32; 3]>,
    /// Indices of corners.
    pub triangles: Vec<[u32; 3]>,
}

impl Model {
    /// About `count` triangles, 500 and up.
    pub fn with_triangles(count: usize) -> Self {
        let cells = |share: f64| (0.5 * share * count as f64).max(1.0);
        let sides = (cells(KNOT_SHARE) / RINGS_PER_SIDE as f64).sqrt().round().max(3.0) as usize;
        let across = cells(1.0 - KNOT_SHARE).sqrt().round() as usize;
        let mut model = Self::default();
        model.add_grid([sides, RINGS_PER_SIDE * sides], [true, true], |around, along| knot(along, around));
        model.add_grid([across, across], [false, false], |z, x| ground(8.0 * x - 4.0, 8.0 * z - 4.0));
        model
    }

    /// A grid of `n` x `m` cells over `f(0..1, 0..1)`, joined at the ends of the axes that are closed. The front is the
    /// side of `df/di x df/dj`.
    fn add_grid(&mut self, [n, m]: [usize; 2], closed: [bool; 2], f: impl Fn(f64, f64) -> DVec3) {
        let first = self.positions.len();
        let [rows, columns] = [n + usize::from(!closed[0]), m + usize::from(!closed[1])];
        for i in 0..rows {
            let row = (0..columns).map(|j| f(i as f64 / n as f64, j as f64 / m as f64).as_vec3().to_array());
            self.positions.extend(row);
        }
        let at = |i: usize, j: usize| (first + (i % rows) * columns + j % columns) as u32;
        for (i, j) in (0..n).flat_map(|i| (0..m).map(move |j| (i, j))) {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            self.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }

    /// As a reader delivers it.
    pub fn to_soup(&self) -> Soup {
        let count = self.triangles.len();
        let corner = |i: u32| DVec3::from_array(self.positions[i as usize].map(f64::from));
        Soup {
            corners_model: self.triangles.iter().map(|triangle| triangle.map(corner)).collect(),
            sides: vec![Sides::Front; count],
            cutout: vec![None; count],
            cutout_uv: vec![[Vec2::ZERO; 3]; count],
            cutouts: Vec::new(),
        }
    }
}

/// The trefoil's centre line at `t` turns.
fn knot_centre(t: f64) -> DVec3 {
    let (a, b) = (2.0 * TAU * t, 3.0 * TAU * t);
    DVec3::new((2.0 + b.cos()) * a.cos(), b.sin(), (2.0 + b.cos()) * a.sin())
}

/// A point of the knot's tube, both ways around in turns.
fn knot(along: f64, around: f64) -> DVec3 {
    let (before, here, after) = (knot_centre(along - 1e-3), knot_centre(along), knot_centre(along + 1e-3));
    let tangent = (after - before).normalize();
    let normal = (after + before - 2.0 * here).reject_from(tangent).normalize();
    let (sin, cos) = (TAU * around).sin_cos();
    here + (normal * cos + tangent.cross(normal) * sin) * TUBE_M
}

/// The ground at `x`, `z` metres.
fn ground(x: f64, z: f64) -> DVec3 {
    DVec3::new(x, -2.2 + 0.25 * (1.3 * x + 0.4).sin() * (1.1 * z - 0.2).cos(), z)
}
