//! The field of instances on which techniques are scaled: random copies of the model in view of one camera.
//!
//! Instances stand on a level plain in rows that widen with the view, each turned at random about every axis, so that
//! one directional light comes from another side for each of them. The camera stands in front of the field, low, and
//! looks along it: near instances are large, far ones small. The same seed gives the same field, and a smaller field is
//! the near part of a larger one.

use super::{Camera, stage::Placement};
use glam::{Quat, Vec3};
use shadowfit_solver::sampling::{hash, uniform};

/// Distance of neighbours, radii of the model: those turned worst still do not touch.
const SPACING: f32 = 2.2;

/// Where the camera stands: above the plain, and in front of the first row.
const EYE: Vec3 = Vec3::new(0.0, 3.0, 5.0);

/// Vertical field of view, radians.
const FIELD_OF_VIEW_RAD: f32 = 0.9;

/// The instances (radius 1) and a camera that sees them.
#[must_use]
pub fn field(count: usize, seed: u64) -> (Vec<Placement>, Camera) {
    let mut placements = Vec::with_capacity(count);
    let mut row = 0;
    while placements.len() < count {
        // A row as wide as the view at its distance.
        let z = -SPACING * row as f32;
        let half_width = (EYE.z - z) * (0.5 * FIELD_OF_VIEW_RAD).tan();
        let columns = ((2.0 * half_width / SPACING) as usize).max(1).min(count - placements.len());
        for column in 0..columns {
            let key = hash(seed, placements.len() as u64);
            let x = (column as f32 - 0.5 * (columns - 1) as f32) * SPACING;
            let jitter = Vec3::new(random(key, 0) - 0.5, 0.0, random(key, 1) - 0.5) * (0.2 * SPACING);
            let scale = 0.7 + 0.3 * random(key, 2);
            placements.push(Placement { rotation: turn(key), scale, translation: Vec3::new(x, 0.0, z) + jitter });
        }
        row += 1;
    }
    let depth = SPACING * row as f32;
    let camera = Camera::looking(EYE, Vec3::new(0.0, 0.0, -0.3 * depth), FIELD_OF_VIEW_RAD, [0.5, EYE.z + depth + 4.0]);
    (placements, camera)
}

/// Number `index` of an instance's own, 0 to 1.
fn random(key: u64, index: u64) -> f32 {
    uniform(key, index) as f32
}

/// A turn, all alike probable (K. Shoemake, "Uniform Random Rotations", 1992).
fn turn(key: u64) -> Quat {
    let [u, v, w] = [3, 4, 5].map(|index| random(key, index));
    let (sin_v, cos_v) = (std::f32::consts::TAU * v).sin_cos();
    let (sin_w, cos_w) = (std::f32::consts::TAU * w).sin_cos();
    let (a, b) = ((1.0 - u).sqrt(), u.sqrt());
    Quat::from_xyzw(a * sin_v, a * cos_v, b * sin_w, b * cos_w).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn instances_are_in_view_and_apart() {
        let (placements, camera) = field(200, 1);
        assert_eq!(placements.len(), 200);
        let clip_from_world = camera.clip_from_world([100, 100]);
        for (i, p) in placements.iter().enumerate() {
            let ndc = clip_from_world.project_point3(p.translation);
            assert!(ndc.x.abs() < 1.1 && ndc.y.abs() < 1.1 && (0.0..1.0).contains(&ndc.z), "{i}: {ndc}");
            let nearest = placements[..i].iter().map(|q| q.translation.distance(p.translation) - q.scale - p.scale);
            assert!(nearest.fold(f32::MAX, f32::min) > -0.5, "{i}");
        }
    }

    #[test]
    fn a_small_field_is_part_of_a_large_one() {
        assert_eq!(field(3, 7).0[..2], field(100, 7).0[..2]);
    }
}
