//! Every option of `fit` has its effect.

use crate::program::{fit, model, number, plane_file, planes, report};
use serde_json::Value;
use shadowfit_solver::plane::distinct;
use std::{fs, path::Path};

/// The report of a fit that must end well.
fn fitted(name: &str, more: &[&str]) -> (tempfile::TempDir, Value) {
    let folder = tempfile::tempdir().unwrap();
    fit(&model(name), folder.path(), more).ok();
    let report = report(folder.path(), name);
    (folder, report)
}

#[test]
fn no_planes_are_as_wrong_as_no_shadow() {
    let (folder, report) = fitted("t_shape", &["--max-planes", "0"]);
    for (pointer, expected) in [
        ("/planes", 0.0),
        ("/held_out/shadow_error", 1.0),
        ("/held_out/missed", 1.0),
        ("/held_out/false", 0.0),
        ("/texture_bytes", 0.0),
        ("/lookups/mean", 0.0),
    ] {
        assert_eq!(number(&report, pointer), expected, "{pointer}");
    }
    assert_eq!(planes(folder.path(), "t_shape").planes.len(), 0);
}

#[test]
fn more_planes_are_better_and_no_more_than_allowed() {
    let mut last = 1.0;
    for allowed in ["1", "2"] {
        let (folder, report) = fitted("t_shape", &["--max-planes", allowed, "--texture-size", "64"]);
        assert_eq!(planes(folder.path(), "t_shape").planes.len().to_string(), allowed);
        assert_eq!(report["planes"].to_string(), allowed);
        let error = number(&report, "/held_out/shadow_error");
        // The T has one bar and one stem, each casting about half of the shadow.
        assert!(error < last - 0.2, "{allowed} planes: {error}, one less: {last}");
        last = error;
    }
}

#[test]
fn a_target_within_reach_is_met_with_few_planes() {
    let (_folder, report) = fitted("planted_planes", &["--max-error", "0.5"]);
    let (planes, error) = (number(&report, "/planes"), number(&report, "/held_out/shadow_error"));
    assert!(error <= 0.5, "{error}");
    // The model is four plates: more than half of the shadow is those of the largest two or three.
    assert!((1.0..4.0).contains(&planes), "{planes} planes");
    assert_eq!(number(&report, "/max_error"), 0.5);
}

#[test]
fn textures_are_no_larger_than_allowed() {
    let mut largest = Vec::new();
    for size in [8, 12, 96] {
        let (folder, _) = fitted("t_shape", &["--max-planes", "2", "--texture-size", &size.to_string()]);
        let set = planes(folder.path(), "t_shape");
        let side = set.planes.iter().map(|plane| plane.texture.width.max(plane.texture.height)).max().unwrap();
        assert!(side <= size, "{side} texels for --texture-size {size}");
        largest.push(side);
    }
    // Where texels pay for their bytes they are used: an outline of straight lines needs few.
    assert!(largest[0] == 8 && largest[2] > 12, "{largest:?}");
}

/// The curve's bytes are those of the textures themselves; the atlases have room between them and power-of-two sides.
fn curve(report: &Value) -> Vec<(f64, f64, f64)> {
    let point = |p: &Value| (number(p, "/planes"), number(p, "/texture_bytes"), number(p, "/shadow_error"));
    report["curve"].as_array().unwrap().iter().map(point).collect()
}

#[test]
fn a_divided_model_has_sections_with_short_lists() {
    let (folder, report) = fitted("t_shape", &["--sections", "6", "--max-lookups", "2"]);
    assert_eq!(number(&report, "/sections"), 6.0);
    let set = planes(folder.path(), "t_shape");
    assert_eq!(set.sections.len(), 6);
    let (mean, max) = (number(&report, "/lookups/mean"), number(&report, "/lookups/max"));
    assert!(mean > 0.0 && mean <= max && max <= 2.0, "{mean} {max}");
    let active = set.active.as_ref().unwrap();
    assert!(active.lists.iter().flatten().all(|list| list.len() <= 2));
    let curve = curve(&report);
    assert!(curve.windows(2).all(|p| p[0].1 <= p[1].1), "{curve:?}");
    assert_eq!(curve[0], (0.0, 0.0, 1.0));
    assert_eq!(curve.last().unwrap().2, number(&report, "/held_out/shadow_error"));
    // One section of two lookups has two planes at most under each light; more sections have more.
    assert!(curve.last().unwrap().2 < 0.5, "{curve:?}");
}

