//! A jet in the manner of the F-35 around the planes of a published fit, so that those planes cut it as they should:
//! wings and stabilisers lie in the horizontal plane, the canted fins in the two fin planes.
//!
//! Source of the planes: Chris Coleman, "Fast Self-Shadowing Using Occluder Textures", Texas A&M University, 2006.
//! "Aircraft space" is its frame: metres, x right, y towards the nose, z up. Model space is glTF's: (x, z, -y), so the
//! nose points towards -Z. The shape itself is drawn freely after the type's plan view.
//!
//! Every piece is a closed 2-manifold; pieces reach into each other (wings into the body), they are not united.

use glam::DVec3;

use super::glb::{Material, Model, Part, Sides};
use super::loft::{End, Section, WingPlane, WingSection, loft, ring, smoothed, wing};
use super::mesh::Mesh;
use super::planes::{PlaneFile, Rectangle};

/// Corner of the horizontal plane, aircraft space.
const HORIZONTAL_CORNER: DVec3 = DVec3::new(-7.5, -5.315, 0.0);
/// Edge of the horizontal square, metres.
const HORIZONTAL_EDGE_M: f64 = 15.0;
/// Corner of the right fin's plane, aircraft space; the left one is its mirror image in x.
const FIN_CORNER: DVec3 = DVec3::new(0.899235, -0.676381, -0.706742);
/// Up along the right fin, aircraft space; the plane's other axis is -y.
const FIN_UP: DVec3 = DVec3::new(0.3975177, 0.0, 0.91759448);
/// Edge of the fin square, metres.
const FIN_EDGE_M: f64 = 4.1218186;

/// The body from nose to tail, widest at z = 0 like the wings.
const BODY: [Section; 15] = [
    [9.45, 0.0, 0.15, 0.0, 0.09, -0.17, 1.8],
    [9.00, 0.0, 0.34, 0.0, 0.23, -0.35, 1.8],
    [8.20, 0.0, 0.56, 0.0, 0.41, -0.56, 1.8],
    [7.20, 0.0, 0.73, 0.0, 0.54, -0.72, 1.85],
    [6.00, 0.0, 0.81, 0.0, 0.63, -0.83, 1.95],
    [4.80, 0.0, 0.83, 0.0, 0.68, -0.90, 2.2],
    [3.60, 0.0, 0.83, 0.0, 0.73, -0.97, 2.5],
    [3.00, 0.0, 0.88, 0.0, 0.75, -1.00, 2.6],
    [2.40, 0.0, 1.30, 0.0, 0.77, -1.02, 2.6],
    [1.60, 0.0, 1.72, 0.0, 0.79, -1.03, 2.6],
    [0.40, 0.0, 1.84, 0.0, 0.79, -1.02, 2.6],
    [-1.20, 0.0, 1.76, 0.0, 0.75, -0.95, 2.6],
    [-2.40, 0.0, 1.40, 0.0, 0.69, -0.85, 2.5],
    [-3.20, 0.0, 1.02, 0.0, 0.63, -0.76, 2.3],
    [-3.70, 0.0, 0.80, 0.0, 0.57, -0.68, 2.1],
];
const NOSE_TIP: DVec3 = DVec3::new(0.0, 9.65, -0.05);

/// The hump behind the canopy.
const SPINE: [Section; 6] = [
    [5.40, 0.0, 0.30, 0.3, 0.92, 0.0, 2.0],
    [4.20, 0.0, 0.52, 0.3, 1.05, 0.0, 2.0],
    [2.60, 0.0, 0.78, 0.3, 1.00, 0.0, 2.0],
    [0.20, 0.0, 0.85, 0.3, 0.93, 0.0, 2.0],
    [-1.80, 0.0, 0.60, 0.3, 0.80, 0.0, 2.0],
    [-3.20, 0.0, 0.30, 0.3, 0.58, 0.0, 2.0],
];

const CANOPY: [Section; 6] = [
    [8.15, 0.0, 0.16, 0.3, 0.52, 0.1, 2.0],
    [7.55, 0.0, 0.42, 0.3, 0.88, 0.0, 2.0],
    [6.70, 0.0, 0.55, 0.3, 1.15, 0.0, 2.0],
    [5.80, 0.0, 0.57, 0.3, 1.24, 0.0, 2.0],
    [5.00, 0.0, 0.50, 0.3, 1.16, 0.0, 2.0],
    [4.40, 0.0, 0.36, 0.3, 0.98, 0.1, 2.0],
];

