//! Pictures of masks with planes placed by hand, small enough to be read in a diff: `tests/golden/*.txt`.
//!
//! The CPU renderer draws them (`tests/parity.rs` holds the other one to it) from what a fit wrote, so they stand for
//! everything from the reader to the baked textures. A missing picture fails; a failing one leaves what was drawn
//! and the difference under `target/tmp/golden`.

#![allow(clippy::unwrap_used, reason = "clippy sees only #[test] functions as tests, not what they call")]

#[allow(dead_code, reason = "each test binary uses its part")]
mod fits;
mod pictures;

use shadowfit::{
    asset::read,
    render::{Antialias, Camera, FrameOptions, FrameRequest, Light, Mode, cpu},
    scene,
};
use shadowfit_solver::{lights::direction, mesh::Mesh};
use std::fs;

/// One picture: model, plane file, view and light (azimuth, elevation in degrees).
struct Golden {
    name: &'static str,
    model: &'static str,
    planes: &'static str,
    view_deg: [f32; 2],
    light_deg: [f32; 2],
}

const PICTURES: [Golden; 4] = [
    Golden {
        name: "plate_over_ground",
        model: "plate_over_ground.glb",
        planes: "plate_over_ground.planes.json",
        view_deg: [20.0, 50.0],
        light_deg: [210.0, 30.0],
    },
    Golden {
        name: "t_shape",
        model: "t_shape.glb",
        planes: "../../tests/golden/t_shape.planes.json",
        view_deg: [40.0, 5.0],
        light_deg: [60.0, 45.0],
    },
    Golden {
        name: "teapot",
        model: "teapot.glb",
        planes: "teapot-by-hand.planes.json",
        view_deg: [30.0, 60.0],
        light_deg: [100.0, 25.0],
    },
    Golden {
        name: "aircraft",
        model: "aircraft.glb",
        planes: "aircraft-thesis.planes.json",
        view_deg: [30.0, 50.0],
        light_deg: [100.0, 40.0],
    },
];

/// The mask frame of what a fit wrote.
fn draw(golden: &Golden) -> image::RgbaImage {
    let folder = tempfile::tempdir().unwrap();
    let model = fits::model(golden.model);
    let planes = Some(fits::model("planes").join(golden.planes));
    let request = fits::FitRequest { planes, ..fits::request(&model, folder.path(), fits::least()) };
    fits::fit(&request).unwrap();
    let written = folder.path().join(golden.model).with_extension("shadow.glb");
    let scene = scene::load(&written).unwrap();
    let mesh = Mesh::new(&scene.soup).unwrap();
    let mut turntable = cpu::Turntable::new(&scene, &mesh);
    turntable.set_planes(&read(&written).unwrap().in_unit_space(&mesh.frame));
    let [view, light] = [golden.view_deg, golden.light_deg].map(|angles| angles.map(f32::to_radians));
    let size_px = pictures::SIZE_PX;
    let request = FrameRequest {
        camera: Camera::turntable(view[0], view[1]),
        light: Light::Directional { to_light: direction(light[0], light[1]) },
        options: FrameOptions { size_px, mode: Mode::Mask, antialias: Antialias::Off },
    };
    turntable.render(&request).unwrap()
}

/// Draws, and compares with the golden picture or takes its place.
fn check(golden: &Golden) -> Result<(), String> {
    let frame = draw(golden);
    if pictures::shows_too_little_shadow(&frame) {
        return Err(format!("{}: the shadow could be lost unnoticed: choose another view or light", golden.name));
    }
    pictures::check(golden.name, &frame)
}

#[test]
fn masks_look_as_accepted() {
    let failures: Vec<String> = PICTURES.iter().filter_map(|golden| check(golden).err()).collect();
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn every_golden_picture_is_compared() {
    let folder = fs::read_dir(pictures::golden_path("").parent().unwrap()).unwrap();
    for path in folder.map(|entry| entry.unwrap().path()).filter(|path| path.extension().is_some_and(|e| e == "txt")) {
        assert!(
            PICTURES.iter().any(|golden| pictures::golden_path(golden.name) == path),
            "{} is nobody's",
            path.display()
        );
        // Large pictures belong into no repository.
        assert!(fs::metadata(&path).unwrap().len() <= 4096, "{}", path.display());
    }
}
