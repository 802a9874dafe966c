//! `render`, and machines without a graphics adapter.

use crate::program::{Outcome, model, outcome, program, run, small_asset};
use glam::DVec3;
use image::RgbaImage;
use shadowfit::{
    asset::{self, AssetRequest},
    scene,
};
use shadowfit_solver::{mesh::Mesh, plane::BakedSet};
use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
    process::Command,
};

const SIZE_PX: u32 = 96;

/// The picture that `render` writes with these words.
fn picture(asset: &Path, more: &[&str]) -> RgbaImage {
    let out = asset.with_file_name("frame.png");
    let words = ["render", asset.to_str().unwrap(), "-o", out.to_str().unwrap(), "--size", &SIZE_PX.to_string()];
    assert_eq!(run(&[&words, more].concat()).ok().stdout, "");
    let picture = image::open(out).unwrap().into_rgba8();
    assert_eq!(picture.dimensions(), (SIZE_PX, SIZE_PX));
    picture
}

fn colours(picture: &RgbaImage) -> BTreeSet<[u8; 4]> {
    picture.pixels().map(|pixel| pixel.0).collect()
}

/// Share of the pixels with this property.
fn share(picture: &RgbaImage, is: impl Fn([u8; 4]) -> bool) -> f64 {
    picture.pixels().filter(|pixel| is(pixel.0)).count() as f64 / f64::from(picture.width() * picture.height())
}

/// Share of the pixels that differ.
fn difference(a: &RgbaImage, b: &RgbaImage) -> f64 {
    let count = a.pixels().zip(b.pixels()).filter(|(a, b)| a != b).count();
    count as f64 / f64::from(a.width() * a.height())
}

#[test]
fn three_modes_draw_three_pictures() {
    let folder = tempfile::tempdir().unwrap();
    let asset = small_asset(folder.path());
    let draw = |mode| picture(&asset, &["--mode", mode, "--light", "-30,60", "--view", "20,35"]);
    let [shaded, mask, planes] = ["shaded", "mask", "planes"].map(draw);
    // A 4 m square seen from 35 degrees above fills a third of a frame that its bounding sphere fits in.
    let covered = share(&mask, |[.., b, _]| b == 255);
    assert!((0.15..0.7).contains(&covered), "{covered}");
    // Everything faces up and so towards the light; the shadow of the 1 m plate is about 1/17 of it, less what the
    // plate hides of it.
    let facing = share(&mask, |[_, g, ..]| g == 255);
    let dark = share(&mask, |[r, g, ..]| g == 255 && r < 128) / covered;
    assert_eq!(facing, covered);
    assert!((0.01..0.1).contains(&dark), "{dark}");
    // Ground, shadow, background and the mixed colours of their borders.
    assert!(colours(&shaded).len() > 4, "{:?}", colours(&shaded));
    // The drawn plane is a good part of a square metre of 16.
    let drawn = difference(&shaded, &planes) / covered;
    assert!((0.01..0.3).contains(&drawn), "{drawn}");
}

#[test]
fn light_and_view_move_what_is_seen() {
    let folder = tempfile::tempdir().unwrap();
    let asset = small_asset(folder.path());
    let first = picture(&asset, &["--light", "0,60", "--view", "20,35"]);
    assert_eq!(difference(&first, &picture(&asset, &["--light", "0,60", "--view", "20,35"])), 0.0);
    for more in [["--light", "90,60", "--view", "20,35"], ["--light", "0,60", "--view", "60,35"]] {
        // The shadow alone covers more than a hundredth of the frame.
        assert!(difference(&first, &picture(&asset, &more)) > 0.01, "{more:?}");
    }
    // From below there is nothing: both squares are single-sided.
    assert_eq!(share(&picture(&asset, &["--mode", "mask", "--view", "0,-40"]), |[.., b, _]| b > 0), 0.0);
}

#[test]
fn a_light_with_a_radius_has_soft_edges() {
    let folder = tempfile::tempdir().unwrap();
    let asset = small_asset(folder.path());
    let words = ["--mode", "mask", "--light", "-30,60", "--view", "20,35"];
    let grey = |radius: &str| {
        let mask = picture(&asset, &[&words[..], &["--light-radius", radius]].concat());
        mask.pixels().filter(|pixel| pixel.0[1] == 255 && (1..255).contains(&pixel.0[0])).count()
    };
    // The outline of the shadow is some 40 pixels long, its penumbra 2 pixels wide at 4 degrees.
    let [none, narrow, wide] = ["0", "4", "12"].map(grey);
    assert!(none == 0 && narrow > 20 && wide > narrow * 3 / 2, "{none} {narrow} {wide}");
}

#[test]
fn light_in_the_plane_or_below_the_horizon_draws_no_nonsense() {
    let folder = tempfile::tempdir().unwrap();
    let asset = small_asset(folder.path());
    // The shadow plane is horizontal: this light lies exactly in it, and grazes what it lights.
    for light in ["0,0", "90,0", "180,0", "90,-30"] {
        let mask = picture(&asset, &["--mode", "mask", "--light", light]);
        assert!(colours(&mask).iter().all(|[_, g, b, a]| [*g, *b].iter().all(|x| [0, 255].contains(x)) && *a == *b));
        let facing_and_dark = share(&mask, |[r, g, ..]| g == 255 && r < 255);
        assert_eq!(facing_and_dark, 0.0, "{light}");
    }
}