/// The right intake: from inside the body forwards to the lip, round it, and back down the duct to its closed end.
const INTAKE: [Section; 8] = [
    [1.20, 1.20, 0.44, -0.25, 0.30, -0.80, 4.0],
    [2.20, 1.24, 0.50, -0.25, 0.34, -0.88, 4.0],
    [3.30, 1.23, 0.50, -0.25, 0.34, -0.88, 4.0],
    [4.30, 1.20, 0.46, -0.25, 0.30, -0.84, 4.0],
    [4.42, 1.20, 0.43, -0.25, 0.27, -0.81, 4.0],
    [4.30, 1.20, 0.40, -0.25, 0.24, -0.78, 4.0],
    [3.70, 1.22, 0.38, -0.25, 0.20, -0.74, 3.5],
    [3.10, 1.24, 0.34, -0.25, 0.14, -0.68, 3.0],
];
/// From this y forwards the intake is sheared to a swept lip, growing to the full sweep over the length below.
const INTAKE_SWEEP_START_M: f64 = 3.3;
const INTAKE_SWEEP_LENGTH_M: f64 = 1.0;
/// How far the lip falls back per metre outwards and per metre downwards.
const INTAKE_SWEEP_OUT: f64 = 0.45;
const INTAKE_SWEEP_DOWN: f64 = 0.30;

/// The nozzle: from inside the body backwards to the lip, round it, and forwards to its closed end.
const NOZZLE: [Section; 8] = [
    [-3.30, 0.0, 0.72, -0.05, 0.60, -0.70, 2.0],
    [-3.80, 0.0, 0.72, -0.05, 0.62, -0.72, 2.0],
    [-4.30, 0.0, 0.66, -0.05, 0.60, -0.70, 2.0],
    [-4.85, 0.0, 0.54, -0.05, 0.49, -0.59, 2.0],
    [-4.87, 0.0, 0.52, -0.05, 0.47, -0.57, 2.0],
    [-4.85, 0.0, 0.50, -0.05, 0.45, -0.55, 2.0],
    [-4.40, 0.0, 0.50, -0.05, 0.45, -0.55, 2.0],
    [-3.95, 0.0, 0.44, -0.05, 0.39, -0.49, 2.0],
];

/// The right boom that carries fin and stabiliser.
const BOOM: [Section; 6] = [
    [0.00, 1.42, 0.30, 0.0, 0.20, -0.25, 2.4],
    [-1.20, 1.45, 0.46, 0.0, 0.40, -0.42, 2.4],
    [-2.40, 1.43, 0.48, 0.0, 0.42, -0.40, 2.4],
    [-3.40, 1.38, 0.42, 0.0, 0.35, -0.33, 2.4],
    [-4.30, 1.34, 0.28, 0.0, 0.22, -0.20, 2.4],
    [-4.80, 1.32, 0.12, 0.0, 0.09, -0.08, 2.4],
];

/// The right wing with its strake along the intake, in y over x.
const WING: [WingSection; 5] = [
    [1.62, 3.60, -2.56, 0.09],
    [1.95, 2.45, -2.49, 0.12],
    [3.50, 1.36, -2.13, 0.08],
    [5.20, 0.17, -1.73, 0.04],
    [5.35, -0.12, -1.66, 0.02],
];
/// The right stabiliser, in y over x.
const STABILISER: [WingSection; 3] =
    [[1.42, -2.75, -5.25, 0.06], [3.30, -4.07, -4.86, 0.025], [3.42, -4.22, -4.80, 0.015]];
/// The right fin, in y over the distance along `FIN_UP` from the plane's lower edge.
const FIN: [WingSection; 4] =
    [[0.75, -0.95, -4.45, 0.10], [1.60, -1.62, -4.52, 0.085], [3.62, -3.20, -4.68, 0.04], [3.75, -3.42, -4.68, 0.02]];

/// Points around the body, and around every smaller piece.
const BODY_POINTS: usize = 40;
const PIECE_POINTS: usize = 24;
/// Sections drawn between two of the tables'.
const SMOOTH_STEPS: usize = 2;
/// Sharper edges stay sharp: caps, lips, trailing edges, the forward chine.
const CREASE_DEG: f64 = 38.0;

