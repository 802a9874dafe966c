//! The camera: around the centre of unit space (the turntable), or anywhere.
//!
//! [`Camera::clip_from_world`] (rasteriser) and [`Camera::ray`] (tracer) are built from the same axes and extents,
//! so the ray through a pixel's centre meets the point that the rasteriser draws there.

use glam::{Mat4, Vec2, Vec3, Vec4};

/// The unit sphere fills the shorter side of the frame but for this share.
const MARGIN: f32 = 0.04;
/// Vertical field of view of the turntable: 30 degrees, little distortion.
const FIELD_OF_VIEW_RAD: f32 = std::f32::consts::FRAC_PI_6;
/// Half the drawn depth around the centre. The model ends at 1, a square around the unit sphere at sqrt(2);
/// twice this would still leave Depth32Float finer than 1e-6.
const REACH: f32 = 1.5;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Projection {
    /// Tangent of half the field of view over the frame's shorter side.
    Perspective { half_tangent: f32 },
    /// Half the width of the frame's shorter side, unit space.
    Orthographic { half_extent: f32 },
}

/// A view of world space, which is unit space where one instance stands as it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    right: Vec3,
    up: Vec3,
    forward: Vec3,
    eye: Vec3,
    /// Nearest and farthest depth that is drawn.
    depth: [f32; 2],
    projection: Projection,
}

impl Camera {
    /// Perspective view of the centre with a field of view of 30 degrees over the frame's shorter side, the unit
    /// sphere fitted with 4 % margin. Azimuth 0 looks from +Z towards -Z, azimuth 90 degrees from +X; elevation
    /// counts up from the XZ plane, positive from above (+Y).
    #[must_use]
    pub fn turntable(azimuth_rad: f32, elevation_rad: f32) -> Self {
        let half_tangent = (0.5 * FIELD_OF_VIEW_RAD).tan();
        let distance = (1.0 + MARGIN) / (0.5 * FIELD_OF_VIEW_RAD).sin();
        Self::around_centre(azimuth_rad, elevation_rad, distance, Projection::Perspective { half_tangent })
    }

    /// The same view without perspective.
    #[must_use]
    pub fn orthographic(azimuth_rad: f32, elevation_rad: f32) -> Self {
        let projection = Projection::Orthographic { half_extent: 1.0 + MARGIN };
        Self::around_centre(azimuth_rad, elevation_rad, 2.0 * REACH, projection)
    }

    /// Perspective view from `eye` towards `target` with the given field of view over the frame's shorter side; what
    /// lies between the two depths is drawn. Up is as near to +Y as it can be.
    #[must_use]
    pub fn looking(eye: Vec3, target: Vec3, field_of_view_rad: f32, depth: [f32; 2]) -> Self {
        let forward = (target - eye).normalize_or(Vec3::NEG_Z);
        let right = forward.cross(Vec3::Y).normalize_or(Vec3::X);
        let projection = Projection::Perspective { half_tangent: (0.5 * field_of_view_rad).tan() };
        Self { right, up: right.cross(forward), forward, eye, depth, projection }
    }

    fn around_centre(azimuth_rad: f32, elevation_rad: f32, distance: f32, projection: Projection) -> Self {
        let (sin_a, cos_a) = azimuth_rad.sin_cos();
        let (sin_e, cos_e) = elevation_rad.sin_cos();
        let forward = -Vec3::new(sin_a * cos_e, sin_e, cos_a * cos_e);
        Self {
            right: Vec3::new(cos_a, 0.0, -sin_a),
            up: Vec3::new(-sin_a * sin_e, cos_e, -cos_a * sin_e),
            forward,
            eye: -distance * forward,
            depth: [distance - REACH, distance + REACH],
            projection,
        }
    }

    /// The same view in a space in which the point p is `scale * p + offset`.
    #[must_use]
    pub fn moved(&self, scale: f32, offset: Vec3) -> Self {
        let projection = match self.projection {
            Projection::Orthographic { half_extent } => Projection::Orthographic { half_extent: scale * half_extent },
            perspective @ Projection::Perspective { .. } => perspective,
        };
        let (eye, depth) = (scale * self.eye + offset, self.depth.map(|depth| scale * depth));
        Self { eye, depth, projection, ..*self }
    }

    /// Where the camera stands.
    #[must_use]
    pub fn eye(&self) -> Vec3 {
        self.eye
    }

    /// Is there no perspective?
    #[must_use]
    pub fn is_orthographic(&self) -> bool {
        matches!(self.projection, Projection::Orthographic { .. })
    }

    /// Unit vector of the view.
    #[must_use]
    pub fn forward(&self) -> Vec3 {
        self.forward
    }

    /// Nearest and farthest depth that is drawn.
    #[must_use]
    pub fn depth(&self) -> [f32; 2] {
        self.depth
    }