/// An asset of two sections: the plate, and the ground, which reads the planes only where `ground_reads`.
fn two_sections(fitted: &Path, ground_reads: &[u32]) -> PathBuf {
    let input = model("plate_over_ground");
    let scene = scene::load(&input).unwrap();
    let frame = Mesh::new(&scene.soup).unwrap().frame;
    let (found, out) = (asset::read(fitted).unwrap(), fitted.with_file_name(format!("{}-planes", ground_reads.len())));
    let sections = vec![vec![], ground_reads.to_vec()];
    let set = BakedSet { sections, active: None, ..found.in_unit_space(&frame) };
    let low = |corners: &[DVec3; 3]| corners.iter().all(|corner| corner.y < frame.centre_model.y);
    let section_of: Vec<u32> = scene.soup.corners_model.iter().map(|corners| u32::from(low(corners))).collect();
    assert!(section_of.contains(&0) && section_of.contains(&1));
    let bounds = found.bounds;
    let (origins, section_of) = (&scene.origins, &section_of);
    let request =
        AssetRequest { input: &input, out_dir: &out, stem: "m", frame: &frame, bounds, set: &set, origins, section_of };
    asset::write(&request).unwrap().model
}

#[test]
fn sections_are_drawn_with_their_own_planes() {
    let folder = tempfile::tempdir().unwrap();
    let words = ["--light", "-30,60", "--view", "20,35"];
    let mask = |asset: &Path| picture(asset, &[&["--mode", "mask"], &words[..]].concat());
    let fitted = small_asset(folder.path());
    let [with, without] = [&[0][..], &[]].map(|reads| mask(&two_sections(&fitted, reads)));
    let one = mask(&fitted);
    assert_eq!(difference(&one, &with), 0.0, "the plate itself has no shadow");
    assert!(share(&with, |[r, g, ..]| g == 255 && r < 128) > 0.003);
    assert_eq!(share(&without, |[r, g, ..]| g == 255 && r < 255), 0.0);
}

/// The program on a machine where wgpu finds nothing: no Vulkan driver, and no other interface looked at.
fn without_adapter(command: &mut Command) -> Outcome {
    let nowhere = "/nonexistent/driver.json";
    outcome(command.env("WGPU_BACKEND", "vulkan").env("VK_DRIVER_FILES", nowhere).env("VK_ICD_FILENAMES", nowhere))
}

#[test]
fn without_an_adapter_the_cpu_validates_and_draws() {
    let folder = tempfile::tempdir().unwrap();
    let mut command = program();
    command.args(["fit", "--preset", "fast", "--texture-size", "32", "-o"]).arg(folder.path());
    let outcome = without_adapter(command.arg(model("plate_over_ground")));
    assert_eq!(outcome.code, Some(0), "{outcome:?}");
    assert!(outcome.stdout.contains("cpu"), "the table does not say that the CPU drew: {outcome:?}");
    let report = crate::program::report(folder.path(), "plate_over_ground");
    assert_eq!(report["image"]["renderer"], "cpu");
    assert!(report["image"]["mask_error"].as_f64().unwrap() < 0.03, "{}", report["image"]);

    let asset = folder.path().join("plate_over_ground.shadow.glb");
    for mode in ["mask", "shaded"] {
        let by_gpu = picture(&asset, &["--mode", mode]);
        let out = folder.path().join("cpu.png");
        let mut command = program();
        command.arg("render").arg(&asset).arg("-o").arg(&out).args(["--size", &SIZE_PX.to_string(), "--mode", mode]);
        let outcome = without_adapter(&mut command);
        assert_eq!((outcome.code, outcome.stdout.as_str()), (Some(0), ""), "{outcome:?}");
        assert!(outcome.stderr.contains("drawing with the CPU"), "{outcome:?}");
        let by_cpu = image::open(&out).unwrap().into_rgba8();
        let far = by_cpu.pixels().zip(by_gpu.pixels()).filter(|(a, b)| (0..4).any(|i| a.0[i].abs_diff(b.0[i]) > 8));
        // The twins may differ along silhouettes: 100 to 200 pixels of outline in a frame of 96 squared, of which
        // `tests/parity.rs` allows a small part.
        assert!(far.count() < 50, "{mode}: the twins drew different pictures");
    }
}

#[test]
fn without_an_adapter_planes_cannot_be_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let asset = small_asset(folder.path());
    let out = folder.path().join("frame.png");
    let mut command = program();
    command.arg("render").arg(&asset).arg("-o").arg(&out).args(["--mode", "planes"]);
    let outcome = without_adapter(&mut command);
    outcome.refused(4, &["Planes", "adapter"]);
    assert!(!out.exists());
}
