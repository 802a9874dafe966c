//! `--ground`: planes that cast the model's shadow on what it stands on, too.

use crate::program::{contents, fit, model, number, planes, report, run};
use serde_json::Value;
use shadowfit::scene::load;
use shadowfit_solver::{
    lights::LightDomain, mesh::Mesh, metrics::measure, plane::BakedSet, receivers::ReceiverOptions, visibility::trace,
};
use std::{fs, path::Path};

/// The report of a fit that must end well.
fn fitted(out: &Path, name: &str, more: &[&str]) -> Value {
    fit(&model(name), out, more).ok();
    report(out, name)
}

/// The set as read back, and its error on the ground that the file tells of.
fn measured(out: &Path, name: &str) -> (BakedSet, f64) {
    let mesh = Mesh::new(&load(&model(name)).unwrap().soup).unwrap();
    let set = planes(out, name).in_unit_space(&mesh.frame);
    let (ground, section) = set.ground_section().unwrap();
    let receivers = ground.sample(&mesh, &ReceiverOptions { count: 6_000, exposure_rays: 16, seed: 12 });
    let pairs = trace(&mesh, &receivers, &LightDomain::Sphere.directions(101, 8), 1.0);
    let error = measure(&set, &pairs, &vec![section; pairs.receivers]).shadow_error;
    (set, error)
}

#[test]
fn few_planes_serve_the_model_and_its_ground() {
    let folder = tempfile::tempdir().unwrap();
    let report = fitted(folder.path(), "t_shape", &["--max-planes", "3", "--ground"]);
    let (set, error) = measured(folder.path(), "t_shape");
    assert_eq!((set.planes.len(), set.model_sections(), set.sections.len()), (3, 1, 2));
    assert_eq!(number(&report, "/sections"), 1.0);
    // Measured: 0.24; the T is thick, and cuts through its middle are narrower than its shadow.
    let told = number(&report, "/ground/shadow_error");
    assert!((error - told).abs() < 0.02 && told < 0.35, "{error} measured, {told} told");
    assert!(number(&report, "/held_out/shadow_error") < 0.4, "{report}");
    assert_eq!(number(&report, "/ground/planes"), set.sections[1].len() as f64);
    assert!((1.0..=3.0).contains(&number(&report, "/ground/lookups/mean")), "{report}");
    // Metres, below the box of the model.
    let written = planes(folder.path(), "t_shape");
    let ground = written.ground.unwrap();
    let radius = 0.5 * (written.bounds.max - written.bounds.min).length();
    assert!((ground.height - written.bounds.min.y).abs() < 1e-6, "{ground:?}");
    assert!((ground.half_extent - 2.0 * radius).abs() < 1e-5, "{ground:?}, radius {radius}");
    // One section needs no labels.
    let text = String::from_utf8_lossy(&fs::read(folder.path().join("t_shape.shadow.glb")).unwrap()).into_owned();
    assert!(!text.contains("_SHADOW_SECTION") && text.contains("\"ground\":{\"section\":1,"));
}

#[test]
fn a_divided_model_is_fitted_as_without_its_ground() {
    let folder = tempfile::tempdir().unwrap();
    let [with, without] = [&["--ground"][..], &[]].map(|more| {
        let out = folder.path().join(more.concat());
        let report = fitted(&out, "t_shape", &[&["--sections", "6"], more].concat());
        (out, report)
    });
    let sections = number(&without.1, "/sections");
    assert_eq!((&with.1["held_out"], &with.1["sections"]), (&without.1["held_out"], &without.1["sections"]));
    assert_eq!((&without.1["ground"], with.1["training"].clone()), (&Value::Null, without.1["training"].clone()));
    let (set, error) = measured(&with.0, "t_shape");
    assert_eq!((set.sections.len() as f64, set.model_sections() as f64), (sections + 1.0, sections));
    assert!(error < 0.1 && !set.sections[set.model_sections()].is_empty(), "{error}");
    let active = set.active.unwrap();
    assert!(active.lists.iter().flatten().all(|list| list.len() <= 4));
    // No triangle belongs to the ground.
    let of_triangles = load(&with.0.join("t_shape.shadow.glb")).unwrap().section_of;
    assert!(of_triangles.iter().all(|section| f64::from(*section) < sections));
    for name in ["t_shape.shadow.glb", "t_shape.shadow.json"] {
        let bytes = fs::read(without.0.join(name)).unwrap();
        assert!(!String::from_utf8_lossy(&bytes).contains("\"ground\""), "{name}");
    }
}