/// Model space from aircraft space.
pub fn model_from_aircraft(p: DVec3) -> DVec3 {
    DVec3::new(p.x, p.z, -p.y)
}

/// Skin, glass and nozzle.
pub fn model() -> Model {
    let mut skin = Mesh::default();
    let nose = End::Point(NOSE_TIP);
    skin.append(&loft(&rings(&smoothed(&BODY, SMOOTH_STEPS), BODY_POINTS), nose, End::Flat));
    skin.append(&loft(&rings(&smoothed(&SPINE, SMOOTH_STEPS), PIECE_POINTS), End::Flat, End::Flat));
    let boom = loft(&rings(&smoothed(&BOOM, SMOOTH_STEPS), PIECE_POINTS), End::Flat, End::Flat);
    let flat = WingPlane { origin: DVec3::ZERO, chord: DVec3::Y, span: DVec3::X };
    for right in [intake(), boom, wing(&flat, &WING), wing(&flat, &STABILISER), right_fin()] {
        skin.append(&right);
        skin.append(&right.mirrored_x());
    }
    let canopy = loft(&rings(&smoothed(&CANOPY, SMOOTH_STEPS), PIECE_POINTS), End::Flat, End::Flat);
    let nozzle = loft(&rings(&NOZZLE, PIECE_POINTS), End::Flat, End::Flat);
    let part = |mesh: &Mesh, name, base_color, roughness| Part {
        mesh: mesh.mapped(model_from_aircraft),
        crease_deg: CREASE_DEG,
        material: Material { name, base_color, roughness, sides: Sides::Front },
    };
    let parts = vec![
        part(&skin, "skin", [0.36, 0.40, 0.44], 0.6),
        part(&canopy, "canopy", [0.10, 0.08, 0.04], 0.2),
        part(&nozzle, "nozzle", [0.14, 0.13, 0.13], 0.5),
    ];
    Model { name: "aircraft", parts }
}

/// The right fin in aircraft space.
pub fn right_fin() -> Mesh {
    let plane = WingPlane { origin: DVec3::new(FIN_CORNER.x, 0.0, FIN_CORNER.z), chord: DVec3::Y, span: FIN_UP };
    wing(&plane, &FIN)
}

fn rings(sections: &[Section], points: usize) -> Vec<Vec<DVec3>> {
    sections.iter().map(|&section| ring(section, points)).collect()
}

/// The right intake with its swept lip.
fn intake() -> Mesh {
    let mut rings = rings(&INTAKE, PIECE_POINTS);
    for (ring, section) in rings.iter_mut().zip(INTAKE) {
        let [y, middle_x, _, middle_z, ..] = section;
        let share = ((y - INTAKE_SWEEP_START_M) / INTAKE_SWEEP_LENGTH_M).clamp(0.0, 1.0);
        for p in ring {
            let back = INTAKE_SWEEP_OUT * (p.x - middle_x) + INTAKE_SWEEP_DOWN * (middle_z - p.z);
            p.y -= share * back;
        }
    }
    loft(&rings, End::Flat, End::Flat)
}

/// The three published planes in model space: horizontal, right fin, left fin.
pub fn plane_file() -> PlaneFile {
    let plane = |name: &str, corner, u, v| Rectangle {
        name: name.to_owned(),
        origin: model_from_aircraft(corner),
        u_axis: model_from_aircraft(u),
        v_axis: model_from_aircraft(v),
    };
    let edge = HORIZONTAL_EDGE_M;
    let (back, up) = (DVec3::NEG_Y * FIN_EDGE_M, FIN_UP * FIN_EDGE_M);
    let left = |p: DVec3| DVec3::new(-p.x, p.y, p.z);
    PlaneFile {
        comment: "The three planes of Coleman, \"Fast Self-Shadowing Using Occluder Textures\", 2006, turned to Y up."
            .to_owned(),
        planes: vec![
            plane("horizontal", HORIZONTAL_CORNER, DVec3::X * edge, DVec3::Y * edge),
            plane("right fin", FIN_CORNER, back, up),
            plane("left fin", left(FIN_CORNER), back, left(up)),
        ],
    }
}
