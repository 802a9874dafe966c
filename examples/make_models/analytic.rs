//! Small models whose shadows are known in closed form. All are centred on the vertical axis or stand on y = 0.

use glam::DVec3;

use super::glb::{Material, Model, Part, Sides};
use super::mesh::{MICROMETRE, Mesh, NANOMETRE};
use super::planes::{PlaneFile, Rectangle};

/// Edge of the ground square, centred on the origin, metres.
pub const GROUND_EDGE_M: f64 = 4.0;
/// Edge of the plate above it, metres.
pub const PLATE_EDGE_M: f64 = 1.0;
/// Height of the plate, metres.
pub const PLATE_HEIGHT_M: f64 = 0.5;
/// Border of a plane around its plate, as a share of the edge: an open texel remains even at 32 texels.
const PLATE_MARGIN: f64 = 0.04;

/// Radius of the sphere, metres.
pub const SPHERE_RADIUS_M: f64 = 1.0;
/// Divisions of each edge of the icosahedron: 20 n^2 = 980 triangles.
const SPHERE_FREQUENCY: usize = 7;
/// Full edges of the box, metres.
const BOX_EDGES_M: DVec3 = DVec3::new(1.2, 0.7, 0.9);

/// The T in its plane, counter-clockwise, metres: stem 0.4 wide and 0.8 tall, bar 1.4 wide and 0.4 thick.
const T_OUTLINE_M: [[f64; 2]; 8] =
    [[-0.2, 0.0], [0.2, 0.0], [0.2, 0.8], [0.7, 0.8], [0.7, 1.2], [-0.7, 1.2], [-0.7, 0.8], [-0.2, 0.8]];
/// Triangles of the T without a vertex inside an edge.
const T_TRIANGLES: [[usize; 3]; 6] = [[0, 1, 2], [0, 2, 7], [5, 6, 7], [5, 7, 4], [7, 2, 4], [2, 3, 4]];
/// Thickness of the T, metres.
const T_DEPTH_M: f64 = 0.6;

/// Sharp edges for flat faces.
const FLAT_CREASE_DEG: f64 = 30.0;
/// No edge of the sphere is sharp.
const ROUND_CREASE_DEG: f64 = 60.0;

fn matt(name: &'static str, base_color: [f64; 3]) -> Material {
    Material { name, base_color, roughness: 0.8, sides: Sides::Front }
}

fn flat(mesh: Mesh, material: Material) -> Part {
    Part { mesh: mesh.welded(MICROMETRE), crease_deg: FLAT_CREASE_DEG, material }
}

/// A horizontal square that faces +Y, centred on the axis.
fn square(edge_m: f64, height_m: f64) -> Mesh {
    let h = edge_m / 2.0;
    let mut mesh = Mesh::default();
    mesh.push_fan(&[[-h, h], [h, h], [h, -h], [-h, -h]].map(|[x, z]| DVec3::new(x, height_m, z)));
    mesh
}

/// A single-sided plate over a single-sided ground, both facing up.
pub fn plate_over_ground() -> Model {
    let ground = flat(square(GROUND_EDGE_M, 0.0), matt("ground", [0.62, 0.60, 0.52]));
    let plate = flat(square(PLATE_EDGE_M, PLATE_HEIGHT_M), matt("plate", [0.20, 0.45, 0.65]));
    Model { name: "plate_over_ground", parts: vec![ground, plate] }
}

/// The plate's plane, grown by a margin.
pub fn plate_planes() -> PlaneFile {
    let half = PLATE_EDGE_M / 2.0;
    let middle = DVec3::new(0.0, PLATE_HEIGHT_M, 0.0);
    let margin_m = PLATE_MARGIN * PLATE_EDGE_M;
    let plate = Rectangle::centred("plate", middle, DVec3::X * half, DVec3::Z * half, margin_m);
    PlaneFile {
        comment: "The exact answer: the plate's own plane, with a margin of 4 % of its edge on each side.".to_owned(),
        planes: vec![plate],
    }
}