#[test]
fn textures_fit_in_their_budget() {
    for (budget, bytes) in [("900", 900.0), ("4K", 4096.0), ("4k", 4096.0)] {
        let (folder, report) = fitted("t_shape", &["--sections", "4", "--texture-budget", budget]);
        let last = *curve(&report).last().unwrap();
        assert!(last.0 >= 1.0 && last.1 <= bytes, "{budget}: {last:?}");
        let set = planes(folder.path(), "t_shape");
        // The T is its own mirror image: its halves share textures.
        let (textures, _) = distinct(set.planes.iter().map(|plane| &plane.texture));
        assert!(2 * textures.len() <= set.planes.len());
        let texels: usize = textures.iter().map(|texture| texture.texels.len()).sum();
        assert_eq!(texels as f64, last.1, "{budget}");
    }
}

#[test]
fn a_model_is_whole_where_a_few_planes_explain_it_or_their_number_is_given() {
    for (name, more, sections) in [
        ("plate_over_ground", &[][..], 1.0),
        ("box", &[], 1.0),
        ("t_shape", &["--max-planes", "3"], 1.0),
        ("t_shape", &["--sections", "1"], 1.0),
        ("t_shape", &["--sections", "3", "--max-planes", "5"], 3.0),
    ] {
        let (_folder, report) = fitted(name, more);
        assert_eq!(number(&report, "/sections"), sections, "{name} {more:?}");
        if let ["--sections", _, "--max-planes", most] = more {
            assert!(number(&report, "/planes") <= most.parse().unwrap(), "{report}");
        }
    }
}

#[test]
fn lights_come_from_their_domain() {
    for (domain, axis, cos) in [
        ("hemisphere", [0.0, 1.0, 0.0], 0.0),
        ("cone:90,30,20", [30_f64.to_radians().cos(), 0.5, 0.0], 20_f64.to_radians().cos()),
        ("cone:0,-90,15", [0.0, -1.0, 0.0], 15_f64.to_radians().cos()),
    ] {
        let (_folder, report) = fitted("t_shape", &["--lights", domain, "--max-planes", "1", "--texture-size", "32"]);
        assert_eq!(report["light_domain"], domain);
        let worst = &report["held_out"]["worst_light"]["direction"];
        let towards_axis: f64 = (0..3).map(|i| worst[i].as_f64().unwrap() * axis[i]).sum();
        // Rounding of f32 directions.
        assert!(towards_axis >= cos - 1e-6, "{domain}: {worst}");
        assert!(number(&report, "/held_out/shadow_error") < 1.0, "{domain}");
    }
}

/// Plane file, model, planes, and the most error that they may leave.
const BY_HAND: [(&str, &str, usize, f64); 4] = [
    // The exact answers: what remains are the texels on the outlines, at 64 texels a side.
    ("plate_over_ground", "plate_over_ground", 1, 0.04),
    ("planted_planes", "planted_planes", 4, 0.06),
    // Rough answers: better than no shadow, by half of what they reach.
    ("teapot-by-hand", "teapot", 11, 0.8),
    ("aircraft-thesis", "aircraft", 3, 0.8),
];

