//! Billboard clouds: the densest planes of plane space, greedily.
//!
//! Planes are (theta, phi, rho): the angles of a normal and the distance from the centre. A triangle is *valid* for a
//! plane that passes all its corners within the tolerance. A cell of plane space has as density the projected area of
//! the triangles that are valid for some plane in it, minus a multiple of the projected area of those that it *nearly
//! misses* on the inside: without that penalty a plane leaves slivers of the model outside. The densest cell is
//! refined: it and its neighbours are halved, the densest part is taken, until the plane in the middle is valid for
//! all the triangles of its cell; these are taken out, and the next plane is looked for.
//!
//! Source: Decoret, Durand, Sillion, Dorsey, "Billboard Clouds for Extreme Model Simplification" (2003). Densities are
//! summed anew for each plane rather than kept up to date: the sum is the same.

use super::{BaselineOptions, Unbounded};
use crate::{lights::direction, mesh::Mesh};
use glam::Vec3;
use rayon::prelude::*;
use std::f32::consts::{PI, TAU};

/// Cells along theta, phi, rho: 11 degrees, and as fine in rho as half of the default tolerance.
const CELLS: [usize; 3] = [32, 16, 20];

/// How much more a near miss costs than a valid triangle brings, as published.
const MISS_PENALTY: f64 = 10.0;

/// Halvings of a cell at most: 11 degrees become 0.01, where corners in unit space move by 2e-4 of it.
const MAX_HALVINGS: usize = 10;

/// Densities that differ by less than this share are equal: the same triangles summed in another order.
const SAME_DENSITY: f64 = 1e-9;

/// What a cell stands for.
#[derive(Clone, Copy, Default)]
struct Density {
    /// Projected area, less the penalty.
    area: f64,
    /// Projected area x how far off the middle of each triangle's validity the cell lies: of equally dense cells the
    /// one is taken that passes its triangles most closely.
    off_middle: f64,
}

/// A block of cells in plane space.
struct Grid {
    low: [f32; 3],
    step: [f32; 3],
    cells: [usize; 3],
}

impl Grid {
    /// All of plane space: normals in any direction, the farthest corner at distance 1.
    fn whole() -> Self {
        let [theta, phi, rho] = CELLS;
        Self { low: [0.0, -0.5 * PI, 0.0], step: [TAU / theta as f32, PI / phi as f32, 1.0 / rho as f32], cells: CELLS }
    }

    /// One cell and its neighbours, halved.
    fn around(&self, cell: [usize; 3]) -> Self {
        let low = std::array::from_fn(|a| self.low[a] + (cell[a] as f32 - 1.0) * self.step[a]);
        Self { low, step: self.step.map(|step| 0.5 * step), cells: [6; 3] }
    }

    fn at(&self, axis: usize, position: f32) -> f32 {
        self.low[axis] + self.step[axis] * position
    }

    fn cell(&self, index: usize) -> [usize; 3] {
        let [_, phi, rho] = self.cells;
        [index / (phi * rho), index / rho % phi, index % rho]
    }

    /// Normals in the corners of a column of cells, and in its middle.
    fn normals(&self, theta: usize, phi: usize) -> ([Vec3; 4], Vec3) {
        let normal = |t: f32, p: f32| direction(self.at(0, theta as f32 + t), self.at(1, phi as f32 + p));
        ([normal(0.0, 0.0), normal(1.0, 0.0), normal(0.0, 1.0), normal(1.0, 1.0)], normal(0.5, 0.5))
    }

    fn middle(&self, [theta, phi, rho]: [usize; 3]) -> Unbounded {
        Unbounded { normal: self.normals(theta, phi).1, offset: self.at(2, rho as f32 + 0.5) }
    }

    /// Density of each cell.
    fn densities(&self, mesh: &Mesh, faces: &[u32], tolerance: f32) -> Vec<Density> {
        let [thetas, phis, rhos] = self.cells;
        let column = |index: usize| {
            let (corners, middle) = self.normals(index / phis, index % phis);
            let mut density = vec![Density::default(); rhos];
            for &face in faces {
                let Some((least, most)) = validity(&mesh.corners[face as usize], &corners, tolerance) else { continue };
                let area = f64::from(mesh.areas[face as usize] * mesh.normals[face as usize].dot(middle).abs());
                for rho in self.rhos(least, most) {
                    density[rho].area += area;
                    let off = self.at(2, rho as f32 + 0.5) - 0.5 * (least + most);
                    density[rho].off_middle += area * f64::from(off.abs());
                }
                for rho in self.rhos(least - tolerance, least) {
                    if self.at(2, rho as f32 + 1.0) < least {
                        density[rho].area -= MISS_PENALTY * area;
                    }
                }
            }
            density
        };
        (0..thetas * phis).into_par_iter().flat_map_iter(column).collect()
    }

