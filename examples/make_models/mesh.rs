//! Indexed triangle meshes in double precision: welding, mirroring, and the split into shaded vertices.
//!
//! In: triangles from the generators. Out: vertices with normals, ready for a GLB file.
//! `sin`, `cos` and `powf` may differ in the last bit between platforms, and the written bytes must not: their results
//! go through `settled`, and positions are snapped to a grid before normals are computed from them.

use std::collections::BTreeMap;

use glam::DVec3;

/// Grid of the generators that use trigonometry, in metres: far above rounding noise, far below what can be seen.
pub const MICROMETRE: f64 = 1e-6;
/// Grid of the generators that use only `+ - * / sqrt` (exact on every platform), in metres: below f32 at 1 m.
pub const NANOMETRE: f64 = 1e-9;
/// Grid of the normals (unit length), for the same reason.
const NORMAL_GRID: f64 = 1e-5;

/// Grid of the results of `sin`, `cos` and `powf` (about 1): far above their rounding noise, far below a micrometre.
const SETTLED_STEPS: f64 = 1e12;

/// A transcendental function's result without its last, platform-dependent bits.
pub fn settled(value: f64) -> f64 {
    (value * SETTLED_STEPS).round() / SETTLED_STEPS
}

/// Triangles that share vertices, counter-clockwise seen from outside.
#[derive(Clone, Default)]
pub struct Mesh {
    pub positions: Vec<DVec3>,
    pub triangles: Vec<[usize; 3]>,
}

/// Vertices split where the surface has a crease: parallel arrays, and triangles as flat indices.
#[derive(Default)]
pub struct ShadedMesh {
    pub positions: Vec<DVec3>,
    pub normals: Vec<DVec3>,
    pub indices: Vec<usize>,
}

/// The nearest multiple of `grid`, never -0.
fn snapped(p: DVec3, grid: f64) -> ([i64; 3], DVec3) {
    let steps_per_unit = (1.0 / grid).round();
    let steps = (p * steps_per_unit).round();
    (steps.to_array().map(|c| c as i64), steps / steps_per_unit + DVec3::ZERO)
}

impl Mesh {
    /// Adds a convex or star-shaped polygon as a fan around its first corner.
    pub fn push_fan(&mut self, corners: &[DVec3]) {
        let first = self.positions.len();
        self.positions.extend_from_slice(corners);
        self.triangles.extend((1..corners.len().saturating_sub(1)).map(|i| [first, first + i, first + i + 1]));
    }

    /// Adds all of `other`; nothing is welded, so its parts stay separate components.
    pub fn append(&mut self, other: &Mesh) {
        let first = self.positions.len();
        self.positions.extend_from_slice(&other.positions);
        self.triangles.extend(other.triangles.iter().map(|t| t.map(|v| first + v)));
    }

    /// Snaps to `grid_m`, joins equal positions, and drops the triangles that lose an edge by it (poles).
    pub fn welded(&self, grid_m: f64) -> Mesh {
        let mut index_of_key = BTreeMap::new();
        let mut welded = Mesh::default();
        let mut new_index = Vec::with_capacity(self.positions.len());
        for &p in &self.positions {
            let (key, p) = snapped(p, grid_m);
            new_index.push(*index_of_key.entry(key).or_insert_with(|| {
                welded.positions.push(p);
                welded.positions.len() - 1
            }));
        }
        let moved = self.triangles.iter().map(|t| t.map(|v| new_index[v]));
        welded.triangles = moved.filter(|&[a, b, c]| a != b && b != c && c != a).collect();
        welded
    }

    /// The same mesh with every position mapped by `map`, which must keep the handedness.
    pub fn mapped(&self, map: impl Fn(DVec3) -> DVec3) -> Mesh {
        Mesh {
            positions: self.positions.iter().map(|&p| map(p) + DVec3::ZERO).collect(),
            triangles: self.triangles.clone(),
        }
    }

    /// The mirror image in the plane x = 0, again with its outside outside.
    pub fn mirrored_x(&self) -> Mesh {
        self.mapped(|p| DVec3::new(-p.x, p.y, p.z)).flipped()
    }

    /// The same surface with the other side outside.
    pub fn flipped(mut self) -> Mesh {
        for t in &mut self.triangles {
            t.swap(1, 2);
        }
        self
    }

    /// A closed mesh with its outside outside, whichever way it was built.
    pub fn turned_outward(self) -> Mesh {
        if self.signed_volume() < 0.0 { self.flipped() } else { self }
    }

    /// Enclosed volume in cubic metres, positive if the triangles face outwards. Means something for closed meshes.
    pub fn signed_volume(&self) -> f64 {
        let origin = self.positions.first().copied().unwrap_or(DVec3::ZERO);
        let six_volumes = self.triangles.iter().map(|t| {
            let [a, b, c] = t.map(|v| self.positions[v] - origin);
            a.dot(b.cross(c))
        });
        six_volumes.sum::<f64>() / 6.0
    }

    /// Twice the area of a triangle times its unit normal.
    pub fn area_normal(&self, triangle: [usize; 3]) -> DVec3 {
        let [a, b, c] = triangle.map(|v| self.positions[v]);
        (b - a).cross(c - a)
    }

    /// Splits the vertices at edges sharper than `crease_deg` and gives each the angle-weighted mean of its smooth
    /// neighbourhood (Thuermer and Wuethrich, "Computing Vertex Normals from Polygonal Facets", 1998).
    pub fn shaded(&self, crease_deg: f64) -> ShadedMesh {
        let crease_cos = crease_deg.to_radians().cos();
        let face_normals: Vec<DVec3> =
            self.triangles.iter().map(|&t| self.area_normal(t).normalize_or_zero()).collect();
        let faces_of_vertex = self.faces_of_vertices();
        let mut out = ShadedMesh::default();
        let mut index_of_key = BTreeMap::new();
        for (face, triangle) in self.triangles.iter().enumerate() {
            for &vertex in triangle {
                let smooth =
                    faces_of_vertex[vertex].iter().filter(|f| face_normals[f.0].dot(face_normals[face]) > crease_cos);
                let sum: DVec3 = smooth.map(|&(f, angle)| face_normals[f] * angle).sum();
                let (key, normal) = snapped(sum.normalize_or(face_normals[face]), NORMAL_GRID);
                let index = *index_of_key.entry((vertex, key)).or_insert_with(|| {
                    out.positions.push(self.positions[vertex]);
                    out.normals.push(normal);
                    out.positions.len() - 1
                });
                out.indices.push(index);
            }
        }
        out
    }

    /// Per vertex its faces, each with the face's angle there in radians.
    fn faces_of_vertices(&self) -> Vec<Vec<(usize, f64)>> {
        let mut faces = vec![Vec::new(); self.positions.len()];
        for (face, t) in self.triangles.iter().enumerate() {
            for corner in 0..3 {
                let [p, q, r] = [0, 1, 2].map(|k| self.positions[t[(corner + k) % 3]]);
                faces[t[corner]].push((face, (q - p).angle_between(r - p)));
            }
        }
        faces
    }
}
