//! The list of all generated files. `main.rs` writes them, `tests/models.rs` compares them with the committed ones.

pub mod aircraft;
pub mod analytic;
pub mod glb;
pub mod loft;
pub mod mesh;
pub mod planes;
pub mod planted;
pub mod teapot;
pub mod teapot_planes;

/// One generated file.
pub struct GeneratedFile {
    /// Path below the models folder, with `/`.
    pub path: &'static str,
    /// The whole content.
    pub bytes: Vec<u8>,
}

/// All models and plane files, in a fixed order.
pub fn all_files() -> Vec<GeneratedFile> {
    let mut files = Vec::new();
    let mut add = |path, bytes| files.push(GeneratedFile { path, bytes });
    add("teapot.glb", teapot::model().to_glb());
    add("aircraft.glb", aircraft::model().to_glb());
    add("plate_over_ground.glb", analytic::plate_over_ground().to_glb());
    add("sphere.glb", analytic::sphere().to_glb());
    add("box.glb", analytic::cuboid().to_glb());
    add("t_shape.glb", analytic::t_shape().to_glb());
    add("planted_planes.glb", planted::model().to_glb());
    add("planes/teapot-by-hand.planes.json", teapot_planes::file().to_json());
    add("planes/aircraft-thesis.planes.json", aircraft::plane_file().to_json());
    add("planes/plate_over_ground.planes.json", analytic::plate_planes().to_json());
    add("planes/planted_planes.planes.json", planted::plane_file().to_json());
    files
}