#[test]
fn a_convex_body_casts_on_the_ground_alone() {
    let folder = tempfile::tempdir().unwrap();
    let report = fitted(folder.path(), "box", &["--ground"]);
    let (set, error) = measured(folder.path(), "box");
    assert_eq!((number(&report, "/held_out/shadow_error"), number(&report, "/sections")), (0.0, 1.0));
    assert!(error < 0.1 && set.sections[0].is_empty(), "{error}, {:?}", set.sections);
    assert_eq!(number(&report, "/planes"), number(&report, "/ground/planes"));
}

#[test]
fn one_plane_is_enough_for_a_plate() {
    let folder = tempfile::tempdir().unwrap();
    let report = fitted(folder.path(), "plate_over_ground", &["--ground", "--max-error", "0.1"]);
    assert_eq!(number(&report, "/planes"), 1.0, "{report}");
    assert!(number(&report, "/ground/shadow_error") < 0.1, "{report}");
    assert!(number(&report, "/held_out/shadow_error") < 0.1, "{report}");
}

#[test]
fn a_target_that_the_ground_misses_is_missed() {
    let folder = tempfile::tempdir().unwrap();
    let more = ["--ground", "--max-error", "0.001", "--texture-size", "8", "--max-planes", "1"];
    let outcome = fit(&model("plate_over_ground"), folder.path(), &more);
    assert_eq!(outcome.code, Some(6), "{outcome:?}");
    let report = report(folder.path(), "plate_over_ground");
    let worst = number(&report, "/ground/shadow_error").max(number(&report, "/held_out/shadow_error"));
    assert!(outcome.stderr.contains(&format!("{worst:.4}")), "{outcome:?}");
}

#[test]
fn the_ground_does_not_depend_on_the_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let [one, three] = ["1", "3"].map(|threads| {
        let out = folder.path().join(threads);
        fit(&model("t_shape"), &out, &["--ground", "--threads", threads, "--max-planes", "2"]).ok();
        contents(&out)
    });
    assert_eq!(one.len(), 4);
    for name in one.keys().filter(|name| !name.ends_with(".report.json")) {
        assert!(one[name] == three[name], "{name} depends on the number of threads");
    }
}

#[test]
fn a_ground_that_makes_no_sense_is_refused() {
    let (folder, input) = (tempfile::tempdir().unwrap(), model("box"));
    let words = |more: &[&str]| {
        let start = ["fit", input.to_str().unwrap(), "-o", folder.path().to_str().unwrap(), "--ground"];
        start.iter().chain(more).map(|word| (*word).to_owned()).collect::<Vec<_>>()
    };
    run(&words(&["--certificate"])).refused(1, &["--ground", "--certificate"]);
    run(&words(&["--lights", "cone:0,-60,20"])).refused(1, &["--ground", "cone:0,-60,20", "above the horizon"]);
    assert!(contents(folder.path()).is_empty());
}

#[test]
fn the_ground_is_drawn_with_its_shadow() {
    let folder = tempfile::tempdir().unwrap();
    fitted(folder.path(), "plate_over_ground", &["--max-planes", "2", "--ground"]);
    let asset = folder.path().join("plate_over_ground.shadow.glb");
    let draw = |more: &[&str]| {
        let out = folder.path().join("frame.png");
        let light = ["--light", "90,50", "--view", "20,50", "--mode", "mask", "--size", "128"];
        let words = [&["render", asset.to_str().unwrap(), "-o", out.to_str().unwrap()], &light[..], more].concat();
        run(&words).ok();
        image::open(out).unwrap().into_rgba8()
    };
    let count = |picture: &image::RgbaImage, is: fn([u8; 4]) -> bool| picture.pixels().filter(|p| is(p.0)).count();
    let [without, with] = [draw(&[]), draw(&["--ground"])];
    // The model's own ground is smaller than what it stands on, though the camera stands farther away.
    let covered = |picture| count(picture, |[.., b, _]| b == 255);
    assert!(covered(&with) > 3 * covered(&without) / 2, "{} {}", covered(&with), covered(&without));
    let dark = count(&with, |[r, g, ..]| g == 255 && r < 128) as f64 / covered(&with) as f64;
    assert!((0.003..0.2).contains(&dark), "{dark}");

    let plain = folder.path().join("plain");
    fitted(&plain, "plate_over_ground", &["--max-planes", "1"]);
    let asset = plain.join("plate_over_ground.shadow.glb");
    run(&["render", asset.to_str().unwrap(), "-o", "frame.png", "--ground"]).refused(1, &["--ground", "without"]);
}