    /// Clip space (wgpu: depth 0..1, y up) from world space, for a frame of `size_px`.
    #[must_use]
    pub fn clip_from_world(&self, size_px: [u32; 2]) -> Mat4 {
        let half = self.half_extents(size_px);
        let [near, far] = self.depth;
        let row = |axis: Vec3| axis.extend(-axis.dot(self.eye));
        let (x, y) = (row(self.right / half.x), row(self.up / half.y));
        let depth = row(self.forward);
        let (z, w) = match self.projection {
            Projection::Perspective { .. } => ((depth - near * Vec4::W) * (far / (far - near)), depth),
            Projection::Orthographic { .. } => ((depth - near * Vec4::W) / (far - near), Vec4::W),
        };
        Mat4::from_cols(x, y, z, w).transpose()
    }

    /// The ray through a point of the frame, in pixels from the upper left corner: the centre of pixel (i, j) is
    /// (i + 0.5, j + 0.5). Origin and unit direction, world space.
    #[must_use]
    pub fn ray(&self, px: f32, py: f32, size_px: [u32; 2]) -> (Vec3, Vec3) {
        let [width, height] = size_px.map(|n| n as f32);
        let half = self.half_extents(size_px);
        let on_screen =
            self.right * (half.x * (2.0 * px / width - 1.0)) + self.up * (half.y * (1.0 - 2.0 * py / height));
        match self.projection {
            Projection::Perspective { .. } => (self.eye, (self.forward + on_screen).normalize()),
            Projection::Orthographic { .. } => (self.eye + on_screen, self.forward),
        }
    }

    /// Half the frame's width and height: at distance 1 from the eye, or anywhere if orthographic.
    fn half_extents(&self, size_px: [u32; 2]) -> Vec2 {
        let size = Vec2::new(size_px[0] as f32, size_px[1] as f32);
        let shorter = match self.projection {
            Projection::Perspective { half_tangent } => half_tangent,
            Projection::Orthographic { half_extent } => half_extent,
        };
        shorter * size / size.min_element()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cameras() -> impl Iterator<Item = Camera> {
        let angles = [(0.0, 0.0), (1.3, 0.4), (4.0, -1.2), (0.3, std::f32::consts::FRAC_PI_2)];
        angles.into_iter().flat_map(|(a, e)| [Camera::turntable(a, e), Camera::orthographic(a, e)])
    }

    #[test]
    fn rays_meet_the_points_that_the_matrix_draws() {
        for camera in cameras() {
            for size in [[640, 480], [100, 300], [64, 64]] {
                let (origin, direction) = camera.ray(37.5, 51.5, size);
                let clip = camera.clip_from_world(size) * (origin + 3.7 * direction).extend(1.0);
                let ndc = clip.truncate() / clip.w;
                let x = (ndc.x + 1.0) * 0.5 * size[0] as f32;
                let y = (1.0 - ndc.y) * 0.5 * size[1] as f32;
                assert!((x - 37.5).abs() < 1e-3 && (y - 51.5).abs() < 1e-3, "{camera:?} {size:?}: {x} {y}");
                assert!((0.0..1.0).contains(&ndc.z), "{camera:?}: depth {}", ndc.z);
            }
        }
    }

    #[test]
    fn the_unit_sphere_fits_with_a_margin_of_four_percent() {
        // The ray through the edge's middle passes the centre at 1.04.
        for camera in cameras() {
            for (px, py) in [(0.0, 50.0), (100.0, 50.0), (50.0, 0.0), (50.0, 100.0)] {
                let (origin, direction) = camera.ray(px, py, [100, 100]);
                let nearest = origin - direction * origin.dot(direction);
                assert!((nearest.length() - 1.04).abs() < 1e-5, "{camera:?}: {}", nearest.length());
            }
        }
    }

    #[test]
    fn azimuth_0_looks_from_plus_z_and_90_degrees_from_plus_x() {
        let size = [100, 100];
        let right_of = |camera: Camera, p: Vec3| {
            let clip = camera.clip_from_world(size) * p.extend(1.0);
            clip.x / clip.w
        };
        assert!(Camera::turntable(0.0, 0.0).eye().normalize().distance(Vec3::Z) < 1e-6);
        assert!(right_of(Camera::turntable(0.0, 0.0), Vec3::X) > 0.5);
        let from_x = Camera::turntable(std::f32::consts::FRAC_PI_2, 0.0);
        assert!(from_x.eye().normalize().distance(Vec3::X) < 1e-6);
        assert!(right_of(from_x, Vec3::NEG_Z) > 0.5);
        let above = Camera::turntable(0.0, 0.5).clip_from_world(size) * Vec3::Y.extend(1.0);
        assert!(above.y > 0.0 && Camera::turntable(0.0, 0.5).eye().y > 0.0);
    }
}
