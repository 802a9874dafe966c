//! The views of a light on the casters: one parallel projection, or six perspective ones around a point.
//!
//! A directional light's view is the smallest axis-aligned rectangle, about an arbitrary up, that holds every caster's
//! extreme points ([`Model::extremes`](super::upload::Model)), a texel's room around. A point light has the faces of a
//! cube (as cube maps order them), each a little wider than a quarter turn so that filters find neighbours.

use super::{
    Light,
    stage::{Placement, Stage},
};
use glam::{Mat4, Vec3, Vec4};

/// Extreme points are taken in a few hundred directions; between two the surface may bulge by this share of the extent:
/// 0.4 % of a sphere.
pub(crate) const BULGE: f32 = 0.005;

/// Nearest depth of a point light's faces, of the reach of the farthest caster: nearer casters are cut off.
const NEAREST: f32 = 1e-3;

/// Directions of the faces of a cube and their ups.
const FACES: [(Vec3, Vec3); 6] = [
    (Vec3::X, Vec3::Y),
    (Vec3::NEG_X, Vec3::Y),
    (Vec3::Y, Vec3::NEG_Z),
    (Vec3::NEG_Y, Vec3::Z),
    (Vec3::Z, Vec3::Y),
    (Vec3::NEG_Z, Vec3::Y),
];

/// Right and up of a view along `forward`.
pub(crate) fn axes(forward: Vec3) -> (Vec3, Vec3) {
    let up = if forward.y.abs() > 0.99 { Vec3::X } else { Vec3::Y };
    let right = forward.cross(up).normalize();
    (right, right.cross(forward))
}

/// The extreme points of all casters, world space.
pub(crate) fn extremes(stage: &Stage) -> impl Iterator<Item = Vec3> {
    let of_instance = |placement: &Placement| {
        let world_from_unit = placement.world_from_unit();
        stage.model.extremes.iter().map(move |&p| world_from_unit.transform_point3(p))
    };
    stage.placements().iter().flat_map(of_instance)
}

/// Clip space from world space for each view of `light`, for maps of `size_texels` a side whose filters reach
/// `reach_texels` beyond a lookup.
pub(crate) fn views(stage: &Stage, light: &Light, (size_texels, reach_texels): (u32, f32)) -> Vec<Mat4> {
    let room = reach_texels / size_texels as f32;
    match *light {
        Light::Directional { to_light } => vec![parallel(extremes(stage), -to_light, room)],
        Light::Point { position } => {
            let reach = extremes(stage).map(|p| p.distance(position)).fold(0.0, f32::max) * (1.0 + BULGE);
            FACES.map(|face| face_of_cube(position, face, (reach, room))).to_vec()
        }
    }
}

/// The parallel projection along `forward` that holds `points`.
pub(crate) fn parallel(points: impl Iterator<Item = Vec3>, forward: Vec3, room: f32) -> Mat4 {
    let (right, up) = axes(forward);
    let (mut low, mut high) = (Vec3::MAX, Vec3::MIN);
    for p in points {
        let seen = Vec3::new(p.dot(right), p.dot(up), p.dot(forward));
        (low, high) = (low.min(seen), high.max(seen));
    }
    let (centre, half) = (0.5 * (low + high), 0.5 * (high - low).max(Vec3::splat(1e-6)));
    let half = half * (1.0 + BULGE + 2.0 * room);
    let row = |axis: Vec3, centre: f32, scale: f32| (axis * scale).extend(-centre * scale);
    let x = row(right, centre.x, 1.0 / half.x);
    let y = row(up, centre.y, 1.0 / half.y);
    let z = row(forward, centre.z - half.z, 0.5 / half.z);
    Mat4::from_cols(x, y, z, Vec4::W).transpose()
}

fn face_of_cube(eye: Vec3, (forward, up): (Vec3, Vec3), (far, room): (f32, f32)) -> Mat4 {
    let near = NEAREST * far;
    let scale = 1.0 / (1.0 + 2.0 * room);
    let row = |axis: Vec3| axis.extend(-axis.dot(eye));
    let depth = row(forward);
    let z = (depth - near * Vec4::W) * (far / (far - near));
    Mat4::from_cols(row(forward.cross(up)) * scale, row(up) * scale, z, depth).transpose()
}
