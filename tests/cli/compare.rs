//! `compare`: which tables and pictures it leaves, and that they say the same and what theory says.

use crate::program::{Outcome, model, number, run};
use serde_json::Value;
use std::{collections::BTreeMap, fs, path::Path};

/// The quickest comparison: a plate over a ground.
fn compare(out: &Path, more: &[&str]) -> Outcome {
    let (model, out) = (model("plate_over_ground"), out.to_str().unwrap());
    let quick = ["--preset", "fast", "--views", "2", "--lights", "2", "--size", "128", "--frames", "2"];
    run(&[&["compare", model.to_str().unwrap(), "-o", out], &quick[..], more].concat())
}

/// Files of a folder by name, without those of the fits, which have folders of their own.
fn files_of(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).filter(|path| path.is_file());
    entries.map(|path| (path.file_name().unwrap().to_str().unwrap().to_owned(), fs::read(&path).unwrap())).collect()
}

fn rows(json: &Value) -> Vec<(String, f64)> {
    let row = |row: &Value| (row["technique"].as_str().unwrap().to_owned(), number(row, "/mask_error"));
    json["rows"].as_array().unwrap().iter().map(row).collect()
}

#[test]
fn tables_and_pictures_of_techniques() {
    let folder = tempfile::tempdir().unwrap();
    let outcome = compare(folder.path(), &["--techniques", "planes,shadow-map", "--instances", "1,3"]).ok();
    let files = files_of(folder.path());
    let text = |name: &str| std::str::from_utf8(&files[name]).unwrap().to_owned();
    let json: Value = serde_json::from_str(&text("plate_over_ground.techniques.json")).unwrap();
    assert_eq!(json["schema"], "shadowfit.comparison/1");

    // What theory says.
    let rows = rows(&json);
    let error = |name: &str| rows.iter().find(|row| row.0 == name).unwrap_or_else(|| panic!("{name}: {rows:?}")).1;
    let (none, planes) = (error("none"), error("occluder planes, 8 planes"));
    assert!(none > 0.01 && planes < 0.1 * none, "{rows:?}");
    assert!(error("shadow map 2048") < error("shadow map 128") && error("shadow map 128") < none, "{rows:?}");

    // All say the same.
    assert_eq!(outcome.stdout, text("plate_over_ground.techniques.md"));
    let csv = text("plate_over_ground.techniques.csv");
    assert_eq!(csv.lines().count(), 1 + rows.len());
    for (line, (name, error)) in csv.lines().skip(1).zip(&rows) {
        assert!(line.starts_with(&format!("\"{name}\",model,hard,{error:.5},")), "{line}");
    }
    for (name, _) in &rows {
        let picture = format!("plate_over_ground.{}.png", name.replace(", ", "-").replace(' ', "-").to_lowercase());
        assert!(files.contains_key(&picture), "{picture}");
        assert!(outcome.stdout.contains(&format!("| {name} |")), "{name}");
    }
    assert!(text("plate_over_ground.techniques.svg").contains("shadow map"));

    // Each scaling test has each technique once: plain with one and three, three tests with three.
    let scaling = json["scaling"].as_array().unwrap();
    assert_eq!(scaling.len(), 5 * 4);
    assert!(scaling.iter().all(|row| number(row, "/frame") > 0.0));
    assert_eq!(text("plate_over_ground.scaling.csv").lines().count(), 1 + scaling.len());
}

#[test]
fn an_asset_is_not_fitted_again_and_no_instances_are_no_test() {
    let folder = tempfile::tempdir().unwrap();
    let fitted = folder.path().join("fitted");
    let model = model("plate_over_ground");
    let words = ["fit", model.to_str().unwrap(), "-o", fitted.to_str().unwrap(), "--max-planes", "1"];
    run(&[&words[..], &crate::program::QUICK].concat()).ok();
    let (asset, out) = (fitted.join("plate_over_ground.shadow.glb"), folder.path().join("out"));
    let words = ["compare", asset.to_str().unwrap(), "-o", out.to_str().unwrap(), "--techniques", "planes"];
    let quick = ["--views", "1", "--lights", "1", "--size", "64", "--frames", "1", "--instances", "0"];
    run(&[&words[..], &quick].concat()).ok();
    let files = files_of(&out);
    let json: Value = serde_json::from_slice(&files["plate_over_ground.shadow.techniques.json"]).unwrap();
    let names: Vec<String> = rows(&json).into_iter().map(|row| row.0).collect();
    assert_eq!(names, ["none", "occluder planes, asset", "occluder planes, per vertex, asset"]);
    assert_eq!(json["scaling"], Value::Array(Vec::new()));
}

#[test]
fn unknown_techniques_and_missing_models_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let twice = model("plate_over_ground");
    compare(folder.path(), &[twice.to_str().unwrap()]).refused(1, &["two models", "plate_over_ground"]);
    compare(folder.path(), &["--techniques", "candles"]).refused(1, &["candles", "shadow-map"]);
    let missing = folder.path().join("missing.glb");
    run(&["compare", missing.to_str().unwrap(), "-o", folder.path().to_str().unwrap()]).refused(2, &["missing.glb"]);
}
