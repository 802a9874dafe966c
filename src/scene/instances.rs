//! A scene of many copies of another: what rays meet where a renderer draws instances.

use super::Scene;
use glam::DVec3;
use shadowfit_solver::mesh::Frame;

impl Scene {
    /// Every triangle of every instance as its own. `instances` take the unit space of `frame` to the new scene's model
    /// space; materials and images are shared.
    #[must_use]
    pub fn instanced(&self, instances: &[glam::Mat4], frame: &Frame) -> Self {
        let mut out = Self { materials: self.materials.clone(), images: self.images.clone(), ..Self::default() };
        out.soup.cutouts = self.soup.cutouts.clone();
        for world_from_unit in instances {
            let matrix = world_from_unit.as_dmat4();
            let moved = |p: DVec3| matrix.transform_point3((p - frame.centre_model) / frame.radius);
            out.soup.corners_model.extend(self.soup.corners_model.iter().map(|corners| corners.map(moved)));
            out.soup.sides.extend(&self.soup.sides);
            out.soup.cutout.extend(&self.soup.cutout);
            out.soup.cutout_uv.extend(&self.soup.cutout_uv);
            let turned = |n: glam::Vec3| world_from_unit.transform_vector3(n).normalize_or_zero();
            out.normals.extend(self.normals.iter().map(|normals| normals.map(turned)));
            out.uvs.extend(&self.uvs);
            out.material_of.extend(&self.material_of);
            out.origins.extend(&self.origins);
            out.section_of.extend(&self.section_of);
        }
        out
    }
}