    /// The cells that `least..=most` reaches into.
    fn rhos(&self, least: f32, most: f32) -> std::ops::Range<usize> {
        let position = |rho: f32| (rho - self.low[2]) / self.step[2];
        let end = (position(most).floor() + 1.0).max(0.0) as usize;
        (position(least).floor().max(0.0) as usize).min(self.cells[2])..end.min(self.cells[2])
    }

    /// Is a face valid for some plane of the cell?
    fn holds(&self, [theta, phi, rho]: [usize; 3], corners: &[Vec3; 3], tolerance: f32) -> bool {
        let range = validity(corners, &self.normals(theta, phi).0, tolerance);
        range.is_some_and(|(least, most)| self.rhos(least, most).contains(&rho))
    }
}

/// Distances at which a plane with some normal of a cell passes all corners of a face within the tolerance: the union
/// over the cell's corners, the intersection over the face's.
fn validity(corners: &[Vec3; 3], normals: &[Vec3; 4], tolerance: f32) -> Option<(f32, f32)> {
    let (mut least, mut most) = (f32::MIN, f32::MAX);
    for p in corners {
        let heights = normals.map(|n| n.dot(*p));
        least = least.max(heights.into_iter().fold(f32::MAX, f32::min) - tolerance);
        most = most.min(heights.into_iter().fold(f32::MIN, f32::max) + tolerance);
    }
    (least <= most && most >= 0.0).then_some((least, most))
}

fn densest(densities: &[Density]) -> Option<usize> {
    let better = |a: &Density, b: &Density| {
        let same = SAME_DENSITY * a.area.abs().max(b.area.abs());
        a.area > b.area + same || (a.area > b.area - same && a.off_middle < b.off_middle)
    };
    (0..densities.len()).reduce(|best, i| if better(&densities[i], &densities[best]) { i } else { best })
}

/// The densest plane, and the faces that it stands for.
fn densest_plane(mesh: &Mesh, faces: &[u32], tolerance: f32) -> Option<(Unbounded, Vec<u32>)> {
    let corners = |face: &u32| &mesh.corners[*face as usize];
    let held_by = |faces: &[u32], grid: &Grid, cell: [usize; 3]| -> Vec<u32> {
        faces.iter().copied().filter(|face| grid.holds(cell, corners(face), tolerance)).collect()
    };
    let mut grid = Grid::whole();
    let mut cell = grid.cell(densest(&grid.densities(mesh, faces, tolerance))?);
    let mut held = held_by(faces, &grid, cell);
    for _ in 0..MAX_HALVINGS {
        let plane = grid.middle(cell);
        if held.iter().all(|face| plane.is_near(corners(face), tolerance)) {
            break;
        }
        let finer = grid.around(cell);
        let next = finer.cell(densest(&finer.densities(mesh, &held, tolerance))?);
        let next_held = held_by(&held, &finer, next);
        if next_held.is_empty() {
            break;
        }
        (grid, cell, held) = (finer, next, next_held);
    }
    let plane = grid.middle(cell);
    let valid: Vec<u32> = held.iter().copied().filter(|face| plane.is_near(corners(face), tolerance)).collect();
    // A cell that settles on no plane for any of its faces is given up with them, so that the rest goes on.
    Some((plane, if valid.is_empty() { held } else { valid }))
}

pub(super) fn planes(mesh: &Mesh, options: &BaselineOptions) -> Vec<Unbounded> {
    let mut faces: Vec<u32> = (0..mesh.triangle_count() as u32).collect();
    let mut planes = Vec::new();
    while planes.len() < options.count && !faces.is_empty() {
        let Some((plane, covered)) = densest_plane(mesh, &faces, options.tolerance) else { break };
        let before = faces.len();
        faces.retain(|face| covered.binary_search(face).is_err());
        if faces.len() == before {
            break;
        }
        planes.push(plane);
    }
    planes
}
