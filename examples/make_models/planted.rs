//! Planted answer: four plates without thickness that shadow each other, and nothing else. Their planes are the answer.
//!
//! The orientations are rational rotations (quaternions of small integers), so that no trigonometry is needed for them.

use std::f64::consts::TAU;

use glam::{DMat3, DQuat, DVec2, DVec3};

use super::glb::{Material, Model, Part, Sides};
use super::mesh::{MICROMETRE, Mesh, settled};
use super::planes::{PlaneFile, Rectangle};

/// Segments of the disc.
const DISC_SEGMENTS: usize = 48;
/// Radius of the disc, metres.
const DISC_RADIUS_M: f64 = 0.45;
/// Border of a plane around its plate, as a share of the longer edge: an open texel remains even at 32 texels.
const MARGIN: f64 = 0.04;
/// Flat plates have no smooth edge.
const CREASE_DEG: f64 = 30.0;

/// One plate. Its outline lies in the plane of the first two axes of its rotation.
pub struct Plate {
    pub name: &'static str,
    middle_model: DVec3,
    /// Not normalised.
    model_from_plate: DQuat,
    /// Star-shaped around its first corner, counter-clockwise, metres.
    outline_plate: Vec<DVec2>,
    base_color: [f64; 3],
}

/// The K = 4 plates.
pub fn plates() -> Vec<Plate> {
    let disc = (0..DISC_SEGMENTS)
        .map(|i| DVec2::from_angle(TAU * i as f64 / DISC_SEGMENTS as f64).map(settled) * DISC_RADIUS_M);
    let corners = |points: &[[f64; 2]]| points.iter().map(|&p| DVec2::from_array(p)).collect();
    let plate = |name, middle: [f64; 3], rotation: [f64; 4], outline_plate, base_color| Plate {
        name,
        middle_model: DVec3::from_array(middle),
        model_from_plate: DQuat::from_array(rotation),
        outline_plate,
        base_color,
    };
    vec![
        plate(
            "rectangle",
            [0.0, 0.0, 0.0],
            [-5.0, 0.0, 1.0, 6.0],
            corners(&[[-0.7, -0.5], [0.7, -0.5], [0.7, 0.5], [-0.7, 0.5]]),
            [0.25, 0.45, 0.70],
        ),
        plate("disc", [0.12, 0.62, 0.05], [-4.0, 1.0, 0.0, 3.0], disc.collect(), [0.75, 0.42, 0.25]),
        plate(
            "L",
            [-0.74, 0.50, 0.0],
            [0.0, 5.0, 1.0, 6.0],
            corners(&[[-0.12, -0.12], [-0.12, 0.45], [-0.45, 0.45], [-0.45, -0.45], [0.45, -0.45], [0.45, -0.12]]),
            [0.35, 0.60, 0.35],
        ),
        plate(
            "triangle",
            [0.15, 0.46, -0.66],
            [1.0, 1.0, 0.0, 8.0],
            corners(&[[-0.5, -0.3], [0.5, -0.3], [0.1, 0.5]]),
            [0.70, 0.60, 0.25],
        ),
    ]
}

impl Plate {
    /// Corners in model space.
    pub fn corners_model(&self) -> Vec<DVec3> {
        let model_from_plate = self.axes();
        self.outline_plate.iter().map(|p| self.middle_model + model_from_plate * p.extend(0.0)).collect()
    }

    fn axes(&self) -> DMat3 {
        DMat3::from_quat(self.model_from_plate.normalize())
    }

    fn mesh(&self) -> Mesh {
        let mut mesh = Mesh::default();
        mesh.push_fan(&self.corners_model());
        mesh.welded(MICROMETRE)
    }

    /// The smallest rectangle along the plate's axes, grown by the margin.
    fn rectangle(&self) -> Rectangle {
        let min = self.outline_plate.iter().copied().fold(DVec2::INFINITY, DVec2::min);
        let max = self.outline_plate.iter().copied().fold(DVec2::NEG_INFINITY, DVec2::max);
        let (middle, half) = ((min + max) / 2.0, (max - min) / 2.0);
        let axes = self.axes();
        let middle_model = self.middle_model + axes * middle.extend(0.0);
        let margin_m = MARGIN * 2.0 * half.max_element();
        Rectangle::centred(self.name, middle_model, axes.x_axis * half.x, axes.y_axis * half.y, margin_m)
    }
}

/// One part per plate, double-sided.
pub fn model() -> Model {
    let part = |plate: &Plate| Part {
        mesh: plate.mesh(),
        crease_deg: CREASE_DEG,
        material: Material { name: plate.name, base_color: plate.base_color, roughness: 0.8, sides: Sides::Both },
    };
    Model { name: "planted_planes", parts: plates().iter().map(part).collect() }
}

/// The plates' own planes.
pub fn plane_file() -> PlaneFile {
    PlaneFile {
        comment: "The exact answer: the plates' own planes, with a margin of 4 % of the longer edge on each side."
            .to_owned(),
        planes: plates().iter().map(Plate::rectangle).collect(),
    }
}
