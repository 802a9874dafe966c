//! The Utah teapot: Newell's 32 bicubic Bezier patches, in the proportions in which the data are known
//! (the real pot is about 1.3 times as tall), with its lid and with Crow's bottom.
//!
//! Sources: Martin Newell, "The Utilization of Procedure Models in Digital Image Synthesis", University of Utah, 1975
//! (the patches); Frank Crow, "The Origins of the Teapot", IEEE CG&A 7(1), 1987 (data with the bottom).
//! The patches repeat each other: 24 of them are quarter turns of six profiles, the other 8 are two tubes, each two
//! patches long and mirrored in the plane through handle and spout. So only profiles and tubes are stored.
//!
//! Two flat pieces are added, because the model is single-sided and one would look through the pot there: a seat between
//! the lid's edge and the rim, and a lid in the spout's mouth. Body, seat, lid and bottom together are closed; handle and
//! spout are open tubes whose ends lie inside the body.

use glam::{DMat3, DVec2, DVec3};

use super::glb::{Material, Model, Part, Sides};
use super::mesh::{MICROMETRE, Mesh};

/// Metres per unit of Newell's data: the pot becomes 0.1575 m tall and 0.326 m long.
pub const METRES_PER_UNIT: f64 = 0.05;
/// Quads along each side of a patch: with the two flat pieces 64 n^2 + 4 n - 4 = 6436 triangles.
const PATCH_SEGMENTS: usize = 10;
/// Above the angles between neighbouring facets of the smooth surface (up to about 40 degrees at the rims).
const CREASE_DEG: f64 = 65.0;

/// Control points of a profile: [radius, the same with the handle length of the quarter circle, height].
type Profile = [[f64; 3]; 4];
/// Profiles from the rim down the outside to the middle of the bottom, then from the knob's top to the lid's edge.
const PROFILES: [Profile; 6] = [
    RIM,
    [[1.5, 0.84, 2.4], [1.75, 0.98, 1.875], [2.0, 1.12, 1.35], [2.0, 1.12, 0.9]],
    [[2.0, 1.12, 0.9], [2.0, 1.12, 0.45], [1.5, 0.84, 0.225], [1.5, 0.84, 0.15]],
    [[1.5, 0.84, 0.15], [1.5, 0.84, 0.075], [1.425, 0.798, 0.0], [0.0, 0.0, 0.0]],
    KNOB,
    [[0.2, 0.112, 2.7], [0.4, 0.224, 2.55], [1.3, 0.728, 2.55], [1.3, 0.728, 2.4]],
];
/// From the lid's edge to the rim.
const SEAT: Profile = [[1.3, 0.728, 2.4], [1.3, 0.728, 2.4], [1.4, 0.784, 2.4], [1.4, 0.784, 2.4]];
/// The pot's rim, from its inside over the top to its outside.
pub const RIM: Profile = [[1.4, 0.784, 2.4], [1.3375, 0.749, 2.53125], [1.4375, 0.805, 2.53125], [1.5, 0.84, 2.4]];
/// The lid's knob.
pub const KNOB: Profile = [[0.0, 0.0, 3.15], [0.8, 0.45, 3.15], [0.0, 0.0, 2.85], [0.2, 0.112, 2.7]];

/// Control points around a tube: [x and height at the inner end, x and height at the outer end, half width].
type TubeRow = [f64; 5];
/// Two Bezier segments that share their middle row. Inner means next to the body or, on the spout, above.
type Tube = [TubeRow; 7];
/// From the upper end down to the lower one.
pub const HANDLE: Tube = [
    [-1.6, 2.025, -1.5, 2.25, 0.3],
    [-2.3, 2.025, -2.5, 2.25, 0.3],
    [-2.7, 2.025, -3.0, 2.25, 0.3],
    [-2.7, 1.8, -3.0, 1.8, 0.3],
    [-2.7, 1.575, -3.0, 1.35, 0.3],
    [-2.5, 1.125, -2.65, 0.9375, 0.3],
    [-2.0, 0.9, -1.9, 0.6, 0.3],
];
/// From the body up to the lip and round it into the mouth.
pub const SPOUT: Tube = [
    [1.7, 1.425, 1.7, 0.6, 0.66],
    [2.6, 1.425, 3.1, 0.825, 0.66],
    [2.3, 2.1, 2.4, 2.025, 0.25],
    [2.7, 2.4, 3.3, 2.4, 0.25],
    [2.8, 2.475, 3.525, 2.49375, 0.25],
    [2.9, 2.475, 3.45, 2.5125, 0.15],
    [2.8, 2.4, 3.2, 2.4, 0.15],
];
/// Index of the first row of each Bezier segment of a tube.
pub const TUBE_SEGMENTS: [usize; 2] = [0, 3];

/// The point at `t` in 0..1 of a cubic Bezier curve.
pub fn bezier(points: [DVec3; 4], t: f64) -> DVec3 {
    let s = 1.0 - t;
    points[0] * (s * s * s) + points[1] * (3.0 * s * s * t) + points[2] * (3.0 * s * t * t) + points[3] * (t * t * t)
}