/// A geodesic sphere: convex, every vertex on the sphere. It needs no plane.
pub fn sphere() -> Model {
    let mut mesh = Mesh::default();
    for [a, b, c] in icosahedron() {
        push_divided(&mut mesh, a, b, c);
    }
    let mesh = mesh.mapped(|p| p.normalize() * SPHERE_RADIUS_M).welded(NANOMETRE);
    let material = matt("clay", [0.65, 0.36, 0.27]);
    let part = Part { mesh, crease_deg: ROUND_CREASE_DEG, material };
    Model { name: "sphere", parts: vec![part] }
}

/// The 20 faces, corners not normalised. Built from the 12 vertices (0, +-1, +-phi) and their cyclic turns.
fn icosahedron() -> Vec<[DVec3; 3]> {
    let phi = (1.0 + 5.0_f64.sqrt()) / 2.0;
    let mut vertices = Vec::new();
    for (s, t) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
        vertices.extend([DVec3::new(0.0, s, t * phi), DVec3::new(s, t * phi, 0.0), DVec3::new(t * phi, 0.0, s)]);
    }
    // Neighbours are 2 apart, all other pairs at least 2 phi.
    let adjacent = |a: DVec3, b: DVec3| a.distance_squared(b) < 5.0;
    let mut faces = Vec::new();
    for i in 0..vertices.len() {
        for j in i + 1..vertices.len() {
            for k in j + 1..vertices.len() {
                let [a, b, c] = [i, j, k].map(|v| vertices[v]);
                if adjacent(a, b) && adjacent(b, c) && adjacent(c, a) {
                    faces.push(if (b - a).cross(c - a).dot(a) > 0.0 { [a, b, c] } else { [a, c, b] });
                }
            }
        }
    }
    faces
}

/// Divides a triangle evenly into `SPHERE_FREQUENCY` squared ones.
fn push_divided(mesh: &mut Mesh, a: DVec3, b: DVec3, c: DVec3) {
    let n = SPHERE_FREQUENCY;
    let point = |i: usize, j: usize| (a * (n - i - j) as f64 + b * i as f64 + c * j as f64) / n as f64;
    for i in 0..n {
        for j in 0..n - i {
            mesh.push_fan(&[point(i, j), point(i + 1, j), point(i, j + 1)]);
            if i + j + 1 < n {
                mesh.push_fan(&[point(i + 1, j), point(i + 1, j + 1), point(i, j + 1)]);
            }
        }
    }
}

/// A box that stands on y = 0: 12 triangles, convex.
pub fn cuboid() -> Model {
    let h = BOX_EDGES_M / 2.0;
    let outline = [[-h.x, 0.0], [h.x, 0.0], [h.x, BOX_EDGES_M.y], [-h.x, BOX_EDGES_M.y]];
    let mesh = extruded(&outline, &[[0, 1, 2], [0, 2, 3]], BOX_EDGES_M.z);
    Model { name: "box", parts: vec![flat(mesh, matt("painted", [0.35, 0.55, 0.35]))] }
}

/// A T that stands on y = 0: the bar shadows the stem.
pub fn t_shape() -> Model {
    let mesh = extruded(&T_OUTLINE_M, &T_TRIANGLES, T_DEPTH_M);
    Model { name: "t_shape", parts: vec![flat(mesh, matt("painted", [0.72, 0.50, 0.22]))] }
}

/// A prism along z, centred on z = 0. `outline` is counter-clockwise in (x, y), `triangles` fill it.
fn extruded(outline: &[[f64; 2]], triangles: &[[usize; 3]], depth_m: f64) -> Mesh {
    let at = |i: usize, z: f64| DVec3::new(outline[i][0], outline[i][1], z);
    let (back, front) = (-depth_m / 2.0, depth_m / 2.0);
    let mut mesh = Mesh::default();
    for &[a, b, c] in triangles {
        mesh.push_fan(&[at(a, front), at(b, front), at(c, front)]);
        mesh.push_fan(&[at(a, back), at(c, back), at(b, back)]);
    }
    for i in 0..outline.len() {
        let j = (i + 1) % outline.len();
        mesh.push_fan(&[at(i, back), at(j, back), at(j, front), at(i, front)]);
    }
    mesh
}
