//! A flat receiver of shadow, and the matrices that flatten casters onto it: what the planar techniques share.
//!
//! In: a parallelogram and a light, world space. Out: the projection onto its plane as seen from the light (J. Blinn, "Me and
//! My (Fake) Shadow", 1988; for any plane), and the one that takes the pyramid between a light's sample and the
//! parallelogram to clip space (P. Heckbert, M. Herf, "Simulating Soft Shadows with Graphics Hardware", 1997).
//!
//! Both have a homogeneous w that is positive on this side of the light only, so that what lies beyond the light is
//! clipped and never drawn mirrored (an anti-shadow).

use crate::scene::Scene;
use glam::{Mat4, Vec3, Vec4};
use shadowfit_solver::mesh::Frame;

/// The pyramid is cut off at its apex: casters higher than 1 / (1 + this) of the light's height cast nothing there. Far
/// below any scene's detail, and far above the rounding of a height that is a sum of three products (1e-7).
const CUT_APEX: f32 = 1e-5;

/// A parallelogram that receives shadow, world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Receiver {
    corner: Vec3,
    edges: [Vec3; 2],
    normal: Vec3,
}

impl Receiver {
    /// From a corner and the edges that leave it; `None` where they span no area.
    #[must_use]
    pub fn new(corner: Vec3, edges: [Vec3; 2]) -> Option<Self> {
        let normal = edges[0].cross(edges[1]).try_normalize()?;
        Some(Self { corner, edges, normal })
    }

    /// The ground of `scene` ([`Scene::stand_on_ground`]), where unit space (that of `frame`) is world space. `None`
    /// where it has none.
    #[must_use]
    pub fn of_ground(scene: &Scene, frame: &Frame) -> Option<Self> {
        let corners = &scene.soup.corners_model;
        let [first, second] = corners.get(corners.len().checked_sub(scene.ground_triangles)?..)? else { return None };
        let [a, b, d] = [first[0], first[1], second[2]].map(|p| frame.unit_from_model(p));
        Self::new(a, [b - a, d - a])
    }

    /// The equation of its plane, positive on the side of `light` ([`Light::homogeneous`]); `None` where the light lies
    /// in the plane and nothing can be flattened.
    pub(crate) fn facing(&self, light: Vec4) -> Option<Vec4> {
        let plane = self.normal.extend(-self.normal.dot(self.corner));
        let height = plane.dot(light);
        (height != 0.0).then(|| plane * height.signum())
    }

    /// Takes a point to its shadow on `plane`, which faces `light`. w is the height of the light over the point (its
    /// sine above the horizon, if it is directional): positive on this side of the light.
    pub(crate) fn flattened_from_world(plane: Vec4, light: Vec4) -> Mat4 {
        let columns = plane.to_array().map(|n| -n * light);
        let [x, y, z, w] = columns;
        Mat4::from_cols(x, y, z, w) + plane.dot(light) * Mat4::IDENTITY
    }

    /// Rows 0 and 1: coordinates (0..1 along the edges) of a point in the plane.
    pub(crate) fn texture_from_world(&self) -> Mat4 {
        let [u, v] = self.edges;
        let area = u.cross(v);
        let row = |dual: Vec3| (dual / area.length_squared()).extend(0.0);
        let [a, b] = [row(v.cross(area)), row(area.cross(u))].map(|r| r - Vec4::W * r.dot(self.corner.extend(0.0)));
        Mat4::from_cols(a, b, Vec4::ZERO, Vec4::W).transpose()
    }

    /// Takes the pyramid from `light` (a far one: the prism) down to the parallelogram to clip space: the parallelogram
    /// fills the frame, its corner at the upper left, and casters below it or beyond the light are clipped.
    pub(crate) fn clip_from_world(&self, plane: Vec4, light: Vec4) -> Mat4 {
        let flat = Self::flattened_from_world(plane, light);
        let texture = self.texture_from_world() * flat;
        let w = flat.row(3);
        let (x, y) = (2.0 * texture.row(0) - w, w - 2.0 * texture.row(1));
        Mat4::from_cols(x, y, w - CUT_APEX * plane, w).transpose()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIGHTS: [Vec4; 3] =
        [Vec4::new(0.48, 0.6, -0.64, 0.0), Vec4::new(0.3, 2.0, 0.1, 1.0), Vec4::new(-5.0, 900.0, 30.0, 1.0)];

    fn slanted() -> Receiver {
        Receiver::new(Vec3::new(-1.0, -0.5, 1.0), [Vec3::new(2.0, 0.4, 0.1), Vec3::new(0.3, 0.2, -2.0)]).unwrap()
    }

    #[test]
    fn a_shadow_lies_in_the_plane_on_the_ray_from_the_light() {
        for light in LIGHTS {
            let plane = slanted().facing(light).unwrap();
            let p = Vec3::new(0.2, 0.7, 0.3);
            let flat = Receiver::flattened_from_world(plane, light) * p.extend(1.0);
            let shadow = flat.truncate() / flat.w;
            assert!(flat.w > 0.0 && plane.dot(shadow.extend(1.0)).abs() < 1e-5, "{light}: {flat}");
            let ray = light.truncate() - light.w * p;
            assert!((shadow - p).normalize().cross(ray.normalize()).length() < 1e-5, "{light}: {shadow}");
        }
    }

    #[test]
    fn the_receiver_fills_the_texture_at_depth_one() {
        let receiver = slanted();
        for light in LIGHTS {
            let matrix = receiver.clip_from_world(receiver.facing(light).unwrap(), light);
            for (i, j) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.25, 0.5)] {
                let p = receiver.corner + i * receiver.edges[0] + j * receiver.edges[1];
                let clip = matrix * p.extend(1.0);
                let expected = Vec3::new(2.0 * i - 1.0, 1.0 - 2.0 * j, 1.0);
                assert!((clip.truncate() / clip.w).distance(expected) < 1e-5, "{light}: {clip}");
                assert!(
                    (receiver.texture_from_world() * p.extend(1.0)).truncate().distance(Vec3::new(i, j, 0.0)) < 1e-5
                );
            }
        }
    }

    #[test]
    fn what_lies_below_the_receiver_or_beyond_the_light_is_outside() {
        let receiver = Receiver::new(Vec3::new(-1.0, 0.0, 1.0), [Vec3::X * 2.0, Vec3::Z * -2.0]).unwrap();
        let light = Vec4::new(0.0, 1.0, 0.0, 1.0);
        let plane = receiver.facing(light).unwrap();
        let inside = |height: f32| {
            let clip = receiver.clip_from_world(plane, light) * Vec4::new(0.0, height, 0.0, 1.0);
            clip.w > 0.0 && (0.0..=clip.w).contains(&clip.z)
        };
        assert_eq!([-1.0, -0.01, 0.01, 0.99, 1.01, 2.0].map(inside), [false, false, true, true, false, false]);
    }

    #[test]
    fn a_light_in_the_plane_and_edges_without_area_are_refused() {
        let receiver = Receiver::new(Vec3::ZERO, [Vec3::X, Vec3::NEG_Z]).unwrap();
        assert_eq!(receiver.facing(Vec4::new(1.0, 0.0, 0.0, 0.0)), None);
        assert_eq!(receiver.facing(Vec4::new(3.0, -2.0, 0.0, 1.0)), Some(Vec4::NEG_Y));
        assert_eq!(Receiver::new(Vec3::ZERO, [Vec3::X, Vec3::X * 2.0]), None);
    }
}
