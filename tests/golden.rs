//! Pictures of masks with planes placed by hand, small enough to be read in a diff: `tests/golden/*.txt`.
//!
//! The CPU renderer draws them (`tests/parity.rs` holds the other one to it) from what a fit wrote, so they stand for
//! everything from the reader to the baked textures. A missing picture fails; a failing one leaves what was drawn
//! and the difference under `target/tmp/golden`.

#![allow(clippy::unwrap_used, reason = "clippy sees only #[test] functions as tests, not what they call")]

#[allow(dead_code, reason = "each test binary uses its part")]
mod fits;

use shadowfit::{
    asset::read,
    render::{Antialias, Camera, FrameOptions, FrameRequest, Light, Mode, cpu},
    scene,
};
use shadowfit_solver::{lights::direction, mesh::Mesh};
use std::{
    fs,
    path::{Path, PathBuf},
};

/// Pixels in a cell, and cells in a picture. Letters are about twice as tall as wide.
const CELL_PX: [u32; 2] = [4, 8];
const CELLS: [u32; 2] = [80, 40];
/// Share of the cells with something in them that may differ. Another machine's rounding changes cells whose mean lies
/// on a threshold, one or two; a plane that is off by two cells, or a texture that is mirrored, changes half of those
/// in shadow and more.
const TOLERANCE: f64 = 0.02;

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
    let size_px = [CELLS[0] * CELL_PX[0], CELLS[1] * CELL_PX[1]];
    let request = FrameRequest {
        camera: Camera::turntable(view[0], view[1]),
        light: Light::Directional { to_light: direction(light[0], light[1]) },
        options: FrameOptions { size_px, mode: Mode::Mask, antialias: Antialias::Off },
    };
    turntable.render(&request).unwrap()
}

/// One letter a cell: ` ` mostly background, `-` mostly turned away from the light; else by how much of the rest is
/// lit: `#` in shadow, `+` half and half, `.` lit.
fn letters(frame: &image::RgbaImage) -> Vec<String> {
    let letter = |column: u32, row: u32| {
        let pixels = (0..CELL_PX[0] * CELL_PX[1])
            .map(|i| frame.get_pixel(column * CELL_PX[0] + i % CELL_PX[0], row * CELL_PX[1] + i / CELL_PX[0]).0);
        let [lit, facing, covered] = pixels.fold([0; 3], |sum, p| [0, 1, 2].map(|i| sum[i] + u32::from(p[i])));
        let total = CELL_PX[0] * CELL_PX[1] * 255;
        match (2 * covered > total, 2 * facing > covered) {
            (false, _) => ' ',
            (true, false) => '-',
            (true, true) if 3 * lit < facing => '#',
            (true, true) if 3 * lit < 2 * facing => '+',
            (true, true) => '.',
        }
    };
    (0..CELLS[1]).map(|row| (0..CELLS[0]).map(|column| letter(column, row)).collect()).collect()
}

fn golden_path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(format!("{name}.txt"))
}

/// How many cells differ, and the letters drawn where they do.
fn compare(expected: &[String], actual: &[String]) -> (usize, String) {
    let (mut count, mut text) = (0, String::new());
    for (row, actual) in actual.iter().enumerate() {
        let expected = expected.get(row).map_or("", String::as_str);
        let padded = expected.chars().chain(std::iter::repeat('?')).take(actual.len());
        for (e, a) in padded.zip(actual.chars()) {
            count += usize::from(e != a);
            text.push(if e == a { ' ' } else { a });
        }
        text.push('\n');
    }
    (count, text)
}

/// Draws, and compares with the golden picture or takes its place.
fn check(golden: &Golden) -> Result<(), String> {
    let name = golden.name;
    let frame = draw(golden);
    let actual = letters(&frame);
    let count = |is: fn(char) -> bool| actual.iter().flat_map(|row| row.chars()).filter(|c| is(*c)).count();
    let tolerated = TOLERANCE * count(|c| c != ' ') as f64;
    let in_shadow = count(|c| c == '#');
    if (in_shadow as f64) < 3.0 * tolerated {
        return Err(format!(
            "{name}: {in_shadow} cells in shadow could be lost unnoticed: choose another view or light"
        ));
    }
    let path = golden_path(name);
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("golden");
    fs::create_dir_all(&folder).unwrap();
    let text = format!("{}\n", actual.join("\n"));
    if std::env::var_os("SHADOWFIT_ACCEPT").is_some_and(|value| value == "1") {
        frame.save(folder.join(format!("{name}.png"))).unwrap();
        fs::write(&path, text).unwrap();
        return Ok(());
    }
    let accept = "look at it, then accept it with: SHADOWFIT_ACCEPT=1 cargo test --test golden";
    let drawn = folder.join(format!("{name}.actual.txt"));
    let Ok(expected) = fs::read_to_string(&path) else {
        fs::write(&drawn, text).unwrap();
        return Err(format!("{} is missing; {} is what was drawn: {accept}", path.display(), drawn.display()));
    };
    let (different, difference) = compare(&expected.lines().map(str::to_owned).collect::<Vec<_>>(), &actual);
    if expected.lines().count() == actual.len() && different as f64 <= tolerated {
        return Ok(());
    }
    fs::write(&drawn, text).unwrap();
    fs::write(folder.join(format!("{name}.difference.txt")), &difference).unwrap();
    frame.save(folder.join(format!("{name}.actual.png"))).unwrap();
    Err(format!("{name}: {different} cells differ, see {}: {accept}\n{difference}", drawn.display()))
}

#[test]
fn masks_look_as_accepted() {
    let failures: Vec<String> = PICTURES.iter().filter_map(|golden| check(golden).err()).collect();
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn every_golden_picture_is_compared() {
    let folder = fs::read_dir(golden_path("").parent().unwrap()).unwrap();
    for path in folder.map(|entry| entry.unwrap().path()).filter(|path| path.extension().is_some_and(|e| e == "txt")) {
        assert!(PICTURES.iter().any(|golden| golden_path(golden.name) == path), "{} is nobody's", path.display());
        // Large pictures belong into no repository.
        assert!(fs::metadata(&path).unwrap().len() <= 4096, "{}", path.display());
    }
}
