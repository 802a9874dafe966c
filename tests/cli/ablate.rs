//! `ablate`: which tables it leaves, and that they say the same.

use crate::program::{Outcome, contents, model, number, plane_file, run};
use serde_json::Value;
use std::{collections::BTreeMap, fs, path::Path};

/// The quickest ablation: one plate, two planes.
fn ablate(out: &Path, more: &[&str]) -> Outcome {
    let (model, out) = (model("plate_over_ground"), out.to_str().unwrap());
    let quick = ["--preset", "fast", "--max-planes", "2", "--texture-size", "32"];
    let words = [&["ablate", model.to_str().unwrap(), "-o", out], &quick[..], more].concat();
    run(&words)
}

/// Rows of the CSV: method and planes with the other columns as numbers.
fn rows(csv: &str) -> BTreeMap<(String, usize), Vec<f64>> {
    let mut lines = csv.lines();
    assert_eq!(lines.next(), Some("method,planes,lookups,shadow_error,missed,false,texture_bytes,seconds"));
    let row = |line: &str| {
        let cells: Vec<&str> = line.split(',').collect();
        let numbers = cells[2..].iter().map(|cell| cell.parse().unwrap()).collect();
        ((cells[0].to_owned(), cells[1].parse().unwrap()), numbers)
    };
    lines.map(row).collect()
}

#[test]
fn tables_of_all_methods() {
    let folder = tempfile::tempdir().unwrap();
    let outcome = ablate(folder.path(), &["--planes", &plane_file("plate_over_ground")]).ok();
    let files = contents(folder.path());
    let names: Vec<&str> = files.keys().map(String::as_str).collect();
    assert_eq!(names, ["plate_over_ground.ablation.csv", "plate_over_ground.ablation.json"]);
    let rows = rows(std::str::from_utf8(&files[names[0]]).unwrap());
    let json: Value = serde_json::from_slice(&files[names[1]]).unwrap();

    // One plane is the answer: the search and the hand find it, and the plane is the plate.
    let error = |method: &str, planes| rows[&(method.to_owned(), planes)][1];
    for method in ["shadowfit", "without refinement", "without re-bake", "coverage only", "placed by hand"] {
        assert!(error(method, 1) < 0.1, "{method}: {rows:?}");
    }
    assert!(!rows.contains_key(&("placed by hand".to_owned(), 2)), "{rows:?}");
    for method in ["billboard cloud", "stochastic billboards", "k-means"] {
        assert!(error(method, 2) < 0.1, "{method}: {rows:?}");
    }
    assert!(error("axis planes", 2) > 0.1 && error("random planes", 2) > 0.1, "{rows:?}");
    assert!(error("shadow map 128", 0) > error("shadow map 512", 0));

    // All say the same.
    let curves = ["methods", "encodings", "shadow_maps"].iter().flat_map(|list| json[list].as_array().unwrap());
    let mut points = 0;
    for curve in curves {
        let method = curve["method"].as_str().unwrap();
        assert!(outcome.stdout.contains(method), "{method} is missing in {}", outcome.stdout);
        for point in curve["points"].as_array().unwrap() {
            let planes = point["planes"].as_u64().unwrap() as usize;
            let columns = ["/lookups", "/shadow_error", "/missed", "/false", "/texture_bytes", "/seconds"];
            for (column, cell) in columns.iter().zip(&rows[&(method.to_owned(), planes)]) {
                assert!((number(point, column) - cell).abs() <= 0.005, "{method} {planes} {column}");
            }
            assert!((number(point, "/missed") + number(point, "/false") - number(point, "/shadow_error")).abs() < 1e-9);
            points += 1;
        }
    }
    assert_eq!(points, rows.len());
    assert_eq!(json["schema"], "shadowfit.ablation/1");
    assert_eq!(json["version"], env!("CARGO_PKG_VERSION"));
    assert!(json["command"].as_str().unwrap().contains("--max-planes 2"));
    assert_eq!((number(&json, "/seed"), number(&json, "/held_out/lights")), (1.0, 307.0));
    // One plane needs no division: nothing to switch off, and that is said.
    assert_eq!(json["not_measured"], serde_json::json!(["sections: the model is left whole"]));
    assert!(outcome.stdout.contains("not part of this fit: sections"), "{}", outcome.stdout);
    // Smaller textures are worse, and a distance field is the better small one.
    assert!(error("coverage 32", 1) > error("coverage 128", 1), "{rows:?}");
    assert!(error("distance fields 32", 1) < error("coverage 32", 1), "{rows:?}");
}

#[test]
fn rows_of_a_divided_model() {
    let folder = tempfile::tempdir().unwrap();
    ablate(folder.path(), &["--sections", "2"]).ok();
    let files = contents(folder.path());
    let rows = rows(std::str::from_utf8(&files["plate_over_ground.ablation.csv"]).unwrap());
    let divided = ["2 sections", "2 sections: coverage only", "2 sections: without re-bake"];
    let divided = divided.iter().chain(&["2 sections: no active lists", "2 sections around random points"]);
    for method in divided.chain(&["1 section", "3 sections"]) {
        let of_method: Vec<&Vec<f64>> =
            rows.iter().filter(|((name, _), _)| name == method).map(|(_, row)| row).collect();
        let [row] = of_method[..] else { panic!("{method}: {rows:?}") };
        assert!(row[0] <= 4.0 && row[1] < 0.2, "{method}: {row:?}");
    }
    let encoded = rows.keys().filter(|(name, _)| name.starts_with("2 sections: distance fields ")).count();
    assert_eq!(encoded, 3, "{rows:?}");
}

#[test]
fn refusals_leave_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    for words in [&["--max-planes", "0"][..], &["--lights", "disc"], &["--json"]] {
        let outcome = ablate(&out, words);
        assert_eq!((outcome.code, outcome.stdout.as_str()), (Some(1), ""), "{words:?}: {outcome:?}");
    }
    ablate(&out, &["--planes", "/nonexistent/p.json"]).refused(2, &["/nonexistent/p.json"]);
    assert!(!out.exists());
    // Planes where the table would go.
    let planes = folder.path().join("plate_over_ground.ablation.json");
    fs::copy(plane_file("plate_over_ground"), &planes).unwrap();
    let outcome = ablate(folder.path(), &["--planes", planes.to_str().unwrap()]);
    outcome.refused(2, &[planes.to_str().unwrap()]);
    assert_eq!(contents(folder.path()).len(), 1);
}