/// Metres, Y up, spout towards +X, from Newell's units, Z up.
pub fn model_from_newell(p: DVec3) -> DVec3 {
    DVec3::new(p.x, p.z, -p.y) * METRES_PER_UNIT
}

/// Where a tube lies in the symmetry plane: inner and outer point of (x, height) in Newell's units, and half width.
pub struct TubeSection {
    pub inner: DVec2,
    pub outer: DVec2,
    pub half_width: f64,
}

/// The tube's section at `t` in 0..1 of its segment that starts at row `first_row`.
pub fn tube_section(tube: &Tube, first_row: usize, t: f64) -> TubeSection {
    let row = |k: usize| tube[first_row + k];
    let inner = bezier([0, 1, 2, 3].map(|k| DVec3::new(row(k)[0], row(k)[1], row(k)[4])), t);
    let outer = bezier([0, 1, 2, 3].map(|k| DVec3::new(row(k)[2], row(k)[3], row(k)[4])), t);
    // The section is itself a Bezier curve whose two middle control points lie at the half width: 3/4 is reached.
    TubeSection { inner: inner.truncate(), outer: outer.truncate(), half_width: 0.75 * inner.z }
}

/// The teapot as one part. Pot, handle and spout are welded each for itself: the handle touches the pot in one vertex.
pub fn model() -> Model {
    let material = Material { name: "glazed", base_color: [0.80, 0.62, 0.42], roughness: 0.45, sides: Sides::Front };
    let mut mesh = Mesh::default();
    for piece in [pot(), tube(&HANDLE), spout()] {
        mesh.append(&piece.mapped(model_from_newell).welded(MICROMETRE));
    }
    Model { name: "teapot", parts: vec![Part { mesh, crease_deg: CREASE_DEG, material }] }
}

/// Body, seat, lid and bottom, in Newell's units.
fn pot() -> Mesh {
    let mut pot = Mesh::default();
    for quarter in 0..4 {
        for profile in PROFILES {
            pot.append(&patch(profile_controls(profile, quarter), PATCH_SEGMENTS));
        }
        pot.append(&patch(profile_controls(SEAT, quarter), 1));
    }
    pot
}

/// The spout with its mouth, in Newell's units.
fn spout() -> Mesh {
    let mut spout = tube(&SPOUT);
    spout.append(&mirrored_pair(mouth_controls(), 1));
    spout
}

/// A tube open at both ends, in Newell's units.
fn tube(rows: &Tube) -> Mesh {
    let mut tube = Mesh::default();
    for first_row in TUBE_SEGMENTS {
        tube.append(&mirrored_pair(tube_controls(rows, first_row), PATCH_SEGMENTS));
    }
    tube
}

/// Control net of a quarter of a surface of revolution: `[along the profile][around the axis]`.
fn profile_controls(profile: Profile, quarter: usize) -> [[DVec3; 4]; 4] {
    // Rows of quarter turns about the vertical axis; exact, because the entries are 0 and +-1.
    let turn = DMat3::from_cols(DVec3::Y, DVec3::NEG_X, DVec3::Z);
    let turned = (0..quarter).fold(DMat3::IDENTITY, |m, _| turn * m);
    profile.map(|[r, k, z]| [[r, 0.0], [r, k], [k, r], [0.0, r]].map(|[x, y]| turned * DVec3::new(x, y, z)))
}

/// Control net of the half of a tube's segment at negative y: `[along the tube][from inside to outside]`.
fn tube_controls(tube: &Tube, first_row: usize) -> [[DVec3; 4]; 4] {
    [0, 1, 2, 3].map(|k| {
        let [xi, zi, xo, zo, w] = tube[first_row + k];
        [DVec3::new(xi, 0.0, zi), DVec3::new(xi, -w, zi), DVec3::new(xo, -w, zo), DVec3::new(xo, 0.0, zo)]
    })
}

/// Half of the flat piece in the mouth: from the spout's last row straight to the symmetry plane.
fn mouth_controls() -> [[DVec3; 4]; 4] {
    let edge = tube_controls(&SPOUT, TUBE_SEGMENTS[1])[3];
    let middle = edge.map(|p| DVec3::new(p.x, 0.0, p.z));
    [edge, edge, middle, middle]
}

/// A patch at negative y and its mirror image at positive y.
fn mirrored_pair(controls: [[DVec3; 4]; 4], rows: usize) -> Mesh {
    let mut pair = patch(controls, rows).flipped();
    pair.append(&patch(controls.map(|row| row.map(|p| DVec3::new(p.x, -p.y, p.z))), rows));
    pair
}

/// A regular grid of triangles over a patch, `rows` quads along it; on a surface of revolution it faces outwards.
fn patch(controls: [[DVec3; 4]; 4], rows: usize) -> Mesh {
    let columns = PATCH_SEGMENTS;
    let mut mesh = Mesh::default();
    for i in 0..=rows {
        for j in 0..=columns {
            let column = controls.map(|row| bezier(row, j as f64 / columns as f64));
            mesh.positions.push(bezier(column, i as f64 / rows as f64));
        }
    }
    for i in 0..rows {
        for j in 0..columns {
            let a = i * (columns + 1) + j;
            let (b, c, d) = (a + columns + 1, a + columns + 2, a + 1);
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh
}
