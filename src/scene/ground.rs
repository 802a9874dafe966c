//! A level ground under a model: it receives shadow and casts none.

use super::{Material, Origin, Scene};
use glam::{DVec3, Vec2, Vec3};
use shadowfit_solver::mesh::{Frame, Sides};

/// Linear RGBA of the ground: light enough for a shadow to show, darker than the background.
const COLOR: [f32; 4] = [0.5, 0.5, 0.48, 1.0];

impl Scene {
    /// Puts a square ground under the model, level with its lowest corner; `half_extent` is in radii of `frame`, the
    /// unit space of the model alone. Two triangles behind all others, in no section.
    pub fn stand_on_ground(&mut self, frame: &Frame, half_extent: f64) {
        let corners = self.soup.corners_model.iter().flatten();
        let height = corners.map(|p| p.y).fold(f64::INFINITY, f64::min);
        let reach = half_extent * frame.radius;
        let corner =
            |x: f64, z: f64| DVec3::new(frame.centre_model.x + x * reach, height, frame.centre_model.z + z * reach);
        let [a, b, c, d] = [corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0)];
        self.materials.push(Material {
            base_color: COLOR,
            image: None,
            repeat: [false; 2],
            alpha_cutoff: None,
            transmittance: None,
        });
        for triangle in [[a, b, c], [a, c, d]] {
            self.soup.corners_model.push(triangle);
            self.soup.sides.push(Sides::Front);
            self.soup.cutout.push(None);
            self.soup.cutout_uv.push([Vec2::ZERO; 3]);
            self.normals.push([Vec3::Y; 3]);
            self.uvs.push([Vec2::ZERO; 3]);
            self.material_of.push(self.materials.len() as u32 - 1);
            self.origins.push(Origin { mesh: u32::MAX, primitive: 0, triangle: self.ground_triangles as u32 });
            self.section_of.push(u32::MAX);
            self.ground_triangles += 1;
        }
    }

    /// Puts the ground into a section of a fitted asset.
    pub fn label_ground(&mut self, section: u32) {
        let first = self.section_of.len() - self.ground_triangles;
        self.section_of[first..].fill(section);
    }

    /// Is that triangle of the ground?
    #[must_use]
    pub fn is_ground(&self, triangle: usize) -> bool {
        triangle + self.ground_triangles >= self.soup.corners_model.len()
    }
}