#[test]
fn planes_placed_by_hand_are_baked_where_they_are() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("models/planes");
    assert_eq!(fs::read_dir(&folder).unwrap().count(), BY_HAND.len(), "a plane file without a test");
    for (file, name, count, limit) in BY_HAND {
        let path = plane_file(file);
        let given: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
        let (folder, report) = fitted(name, &["--planes", &path, "--texture-size", "64"]);
        assert_eq!(number(&report, "/planes") as usize, count, "{file}");
        let error = number(&report, "/held_out/shadow_error");
        assert!(error < limit, "{file}: {error}");
        assert_inside(&planes(folder.path(), name).planes, &given["planes"], file);
    }
}

/// Every baked rectangle lies in the plane that was given, and within it but for its open ring of texels.
fn assert_inside(planes: &[shadowfit::asset::ModelPlane], given: &Value, file: &str) {
    let vector = |value: &Value| glam::DVec3::from([0, 1, 2].map(|i| value[i].as_f64().unwrap()));
    for (i, baked) in planes.iter().enumerate() {
        let [origin, u, v] = ["origin", "uAxis", "vAxis"].map(|member| vector(&given[i][member]));
        let (normal, rectangle) = (u.cross(v).normalize(), &baked.rectangle);
        let size = u.length().max(v.length());
        // Two texels of 64, for the ring.
        let margin = 2.0 / 64.0;
        for (a, b) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
            let corner = rectangle.origin + a * rectangle.u_axis + b * rectangle.v_axis - origin;
            let (along_u, along_v) = (corner.dot(u) / u.length_squared(), corner.dot(v) / v.length_squared());
            // f32 in unit space, for rectangles a little larger than the model.
            assert!(corner.dot(normal).abs() < 1e-6 * size, "{file}: plane {i} has left its plane");
            for along in [along_u, along_v] {
                let overlap = margin * size / u.length().min(v.length());
                assert!((-overlap..=1.0 + overlap).contains(&along), "{file}: plane {i} ends at {along}");
            }
        }
    }
}

#[test]
fn plane_files_that_are_wrong_end_with_3() {
    let folder = tempfile::tempdir().unwrap();
    let [file, out] = ["p.json", "out"].map(|name| folder.path().join(name));
    let rectangle = r#""origin":[0,0.5,0],"uAxis":[1,0,0],"vAxis":[0,0,1]"#;
    for (text, word) in [
        ("planes".to_owned(), "not JSON"),
        ("{}".to_owned(), "planes"),
        (format!(r#"{{"planes":[{{{rectangle},"colour":"red"}}]}}"#), "colour"),
        (format!(r#"{{"plains":[{{{rectangle}}}]}}"#), "plains"),
        (format!(r#"{{"planes":[{{{rectangle}}},{{{rectangle},"side":"left"}}]}}"#), "/planes/1"),
        (r#"{"planes":[{"origin":[0,0,0],"uAxis":[1,0,0],"vAxis":[2,0,0]}]}"#.to_owned(), "parallel"),
        (r#"{"planes":[{"origin":[0,0],"uAxis":[1,0,0],"vAxis":[0,0,1]}]}"#.to_owned(), "/planes/0"),
        (r#"{"planes":[{"origin":[0,1e999,0],"uAxis":[1,0,0],"vAxis":[0,0,1]}]}"#.to_owned(), "p.json"),
    ] {
        fs::write(&file, &text).unwrap();
        fit(&model("box"), &out, &["--planes", file.to_str().unwrap()]).refused(3, &[file.to_str().unwrap(), word]);
        assert!(!out.exists(), "{text}");
    }
}

#[test]
fn outputs_for_the_khronos_validator() {
    // `tests/khronos/validate.mjs` is run on these files by ./test: without planes, with one, with eleven.
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("khronos/cli");
    let [plate, teapot] = ["plate_over_ground", "teapot-by-hand"].map(plane_file);
    for (name, more) in [
        ("box", &[][..]),
        ("plate_over_ground", &["--planes", &plate, "--texture-size", "32"]),
        ("teapot", &["--planes", &teapot, "--texture-size", "32"]),
    ] {
        fit(&model(name), &folder.join(name), more).ok();
    }
}
